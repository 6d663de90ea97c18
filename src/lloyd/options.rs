//! The options of the solver, and the lengths that follow from them.

use serde::{Deserialize, Serialize};

use super::{
    acceleration::Acceleration,
    field::Grading,
    seeds::{DominantNormals, SeedRule},
    step::Restriction,
};
use crate::geometry::{PatchKind, WIDE_RADIUS_IN_FIT_RADII};

/// The options of one solve. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolverOptions {
    /// The edge of the hexagonal lattice that has as many sites to the unit of area; the coarsest one if it varies.
    pub spacing: f64,
    /// How the spacing varies; `None` if it is the same everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<Grading>,
    /// Radius of the neighbourhood that a patch is fitted to: the scale of the details kept.
    pub fit_radius: f64,
    /// Radius of the patches by which noise is smoothed away before anything else; 0 for none.
    pub smooth: f64,
    /// Width of the widest hole to close; 0 for none.
    pub fill: f64,
    /// Number of Lloyd iterations: the paper's K, 20.
    pub iterations: u32,
    /// The rule by which seeds are chosen.
    pub seeds: SeedRule,
    /// The directions that many planes of the whole cloud face. Lattices of seeds stand across them.
    #[serde(default)]
    pub dominant_normals: DominantNormals,
    /// Share of the points of the scan that become random seeds.
    pub seeds_per_point: f64,
    /// How centroids are extrapolated to the positions of the next iteration.
    pub acceleration: Acceleration,
    /// The kind of surface that is fitted near a site.
    pub patch: PatchKind,
    /// How far from the scan a site may move.
    pub restriction: Restriction,
    /// Sites nearer to a sharp edge than this are moved onto it; 0 for none. `None` if patches may round edges.
    pub edge_capture: Option<f64>,
    /// Whether isolated returns are left out.
    pub drops_isolated: bool,
    /// Seed of every hash.
    pub seed: u64,
}

/// Default radius of a fit.
pub(crate) const FIT_RADIUS_IN_SPACINGS: f64 = 1.2;

/// Default width of the widest hole that is closed.
pub(crate) const FILL_IN_SPACINGS: f64 = 4.0;

/// Bound on the chains of an election, and on the reach of its lattices: they go on for a spacing, and their normals are
/// averaged over two. Nodes on an edge are found from no farther.
const SEED_MARGIN_IN_SPACINGS: f64 = 9.0;
/// Seeds nearer to each other than this belong together, when isolated ones are sought: on a surface the nearest seed is
/// hardly ever as far.
const LINK_IN_SPACINGS: f64 = 1.25;
/// Radius of the neighbourhood in which seeds may lie on a common plane, in linking distances.
const PLANE_IN_LINKS: f64 = 2.3;
/// A seed is beside a surface if one on it is nearer than this, in linking distances.
const BESIDE_IN_LINKS: f64 = 1.75;
/// Radius of the neighbourhood of a seed whose plane is its surface, in linking distances.
const SURFACE_IN_LINKS: f64 = 1.6;
/// A small group of seeds is alone if it has no company nearer than this, in linking distances.
const ALONE_IN_LINKS: f64 = 1.5;
/// So many seeds that belong together are never isolated.
pub(super) const MANY_SEEDS: usize = 3;

