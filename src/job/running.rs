//! A job from its inputs to its output.

use std::{
    fs::{self, File},
    path::PathBuf,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
    thread,
};

use serde::{Deserialize, Serialize};

use super::{
    InputCount, JobError, JobPlan, LeftOut, Outcome, Progress, Survey, TileFigures, Unit, Worker,
    directory::{
        DiskNeed, InputStamps, JobDirectory, Scratch, SolvedTiles, Stamp, bytes_in, check_room,
    },
    planning::Planning,
    provenance::{checksums, provenance},
    queue::Queue,
    resources::{Budget, Clock, Forecast, mebibytes},
    scattering::{Scattering, input_counts},
    transfer::Transfer,
    writing,
};
use crate::{
    config::Settings,
    las::{CloudHeader, CloudWriter, CompleteCloud, Format, LasError, Workspace},
    lloyd::SolverOptions,
    picture::View,
    tile::{SettledTiles, Spill, Tile, TileError},
    views::{CloudPair, Coloring, PictureOptions, UniformityMap, WorstPlace, draw_picture},
};

/// The picture of what came out.
const OVERVIEW: PictureOptions = PictureOptions {
    view: View::Oblique,
    coloring: Coloring::Auto,
    size: [1280, 640],
    point_size: None,
};

/// Seconds that come after the tiles are solved: for a million points of the output to be
/// stitched, written and sorted, and for the views of them.
const STITCH_SECONDS: f64 = 0.2;
const WRITE_SECONDS: f64 = 0.5;
const SORT_SECONDS: f64 = 0.7;
const LOOK_SECONDS: f64 = 0.2;

/// A job to be done.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Job {
    /// Files, directories and patterns.
    pub(crate) inputs: Vec<PathBuf>,
    /// Where the cloud goes.
    pub(crate) output: PathBuf,
    /// Where temporary files go.
    pub(crate) dir: PathBuf,
    /// Where those go that only the last stage needs, if there is room; nothing if that is
    /// no other place.
    #[serde(skip)]
    pub(crate) scratch: Option<PathBuf>,
    /// How it is done.
    pub(crate) settings: Settings,
    /// Whether an existing output is replaced.
    pub(crate) overwrite: bool,
    /// Whether temporary files stay.
    pub(crate) keep: bool,
    /// Whether inputs that cannot be read are left out.
    pub(crate) skip_bad_files: bool,
    /// Whether what an earlier run left is forgotten.
    pub(crate) restart: bool,
}

impl Job {
    /// Does the job; what an earlier run of the same job left is used. When all is
    /// done but that the output gets its name, `report` is called; what it fails with
    /// fails the job, and the same job goes on there. `None` if an earlier run had
    /// come to its end already and was stopped while it tidied up.
    ///
    /// # Errors
    ///
    /// See [`JobError`]. What is done stays in the job directory, and the same
    /// job goes on from it; nothing is left under the output's name.
    pub(crate) fn run(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        report: impl FnOnce(&Outcome) -> Result<(), JobError>,
    ) -> Result<Option<Outcome>, JobError> {
        let format = self.check_output()?;
        let pool = threads(self.settings.threads)?;
        let worker = Worker::until_all_is_done(self.settings.threads);
        self.watched(progress, |forecast, clock| {
            let prepared = pool.install(|| self.prepare(&worker, forecast, cancel, &clock))?;
            let Some(running) = prepared else {
                return Ok(None);
            };
            forecast.expect(&self.seconds_ahead(&running.plan));
            let tiles = self.solve(&running, &pool, forecast, cancel)?;
            clock.end_stage("solve");
            let (outcome, cloud) =
                pool.install(|| self.finish(&running, &tiles, format, forecast, cancel, clock))?;
            report(&outcome)?;
            self.deliver(running, cloud)?;
            Ok(Some(outcome))
        })
    }

