//! On what was measured: numbers of time mean nothing without it.

use crate::math;
use serde::Serialize;
use std::fs;

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
    /// The commit that the program was built from, twelve digits; `-dirty` behind them where its sources differed, and
    /// `unknown` where there was no git. `build.rs` asks for it.
    pub commit: &'static str,
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
            commit: env!("ANISOMAP_BUILT_FROM"),
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

    /// All of it, and the command that measured, as the pages have it.
    pub(super) fn signature(&self, command: &str) -> String {
        format!(
            "{}; {}; anisomap {} (commit {}), {} build; `{command}`.",
            self.line(),
            self.system,
            self.version,
            self.commit,
            self.build
        )
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

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_signature_says_which_build_measured_on_what_and_how() {
        let here = Machine::here();
        let text = here.signature("anisomap chart -o DIR");
        for part in [
            &here.cpu,
            &here.simd,
            &here.system,
            here.commit,
            here.build,
            "`anisomap chart -o DIR`",
        ] {
            assert!(!part.is_empty() && text.contains(part), "{part}: {text}");
        }
    }
}
