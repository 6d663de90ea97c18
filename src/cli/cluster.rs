//! `scatter`, `solve`, `stitch` and `status`: one job by many processes.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use clap::Args;

use super::{
    allocator,
    exit::DONE,
    printing::result,
    running::run_and_print,
    scans::{ProgressFlags, Scans},
    signals::{CANCEL, stop_on_signals},
    terminal::{Terminal, duration},
};
use crate::{
    config::Bytes,
    job::{ClaimedGroup, JobDescription, JobError, JobStatus, Worker},
    report::{counted, thousands},
};

/// When a process takes over the work of others.
#[derive(Args)]
pub(super) struct OtherProcesses {
    /// Seconds without a heartbeat after which another process counts as dead, and its work is
    /// taken over
    #[arg(long, value_name = "SECONDS", default_value_t = Worker::DEFAULT_HEARTBEAT_TIMEOUT.as_secs(), value_parser = clap::value_parser!(u64).range(15..))]
    patience: u64,
    /// Number of processes that may die at the same work before it is given up
    #[arg(long, value_name = "N", default_value_t = Worker::DEFAULT_RETRY_LIMIT, value_parser = clap::value_parser!(u32).range(1..))]
    attempts: u32,
}

impl OtherProcesses {
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

/// A job that several processes share.
#[derive(Args)]
pub(super) struct SharedJob {
    /// The job directory that `scatter` made
    #[arg(value_name = "JOB")]
    dir: PathBuf,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    others: OtherProcesses,
    #[command(flatten)]
    progress: ProgressFlags,
}

impl SharedJob {
    fn worker(&self, shard: Option<(u32, u32)>, waits_for_others: bool) -> Worker {
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let threads = self.threads.unwrap_or_else(cores);
        self.others.worker(threads, shard, waits_for_others)
    }
}

/// Scatters the points of a job: as a shard, those that no other process has claimed; without a
/// shard all that are left, and then it plans the tiles.
pub(super) fn scatter(
    scans: &Scans,
    output: &Path,
    restart: bool,
    shard: Option<(u32, u32)>,
    others: &OtherProcesses,
) -> Result<u8, JobError> {
    let job = JobDescription {
        restart,
        ..scans.job(output)?
    };
    stop_on_signals();
    let terminal = Terminal::new(scans.display());
    let worker = others.worker(job.settings.resources.threads, shard, shard.is_none());
    if shard.is_some() {
        return job.scatter(&worker, &terminal, &CANCEL).map(|()| DONE);
    }
    match job.hand_over(&worker, &terminal, &CANCEL)? {
        Some(plan) => {
            let tiles = counted(plan.plan.tiles.len() as u64, "tile");
            result!("{tiles} ready to be solved in {}", job.dir.display());
        }
        None => result!("{} is complete already", output.display()),
    }
    Ok(DONE)
}

/// Solves tiles until every tile is solved or claimed by another process.
pub(super) fn solve(shared: &SharedJob, shard: Option<(u32, u32)>) -> Result<u8, JobError> {
    allocator::return_freed_memory(JobDescription::handed_over(&shared.dir)?.memory());
    stop_on_signals();
    let terminal = Terminal::new(shared.progress.display());
    let worker = shared.worker(shard, false);
    worker.solve(&shared.dir, &terminal, &CANCEL).map(|()| DONE)
}

/// Solves the tiles that no other process has claimed, waits for the others, and stitches: as a shard, parts of what can be
/// divided; without a shard all that is left, and then it writes the output.
pub(super) fn stitch(
    shared: &SharedJob,
    shard: Option<(u32, u32)>,
    memory: Option<Bytes>,
    scratch: Option<PathBuf>,
) -> Result<u8, JobError> {
    let mut job = JobDescription {
        scratch,
        ..JobDescription::handed_over(&shared.dir)?
    };
    allocator::return_freed_memory(job.memory());
    stop_on_signals();
    let worker = shared.worker(shard, true);
    let terminal = Terminal::new(shared.progress.display());
    worker.solve(&shared.dir, &terminal, &CANCEL)?;
    if shard.is_some() {
        return worker
            .help_to_stitch(&shared.dir, &terminal, &CANCEL)
            .map(|()| DONE);
    }
    drop(terminal);
    let resources = &mut job.settings.resources;
    resources.threads = worker.threads;
    resources.memory = resources.memory.max(memory.map(|bytes| bytes.0));
    run_and_print(&job, Some(&worker), shared.progress.display())
}

/// Prints the progress of a job.
pub(super) fn print_status(dir: &Path, json: bool) -> Result<u8, JobError> {
    let status = JobStatus::of(dir)?;
    if json {
        result!(
            "{}",
            serde_json::to_string_pretty(&status).unwrap_or_default()
        );
        return Ok(DONE);
    }
    let members = match status.scattered {
        Some([done, all]) => {
            result!("{done} of {} of scans scattered", counted(all, "group"));
            "group"
        }
        None => {
            let (solved, tiles) = (thousands(status.solved), counted(status.tiles, "tile"));
            let remaining = match status.remaining_seconds {
                Some(seconds) if status.solved < status.tiles => {
                    format!("; approx. {} left", duration(seconds))
                }
                _ => String::new(),
            };
            if let Some(started) = status.started.filter(|&started| started < status.tiles) {
                result!(
                    "{} of {tiles} done with the first round",
                    thousands(started)
                );
            }
            let share = 100.0 * status.share;
            result!("{solved} of {tiles} solved, {share:.0} % of the work{remaining}");
            "tiles"
        }
    };
    print_claimed(members, &status.claimed);
    for work in &status.stitch {
        let ([complete, all], name) = (work.groups, &work.work);
        result!("stitch: {complete} of {} {name}", counted(all, "group"));
        print_claimed("group", &work.claimed);
    }
    Ok(DONE)
}

/// Prints the groups with these `members` on which processes are at work.
fn print_claimed(members: &str, claimed: &[ClaimedGroup]) {
    for group in claimed {
        result!(
            "  {members} {:?}: attempt {}, last heartbeat {:.0} s ago",
            group.members,
            group.attempt,
            group.silent_seconds
        );
    }
}

/// Prints the time limit of each of `tasks` tasks with `cores` cores, in minutes.
pub(super) fn print_time_limit(dir: &Path, tasks: u32, cores: u32) -> Result<u8, JobError> {
    result!("{}", JobStatus::time_limit_minutes(dir, tasks, cores)?);
    Ok(DONE)
}

/// Reads `3/16`: the number of a process, from 0, and the number of all.
pub(super) fn shard(text: &str) -> Result<(u32, u32), String> {
    let shard = text.split_once('/').and_then(|(own, of)| {
        let (own, of): (u32, u32) = (own.parse().ok()?, of.parse().ok()?);
        (own < of).then_some((own, of))
    });
    shard.ok_or_else(|| {
        format!(
            "`{text}` is not a shard; write its number, from 0, and the number of shards: 0/16 to \
             15/16"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_nought() {
        assert_eq!(shard("0/1"), Ok((0, 1)));
        assert_eq!(shard("15/16"), Ok((15, 16)));
        for wrong in ["16/16", "1", "a/b", "-1/4"] {
            assert!(shard(wrong).unwrap_err().contains("0/16"), "{wrong}");
        }
    }
}