    /// Does `work`, and tells `progress` all the while where it stands.
    pub(super) fn watched<T>(
        &self,
        progress: &dyn Progress,
        work: impl FnOnce(&Forecast<'_>, Clock) -> T,
    ) -> T {
        let forecast = &Forecast::new(progress);
        thread::scope(|scope| {
            let clock = Clock::start(scope, &self.dir, self.budget().total, forecast);
            work(forecast, clock)
        })
    }

    /// Gives the output its name: then the job is done, and forgotten.
    fn deliver(&self, mut running: Running, cloud: CompleteCloud) -> Result<(), JobError> {
        let stamp = Stamp::of(cloud.part());
        let stamp = stamp.map_err(|e| JobError::io("read", cloud.part(), e))?;
        running.directory.deliver(stamp)?;
        cloud.deliver()?;
        if !self.keep {
            running.directory.clear();
        }
        Ok(())
    }

    /// The stages from the first tile on, and the seconds that each will take, about.
    fn seconds_ahead(&self, plan: &JobPlan) -> [(&'static str, f64); 4] {
        let million = 1e-6 * plan.points_out as f64;
        let sort = if self.is_sorted() { SORT_SECONDS } else { 0.0 };
        [
            ("solve", plan.seconds_to_solve),
            ("stitch", STITCH_SECONDS * million),
            ("write", WRITE_SECONDS * million),
            ("sort", LOOK_SECONDS + sort * million),
        ]
    }

    /// Does all that comes before the first tile is solved, and says what would
    /// be done; `None` as for [`run`](Self::run).
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub(crate) fn plan(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Option<JobPlan>, JobError> {
        let pool = threads(self.settings.threads)?;
        let worker = Worker::until_all_is_done(self.settings.threads);
        let prepared = self.watched(progress, |progress, clock| {
            pool.install(|| self.prepare(&worker, progress, cancel, &clock))
        })?;
        Ok(prepared.map(|running| {
            let plan = running.plan;
            if !self.keep {
                running.directory.abandon();
            }
            plan
        }))
    }

    /// Whether the output's points are sorted by place before they are written.
    pub(super) fn is_sorted(&self) -> bool {
        matches!(self.format(), Ok(Format::Copc | Format::Tiles))
    }

    fn format(&self) -> Result<Format, LasError> {
        let of_file = Format::of_path(&self.output);
        match (self.settings.output_tiles, of_file) {
            (None, of_file) => of_file,
            (Some(_), Err(_)) => Ok(Format::Tiles),
            (Some(_), Ok(_)) => Err(LasError::new(
                &self.output,
                "is the name of a file; --output-tiles wants that of a directory",
            )),
        }
    }

    /// The most memory that it may hold, in bytes: what was asked for, or three quarters of
    /// what there is.
    pub(crate) fn memory(&self) -> u64 {
        self.budget().total
    }

    fn budget(&self) -> Budget {
        Budget::new(self.settings.memory, self.settings.threads)
    }

    /// Refuses now what would fail at the end of the night.
    pub(super) fn check_output(&self) -> Result<Format, JobError> {
        let format = self.format()?;
        format.check_replaceable(&self.output)?;
        let wrong = |e| LasError::new(&self.output, format!("cannot be written: {e}"));
        let trial = self.output.with_extension("lloydar-trial");
        File::create(&trial).map_err(wrong)?;
        fs::remove_file(&trial).map_err(wrong)?;
        Ok(format)
    }

    /// Survey, scatter, spacing and plan; `None` if the job is done. If several processes have
    /// begun to scatter it, it is `worker` that does it with them.
    pub(super) fn prepare(
        &self,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        clock: &Clock,
    ) -> Result<Option<Running>, JobError> {
        let (survey, inputs) = self.survey(progress)?;
        let directory = JobDirectory::open(&self.dir, self.identity(&inputs), self.restart)?;
        if directory.has_delivered(&self.output) {
            if !self.keep {
                directory.clear();
            }
            return Ok(None);
        }
        if let Err(error) = self.check_free() {
            directory.abandon();
            return Err(error);
        }
        clock.end_stage("survey");
        let prepared = self.prepare_in(&directory, survey, worker, progress, cancel, clock);
        let prepared = prepared.and_then(|prepared| inputs.check().map(|()| prepared));
        let prepared = prepared.and_then(|(survey, spill, options, plan)| {
            let checksums = checksums(&survey, &directory)?;
            Ok((survey, spill, options, plan, checksums))
        });
        match prepared {
            Ok((survey, spill, options, plan, checksums)) => Ok(Some(Running {
                checksums,
                inputs: input_counts(&survey, &spill),
                transfer: Transfer::new(&survey.record, &self.settings),
                directory,
                survey,
                spill,
                options,
                plan,
            })),
            Err(error) => {
                if !error.is_resumable() {
                    // The next try, with other inputs or settings, is another job.
                    directory.abandon();
                }
                Err(error)
            }
        }
    }

    fn prepare_in(
        &self,
        directory: &JobDirectory,
        survey: Survey,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        clock: &Clock,
    ) -> Result<(Survey, Spill, SolverOptions, JobPlan), JobError> {
        let budget = &self.budget();
        let (survey, spill) = self.spill(directory, survey, worker, progress, cancel)?;
        clock.end_stage("scatter");
        if spill.points() == 0 {
            return Err(JobError::Refused(
                "no point of the input is within the range of its own scale; there is nothing to \
                 resample"
                    .into(),
            ));
        }
        let planning = Planning {
            job: self,
            survey: &survey,
            directory,
            spill: &spill,
            budget,
        };
        let (spacing, points_out) = planning.spacing(progress)?;
        let seeds_per_point = points_out as f64 / spill.points() as f64;
        let options = self.settings.solver.at(spacing, seeds_per_point);
        let plan = planning.tiles(&options, points_out, progress)?;
        clock.end_stage("plan");
        Ok((survey, spill, options, plan))
    }

    /// What the headers say, and the inputs as they are now.
    fn survey(&self, progress: &dyn Progress) -> Result<(Survey, InputStamps), JobError> {
        let budget = self.budget();
        if budget.total < budget.least() {
            return Err(JobError::Refused(format!(
                "--memory {} is too little for any job; give at least {}",
                mebibytes(budget.total),
                mebibytes(budget.least())
            )));
        }
        let survey = Survey::of(&self.inputs, &self.settings, self.skip_bad_files)?;
        for note in &survey.notes {
            progress.note(note);
        }
        let inputs = InputStamps::of(survey.paths());
        Ok((survey, inputs))
    }

    /// Refuses an output that is there and is not to be replaced.
    fn check_free(&self) -> Result<(), JobError> {
        match self.output.exists() && !self.overwrite {
            true => {
                let problem = "exists already; give another name, or --overwrite";
                Err(LasError::new(&self.output, problem).into())
            }
            false => Ok(()),
        }
    }

    /// Scatters what no other process does, without taking hold of the job directory.
    pub(super) fn join_scatter(
        &self,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        self.format()?;
        let (survey, inputs) = self.survey(progress)?;
        if !JobDirectory::join(&self.dir, self.identity(&inputs), &self.output)? {
            return Ok(());
        }
        self.check_free()?;
        check_room(&[self.room_for(&survey)])?;
        self.scattering(&survey, progress, cancel).share(worker)?;
        inputs.check()
    }

    fn scattering<'a>(
        &'a self,
        survey: &'a Survey,
        progress: &'a dyn Progress,
        cancel: &'a AtomicBool,
    ) -> Scattering<'a> {
        Scattering {
            survey,
            dir: &self.dir,
            budget: self.budget(),
            keep_going: self.skip_bad_files,
            progress,
            cancel,
        }
    }

    /// What the points of all inputs take that are not spilled yet.
    fn room_for(&self, survey: &Survey) -> DiskNeed<'_> {
        let is_spill = |name: &str| name.starts_with("spill") && name.ends_with(".bin");
        let held = bytes_in(&self.dir, is_spill);
        let inputs = survey.inputs.iter();
        let largest = inputs.max_by_key(|input| input.points_claimed);
        let largest = largest.map_or_else(String::new, |input| {
            let (claimed, path) = (input.points_claimed, input.path.display());
            format!(", {claimed} of them in {path},")
        });
        let record_length = survey.record.record_length() as u64;
        let points = survey.points_claimed();
        DiskNeed {
            what: format!("all points{largest}"),
            dir: &self.dir,
            bytes: (points.saturating_mul(record_length)).saturating_sub(held),
        }
    }

