//! The provenance of a cloud, which the output states for those who find it later.

use super::planned_job::PlannedJob;
use crate::config::{ResourceSettings, Settings, TilingSettings};

/// Describes as JSON how the cloud was made: program, settings that decide the result, inputs.
pub(super) fn provenance(settings: &Settings, planned: &PlannedJob) -> String {
    let survey = &planned.survey;
    let inputs: Vec<serde_json::Value> = survey
        .inputs
        .iter()
        .zip(&planned.checksums)
        .map(|(input, checksum)| {
            let name = input.path.file_name().map(|name| name.to_string_lossy());
            match checksum {
                Some(checksum) => serde_json::json!({ "name": name, "sha256": checksum }),
                None => serde_json::json!({ "name": name, "bytes": input.bytes, "is_read_in_part": true }),
            }
        })
        .collect();
    let mut settings = Settings {
        resources: ResourceSettings::UNSTATED,
        tiling: TilingSettings::default(),
        ..settings.clone()
    };
    // The polygon of a coast line would fill the record.
    settings.input.filter.polygons = None;
    if let Some(density) = &mut settings.density {
        density.leave_out_outlines();
    }
    serde_json::json!({
        "lloydar": env!("CARGO_PKG_VERSION"),
        "spacing": planned.solver.options.spacing,
        "settings": settings,
        "inputs": inputs,
        "inputs_in_all": survey.inputs.len(),
        "points_read": planned.solver.spill.points(),
    })
    .to_string()
}
