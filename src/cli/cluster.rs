//! One job by many processes: its stages as commands, and how they are given to Slurm.

use std::{
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use crate::{
    config::Bytes,
    job::{JobDescription, JobError, JobStatus, Worker, default_directory},
    report::thousands,
};
use clap::Args;

use super::{
    CANCEL, Scans, allocator, describing,
    printing::result,
    run_and_report, stop_on_signals,
    terminal::{Look, Terminal, duration},
    with_ending,
};

/// What a process thinks of the others.
#[derive(Args)]
pub(super) struct Others {
    /// Seconds of silence after which another process is taken for dead, and its work is
    /// taken over
    #[arg(long, value_name = "SECONDS", default_value_t = Worker::DEFAULT_HEARTBEAT_TIMEOUT.as_secs(), value_parser = clap::value_parser!(u64).range(15..))]
    patience: u64,
    /// How many processes may die over the same work before it is given up
    #[arg(long, value_name = "N", default_value_t = Worker::DEFAULT_RETRY_LIMIT, value_parser = clap::value_parser!(u32).range(1..))]
    attempts: u32,
}

impl Others {
    fn worker(&self, threads: usize, shard: Option<(u32, u32)>, waits_for_others: bool) -> Worker {
        Worker {
            threads,
            shard,
            heartbeat_timeout: Duration::from_secs(self.patience),
            retry_limit: self.attempts,
            waits_for_others,
        }
    }
}

/// A process among others.
#[derive(Args)]
pub(super) struct Sharing {
    /// The job directory that `scatter` made
    #[arg(value_name = "JOB")]
    dir: PathBuf,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    others: Others,
    /// Show nothing but errors
    #[arg(short, long)]
    quiet: bool,
    /// `json`: progress as JSON lines on standard error
    #[arg(long, value_name = "FORMAT", value_parser = ["json", "text"], default_value = "text")]
    log: String,
}

impl Sharing {
    fn look(&self) -> Look {
        Look::choose(self.quiet, self.log == "json")
    }

    fn worker(&self, shard: Option<(u32, u32)>, waits_for_others: bool) -> Worker {
        let threads = self.threads.unwrap_or_else(super::cores);
        self.others.worker(threads, shard, waits_for_others)
    }
}

/// Scatters points of a job. As a shard, those that no other process does; or else it sees to
/// all of them, plans the tiles, and leaves these to others.
pub(super) fn scatter(
    scans: &Scans,
    output: &Path,
    restart: bool,
    shard: Option<(u32, u32)>,
    others: &Others,
) -> Result<u8, JobError> {
    let job = JobDescription {
        restart,
        ..super::job(scans, output)?
    };
    stop_on_signals();
    let terminal = Terminal::new(Look::choose(scans.quiet, scans.log == "json"));
    let worker = others.worker(job.settings.threads, shard, shard.is_none());
    if shard.is_some() {
        return job.scatter(&worker, &terminal, &CANCEL).map(|()| 0);
    }
    match job.hand_over(&worker, &terminal, &CANCEL)? {
        Some(plan) => result!(
            "{} tiles are ready to be solved in {}",
            thousands(plan.plan.tiles.len() as u64),
            job.dir.display()
        ),
        None => result!("{} is complete already", output.display()),
    }
    Ok(0)
}

/// Solves tiles until there are none that nobody works on.
pub(super) fn solve(sharing: &Sharing, shard: Option<(u32, u32)>) -> Result<u8, JobError> {
    allocator::spare(JobDescription::handed_over(&sharing.dir)?.memory());
    stop_on_signals();
    let terminal = Terminal::new(sharing.look());
    let worker = sharing.worker(shard, false);
    worker.solve(&sharing.dir, &terminal, &CANCEL).map(|()| 0)
}

/// Waits until all tiles are solved, solves those that nobody does, and writes the output.
pub(super) fn stitch(
    sharing: &Sharing,
    memory: Option<Bytes>,
    scratch: Option<PathBuf>,
) -> Result<u8, JobError> {
    let mut job = JobDescription {
        scratch,
        ..JobDescription::handed_over(&sharing.dir)?
    };
    allocator::spare(job.memory());
    stop_on_signals();
    let worker = sharing.worker(None, true);
    worker.solve(&sharing.dir, &Terminal::new(sharing.look()), &CANCEL)?;
    job.settings.threads = worker.threads;
    job.settings.memory = job.settings.memory.max(memory.map(|bytes| bytes.0));
    run_and_report(&job, sharing.look())
}

/// Prints how far a job is.
pub(super) fn status(dir: &Path, json: bool) -> Result<u8, JobError> {
    let status = JobStatus::of(dir)?;
    if json {
        result!(
            "{}",
            serde_json::to_string_pretty(&status).unwrap_or_default()
        );
        return Ok(0);
    }
    match status.scattered {
        Some([done, all]) => result!("{done} of {all} groups of scans scattered"),
        None => result!(
            "{} of {} tiles solved, {:.0} % of the work{}",
            thousands(status.solved),
            thousands(status.tiles),
            100.0 * status.share,
            match status.remaining_seconds {
                Some(seconds) if status.solved < status.tiles =>
                    format!("; {} to go", duration(seconds)),
                _ => String::new(),
            }
        ),
    }
    let members = match status.scattered {
        Some(_) => "group",
        None => "tiles",
    };
    for group in &status.claimed {
        result!(
            "  {members} {:?}: attempt {}, last heard of {:.0} s ago",
            group.members,
            group.attempt,
            group.silent_seconds
        );
    }
    Ok(0)
}

/// Prints the minutes that tasks should be given.
pub(super) fn limit(dir: &Path, tasks: u32, cores: u32) -> Result<u8, JobError> {
    result!("{}", JobStatus::time_limit_minutes(dir, tasks, cores)?);
    Ok(0)
}

/// `64x4` as tasks and cores.
pub(super) fn tasks(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(tasks, cores)| {
        let number = |text: &str| text.parse().ok().filter(|&number: &u32| number > 0);
        Some([number(tasks)?, number(cores)?])
    });
    numbers.ok_or_else(|| format!("`{text}` is no number of tasks and cores; write it like 64x4"))
}