    /// What makes this job this job: inputs as they are now, and what decides
    /// the result. Memory and threads do not.
    fn identity(&self, inputs: &InputStamps) -> serde_json::Value {
        let settings = Settings {
            memory: None,
            threads: 1,
            ..self.settings.clone()
        };
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "inputs": inputs.by_name(),
            "settings": settings,
        })
    }

    /// The spill of all inputs, or of those that can be read.
    fn spill(
        &self,
        directory: &JobDirectory,
        mut survey: Survey,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(Survey, Spill), JobError> {
        let skip = self.skip_bad_files;
        // What an earlier run found only as it decoded.
        if let Some(bad) = directory.read::<Vec<LeftOut>>("left-out.json")
            && skip
        {
            survey = survey.without(bad)?;
        }
        loop {
            check_room(&[self.room_for(&survey)])?;
            let scattering = self.scattering(&survey, progress, cancel);
            match scattering.complete(worker) {
                Err(JobError::BadFiles(bad)) if skip => {
                    // Some of their points are spilled already: once more, without.
                    for bad in &bad {
                        progress.note(&format!("{} is left out: it {}", bad.path, bad.reason));
                    }
                    survey = survey.without(bad)?;
                    directory.forget(|name| name.starts_with("spill"));
                    directory.write("left-out.json", &survey.left_out)?;
                }
                other => return Ok((survey, other?)),
            }
        }
    }

    /// Solves the tiles that are not solved yet.
    fn solve(
        &self,
        running: &Running,
        pool: &rayon::ThreadPool,
        progress: &Forecast<'_>,
        cancel: &AtomicBool,
    ) -> Result<SolvedTiles, JobError> {
        let tiles = &running.plan.plan.tiles;
        let mut solved_tiles = SolvedTiles::open(
            running.directory.path(),
            super::cluster::block_files(running.directory.path())?,
        )?;
        let (done, missing): (Vec<Tile>, Vec<Tile>) = tiles
            .iter()
            .partition(|tile| solved_tiles.contains(tile.id));
        progress.begin("solve", tiles.len() as u64, done.len() as u64, Unit::Tiles);
        let cost = |tiles: &[Tile]| tiles.iter().map(|tile| tile.cost).sum::<u64>();
        let (all, over) = (cost(tiles), AtomicU64::new(cost(&done)));
        let watch = |tile: &Tile, share: f64| {
            let over_before = over.load(Ordering::Relaxed) as f64;
            progress.reach((over_before + share * tile.cost as f64) / all as f64);
            if share >= 1.0 {
                over.fetch_add(tile.cost, Ordering::Relaxed);
                progress.advance(1);
            }
        };
        running
            .queue()
            .solve(&missing, &mut solved_tiles, pool, &watch, cancel)?;
        progress.end();
        Ok(solved_tiles)
    }

    fn finish(
        &self,
        running: &Running,
        solved: &SolvedTiles,
        format: Format,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        clock: Clock,
    ) -> Result<(Outcome, CompleteCloud), JobError> {
        for note in running.notes().iter().skip(running.survey.notes.len()) {
            progress.note(note);
        }
        let (quantization, spacing) = (&running.survey.quantization, running.options.spacing);
        let plan = &running.plan.plan;
        progress.begin("stitch", plan.tiles.len() as u64, 0, Unit::Tiles);
        let scratch = Scratch::choose(
            self.scratch.as_deref(),
            running.directory.path(),
            running.bytes_to_settle(self.is_sorted()),
            progress,
        )?;
        let mut settled = SettledTiles::create(scratch.path())?;
        let seams = writing::settle(plan, solved, &mut settled, quantization, spacing, progress)?;
        progress.end();
        clock.end_stage("stitch");
        if cancel.load(Ordering::Relaxed) {
            return Err(JobError::Tile(TileError::Cancelled));
        }
        let figures = plan.tiles.iter().map(|tile| solved.figures(tile.id));
        let tiles: Vec<TileFigures> = figures.collect::<Result<_, JobError>>()?;
        let largest = tiles.iter().max_by_key(|tile| tile.sites);
        let largest = largest.map_or(0, |figures| figures.tile.id);
        let clouds = CloudPair {
            plan,
            spill: &running.spill,
            settled: &settled,
            record_length: running.transfer.record().record_length(),
            has_color: running.transfer.record().has_color(),
            sites_per_point: running.options.seeds_per_point,
            quantization,
            spacing,
        };
        let mut uniformity_map = UniformityMap::of_input(&running.spill);
        progress.begin("write", plan.tiles.len() as u64, 0, Unit::Tiles);
        let header = CloudHeader {
            record: running.transfer.record().clone(),
            quantization: *quantization,
            crs: running.survey.crs.clone(),
            kept_records: running.survey.kept_records(),
            has_standard_time: running.survey.has_standard_time,
            provenance: provenance(
                &self.settings,
                spacing,
                &running.survey,
                &running.checksums,
                &running.spill,
            ),
        };
        let budget = self.budget();
        let workspace = Workspace {
            spacing,
            tile_edge: self.settings.output_tiles.unwrap_or(0.0),
            stem: scratch.path().join("octree"),
            buffer_bytes: budget.buffers(),
            sort_bytes: budget.tile() as usize / 2,
        };
        let mut writer = CloudWriter::create(&self.output, format, &header, &workspace)?;
        let (stitched, by_tile) = writing::write(
            plan,
            &settled,
            quantization,
            spacing,
            running.transfer.record().record_length(),
            seams,
            &mut uniformity_map,
            &mut writer,
            progress,
        )?;
        progress.end();
        clock.end_stage("write");
        let overview = draw_picture(
            &OVERVIEW,
            writer.points(),
            running.transfer.record().has_color(),
            quantization,
            &|draw| clouds.visit(draw),
        )?;
        let worst = uniformity_map.worst().into_iter().map(|(delta, point)| {
            Ok(WorstPlace {
                place: quantization.world(point),
                delta,
                detail: clouds.around([point.x.into(), point.y.into()])?,
            })
        });
        let worst = worst.collect::<Result<Vec<WorstPlace>, JobError>>()?;
        let detail = clouds.at_middle(largest)?;
        let viewer_sample = clouds.viewer_sample(largest)?;
        clock.end_stage("look");
        if self.is_sorted() {
            progress.begin("sort", running.plan.points_out, 0, Unit::Points);
        }
        let cloud = writer.complete(&|points| progress.advance(points))?;
        let points = cloud.points();
        if self.is_sorted() {
            progress.end();
            clock.end_stage("sort");
        }
        let sites: u64 = tiles.iter().map(|tile| tile.sites).sum();
        if points != sites {
            return Err(JobError::Refused(format!(
                "{sites} points were solved and {points} written; please report this"
            )));
        }
        let (stages, held) = clock.stop(&self.dir);
        let outcome = Outcome {
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
            detail,
            viewer_sample,
            uniformity_map,
            overview,
            worst,
            points,
            bytes: cloud.bytes(),
            stages,
            held,
            notes: running.notes(),
        };
        Ok((outcome, cloud))
    }
}

/// So many threads.
pub(super) fn threads(count: usize) -> Result<rayon::ThreadPool, JobError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
    pool.map_err(|e| JobError::Refused(format!("cannot start {count} threads: {e}")))
}

/// A job whose tiles are known.
pub(super) struct Running {
    directory: JobDirectory,
    pub(super) survey: Survey,
    /// Of the inputs, as far as they are named.
    checksums: Vec<String>,
    spill: Spill,
    options: SolverOptions,
    transfer: Transfer,
    pub(super) plan: JobPlan,
    inputs: Vec<InputCount>,
}

impl Running {
    /// What the last stage needs for itself, in bytes: all sites as they are settled, and, if the output is sorted, once more.
    fn bytes_to_settle(&self, is_sorted: bool) -> u64 {
        let records = self.plan.points_out * self.transfer.record().record_length() as u64;
        if is_sorted { 2 * records } else { records }
    }

    fn queue(&self) -> Queue<'_> {
        Queue {
            spill: &self.spill,
            plan: &self.plan.plan,
            quantization: self.survey.quantization,
            options: &self.options,
            transfer: &self.transfer,
        }
    }

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
}
