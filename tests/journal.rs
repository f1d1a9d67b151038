//! Work survives a kill, a full disk and another start: processes that paint are killed, and what they had finished is always
//! recovered, to the last point.
#![cfg(unix)]

use anisomap::convention::MapInfo;
use anisomap::export::Export;
use anisomap::export::exr::{Precision, write_master};
use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Wrap};
use anisomap::paint::{Brush, Point, Stroke};
use anisomap::recipe::{RecipeFile, Source};
use anisomap::studio::{Base, Edit, Journal, LayerHead, LeftBehind, Options, Studio, left_behind};
use glam::Vec2;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const FOLDER: &str = "ANISOMAP_TEST_FOLDER";
const KILLS: u64 = 50;
/// Strokes whose recipe is far over 20 blocks.
const MANY: u32 = 1000;
/// A place in a folder that is read-only even to the superuser.
const READ_ONLY: &str = "/sys/work.toml";
const TEXT: &str = "version = 1\nsize = 128\n[[layers]]\nname = 'paint'\n[layers.strokes]\npacked = []\nbrushes = []\n";

fn options(folder: &Path) -> Options {
    Options {
        journals: Some(folder.to_owned()),
        ..Options::default()
    }
}

fn brush() -> Arc<Brush> {
    Arc::new(Brush {
        radius: 0.02,
        ..Brush::default()
    })
}

/// Stroke number `n` of everybody who paints here: no two are the same.
fn points(n: u32) -> impl Iterator<Item = Point> {
    let at = move |i: u32| {
        Vec2::new(
            0.05 * i as f32,
            (n % 977) as f32 / 977.0 + 0.001 * (i % 3) as f32,
        )
    };
    (0..20).map(move |i| Point::new(at(i), 1.0 - 0.01 * i as f32).expect("finite"))
}

fn stroke(n: u32) -> Arc<Stroke> {
    Arc::new(Stroke::new(brush(), n, points(n)).expect("points"))
}

/// Paints stroke after stroke, and says so after each, and what went wrong before it, until it is killed.
fn paint(folder: &Path) -> ! {
    let file = RecipeFile::parse(TEXT, "t.toml", None).expect("a recipe");
    let mut studio = Studio::new(file, None, options(folder)).expect("a studio");
    studio.settle();
    let brush = brush();
    let mut out = std::io::stdout();
    for n in 0..u32::MAX {
        studio
            .begin_stroke(brush.clone(), n)
            .expect("a layer of strokes");
        for point in points(n) {
            studio.stroke_to(point);
        }
        studio.end_stroke().expect("room");
        for error in studio.take_trouble() {
            writeln!(out, "trouble: {error}").expect("somebody listens");
        }
        writeln!(out, "{}", n + 1).expect("somebody listens");
        out.flush().expect("somebody listens");
    }
    unreachable!("it is killed")
}

/// Recovers what lies in a folder, and tells how many changes there were, in how many milliseconds, with how many threads and
/// kibibytes.
fn recover(folder: &Path) {
    let start = Instant::now();
    let (mut found, errors) = left_behind(folder);
    assert!(errors.is_empty() && found.len() == 1, "{errors:?}");
    let (studio, changes) = Studio::recover(found.remove(0), options(folder)).expect("work");
    let took = start.elapsed().as_millis();
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let of = |key: &str| {
        let line = status.lines().find_map(|l| l.strip_prefix(key));
        let word = line.and_then(|l| l.split_whitespace().next().map(str::to_owned));
        word.unwrap_or_else(|| "0".to_owned())
    };
    println!("{changes} {took} {} {}", of("Threads:"), of("VmHWM:"));
    drop(studio); // as a kill would
}

/// A studio with so many strokes in it.
fn painted(folder: &Path, strokes: u32) -> Studio {
    let file = RecipeFile::parse(TEXT, "t.toml", None).expect("a recipe");
    let mut studio = Studio::new(file, None, options(folder)).expect("a studio");
    for n in 0..strokes {
        let edit = Edit::AddStroke {
            layer: 0,
            mask: false,
            stroke: stroke(n),
        };
        studio.edit("Stroke", vec![edit], None).expect("room");
    }
    studio
}

/// Saves much work where only little may be written, over a file and beside it, and exports it: all three fail, and the work is
/// still there.
fn save(folder: &Path) {
    let mut studio = painted(&folder.join("journals"), MANY);
    // A folder that nobody may write into, whoever runs this, is there besides.
    for path in [
        folder.join("kept.toml"),
        folder.join("new.toml"),
        READ_ONLY.into(),
    ] {
        let error = studio.save(&path).expect_err("no room");
        println!("\nsaving: {} {error}", error.exit_code());
        assert!(studio.document().is_changed(), "it is not saved");
        assert_eq!(strokes(&studio), MANY as usize);
    }
    assert!(studio.undo().expect("a step") && studio.redo().expect("a step"));
    assert_eq!(strokes(&studio), MANY as usize);
    let size = Size::new(512, 512).expect("a size");
    let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
    for (i, alpha) in map.region_mut().alpha_x.iter_mut().enumerate() {
        // Nothing that could be packed.
        *alpha = 0.1 + (i as f32 * 0.618_034).fract();
    }
    let info = MapInfo::default();
    for name in ["kept.exr", "new.exr"] {
        let export = Export::new(&map, &info);
        let error = write_master(&folder.join(name), &export, Precision::Float);
        let error = error.expect_err("no room");
        println!("\nexport: {} {error}", error.exit_code());
    }
}

