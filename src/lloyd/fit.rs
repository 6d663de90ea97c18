//! III-B: the patch of a site, and what the fit saw.

use super::{Scan, SolverOptions};
use crate::geometry::{BOUNDING_SIDES, Local, Patch, PatchKind, Reach, bounding_corners};

/// Radius of a cell's domain, in spacings. Seeds cover surfaces at 0.745
/// spacings, so no cell inside one reaches it.
pub(super) const DOMAIN_RADIUS: f64 = 1.0;

/// A patch stays in use until its site has moved this far from where it was
/// fitted, in spacings: the fit's weights fall off over 1.2.
const PATCH_SKIN: f64 = 0.1;

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
    /// domain. What `samples` looked at last is lost.
    pub(super) fn scanned(
        &mut self,
        site: Local,
        scan: &Scan,
        options: &SolverOptions,
        samples: &mut Samples,
    ) -> Reach {
        let Self {
            patch,
            anchor,
            scanned,
            ..
        } = self;
        let from_anchor = scanned.get_or_insert_with(|| {
            let within = &mut samples.within;
            scan.samples().gather(*anchor, options.fit_radius, within);
            Box::new(reach_of(within, patch, *anchor, options.spacing))
        });
        // A sample stands for what is around it.
        let margin = (0.5 * self.input_spacing).max(0.42 * options.spacing);
        let way = site - *anchor;
        let [u, v] = [0, 1].map(|axis| patch.axes[axis].dot(&way));
        let mut reach = **from_anchor;
        for (reach, [cos, sin]) in reach.iter_mut().zip(bounding_corners()) {
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
    let mut reach = [0.0_f64; BOUNDING_SIDES];
    let [u, v, _] = patch.coordinates(place);
    for &sample in samples {
        let [s, t, height] = patch.coordinates(sample);
        if (height - patch.height(s, t)).abs() > THICKNESS * spacing {
            continue;
        }
        let way = [s - u, t - v];
        let distance = way[0].hypot(way[1]);
        for (reach, corner) in reach.iter_mut().zip(bounding_corners()) {
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

/// The samples in and around a box, for the patches of the places in it.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// Each with the number of points that it stands for.
    around: Vec<(Local, u32)>,
    /// Scratch: those of one patch.
    within: Vec<Local>,
}

impl Samples {
    /// DisplayAttributes up what the patches of places from `low` to `high` may need.
    pub(super) fn look(&mut self, scan: &Scan, low: Local, high: Local, options: &SolverOptions) {
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
    pub(super) fn fit(&mut self, site: Local, options: &SolverOptions) -> Option<Fit> {
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
fn sharper(
    patch: &Patch,
    site: Local,
    samples: &[Local],
    options: &SolverOptions,
) -> Option<Patch> {
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
pub(super) fn is_allowed(
    scan: &Scan,
    fit: &mut Fit,
    place: Local,
    options: &SolverOptions,
) -> bool {
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
