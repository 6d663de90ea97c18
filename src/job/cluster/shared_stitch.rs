//! The stitch by many: its work in pieces, which the processes that share a job divide among themselves.
//!
//! ```text
//!   settled    each tile, settled                           elected, figures   levels of an octree
//!   sorted     its records, sorted by position              columns            columns of its nodes, compressed
//!   measured   the distances between its points           written            tiles of the output
//! ```
//!
//! Each work begins when the one before is complete. One process, which works like the others, puts together what all have made,
//! and writes the report.

use std::{
    borrow::Cow,
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering::Relaxed},
    time::{SystemTime, UNIX_EPOCH},
};

use super::{
    claims::{Claim, WorkKind},
    group_files::{TILES, block_files, block_files_of},
    handover::Handover,
    worker::Worker,
};
use crate::{
    job::{
        context::RunContext,
        directory::{SolvedTiles, WRITTEN_DIRECTORY},
        error::JobError,
        progress::Progress,
        stages::{
            output::help_with_output,
            stitchers::{ReadTile, SORTED, Sorting, Stitchers, sort_in},
        },
    },
    las::{KeptPieces, MakePiece, SortedRecords, StoreError, TakePiece, Workforce},
    tile::{BlockFile, KeptBlocks, Spill, TileError, add_piece},
};

/// The number of groups in which the pieces of a work are claimed, at most.
const MOST_GROUPS: usize = 64;

/// The work of sorting the records of tiles by position.
const SORTING: WorkKind = WorkKind {
    prefix: Cow::Borrowed(SORTED),
    claim_extension: "bin",
    complete_extension: "index",
};

/// The processes that stitch a job together, as one of them sees them.
pub(crate) struct SharedStitch<'a> {
    worker: Worker,
    /// The job directory.
    dir: &'a Path,
    /// The directory in it for files that this process makes.
    own_directory: PathBuf,
    cancel: &'a AtomicBool,
    /// Whether this process puts together what all have made.
    completes: bool,
}

/// Consecutive numbers, divided into groups.
#[derive(Clone, Copy, Debug)]
struct Groups {
    count: usize,
    per_group: usize,
}

impl Groups {
    fn of(count: usize) -> Self {
        Self {
            count,
            per_group: count.div_ceil(MOST_GROUPS).max(1),
        }
    }

    fn len(self) -> usize {
        self.count.div_ceil(self.per_group)
    }

    fn members(self, group: usize) -> std::ops::Range<usize> {
        let first = group * self.per_group;
        first..(first + self.per_group).min(self.count)
    }
}

/// The kind of a work in pieces whose files have names that begin with `prefix`.
fn pieces_of(prefix: String) -> WorkKind {
    WorkKind {
        prefix: prefix.into(),
        claim_extension: "pieces",
        complete_extension: "complete",
    }
}

/// Lists the works of the stitch of `tiles` tiles that processes have begun in `dir`, in the order in which they did, with
/// the number of groups of each.
///
/// # Errors
///
/// [`JobError::Io`] if `dir` cannot be read.
pub(super) fn works_begun(dir: &Path, tiles: usize) -> Result<Vec<(WorkKind, usize)>, JobError> {
    let mut begun: HashMap<String, (SystemTime, usize)> = HashMap::new();
    for entry in fs::read_dir(dir).map_err(|e| JobError::io("read", dir, e))? {
        let entry = entry.map_err(|e| JobError::io("read", dir, e))?;
        let name = entry.file_name();
        let found = name.to_str().and_then(|name| prefix_and_count(name, tiles));
        // A file that has gone meanwhile belongs to a stitch that is over.
        let modified = entry.metadata().and_then(|metadata| metadata.modified());
        if let (Some((prefix, count)), Ok(modified)) = (found, modified) {
            let (first, _) = begun.entry(prefix).or_insert((modified, count));
            *first = modified.min(*first);
        }
    }
    let mut works: Vec<_> = begun.into_iter().collect();
    works.sort_unstable_by(|(a, (first_of_a, _)), (b, (first_of_b, _))| {
        (first_of_a, a).cmp(&(first_of_b, b))
    });
    let work = |(prefix, (_, count)): (String, _)| {
        let kind = if prefix == SORTED {
            SORTING
        } else {
            pieces_of(prefix)
        };
        (kind, Groups::of(count).len())
    };
    Ok(works.into_iter().map(work).collect())
}

/// The prefix of the work, and the number of its pieces, in whose files one with this `name` is; `None` if it is none of them.
fn prefix_and_count(name: &str, tiles: usize) -> Option<(String, usize)> {
    let (stem, extension) = name.rsplit_once('.')?;
    let (rest, attempt) = stem.rsplit_once('-')?;
    let (prefix, group) = rest.rsplit_once('-')?;
    attempt.parse::<u32>().ok()?;
    group.parse::<usize>().ok()?;
    match extension {
        "pieces" => Some((prefix.to_owned(), prefix.rsplit_once('-')?.1.parse().ok()?)),
        "bin" if prefix == SORTED => Some((prefix.to_owned(), tiles)),
        _ => None,
    }
}

impl<'a> SharedStitch<'a> {
    /// The stitch of the job in `dir` by `worker` and others; one of them `completes` the cloud.
    pub(crate) fn new(
        worker: Worker,
        dir: &'a Path,
        cancel: &'a AtomicBool,
        completes: bool,
    ) -> Self {
        // Processes of two machines may have one number, but hardly in the same nanosecond.
        let now = UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
        let name = format!("{}-{now}", std::process::id());
        Self {
            worker,
            dir,
            own_directory: dir.join(WRITTEN_DIRECTORY).join(name),
            cancel,
            completes,
        }
    }