/// `3/16` as which of how many, from 0.
pub(super) fn shard(text: &str) -> Result<(u32, u32), String> {
    let parts = text.split_once('/').and_then(|(own, of)| {
        let (own, of): (u32, u32) = (own.parse().ok()?, of.parse().ok()?);
        (own < of).then_some((own, of))
    });
    parts.ok_or_else(|| {
        format!("`{text}` is no shard; of sixteen the first is 0/16, the last 15/16")
    })
}

/// What Slurm is asked for.
#[derive(Args)]
pub(super) struct Cluster {
    /// Tasks that scatter at once, and tasks that solve tiles at once
    #[arg(long, value_name = "N", default_value = "16", value_parser = clap::value_parser!(u32).range(1..))]
    tasks: u32,
    /// Cores for each task
    #[arg(long, value_name = "N", default_value = "4")]
    cpus: u32,
    /// Time limit of each task, as sbatch has it [default: the partition's, and for those that
    /// solve tiles what the plan says, if that is less]
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Partition [default: the cluster's]
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Account [default: the user's]
    #[arg(long, value_name = "NAME")]
    account: Option<String>,
    /// Print what would be submitted, and submit nothing
    #[arg(long)]
    dry_run: bool,
}

/// Memory of a task when none is asked for.
const TASK_MEMORY: Bytes = Bytes(4 << 30);

/// MiB of the task that says how long others may take.
const LIMIT_MEMORY: u64 = 128;

/// Submits a job to Slurm.
pub(super) fn slurm(cluster: &Cluster, scans: &Scans, output: &Path) -> Result<u8, JobError> {
    let script = cluster.script(scans, output)?;
    if cluster.dry_run {
        result!("{}", script.trim_end());
        return Ok(0);
    }
    let failed = |problem: String| Err(JobError::Refused(problem));
    match Command::new("sh").arg("-c").arg(&script).status() {
        Ok(status) if status.success() => Ok(0),
        Ok(_) => failed(
            "sbatch refused; what it said stands above. --dry-run prints what it was asked".into(),
        ),
        Err(e) => failed(format!("cannot start a shell: {e}")),
    }
}

impl Cluster {
    /// The shell commands that submit the stages of a job.
    fn script(&self, scans: &Scans, output: &Path) -> Result<String, JobError> {
        let mut choices = super::choices(scans)?;
        let memory = *choices.memory.get_or_insert(TASK_MEMORY);
        choices.threads = None;
        let job = choices
            .job
            .clone()
            .unwrap_or_else(|| default_directory(output));
        let logs = with_ending(&job, ".slurm");
        let program = std::env::current_exe().unwrap_or_else(|_| "lloydar".into());
        let [program, job, output] =
            [&program, &job, output].map(|path| quoted(&path.display().to_string()));
        let inputs: Vec<String> = scans
            .inputs
            .iter()
            .map(|path| quoted(&path.display().to_string()))
            .collect();
        let options = describing::flags(&choices)
            .iter()
            .map(|flag| quoted(flag))
            .collect::<Vec<_>>();
        let cpus = self.cpus;
        let plan = format!(
            "exec {program} scatter {} -o {output} {} --threads {cpus}",
            inputs.join(" "),
            options.join(" ")
        );
        let shard = format!("--shard $SLURM_ARRAY_TASK_ID/{}", self.tasks);
        let scatter = format!("{plan} {shard}");
        let solve = format!("exec {program} solve {job} --threads {cpus} {shard}");
        let stitch = format!(
            "exec {program} stitch {job} --threads {cpus} ${{TMPDIR:+--scratch \"$TMPDIR\"}}"
        );
        // What the partition allows is the most; a better limit is known once there is a plan.
        let limit = match self.time {
            Some(_) => ":".to_owned(),
            None => self.sbatch(
                "limit",
                &logs,
                LIMIT_MEMORY,
                "--dependency=afterok:$plan --export=ALL,SOLVE=$solve",
                &format!(
                    "{program} status {job} --limit {}x{cpus} | xargs -I% scontrol update JobId=$SOLVE TimeLimit=%",
                    self.tasks
                ),
            ),
        };
        // The budget is kept by measured costs; the margin is for what was not measured.
        let task = (memory.0 >> 20) * 5 / 4 + 64;
        let array = format!("--array=0-{}", self.tasks - 1);
        Ok(format!(
            "set -eu\n\
             mkdir -p {logs}\n\
             # Points to their cells.\n\
             scatter=$({})\n\
             # What is missing of that, and the tiles.\n\
             plan=$({})\n\
             # Tiles: who ends early takes over from the others.\n\
             solve=$({})\n\
             # As much time for each of these as the plan says; the partition's where that is less.\n\
             limit=$({})\n\
             # Once more with twice the memory, if a task failed.\n\
             again=$({})\n\
             # One cloud. What still is missing is solved here.\n\
             stitch=$({})\n\
             echo \"scatter $scatter, plan $plan, solve $solve (again: $again), stitch $stitch\"\n\
             echo {}\n",
            self.sbatch("scatter", &logs, task, &array, &scatter),
            self.sbatch("plan", &logs, task, "--dependency=afterany:$scatter", &plan),
            self.sbatch(
                "solve",
                &logs,
                task,
                &format!("{array} --dependency=afterok:$plan"),
                &solve
            ),
            limit,
            self.sbatch(
                "again",
                &logs,
                2 * task,
                &format!("{array} --dependency=afterok:$plan,afternotok:$solve"),
                &solve
            ),
            self.sbatch(
                "stitch",
                &logs,
                2 * task,
                "--dependency=afterok:$plan,afterany:$solve:$again",
                &stitch
            ),
            quoted(&format!("lloydar status {job} says how far it is"),),
            logs = quoted(&logs.display().to_string()),
        ))
    }

    fn sbatch(
        &self,
        stage: &str,
        logs: &Path,
        mebibytes: u64,
        more: &str,
        command: &str,
    ) -> String {
        let log = quoted(
            &logs
                .join(format!("{stage}-%A-%a.log"))
                .display()
                .to_string(),
        );
        let asked = [
            ("time", &self.time),
            ("partition", &self.partition),
            ("account", &self.account),
        ];
        let asked: String = asked
            .iter()
            .filter_map(|(name, value)| Some(format!(" --{name}={}", quoted(value.as_deref()?))))
            .collect();
        // A task that is killed begins again where it was; before its time is up it is told.
        format!(
            "sbatch --parsable --job-name=lloydar-{stage} --output={log} --open-mode=append --requeue \
             --kill-on-invalid-dep=yes --signal=B:TERM@60 --nodes=1 --ntasks=1 --cpus-per-task={} \
             --mem={mebibytes}M{asked} {more} --wrap={}",
            self.cpus,
            quoted(command)
        )
    }
}

/// `text` as one word of a shell.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:@%+".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_of_a_shell_is_one_word() {
        for text in [
            "plain/path.laz",
            "",
            "a b",
            "it's",
            "$HOME `x` \"y\" \\",
            "é;&|",
        ] {
            let said = Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(text))])
                .output()
                .unwrap();
            assert_eq!(String::from_utf8(said.stdout).unwrap(), text);
        }
    }

    #[test]
    fn shards_are_counted_from_nought() {
        assert_eq!(shard("0/1"), Ok((0, 1)));
        assert_eq!(shard("15/16"), Ok((15, 16)));
        for wrong in ["16/16", "1", "a/b", "-1/4"] {
            assert!(shard(wrong).unwrap_err().contains("0/16"), "{wrong}");
        }
    }
}
