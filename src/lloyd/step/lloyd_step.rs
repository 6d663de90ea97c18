//! One Lloyd step of one site: its patch, its cell, its centroid.
//!
//! ```text
//!   patch ─► cell ─► centroid ─► foot point on the patch ─► clear of neighbours ─► near the scan
//! ```
//!
//! The cell is clipped, or followed where it has hardly changed (`following`).

use serde::{Deserialize, Serialize};

use super::{
    crowding::{Crowding, Way, without_leaving},
    fit::Fit,
    following::{FollowedCell, LARGEST_DRIFT_IN_SPACINGS},
    links::Links,
    neighborhoods::{FarList, NEAR_IN_SPACINGS},
    scan_border::Standing,
    vicinity::Vicinity,
};
use crate::{
    geometry::{Local, Moments},
    lloyd::{region::DependencyCone, site::FARTHEST_NEIGHBOR_IN_SPACINGS, surface::Surface},
    quality::Surroundings,
};

/// A site that is moved to a facet when all iterations are done comes no nearer to another than this, unless one is as
/// near before. On a simulated street δ was 0.0538 without a bound, and 0.0526 with this one.
const CLEARANCE_ON_FACETS_IN_SPACINGS: f64 = 0.8;

/// Longest way to a facet when all iterations are done. It leads past no neighbour that is not near.
const LONGEST_WAY_TO_FACET_IN_SPACINGS: f64 = 0.5;

/// What the steps of all sites in one iteration have in common.
#[derive(Clone, Copy)]
pub(crate) struct Iteration<'a> {
    pub(crate) surface: Surface<'a>,
    pub(crate) cone: &'a DependencyCone<'a>,
    /// Whether each site was exact before the iteration.
    pub(crate) was_exact: &'a [bool],
    /// Whether facets are sought where patches round an edge.
    seeks_facets: bool,
    /// How near to each other sites may be; `None` if that does not matter.
    crowding: Option<Crowding>,
}

impl<'a> Iteration<'a> {
    /// The iteration with this `number`.
    pub(crate) fn new(
        surface: Surface<'a>,
        cone: &'a DependencyCone<'a>,
        was_exact: &'a [bool],
        number: u32,
    ) -> Self {
        Self {
            surface,
            cone,
            was_exact,
            seeks_facets: surface.options.seeks_facets(number),
            crowding: Crowding::in_iteration(surface.options, number),
        }
    }

    /// The iteration for a site by whose options `surface` is.
    pub(crate) fn on<'b>(self, surface: Surface<'b>) -> Iteration<'b>
    where
        'a: 'b,
    {
        Iteration { surface, ..self }
    }
}

/// The result of the last Lloyd step of one site.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Step {
    /// The patch, if one is trusted.
    pub(crate) fit: Option<Box<Fit>>,
    /// Whether the scan has no patch to trust where the site is. The site stays there for good.
    is_settled: bool,
    /// Whether everything that the position depends on was available.
    pub(crate) is_exact: bool,
    /// The centroid, projected and restricted.
    #[serde(skip)]
    pub(crate) target: Local,
    /// The sites whose cells share an edge with that of the site.
    #[serde(skip)]
    pub(crate) links: Links,
    /// Whether those sites do not bound the cell all around.
    pub(crate) is_open: bool,
    /// Distance to the nearest other site (CRS units), for figures.
    pub(crate) nearest: Option<f64>,
    /// How far the site may move in any direction and keep clear of its neighbours (CRS
    /// units).
    #[serde(skip)]
    pub(crate) free: f64,
    /// Whether the cell is followed.
    is_followed: bool,
    /// The cell that is followed, or memory for the next.
    followed: Option<Box<FollowedCell>>,
    /// The sites that can cut a large cell.
    #[serde(skip)]
    far: FarList,
}

