//! One Lloyd step of one site: its patch, its neighbours, its cell.

use crate::geometry::{
    Cell, DOMAIN_SIDES, Local, Moments, Neighbor, NeighborGrid, Patch, PatchKind, Reach,
    domain_corners,
};

use super::{Options, Restriction, Scan, SeedRule};

/// Radius of a cell's domain, in spacings. Seeds cover surfaces at 0.745
/// spacings, so no cell inside one reaches it.
pub(super) const DOMAIN_RADIUS: f64 = 1.0;

/// A patch stays in use until its site has moved this far from where it was
/// fitted, in spacings: the fit's weights fall off over 1.2.
const PATCH_SKIN: f64 = 0.1;

/// No step brings two sites nearer than this, in spacings, or nearer than they
/// are. On one surface cells see to it; two sides of a leaf do not know of each
/// other, and have one patch.
const CLEARANCE: f64 = 0.7;

/// The clearance (CRS units) that holds for the sites of `options`. Seeds that
/// were not elected start in clumps, which it would keep from spreading.
pub(super) fn clearance(options: &Options) -> f64 {
    match options.seeds {
        SeedRule::Hexagonal | SeedRule::Poisson => CLEARANCE * options.spacing,
        SeedRule::Area | SeedRule::Random => 0.0,
    }
}

/// Farthest from a patch, in spacings, that a sample of its surface lies.
pub(super) const THICKNESS: f64 = 0.25;

/// A sample lies towards a corner of the domain if the cosine between them is
/// at least this: up to 26°.
const WITHIN: f64 = 0.9;

/// A patch and what the fit saw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) patch: Patch,
    /// Where the site was when the patch was fitted.
    anchor: Local,
    /// Spacing of the scan around it (CRS units).
    pub(super) input_spacing: f64,
    /// What share of a step may be taken by the patch.
    pub(super) trust: f64,
    /// The point that the boundary restriction found last: the next place is
    /// near it, too, more often than not.
    witness: Local,
}

impl Fit {
    /// Whether the patch still stands for the surface at `site`.
    pub(super) fn serves(&self, site: Local, spacing: f64) -> bool {
        let skin = PATCH_SKIN * spacing;
        (site - self.anchor).norm_squared() <= skin * skin
    }

    /// How far the scan reaches around `site` on the patch, at most as far as the
    /// domain. `samples` is scratch.
    fn scanned(
        &self,
        site: Local,
        scan: &Scan,
        options: &Options,
        samples: &mut Vec<Local>,
    ) -> Reach {
        let spacing = options.spacing;
        scan.samples().gather(site, options.fit_radius, samples);
        let mut reach = [0.0_f64; DOMAIN_SIDES];
        let [u, v, _] = self.patch.coordinates(site);
        for &sample in &*samples {
            let [s, t, height] = self.patch.coordinates(sample);
            if (height - self.patch.height(s, t)).abs() > THICKNESS * spacing {
                continue;
            }
            let way = [s - u, t - v];
            let distance = way[0].hypot(way[1]);
            for (reach, corner) in reach.iter_mut().zip(domain_corners()) {
                let along = way[0] * corner[0] + way[1] * corner[1];
                if along >= WITHIN * distance {
                    *reach = reach.max(along);
                }
            }
        }
        // A sample stands for what is around it.
        let margin = (0.5 * self.input_spacing).max(0.42 * spacing);
        reach.map(|reach| (reach + margin).min(DOMAIN_RADIUS * spacing))
    }

    /// Whether the patch describes its neighbourhood well enough to move by.
    pub(super) fn is_trusted(&self) -> bool {
        self.trust > 0.0
    }
}

/// A patch that leaves this much unexplained, in spacings, is near an edge …
const SHARP: f64 = 0.02;
/// … and with so much more it reaches …
const SHARPER: f64 = 0.06;
/// … this share of its reach less far, so as not to round the edge: if that
/// explains more, and on so many samples.
const WITHDRAWN: f64 = 0.15;
const WITHDRAWN_SUPPORT: u32 = 12;
const EXPLAINS_MORE: f64 = 0.9;

/// Edge of a block, in spacings. Places of a block look for their neighbours and
/// for samples together.
pub(super) const BLOCK: f64 = 2.4;

/// The corners of the box about `places`.
pub(super) fn bounds(places: impl Iterator<Item = Local>) -> [Local; 2] {
    let far = Local::repeat(f64::INFINITY);
    places.fold([far, -far], |[low, high], place| {
        [low.inf(&place), high.sup(&place)]
    })
}

/// The samples in and around a box, for the patches of the places in it.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// Each with the number of points that it stands for.
    around: Vec<(Local, u32)>,
    /// Scratch: those of one patch.
    within: Vec<Local>,
}

impl Samples {
    /// Looks up what the patches of places from `low` to `high` may need.
    pub(super) fn look(&mut self, scan: &Scan, low: Local, high: Local, options: &Options) {
        let reach = Local::repeat(options.fit_radius);
        self.around.clear();
        scan.samples()
            .visit_box(low - reach, high + reach, |index, sample| {
                self.around.push((sample, scan.count(index)));
            });
    }

