//! `slurm`: one job by many processes, submitted to Slurm.
//!
//! ```text
//!   scatter (array) ─► plan ─► solve (array) ─► again (array, if a task failed) ─► stitch (array) ─► complete
//!                        └───► limit (time of the tasks that solve)
//! ```

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use clap::Args;

use super::{exit::DONE, options::flags_of, printing::result, running::with_ending, scans::Scans};
use crate::{
    config::{Bytes, ConfigError},
    job::{JobError, Placement},
    store::{has_secret, without_secrets},
};

/// What is requested from Slurm.
#[derive(Args)]
pub(super) struct SlurmOptions {
    /// Number of tasks that scatter at once, and of tasks that solve tiles at once
    #[arg(long, value_name = "N", default_value = "16", value_parser = clap::value_parser!(u32).range(1..))]
    tasks: u32,
    /// Cores of each task
    #[arg(long, value_name = "N", default_value = "4")]
    cpus: u32,
    /// Time limit of each task, in the notation of sbatch [default: the partition's; for tasks
    /// that solve tiles three times what the plan expects, and ten minutes, if that is less]
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Partition [default: the cluster's]
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Account [default: the user's]
    #[arg(long, value_name = "NAME")]
    account: Option<String>,
    /// Print the commands, and submit nothing
    #[arg(long)]
    dry_run: bool,
}

/// Reads `64x4`: a number of tasks, and of cores for each of them.
pub(super) fn tasks_and_cores(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(tasks, cores)| {
        let number = |text: &str| text.parse().ok().filter(|&number: &u32| number > 0);
        Some([number(tasks)?, number(cores)?])
    });
    numbers.ok_or_else(|| {
        format!(
            "`{text}` does not state tasks and cores; write 64x4 for 64 tasks with 4 cores each"
        )
    })
}

/// The memory of a job whose options state none.
const DEFAULT_JOB_MEMORY: Bytes = Bytes(4 << 30);

/// The memory (MiB) of the task that sets the time limit of others.
const LIMIT_TASK_MEBIBYTES: u64 = 128;

/// Submits a job to Slurm, or prints the commands that would.
pub(super) fn submit(slurm: &SlurmOptions, scans: &Scans, output: &Path) -> Result<u8, JobError> {
    let script = Submission::new(slurm, scans, output)?.script();
    if slurm.dry_run {
        result!("{}", script.trim_end());
        return Ok(DONE);
    }
    let failed = |problem: String| Err(JobError::Refused(problem));
    match Command::new("sh").arg("-c").arg(&script).status() {
        Ok(status) if status.success() => Ok(DONE),
        Ok(_) => failed(
            "sbatch failed, with the message above; --dry-run prints the commands and runs none"
                .into(),
        ),
        Err(e) => failed(format!("cannot start a shell: {e}")),
    }
}

/// A job on its way to Slurm. All texts are words of a shell already.
struct Submission<'a> {
    slurm: &'a SlurmOptions,
    /// The directory for what tasks print.
    logs: PathBuf,
    /// The executable of this program.
    program: String,
    /// The job directory.
    job: String,
    /// The command that scatters the points and plans the tiles.
    scatter: String,
    /// The memory (MiB) of a task that works with the job's budget.
    mebibytes: u64,
}

/// A task, or an array of tasks.
struct Task {
    stage: &'static str,
    mebibytes: u64,
    /// Further options of sbatch.
    options: String,
    /// The command of the task, before it is quoted.
    command: String,
}

impl<'a> Submission<'a> {
    fn new(slurm: &'a SlurmOptions, scans: &Scans, output: &Path) -> Result<Self, JobError> {
        let mut choices = scans.choices()?;
        let memory = *choices.memory.get_or_insert(DEFAULT_JOB_MEMORY);
        choices.threads = None;
        let job = choices.job.clone();
        let job = Placement::of(output, job.as_deref()).dir;
        let path = |path: &Path| quoted(&path.display().to_string());
        let program = std::env::current_exe().unwrap_or_else(|_| "lloydar".into());
        let program = path(&program);
        let signed = scans
            .inputs
            .arguments()
            .iter()
            .find(|input| has_secret(input));
        if let Some(input) = signed
            .map(PathBuf::as_path)
            .or(Some(output).filter(|output| has_secret(output)))
        {
            return Err(JobError::Refused(format!(
                "{}: the address has a signature or a password, which is not written into scripts; give credentials in \
                 the environment of the tasks",
                without_secrets(input).display()
            )));
        }
        let arguments = scans.inputs.arguments().iter();
        let mut inputs: Vec<String> = arguments.map(|input| path(input)).collect();
        match scans.inputs.list() {
            Some(list) if list == Path::new("-") => {
                return Err(JobError::Config(ConfigError::Words(
                    "--from-list -: tasks of a cluster cannot read this standard input; give a file".into(),
                )));
            }
            list => inputs.extend(list.map(|list| format!("--from-list {}", path(list)))),
        }
        let flags: Vec<String> = flags_of(&choices).iter().map(|flag| quoted(flag)).collect();
        Ok(Self {
            slurm,
            logs: with_ending(&job, ".slurm"),
            job: path(&job),
            scatter: format!(
                "exec {program} scatter {} -o {} {} --threads {}",
                inputs.join(" "),
                path(output),
                flags.join(" "),
                slurm.cpus
            ),
            program,
            // The budget is kept by measured costs; the margin is for what was not measured.
            mebibytes: (memory.0 >> 20) * 5 / 4 + 64,
        })
    }

