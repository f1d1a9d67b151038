//! Work survives a kill: a process that paints is killed at fifty moments, and what it had finished is always recovered.
#![cfg(unix)]

use anisomap::paint::{Brush, Point};
use anisomap::recipe::{RecipeFile, Source};
use anisomap::studio::{Options, Studio, left_behind};
use glam::Vec2;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

const FOLDER: &str = "ANISOMAP_TEST_PAINTER";
const KILLS: u64 = 50;

fn options(folder: &Path) -> Options {
    Options {
        journals: Some(folder.to_owned()),
        ..Options::default()
    }
}

/// Paints stroke after stroke, and says so after each, until it is killed.
fn paint(folder: PathBuf) -> ! {
    let text = "version = 1\nsize = 128\n[[layers]]\nname = 'paint'\n[layers.strokes]\npacked = []\nbrushes = []\n";
    let file = RecipeFile::parse(text, "t.toml", None).expect("a recipe");
    let mut studio = Studio::new(file, None, options(&folder)).expect("a studio");
    studio.settle();
    let brush = Arc::new(Brush::default());
    let mut out = std::io::stdout();
    for n in 0..u32::MAX {
        studio
            .begin_stroke(brush.clone(), n)
            .expect("a layer of strokes");
        for i in 0..20 {
            let at = Vec2::new(0.05 * i as f32, (n % 20) as f32 * 0.05);
            studio.stroke_to(Point::new(at, 1.0).expect("finite"));
        }
        studio.end_stroke().expect("room");
        writeln!(out, "{}", n + 1).expect("somebody listens");
        out.flush().expect("somebody listens");
    }
    unreachable!("it is killed")
}

/// Not a test of its own: what the test below starts and kills.
#[test]
fn painter() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        paint(folder.into());
    }
}

/// Kills a painter after a while; gives how many strokes it said it had finished.
fn killed(folder: &Path, after: Duration) -> usize {
    let mut child = Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "painter", "--nocapture"])
        .env(FOLDER, folder)
        .stdout(Stdio::piped())
        .spawn()
        .expect("itself");
    let out = BufReader::new(child.stdout.take().expect("piped"));
    let mut lines = out
        .lines()
        .map_while(|l| l.ok())
        .filter_map(|l| l.parse::<usize>().ok());
    let mut done = lines.next().expect("a first stroke");
    std::thread::sleep(after);
    child.kill().expect("SIGKILL");
    child.wait().expect("it ended");
    // What it said before it was killed is still in the pipe.
    done = lines.last().unwrap_or(done);
    done
}

#[test]
fn a_kill_at_any_moment_costs_at_most_the_stroke_in_flight() {
    let root = tempfile::tempdir().expect("a folder");
    for kill in 0..KILLS {
        let folder = root.path().join(kill.to_string());
        // Moments spread over a few strokes, to a fraction of a write.
        let micros = kill.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 50;
        let done = killed(&folder, Duration::from_micros(micros));
        let (mut found, errors) = left_behind(&folder);
        assert!(errors.is_empty(), "kill {kill}: {errors:?}");
        assert_eq!(found.len(), 1, "kill {kill}");
        let (mut studio, _) =
            Studio::recover(found.remove(0), options(&folder)).expect("readable work");
        assert!(studio.take_trouble().is_empty(), "kill {kill}");
        let Source::Strokes(strokes) = &studio.recipe().layers[0].source else {
            panic!("kill {kill}: no layer of strokes");
        };
        let n = strokes.strokes.len();
        assert!(
            n == done || n == done + 1,
            "kill {kill}: {n} strokes of {done} that were finished"
        );
    }
}
