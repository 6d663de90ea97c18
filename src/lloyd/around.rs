//! What is around a site: its neighbours, and the cell that they leave it.

use std::ops::Range;

use super::{
    Restriction, Scan, SeedRule, SolverOptions,
    acceleration::{LINKS, linked},
    fit::{DOMAIN_RADIUS, Fit, Samples},
    neighborhoods::{NEAR, Neighborhoods, bounds, neighbor},
};
use crate::geometry::{BOUNDING_SIDES, Cell, Local, Moments, Neighbor, Patch, Reach};

/// No step brings two sites nearer than this, in spacings, or nearer than they
/// are. On one surface cells see to it; two sides of a leaf do not know of each
/// other, and have one patch.
const CLEARANCE: f64 = 0.7;

/// The clearance (CRS units) that holds for the sites of `options`. Seeds that
/// were not elected start in clumps, which it would keep from spreading.
pub(super) fn clearance(options: &SolverOptions) -> f64 {
    match options.seeds {
        SeedRule::Hexagonal | SeedRule::Poisson => CLEARANCE * options.spacing,
        SeedRule::Area | SeedRule::Random => 0.0,
    }
}

/// A patch is nearly flat if over the longest edge of a cell it leaves its chord by
/// no more than a quarter of this, in spacings.
const NEARLY_FLAT: f64 = 0.1;

/// Whether the longest edge of a cell on `patch` hardly leaves its chord.
pub(super) fn is_nearly_flat(patch: &Patch, spacing: f64) -> bool {
    patch.most_bend(NEAR * spacing) <= NEARLY_FLAT * spacing
}

/// Farthest that is looked for neighbours that could cut a cell, in spacings: the corners of
/// a domain that bends more lie on no surface.
const FAR: f64 = 2.5 * DOMAIN_RADIUS;

/// What a thread reuses from site to site.
pub(super) struct Scratch {
    pub(super) cell: Cell,
    /// The neighbours of a site.
    pub(super) neighbors: Vec<Neighbor>,
    /// Those that its cell had edges with.
    ring: Vec<Neighbor>,
    /// Those that are in the way of its step.
    in_the_way: Vec<Neighbor>,
    pub(super) samples: Samples,
    /// Whether the samples are those around the block.
    has_samples: bool,
    /// Strays around the block.
    strays: Vec<u32>,
    /// All sites around it, as far as they were looked for (CRS units).
    sites: Vec<(u32, Local)>,
    reach: f64,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self {
            cell: Cell::new(),
            neighbors: Vec::new(),
            ring: Vec::new(),
            in_the_way: Vec::new(),
            samples: Samples::default(),
            has_samples: false,
            strays: Vec::new(),
            sites: Vec::new(),
            reach: 0.0,
        }
    }

    /// Makes ready for the sites of `block`.
    pub(super) fn begin(&mut self, neighborhoods: &Neighborhoods, block: &Range<usize>) {
        self.has_samples = false;
        self.reach = 0.0;
        let radius = NEAR * neighborhoods.spacing();
        neighborhoods.strays_around(block, radius, &mut self.strays);
    }

    /// Distance to the nearest neighbour.
    pub(super) fn nearest(&self) -> Option<f64> {
        let squared = self.neighbors.iter().map(|n| n.distance_squared);
        squared.min_by(f64::total_cmp).map(f64::sqrt)
    }
}

/// A site and what is around it.
pub(super) struct Around<'a> {
    pub(super) site: usize,
    pub(super) place: Local,
    pub(super) spacing: f64,
    /// No step brings two sites nearer than this (CRS units).
    pub(super) clearance: f64,
    pub(super) neighborhoods: &'a Neighborhoods,
    /// The sites of its block.
    pub(super) block: Range<usize>,
    /// Those that its cell had edges with last, counter-clockwise.
    pub(super) links: [u32; LINKS],
    /// Whether they did not bound it all around.
    pub(super) was_open: bool,
    /// Whether far neighbours may close the cell before the scan ends it: for figures, from
    /// which no large cell may be missing.
    pub(super) asks_far: bool,
    pub(super) scratch: &'a mut Scratch,
}

