//! A cell that is followed without being clipped.
//!
//! Most sites hardly move from one iteration to the next, and neither do their neighbours. The
//! centroid of a cell then follows the moves to first order (`geometry::Response`), until the
//! moves add up to what could be noticed. That is done for cells on patches that are nearly
//! flat, closed by neighbours or by the end of the scan: others respond less simply (with them
//! followed, too, the area CV of 53 clouds was higher by 1 % on the mean).

use serde::{Deserialize, Serialize};

use super::{
    fit::Fit,
    links::Links,
    neighborhoods::NEAR_IN_SPACINGS,
    vicinity::{Vicinity, is_nearly_flat},
};
use crate::geometry::{Local, Moments, Response};

/// A centroid is followed until the farthest moves, iteration by iteration, add up to this. The
/// error of the first order grows with the square.
pub(super) const LARGEST_DRIFT_IN_SPACINGS: f64 = 0.03;

/// What is kept of a clipped cell.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct FollowedCell {
    /// The centroid of the cell, as far as it was followed.
    centroid: Local,
    response: Response,
    /// Square of the distance (CRS units) within which a move matters to the cell.
    attention: f64,
    /// Distance to the nearest neighbour when the cell was clipped (CRS units).
    nearest: f64,
    /// Sum of the farthest moves since the cell was clipped (spacings).
    drift: f64,
}

impl FollowedCell {
    /// What is kept of the cell that was clipped last, with `moments`, if it can be followed.
    pub(super) fn new(fit: &Fit, moments: &Moments, vicinity: &Vicinity<'_>) -> Option<Self> {
        let (spacing, cell) = (vicinity.spacing, &vicinity.scratch.cell);
        let security = cell.security_squared();
        let near = (NEAR_IN_SPACINGS * spacing).powi(2);
        // A small open cell ends where the scan ends, which does not move.
        let is_bounded = cell.is_closed() || security <= near;
        if !is_bounded || !is_nearly_flat(&fit.patch, spacing) {
            return None;
        }
        // The nearest site shares an edge where all are sites of one surface.
        let nearest = vicinity.nearest_linked()?;
        let positions = vicinity.neighborhoods.positions();
        Some(Self {
            centroid: moments.centroid,
            response: Response::new(cell, moments, &fit.patch, vicinity.position, |neighbor| {
                positions[neighbor as usize]
            }),
            attention: security.min(near),
            nearest,
            drift: 0.0,
        })
    }

    /// Takes note of the last moves; whether the sites around were exact, or `None` if the
    /// cell can be followed no longer.
    pub(super) fn drift(
        &mut self,
        fit: &Fit,
        was_exact: &[bool],
        vicinity: &mut Vicinity<'_>,
    ) -> Option<bool> {
        let (farthest, is_exact) = vicinity.farthest_move(self.attention, was_exact);
        self.drift += farthest;
        let is_outdated = self.drift > LARGEST_DRIFT_IN_SPACINGS
            || !fit.is_valid_at(vicinity.position, vicinity.spacing);
        (!is_outdated).then_some(is_exact)
    }

    /// The centroid after the last moves.
    pub(super) fn follow(&mut self, fit: &Fit, links: &Links, vicinity: &Vicinity<'_>) -> Local {
        let neighborhoods = vicinity.neighborhoods;
        self.centroid += self.response.of(
            &fit.patch,
            neighborhoods.last_move(vicinity.site),
            links
                .sites()
                .map(|neighbor| neighborhoods.last_move(neighbor as usize)),
        );
        self.centroid
    }

    /// The target of a `step` that keeps clear of the neighbours, and how far the site may move in any direction (CRS units).
    pub(super) fn keeping_clear(&self, step: Local, vicinity: &mut Vicinity<'_>) -> (Local, f64) {
        // The site and its neighbour may both have moved by the drift.
        let nearest = self.nearest - 2.0 * self.drift * vicinity.spacing;
        let free = vicinity.room(nearest);
        let position = vicinity.position;
        let target = if step.norm_squared() <= free * free {
            position + step
        } else {
            vicinity.find_near();
            vicinity.keeping_clear(position + step)
        };
        (target, free)
    }
}
