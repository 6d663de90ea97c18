//! The cloud of a job on its way to its file.

use super::{
    cloud_header::cloud_header,
    planned_job::PlannedJob,
    stitchers::{SORTED, Sorting, Stitchers},
    tile_solver::TileSolver,
};
use crate::{
    geometry::Rect,
    job::{
        context::RunContext,
        error::JobError,
        progress::{Progress, Unit},
        resources::Budget,
    },
    las::{
        CloudHeader, CloudWriter, CompleteCloud, Format, RecordSorter, SortedRecords, Workforce,
        Workspace, write_sorted,
    },
    tile::OneProcess,
};

/// The cloud of a job, before anything of it is written.
pub(super) struct CloudOutput<'a> {
    run: &'a RunContext<'a>,
    format: Format,
    header: CloudHeader,
    /// The finest spacing (CRS units).
    spacing: f64,
    sorting: Sorting,
    /// The memory that the plan was made for: processes that share a job divide its work alike.
    planned_memory: u64,
    /// The process that writes the cloud.
    alone: &'a OneProcess<'a>,
}

/// A cloud that is being written, from records in their order.
pub(super) enum OrderedCloud {
    /// The format keeps the order.
    Written(CloudWriter),
    /// The points are to be sorted.
    Sorted(Box<dyn RecordSorter>),
}

impl<'a> CloudOutput<'a> {
    /// The cloud of a planned job in this `format`, which this process writes `alone` or with the help of others.
    pub(super) fn new(
        run: &'a RunContext<'a>,
        planned: &PlannedJob,
        format: Format,
        alone: &'a OneProcess<'a>,
    ) -> Self {
        let solver = &planned.solver;
        Self {
            run,
            format,
            header: cloud_header(planned, &run.job.settings),
            spacing: solver.options.finest_spacing(),
            sorting: sorting(run, solver),
            planned_memory: solver.plan.budget,
            alone,
        }
    }

    /// Begins the cloud from records in their order.
    ///
    /// # Errors
    ///
    /// [`JobError`] if no file can be made.
    pub(super) fn begin(&self) -> Result<OrderedCloud, JobError> {
        if !self.run.job.is_sorted() {
            let writer = CloudWriter::create(&self.run.job.output, self.format, &self.header)?;
            return Ok(OrderedCloud::Written(writer));
        }
        let Sorting {
            grid,
            record_length,
            buffer_bytes,
        } = self.sorting;
        let space = self.alone.space(buffer_bytes);
        let sorter = space.begin(SORTED, grid, record_length);
        Ok(OrderedCloud::Sorted(sorter.map_err(JobError::of_store)?))
    }

    /// Completes the file of `cloud`, whose colours reach `brightest`. If it has levels, those of the points in `seen` are returned
    /// with it.
    ///
    /// # Errors
    ///
    /// [`JobError`] if it cannot be written.
    pub(super) fn complete(
        &self,
        cloud: OrderedCloud,
        brightest: u16,
        seen: Option<&Rect>,
    ) -> Result<CompleteCloud, JobError> {
        match cloud {
            OrderedCloud::Written(writer) => Ok(writer.complete()?),
            OrderedCloud::Sorted(sorter) => {
                let sorted = sorter.finish().map_err(JobError::of_store)?;
                self.write_sorted(sorted, brightest, seen, self.alone)
            }
        }
    }

    /// Writes the cloud of `sorted` points, and reports the stage.
    ///
    /// # Errors
    ///
    /// [`JobError`] if it cannot be written.
    pub(super) fn write_sorted(
        &self,
        sorted: Box<dyn SortedRecords>,
        brightest: u16,
        seen: Option<&Rect>,
        workforce: &dyn Workforce,
    ) -> Result<CompleteCloud, JobError> {
        let run = self.run;
        run.progress.begin("sort", sorted.points(), 0, Unit::Points);
        let workspace = Workspace {
            brightest,
            ..workspace(
                run,
                self.spacing,
                self.planned_memory,
                self.alone,
                workforce,
            )
        };
        let path = &run.job.output;
        let advance = |points| run.progress.advance(points);
        let (format, header) = (self.format, &self.header);
        let complete = write_sorted(path, format, header, &workspace, &*sorted, seen, &advance);
        // Whatever the writer says of it: the user has stopped it.
        run.check_cancelled()?;
        let complete = complete?;
        if !workforce.is_shared() {
            sorted.remove();
        }
        run.progress.end();
        run.clock.end_stage("sort");
        Ok(complete)
    }
}

impl OrderedCloud {
    /// Appends records.
    ///
    /// # Errors
    ///
    /// [`JobError`] if they cannot be written.
    pub(super) fn write(&mut self, records: &[u8]) -> Result<(), JobError> {
        match self {
            Self::Written(writer) => Ok(writer.write(records)?),
            Self::Sorted(sorter) => sorter.push(records).map_err(JobError::of_store),
        }
    }
}

/// How the points of the output of `solver` are sorted by position.
pub(super) fn sorting(run: &RunContext<'_>, solver: &TileSolver) -> Sorting {
    let (spacing, quantization) = (solver.options.spacing, &solver.plan.quantization);
    let length = solver.transfer.record().record_length();
    Sorting::new(spacing, quantization, length, run.budget.buffers())
}

/// What a cloud of this finest `spacing` (CRS units) is written with, in a job that was planned for so many bytes of memory.
pub(super) fn workspace<'a>(
    run: &RunContext<'_>,
    spacing: f64,
    planned_memory: u64,
    stitchers: &dyn Stitchers,
    workforce: &'a dyn Workforce,
) -> Workspace<'a> {
    let job = run.job;
    let budget = match workforce.is_shared() {
        true => Budget::new(Some(planned_memory), run.budget.threads),
        false => run.budget,
    };
    Workspace {
        spacing,
        tile_edge: job.settings.output_tiles.unwrap_or(0.0),
        pcd: job.settings.pcd,
        brightest: 0,
        sorting: stitchers.space(run.budget.buffers()),
        workforce,
        sort_bytes: budget.tile() as usize / 2,
    }
}