    /// Returns the shell commands that submit all stages.
    fn script(&self) -> String {
        let limit = match self.slurm.time {
            Some(_) => ":".to_owned(),
            None => self.sbatch(&self.limit()),
        };
        format!(
            "set -eu\n\
             mkdir -p {logs}\n\
             # Scatter: each task decodes some of the scans.\n\
             scatter=$({scatter})\n\
             # Plan: decode the scans that are left, and plan the tiles.\n\
             plan=$({plan})\n\
             # Solve: a task that has finished its tiles takes over tiles of others.\n\
             solve=$({solve})\n\
             # Limit: the time of the tasks that solve, by the plan, if the partition allows more.\n\
             limit=$({limit})\n\
             # Again: solve with twice the memory, if a task has failed.\n\
             again=$({again})\n\
             # Stitch: solve the tiles that are left, and stitch by all tasks.\n\
             stitch=$({stitch})\n\
             # Complete: put the cloud together, and write the report.\n\
             complete=$({complete})\n\
             echo \"scatter $scatter, plan $plan, solve $solve (again: $again), stitch $stitch, complete $complete\"\n\
             echo {status}\n",
            logs = quoted(&self.logs.display().to_string()),
            scatter = self.sbatch(&self.scatter_array()),
            plan = self.sbatch(&self.plan()),
            solve = self.sbatch(&self.solve("solve", self.mebibytes, "afterok:$plan")),
            again = self.sbatch(&self.solve(
                "again",
                2 * self.mebibytes,
                "afterok:$plan,afternotok:$solve"
            )),
            stitch = self.sbatch(&self.stitch()),
            complete = self.sbatch(&self.complete()),
            status = quoted(&format!("lloydar status {} prints the progress", self.job)),
        )
    }

    /// Returns the flag by which the tasks of an array tell each other apart.
    fn shard(&self) -> String {
        format!("--shard $SLURM_ARRAY_TASK_ID/{}", self.slurm.tasks)
    }

    fn array(&self) -> String {
        format!("--array=0-{}", self.slurm.tasks - 1)
    }

    fn scatter_array(&self) -> Task {
        Task {
            stage: "scatter",
            mebibytes: self.mebibytes,
            options: self.array(),
            command: format!("{} {}", self.scatter, self.shard()),
        }
    }

    fn plan(&self) -> Task {
        Task {
            stage: "plan",
            mebibytes: self.mebibytes,
            options: "--dependency=afterany:$scatter".to_owned(),
            command: self.scatter.clone(),
        }
    }

    fn solve(&self, stage: &'static str, mebibytes: u64, dependency: &str) -> Task {
        let (program, job, cpus) = (&self.program, &self.job, self.slurm.cpus);
        Task {
            stage,
            mebibytes,
            options: format!("{} --dependency={dependency}", self.array()),
            command: format!(
                "exec {program} solve {job} --threads {cpus} {}",
                self.shard()
            ),
        }
    }

    /// Returns the task that lowers the time limit of those that solve, once there is a plan.
    fn limit(&self) -> Task {
        let (program, job) = (&self.program, &self.job);
        let (tasks, cpus) = (self.slurm.tasks, self.slurm.cpus);
        Task {
            stage: "limit",
            mebibytes: LIMIT_TASK_MEBIBYTES,
            options: "--dependency=afterok:$plan --export=ALL,SOLVE=$solve".to_owned(),
            command: format!(
                "{program} status {job} --limit {tasks}x{cpus} | xargs -I% scontrol update JobId=$SOLVE TimeLimit=%"
            ),
        }
    }

    fn stitch(&self) -> Task {
        let (program, job, cpus) = (&self.program, &self.job, self.slurm.cpus);
        let dependency = "--dependency=afterok:$plan,afterany:$solve:$again";
        Task {
            stage: "stitch",
            mebibytes: 2 * self.mebibytes,
            options: format!("{} {dependency}", self.array()),
            command: format!(
                "exec {program} stitch {job} --threads {cpus} {}",
                self.shard()
            ),
        }
    }

    fn complete(&self) -> Task {
        let (program, job, cpus) = (&self.program, &self.job, self.slurm.cpus);
        Task {
            stage: "complete",
            mebibytes: 2 * self.mebibytes,
            options: "--dependency=afterok:$plan,afterany:$stitch".to_owned(),
            command: format!(
                "exec {program} stitch {job} --threads {cpus} ${{TMPDIR:+--scratch \"$TMPDIR\"}}"
            ),
        }
    }

    /// Returns the command that submits `task` and prints its number.
    fn sbatch(&self, task: &Task) -> String {
        let Task {
            stage,
            mebibytes,
            options,
            command,
        } = task;
        let log = self.logs.join(format!("{stage}-%A-%a.log"));
        let log = quoted(&log.display().to_string());
        let requests = [
            ("time", &self.slurm.time),
            ("partition", &self.slurm.partition),
            ("account", &self.slurm.account),
        ];
        let requests: String = requests
            .iter()
            .filter_map(|(name, value)| Some(format!(" --{name}={}", quoted(value.as_deref()?))))
            .collect();
        // A task that is killed is queued again and continues its work. It gets SIGTERM a minute
        // before its time is up.
        format!(
            "sbatch --parsable --job-name=lloydar-{stage} --output={log} --open-mode=append --requeue \
             --kill-on-invalid-dep=yes --signal=B:TERM@60 --nodes=1 --ntasks=1 --cpus-per-task={} \
             --mem={mebibytes}M{requests} {options} --wrap={}",
            self.slurm.cpus,
            quoted(command)
        )
    }
}

/// Returns `text` as one word of a shell.
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
}