/// Not a test of its own: what the tests below start and kill.
#[test]
fn painter() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        paint(Path::new(&folder));
    }
}

/// Not a test of its own either.
#[test]
fn recoverer() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        recover(Path::new(&folder));
    }
}

/// Nor this one.
#[test]
fn saver() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        save(Path::new(&folder));
    }
}

/// This program as another process, which does one of the three above; run by `shell` words, if any.
fn start(what: &str, folder: &Path, shell: &str) -> Child {
    Command::new("sh")
        .arg("-c")
        .arg(format!("{shell} exec \"$@\""))
        .arg("sh")
        .arg(std::env::current_exe().expect("this test"))
        .args(["--exact", what, "--nocapture"])
        .env(FOLDER, folder)
        .stdout(Stdio::piped())
        .spawn()
        .expect("itself")
}

fn lines(child: &mut Child) -> impl Iterator<Item = String> + use<> {
    let out = BufReader::new(child.stdout.take().expect("piped"));
    out.lines().map_while(Result::ok)
}

/// Kills a painter after a while; gives how many strokes it said it had finished.
fn killed(folder: &Path, after: Duration) -> usize {
    let mut child = start("painter", folder, "");
    let mut lines = lines(&mut child).filter_map(|l| {
        assert!(!l.starts_with("trouble"), "{l}");
        l.parse::<usize>().ok()
    });
    let first = lines.next().expect("a first stroke");
    std::thread::sleep(after);
    child.kill().expect("SIGKILL");
    child.wait().expect("it ended");
    // What it said before it was killed is still in the pipe.
    lines.last().unwrap_or(first)
}

#[track_caller]
fn only_one(folder: &Path) -> LeftBehind {
    let (mut found, errors) = left_behind(folder);
    assert!(errors.is_empty(), "{errors:?}");
    assert_eq!(found.len(), 1);
    found.remove(0)
}

/// How many strokes a document has, which are the first ones.
#[track_caller]
fn strokes(studio: &Studio) -> usize {
    let Source::Strokes(strokes) = &studio.recipe().layers[0].source else {
        panic!("no layer of strokes");
    };
    for (n, there) in strokes.strokes.iter().enumerate() {
        assert_eq!(*there, stroke(n as u32), "stroke {n}");
    }
    strokes.strokes.len()
}

#[test]
fn a_kill_at_any_moment_costs_at_most_the_stroke_in_flight() {
    let root = tempfile::tempdir().expect("a folder");
    for kill in 0..KILLS {
        let folder = root.path().join(kill.to_string());
        // Moments spread over a few strokes, to a fraction of a write.
        let micros = kill.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 50;
        let done = killed(&folder, Duration::from_micros(micros));
        let (mut studio, _) =
            Studio::recover(only_one(&folder), options(&folder)).expect("readable work");
        assert!(studio.take_trouble().is_empty(), "kill {kill}");
        let n = strokes(&studio);
        assert!(
            n == done || n == done + 1,
            "kill {kill}: {n} strokes of {done} that were finished"
        );
    }
}

#[test]
fn a_disk_that_fills_keeps_what_was_written_and_stops_nobody() {
    let folder = tempfile::tempdir().expect("a folder");
    // No file of it may have more than 20 blocks, as on a disk that is full from then on.
    let mut child = start("painter", folder.path(), "trap '' XFSZ; ulimit -f 20;");
    let mut lines = lines(&mut child);
    let mut done = 0;
    let mut trouble = String::new();
    for line in &mut lines {
        match line.parse::<usize>() {
            Ok(n) => done = n,
            Err(_) if line.starts_with("trouble") => {
                trouble = line;
                break;
            }
            Err(_) => {}
        }
    }
    assert!(trouble.contains("save the work"), "{trouble}");
    let after: Vec<String> = lines.by_ref().take(10).collect();
    let counted: Vec<String> = (done + 1..=done + 10).map(|n| n.to_string()).collect();
    assert_eq!(after, counted, "it paints on, and tells it once");
    child.kill().expect("SIGKILL");
    child.wait().expect("it ended");
    let left = only_one(folder.path());
    assert_eq!(left.damage, None);
    let (studio, changes) = Studio::recover(left, Options::default()).expect("readable work");
    let n = strokes(&studio);
    assert!(n >= done && n as u64 == changes, "{n} of {done}");
}

