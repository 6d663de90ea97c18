//! The commands, and what they print.

mod allocator;
mod cluster;
mod describing;
mod printing;
mod simulating;
mod tables;
mod terminal;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use crate::{
    config::{Bytes, Choices, OnBadFile, by_name},
    job::{InputCount, JobDescription, JobError, default_directory, write_file},
    las::{InputFile, expand_inputs},
    picture::View,
    report::{REPORT_PAGE, Report, VIEWER_PAGE},
    views::{Coloring, PictureOptions, png_path, render},
};
use clap::{CommandFactory, Parser, Subcommand};

use cluster::{Cluster, Others, Sharing};
use printing::{result, say};
use simulating::Simulation;
use terminal::{Look, Terminal};

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
        /// The cloud to write: .copc.laz, .laz, .las or .ply, or a directory for
        /// --output-tiles
        #[arg(short, long, value_name = "FILE", default_value = "resampled.copc.laz")]
        output: PathBuf,
        /// Forget what an earlier run left in the job directory
        #[arg(long)]
        restart: bool,
    },
    /// Say what would be done: tiles, memory, disk, time
    Plan {
        #[command(flatten)]
        scans: Scans,
        /// The cloud that would be written
        #[arg(short, long, value_name = "FILE", default_value = "resampled.copc.laz")]
        output: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Submit a job to Slurm: a task that scatters, many that solve tiles, one that stitches
    Slurm {
        #[command(flatten)]
        cluster: Cluster,
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write
        #[arg(short, long, value_name = "FILE", default_value = "resampled.copc.laz")]
        output: PathBuf,
    },
    /// First stage of a job for many processes: decode the scans, plan the tiles. With
    /// --shard decode only, by as many processes as there are; without, decode what those
    /// have not, and plan
    Scatter {
        #[command(flatten)]
        scans: Scans,
        /// The cloud to write in the end
        #[arg(short, long, value_name = "FILE", default_value = "resampled.copc.laz")]
        output: PathBuf,
        /// Forget what an earlier run left in the job directory
        #[arg(long, conflicts_with = "shard")]
        restart: bool,
        /// Begin with these scans: which of how many processes this is, like 0/16
        #[arg(long, value_name = "I/N", value_parser = cluster::shard)]
        shard: Option<(u32, u32)>,
        #[command(flatten)]
        others: Others,
    },
    /// Second stage: solve tiles that nobody solves; by as many processes, on as many
    /// machines, as there are
    Solve {
        #[command(flatten)]
        sharing: Sharing,
        /// Begin with these tiles: which of how many processes this is, like 0/16
        #[arg(long, value_name = "I/N", value_parser = cluster::shard)]
        shard: Option<(u32, u32)>,
    },
    /// Last stage: wait for the tiles, solve what nobody does, write the cloud
    Stitch {
        #[command(flatten)]
        sharing: Sharing,
        /// Peak memory, if it is to be more than the job had
        #[arg(long, value_name = "SIZE")]
        memory: Option<Bytes>,
        /// A disk of this machine for files that nobody else reads [default: the job directory]
        #[arg(long, value_name = "DIR")]
        scratch: Option<PathBuf>,
    },
    /// Say how far a job of many processes is
    Status {
        /// The job directory
        #[arg(value_name = "JOB")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
        /// Print instead in how many minutes each of so many tasks with so many cores, like
        /// 64x4, should have solved its share, by the plan and with much to spare
        #[arg(long, value_name = "TASKSxCORES", value_parser = cluster::tasks)]
        limit: Option<[u32; 2]>,
    },
    /// Print the figures of uniformity of a cloud
    Measure {
        /// LAS, LAZ and PLY files, directories, patterns
        #[arg(required = true, value_name = "CLOUD")]
        files: Vec<PathBuf>,
        /// Scans that the cloud was made from: tells how near it is to them,
        /// and how well it covers them
        #[arg(long, num_args = 1.., value_name = "INPUT")]
        against: Vec<PathBuf>,
        /// Directory of the simulated street that the cloud was made from:
        /// tells how near it is to the true surfaces
        #[arg(long, value_name = "DIR")]
        truth: Option<PathBuf>,
        /// Peak memory
        #[arg(long, value_name = "SIZE")]
        memory: Option<Bytes>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Draw a cloud: a picture in PNG
    Render {
        /// LAS, LAZ, COPC and PLY files, directories, patterns
        #[arg(required = true, value_name = "CLOUD")]
        files: Vec<PathBuf>,
        /// The picture (.png)
        #[arg(short, long, value_name = "FILE", default_value = "cloud.png", value_parser = png_path)]
        output: PathBuf,
        /// top, oblique or street: from within, along the longer side
        #[arg(long, default_value = "oblique", value_parser = by_name::<View>)]
        view: View,
        /// auto (colour if there is one, else height), height, intensity or class
        #[arg(long, default_value = "auto", value_parser = by_name::<Coloring>)]
        by: Coloring,
        /// Pixels to the right and downwards
        #[arg(long, value_name = "WxH", default_value = "1600x900", value_parser = pixels)]
        size: [u32; 2],
        /// Diameter of the points, in CRS units [default: by how dense they are]
        #[arg(long, value_name = "LENGTH")]
        point_size: Option<f64>,
    },
    /// Print what the headers of scans say, and what is odd about them
    Info {
        /// LAS, LAZ, COPC and PLY files, directories of LAS and LAZ, patterns
        #[arg(required = true, value_name = "INPUT")]
        files: Vec<PathBuf>,
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
    /// Print the options of a job as a TOML file, each with where it comes from
    Config {
        /// Options from a TOML file; flags win
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        #[command(flatten)]
        choices: Box<Choices>,
    },
    /// Print completions for a shell, to be put where it looks for them
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages: lloydar.1, lloydar-run.1, …
    Man {
        /// Directory for them
        #[arg(short, long, value_name = "DIR", default_value = "man")]
        output: PathBuf,
    },
    /// Simulate a street, resample it under a small budget, write a report
    Demo {
        /// Directory for everything
        #[arg(short, long, value_name = "DIR", default_value = "lloydar-demo")]
        output: PathBuf,
    },
}

/// Inputs and options of a job.
#[derive(clap::Args)]
struct Scans {
    /// LAS, LAZ, COPC and PLY files, directories of LAS and LAZ, patterns
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
const STOPPED: u8 = 130;

/// Set by the first Ctrl-C or SIGTERM.
static CANCEL: AtomicBool = AtomicBool::new(false);

/// Runs the command line; the only place where a program ends.
pub fn main() -> ExitCode {
    let loud = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !crate::las::is_decoding() {
            loud(panic);
        }
    }));
    let arguments = Arguments::parse();
    match run(arguments.command) {
        Ok(_) if !printing::is_complete() => ExitCode::from(FAILED),
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            say!("lloydar: {error}");
            ExitCode::from(if error.is_usage() {
                USAGE
            } else if error.is_cancelled() {
                STOPPED
            } else {
                FAILED
            })
        }
    }
}

