//! The command line of lloydar.

use std::process::ExitCode;

fn main() -> ExitCode {
    lloydar::cli::run_process(std::env::args_os()).into()
}
