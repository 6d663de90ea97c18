//! A job whose points are scattered and whose tiles are planned.

use super::{input_counts::InputCount, survey::Survey, tile_solver::TileSolver};
use crate::{
    config::{MeshSettings, Settings},
    job::{
        directory::JobDirectory,
        numbers::{counted, thousands},
    },
    las::InputFile,
};

/// A job whose points are scattered and whose tiles are planned.
pub(crate) struct PlannedJob {
    /// The locked job directory.
    pub(crate) directory: JobDirectory,
    /// The headers of the inputs, without the inputs that are left out.
    pub(crate) survey: Survey,
    /// The checksums of the first inputs, which the output names; `None` for those that are read in part.
    pub(crate) checksums: Vec<Option<String>>,
    /// Numbers of points of each input.
    pub(crate) inputs: Vec<InputCount>,
    /// The spill, the plan and the options from which tiles are solved.
    pub(crate) solver: TileSolver,
}

impl PlannedJob {
    /// How the mesh is made: as the job's `settings` say and, where they know of no scanner, with those that the inputs
    /// tell of.
    pub(crate) fn mesh_settings(&self, settings: &Settings) -> MeshSettings {
        let mut mesh = settings.mesh.clone().unwrap_or_default();
        if mesh.scanners.is_empty() && mesh.trajectory.is_none() {
            let inputs = self.survey.inputs.iter();
            mesh.scanners = inputs.flat_map(InputFile::stations).collect();
        }
        mesh
    }

    /// Bytes of the temporary files of the last stage: the records of all sites, and `sorted_copies` of them.
    pub(crate) fn settled_bytes(&self, sorted_copies: u64) -> u64 {
        let record_length = self.solver.transfer.record().record_length() as u64;
        let records = self.solver.plan.points_out * record_length;
        (1 + sorted_copies) * records
    }

    /// Notes on inputs with points outside of the bounds that their headers state.
    pub(crate) fn notes_on_points(&self) -> Vec<String> {
        let outside = self.inputs.iter().filter(|input| input.outside > 0);
        let damaged = outside.map(|input| {
            format!(
                "{}: {} of {} outside of the bounds that its header states; the header or the points are damaged",
                input.path,
                thousands(input.outside),
                counted(input.read, "point")
            )
        });
        damaged.collect()
    }
}
