# For scripts that drive the real window: a display of its own with software GL, and a hand on it. To be sourced, with $out (where
# pictures go) and $tool (the binary) set; leaves $work, a folder that goes at the end.

if ! command -v Xvfb >/dev/null || ! command -v xdotool >/dev/null || ! command -v import >/dev/null; then
  apt-get update -qq
  apt-get install -y -qq --no-install-recommends xvfb xdotool imagemagick libgl1 libglx-mesa0 libgl1-mesa-dri libx11-6 \
    libx11-xcb1 libxcb1 libxcursor1 libxi6 libxrender1 libxfixes3 libxkbcommon0 libxkbcommon-x11-0 >/dev/null
fi

work=$(mktemp -d)
display=
server=
window=
finish() {
  if [ -n "$window" ]; then kill "$window" 2>/dev/null || true; fi
  if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; fi
  rm -rf "$work"
}
trap finish EXIT

# A free display: the server itself says which.
exec 3<>"$work/display"
Xvfb -displayfd 3 -screen 0 1440x900x24 -nolisten tcp >/dev/null 2>&1 &
server=$!
for _ in $(seq 100); do
  display=$(cat "$work/display")
  if [ -n "$display" ]; then break; fi
  sleep 0.1
done
export DISPLAY=":$display" LIBGL_ALWAYS_SOFTWARE=1 ANISOMAP_CONFIG="$work/config"
unset WAYLAND_DISPLAY DBUS_SESSION_BUS_ADDRESS

# The window, once it is there and has drawn what it opens.
start() {
  rm -rf "$ANISOMAP_CONFIG"/recovery
  again "$@"
}

# The same with what an end before left behind.
again() {
  "$tool" "$@" 2>"$work/stderr" &
  window=$!
  for _ in $(seq 150); do
    id=$(xdotool search --onlyvisible --pid "$window" 2>/dev/null | head -1 || true)
    if [ -n "$id" ]; then
      xdotool windowmove "$id" 0 0 windowsize "$id" 1440 900 windowfocus "$id" 2>/dev/null || true
      at_rest
      return
    fi
    kill -0 "$window" 2>/dev/null || { cat "$work/stderr"; echo "the window did not open"; exit 1; }
    sleep 0.1
  done
  echo "no window within 15 s"
  exit 1
}

# Ends the window without asking.
stop() {
  kill "$window"
  wait "$window" 2>/dev/null || true
  window=
}

# Waits until the window has nothing more to do: the map is made, and the picture is as good as it gets. 20 s at most.
at_rest() {
  local before now still=0
  before=$(ticks)
  for _ in $(seq 100); do
    sleep 0.2
    now=$(ticks)
    if [ $((now - before)) -le 1 ]; then still=$((still + 1)); else still=0; fi
    if [ "$still" -ge 3 ]; then return; fi
    before=$now
  done
}

# Hundredths of a second that the window has computed.
ticks() { awk '{ print $14 + $15 }' "/proc/$window/stat" 2>/dev/null || echo 0; }

# From left to right over the canvas, in steps as a hand moves.
stroke() {
  xdotool mousemove "$1" "$2" mousedown 1
  for i in $(seq 1 20); do
    xdotool mousemove $(($1 + ($3 - $1) * i / 20)) $(($2 + ($4 - $2) * i / 20))
    sleep 0.02
  done
  xdotool mouseup 1
  sleep 0.2
}

# The whole window as a PNG file of DIR.
picture() { import -window root "$out/$1.png"; }