    /// Those nearer to `place`, which was looked around, than `radius` (CRS units),
    /// and how many points they stand for.
    pub(super) fn within(&mut self, place: Local, radius: f64) -> (&[Local], u64) {
        let mut points = 0;
        self.within.clear();
        for &(sample, count) in &self.around {
            if (sample - place).norm_squared() < radius * radius {
                self.within.push(sample);
                points += u64::from(count);
            }
        }
        (&self.within, points)
    }

    /// Fits the patch at `site`, a place that was looked around; `None` where the
    /// scan does not carry one.
    pub(super) fn fit(&mut self, site: Local, options: &Options) -> Option<Fit> {
        let radius = options.fit_radius;
        let (near, points) = self.within(site, radius);
        let patch = Patch::fit(site, near, radius, options.patch)?;
        Some(Fit {
            patch: sharper(&patch, site, near, options).unwrap_or(patch),
            anchor: site,
            input_spacing: radius * (std::f64::consts::PI / points as f64).sqrt(),
            // A sharper patch finds a surface in leaves, too.
            trust: patch.trust(radius.max(options.spacing)),
            witness: Local::repeat(f64::NAN),
        })
    }
}

/// The patch that keeps to what is nearer, where `patch` rounds an edge.
fn sharper(patch: &Patch, site: Local, samples: &[Local], options: &Options) -> Option<Patch> {
    let excess = patch.residual / options.spacing - SHARP;
    if excess <= 0.0 || options.patch == PatchKind::Plane {
        return None;
    }
    let reach = 1.0 - WITHDRAWN * (excess / SHARPER).min(1.0);
    Patch::fit(site, samples, options.fit_radius * reach, options.patch).filter(|sharper| {
        sharper.support >= WITHDRAWN_SUPPORT && sharper.residual < EXPLAINS_MORE * patch.residual
    })
}

/// The boundary restriction (IV-E).
pub(super) fn is_allowed(scan: &Scan, fit: &mut Fit, place: Local, options: &Options) -> bool {
    let threshold = options
        .restriction
        .threshold(fit.input_spacing, options.spacing);
    if threshold.is_infinite() {
        return place.iter().all(|c| c.is_finite());
    }
    // Not a number is nowhere near the scan.
    if (place - fit.witness).norm_squared() <= threshold * threshold {
        return true;
    }
    let found = scan.some_point_within(place, threshold);
    fit.witness = found.unwrap_or(fit.witness);
    found.is_some()
}

/// The sites of one iteration, to be looked up around each.
pub(super) struct Neighborhoods {
    grid: NeighborGrid,
}

/// A patch is nearly flat if over the longest edge of a cell it leaves its chord by
/// no more than a quarter of this, in spacings.
const NEARLY_FLAT: f64 = 0.1;

/// A first ball of so many spacings holds what cuts a good cell …
const NEAR: f64 = 1.6;
/// … and one of so many whatever can cut any.
const FAR: f64 = 2.5 * DOMAIN_RADIUS;

impl Neighborhoods {
    /// Sites by cells of `edge` (CRS units).
    pub(super) fn new(sites: &[Local], edge: f64) -> Self {
        Self {
            grid: NeighborGrid::new(sites, edge),
        }
    }

    /// Fills `neighbors` with every site but `own` within `radius` of `place`,
    /// nearest first, equally near ones in the order of the sites.
    pub(super) fn gather(
        &self,
        place: Local,
        own: usize,
        radius: f64,
        neighbors: &mut Vec<Neighbor>,
    ) {
        neighbors.clear();
        self.grid.visit_around(place, radius, |index, position| {
            neighbors.extend(neighbor(place, own, radius * radius, index, position));
        });
        sort(neighbors);
    }
}

/// Site `index` at `position` as a neighbour of site `own` at `place`.
fn neighbor(
    place: Local,
    own: usize,
    radius_squared: f64,
    index: u32,
    position: Local,
) -> Option<Neighbor> {
    let distance_squared = (position - place).norm_squared();
    (distance_squared <= radius_squared && index as usize != own).then_some(Neighbor {
        distance_squared,
        index,
        position,
    })
}

fn sort(neighbors: &mut [Neighbor]) {
    neighbors.sort_unstable_by(|a, b| {
        a.distance_squared
            .total_cmp(&b.distance_squared)
            .then(a.index.cmp(&b.index))
    });
}