impl Step {
    /// The step of a site at `position` before the first iteration.
    pub(crate) fn new(position: Local) -> Self {
        Self {
            fit: None,
            is_settled: false,
            is_exact: false,
            target: position,
            links: Links::NONE,
            is_open: false,
            nearest: None,
            free: 0.0,
            is_followed: false,
            followed: None,
            far: FarList::default(),
        }
    }

    /// The step of a site that comes at `position` between two rounds, in every tile alike.
    pub(crate) fn between_rounds(position: Local) -> Self {
        Self {
            is_exact: true,
            ..Self::new(position)
        }
    }

    /// What is around the site.
    pub(crate) fn surroundings(&self) -> Surroundings {
        let is_on_surface = self.fit.as_ref().is_some_and(|fit| fit.trust >= 1.0);
        Surroundings::of(is_on_surface, !self.is_open)
    }

    /// The step as it is kept between two rounds.
    pub(crate) fn kept(mut self) -> Self {
        // It is of sites by their places in this round.
        self.far = FarList::default();
        if !self.is_followed {
            self.followed = None;
        }
        self
    }

    /// Continues the kept step of a site at `position`. `links` are those that the step had;
    /// `None` if not all of those sites are known.
    pub(crate) fn resume(&mut self, position: Local, links: Option<Links>) {
        self.target = position;
        match links {
            Some(links) => self.links = links,
            None => {
                self.reset(position);
                self.is_exact = false;
            }
        }
    }

    /// The foot point of `position` on the patch of the site, if it has one.
    pub(crate) fn project(&self, position: Local) -> Local {
        self.fit
            .as_ref()
            .map_or(position, |fit| fit.foot_point(position))
    }

    /// Discards the last step: the site stays at `position`.
    pub(crate) fn reset(&mut self, position: Local) {
        self.target = position;
        self.links = Links::NONE;
        self.free = 0.0;
        self.is_followed = false;
    }

    /// Leaves a site that matters to no wanted site any more at `position`, without what it needed to move.
    pub(crate) fn retire(&mut self, position: Local) {
        *self = Self::new(position);
    }

    /// III-B: fits the patch, unless the site is still near where it was fitted.
    fn fit_patch(&mut self, surface: Surface<'_>, vicinity: &mut Vicinity<'_>) {
        let is_valid = |fit: &Fit| fit.is_valid_at(vicinity.position, surface.spacing());
        if !self.is_settled && !self.fit.as_deref().is_some_and(is_valid) {
            // In the first iteration the other sites of the block have no patch, either.
            if self.fit.is_none() {
                vicinity.gather_samples(surface);
            }
            put(&mut self.fit, vicinity.fit(surface));
            // The cell was one on the former patch.
            self.is_followed = false;
            self.is_settled = self.fit.is_none();
        }
    }

    /// III-B, III-C: clips the cell of the site on its patch, and gives its moments; `None`
    /// without a cell.
    pub(crate) fn clip(
        &mut self,
        surface: Surface<'_>,
        vicinity: &mut Vicinity<'_>,
    ) -> Option<Moments> {
        self.fit_patch(surface, vicinity);
        vicinity.restricted_cell(self.fit.as_deref_mut()?, &mut self.far, surface)
    }

    /// Computes the step from the position of the site to its centroid.
    pub(crate) fn advance(&mut self, iteration: Iteration<'_>, mut vicinity: Vicinity<'_>) {
        // Where nothing moves, the nearest other site of a settled one stays what it was.
        if self.is_settled && vicinity.is_near(self.nearest) && vicinity.is_still() {
            return;
        }
        if !self.follow(iteration, &mut vicinity) {
            let moments = self.clip(iteration.surface, &mut vicinity);
            self.step_to_centroid(moments, iteration, &mut vicinity);
            self.nearest =
                vicinity.nearest_within(FARTHEST_NEIGHBOR_IN_SPACINGS * vicinity.spacing);
        }
    }

