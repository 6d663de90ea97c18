//! What one pass of the scanner saw and others looked through is found before the scatter, which leaves it out.
//!
//! All inputs are decoded twice for it: once for what was seen when, and once, if that was in several visits, for the sight
//! lines that passed there. The result is a file in the job directory, which is made once, however many processes scatter.

use std::{
    borrow::Cow,
    path::Path,
    sync::{Mutex, PoisonError},
};

use super::{all_points::AllPoints, scanner_way::scanner_way, survey::Survey};
use crate::{
    config::TransientSettings,
    geometry::{Quantization, ScannerWay, Stored},
    job::{
        cluster::{Claim, WorkKind, Worker},
        context::RunContext,
        directory::write_among_others,
        error::JobError,
        progress::Progress,
        resources::mebibytes,
    },
    las::{PointCounts, PointStream},
    tile::{Source, SourceError, read_checksummed},
    transients::{
        DoubtfulVoxels, Moment, SightLine, TransientCounts, TransientVoxels, Visits, VoxelGrid,
    },
};

/// The work of finding transients, which one process does for all.
const SEARCH: WorkKind = WorkKind {
    prefix: Cow::Borrowed("transients"),
    claim_extension: "part",
    complete_extension: "complete",
};

/// Name of the file in the job directory that contains what was found.
const TRANSIENTS_FILE: &str = "transients.bin";

/// The number of voxels that a thread gathers before it adds them to those of all.
const VOXELS_OF_A_THREAD: usize = 1 << 16;

/// The share of the memory that what is known of voxels may take; decoders have the rest.
const VOXEL_SHARE: f64 = 0.6;

/// Reads how much was found in the job directory `dir`; `None` if the job looked for nothing.
pub(super) fn transient_counts(dir: &Path) -> Option<TransientCounts> {
    TransientCounts::from_bytes(&found_bytes(dir)?)
}

/// What was found in the job directory `dir`, if the search is complete.
fn found_in(dir: &Path) -> Option<TransientVoxels> {
    TransientVoxels::from_bytes(&found_bytes(dir)?)
}

/// The content of the file that contains what was found, if the search is complete.
fn found_bytes(dir: &Path) -> Option<Vec<u8>> {
    read_checksummed(&dir.join(TRANSIENTS_FILE)).ok()?
}

/// Returns whether processes that scatter the job in the directory `dir` together have begun to look for transients.
///
/// # Errors
///
/// [`JobError::Io`] if `dir` cannot be read.
pub(super) fn is_searched(dir: &Path) -> Result<bool, JobError> {
    Ok(!Claim::all(&SEARCH, dir)?.is_empty())
}

/// Returns what one pass saw and others looked through, if points are left out by it: as found by an earlier run, by
/// another process if several scatter the job, or now.
///
/// # Errors
///
/// [`JobError::BadFiles`] if inputs cannot be read to their end, [`JobError::Refused`] if no point was seen during the
/// scanner's way, [`JobError::Resources`] if the memory is too little.
pub(super) fn find_transients(
    run: &RunContext<'_>,
    survey: &Survey,
    sharing: Option<&Worker>,
) -> Result<Option<TransientVoxels>, JobError> {
    let dir = run.job.dir.as_path();
    let Some(settings) = &run.job.settings.input.transients else {
        return Ok(None);
    };
    if let Some(found) = found_in(dir) {
        return Ok(Some(found));
    }
    let search = || Search::new(run, survey, settings)?.complete();
    match sharing {
        None => search().map(Some),
        Some(worker) => {
            let waiting = Worker {
                waits_for_others: true,
                ..*worker
            };
            waiting.share(&SEARCH, dir, 1, run.cancel, |claim, _| {
                search()?;
                claim.complete().map(|()| true)
            })?;
            let lost = || {
                JobError::Refused(format!(
                    "the processes that looked for transients have died; see to that, and give --attempts {} to try again",
                    worker.retry_limit + 1
                ))
            };
            found_in(dir).ok_or_else(lost).map(Some)
        }
    }
}

/// The search for what one pass saw and others looked through.
struct Search<'a> {
    run: &'a RunContext<'a>,
    points: AllPoints<'a>,
    quantization: Quantization,
    way: ScannerWay,
    /// The first and the last time of the way (s).
    times: [f64; 2],
    grid: VoxelGrid,
}

/// What was seen when, of some of the points.
struct Sightings {
    visits: Visits,
    points: u64,
    /// The points that were seen during the way of the scanner.
    on_way: u64,
    /// The points among these that the scanner can have seen from where it was.
    in_range: u64,
    /// The first and the last time of a point (s).
    times: [f64; 2],
}

