//! Puts the commit that the program is built from into it, for the numbers that `chart` measures.
//!
//! Twelve digits, with `-dirty` where what the program is made of differs from the commit, and `unknown` where there is no
//! git or no repository of this package's own (a tarball inside of somebody's repository is not that repository's). Whoever
//! builds elsewhere from a known commit may say which in the variable `ANISOMAP_COMMIT`.

use std::path::Path;
use std::process::Command;

/// What the program is made of. A change of anything else leaves it, and its commit, as they are.
const SOURCES: [&str; 5] = ["src", "presets", "build.rs", "Cargo.toml", "Cargo.lock"];

fn main() {
    println!("cargo::rerun-if-env-changed=ANISOMAP_COMMIT");
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
    let stated = std::env::var("ANISOMAP_COMMIT").unwrap_or_default();
    let commit = if stated.is_empty() {
        checkout().unwrap_or_else(|| "unknown".to_owned())
    } else {
        stated
    };
    println!("cargo::rustc-env=ANISOMAP_BUILT_FROM={commit}");
}

/// The commit of this checkout; none without git.
fn checkout() -> Option<String> {
    // A folder, or in a worktree a file that names one. Cargo runs a build script in the package's folder.
    if !Path::new(".git").exists() {
        return None;
    }
    let head = git(&["rev-parse", "HEAD"])?;
    watch();
    let mut changes = vec!["status", "--porcelain", "--"];
    changes.extend(SOURCES);
    let dirty = if git(&changes)?.is_empty() {
        ""
    } else {
        "-dirty"
    };
    Some(format!("{}{dirty}", head.get(..12)?))
}

/// Has this run again when another commit is checked out or made: both stand in the log of HEAD, and where none is kept in HEAD
/// or its branch. The index is left alone: `git status` writes it, and what is staged is seen in the sources.
fn watch() {
    watch_file("HEAD");
    if !watch_file("logs/HEAD") {
        watch_file("packed-refs");
        if let Some(branch) = git(&["symbolic-ref", "--quiet", "HEAD"]) {
            watch_file(&branch);
        }
    }
}

/// Whether git has the file. One that is not there would have cargo build everything anew each time.
fn watch_file(name: &str) -> bool {
    let path = git(&["rev-parse", "--git-path", name]).unwrap_or_default();
    let is_there = Path::new(&path).is_file();
    if is_there {
        println!("cargo::rerun-if-changed={path}");
    }
    is_there
}

/// What git prints; none where it fails or is not there.
fn git(words: &[&str]) -> Option<String> {
    let mut command = Command::new("git");
    // A hook of another repository would have git look there; and nothing is written, not even a fresher index.
    for variable in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"] {
        command.env_remove(variable);
    }
    let output = command.arg("--no-optional-locks").args(words).output();
    let output = output.ok().filter(|o| o.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim().to_owned())
}
