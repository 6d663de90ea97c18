//! The commands and their arguments, as typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use super::{
    cluster::{OtherProcesses, SharedJob, shard},
    comparing::CompareArguments,
    inputs::{DEFAULT_OUTPUT, Inputs},
    measuring::MeasureArguments,
    options::JobOptions,
    rendering::RenderArguments,
    scans::Scans,
    simulating::Simulation,
    slurm::{SlurmOptions, tasks_and_cores},
};
use crate::config::Bytes;

/// The commands to begin with.
pub(super) const EXAMPLES: &str = "\
To begin with:
  lloydar run scan.laz
        an even cloud, scan.even.copc.laz, and a report; the spacing is proposed from the scan
  lloydar plan scan.laz
        what that would take, and how many points other spacings give
  lloydar run scans/*.laz -o city.laz --spacing 5cm --memory 4GiB
        all scans of a directory as one cloud, five centimetres apart

`lloydar --help` lists the commands, `lloydar run --help` the options of a job; `lloydar demo` makes its own scan.";

/// Turns laser scans larger than memory into evenly spaced points.
#[derive(Parser)]
#[command(name = "lloydar", version, about, after_help = EXAMPLES)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
}

/// What is to be done.
#[derive(Subcommand)]
pub(super) enum Command {
    /// Resample scans: the whole job; a job that was stopped is continued. Without --spacing,
    /// --count or --ratio a spacing is proposed from the scans
    Run {
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write: .copc.laz, .laz, .las, .ply or .pcd, or a directory for
        /// --output-tiles; also at s3://, gs:// and az:// [default: SCAN.even.copc.laz for one input, else resampled.copc.laz]
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Delete what an earlier run left in the job directory, and begin anew
        #[arg(long)]
        restart: bool,
    },
    /// Print what a run would take: tiles, memory, disk, time, and the points that other
    /// spacings would give
    Plan {
        #[command(flatten)]
        scans: Scans,
        /// The cloud that would be written [default: that of `run`]
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Submit a job to Slurm: tasks that scatter, one that plans, tasks that solve tiles, one
    /// that stitches
    Slurm {
        #[command(flatten)]
        slurm: SlurmOptions,
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write
        #[arg(short, long, value_name = "FILE", default_value = DEFAULT_OUTPUT)]
        output: PathBuf,
    },
    /// First stage of a job of many processes: decode the scans and plan the tiles. With
    /// --shard this process only decodes, beside others; without, it decodes what they have
    /// left over, and plans
    Scatter {
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write in the end
        #[arg(short, long, value_name = "FILE", default_value = DEFAULT_OUTPUT)]
        output: PathBuf,
        /// Delete what an earlier run left in the job directory, and begin anew
        #[arg(long, conflicts_with = "shard")]
        restart: bool,
        /// The scans to begin with, by number and count of the processes: 0/16 to 15/16
        #[arg(long, value_name = "I/N", value_parser = shard)]
        shard: Option<(u32, u32)>,
        #[command(flatten)]
        others: OtherProcesses,
    },
    /// Second stage: solve the tiles that no other process has claimed; for any number of
    /// processes on any number of machines
    Solve {
        #[command(flatten)]
        shared: SharedJob,
        /// The tiles to begin with, by number and count of the processes: 0/16 to 15/16
        #[arg(long, value_name = "I/N", value_parser = shard)]
        shard: Option<(u32, u32)>,
    },
    /// Last stage: wait for the tiles, solve those that no process has claimed, write the
    /// cloud. With --shard this process only helps, beside others; one without completes the
    /// cloud
    Stitch {
        #[command(flatten)]
        shared: SharedJob,
        /// The parts to begin with, by number and count of the processes: 0/16 to 15/16
        #[arg(long, value_name = "I/N", value_parser = shard)]
        shard: Option<(u32, u32)>,
        /// Peak memory, if it is to be more than the job had
        #[arg(long, value_name = "SIZE")]
        memory: Option<Bytes>,
        /// A local disk for files that no other process reads [default: the job directory]
        #[arg(long, value_name = "DIR", conflicts_with = "shard")]
        scratch: Option<PathBuf>,
    },
    /// Print the progress of a job of many processes
    Status {
        /// The job directory
        #[arg(value_name = "JOB")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
        /// Print a time limit instead: the minutes in which 64 tasks with 4 cores each (64x4)
        /// should solve all tiles, by the plan, times three, plus ten
        #[arg(long, value_name = "TASKSxCORES", value_parser = tasks_and_cores)]
        limit: Option<[u32; 2]>,
    },
    /// Print the figures of uniformity of a cloud
    Measure(MeasureArguments),
    /// Compare two clouds: the figures of both side by side, and a picture
    Compare(CompareArguments),
    /// Draw a cloud: a picture in PNG
    Render(RenderArguments),
    /// Print the headers of scans, with notes on what is unusual in them
    Info {
        #[command(flatten)]
        files: Inputs,
        /// Print JSON, one line a file
        #[arg(long)]
        json: bool,
    },
    /// Write a simulated mobile-mapping street, one file a pass
    Simulate {
        #[command(flatten)]
        street: Simulation,
        /// Directory for the files
        #[arg(short, long, value_name = "DIR", default_value = "street")]
        output: PathBuf,
    },
    /// Print the options of a job as a TOML file, each with the origin of its value
    Config {
        /// Options from a TOML file; flags win
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        #[command(flatten)]
        options: Box<JobOptions>,
    },
    /// Print completions for a shell, to be stored in the shell's directory for them
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages: lloydar.1, lloydar-run.1, …
    Man {
        /// Directory for the pages
        #[arg(short, long, value_name = "DIR", default_value = "man")]
        output: PathBuf,
    },
    /// Simulate a street, resample it in 192 MiB, write a report
    Demo {
        /// Directory for everything
        #[arg(short, long, value_name = "DIR", default_value = "lloydar-demo")]
        output: PathBuf,
    },
}
