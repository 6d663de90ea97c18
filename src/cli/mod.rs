//! The commands, and what they print.

mod terminal;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
};

use clap::{Parser, Subcommand};
use lloydar::{
    config::Choices,
    pipeline::{Job, JobError, JobPlan, Quiet, default_directory},
};

use terminal::{Look, Terminal, thousands};

/// Turns laser scans larger than memory into evenly spaced points.
#[derive(Parser)]
#[command(name = "lloydar", version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Resample scans: the whole job; goes on where an earlier run stopped
    Run {
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write: .laz, .las or .ply
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Say what would be done: tiles, memory, disk, time
    Plan {
        #[command(flatten)]
        scans: Scans,
        /// The cloud that would be written
        #[arg(short, long, value_name = "FILE", default_value = "out.laz")]
        output: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

/// Inputs and options of a job.
#[derive(clap::Args)]
struct Scans {
    /// LAS and LAZ files, directories, patterns
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Options from a TOML file; flags win
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Show nothing but errors
    #[arg(short, long)]
    quiet: bool,
    /// `json`: progress as JSON lines on standard error
    #[arg(long, value_name = "FORMAT", value_parser = ["json", "text"], default_value = "text")]
    log: String,
    #[command(flatten)]
    choices: Choices,
}

/// Exit codes, as documented in the README.
const FAILED: u8 = 1;
const USAGE: u8 = 2;
const LEFT_OUT: u8 = 3;

/// Set by the first Ctrl-C or SIGTERM.
static CANCEL: AtomicBool = AtomicBool::new(false);

/// Runs the command line; the only place where a program ends.
pub(crate) fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(arguments.command) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("lloydar: {error}");
            ExitCode::from(if error.is_usage() {
                USAGE
            } else if error.is_cancelled() {
                130
            } else {
                FAILED
            })
        }
    }
}

fn run(command: Command) -> Result<u8, JobError> {
    match command {
        Command::Run { scans, output } => run_job(&scans, &output),
        Command::Plan {
            scans,
            output,
            json,
        } => plan_job(&scans, &output, json),
    }
}

/// The job that flags and file describe.
fn job(scans: &Scans, output: &Path) -> Result<Job, JobError> {
    let file = match &scans.config {
        Some(path) => Choices::from_file(path)?,
        None => Choices::default(),
    };
    let choices = scans.choices.clone().or(file);
    Ok(Job {
        inputs: scans.inputs.clone(),
        output: output.to_owned(),
        dir: choices
            .job
            .clone()
            .unwrap_or_else(|| default_directory(output)),
        settings: choices.settings()?,
        overwrite: choices.overwrite,
        keep: choices.keep_job,
    })
}

fn run_job(scans: &Scans, output: &Path) -> Result<u8, JobError> {
    let job = job(scans, output)?;
    stop_on_signals();
    let terminal = Terminal::new(Look::choose(scans.quiet, scans.log == "json"));
    let outcome = job.run(&terminal, &CANCEL)?;
    let rejected: u64 = outcome.inputs.iter().map(|input| input.rejected).sum();
    println!("{} points", outcome.points);
    Ok(if rejected > 0 { LEFT_OUT } else { 0 })
}

fn plan_job(scans: &Scans, output: &Path, json: bool) -> Result<u8, JobError> {
    let job = job(scans, output)?;
    let plan = job.plan(&Quiet, &CANCEL)?;
    if json {
        println!(
            "{}",
            serde_json::to_string_pretty(&plan).unwrap_or_default()
        );
    } else {
        print_plan(&plan);
    }
    Ok(0)
}

fn print_plan(plan: &JobPlan) {
    let mebibytes = |bytes: u64| format!("{} MiB", thousands(bytes >> 20));
    let rows = [
        ("points in", thousands(plan.points)),
        ("points out, about", thousands(plan.points_out)),
        ("spacing", format!("{:.4}", plan.spacing)),
        ("tiles", thousands(plan.plan.tiles.len() as u64)),
        ("halo", format!("{:.3}", plan.halo)),
        (
            "peak memory",
            format!("{} of {}", mebibytes(plan.memory), mebibytes(plan.budget)),
        ),
        ("temporary disk", mebibytes(plan.temporary)),
        ("time, roughly", format!("{:.0} s", plan.seconds)),
    ];
    for (name, value) in rows {
        println!("{name:<20} {value}");
    }
}

/// The first signal stops the job after the tile in hand; the second ends the
/// program as usual.
fn stop_on_signals() {
    let stop = || {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("stopping; the same command will go on from here");
    };
    // Without a handler a signal ends the program, and the job is resumable
    // all the same.
    drop(ctrlc::set_handler(stop));
}
