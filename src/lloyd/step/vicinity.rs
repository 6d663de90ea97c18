//! The vicinity of a site: its neighbours, and the cell that they leave to it.

use std::ops::Range;

use super::{
    fit::{BOUNDING_RADIUS_IN_SPACINGS, Fit},
    links::Links,
    neighborhoods::{FarList, NEAR_IN_SPACINGS, Neighborhoods},
    restriction::Restriction,
    scratch::Scratch,
};
use crate::{
    geometry::{BOUNDING_SIDES, Local, Moments, Neighbor, Patch, Reach, keeps_corner},
    lloyd::{
        SolverOptions,
        surface::{Surface, bounding_box},
    },
};

/// No step brings two sites nearer to each other than this, or nearer than they are. On one
/// surface the cells see to it; but the sites on the two sides of a leaf share no bisector and
/// have one patch.
const CLEARANCE_IN_SPACINGS: f64 = 0.7;

/// The clearance of a site whose centroid is doubtful is wider by this factor. Such sites draw up to
/// neighbours that stand still, and away from where none are: the energy of each cell on its patch
/// falls, and the distances become less even with each iteration. With the clearance of others δ
/// rose by more than 1 % from its least value in 15 of 18 cases of real scans, by up to 15 %. A
/// wider clearance costs energy: with 0.9 spacings up to half a percent more than with 0.88.
const DOUBTFUL_CLEARANCE_FACTOR: f64 = 0.88 / CLEARANCE_IN_SPACINGS;

/// The clearance between sites (CRS units). Seeds of the rules without election start in
/// clumps, which a clearance would keep from spreading.
pub(crate) fn clearance(options: &SolverOptions) -> f64 {
    match options.seeds.is_election() {
        true => CLEARANCE_IN_SPACINGS * options.spacing,
        false => 0.0,
    }
}

/// A patch is nearly flat if no chord as long as the longest edge of a cell lies farther off it
/// than a quarter of this.
const NEARLY_FLAT_IN_SPACINGS: f64 = 0.1;

/// Whether the patch leaves the longest edge of a cell by little.
pub(super) fn is_nearly_flat(patch: &Patch, spacing: f64) -> bool {
    patch.max_quadratic_term(NEAR_IN_SPACINGS * spacing) <= NEARLY_FLAT_IN_SPACINGS * spacing
}

/// Bound on the search for neighbours that could cut a cell: the corners of a bounding polygon
/// on a patch that bends more lie on no surface.
const FAR_IN_SPACINGS: f64 = 2.5 * BOUNDING_RADIUS_IN_SPACINGS;

/// Relative slack for rounding in the search for neighbours that are in the way.
const SLACK: f64 = 1e-9;

/// A site with its surroundings.
pub(crate) struct Vicinity<'a> {
    /// The index of the site.
    pub(crate) site: usize,
    /// The position of the site.
    pub(crate) position: Local,
    /// The spacing at the site (CRS units).
    pub(crate) spacing: f64,
    /// The step does not bring the site nearer to another than this (CRS units).
    pub(crate) clearance: f64,
    pub(crate) neighborhoods: &'a Neighborhoods,
    /// The sites of the block of the site.
    pub(crate) block: Range<usize>,
    /// The neighbours with which the cell of the site shared edges last.
    pub(crate) links: Links,
    /// Whether those neighbours did not bound the cell all around.
    pub(crate) was_open: bool,
    /// Whether far neighbours may close the cell before the scan ends it: for figures, from
    /// which no large cell may be missing.
    pub(crate) may_close_far: bool,
    pub(crate) scratch: &'a mut Scratch,
}

