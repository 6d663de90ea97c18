//! Normals, rounded to one of a few directions.

use crate::geometry::Local;

/// A component of a normal, over the largest, is rounded to 0, ± this or ± 1. With a finer
/// step a curved surface falls into more grains; with a coarser one a lattice is stretched by
/// more than a twentieth on the planes that it serves. On a sphere (300 K points, 10 K sites,
/// 20 iterations) the energy ratio is 1.014 with no step between 0 and 1, 1.006 with this one,
/// 1.010 with steps of 0.4.
const STEP: f64 = 2.0 / 3.0;

/// A normal that is rounded to one of a few directions.
pub(super) struct RoundedNormal {
    /// The unit vector of the direction.
    pub(super) unit: Local,
    /// The axis along which the normal has its largest component.
    pub(super) largest: usize,
    /// The components over the largest, in steps.
    pub(super) steps: [i8; 3],
}

impl RoundedNormal {
    /// The direction to which `normal` is rounded, whatever its length and its sign.
    pub(super) fn of(normal: Local) -> Self {
        let largest = normal.iamax();
        let mut steps = normal.map(|c| (c / normal[largest] / STEP).round());
        steps[largest] = 2.0;
        Self {
            unit: steps.map(|c| (c * STEP).clamp(-1.0, 1.0)).normalize(),
            largest,
            steps: steps.map(|c| c as i8).into(),
        }
    }
}
