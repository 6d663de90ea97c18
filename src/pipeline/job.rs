//! A job from its inputs to its output.

use std::{
    fs::{self, File},
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

use crossbeam::channel;
use serde::{Deserialize, Serialize};

use super::{
    Glimpse, JobError, Progress, Survey, TileFigures, Unit,
    memory::{Budget, peak_resident},
    solving::{figures_path, load, solve_tile},
    spacing, writing,
};
use crate::{
    config::{Settings, Target},
    geometry::Lattice,
    las::{CloudHeader, CloudWriter, Format, LasError, PointCounts, PointStream},
    lloyd::Options,
    tile::{
        CellGrid, Opener, Plan, PlanOptions, ScatterOptions, Source, SourceError, Spill, Tile,
        TileError, scatter, solved_path,
    },
};

/// A job to be done.
#[derive(Clone, Debug)]
pub struct Job {
    /// Files, directories and patterns.
    pub inputs: Vec<PathBuf>,
    /// Where the cloud goes.
    pub output: PathBuf,
    /// Where temporary files go.
    pub dir: PathBuf,
    /// How it is done.
    pub settings: Settings,
    /// Whether an existing output is replaced.
    pub overwrite: bool,
    /// Whether temporary files stay.
    pub keep: bool,
}

/// What would be done.
#[derive(Clone, Debug, Serialize)]
pub struct JobPlan {
    /// Points of the input.
    pub points: u64,
    /// Spacing of the output (CRS units).
    pub spacing: f64,
    /// Points of the output, about.
    pub points_out: u64,
    /// The tiles.
    pub plan: Plan,
    /// What a tile sees around its core (CRS units).
    pub halo: f64,
    /// Peak memory expected, in bytes.
    pub memory: u64,
    /// The budget, in bytes.
    pub budget: u64,
    /// Temporary files, in bytes.
    pub temporary: u64,
    /// Seconds expected, about.
    pub seconds: f64,
    /// Scale and offset of the output.
    pub lattice: Lattice,
}

/// Time and memory of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageCost {
    /// The stage.
    pub stage: String,
    /// Seconds that it took in this run.
    pub seconds: f64,
    /// Most memory held until its end, in bytes.
    pub peak: Option<u64>,
}

/// Points of one input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputCount {
    /// The file.
    pub path: String,
    /// Points that its header claims.
    pub claimed: u64,
    /// Points read.
    pub read: u64,
    /// Points out of the range of the run's scale, left out.
    pub rejected: u64,
    /// Points outside of the bounds that the header claims.
    pub outside: u64,
}

/// What a job did.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was planned.
    pub plan: JobPlan,
    /// Points of each input.
    pub inputs: Vec<InputCount>,
    /// Figures of each tile, in the order of the plan.
    pub tiles: Vec<TileFigures>,
    /// What the stitch found.
    pub stitched: writing::Stitched,
    /// Nearest distances by tile, as written.
    pub delta_by_tile: Vec<f64>,
    /// Points written.
    pub points: u64,
    /// Bytes written.
    pub bytes: u64,
    /// One place before and after.
    pub glimpse: Glimpse,
    /// What each stage took.
    pub stages: Vec<StageCost>,
    /// What is worth a line.
    pub notes: Vec<String>,
}

/// Points of an input that are decoded by themselves.
const PART_POINTS: u64 = 1_000_000;

/// Seconds for a million points to be decoded and spilled, and for a million
/// seeds to be moved once, on one core: rough, for the estimate of a plan.
const SCATTER_SECONDS: f64 = 0.9;
const STEP_SECONDS: f64 = 6.0;

impl Job {
    /// Does the job; what an earlier run of the same job left is used.
    ///
    /// # Errors
    ///
    /// See [`JobError`]. What is done stays in the job directory, and the same
    /// job goes on from it; nothing is left under the output's name.
    pub fn run(&self, progress: &dyn Progress, cancel: &AtomicBool) -> Result<Outcome, JobError> {
        let format = self.check_output()?;
        let pool = self.pool()?;
        let mut clock = Clock::new();
        let running = pool.install(|| self.prepare(progress, cancel, &mut clock))?;
        let tiles = self.solve(&running, &pool, progress, cancel)?;
        clock.stop("solve");
        let outcome =
            pool.install(|| self.finish(&running, tiles, format, progress, cancel, clock))?;
        if !self.keep {
            running.close();
        }
        Ok(outcome)
    }