    /// Does the groups of a work that no other process does. Waits until all are done, if anything is made of them.
    fn share(
        &self,
        kind: &WorkKind,
        groups: Groups,
        is_awaited: bool,
        mut make: impl FnMut(&Claim) -> Result<(), JobError>,
    ) -> Result<(), JobError> {
        let worker = Worker {
            waits_for_others: is_awaited,
            ..self.worker
        };
        let count = groups.len();
        let given_up = worker.share(kind, self.dir, count, self.cancel, |claim, _| {
            make(claim).map(|()| true)
        })?;
        match given_up.as_slice() {
            [] => Ok(()),
            _ => Err(JobError::Refused(format!(
                "stitch: {} processes died over parts {given_up:?} of its work `{}`, or their machines did; give \
                 --attempts {} to try them again",
                worker.retry_limit,
                kind.prefix,
                worker.retry_limit + 1
            ))),
        }
    }

    /// Makes the pieces of a work that no other process makes; returns how its files are named and divided.
    fn make_pieces(
        &self,
        name: &str,
        count: usize,
        is_awaited: bool,
        make: &mut MakePiece<'_>,
    ) -> Result<(WorkKind, Groups), JobError> {
        // Processes that divide the work differently have different files.
        let kind = pieces_of(format!("{name}-{count}"));
        let groups = Groups::of(count);
        self.share(&kind, groups, is_awaited, |claim| {
            let mut file = BlockFile::create(&claim.path())?;
            for piece in groups.members(claim.group) {
                if self.cancel.load(Relaxed) {
                    return Err(JobError::Tile(TileError::Cancelled));
                }
                let made = make(piece).map_err(JobError::of_store)?;
                add_piece(&mut file, piece, &made)?;
            }
            file.flush()?;
            claim.complete()
        })?;
        Ok((kind, groups))
    }

    /// The complete claim of each group.
    fn complete_claims(&self, kind: &WorkKind, groups: Groups) -> Result<Vec<Claim>, JobError> {
        let complete = Claim::all_complete(kind, self.dir)?;
        match complete.len() == groups.len() {
            true => Ok(complete),
            false => Err(JobError::Tile(TileError::damaged(self.dir))),
        }
    }

    fn pieces(&self, kind: &WorkKind, groups: Groups) -> Result<KeptBlocks, JobError> {
        let claims = self.complete_claims(kind, groups)?;
        let files = block_files_of(&claims)?;
        Ok(KeptBlocks::of_many_processes(files, groups.per_group))
    }
}

impl Workforce for SharedStitch<'_> {
    fn shared_directory(&self) -> Option<&Path> {
        Some(&self.own_directory)
    }

    fn keep(
        &self,
        name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
    ) -> Result<Box<dyn KeptPieces>, StoreError> {
        let (kind, groups) = self.make_pieces(name, count, true, make)?;
        Ok(Box::new(self.pieces(&kind, groups)?))
    }

    fn pass(
        &self,
        name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
        take: &mut TakePiece<'_>,
    ) -> Result<(), StoreError> {
        let (kind, groups) = self.make_pieces(name, count, self.completes, make)?;
        if !self.completes {
            return Ok(());
        }
        let pieces = self.pieces(&kind, groups)?;
        (0..count).try_for_each(|piece| take(piece, pieces.piece(piece)?))
    }
}

impl Stitchers for SharedStitch<'_> {
    fn workforce(&self) -> &dyn Workforce {
        self
    }

    fn directory(&self) -> &Path {
        self.dir
    }

    fn sort(
        &self,
        sorting: &Sorting,
        tiles: usize,
        read: &mut ReadTile<'_>,
    ) -> Result<Box<dyn SortedRecords>, JobError> {
        let (space, groups) = (self.space(sorting.buffer_bytes), Groups::of(tiles));
        self.share(&SORTING, groups, true, |claim| {
            let name = claim.stem.file_name().unwrap_or_default();
            let tiles = groups.members(claim.group);
            sort_in(&*space, &name.to_string_lossy(), sorting, tiles, read).map(drop)
        })?;
        let claims = self.complete_claims(&SORTING, groups)?;
        let stems: Vec<_> = claims.into_iter().map(|claim| claim.stem).collect();
        Ok(Box::new(Spill::join(&stems)?))
    }
}

impl Worker {
    /// Does parts of the stitch of the job in `dir`, whose tiles are solved, until there are none left; another process completes
    /// the cloud.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(crate) fn help_to_stitch(
        &self,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let helped = self.help_with_pieces(dir, progress, cancel);
        match helped {
            // Who completes the cloud removes the job without waiting for those that help.
            Err(JobError::Io { .. } | JobError::Tile(TileError::Io { .. }))
                if !Handover::exists_in(dir) =>
            {
                Ok(())
            }
            helped => helped,
        }
    }

    fn help_with_pieces(
        &self,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let handover = Handover::read(dir)?;
        let (job, header, solver) = (&handover.job, &handover.header, handover.solver()?);
        let format = job.format()?;
        RunContext::with(job, self.threads, progress, cancel, |run| {
            let solved = SolvedTiles::of(block_files(&TILES, dir)?);
            let shared = SharedStitch::new(*self, dir, cancel, false);
            let help = || help_with_output(run, &solver, &solved, format, header, &shared);
            run.pool.install(help)
        })
    }
}
