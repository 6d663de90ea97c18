//! What a caller of [`resample`](crate::resample) may choose.

use super::error::{ResampleError, SHORTEST_LENGTH};
use crate::{
    geometry::PatchKind,
    lloyd::{Acceleration, Restriction, SeedRule, SolverSettings},
    spacing::Target,
};

/// How a cloud is resampled: how dense the result is to be, and how it is solved.
///
/// Options begin with one of the three densities; each further setting replaces a default. Lengths are in
/// the unit of the points. Values are checked by [`resample`](crate::resample), which names the first that is
/// out of its range.
///
/// ```
/// use lloydar::{Options, SeedRule};
///
/// let options = Options::with_spacing(0.05).fill(0.3).iterations(30).seeds(SeedRule::Poisson);
/// # let _ = options;
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    pub(crate) target: Target,
    pub(crate) exact: bool,
    pub(crate) solver: SolverSettings,
    pub(super) scale: Option<f64>,
}

impl Options {
    /// Options for neighbouring points `spacing` apart: the edge of the hexagonal lattice that has as many
    /// points to the area.
    pub fn with_spacing(spacing: f64) -> Self {
        Self::new(Target::Spacing(spacing))
    }

    /// Options for `count` points. The count is met to within 0.3 %, or [exactly](Self::exact).
    pub fn with_count(count: u64) -> Self {
        Self::new(Target::Count(count))
    }

    /// Options for `ratio` output points to each input point, as near as a count is met: 0.02 keeps one in fifty, a ratio
    /// above 1 gives more points than there were.
    pub fn with_ratio(ratio: f64) -> Self {
        Self::new(Target::Ratio(ratio))
    }

    fn new(target: Target) -> Self {
        Self {
            target,
            exact: false,
            solver: SolverSettings::default(),
            scale: None,
        }
    }

    /// Meets a count or a ratio exactly: points that are too many leave where they are closest, missing ones come
    /// where gaps are widest, before the last iterations.
    #[must_use]
    pub fn exact(mut self) -> Self {
        self.exact = true;
        self
    }

    /// Sets the number of Lloyd iterations; 20 by default, the K of the paper.
    #[must_use]
    pub fn iterations(mut self, iterations: u32) -> Self {
        self.solver.iterations = iterations;
        self
    }

    /// Sets how centroids are extrapolated to the positions of the next iteration.
    #[must_use]
    pub fn acceleration(mut self, acceleration: Acceleration) -> Self {
        self.solver.acceleration = acceleration;
        self
    }

    /// Sets the rule by which seeds are chosen.
    #[must_use]
    pub fn seeds(mut self, rule: SeedRule) -> Self {
        self.solver.seeds = rule;
        self
    }

    /// Sets the kind of surface that is fitted near each point.
    #[must_use]
    pub fn patch(mut self, kind: PatchKind) -> Self {
        self.solver.patch = kind;
        self
    }

    /// Sets the radius of the surface fit, 1.2 spacings by default. A larger radius removes noise of that
    /// reach before anything else; a smaller one keeps finer detail.
    #[must_use]
    pub fn smooth(mut self, radius: f64) -> Self {
        self.solver.smooth = Some(radius);
        self
    }

    /// Sets the width of the widest hole that is closed, 0 for none. By default it is four spacings, or
    /// four of the input's own where more points are requested than there are.
    #[must_use]
    pub fn fill(mut self, width: f64) -> Self {
        self.solver.fill = Some(width);
        self
    }

    /// Sets how far from the nearest input point a point may move: one threshold for the whole cloud (paper,
    /// section IV-E). By default the threshold is local, from the spacing of the input around the point.
    #[must_use]
    pub fn restrict(mut self, distance: f64) -> Self {
        self.solver.restriction = Restriction::Global(distance);
        self
    }

    /// Sets the seed of every hash; 0 by default. Other seeds give other points that are as even.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.solver.seed = seed;
        self
    }

    /// Sets the step of the integer grid that coordinates are rounded to before anything is decided by them,
    /// such as the scale of the file that the points come from. By default it is a power of ten below a
    /// five-thousandth of the spacing. A scale that is too coarse for the spacing, or too fine for the
    /// extent of the cloud, is changed by powers of ten until it fits, as it is for files.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.scale = Some(scale);
        self
    }

    /// Names the first value that is out of its range.
    pub(crate) fn check(&self) -> Result<(), ResampleError> {
        let positive = "must be a length above zero";
        let of_target = match self.target {
            Target::Spacing(spacing) => ("spacing", spacing, positive),
            Target::Count(count) => ("count", count as f64, "must be at least 1"),
            Target::Ratio(ratio) => ("ratio", ratio, "must be a number above zero"),
        };
        let restriction = match self.solver.restriction {
            Restriction::Global(distance) => Some(distance),
            Restriction::Local | Restriction::None => None,
        };
        let lengths = [
            ("smooth", self.solver.smooth),
            ("restrict", restriction),
            ("scale", self.scale),
            // A width of 0 closes no hole.
            ("fill", self.solver.fill.filter(|&width| width != 0.0)),
        ];
        let given = lengths.into_iter();
        let given = given.filter_map(|(option, value)| Some((option, value?, positive)));
        for (option, value, remedy) in std::iter::once(of_target).chain(given) {
            let invalid = |remedy| ResampleError::InvalidOption {
                option,
                value,
                remedy,
            };
            // Written so that NaN fails.
            if !(value > 0.0 && value.is_finite()) {
                return Err(invalid(remedy));
            }
            // A scale that is too fine is made coarser; a ratio is no length.
            let is_length = remedy == positive && option != "scale";
            if is_length && value < SHORTEST_LENGTH {
                return Err(invalid(
                    "must be at least 1e-12: give points and lengths in a smaller unit",
                ));
            }
        }
        if self.exact && self.target.wanted_count(1, true, &self.solver).is_none() {
            return Err(ResampleError::InvalidOption {
                option: "exact",
                value: 1.0,
                remedy: "needs a count or a ratio, and an acceleration without Anderson mixing",
            });
        }
        if self.solver.iterations > MAX_ITERATIONS {
            return Err(ResampleError::InvalidOption {
                option: "iterations",
                value: self.solver.iterations.into(),
                remedy: "must be at most 1000; twenty are usual",
            });
        }
        Ok(())
    }
}

/// More Lloyd iterations are a mistake.
const MAX_ITERATIONS: u32 = 1000;