    /// Does all that comes before the first tile is solved, and says what would
    /// be done.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn plan(&self, progress: &dyn Progress, cancel: &AtomicBool) -> Result<JobPlan, JobError> {
        self.pool()?.install(|| {
            let running = self.prepare(progress, cancel, &mut Clock::new())?;
            let plan = running.plan.clone();
            if !self.keep {
                running.close();
            }
            Ok(plan)
        })
    }

    fn pool(&self) -> Result<rayon::ThreadPool, JobError> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.settings.threads)
            .build()
            .map_err(|e| {
                JobError::Refused(format!(
                    "cannot start {} threads: {e}",
                    self.settings.threads
                ))
            })
    }

    /// Refuses now what would fail at the end of the night.
    fn check_output(&self) -> Result<Format, JobError> {
        let format = Format::of_path(&self.output)?;
        let wrong = |problem: String| JobError::Las(LasError::new(&self.output, problem));
        if self.output.exists() && !self.overwrite {
            return Err(wrong(
                "exists already; give another name, or --overwrite".into(),
            ));
        }
        let trial = self.output.with_extension("lloydar-trial");
        File::create(&trial).map_err(|e| wrong(format!("cannot be written: {e}")))?;
        fs::remove_file(&trial).map_err(|e| wrong(format!("cannot be written: {e}")))?;
        Ok(format)
    }

    /// Survey, scatter, spacing and plan.
    fn prepare(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        clock: &mut Clock,
    ) -> Result<Running, JobError> {
        let budget = Budget::new(self.settings.memory, self.settings.threads);
        if budget.total < budget.least() {
            return Err(JobError::Refused(format!(
                "--memory {} is too little for any job; give at least {}",
                mebibytes(budget.total),
                mebibytes(budget.least())
            )));
        }
        let survey = Survey::of(&self.inputs, Some(self.settings.target))?;
        for note in &survey.notes {
            progress.note(note);
        }
        let lock = self.open_directory(&survey)?;
        clock.stop("survey");
        let prepared = self.prepare_in_directory(survey, lock, &budget, progress, cancel, clock);
        if let Err(error) = &prepared
            && !error.is_cancelled()
        {
            // Nothing is solved that could be lost, and the next try, with
            // other inputs or settings, is another job.
            clear(&self.dir);
        }
        prepared
    }

    fn prepare_in_directory(
        &self,
        survey: Survey,
        lock: File,
        budget: &Budget,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        clock: &mut Clock,
    ) -> Result<Running, JobError> {
        let inputs = self.scatter(&survey, budget, progress, cancel)?;
        clock.stop("scatter");
        let spill = Spill::open(&self.dir)?;
        if spill.points() == 0 {
            return Err(JobError::Refused(
                "no point of the input is within the range of its own scale; there is nothing to \
                 resample"
                    .into(),
            ));
        }
        let (spacing, points_out) = self.spacing(&spill, &survey, progress)?;
        let seeds_per_point = points_out as f64 / spill.points() as f64;
        let options = self.settings.solver(spacing, seeds_per_point);
        let plan = self.plan_tiles(&spill, &survey, budget, &options, points_out)?;
        clock.stop("plan");
        Ok(Running {
            _lock: lock,
            dir: self.dir.clone(),
            survey,
            spill,
            options,
            plan,
            inputs,
        })
    }

    /// Makes the job directory or finds this very job in it, and takes hold of
    /// it.
    fn open_directory(&self, survey: &Survey) -> Result<File, JobError> {
        fs::create_dir_all(&self.dir)
            .map_err(|e| JobError::io("make the job directory", &self.dir, e))?;
        let lock_path = self.dir.join("lock");
        let lock = File::create(&lock_path).map_err(|e| JobError::io("create", &lock_path, e))?;
        if lock.try_lock().is_err() {
            return Err(JobError::Refused(format!(
                "{}: another process is at work on this job; wait for it, or choose another --job",
                self.dir.display()
            )));
        }
        let identity = self.identity(survey);
        let path = self.dir.join("job.json");
        match fs::read_to_string(&path) {
            Ok(found) if found == identity => {}
            Ok(_) => {
                return Err(JobError::Refused(format!(
                    "{}: holds a job with other inputs or settings; remove it, or choose another \
                     --job",
                    self.dir.display()
                )));
            }
            Err(_) => write_whole(&path, identity.as_bytes())?,
        }
        Ok(lock)
    }

    /// What makes this job this job: inputs as they are now, and what decides
    /// the result. Memory and threads do not.
    fn identity(&self, survey: &Survey) -> String {
        let inputs: Vec<String> = survey
            .inputs
            .iter()
            .map(|input| {
                let modified = fs::metadata(&input.path)
                    .and_then(|m| m.modified())
                    .ok()
                    .and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok())
                    .map_or(0, |d| d.as_nanos());
                format!("{} {} {modified}", input.path.display(), input.bytes)
            })
            .collect();
        let settings = Settings {
            memory: None,
            threads: 1,
            ..self.settings.clone()
        };
        let identity = serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "inputs": inputs,
            "settings": settings,
        });
        format!("{identity:#}")
    }

    fn scatter(
        &self,
        survey: &Survey,
        budget: &Budget,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Vec<InputCount>, JobError> {
        let counts_path = self.dir.join("inputs.json");
        if Spill::is_complete(&self.dir)
            && let Ok(text) = fs::read_to_string(&counts_path)
            && let Ok(counts) = serde_json::from_str(&text)
        {
            return Ok(counts);
        }
        progress.begin("scatter", survey.points_claimed(), 0, Unit::Points);
        // Biggest first: the last file to be decoded is a short one.
        let mut order: Vec<usize> = (0..survey.inputs.len()).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(survey.inputs[i].bytes));
        let parts: Vec<(usize, Range<u64>)> = order
            .into_iter()
            .flat_map(|i| {
                let parts = survey.inputs[i].parts(PART_POINTS);
                parts.into_iter().map(move |part| (i, part))
            })
            .collect();
        let counted: Vec<Mutex<PointCounts>> = parts.iter().map(|_| Mutex::default()).collect();
        let sources = parts
            .iter()
            .zip(&counted)
            .map(|((input, part), counts)| {
                Box::new(move || {
                    let input = &survey.inputs[*input];
                    let stream =
                        PointStream::open(input, part.clone(), &survey.record, survey.lattice)?;
                    Ok(Box::new(Decoding { stream, counts }) as Box<dyn Source>)
                }) as Opener<'_>
            })
            .collect();
        let options = ScatterOptions {
            record_length: survey.record.record_length(),
            threads: budget.decoders(),
            buffer_bytes: budget.buffers(),
        };
        let least = (1.0 / survey.lattice.scale).ceil() as i64;
        let grid = CellGrid::for_extent(survey.extent_claimed(), least.min(1 << 20));
        let done = scatter(
            sources,
            grid,
            &self.dir,
            options,
            &|n| progress.advance(n),
            cancel,
        );
        let scattered = done.map_err(|error| match error {
            TileError::Source(error) => match error.downcast::<LasError>() {
                Ok(error) => JobError::Las(*error),
                Err(error) => JobError::Tile(TileError::Source(error)),
            },
            other => JobError::Tile(other),
        })?;
        progress.end();
        let mut by_input = vec![PointCounts::default(); survey.inputs.len()];
        for (&(input, _), counts) in parts.iter().zip(counted) {
            let counts = counts.into_inner();
            by_input[input].add(&counts.unwrap_or_else(std::sync::PoisonError::into_inner));
        }
        let counts: Vec<InputCount> = survey
            .inputs
            .iter()
            .zip(by_input)
            .map(|(input, counts)| InputCount {
                path: input.path.display().to_string(),
                claimed: input.points_claimed,
                read: counts.read,
                rejected: counts.rejected,
                outside: counts.outside,
            })
            .collect();
        // Conservation: what was read is what was spilled, or rejected.
        let read: u64 = counts.iter().map(|c| c.read - c.rejected).sum();
        let spilled: u64 = scattered.points.iter().sum();
        if read != spilled {
            return Err(JobError::Refused(format!(
                "{read} points were read and {spilled} spilled: the spill is not to be trusted; \
                 please report this"
            )));
        }
        let text = serde_json::to_string_pretty(&counts).expect("counts are plain numbers");
        write_whole(&counts_path, text.as_bytes())?;
        Ok(counts)
    }

    /// The spacing, and about how many points it gives.
    fn spacing(
        &self,
        spill: &Spill,
        survey: &Survey,
        progress: &dyn Progress,
    ) -> Result<(f64, u64), JobError> {
        let path = self.dir.join("spacing.json");
        if let Ok(text) = fs::read_to_string(&path)
            && let Ok(found) = serde_json::from_str(&text)
        {
            return Ok(found);
        }
        let extent = spill.bounds().extent() as f64 * survey.lattice.scale;
        let found = match self.settings.target {
            Target::Spacing(spacing) => {
                // Points that are all at one place are one point, at any spacing.
                if extent > 0.0 && spacing > extent / 2.0 {
                    return Err(JobError::Refused(format!(
                        "--spacing {spacing} is too wide for this scan, which is {extent:.3} across \
                         (in CRS units): give less than half of that"
                    )));
                }
                if spacing < 2.0 * survey.lattice.scale {
                    return Err(JobError::Refused(format!(
                        "--spacing {spacing} is finer than coordinates on a scale of {} can tell; \
                         give at least {}",
                        survey.lattice.scale,
                        2.0 * survey.lattice.scale
                    )));
                }
                let seeds = spacing::expected(spill, &survey.lattice, &self.settings, spacing)?;
                (spacing, seeds.round() as u64)
            }
            Target::Count(count) => (
                spacing::for_count(spill, &survey.lattice, &self.settings, count)?,
                count,
            ),
            Target::Ratio(ratio) => {
                let count = ((spill.points() as f64 * ratio).round() as u64).max(1);
                (
                    spacing::for_count(spill, &survey.lattice, &self.settings, count)?,
                    count,
                )
            }
        };
        progress.note(&format!(
            "spacing {:.4}, about {} points out of {}",
            found.0,
            found.1,
            spill.points()
        ));
        let text = serde_json::to_string(&found).expect("two numbers");
        write_whole(&path, text.as_bytes())?;
        Ok(found)
    }

    fn plan_tiles(
        &self,
        spill: &Spill,
        survey: &Survey,
        budget: &Budget,
        options: &Options,
        points_out: u64,
    ) -> Result<JobPlan, JobError> {
        let lattice = survey.lattice;
        let halo = self.settings.halo.unwrap_or_else(|| options.halo());
        // A tile may lie where the scan is sparse: allow it a quarter more
        // than the mean.
        let seeds_per_point = 1.25 * points_out as f64 / spill.points() as f64;
        let most_points = budget.points_per_tile(seeds_per_point);
        let path = self.dir.join("plan.json");
        // Tiles solved under another plan would not fit together: the first
        // plan of a job stands, as long as it fits the budget of this run.
        let found = fs::read_to_string(&path)
            .ok()
            .and_then(|text| serde_json::from_str::<Plan>(&text).ok())
            .filter(|plan| {
                plan.most_points_seen() <= most_points || self.settings.tile_size.is_some()
            });
        let plan = match found {
            Some(plan) => plan,
            None => {
                let planned = Plan::make(
                    spill,
                    PlanOptions {
                        halo: lattice.units(halo),
                        margin: lattice.units(options.farthest_seed()),
                        tile_edge: self.settings.tile_size.map(|edge| lattice.units(edge)),
                        most_points,
                    },
                );
                let plan = planned.map_err(|error| match error {
                    TileError::TooDense { points, .. } => JobError::Refused(format!(
                        "--memory {} is too little: the densest place holds {points} points within a \
                         halo of {halo:.3}; give at least {}",
                        mebibytes(budget.total),
                        mebibytes(budget.needed_for(points, seeds_per_point))
                    )),
                    other => JobError::Tile(other),
                })?;
                self.forget_tiles()?;
                let text = serde_json::to_string(&plan).expect("a plan is plain numbers");
                write_whole(&path, text.as_bytes())?;
                plan
            }
        };
        let most = plan.most_points_seen();
        let needed = budget.needed_for(most, seeds_per_point);
        if needed > budget.total {
            return Err(JobError::Refused(format!(
                "--tile-size makes a tile of {most} points, which takes about {}, and --memory is {}; \
                 give smaller tiles or more memory",
                mebibytes(needed),
                mebibytes(budget.total)
            )));
        }
        let overlap: u64 = plan.tiles.iter().map(|tile| tile.points_seen).sum();
        let overlap = overlap as f64 / spill.points().max(1) as f64;
        let million = 1e-6 / self.settings.threads as f64;
        let seconds = spill.points() as f64 * million * SCATTER_SECONDS * (1.0 + overlap)
            + points_out as f64 * million * STEP_SECONDS * f64::from(options.iterations) * overlap;
        Ok(JobPlan {
            points: spill.points(),
            spacing: options.spacing,
            points_out,
            halo,
            memory: needed.max(budget.least()),
            budget: budget.total,
            temporary: spill.bytes() + points_out * (2 * spill.record_length() as u64 + 128),
            seconds,
            plan,
            lattice,
        })
    }

    /// Removes the results of tiles of another plan.
    fn forget_tiles(&self) -> Result<(), JobError> {
        let entries = fs::read_dir(&self.dir).map_err(|e| JobError::io("read", &self.dir, e))?;
        for entry in entries.filter_map(Result::ok) {
            if entry.file_name().to_string_lossy().starts_with("tile-") {
                fs::remove_file(entry.path())
                    .map_err(|e| JobError::io("remove", &entry.path(), e))?;
            }
        }
        Ok(())
    }

    /// Solves the tiles that are not solved yet, reading each while the one
    /// before it is solved.
    fn solve(
        &self,
        running: &Running,
        pool: &rayon::ThreadPool,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Vec<TileFigures>, JobError> {
        let tiles = &running.plan.plan.tiles;
        let (done, missing): (Vec<&Tile>, Vec<&Tile>) = tiles
            .iter()
            .partition(|tile| self.figures_of(tile.id).is_some());
        progress.begin("solve", tiles.len() as u64, done.len() as u64, Unit::Tiles);
        let (sender, receiver) = channel::bounded(0);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for tile in missing {
                    let loaded = pool.install(|| {
                        load(
                            &running.spill,
                            &running.plan.plan,
                            *tile,
                            running.survey.lattice,
                            &running.options,
                        )
                    });
                    if cancel.load(Ordering::Relaxed) || sender.send(loaded).is_err() {
                        return;
                    }
                }
            });
            for loaded in receiver {
                let start = Instant::now();
                let loaded = loaded?;
                let id = loaded.tile.id;
                let (solved, mut figures) =
                    pool.install(|| solve_tile(&running.spill, loaded, &running.options))?;
                figures.seconds = start.elapsed().as_secs_f64();
                let text = serde_json::to_string(&figures).expect("figures are plain numbers");
                write_whole(&figures_path(&self.dir, id), text.as_bytes())?;
                solved.write(&self.dir, id)?;
                progress.advance(1);
                if cancel.load(Ordering::Relaxed) {
                    break;
                }
            }
            Ok::<(), JobError>(())
        })?;
        if cancel.load(Ordering::Relaxed) {
            return Err(JobError::Tile(TileError::Cancelled));
        }
        progress.end();
        tiles
            .iter()
            .map(|tile| {
                self.figures_of(tile.id).ok_or_else(|| {
                    JobError::Refused(format!("tile {}: its figures are gone", tile.id))
                })
            })
            .collect()
    }

    /// The figures of a tile, if it is solved.
    fn figures_of(&self, tile: u32) -> Option<TileFigures> {
        let text = fs::read_to_string(figures_path(&self.dir, tile)).ok()?;
        solved_path(&self.dir, tile)
            .exists()
            .then(|| serde_json::from_str(&text).ok())
            .flatten()
    }

    fn finish(
        &self,
        running: &Running,
        tiles: Vec<TileFigures>,
        format: Format,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        mut clock: Clock,
    ) -> Result<Outcome, JobError> {
        for note in running.notes().iter().skip(running.survey.notes.len()) {
            progress.note(note);
        }
        let (lattice, spacing) = (&running.survey.lattice, running.options.spacing);
        let plan = &running.plan.plan;
        progress.begin("stitch", plan.tiles.len() as u64, 0, Unit::Tiles);
        let seams = writing::settle(plan, &self.dir, lattice, spacing, progress)?;
        progress.end();
        clock.stop("stitch");
        if cancel.load(Ordering::Relaxed) {
            return Err(JobError::Tile(TileError::Cancelled));
        }
        let largest = tiles.iter().max_by_key(|tile| tile.sites);
        let glimpse = Glimpse::of_job(
            plan,
            largest.map_or(0, |figures| figures.tile.id),
            &running.spill,
            &self.dir,
            lattice,
            spacing,
        )?;
        progress.begin("write", plan.tiles.len() as u64, 0, Unit::Tiles);
        let header = CloudHeader {
            record: running.survey.record.clone(),
            lattice: *lattice,
            crs: running.survey.crs.clone(),
            has_standard_time: running.survey.has_standard_time,
            provenance: self.provenance(running),
        };
        let mut writer = CloudWriter::create(&self.output, format, &header)?;
        let (stitched, by_tile) = writing::write(
            plan,
            &self.dir,
            lattice,
            spacing,
            running.spill.record_length(),
            seams,
            &mut writer,
            progress,
        )?;
        let (points, bytes) = writer.finish()?;
        progress.end();
        clock.stop("write");
        let sites: u64 = tiles.iter().map(|tile| tile.sites).sum();
        if points != sites {
            return Err(JobError::Refused(format!(
                "{sites} points were solved and {points} written; please report this"
            )));
        }
        Ok(Outcome {
            plan: running.plan.clone(),
            inputs: running.inputs.clone(),
            delta_by_tile: plan
                .tiles
                .iter()
                .map(|tile| {
                    by_tile
                        .get(&tile.id)
                        .map_or(f64::NAN, |t| t.figures().delta)
                })
                .collect(),
            tiles,
            stitched,
            glimpse,
            points,
            bytes,
            stages: clock.stages,
            notes: running.notes(),
        })
    }

    fn provenance(&self, running: &Running) -> String {
        let names: Vec<String> = running
            .survey
            .inputs
            .iter()
            .take(200)
            .map(|input| {
                input
                    .path
                    .file_name()
                    .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
            })
            .collect();
        let settings = Settings {
            memory: None,
            threads: 1,
            tile_size: None,
            halo: None,
            ..self.settings.clone()
        };
        serde_json::json!({
            "lloydar": env!("CARGO_PKG_VERSION"),
            "spacing": running.options.spacing,
            "settings": settings,
            "inputs": names,
            "points_read": running.spill.points(),
        })
        .to_string()
    }
}

