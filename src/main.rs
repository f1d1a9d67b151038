//! anisomap on the command line: a client of the library. One file a command in `cli/`.

mod cli;
#[cfg(feature = "gui")]
mod gui;

fn main() -> std::process::ExitCode {
    cli::run()
}