#[test]
fn a_full_disk_fails_to_save_and_export_and_spoils_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("kept.toml"), TEXT).expect("room");
    std::fs::write(path("kept.exr"), "before").expect("room");
    let mut child = start("saver", folder.path(), "trap '' XFSZ; ulimit -f 20;");
    let said: Vec<String> = lines(&mut child).collect();
    assert!(child.wait().expect("it ended").success(), "{said:?}");
    for (what, name) in [
        ("saving: 3", "kept.toml"),
        ("saving: 3", "new.toml"),
        #[cfg(target_os = "linux")]
        ("saving: 3", READ_ONLY),
        ("export: 3", "kept.exr"),
        ("export: 3", "new.exr"),
    ] {
        let told = |l: &String| l.starts_with(what) && l.contains(name);
        assert!(said.iter().any(told), "{what} {name}: {said:?}");
    }
    assert_eq!(
        std::fs::read_to_string(path("kept.toml")).expect("text"),
        TEXT
    );
    assert_eq!(std::fs::read(path("kept.exr")).expect("bytes"), b"before");
    let mut there: Vec<_> = std::fs::read_dir(folder.path())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    there.sort();
    assert_eq!(there, ["journals", "kept.exr", "kept.toml"], "no halves");
}

/// Says that it is over when it goes, by a panic too: others wait for that.
struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn windows_that_start_together_take_nothing_from_each_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = Base {
        text: TEXT.to_owned(),
        ..Base::default()
    };
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    let (found, errors) = left_behind(folder.path());
                    assert!(found.is_empty() && errors.is_empty(), "{errors:?}");
                }
            });
        }
        let _end = End(&over);
        for n in 0..2000 {
            let mut journal = Journal::begin(folder.path(), &base).expect("a journal");
            let edit = Edit::AddStroke {
                mask: false,
                layer: 0,
                stroke: stroke(n),
            };
            journal.write(&edit).expect("its file");
            assert!(journal.path().exists(), "journal {n} was removed");
            journal.end();
        }
    });
}

/// A journal of many strokes, and of a slider that was dragged after them.
fn long_journal(folder: &Path, strokes: u32, drags: u32) {
    let base = Base {
        text: TEXT.to_owned(),
        ..Base::default()
    };
    let mut journal = Journal::begin(folder, &base).expect("a journal");
    for n in 0..strokes {
        let stroke = stroke(n);
        let edit = Edit::AddStroke {
            layer: 0,
            mask: false,
            stroke,
        };
        journal.write(&edit).expect("room");
    }
    let file = RecipeFile::parse(TEXT, "t.toml", None).expect("a recipe");
    for n in 0..drags {
        let head = Box::new(LayerHead {
            opacity: 1.0 - 0.5 * n as f32 / drags as f32,
            ..LayerHead::of(&file.recipe().layers[0])
        });
        journal.write(&Edit::SetHead { at: 0, head }).expect("room");
    }
}

/// What [`recover`] told.
fn recovered(folder: &Path) -> [u64; 4] {
    let mut child = start("recoverer", folder, "");
    let said: Vec<String> = lines(&mut child).collect();
    assert!(child.wait().expect("it ended").success());
    let numbers = said.iter().find_map(|line| {
        let numbers: Option<Vec<u64>> = line.split(' ').map(|w| w.parse().ok()).collect();
        <[u64; 4]>::try_from(numbers?).ok()
    });
    numbers.unwrap_or_else(|| panic!("it says what it found: {said:?}"))
}

#[test]
fn much_work_is_recovered_soon_and_in_little_memory() {
    let root = tempfile::tempdir().expect("a folder");
    let folder = |n: u32| -> PathBuf { root.path().join(n.to_string()) };
    let mut kibibytes = [0; 2];
    for (i, n) in [1, 6000].into_iter().enumerate() {
        long_journal(&folder(n), n, 1000);
        let [changes, milliseconds, threads, peak] = recovered(&folder(n));
        assert_eq!(changes, u64::from(n) + 1000);
        // Seconds where it was a fraction of one: other work may go on here.
        assert!(milliseconds < 8000, "{n} strokes took {milliseconds} ms");
        assert!(threads < 100, "{threads} threads");
        kibibytes[i] = peak;
    }
    let more = kibibytes[1].saturating_sub(kibibytes[0]);
    assert!(more < 200 << 10, "{more} KiB more for 6000 strokes");
    // It is in a journal again.
    let (studio, changes) =
        Studio::recover(only_one(&folder(6000)), Options::default()).expect("work");
    assert_eq!((strokes(&studio), changes), (6000, 7000));
    let left = {
        let folder = folder(2);
        long_journal(&folder, 3, 0);
        only_one(&folder)
    };
    let brushes: Vec<_> = left
        .edits
        .iter()
        .filter_map(|edit| match edit {
            Edit::AddStroke { stroke, .. } => Some(stroke.brush()),
            _ => None,
        })
        .collect();
    assert!(brushes.len() == 3 && brushes.iter().all(|b| Arc::ptr_eq(b, brushes[0])));
}