impl Sightings {
    fn new(grid: VoxelGrid) -> Self {
        Self {
            visits: Visits::new(grid),
            points: 0,
            on_way: 0,
            in_range: 0,
            times: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    /// Moves all of `other` to these.
    fn take(&mut self, other: &mut Self) {
        self.visits.take(&mut other.visits);
        self.points += std::mem::take(&mut other.points);
        self.on_way += std::mem::take(&mut other.on_way);
        self.in_range += std::mem::take(&mut other.in_range);
        let [first, last] = other.times;
        self.times = [self.times[0].min(first), self.times[1].max(last)];
    }
}

impl<'a> Search<'a> {
    fn new(
        run: &'a RunContext<'a>,
        survey: &'a Survey,
        settings: &TransientSettings,
    ) -> Result<Self, JobError> {
        let way = scanner_way(&settings.trajectory, &survey.quantization)?;
        Ok(Self {
            run,
            points: AllPoints::new(run, survey),
            quantization: survey.quantization,
            times: way.times().unwrap_or_default(),
            way,
            grid: VoxelGrid {
                edge: settings.voxel_edge,
            },
        })
    }

    /// Finds all, and writes it to the job directory.
    fn complete(&self) -> Result<TransientVoxels, JobError> {
        let sightings = self.sightings()?;
        self.check_way(&sightings)?;
        let found = match sightings.visits.are_one() {
            true => TransientVoxels::of_one_visit(self.grid),
            false => {
                let doubtful = DoubtfulVoxels::among(sightings.visits);
                self.look(&doubtful)?;
                doubtful.decide()
            }
        };
        let path = self.run.job.dir.join(TRANSIENTS_FILE);
        write_among_others(&path, &found.to_bytes())?;
        Ok(found)
    }

    /// Reads when the points of each voxel were seen.
    fn sightings(&self) -> Result<Sightings, JobError> {
        let limit = (self.run.budget.usable() as f64 * VOXEL_SHARE) as u64;
        let all = Mutex::new(Sightings::new(self.grid));
        // Returns whether there is room for more.
        let gather = |own: &mut Sightings| {
            let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
            all.take(own);
            all.visits.bytes() <= limit
        };
        let range = SightLine::largest_range(self.grid);
        let begin = || Sightings::new(self.grid);
        let take = |own: &mut Sightings, points: &mut dyn Iterator<Item = (Stored, f64)>| {
            for (point, time) in points {
                let place = self.quantization.local(point);
                own.points += 1;
                if let Some(scanner) = self.way.at(time) {
                    own.on_way += 1;
                    own.in_range += u64::from((place - scanner).norm() <= range);
                }
                own.times = [own.times[0].min(time), own.times[1].max(time)];
                own.visits.add(place, self.moment(time));
            }
            own.visits.voxels() < VOXELS_OF_A_THREAD || gather(own)
        };
        let finish = |mut own| {
            gather(&mut own);
        };
        self.points.visit("visits", begin, take, finish)?;
        let all = all.into_inner().unwrap_or_else(PoisonError::into_inner);
        match all.visits.bytes() <= limit {
            true => Ok(all),
            false => Err(self.too_little_memory(&all)),
        }
    }

    fn too_little_memory(&self, sightings: &Sightings) -> JobError {
        let share = sightings.points as f64 / self.points.count().max(1) as f64;
        let bytes = sightings.visits.bytes() as f64 / share.min(1.0) / VOXEL_SHARE;
        JobError::Resources(format!(
            "--transients drop has to know when every place was seen, which takes more than --memory leaves for it after \
             {:.0} % of the points; give about {}, or cut the job by --bounds",
            100.0 * share,
            mebibytes(self.run.budget.needed(bytes))
        ))
    }

    /// Checks that points were seen during the way of the scanner, and from there.
    fn check_way(&self, sightings: &Sightings) -> Result<(), JobError> {
        let Sightings {
            points,
            on_way,
            in_range,
            times: [first, last],
            ..
        } = *sightings;
        if on_way == 0 && points > 0 {
            let [start, end] = self.times;
            return Err(JobError::Refused(format!(
                "no point was seen during the way of the scanner: the points have GPS times from {first} to {last}, the \
                 trajectory has times from {start} to {end}; both must count in the same way, as seconds of the week or \
                 as adjusted standard time"
            )));
        }
        if 2 * in_range < on_way {
            return Err(JobError::Refused(format!(
                "{:.0} % of the points are farther than {:.0} units from where the scanner was when it saw them: the \
                 trajectory has to be in the CRS of the inputs, or in that of --reproject",
                100.0 * (1.0 - in_range as f64 / on_way as f64),
                SightLine::largest_range(self.grid)
            )));
        }
        if 2 * on_way < points {
            self.run.progress.note(&format!(
                "{:.0} % of the points were seen at times that the trajectory leaves out; what they looked through is not \
                 known",
                100.0 * (1.0 - on_way as f64 / points as f64)
            ));
        }
        Ok(())
    }

    /// Counts the sight lines that passed by doubtful points.
    fn look(&self, doubtful: &DoubtfulVoxels) -> Result<(), JobError> {
        let take = |(): &mut (), points: &mut dyn Iterator<Item = (Stored, f64)>| {
            for (point, time) in points {
                let place = self.quantization.local(point);
                let scanner = self.way.at(time);
                if let Some(line) = scanner.and_then(|from| SightLine::new(from, place, self.grid))
                {
                    doubtful.look(line, self.moment(time));
                }
            }
            true
        };
        self.points.visit("sight lines", || (), take, drop)
    }

    fn moment(&self, time: f64) -> Moment {
        Moment::after(time - self.times[0])
    }
}

/// A source without the points of what has gone.
pub(super) struct WithoutTransients<'a> {
    pub(super) source: PointStream,
    pub(super) transients: &'a TransientVoxels,
    pub(super) quantization: Quantization,
    pub(super) record_length: usize,
}

impl Source for WithoutTransients<'_> {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        let mut counts = self.source.next_batch(records)?;
        let mut kept = 0;
        for start in (0..records.len()).step_by(self.record_length) {
            let record = start..start + self.record_length;
            let place = self
                .quantization
                .local(Stored::of_record(&records[record.clone()]));
            if self.transients.contain(place) {
                counts.filtered += 1;
            } else {
                records.copy_within(record, kept);
                kept += self.record_length;
            }
        }
        records.truncate(kept);
        Ok(counts)
    }
}
