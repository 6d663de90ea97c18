//! One global spacing, from a spacing, a count or a ratio.
//!
//! How many sites a spacing gives depends on the surfaces, which nobody knows beforehand. So it is
//! estimated: seeds are elected in parts of the cloud, and the spacing is changed until the estimate meets
//! the count. Which parts these are depends on the cloud alone, not on tiles, threads or memory. Where nothing is asked
//! for, a round spacing is proposed ([`RoundSpacings`]).

mod distinct;
mod facing;
mod round;
mod sample;
mod scaling;
mod search;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub(crate) use facing::dominant_normals;
pub(crate) use round::{RoundSpacing, RoundSpacings, VoxelCounts};
pub(crate) use search::{estimated_count, spacing_for_count};

use crate::{
    geometry::{Quantization, longest_side},
    lloyd::{AREA_PER_SEED, SolverSettings, WantedCount},
    tiling::CountedCloud,
};

/// How dense the output is to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Target {
    /// Distance between neighbouring points of an even cloud (CRS units).
    Spacing(f64),
    /// Approximate number of output points.
    Count(u64),
    /// Approximate number of output points for each input point.
    Ratio(f64),
}

impl Target {
    /// The number of points that is asked for, if the spacing that meets the target was chosen for a number of
    /// `points`. Solvers whose iterations cannot be interrupted meet it as nearly as that spacing does.
    pub(crate) fn wanted_count(
        self,
        points: u64,
        is_exact: bool,
        solver: &SolverSettings,
    ) -> Option<WantedCount> {
        let is_count = !matches!(self, Self::Spacing(_));
        let wanted = WantedCount {
            sites: points,
            is_exact,
        };
        (is_count && solver.acceleration.has_rounds()).then_some(wanted)
    }

    /// The spacing that meets the target if the points between `min` and `max` lay on a flat square; nothing
    /// is known of it for a ratio.
    pub(crate) fn spacing_of_a_square(self, min: [f64; 3], max: [f64; 3]) -> Option<f64> {
        let extent = longest_side(min, max);
        match self {
            Self::Spacing(spacing) => Some(spacing),
            Self::Count(count) => Some(extent / (count as f64).sqrt()),
            Self::Ratio(_) => None,
        }
    }
}

/// Why no spacing can be given. Lengths are CRS units.
#[derive(Debug)]
pub(crate) enum SpacingError<E> {
    /// The spacing is more than half of what the cloud measures along its longest axis, or more than coordinates can tell if that is
    /// nothing.
    TooWide { spacing: f64, extent: f64 },
    /// The spacing is less than two steps of the quantization.
    TooFine { spacing: f64, scale: f64 },
    /// The count is more than [`MAX_SITES_PER_POINT`] for each point of the cloud.
    TooMany { count: u64, points: u64 },
    /// All points are equal, so that no spacing meets a count.
    AllEqual { points: u64 },
    /// The surfaces do not carry the count: at `spacing` there are approximately `reached` sites, and
    /// a smaller spacing does not give more.
    CannotCarry {
        count: u64,
        spacing: f64,
        reached: f64,
    },
    /// A part of the cloud could not be gathered.
    Gather(E),
}

/// More sites than this for each point of the scan would hardly stand where something was scanned.
pub(crate) const MAX_SITES_PER_POINT: u64 = 16;

/// The spacing that `target` asks for, and the approximate number of sites that it gives.
///
/// # Errors
///
/// See [`SpacingError`].
pub(crate) fn resolve<C: CountedCloud>(
    cloud: &C,
    quantization: &Quantization,
    settings: &SolverSettings,
    target: Target,
) -> Result<(f64, u64), SpacingError<C::Error>> {
    let for_count = |count| {
        Ok((
            spacing_for_count(cloud, quantization, settings, count)?,
            count,
        ))
    };
    match target {
        Target::Spacing(spacing) => {
            let extent = cloud.bounds().extent() as f64 * quantization.scale;
            let scale = quantization.scale;
            // Points that are all equal are one point, at any spacing that coordinates can tell.
            let widest = match extent > 0.0 {
                true => extent / 2.0,
                false => f64::from(u32::MAX) * scale,
            };
            if spacing > widest {
                return Err(SpacingError::TooWide { spacing, extent });
            }
            let finest = settings.at(spacing, 0.0).finest_spacing();
            if finest < 2.0 * scale {
                return Err(SpacingError::TooFine {
                    spacing: finest,
                    scale,
                });
            }
            // By this count it is judged which seeds are isolated, so that it is of all.
            let settings = settings.with_isolated();
            let count = estimated_count(cloud, quantization, &settings, spacing)?;
            Ok((spacing, count.round() as u64))
        }
        Target::Count(count) => for_count(count),
        Target::Ratio(ratio) => for_count(((cloud.points() as f64 * ratio).round() as u64).max(1)),
    }
}

/// Number of sites for which the occupied part of the plane has room at `spacing`, and half as many again
/// for what stands upright.
fn sites_of_the_plane(cloud: &impl CountedCloud, quantization: &Quantization, spacing: f64) -> f64 {
    let square = (cloud.square_edge() as f64 * quantization.scale).powi(2);
    1.5 * cloud.squares().count() as f64 * square / (AREA_PER_SEED * spacing * spacing)
}
