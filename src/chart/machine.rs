//! On what was measured: numbers of time mean nothing without it.

use crate::math;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// The machine and the program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// The name that the processor gives itself.
    pub cpu: String,
    /// Threads that it runs at once, as far as this process may use them.
    pub cores: usize,
    /// The widest vectors that loops are compiled for here.
    pub simd: String,
    /// System and architecture.
    pub system: String,
    /// The program's version.
    pub version: String,
    /// The commit, where it is known: `ANISOMAP_COMMIT` at build time, or that of the checkout in which the program lies.
    pub commit: Option<String>,
    /// `release`, or `debug` for a build whose times say little.
    pub build: &'static str,
}

impl Machine {
    /// The one at hand.
    pub fn here() -> Self {
        let levels = math::levels();
        let name = |level| format!("{level:?}").split('(').next().map(str::to_owned);
        let used = name(math::level());
        let simd = levels.iter().find(|(_, level)| name(*level) == used);
        Self {
            cpu: cpu().unwrap_or_else(|| "unknown processor".to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            simd: simd.map_or("baseline", |(name, _)| name).to_owned(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: option_env!("ANISOMAP_COMMIT")
                .map(str::to_owned)
                .or_else(checkout),
            build: if cfg!(debug_assertions) {
                "debug"
            } else {
                "release"
            },
        }
    }

    /// In one line.
    pub fn line(&self) -> String {
        let threads = if self.cores == 1 { "thread" } else { "threads" };
        format!("{}, {} {threads}, {}", self.cpu, self.cores, self.simd)
    }
}

/// Linux says it in a file, Windows in the environment; elsewhere it would take another program to ask.
fn cpu() -> Option<String> {
    let named = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|l| l.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    named
        .or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok())
        .filter(|name| !name.is_empty())
}

/// The commit of the checkout of this program in whose folders it lies, as after `cargo run`.
fn checkout() -> Option<String> {
    let program = std::env::current_exe().ok()?;
    let root = program.ancestors().find(|folder| {
        fs::read_to_string(folder.join("Cargo.toml"))
            .is_ok_and(|text| text.contains(concat!("name = \"", env!("CARGO_PKG_NAME"), "\"")))
    })?;
    head(&root.join(".git"))
}

/// The commit that a repository stands at, read from its files.
fn head(git: &Path) -> Option<String> {
    let folder = match fs::read_to_string(git) {
        // A worktree has a file that names its folder.
        Ok(text) => git.parent()?.join(text.trim().strip_prefix("gitdir: ")?),
        Err(_) => git.to_owned(),
    };
    let head = fs::read_to_string(folder.join("HEAD")).ok()?;
    let Some(name) = head.trim().strip_prefix("ref: ") else {
        return short(&head);
    };
    let common = fs::read_to_string(folder.join("commondir"));
    let common: PathBuf = common.map_or_else(|_| folder.clone(), |c| folder.join(c.trim()));
    if let Ok(commit) = fs::read_to_string(common.join(name)) {
        return short(&commit);
    }
    let packed = fs::read_to_string(common.join("packed-refs")).ok()?;
    let line = packed.lines().find(|l| l.ends_with(&format!(" {name}")))?;
    short(line.split(' ').next()?)
}

/// Twelve digits are enough to find a commit.
fn short(commit: &str) -> Option<String> {
    let commit = commit.trim();
    let is_commit = commit.len() >= 40 && commit.bytes().all(|b| b.is_ascii_hexdigit());
    is_commit.then(|| commit[..12].to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMIT: &str = "0123456789abcdef0123456789abcdef01234567";

    #[test]
    fn a_repository_tells_its_commit_in_all_its_forms() {
        let folder = tempfile::tempdir().unwrap();
        let git = folder.path().join(".git");
        fs::create_dir_all(git.join("refs/heads")).unwrap();
        assert_eq!(head(&git), None);
        fs::write(git.join("HEAD"), format!("{COMMIT}\n")).unwrap();
        assert_eq!(head(&git).as_deref(), Some("0123456789ab"));
        fs::write(git.join("HEAD"), "ref: refs/heads/main\n").unwrap();
        assert_eq!(head(&git), None);
        fs::write(
            git.join("packed-refs"),
            format!("# x\n{COMMIT} refs/heads/main\n"),
        )
        .unwrap();
        assert_eq!(head(&git).as_deref(), Some("0123456789ab"));
        fs::write(git.join("refs/heads/main"), format!("f{COMMIT}")).unwrap();
        assert_eq!(head(&git).as_deref(), Some("f0123456789a"));
        // A worktree of it.
        let own = git.join("worktrees/other");
        fs::create_dir_all(&own).unwrap();
        fs::write(own.join("HEAD"), "ref: refs/heads/main\n").unwrap();
        fs::write(own.join("commondir"), "../..\n").unwrap();
        let tree = folder.path().join("tree");
        fs::create_dir(&tree).unwrap();
        fs::write(tree.join(".git"), format!("gitdir: {}\n", own.display())).unwrap();
        assert_eq!(head(&tree.join(".git")).as_deref(), Some("f0123456789a"));
    }

    #[test]
    fn the_machine_has_a_name_and_cores() {
        let here = Machine::here();
        assert!(here.cores >= 1 && !here.cpu.is_empty());
        assert!(
            math::levels().iter().any(|(name, _)| *name == here.simd),
            "{}",
            here.simd
        );
        assert!(here.line().contains(&here.cpu));
    }
}