/// A job whose tiles are known.
struct Running {
    /// Held as long as the job runs.
    _lock: File,
    dir: PathBuf,
    survey: Survey,
    spill: Spill,
    options: Options,
    plan: JobPlan,
    inputs: Vec<InputCount>,
}

impl Running {
    /// What is worth a line, of headers and of points.
    fn notes(&self) -> Vec<String> {
        let outside = self.inputs.iter().filter(|input| input.outside > 0);
        let damaged = outside.map(|input| {
            format!(
                "{}: {} of its {} points lie outside of the bounds that its header states; the \
                 header or the points are damaged",
                input.path, input.outside, input.read
            )
        });
        self.survey.notes.iter().cloned().chain(damaged).collect()
    }

    fn close(self) {
        clear(&self.dir);
    }
}

/// Removes a job's files from its directory, and the directory if nothing else
/// is in it.
fn clear(dir: &Path) {
    for name in [
        "job.json",
        "inputs.json",
        "spacing.json",
        "plan.json",
        "spill.bin",
        "spill.index",
        "lock",
    ] {
        drop(fs::remove_file(dir.join(name)));
    }
    for entry in fs::read_dir(dir)
        .into_iter()
        .flatten()
        .filter_map(Result::ok)
    {
        if entry.file_name().to_string_lossy().starts_with("tile-") {
            drop(fs::remove_file(entry.path()));
        }
    }
    drop(fs::remove_dir(dir));
}