/// What a thread reuses from site to site.
pub(super) struct Scratch {
    pub(super) cell: Cell,
    /// The neighbours of a site, nearest first.
    pub(super) neighbors: Vec<Neighbor>,
    pub(super) samples: Samples,
    /// The box of a block's sites, and whether the samples are those around it.
    block: [Local; 2],
    has_samples: bool,
    /// The sites that can be near one of a block.
    around: Vec<(u32, Local)>,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self {
            cell: Cell::new(),
            neighbors: Vec::new(),
            samples: Samples::default(),
            block: [Local::zeros(); 2],
            has_samples: false,
            around: Vec::new(),
        }
    }

    /// Distance to the nearest neighbour.
    pub(super) fn nearest(&self) -> Option<f64> {
        self.neighbors.first().map(|n| n.distance_squared.sqrt())
    }

    /// Looks up the sites around a `block` of them.
    pub(super) fn surround(
        &mut self,
        neighborhoods: &Neighborhoods,
        block: &[Local],
        spacing: f64,
    ) {
        let [low, high] = bounds(block.iter().copied());
        self.block = [low, high];
        self.has_samples = false;
        let reach = Local::repeat(NEAR * spacing);
        let (low, high) = (low - reach, high + reach);
        self.around.clear();
        neighborhoods.grid.visit_box(low, high, |index, place| {
            if low <= place && place <= high {
                self.around.push((index, place));
            }
        });
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
    /// Its block is surrounded.
    pub(super) scratch: &'a mut Scratch,
}

impl Around<'_> {
    /// Looks up the samples around the whole block, for all its patches to come.
    pub(super) fn look_for_samples(&mut self, scan: &Scan, options: &Options) {
        let [low, high] = self.scratch.block;
        if !self.scratch.has_samples {
            self.scratch.samples.look(scan, low, high, options);
            self.scratch.has_samples = true;
        }
    }

    /// III-B: the patch of the site.
    pub(super) fn fit(&mut self, scan: &Scan, options: &Options) -> Option<Fit> {
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
    /// takes; its moments, if anything is left of it. A cell that neighbours do
    /// not bound all around ends where the scan does, if sites are to keep to it.
    pub(super) fn restricted_cell(
        &mut self,
        fit: &Fit,
        scan: &Scan,
        options: &Options,
    ) -> Option<Moments> {
        self.look_near();
        let Scratch {
            cell, neighbors, ..
        } = &mut *self.scratch;
        let within = 0.5 * NEAR * self.spacing;
        // Long edges of a bent patch would be cut twice, and missed.
        let is_nearly_flat = fit.patch.most_bend(2.0 * within) <= NEARLY_FLAT * self.spacing;
        if is_nearly_flat && cell.clip_within(&fit.patch, self.place, within, neighbors) {
            return cell.moments(&fit.patch, self.place);
        }
        let domain = [DOMAIN_RADIUS * self.spacing; DOMAIN_SIDES];
        self.clip(fit, &domain);
        if self.scratch.cell.security_squared() > (NEAR * self.spacing).powi(2) {
            self.look_as_far_as(FAR * self.spacing);
            self.clip(fit, &domain);
        }
        if !self.scratch.cell.is_closed() && options.restriction == Restriction::Local {
            let within = &mut self.scratch.samples.within;
            let scanned = fit.scanned(self.place, scan, options, within);
            self.clip(fit, &scanned);
        }
        self.scratch.cell.moments(&fit.patch, self.place)
    }

    fn clip(&mut self, fit: &Fit, reach: &Reach) {
        let Scratch {
            cell, neighbors, ..
        } = &mut *self.scratch;
        cell.clip(&fit.patch, self.place, reach, neighbors);
    }

    fn look_near(&mut self) {
        let radius_squared = (NEAR * self.spacing).powi(2);
        let Scratch {
            neighbors, around, ..
        } = &mut *self.scratch;
        neighbors.clear();
        for &(index, position) in &*around {
            neighbors.extend(neighbor(
                self.place,
                self.site,
                radius_squared,
                index,
                position,
            ));
        }
        sort(neighbors);
    }

    fn look_as_far_as(&mut self, radius: f64) {
        self.neighborhoods
            .gather(self.place, self.site, radius, &mut self.scratch.neighbors);
    }

    /// As near to `target` as the site can go and keep clear of every neighbour's
    /// bisector by half the clearance. If all sites do, none come nearer to each
    /// other than it.
    pub(super) fn keeping_clear(&self, target: Local) -> Local {
        let mut step = target - self.place;
        // Farther neighbours than are known here must not come near either.
        let longest = 0.5 * (NEAR * self.spacing - self.clearance);
        if step.norm_squared() > longest * longest {
            step *= longest / step.norm();
        }
        // What leads too near to a neighbour is taken off the step, not the step
        // off the site; where two are in the way it is shortened.
        let neighbors = || {
            let apart = |n: &&Neighbor| n.distance_squared > 0.0;
            self.scratch.neighbors.iter().filter(apart).map(|neighbor| {
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
    fn room(&self, distance: f64) -> f64 {
        0.5 * (distance - self.clearance).max(0.0)
    }

    /// Distance to the nearest other site, if one lies within `radius`.
    pub(super) fn nearest_within(&mut self, radius: f64) -> Option<f64> {
        if self.scratch.neighbors.is_empty() {
            self.look_near();
        }
        if self.scratch.neighbors.is_empty() {
            self.look_as_far_as(radius);
        }
        self.scratch.nearest()
    }
}
