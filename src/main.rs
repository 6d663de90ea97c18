//! The command line of lloydar.

use std::process::ExitCode;

fn main() -> ExitCode {
    lloydar::cli::main()
}
