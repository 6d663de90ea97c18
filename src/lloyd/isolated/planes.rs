//! Planes through seeds.

use super::linked::visit_linked;
use crate::{
    geometry::{Local, NeighborGrid, by_position, mean_and_covariance, narrow_frame},
    lloyd::options::SolverOptions,
};

/// A plane is that of no fewer seeds.
const FEWEST_ON_A_PLANE: usize = 5;
/// A surface is that of no fewer seeds: it has them all around, or nearly so.
const FEWEST_ON_A_SURFACE: usize = 10;
/// A line, as a wire, is that of no fewer seeds.
const FEWEST_ON_A_LINE: usize = 4;
/// There are hardly ever more seeds around one.
const SEEDS_AROUND: usize = 64;
/// So much of the variance of seeds on a line is along it, at least.
const SHARE_ALONG_A_LINE: f64 = 0.98;
/// Largest standard deviation of the seeds across their plane.
const THICKEST_PLANE_IN_SPACINGS: f64 = 0.4;
/// Largest standard deviation of sparse seeds across a plane of their own.
const THICKEST_PLANE_OF_ALIKE_IN_SPACINGS: f64 = 0.2;
/// Largest standard deviation of the seeds of a surface across its plane: those of walls and streets have a few
/// hundredths, and on a branch hardly ever are so many so flat.
const THICKEST_SURFACE_IN_SPACINGS: f64 = 0.1;
/// Largest distance of a seed from the plane of those around it.
const FARTHEST_FROM_PLANE_IN_SPACINGS: f64 = 0.5;

/// The plane that seeds lie near to.
struct Plane {
    /// The mean of the seeds.
    mean: Local,
    normal: Local,
    /// Standard deviation of the seeds across the plane (CRS units).
    thickness: f64,
}

/// What seeds lie near to.
enum Shape {
    Plane(Plane),
    Line,
    /// They are spread alike in all directions, or are too few.
    Neither,
}

impl Plane {
    /// Whether `place` is near to the plane.
    fn is_near(&self, place: Local, spacing: f64) -> bool {
        let distance = self.normal.dot(&(place - self.mean)).abs();
        distance < FARTHEST_FROM_PLANE_IN_SPACINGS * spacing
    }
}

/// The shape of seeds at these `places`.
fn shape(mut places: Vec<Local>) -> Shape {
    if places.len() < FEWEST_ON_A_LINE {
        return Shape::Neither;
    }
    // The order in which seeds are found depends on the tile, and rounding on the order.
    places.sort_unstable_by(by_position);
    let (mean, covariance) = mean_and_covariance(&places);
    if covariance.norm() > SHARE_ALONG_A_LINE * covariance.trace() {
        return Shape::Line;
    }
    match narrow_frame(covariance) {
        Some((spread, [.., normal])) if places.len() >= FEWEST_ON_A_PLANE => Shape::Plane(Plane {
            mean,
            normal,
            thickness: spread[2].sqrt(),
        }),
        _ => Shape::Neither,
    }
}

/// Whether the seed at `position` lies on a plane through the seeds around it, or all of them on a line.
pub(super) fn lies_on_a_plane(
    seeds: &NeighborGrid,
    position: Local,
    options: &SolverOptions,
) -> bool {
    lies_among(seeds, position, options, THICKEST_PLANE_IN_SPACINGS, |_| {
        true
    })
}

/// Whether the seed at `position` lies on a plane or line of those seeds around it for which `is_alike`.
pub(super) fn lies_among_alike(
    seeds: &NeighborGrid,
    position: Local,
    options: &SolverOptions,
    is_alike: impl Fn(usize) -> bool,
) -> bool {
    lies_among(
        seeds,
        position,
        options,
        THICKEST_PLANE_OF_ALIKE_IN_SPACINGS,
        is_alike,
    )
}

fn lies_among(
    seeds: &NeighborGrid,
    position: Local,
    options: &SolverOptions,
    thickest_in_spacings: f64,
    is_among: impl Fn(usize) -> bool,
) -> bool {
    let around = steps_to(seeds, position, options.plane_radius(), is_among);
    match shape(around) {
        Shape::Plane(plane) => {
            plane.thickness < thickest_in_spacings * options.spacing
                && plane.is_near(Local::zeros(), options.spacing)
        }
        Shape::Line => true,
        Shape::Neither => false,
    }
}

/// The ways from `position` to those seeds within `radius` of it that `is_among`.
fn steps_to(
    seeds: &NeighborGrid,
    position: Local,
    radius: f64,
    is_among: impl Fn(usize) -> bool,
) -> Vec<Local> {
    let mut steps = Vec::with_capacity(SEEDS_AROUND);
    visit_linked(seeds, position, radius, |seed, place| {
        if is_among(seed) {
            steps.push(place - position);
        }
    });
    steps
}

/// The surface that a seed lies on, as a plane.
pub(super) struct SurfacePlane {
    seed: Local,
    plane: Plane,
}

impl SurfacePlane {
    /// The surface that the seed at `position` lies on, if it is on one. Of the seeds around it, those for which
    /// `is_of_surface` count.
    pub(super) fn at(
        seeds: &NeighborGrid,
        position: Local,
        options: &SolverOptions,
        is_of_surface: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let steps = steps_to(seeds, position, options.surface_radius(), is_of_surface);
        if steps.len() < FEWEST_ON_A_SURFACE {
            return None;
        }
        let thickest = THICKEST_SURFACE_IN_SPACINGS * options.spacing;
        match shape(steps) {
            Shape::Plane(plane) if plane.thickness < thickest => Some(Self {
                seed: position,
                plane,
            }),
            _ => None,
        }
    }

    /// Whether `position` is near to the surface.
    pub(super) fn is_near(&self, position: Local, options: &SolverOptions) -> bool {
        self.plane.is_near(position - self.seed, options.spacing)
    }
}