impl Vicinity<'_> {
    /// The coarsest spacing at the sites of the block (CRS units).
    fn coarsest_of_block(&self) -> f64 {
        self.neighborhoods.spacings().coarsest_of(&self.block)
    }

    /// Collects the samples around the whole block, for all its patches to come.
    pub(super) fn gather_samples(&mut self, surface: Surface<'_>) {
        if !self.scratch.has_samples {
            let positions = &self.neighborhoods.positions()[self.block.clone()];
            let [low, high] = bounding_box(positions.iter().copied());
            let options = surface.options.at(self.coarsest_of_block());
            let samples = &mut self.scratch.samples;
            samples.gather_box(surface.with(&options), low, high);
            self.scratch.has_samples = true;
        }
    }

    /// III-B: fits the patch of the site, if it is to be trusted.
    pub(super) fn fit(&mut self, surface: Surface<'_>) -> Option<Fit> {
        let Scratch {
            samples,
            has_samples,
            ..
        } = &mut *self.scratch;
        if !*has_samples {
            samples.gather_box(surface, self.position, self.position);
        }
        Fit::trusted(self.position, samples, surface.options)
    }

    /// III-C: clips the cell of the site on the patch of `fit` by all neighbours that can cut
    /// it, and gives its moments; `None` if nothing is left of the cell. A cell that
    /// neighbours do not bound all around ends where the scan does, if the restriction is
    /// local: near neighbours come before the end of the scan, far ones before it only if
    /// [`may_close_far`](Self::may_close_far).
    pub(super) fn restricted_cell(
        &mut self,
        fit: &mut Fit,
        far: &mut FarList,
        surface: Surface<'_>,
    ) -> Option<Moments> {
        self.find_near();
        if self.was_open || !self.closed_cell(&fit.patch) {
            Neighbor::sort(&mut self.scratch.neighbors);
            let whole = [BOUNDING_RADIUS_IN_SPACINGS * self.spacing; BOUNDING_SIDES];
            let ends_with_scan = surface.options.restriction == Restriction::Local;
            // Most open cells are seen to be open before they are clipped.
            let is_open = ends_with_scan
                && !self.may_close_far
                && keeps_corner(&fit.patch, self.position, &whole, &self.scratch.neighbors);
            if !is_open {
                self.clip_cell(&fit.patch, &whole);
                if self.may_close_far {
                    self.clip_by_far(&fit.patch, far);
                }
            }
            if is_open || ends_with_scan && !self.scratch.cell.is_closed() {
                let samples = &mut self.scratch.samples;
                let scanned = fit.scanned_reach(self.position, surface, samples);
                self.clip_cell(&fit.patch, &scanned);
            }
            if !self.may_close_far {
                self.clip_by_far(&fit.patch, far);
            }
        }
        self.scratch.cell.moments(&fit.patch, self.position)
    }

    /// Computes the cell if near neighbours bound it all around, as they did before; `false`
    /// if they do not.
    fn closed_cell(&mut self, patch: &Patch) -> bool {
        let Scratch {
            cell,
            ring,
            neighbors,
            ..
        } = &mut *self.scratch;
        let radius = 0.5 * NEAR_IN_SPACINGS * self.spacing;
        ring.clear();
        let links = self.links.sites();
        ring.extend(links.map(|link| self.neighborhoods.neighbor(self.site, link)));
        if cell.close(patch, self.position, radius, ring, neighbors) {
            return true;
        }
        // Long edges of a bent patch would be cut twice, and missed.
        if !is_nearly_flat(patch, self.spacing) {
            return false;
        }
        Neighbor::sort(neighbors);
        cell.clip_within(patch, self.position, radius, neighbors)
    }

    /// Clips the bounding polygon of `reach` by the neighbours, which are sorted.
    fn clip_cell(&mut self, patch: &Patch, reach: &Reach) {
        let Scratch {
            cell, neighbors, ..
        } = &mut *self.scratch;
        cell.clip(patch, self.position, reach, neighbors);
    }

    /// Whether neighbours bound the cell all around, and none is too far to be found that could cut
    /// it further: on a patch that bends much a cell may have corners anywhere.
    pub(crate) fn has_closed_cell(&self) -> bool {
        let cell = &self.scratch.cell;
        cell.is_closed() && cell.security_squared() <= (FAR_IN_SPACINGS * self.spacing).powi(2)
    }

    /// Clips the cell by the neighbours farther than near that could cut it.
    fn clip_by_far(&mut self, patch: &Patch, list: &mut FarList) {
        let near = (NEAR_IN_SPACINGS * self.spacing).powi(2);
        let security = self.scratch.cell.security_squared();
        if security > near {
            let radius = security.sqrt().min(FAR_IN_SPACINGS * self.spacing);
            let count = self.scratch.neighbors.len();
            self.find_far(radius, list);
            let Scratch {
                cell, neighbors, ..
            } = &mut *self.scratch;
            let far = &mut neighbors[count..];
            Neighbor::sort(far);
            cell.clip_on(patch, self.position, far);
        }
    }

    /// Makes the neighbours all other sites within [`NEAR_IN_SPACINGS`].
    pub(super) fn find_near(&mut self) {
        let Scratch {
            strays, neighbors, ..
        } = &mut *self.scratch;
        if !self.neighborhoods.near(self.site, strays, neighbors) {
            neighbors.clear();
            self.find_within(NEAR_IN_SPACINGS * self.spacing, |_| true);
        }
    }

    /// Adds to the neighbours all other sites that are farther than [`NEAR_IN_SPACINGS`], and
    /// within `radius` (CRS units), by the `list` of the site.
    fn find_far(&mut self, radius: f64, list: &mut FarList) {
        let (neighborhoods, site) = (self.neighborhoods, self.site);
        let around_block = FAR_IN_SPACINGS * self.coarsest_of_block();
        let near = (NEAR_IN_SPACINGS * self.spacing).powi(2);
        let Scratch {
            neighbors,
            strays,
            far_strays,
            listed,
            ..
        } = &mut *self.scratch;
        if strays.contains(&(site as u32)) {
            self.find_within(radius, |squared| squared > near);
            return;
        }
        let reach = FAR_IN_SPACINGS * self.spacing;
        let far_strays = far_strays.get_or_insert_with(|| {
            let mut found = Vec::new();
            neighborhoods.strays_around(&self.block, around_block, &mut found);
            found
        });
        if neighborhoods.is_outdated(list) {
            // Other sites of the block will need them, too.
            let listed = listed
                .get_or_insert_with(|| neighborhoods.listed_around(&self.block, around_block));
            neighborhoods.renew(list, site, reach, listed);
        }
        let others = neighborhoods.far(list, far_strays);
        let others = others.map(|other| neighborhoods.neighbor(site, other));
        neighbors.extend(others.filter(|other| {
            let squared = other.distance_squared;
            squared > near && squared <= radius * radius
        }));
    }

    /// Whether neither the site nor any that can be near it has just moved.
    pub(super) fn is_still(&self) -> bool {
        let is_still = |site: u32| self.neighborhoods.length_of_move(site as usize) == 0.0;
        let listed = self.neighborhoods.listed(self.site, &self.scratch.strays);
        is_still(self.site as u32) && listed.is_some_and(|mut others| others.all(is_still))
    }

    /// Adds to the neighbours all other sites within `radius` (CRS units) for whose squared
    /// distance `is_wanted` is true.
    fn find_within(&mut self, radius: f64, is_wanted: impl Fn(f64) -> bool) {
        let around_block = FAR_IN_SPACINGS * self.coarsest_of_block();
        let Scratch {
            neighbors,
            sites,
            reach,
            ..
        } = &mut *self.scratch;
        if radius > *reach {
            // Other sites of the block will need them, too.
            *reach = radius.max(around_block);
            self.neighborhoods.all_around(&self.block, *reach, sites);
        }
        let others = sites
            .iter()
            .filter(|&&(other, _)| other as usize != self.site)
            .map(|&(other, position)| Neighbor::new(self.position, other, position));
        neighbors.extend(others.filter(|other| {
            let squared = other.distance_squared;
            squared <= radius * radius && is_wanted(squared)
        }));
    }

    /// The length of the longest last move (spacings) among the site and the other sites
    /// within the square root of `attention` (CRS units squared); and whether all those
    /// others were exact.
    pub(super) fn farthest_move(&mut self, attention: f64, was_exact: &[bool]) -> (f64, bool) {
        let (neighborhoods, position) = (self.neighborhoods, self.position);
        let mut farthest = neighborhoods.length_of_move(self.site);
        let mut is_exact = true;
        let mut regard = |other: u32| {
            let other = other as usize;
            let length = neighborhoods.length_of_move(other);
            // The positions of few are needed: they are compared last.
            if (length > farthest || is_exact && !was_exact[other])
                && (neighborhoods.positions()[other] - position).norm_squared() <= attention
            {
                farthest = farthest.max(length);
                is_exact &= was_exact[other];
            }
        };
        if let Some(listed) = neighborhoods.listed(self.site, &self.scratch.strays) {
            listed.for_each(regard);
        } else {
            self.scratch.neighbors.clear();
            self.find_within(attention.sqrt(), |_| true);
            let neighbors = self.scratch.neighbors.drain(..);
            neighbors.for_each(|other| regard(other.index));
        }
        (farthest.into(), is_exact)
    }

    /// The position nearest to `target` at which the site keeps clear of the bisector with
    /// every neighbour by half the clearance. If all sites do, no two come nearer to each
    /// other than the clearance.
    pub(super) fn keeping_clear(&mut self, target: Local) -> Local {
        let mut step = target - self.position;
        // Neighbours that are farther than near, and not listed, must keep clear, too.
        let longest = 0.5 * (NEAR_IN_SPACINGS * self.spacing - self.clearance);
        if step.norm_squared() > longest * longest {
            step *= longest / step.norm();
        }
        // Most neighbours are too far to be in the way.
        let reach = self.clearance + (2.0 + SLACK) * step.norm();
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
        // The part of the step that leads too near to a neighbour is removed, so that the site
        // slides past it; where two are in the way the step is shortened.
        let neighbors = || {
            self.scratch.in_the_way.iter().map(|neighbor| {
                let distance = neighbor.distance_squared.sqrt();
                let towards = (neighbor.position - self.position) / distance;
                (towards, self.room(distance))
            })
        };
        for (towards, room) in neighbors() {
            step -= towards * (step.dot(&towards) - room).max(0.0);
        }
        let mut share = 1.0_f64;
        for (towards, room) in neighbors() {
            let along = step.dot(&towards);
            if along > room + SLACK * self.spacing {
                share = share.min(room / along);
            }
        }
        self.position + step * share
    }

    /// Whether a site that is moved to `place` comes no nearer to a neighbour than `clearance` (CRS units), or than its
    /// nearest neighbour is.
    pub(super) fn is_clear(&self, place: Local, clearance: f64) -> bool {
        let from = |start: Local| {
            let neighbors = self.scratch.neighbors.iter();
            let distances = neighbors.map(|neighbor| (neighbor.position - start).norm());
            distances.fold(f64::INFINITY, f64::min)
        };
        from(place) >= clearance.min(from(self.position))
    }

    /// How far the site may move in any direction and keep clear (CRS units).
    pub(super) fn free_radius(&self) -> f64 {
        self.scratch
            .nearest()
            .map_or(0.0, |nearest| self.room(nearest))
    }

    /// Widens the clearance to that of a site whose centroid is doubtful.
    pub(super) fn widen_clearance(&mut self) {
        self.clearance *= DOUBTFUL_CLEARANCE_FACTOR;
    }

    /// How far the site may move towards a neighbour at `distance` (CRS units).
    pub(super) fn room(&self, distance: f64) -> f64 {
        0.5 * (distance - self.clearance).max(0.0)
    }

    /// Whether `distance` (CRS units) is that of a near site.
    pub(super) fn is_near(&self, distance: Option<f64>) -> bool {
        distance.is_some_and(|distance| distance <= NEAR_IN_SPACINGS * self.spacing)
    }

    /// Distance to the nearest other site (CRS units), if it shares an edge of the cell that was
    /// clipped last.
    pub(super) fn nearest_linked(&self) -> Option<f64> {
        let nearest = self.scratch.nearest()?;
        let mut links = self.scratch.cell.neighbors();
        let distance = |link| {
            self.neighborhoods
                .neighbor(self.site, link)
                .distance_squared
                .sqrt()
        };
        links
            .any(|link| distance(link) <= nearest)
            .then_some(nearest)
    }

    /// Distance to the nearest other site, if one lies within `radius` (CRS units).
    pub(crate) fn nearest_within(&mut self, radius: f64) -> Option<f64> {
        if self.scratch.neighbors.is_empty() {
            self.find_near();
        }
        if self.scratch.neighbors.is_empty() {
            self.find_within(radius, |_| true);
        }
        self.scratch.nearest()
    }
}