    /// Computes the step to a centroid that is followed; `false` if it cannot be followed.
    fn follow(&mut self, iteration: Iteration<'_>, vicinity: &mut Vicinity<'_>) -> bool {
        let (true, Some(fit), Some(followed)) = (
            self.is_followed,
            self.fit.as_deref_mut(),
            self.followed.as_deref_mut(),
        ) else {
            return false;
        };
        let Some(is_exact) = followed.drift(fit, iteration.was_exact, vicinity) else {
            return false;
        };
        self.is_exact &= is_exact;
        let position = vicinity.position;
        let positions = vicinity.neighborhoods.positions();
        self.nearest = self
            .links
            .sites()
            .map(|neighbor| (positions[neighbor as usize] - position).norm_squared())
            .min_by(f64::total_cmp)
            .map(f64::sqrt);
        let centroid = followed.follow(fit, &self.links, vicinity);
        let step = even_step(
            centroid,
            fit,
            &self.links,
            self.is_open,
            iteration,
            vicinity,
        );
        let (target, free) = followed.keeping_clear(step, vicinity);
        (self.target, self.free) = restricted(target, free, fit, iteration.surface, vicinity);
        true
    }

    /// Where the site ends when all iterations are done: on the corrected patch, or on the facets around it, if they are wanted and the
    /// scan has some there that leave it clear of its neighbours.
    pub(crate) fn settle(
        &mut self,
        iteration: Iteration<'_>,
        vicinity: &mut Vicinity<'_>,
    ) -> Local {
        let (surface, spacing) = (iteration.surface, vicinity.spacing);
        // The last move may have led away from where the patch was fitted.
        self.fit_patch(surface, vicinity);
        let Some(fit) = self.fit.as_deref_mut() else {
            return vicinity.position;
        };
        let samples = &mut vicinity.scratch.samples;
        let position = fit.correct(vicinity.position, surface, samples);
        if surface.options.edge_capture.is_none() {
            return position;
        }
        let Some(foot) = fit.foot_point_on_facets(position, surface, samples) else {
            return position;
        };
        vicinity.find_near();
        let mut neighbors = vicinity.scratch.neighbors.iter();
        self.is_exact &= neighbors.all(|neighbor| iteration.was_exact[neighbor.index as usize])
            && iteration.cone.has_right_sites(
                position,
                NEAR_IN_SPACINGS * spacing,
                surface.quantization(),
            );
        let is_near = (foot - position).norm() <= LONGEST_WAY_TO_FACET_IN_SPACINGS * spacing;
        let clearance = CLEARANCE_ON_FACETS_IN_SPACINGS * spacing;
        if is_near && vicinity.is_clear(foot, clearance) && fit.allows(foot, surface) {
            fit.keep_at(foot);
            return foot;
        }
        position
    }

    /// Computes the step to the centroid of the cell that was clipped last, with `moments`.
    pub(crate) fn step_to_centroid(
        &mut self,
        moments: Option<Moments>,
        iteration: Iteration<'_>,
        vicinity: &mut Vicinity<'_>,
    ) {
        let Iteration {
            surface,
            cone,
            was_exact,
            seeks_facets,
            ..
        } = iteration;
        let (position, spacing) = (vicinity.position, surface.spacing());
        self.reset(position);
        // Without a patch the site stays, whatever its cell.
        let Some(fit) = self.fit.as_deref_mut() else {
            return;
        };
        if seeks_facets {
            fit.find_facets(surface, &mut vicinity.scratch.samples);
        }
        let cell = &vicinity.scratch.cell;
        self.links = Links::new(cell.neighbors());
        self.is_open = !cell.is_closed();
        // The site is exact if everything within the security radius is, for as long as the
        // cell is followed.
        let security = cell.security_squared();
        let radius = security.sqrt() + LARGEST_DRIFT_IN_SPACINGS * spacing;
        self.is_exact &= vicinity
            .scratch
            .neighbors
            .iter()
            .filter(|n| n.distance_squared <= security)
            .all(|n| was_exact[n.index as usize])
            && cone.has_right_sites(position, radius, surface.quantization());
        let Some(mut moments) = moments else {
            return;
        };
        // Where the spacing varies, the centroid is that by the density.
        if !surface.field().is_constant() {
            let density = |place| surface.field().density_at(place);
            let shift = cell.shift_by_density(&fit.patch, position, density);
            moments.centroid += shift.unwrap_or_else(Local::zeros);
        }
        if let Some(followed) = FollowedCell::new(fit, &moments, vicinity) {
            self.is_followed = true;
            put(&mut self.followed, Some(followed));
        }
        // IV-B, IV-D, IV-E: the centroid, on the patch, near the scan.
        let step = even_step(
            moments.centroid,
            fit,
            &self.links,
            self.is_open,
            iteration,
            vicinity,
        );
        let target = vicinity.keeping_clear(position + step);
        let free = vicinity.free_radius();
        (self.target, self.free) = restricted(target, free, fit, surface, vicinity);
    }
}

