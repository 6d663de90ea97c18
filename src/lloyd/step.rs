//! One Lloyd step of one site: its patch, its cell, its centroid.
//!
//! Most sites hardly move from one iteration to the next, and neither do those around
//! them. A cell is then not clipped anew: its centroid is *followed*, as it answers to
//! the moves to first order, until what they add up to could tell. That is for cells on
//! patches that are nearly flat, closed by neighbours or by the end of the scan: others
//! answer less simply (with them followed, too, the area CV of 53 clouds was higher by 1 %
//! on the mean).

use super::{
    Scan, SolverOptions,
    acceleration::{LINKS, NO_LINK, linked},
    around::{Around, is_nearly_flat},
    domain::DependencyCone,
    fit::{Fit, is_allowed},
    neighborhoods::NEAR,
    solver::FARTHEST_NEIGHBOR,
};
use crate::geometry::{Local, Moments, Response};

/// A centroid is followed until, iteration by iteration, the farthest moves add up to
/// this, in spacings. What the first order leaves out goes with the square.
const MOST_DRIFT: f64 = 0.03;

/// What the last Lloyd step found for one site.
#[derive(Clone)]
pub(super) struct Step {
    pub(super) fit: Option<Fit>,
    /// Whether the scan carries no patch where the site is. It stays there.
    is_stranded: bool,
    pub(super) is_exact: bool,
    /// The centroid, projected and restricted.
    pub(super) target: Local,
    /// Sites whose cells touch, then [`NO_LINK`].
    pub(super) links: [u32; LINKS],
    /// Whether they do not bound the cell all around.
    pub(super) is_open: bool,
    /// Distance to the nearest other site.
    pub(super) nearest: Option<f64>,
    /// How far the site may go in any direction and still keep clear.
    pub(super) free: f64,
    clipped: Option<Clipped>,
}

/// What is kept of a clipped cell, and how far that holds.
#[derive(Clone)]
struct Clipped {
    /// As far as it was followed.
    centroid: Local,
    response: Response,
    /// Square of the distance (CRS units) within which a move matters to the cell.
    attention: f64,
    /// Distance to the nearest neighbour.
    nearest: f64,
    /// What the farthest moves since add up to, in spacings.
    drift: f64,
}

impl Step {
    /// That of a site at `place`, before the first step.
    pub(super) fn new(place: Local) -> Self {
        Self {
            fit: None,
            is_stranded: false,
            is_exact: false,
            target: place,
            links: [NO_LINK; LINKS],
            is_open: false,
            nearest: None,
            free: 0.0,
            clipped: None,
        }
    }

    /// The point of the site's patch at `place`, if it has one.
    pub(super) fn project(&self, place: Local) -> Local {
        self.fit
            .as_ref()
            .map_or(place, |fit| fit.patch.foot_point(place))
    }

    /// Forgets the last step: the site stays at `place`.
    fn forget(&mut self, place: Local) {
        self.target = place;
        self.links = [NO_LINK; LINKS];
        self.free = 0.0;
        self.clipped = None;
    }

    /// Leaves a site at `place` that matters to nobody any more.
    pub(super) fn leave(&mut self, place: Local) {
        self.forget(place);
        self.nearest = None;
        self.is_exact = false;
    }

    /// III-B: the patch, kept while the site stays near where it was fitted.
    fn fit_patch(&mut self, scan: &Scan, options: &SolverOptions, around: &mut Around<'_>) {
        let serves = |fit: &Fit| fit.serves(around.place, options.spacing);
        if !self.is_stranded && !self.fit.as_ref().is_some_and(serves) {
            // At first the others of the block have none, either.
            if self.fit.is_none() {
                around.look_for_samples(scan, options);
            }
            self.fit = around.fit(scan, options);
            self.is_stranded = self.fit.is_none();
        }
    }

    /// The patch of the site, if it is one to trust.
    pub(super) fn trusted(&mut self) -> Option<&mut Fit> {
        self.fit.as_mut().filter(|fit| fit.is_trusted())
    }

    /// III-B, III-C: clips the cell of the site on its patch; its moments, if there is one.
    pub(super) fn clip(
        &mut self,
        scan: &Scan,
        options: &SolverOptions,
        around: &mut Around<'_>,
    ) -> Option<Moments> {
        self.fit_patch(scan, options, around);
        around.restricted_cell(self.trusted()?, scan, options)
    }