fn run(command: Command) -> Result<u8, JobError> {
    match command {
        Command::Run {
            scans,
            output,
            restart,
        } => run_job(&scans, &output, restart),
        Command::Plan {
            scans,
            output,
            json,
        } => plan_job(&scans, &output, json),
        Command::Slurm {
            cluster,
            scans,
            output,
        } => cluster::slurm(&cluster, &scans, &output),
        Command::Scatter {
            scans,
            output,
            restart,
            shard,
            others,
        } => cluster::scatter(&scans, &output, restart, shard, &others),
        Command::Solve { sharing, shard } => cluster::solve(&sharing, shard),
        Command::Stitch {
            sharing,
            memory,
            scratch,
        } => cluster::stitch(&sharing, memory, scratch),
        Command::Status { dir, json, limit } => match limit {
            Some([tasks, cores]) => cluster::limit(&dir, tasks, cores),
            None => cluster::status(&dir, json),
        },
        Command::Measure {
            files,
            against,
            truth,
            memory,
            json,
        } => tables::measure_cloud(&files, &against, truth.as_deref(), memory, json),
        Command::Render {
            files,
            output,
            view,
            by,
            size,
            point_size,
        } => {
            let picture = PictureOptions {
                view,
                coloring: by,
                size,
                point_size,
            };
            write_file(&output, &render(&files, &picture)?).map(|()| 0)
        }
        Command::Info { files, json } => tables::print_info(&files, json),
        Command::Config { config, choices } => {
            describing::print_config(config.as_deref(), *choices)
        }
        Command::Completions { shell } => describing::print_completions(shell),
        Command::Man { output } => describing::write_manual(&output),
        Command::Simulate { street, output } => simulating::simulate(&street, &output),
        Command::Demo { output } => simulating::demo(&output),
    }
}

fn pixels(text: &str) -> Result<[u32; 2], String> {
    let size = text.split_once('x').and_then(|(width, height)| {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
        Some([side(width)?, side(height)?])
    });
    size.ok_or_else(|| format!("`{text}` is no size; write it like 1600x900"))
}

/// What flags and file choose.
fn choices(scans: &Scans) -> Result<Choices, JobError> {
    let file = match &scans.config {
        Some(path) => Choices::from_file(path)?,
        None => Choices::default(),
    };
    Ok(scans.choices.clone().or(file))
}