/// The step of a site with these `links` towards its `centroid` on the surface of `fit`, evened by the distances to the linked sites. Where
/// the centroid is doubtful the clearance is widened, unless the site goes onto an edge, where others leave it little room.
fn even_step(
    centroid: Local,
    fit: &mut Fit,
    links: &Links,
    is_open: bool,
    iteration: Iteration<'_>,
    vicinity: &mut Vicinity<'_>,
) -> Local {
    let (position, neighborhoods) = (vicinity.position, vicinity.neighborhoods);
    let claims_edge = iteration.seeks_facets && {
        let place = |link: u32| neighborhoods.positions()[link as usize];
        fit.claims_edge(position, links.sites().map(place), iteration.surface)
    };
    let is_doubtful = is_doubtful(fit, is_open) && !claims_edge;
    if is_doubtful {
        vicinity.widen_clearance();
    }
    let Some(crowding) = iteration.crowding else {
        return fit.step_towards(centroid, position);
    };
    let way = |link: u32| Way {
        vector: position - neighborhoods.positions()[link as usize],
        spacing: vicinity
            .spacing
            .min(neighborhoods.spacings().of(link as usize)),
    };
    let others = || links.sites().map(way);
    let is_at_border = is_open && fit.trust >= 1.0;
    let relief = crowding.of_site(is_at_border).relief(others());
    let step = fit.step_towards(centroid + relief, position);
    match is_doubtful {
        true => without_leaving(step, others()),
        false => step,
    }
}

/// Where the boundary restriction leads a site with this `target`, which has the distance `free` (CRS units) to move in; and the
/// distance that it has there.
fn restricted(
    target: Local,
    free: f64,
    fit: &mut Fit,
    surface: Surface<'_>,
    vicinity: &mut Vicinity<'_>,
) -> (Local, f64) {
    match fit.place(target, surface) {
        Standing::OnScan => (target, free),
        Standing::BeyondBorder(way) => {
            vicinity.find_near();
            let back = vicinity.keeping_clear(fit.foot_point(target + way));
            // Between neighbours there can be less room for a longer step.
            let leads_back =
                (back - target).dot(&way) > 0.0 && fit.is_within_threshold(back, surface);
            (if leads_back { back } else { target }, free)
        }
        Standing::Away => (vicinity.position, 0.0),
    }
}

/// Whether the centroid of a cell is doubtful: its patch is trusted in part only, or `is_open`,
/// neighbours do not bound it all around. What is beyond is unknown, or does not move.
fn is_doubtful(fit: &Fit, is_open: bool) -> bool {
    is_open || fit.trust < 1.0
}

/// Makes `value` the contents of `place`, in the memory of the former contents.
fn put<T>(place: &mut Option<Box<T>>, value: Option<T>) {
    match (place.as_deref_mut(), value) {
        (Some(former), Some(value)) => *former = value,
        (_, value) => *place = value.map(Box::new),
    }
}