    /// From where the site is to its centroid.
    pub(super) fn advance(
        &mut self,
        scan: &Scan,
        options: &SolverOptions,
        cone: &DependencyCone<'_>,
        was_exact: &[bool],
        mut around: Around<'_>,
    ) {
        if !self.follow(scan, options, was_exact, &mut around) {
            let moments = self.clip(scan, options, &mut around);
            self.go(moments, scan, options, cone, was_exact, around);
        }
    }

    /// The step to a centroid that is followed; `false` if it cannot be.
    fn follow(
        &mut self,
        scan: &Scan,
        options: &SolverOptions,
        was_exact: &[bool],
        around: &mut Around<'_>,
    ) -> bool {
        let (Some(fit), Some(clipped)) = (&mut self.fit, &mut self.clipped) else {
            return false;
        };
        let place = around.place;
        let (farthest, is_exact) = around.farthest_move(clipped.attention, was_exact);
        clipped.drift += farthest;
        if clipped.drift > MOST_DRIFT || !fit.serves(place, options.spacing) {
            return false;
        }
        self.is_exact &= is_exact;
        let neighborhoods = around.neighborhoods;
        let neighbors = || linked(&self.links).map(|link| link as usize);
        clipped.centroid += clipped.response.of(
            &fit.patch,
            neighborhoods.last_move(around.site),
            neighbors().map(|neighbor| neighborhoods.last_move(neighbor)),
        );
        self.nearest = neighbors()
            .map(|neighbor| (neighborhoods.places()[neighbor] - place).norm_squared())
            .min_by(f64::total_cmp)
            .map(f64::sqrt);
        // Both may have come nearer by the drift.
        let nearest = clipped.nearest - 2.0 * clipped.drift * options.spacing;
        let free = around.room(nearest);
        let towards = step_towards(clipped.centroid, place, fit);
        let target = if towards.norm_squared() <= free * free {
            place + towards
        } else {
            around.look_near();
            around.keeping_clear(place + towards)
        };
        let is_allowed = is_allowed(scan, fit, target, options);
        (self.target, self.free) = if is_allowed {
            (target, free)
        } else {
            (place, 0.0)
        };
        true
    }

    /// The step to the centroid of the cell that was clipped, by its `moments`.
    pub(super) fn go(
        &mut self,
        moments: Option<Moments>,
        scan: &Scan,
        options: &SolverOptions,
        cone: &DependencyCone<'_>,
        was_exact: &[bool],
        mut around: Around<'_>,
    ) {
        let place = around.place;
        self.forget(place);
        let Some(fit) = self.fit.as_mut().filter(|fit| fit.is_trusted()) else {
            // It stays, whatever its cell. Of the few that are far from all others how far
            // is asked once.
            around.look_near();
            let near = around.scratch.nearest().or(self.nearest);
            self.nearest =
                near.or_else(|| around.nearest_within(FARTHEST_NEIGHBOR * options.spacing));
            return;
        };
        self.nearest = around.scratch.nearest();
        let cell = &around.scratch.cell;
        for (link, neighbor) in self.links.iter_mut().zip(cell.neighbors()) {
            *link = neighbor;
        }
        self.is_open = !cell.is_closed();
        // Exact if everything within the security radius is, wherever the cell is followed to.
        let security = cell.security_squared();
        let known = security.sqrt() + MOST_DRIFT * options.spacing;
        self.is_exact &= around
            .scratch
            .neighbors
            .iter()
            .filter(|n| n.distance_squared <= security)
            .all(|n| was_exact[n.index as usize])
            && cone.knows(place, known, scan.quantization());
        let Some(moments) = moments else {
            return;
        };
        let near = (NEAR * options.spacing).powi(2);
        // What ends an open cell near by is where the scan ends, which stays.
        let is_bounded = !self.is_open || security <= near;
        if is_bounded && is_nearly_flat(&fit.patch, options.spacing) {
            let places = around.neighborhoods.places();
            self.clipped = Some(Clipped {
                centroid: moments.centroid,
                response: Response::new(cell, &moments, &fit.patch, place, |neighbor| {
                    places[neighbor as usize]
                }),
                attention: security.min(near),
                nearest: self.nearest.unwrap_or(0.0),
                drift: 0.0,
            });
        }
        // IV-B, IV-D, IV-E: the centroid, on the patch, near the scan.
        let towards = step_towards(moments.centroid, place, fit);
        let target = around.keeping_clear(place + towards);
        if is_allowed(scan, fit, target, options) {
            self.target = target;
            self.free = around.free();
        }
    }
}

/// From `place` towards `centroid`, on the patch: the less sure the surface, the shorter.
fn step_towards(centroid: Local, place: Local, fit: &Fit) -> Local {
    (fit.patch.foot_point(centroid) - place) * fit.trust
}