impl SolverOptions {
    /// The default options at `spacing` (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            grading: None,
            fit_radius: FIT_RADIUS_IN_SPACINGS * spacing,
            smooth: 0.0,
            fill: FILL_IN_SPACINGS * spacing,
            iterations: 20,
            seeds: SeedRule::default(),
            dominant_normals: DominantNormals::default(),
            seeds_per_point: 0.0,
            acceleration: Acceleration::default(),
            patch: PatchKind::default(),
            restriction: Restriction::Local,
            edge_capture: None,
            drops_isolated: false,
            seed: 0,
        }
    }

    /// The options where the spacing is `spacing` (CRS units): lengths that are numbers of spacings are shorter there.
    pub(super) fn at(&self, spacing: f64) -> Self {
        let Some(grading) = self.grading else {
            return *self;
        };
        let share = spacing / self.spacing;
        Self {
            spacing,
            fit_radius: grading.widest_fit.min(FIT_RADIUS_IN_SPACINGS * spacing),
            fill: if grading.scales_fill {
                self.fill * share
            } else {
                self.fill
            },
            edge_capture: self.edge_capture.map(|capture| capture * share),
            ..*self
        }
    }

    /// The finest spacing (CRS units).
    pub(crate) fn finest_spacing(&self) -> f64 {
        self.grading
            .map_or(self.spacing, |grading| grading.finest * self.spacing)
    }

    /// How far the points of a scan matter to the spacing at a position (CRS units).
    pub(super) fn reach_of_grading(&self) -> f64 {
        self.grading
            .map_or(0.0, |grading| grading.reach() * self.spacing)
    }

    /// Bound on how far influence travels in one iteration (CRS units): the diameter of a
    /// large cell. Measured on a simulated street of 97 tiles: with 1.4 spacings all tiles
    /// agreed to the bit, with 0.9 to 10⁻⁹ spacings.
    pub(super) fn reach_of_an_iteration(&self) -> f64 {
        1.25 * self.spacing
    }

    /// Radius (CRS units) of the wide neighbourhood of a site, in which facets are sought and patches are corrected.
    pub(super) fn wide_radius(&self) -> f64 {
        WIDE_RADIUS_IN_FIT_RADII * self.fit_radius
    }

    /// Whether facets are sought in this `iteration` where patches round an edge. Sites that are to end on the edge need
    /// time to become even along it; others are moved to the facets when all iterations are done.
    pub(super) fn seeks_facets(&self, iteration: u32) -> bool {
        2 * iteration >= self.iterations && self.has_rows_on_edges()
    }

    /// Whether sites stand in rows on sharp edges.
    pub(super) fn has_rows_on_edges(&self) -> bool {
        self.edge_capture.is_some_and(|capture| capture > 0.0)
    }

    /// Depth (CRS units) inside the rectangle of available points from which on every tile
    /// elects the same seeds.
    pub(super) fn seed_margin(&self) -> f64 {
        match self.drops_isolated {
            true => self.isolation_margin(),
            false => self.election_margin(),
        }
    }

    /// Depth (CRS units) inside the rectangle of available points from which on every tile
    /// elects the same seeds, if isolated ones stay.
    fn election_margin(&self) -> f64 {
        let seen = match self.has_rows_on_edges() {
            true => self.wide_radius(),
            false => self.fit_radius,
        };
        let elected = SEED_MARGIN_IN_SPACINGS * self.spacing + seen;
        elected + 2.0 * (self.fill + self.smooth) + self.reach_of_grading()
    }

    /// Depth (CRS units) inside the rectangle of available points from which on every tile
    /// finds the same isolated seeds.
    pub(super) fn isolation_margin(&self) -> f64 {
        let group = (MANY_SEEDS - 1) as f64 * self.link();
        let beside = self.beside_radius() + self.surface_radius();
        // The last seed of a group that is small enough to be alone is a link nearer. Company has a group and planes of its own.
        let company = group.max(self.plane_radius());
        let alone = self.alone_radius() + company - self.link();
        self.election_margin() + group + beside.max(self.plane_radius()).max(alone)
    }

    /// Seeds nearer to each other (CRS units) belong together. Where more points are requested than were scanned, seeds are
    /// as far apart as the points are.
    pub(super) fn link(&self) -> f64 {
        LINK_IN_SPACINGS * self.spacing * self.seeds_per_point.max(1.0).sqrt()
    }

    /// Radius (CRS units) of the neighbourhood in which seeds may lie on a common plane.
    pub(super) fn plane_radius(&self) -> f64 {
        PLANE_IN_LINKS * self.link()
    }

    /// Radius (CRS units) of the neighbourhood in which a small group of seeds may be alone.
    pub(super) fn alone_radius(&self) -> f64 {
        ALONE_IN_LINKS * self.link()
    }

    /// Radius (CRS units) of the neighbourhood of a seed in which a surface passes by it.
    pub(super) fn beside_radius(&self) -> f64 {
        BESIDE_IN_LINKS * self.link()
    }

    /// Radius (CRS units) of the neighbourhood of a seed whose plane is its surface.
    pub(super) fn surface_radius(&self) -> f64 {
        SURFACE_IN_LINKS * self.link()
    }

    /// Bound on the distance (CRS units) from a seed to the nearest point of the scan: half of
    /// the widest hole that is filled, and a margin.
    pub(crate) fn farthest_seed(&self) -> f64 {
        2.5 * self.spacing + 0.5 * self.fill + self.smooth
    }
}