/// A part of a file that is being decoded, and its counts.
struct Decoding<'a> {
    stream: PointStream,
    counts: &'a Mutex<PointCounts>,
}

impl Source for Decoding<'_> {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<usize, SourceError> {
        let read = self.stream.next_batch(records)?;
        *self
            .counts
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner) = self.stream.counts();
        Ok(read)
    }
}

/// Times the stages of a run.
struct Clock {
    last: Instant,
    stages: Vec<StageCost>,
}

impl Clock {
    fn new() -> Self {
        Self {
            last: Instant::now(),
            stages: Vec::new(),
        }
    }

    fn stop(&mut self, stage: &str) {
        self.stages.push(StageCost {
            stage: stage.to_owned(),
            seconds: self.last.elapsed().as_secs_f64(),
            peak: peak_resident(),
        });
        self.last = Instant::now();
    }
}

/// Writes a small file, complete or not at all.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), JobError> {
    let aside = path.with_extension("part");
    let write = || -> std::io::Result<()> {
        fs::write(&aside, bytes)?;
        File::open(&aside)?.sync_all()?;
        fs::rename(&aside, path)
    };
    write().map_err(|e| JobError::io("write", path, e))
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}

/// A name for the directory of the job that makes `output`.
pub fn default_directory(output: &Path) -> PathBuf {
    let mut name = output
        .file_name()
        .map(std::ffi::OsStr::to_owned)
        .unwrap_or_default();
    name.push(".job");
    output.with_file_name(name)
}