impl Around<'_> {
    /// DisplayAttributes up the samples around the whole block, for all its patches to come.
    pub(super) fn look_for_samples(&mut self, scan: &Scan, options: &SolverOptions) {
        if !self.scratch.has_samples {
            let places = &self.neighborhoods.places()[self.block.clone()];
            let [low, high] = bounds(places.iter().copied());
            self.scratch.samples.look(scan, low, high, options);
            self.scratch.has_samples = true;
        }
    }

    /// III-B: the patch of the site.
    pub(super) fn fit(&mut self, scan: &Scan, options: &SolverOptions) -> Option<Fit> {
        let Scratch {
            samples,
            has_samples,
            ..
        } = &mut *self.scratch;
        if !*has_samples {
            samples.look(scan, self.place, self.place, options);
        }
        samples.fit(self.place, options)
    }

    /// Clips the cell of the site on the patch of `fit`, looking as far as it
    /// takes; its moments, if anything is left of it. A cell that neighbours do not
    /// bound all around ends where the scan does, if sites are to keep to it: near ones,
    /// unless far ones are asked.
    pub(super) fn restricted_cell(
        &mut self,
        fit: &mut Fit,
        scan: &Scan,
        options: &SolverOptions,
    ) -> Option<Moments> {
        self.look_near();
        if self.was_open || !self.closed_cell(&fit.patch) {
            Neighbor::sort(&mut self.scratch.neighbors);
            self.clipped_cell(&fit.patch, &[DOMAIN_RADIUS * self.spacing; BOUNDING_SIDES]);
            if self.asks_far {
                self.clip_on(&fit.patch);
            }
            if !self.scratch.cell.is_closed() && options.restriction == Restriction::Local {
                let scanned = fit.scanned(self.place, scan, options, &mut self.scratch.samples);
                self.clipped_cell(&fit.patch, &scanned);
            }
            if !self.asks_far {
                self.clip_on(&fit.patch);
            }
        }
        self.scratch.cell.moments(&fit.patch, self.place)
    }

    /// The cell, if near neighbours bound it all around, as they did before; whether
    /// they do.
    fn closed_cell(&mut self, patch: &Patch) -> bool {
        let Scratch {
            cell,
            ring,
            neighbors,
            ..
        } = &mut *self.scratch;
        let radius = 0.5 * NEAR * self.spacing;
        ring.clear();
        ring.extend(linked(&self.links).map(|link| self.neighborhoods.neighbor(self.site, link)));
        if cell.close(patch, self.place, radius, ring, neighbors) {
            return true;
        }
        // Long edges of a bent patch would be cut twice, and missed.
        if !is_nearly_flat(patch, self.spacing) {
            return false;
        }
        Neighbor::sort(neighbors);
        cell.clip_within(patch, self.place, radius, neighbors)
    }

    /// What the neighbours, which are sorted, leave of the domain of `reach`.
    fn clipped_cell(&mut self, patch: &Patch, reach: &Reach) {
        let Scratch {
            cell, neighbors, ..
        } = &mut *self.scratch;
        cell.clip(patch, self.place, reach, neighbors);
    }

    /// Clips the cell by those farther than near that could cut it as it is.
    fn clip_on(&mut self, patch: &Patch) {
        let near = (NEAR * self.spacing).powi(2);
        let security = self.scratch.cell.security_squared();
        if security > near {
            let radius = security.sqrt().min(FAR * self.spacing);
            let looked_at = self.scratch.neighbors.len();
            self.look_around(radius, |squared| squared > near);
            let Scratch {
                cell, neighbors, ..
            } = &mut *self.scratch;
            let far = &mut neighbors[looked_at..];
            Neighbor::sort(far);
            cell.clip_on(patch, self.place, far);
        }
    }

    /// All others within [`NEAR`].
    pub(super) fn look_near(&mut self) {
        let Scratch {
            strays, neighbors, ..
        } = &mut *self.scratch;
        if !self.neighborhoods.near(self.site, strays, neighbors) {
            neighbors.clear();
            self.look_around(NEAR * self.spacing, |_| true);
        }
    }

    /// Adds to the neighbours all others within `radius` (CRS units) whose squared distance is
    /// `wanted`.
    fn look_around(&mut self, radius: f64, wanted: impl Fn(f64) -> bool) {
        let Scratch {
            neighbors,
            sites,
            reach,
            ..
        } = &mut *self.scratch;
        if radius > *reach {
            // Others of the block will ask, too.
            *reach = radius.max(FAR * self.spacing);
            self.neighborhoods.all_around(&self.block, *reach, sites);
        }
        let others = sites
            .iter()
            .filter(|&&(other, _)| other as usize != self.site)
            .map(|&(other, position)| neighbor(self.place, other, position));
        neighbors.extend(others.filter(|other| {
            let squared = other.distance_squared;
            squared <= radius * radius && wanted(squared)
        }));
    }

    /// How far the site has gone with the last move, or any other within the square root
    /// of `attention` (CRS units squared) if that went farther, in spacings; and whether
    /// all those were exact.
    pub(super) fn farthest_move(&mut self, attention: f64, was_exact: &[bool]) -> (f64, bool) {
        let (neighborhoods, place) = (self.neighborhoods, self.place);
        let mut farthest = neighborhoods.length_of_move(self.site);
        let mut is_exact = true;
        let mut hear = |other: u32| {
            let other = other as usize;
            let length = neighborhoods.length_of_move(other);
            // Where the others are is asked of few.
            if (length > farthest || is_exact && !was_exact[other])
                && (neighborhoods.places()[other] - place).norm_squared() <= attention
            {
                farthest = farthest.max(length);
                is_exact &= was_exact[other];
            }
        };
        if let Some(listed) = neighborhoods.listed(self.site, &self.scratch.strays) {
            listed.for_each(hear);
        } else {
            self.scratch.neighbors.clear();
            self.look_around(attention.sqrt(), |_| true);
            let neighbors = self.scratch.neighbors.drain(..);
            neighbors.for_each(|other| hear(other.index));
        }
        (farthest.into(), is_exact)
    }

    /// As near to `target` as the site can go and keep clear of every neighbour's
    /// bisector by half the clearance. If all sites do, none come nearer to each
    /// other than it.
    pub(super) fn keeping_clear(&mut self, target: Local) -> Local {
        let mut step = target - self.place;
        // Farther neighbours than are known here must not come near either.
        let longest = 0.5 * (NEAR * self.spacing - self.clearance);
        if step.norm_squared() > longest * longest {
            step *= longest / step.norm();
        }
        // Most neighbours are too far to be in the way.
        let reach = self.clearance + (2.0 + 1e-9) * step.norm();
        let is_in_the_way = |neighbor: &&Neighbor| {
            neighbor.distance_squared <= reach * reach && neighbor.distance_squared > 0.0
        };
        let Scratch {
            neighbors,
            in_the_way,
            ..
        } = &mut *self.scratch;
        in_the_way.clear();
        in_the_way.extend(neighbors.iter().filter(is_in_the_way));
        Neighbor::sort(in_the_way);
        // What leads too near to one is taken off the step, not the step off the
        // site; where two are in the way it is shortened.
        let neighbors = || {
            self.scratch.in_the_way.iter().map(|neighbor| {
                let distance = neighbor.distance_squared.sqrt();
                let towards = (neighbor.position - self.place) / distance;
                (towards, self.room(distance))
            })
        };
        for (towards, room) in neighbors() {
            step -= towards * (step.dot(&towards) - room).max(0.0);
        }
        let mut share = 1.0_f64;
        for (towards, room) in neighbors() {
            let along = step.dot(&towards);
            if along > room + 1e-9 * self.spacing {
                share = share.min(room / along);
            }
        }
        self.place + step * share
    }

    /// How far the site may go in any direction and keep clear.
    pub(super) fn free(&self) -> f64 {
        self.scratch
            .nearest()
            .map_or(0.0, |nearest| self.room(nearest))
    }

    /// How far the site may go towards one at `distance`.
    pub(super) fn room(&self, distance: f64) -> f64 {
        0.5 * (distance - self.clearance).max(0.0)
    }

    /// Distance to the nearest other site, if one lies within `radius`.
    pub(super) fn nearest_within(&mut self, radius: f64) -> Option<f64> {
        if self.scratch.neighbors.is_empty() {
            self.look_near();
        }
        if self.scratch.neighbors.is_empty() {
            self.look_around(radius, |_| true);
        }
        self.scratch.nearest()
    }
}
