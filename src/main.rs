//! anisomap on the command line: a client of the library. One file a command in `cli/`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
