//! One Lloyd step of one site: its patch, its neighbours, its cell.

use std::ops::Range;

use super::{
    Options, Restriction, Scan, SeedRule,
    acceleration::{LINKS, linked},
    neighborhoods::{NEAR, Neighborhoods, sort},
};
use crate::geometry::{
    Cell, DOMAIN_SIDES, Local, Moments, Neighbor, Patch, PatchKind, Reach, domain_corners,
};

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
#[derive(Clone, Debug)]
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
    /// How far the scan reaches around the anchor on the patch, once it was asked.
    scanned: Option<Box<Reach>>,
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
        &mut self,
        site: Local,
        scan: &Scan,
        options: &Options,
        samples: &mut Vec<Local>,
    ) -> Reach {
        let Self {
            patch,
            anchor,
            scanned,
            ..
        } = self;
        let from_anchor = scanned.get_or_insert_with(|| {
            scan.samples().gather(*anchor, options.fit_radius, samples);
            Box::new(reach_of(samples, patch, *anchor, options.spacing))
        });
        // A sample stands for what is around it.
        let margin = (0.5 * self.input_spacing).max(0.42 * options.spacing);
        let way = site - *anchor;
        let [u, v] = [0, 1].map(|axis| patch.axes[axis].dot(&way));
        let mut reach = **from_anchor;
        for (reach, [cos, sin]) in reach.iter_mut().zip(domain_corners()) {
            let left = (*reach - u * cos - v * sin).max(0.0);
            *reach = (left + margin).min(DOMAIN_RADIUS * options.spacing);
        }
        reach
    }

    /// Whether the patch describes its neighbourhood well enough to move by.
    pub(super) fn is_trusted(&self) -> bool {
        self.trust > 0.0
    }
}

/// How far those of `samples` that lie on `patch` reach around `place`.
fn reach_of(samples: &[Local], patch: &Patch, place: Local, spacing: f64) -> Reach {
    let mut reach = [0.0_f64; DOMAIN_SIDES];
    let [u, v, _] = patch.coordinates(place);
    for &sample in samples {
        let [s, t, height] = patch.coordinates(sample);
        if (height - patch.height(s, t)).abs() > THICKNESS * spacing {
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
    reach
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
            scanned: None,
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

/// A patch is nearly flat if over the longest edge of a cell it leaves its chord by
/// no more than a quarter of this, in spacings.
const NEARLY_FLAT: f64 = 0.1;

/// A ball of so many spacings holds whatever can cut any cell.
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
    /// Strays around the block …
    strays: Vec<u32>,
    /// … and all sites whatever can cut a cell of it, once they were looked for.
    around: Vec<u32>,
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
            around: Vec::new(),
        }
    }

    /// Makes ready for the sites of `block`.
    pub(super) fn begin(&mut self, neighborhoods: &Neighborhoods, block: &Range<usize>) {
        self.has_samples = false;
        self.around.clear();
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
    pub(super) scratch: &'a mut Scratch,
}

impl Around<'_> {
    /// Looks up the samples around the whole block, for all its patches to come.
    pub(super) fn look_for_samples(&mut self, scan: &Scan, options: &Options) {
        if !self.scratch.has_samples {
            let places = &self.neighborhoods.places()[self.block.clone()];
            let [low, high] = bounds(places.iter().copied());
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
        fit: &mut Fit,
        scan: &Scan,
        options: &Options,
    ) -> Option<Moments> {
        let is_closed = !self.was_open && self.closed_cell(fit);
        if !is_closed {
            self.open_cell(fit, scan, options);
        }
        self.scratch.cell.moments(&fit.patch, self.place)
    }

    /// The cell, if near neighbours bound it all around; whether they do.
    fn closed_cell(&mut self, fit: &Fit) -> bool {
        self.look_near();
        let Scratch {
            cell,
            ring,
            neighbors,
            ..
        } = &mut *self.scratch;
        let radius = 0.5 * NEAR * self.spacing;
        ring.clear();
        ring.extend(linked(&self.links).map(|link| self.neighborhoods.neighbor(self.site, link)));
        if cell.close(&fit.patch, self.place, radius, ring, neighbors) {
            return true;
        }
        sort(neighbors);
        // Long edges of a bent patch would be cut twice, and missed.
        if fit.patch.most_bend(2.0 * radius) <= NEARLY_FLAT * self.spacing {
            return cell.clip_within(&fit.patch, self.place, radius, neighbors);
        }
        self.clip(fit, &self.domain());
        self.scratch.cell.security_squared() <= (NEAR * self.spacing).powi(2)
    }

    /// The cell, whatever bounds it.
    fn open_cell(&mut self, fit: &mut Fit, scan: &Scan, options: &Options) {
        self.look_far();
        sort(&mut self.scratch.neighbors);
        self.clip(fit, &self.domain());
        if !self.scratch.cell.is_closed() && options.restriction == Restriction::Local {
            let samples = &mut self.scratch.samples.within;
            let scanned = fit.scanned(self.place, scan, options, samples);
            self.clip(fit, &scanned);
        }
    }

    fn domain(&self) -> Reach {
        [DOMAIN_RADIUS * self.spacing; DOMAIN_SIDES]
    }

    fn clip(&mut self, fit: &Fit, reach: &Reach) {
        let Scratch {
            cell, neighbors, ..
        } = &mut *self.scratch;
        cell.clip(&fit.patch, self.place, reach, neighbors);
    }

    fn look_near(&mut self) {
        let Scratch {
            strays, neighbors, ..
        } = &mut *self.scratch;
        if !self.neighborhoods.near(self.site, strays, neighbors) {
            self.look_far();
            let near = (NEAR * self.spacing).powi(2);
            let neighbors = &mut self.scratch.neighbors;
            neighbors.retain(|neighbor| neighbor.distance_squared <= near);
        }
    }

    fn look_far(&mut self) {
        let radius = FAR * self.spacing;
        let Scratch {
            around, neighbors, ..
        } = &mut *self.scratch;
        if around.is_empty() {
            self.neighborhoods.look_around(&self.block, radius, around);
        }
        self.neighborhoods
            .within(self.site, radius, around.iter(), neighbors);
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
        sort(in_the_way);
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
    fn room(&self, distance: f64) -> f64 {
        0.5 * (distance - self.clearance).max(0.0)
    }

    /// Distance to the nearest other site, if one lies within `radius`.
    pub(super) fn nearest_within(&mut self, radius: f64) -> Option<f64> {
        if self.scratch.neighbors.is_empty() {
            self.look_near();
        }
        if self.scratch.neighbors.is_empty() {
            let Scratch {
                around, neighbors, ..
            } = &mut *self.scratch;
            let own = self.site..self.site + 1;
            self.neighborhoods.look_around(&own, radius, around);
            self.neighborhoods
                .within(self.site, radius, around.iter(), neighbors);
            // The next site of the block has other ones around.
            around.clear();
        }
        self.scratch.nearest()
    }
}
