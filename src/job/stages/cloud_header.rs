//! What the header of the output says.

use super::{planned_job::PlannedJob, provenance::provenance};
use crate::{config::Settings, las::CloudHeader};

/// The header of the output of a `planned` job with these `settings`.
pub(crate) fn cloud_header(planned: &PlannedJob, settings: &Settings) -> CloudHeader {
    let (survey, solver) = (&planned.survey, &planned.solver);
    CloudHeader {
        record: solver.transfer.record().clone(),
        quantization: solver.plan.quantization,
        crs: survey.crs.clone(),
        carried_records: survey.carried_records(),
        has_standard_time: survey.has_standard_time,
        provenance: provenance(settings, planned),
    }
}
