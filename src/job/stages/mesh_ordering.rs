//! The way from settled records to points in the order of a mesh.

use std::path::Path;

use super::{
    mesh_source::MeshSource,
    ordered_points::{OrderedPoints, OrderingGrids},
    planned_job::PlannedJob,
    scanner_way::scanner_way,
};
use crate::{
    config::MeshSettings,
    geometry::{Quantization, Viewpoints},
    job::{
        context::RunContext,
        directory::Scratch,
        error::JobError,
        progress::{Progress, Unit},
    },
    las::{LasError, RecordSorter, SortingSpace, StoreError},
    mesh::MeshRules,
    tile::SpillSpace,
};

/// The most points that the indices of a mesh can count.
const MOST_POINTS: u64 = i32::MAX as u64;

/// Records on their way into the order of a mesh.
pub(super) struct Ordering<'a> {
    /// The file of the mesh.
    mesh: &'a Path,
    grids: OrderingGrids,
    sorter: Box<dyn RecordSorter>,
}

impl<'a> Ordering<'a> {
    /// Begins to sort the records of a planned job, with temporary files in `scratch`; `None` if the job makes
    /// no mesh.
    ///
    /// # Errors
    ///
    /// [`JobError`] if no temporary file can be made.
    pub(super) fn begin(
        run: &'a RunContext<'_>,
        planned: &PlannedJob,
        scratch: &Scratch,
    ) -> Result<Option<Self>, JobError> {
        let Some(mesh) = &run.job.mesh else {
            return Ok(None);
        };
        let solver = &planned.solver;
        let grids = OrderingGrids::new(solver.options.spacing, &solver.plan.quantization);
        let space = SpillSpace {
            directory: scratch.path().to_owned(),
            buffer_bytes: run.budget.buffers(),
        };
        let sorter = space.begin(
            "mesh",
            grids.groups,
            solver.transfer.record().record_length(),
        );
        Ok(Some(Self {
            mesh,
            grids,
            sorter: sorter.map_err(|e| unsorted(run, &e))?,
        }))
    }

    /// Adds records, in any order.
    ///
    /// # Errors
    ///
    /// [`JobError`] if they cannot be written.
    pub(super) fn push(&mut self, run: &RunContext<'_>, records: &[u8]) -> Result<(), JobError> {
        self.sorter.push(records).map_err(|e| unsorted(run, &e))
    }

    /// Puts all records in order.
    ///
    /// # Errors
    ///
    /// [`JobError`] if temporary files or the trajectory cannot be read, or the points are too many for a
    /// mesh.
    pub(super) fn complete(
        self,
        run: &'a RunContext<'a>,
        planned: &'a PlannedJob,
        scratch: &Scratch,
    ) -> Result<MeshSource<'a>, JobError> {
        let solver = &planned.solver;
        let record = solver.transfer.record();
        let sorted = self.sorter.finish().map_err(|e| unsorted(run, &e))?;
        if sorted.points() > MOST_POINTS {
            return Err(JobError::Refused(format!(
                "a mesh has at most {MOST_POINTS} points, and the cloud has {}; cut it by --bounds, \
                 or give a larger --spacing",
                sorted.points()
            )));
        }
        run.progress
            .begin("order", sorted.points(), 0, Unit::Points);
        let path = scratch.path().join("mesh.ordered");
        let advance = |points| run.progress.advance(points);
        let length = record.record_length();
        let points = OrderedPoints::new(&*sorted, &self.grids, length, &path, &advance)?;
        sorted.remove();
        run.progress.end();
        let settings = planned.mesh_settings(&run.job.settings);
        Ok(MeshSource {
            run,
            path: self.mesh,
            points,
            grids: self.grids,
            record,
            normal: solver.transfer.normal().ok_or_else(|| {
                JobError::Refused("a mesh needs normals; please report this".into())
            })?,
            viewpoints: viewpoints(&settings, &solver.plan.quantization)?,
            rules: MeshRules {
                points: settings.points,
                keeps_edges: solver.options.edge_capture.is_some(),
            },
            quantization: solver.plan.quantization,
            spacing: solver.options.spacing,
            crs: planned.survey.crs.clone(),
        })
    }
}

/// Where the scanner was, by the `settings`, in the local coordinates of `quantization`.
fn viewpoints(
    settings: &MeshSettings,
    quantization: &Quantization,
) -> Result<Viewpoints, JobError> {
    if let Some(path) = &settings.trajectory {
        return Ok(Viewpoints::Moving(scanner_way(path, quantization)?));
    }
    let local = |place: [f64; 3]| quantization.local_of_world(place);
    Ok(match settings.scanners.as_slice() {
        [] => Viewpoints::Unknown,
        places => Viewpoints::Places(places.iter().copied().map(local).collect()),
    })
}

fn unsorted(run: &RunContext<'_>, error: &StoreError) -> JobError {
    LasError::new(&run.job.output, format!("cannot be put in order: {error}")).into()
}