/// As many threads as can work at once.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The job that flags and file describe.
fn job(scans: &Scans, output: &Path) -> Result<JobDescription, JobError> {
    let choices = choices(scans)?;
    let metres = match choices.has_units() {
        true => metres_per_unit(&scans.inputs, &choices)?,
        false => None,
    };
    let job = JobDescription {
        inputs: scans.inputs.clone(),
        output: output.to_owned(),
        dir: choices
            .job
            .clone()
            .unwrap_or_else(|| default_directory(output)),
        scratch: None,
        settings: choices.settings(metres)?,
        overwrite: choices.overwrite,
        keep: choices.keep_job,
        skip_bad_files: choices.on_bad_file == Some(OnBadFile::Skip),
        restart: false,
    };
    allocator::spare(job.memory());
    Ok(job)
}

/// Metres to a unit of the CRS that the choices give, or else the first input that states
/// one.
fn metres_per_unit(inputs: &[PathBuf], choices: &Choices) -> Result<Option<f64>, JobError> {
    if let Some(crs) = choices.crs()? {
        return Ok(crs.metres_per_unit());
    }
    // Files that cannot be read are told of later, all together.
    let files = expand_inputs(inputs)?;
    let stated = files
        .iter()
        .find_map(|path| InputFile::survey(path).ok()?.crs);
    Ok(stated.and_then(|crs| crs.metres_per_unit()))
}

fn run_job(scans: &Scans, output: &Path, restart: bool) -> Result<u8, JobError> {
    let job = JobDescription {
        restart,
        ..job(scans, output)?
    };
    let look = Look::choose(scans.quiet, scans.log == "json");
    run_and_report(&job, look)
}

/// Runs `job`, writes its report beside the output, and prints a summary.
fn run_and_report(job: &JobDescription, look: Look) -> Result<u8, JobError> {
    stop_on_signals();
    let terminal = Terminal::new(look);
    let mut summary = String::new();
    let outcome = job.run_and_report(&terminal, &CANCEL, |outcome| {
        let report = Report::new(outcome, &job.output.display().to_string(), settings(job));
        summary = report.summary();
        let pages = write_report(job, &report)?;
        for (name, path) in ["report", "viewer"].iter().zip(pages) {
            summary += &format!("{name:<9} {path}\n");
        }
        Ok(())
    })?;
    let Some(outcome) = outcome else {
        if look != Look::Nothing {
            result!("{} is complete already", job.output.display());
        }
        return Ok(0);
    };
    if look != Look::Nothing {
        result!("{}", summary.trim_end());
    }
    let is_whole = |input: &InputCount| input.rejected == 0 && input.left_out.is_none();
    Ok(if outcome.inputs.iter().all(is_whole) {
        0
    } else {
        LEFT_OUT
    })
}

/// The job's settings by name.
fn settings(job: &JobDescription) -> Vec<(String, String)> {
    let settings = serde_json::to_value(&job.settings).unwrap_or_default();
    let settings = settings.as_object().into_iter().flatten();
    settings
        .map(|(name, value)| (name.clone(), value.to_string()))
        .collect()
}

/// `path` with more at its end.
fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.to_owned().into_os_string();
    name.push(ending);
    name.into()
}

/// Writes the report and the viewer beside the output, each complete or not at all: the
/// names of the pages.
fn write_report(job: &JobDescription, report: &Report) -> Result<Vec<String>, JobError> {
    let write = |ending: &str, text: &str| {
        let path = with_ending(&job.output, ending);
        write_file(&path, text.as_bytes()).map(|()| path.display().to_string())
    };
    write(".report.json", &report.to_json())?;
    let mut pages = vec![write(REPORT_PAGE, &report.to_html())?];
    if let Some(viewer) = report.to_viewer() {
        pages.push(write(VIEWER_PAGE, &viewer)?);
    }
    Ok(pages)
}

fn plan_job(scans: &Scans, output: &Path, json: bool) -> Result<u8, JobError> {
    let job = job(scans, output)?;
    let terminal = Terminal::new(Look::choose(scans.quiet, scans.log == "json"));
    let Some(plan) = job.plan(&terminal, &CANCEL)? else {
        result!("{} is complete already", output.display());
        return Ok(0);
    };
    if json {
        result!(
            "{}",
            serde_json::to_string_pretty(&plan).unwrap_or_default()
        );
    } else {
        tables::print_plan(&plan);
    }
    Ok(0)
}

/// How long a job that is told to stop may take to stop by itself.
const GRACE: Duration = Duration::from_millis(800);

/// The first signal stops the job where it next looks up, or a little later where it
/// stands: it can be killed at any time and goes on from there. The second ends the
/// program at once.
fn stop_on_signals() {
    let stop = || {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(STOPPED.into());
        }
        say!("stopping; the same command will go on from here");
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            std::process::exit(STOPPED.into());
        });
    };
    // Without a handler a signal ends the program, and the job is resumable
    // all the same.
    drop(ctrlc::set_handler(stop));
}
