//! The program: its commands, and what they print.
//!
//! `arguments` has the commands as typed; `dispatch` says which file carries out
//! which. Results go to standard output (`printing`), progress to standard error
//! (`terminal`); exit codes stand in `exit`. Packages for other languages call the commands
//! without a terminal ([`call`]).

mod allocator;
mod arguments;
mod calling;
mod cluster;
mod comparing;
mod configuration;
mod demo;
mod exit;
mod inputs;
mod inspecting;
mod manual;
mod measuring;
mod numbers;
mod options;
mod printing;
mod proposing;
mod rendering;
mod running;
mod scans;
mod signals;
mod simulating;
mod slurm;
mod terminal;

use std::{ffi::OsString, sync::Once};

use clap::{CommandFactory, Parser};

use crate::job::JobError;
use arguments::{Arguments, Command, EXAMPLES};
use printing::say;

pub use calling::call;

/// Runs the program as the only work of this process, with `arguments`, the first of which is its
/// name, and returns its exit code.
///
/// A second Ctrl-C ends the process, and so does the first if the work does not stop within a
/// second.
pub fn run_process(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    allocator::own_process();
    report_no_panics_of_decoders();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if arguments.len() <= 1 {
        say!(
            "{}\n\n{EXAMPLES}",
            Arguments::command()
                .get_about()
                .map(ToString::to_string)
                .unwrap_or_default()
        );
        return exit::USAGE;
    }
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are "errors" that go to standard output, with exit code 0. What
            // cannot be printed cannot be reported either.
            drop(error.print());
            return u8::try_from(error.exit_code()).unwrap_or(exit::USAGE);
        }
    };
    match dispatch(arguments.command) {
        Ok(_) if !printing::is_complete() => exit::FAILED,
        Ok(code) => code,
        Err(error) => {
            say!("lloydar: {error}");
            exit::code_of(&error)
        }
    }
}

/// Panics of decoders on damaged files become errors with the name of the file; their own
/// messages would only confuse.
fn report_no_panics_of_decoders() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !crate::las::is_decoding() {
                report(panic);
            }
        }));
    });
}

/// Carries out `command` and returns the exit code.
fn dispatch(command: Command) -> Result<u8, JobError> {
    match command {
        // One process.
        Command::Run {
            scans,
            output,
            restart,
        } => running::run_job(&scans, output.as_deref(), restart),
        Command::Plan {
            scans,
            output,
            json,
        } => running::plan_job(&scans, output.as_deref(), json),
        Command::Demo { output } => demo::demo(&output),

        // Many processes.
        Command::Slurm {
            slurm,
            scans,
            output,
        } => slurm::submit(&slurm, &scans, &output),
        Command::Scatter {
            scans,
            output,
            restart,
            shard,
            others,
        } => cluster::scatter(&scans, &output, restart, shard, &others),
        Command::Solve { shared, shard } => cluster::solve(&shared, shard),
        Command::Stitch {
            shared,
            shard,
            memory,
            scratch,
        } => cluster::stitch(&shared, shard, memory, scratch),
        Command::Status { dir, json, limit } => match limit {
            Some([tasks, cores]) => cluster::print_time_limit(&dir, tasks, cores),
            None => cluster::print_status(&dir, json),
        },

        // Clouds.
        Command::Measure(arguments) => measuring::print_measured(&arguments),
        Command::Compare(arguments) => comparing::print_compared(&arguments),
        Command::Render(arguments) => rendering::draw(&arguments),
        Command::Info { files, json } => inspecting::print_info(&files.paths()?, json),
        Command::Simulate { street, output } => simulating::simulate(&street, &output),

        // The program itself.
        Command::Config { config, options } => {
            configuration::print_config(config.as_deref(), &options)
        }
        Command::Completions { shell } => manual::print_completions(shell),
        Command::Man { output } => manual::write_manual(&output),
    }
}
