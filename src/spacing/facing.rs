//! The directions that the planes of a cloud face, from a sample of its parts.

use super::sample::{Parts, SampleSize};
use crate::{
    geometry::Quantization,
    lloyd::{DominantNormals, SeedRule, SolverOptions},
    tiling::CountedCloud,
};

/// Points among which parts are drawn.
const POINTS_FOR_NORMALS: u64 = 3_000_000;
/// Parts whose normals are looked at.
const SAMPLE: SampleSize = SampleSize {
    parts: 8.0,
    share: 0.01,
};

/// The directions that many planes of `cloud` face, at the scale of `options`; none where seeds do not stand on lattices.
///
/// # Errors
///
/// If a part of the cloud cannot be gathered.
pub(crate) fn dominant_normals<C: CountedCloud>(
    cloud: &C,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Result<DominantNormals, C::Error> {
    if options.seeds != SeedRule::Hexagonal || options.grading.is_some() {
        return Ok(DominantNormals::default());
    }
    let parts = Parts::cut(cloud, quantization, options, POINTS_FOR_NORMALS);
    let normals = parts.normals(&parts.draw(SAMPLE), options)?;
    Ok(DominantNormals::among(normals.into_iter()))
}
