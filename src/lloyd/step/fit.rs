//! III-B: the patch of a site, and what the fit knows of the scan around it.

use serde::{Deserialize, Serialize};

use super::{
    samples::Samples,
    scan_border::{ScanBorder, Standing},
};
use crate::{
    geometry::{
        BOUNDING_SIDES, Facets, Local, Patch, PatchKind, Reach, SharpEdge, bounding_corners,
        upwards,
    },
    lloyd::{SolverOptions, surface::Surface},
};

/// Radius of the polygon that a cell is clipped from. Seeds cover surfaces at 0.8 spacings,
/// so no cell inside one reaches it.
pub(super) const BOUNDING_RADIUS_IN_SPACINGS: f64 = 1.0;

/// A patch stays in use until its site has moved this far from where it was fitted: the fit's
/// weights fall off over 1.2 spacings.
const PATCH_SKIN_IN_SPACINGS: f64 = 0.1;

/// Farthest from a patch that a sample of its surface lies.
pub(crate) const SHEET_THICKNESS_IN_SPACINGS: f64 = 0.25;

/// A sample lies towards a corner of the bounding polygon if the cosine between the two
/// directions is at least this: an angle of up to 26°.
const CORNER_COSINE: f64 = 0.9;

/// A sample stands for the surface this far around it, at least.
const SAMPLE_REACH_IN_SPACINGS: f64 = 0.42;

/// With a larger residual a patch is fitted again, by the weights of the samples.
const NOISE_IN_SPACINGS: f64 = 0.01;

/// A patch with a larger residual is near an edge.
const SHARP_IN_SPACINGS: f64 = 0.02;
/// A wide patch with a larger residual than the patch in use, by this factor, misses detail.
const LARGEST_RESIDUAL_OF_WIDE: f64 = 1.5;
/// Longest way to a corrected patch. What is farther off is not noise, and no site comes nearer to another by more than this.
const LONGEST_WAY_TO_CORRECTION_IN_SPACINGS: f64 = 0.1;
/// Facets are sought around a patch with a larger residual. With [`SHARP_IN_SPACINGS`] the search was done 1.14 times as often,
/// and points at the edges of a simulated street were nearer to the truth by 0.00002 spacings.
const FACETED_IN_SPACINGS: f64 = 0.025;
/// The share of the usual distance from an edge within which sites are moved onto it when all iterations are done: most
/// of those that belong there are there, and others would leave a gap.
const LATE_CAPTURE: f64 = 0.15;
/// A site goes onto an edge if it is nowhere nearer to others there than this. With 0.85 a quarter of the gaps in the rows on the
/// edges of a simulated street were wider than 1.4 spacings, with this a sixth.
const LEAST_GAP_ON_EDGE_IN_SPACINGS: f64 = 0.75;
/// The excess of the residual at which the fit radius is reduced the most.
const SHARPEST_EXCESS_IN_SPACINGS: f64 = 0.06;
/// Largest share by which the fit radius is reduced near an edge, so as not to round it.
const LARGEST_REDUCTION: f64 = 0.15;
/// Fewest samples of a fit with a reduced radius.
const REDUCED_SUPPORT: u32 = 12;
/// A fit with a reduced radius is taken if its residual is smaller by this factor.
const REDUCED_RESIDUAL: f64 = 0.9;

/// A patch, and what the fit knows of the scan around it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Fit {
    pub(crate) patch: Patch,
    /// The position of the site when the patch was fitted.
    anchor: Local,
    /// The border of the scan near the site.
    border: ScanBorder,
    /// The share of a step that the patch is trusted for: 0 for none.
    pub(crate) trust: f64,
    /// How far the scan reaches around the anchor on the patch; computed on demand.
    #[serde(skip)]
    scanned: Option<Box<Reach>>,
    /// The facets that stand in for the patch near an edge; sought on demand.
    facets: Option<Option<Box<Facets>>>,
}

impl Fit {
    /// Fits the patch at `site`, a position in the box of `samples`; `None` where the scan has
    /// no surface.
    pub(crate) fn new(site: Local, samples: &mut Samples, options: &SolverOptions) -> Option<Self> {
        Self::if_trusted(site, samples, options, |_| true)
    }

    /// Fits the patch at `site`, a position in the box of `samples`; `None` where the scan has
    /// no surface, or none that the patch describes well enough to move by.
    pub(crate) fn trusted(
        site: Local,
        samples: &mut Samples,
        options: &SolverOptions,
    ) -> Option<Self> {
        Self::if_trusted(site, samples, options, |trust| trust > 0.0)
    }

    /// Fits the patch at `site`; `None` where the scan has no surface, or one that is trusted
    /// for a share that is not `enough`.
    fn if_trusted(
        site: Local,
        samples: &mut Samples,
        options: &SolverOptions,
        enough: impl Fn(f64) -> bool,
    ) -> Option<Self> {
        let radius = options.fit_radius;
        let (near, weights, points) = samples.in_ball(site, radius);
        let patch = Patch::fit(site, near, radius, options.patch)?;
        // A sharper patch finds a surface in leaves, too.
        let trust = patch.trust(radius.max(options.spacing));
        let input_spacing = radius * (std::f64::consts::PI / points as f64).sqrt();
        enough(trust).then(|| Self {
            patch: better(&patch, trust, site, near, weights, options),
            anchor: site,
            border: ScanBorder::new(site, near, input_spacing, radius),
            trust,
            scanned: None,
            facets: None,
        })
    }

    /// Whether the patch still stands for the surface at `site`.
    pub(super) fn is_valid_at(&self, site: Local, spacing: f64) -> bool {
        let skin = PATCH_SKIN_IN_SPACINGS * spacing;
        (site - self.anchor).norm_squared() <= skin * skin
    }

    /// Seeks the facets that stand in for the patch where it rounds an edge, if the options want any.
    pub(super) fn find_facets(&mut self, surface: Surface<'_>, samples: &mut Samples) {
        if self.facets.is_none() {
            self.facets = Some(self.facets_around(self.anchor, surface, samples));
        }
    }

    /// The facets around `position` that explain more than the patch. Sites are moved onto their edges from within the distance that is usual
    /// when all iterations are done.
    fn facets_around(
        &self,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Option<Box<Facets>> {
        let options = surface.options;
        let is_rounded = self.patch.residual > FACETED_IN_SPACINGS * options.spacing
            && options.patch == PatchKind::Quadratic;
        let capture = LATE_CAPTURE * options.edge_capture.filter(|_| is_rounded)?;
        let samples = samples.of_facets(position, surface);
        Facets::find(position, samples, &self.patch, options.fit_radius, capture).map(Box::new)
    }

    /// The sharp edge nearest to `position`, if it is nearer than `reach` (CRS units).
    pub(crate) fn edge_near(
        &self,
        position: Local,
        reach: f64,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Option<SharpEdge> {
        let facets = self.facets_around(position, surface, samples)?;
        facets.edge_near(position, reach)
    }

    /// Corrects the patch of a site whose iterations are done, and that stands at `position`, by its wide neighbourhood; gives where on
    /// the patch the site stands then.
    pub(super) fn correct(
        &mut self,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Local {
        let Some(patch) = self.corrected_patch(position, surface, samples) else {
            return position;
        };
        let foot = patch.foot_point(position);
        let longest = LONGEST_WAY_TO_CORRECTION_IN_SPACINGS * surface.spacing();
        if (foot - position).norm() > longest {
            return position;
        }
        self.patch = patch;
        self.keep_at(foot);
        foot
    }

    /// The patch in use, corrected by the wide neighbourhood of `position`; `None` where that has detail that a wide patch misses. Where
    /// the patch is doubtful, the wide one may leave no more unexplained than it does: noise is the same everywhere, leaves and edges are not.
    fn corrected_patch(
        &self,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Option<Patch> {
        let options = surface.options;
        if options.patch != PatchKind::Quadratic {
            return None;
        }
        let factor = match self.trust < 1.0 {
            true => 1.0,
            false => LARGEST_RESIDUAL_OF_WIDE,
        };
        let most = factor * self.patch.residual;
        let (samples, weights) = samples.in_wide_ball(position, surface);
        self.patch
            .corrected(position, samples, weights, options.fit_radius, most)
    }

    /// Seeks the facets anew around `position`, and gives its foot point on them; `None` if there are none.
    pub(super) fn foot_point_on_facets(
        &mut self,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Option<Local> {
        self.facets = Some(self.facets_around(position, surface, samples));
        Some(self.facets()?.foot_point(position))
    }

    /// Keeps patch and facets for a site that stands at `position` for good.
    pub(super) fn keep_at(&mut self, position: Local) {
        self.anchor = position;
        self.scanned = None;
    }

    /// Whether the site at `position` goes onto an edge of its facets: one of the linked `others` may come first.
    pub(super) fn claims_edge(
        &mut self,
        position: Local,
        others: impl Iterator<Item = Local>,
        surface: Surface<'_>,
    ) -> bool {
        let (Some(Some(facets)), Some(reach)) =
            (self.facets.as_mut(), surface.options.edge_capture)
        else {
            return false;
        };
        let gap = LEAST_GAP_ON_EDGE_IN_SPACINGS * surface.spacing();
        facets.claim_edge(position, others, reach, gap)
    }

    /// The facets that stand in for the patch, if any were found.
    fn facets(&self) -> Option<&Facets> {
        self.facets.as_ref()?.as_deref()
    }

    /// The unit normal of the surface at `position`, which points upwards, and the mean curvature of the patch (1 / CRS
    /// unit), positive where it bends towards the normal of the patch.
    pub(crate) fn upwards(&self, position: Local) -> (Local, f64) {
        let (normal, curvature) = self.patch.upwards();
        let of_facet = self.facets().and_then(|facets| facets.normal(position));
        (of_facet.map_or(normal, upwards), curvature)
    }

    /// The foot point of `position` on the surface: on the patch, or near an edge on a facet.
    pub(crate) fn foot_point(&self, position: Local) -> Local {
        let foot = self.patch.foot_point(position);
        self.facets().map_or(foot, |facets| facets.foot_point(foot))
    }

    /// The move from `position` towards `centroid` on the surface: the less the patch is
    /// trusted, the shorter.
    pub(super) fn step_towards(&self, centroid: Local, position: Local) -> Local {
        // To a facet the site goes all the way.
        let start = self
            .facets()
            .map_or(position, |facets| facets.foot_point(position));
        (start - position) + (self.foot_point(centroid) - start) * self.trust
    }

    /// How far the scan reaches around `site` on the patch, at most as far as the bounding
    /// polygon (CRS units). The ball of `samples` is lost.
    pub(super) fn scanned_reach(
        &mut self,
        site: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Reach {
        let spacing = surface.spacing();
        let Self {
            patch,
            anchor,
            border,
            scanned,
            ..
        } = self;
        let from_anchor = scanned.get_or_insert_with(|| {
            // By the spacing there, so that it does not matter when it is computed, and again in another round.
            let mut place = None;
            let there = surface.at(surface.field().at(*anchor), &mut place);
            let within = samples.in_fit_radius(*anchor, there);
            Box::new(reach_of(within, patch, *anchor, there.spacing()))
        });
        let margin = (0.5 * border.input_spacing).max(SAMPLE_REACH_IN_SPACINGS * spacing);
        let way = site - *anchor;
        let [u, v] = [0, 1].map(|axis| patch.axes[axis].dot(&way));
        let mut reach = **from_anchor;
        for (reach, [cos, sin]) in reach.iter_mut().zip(bounding_corners()) {
            let left = (*reach - u * cos - v * sin).max(0.0);
            *reach = (left + margin).min(BOUNDING_RADIUS_IN_SPACINGS * spacing);
        }
        reach
    }

    /// How far the scan reaches around `position` on the patch, in the direction in which it reaches the least (CRS units). The
    /// ball of `samples` is lost.
    pub(crate) fn least_reach(
        &self,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> f64 {
        let (near, _, _) = samples.in_ball(self.anchor, surface.options.fit_radius);
        let reach = reach_of(near, &self.patch, position, surface.spacing());
        reach.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Whether the boundary restriction (paper, section IV-E) lets the site be at `position`.
    pub(crate) fn allows(&mut self, position: Local, surface: Surface<'_>) -> bool {
        self.place(position, surface) == Standing::OnScan
    }

    /// Whether `position` is no farther from the scan than the threshold of the boundary restriction, be it beyond a border.
    pub(crate) fn is_within_threshold(&mut self, position: Local, surface: Surface<'_>) -> bool {
        self.border.is_within_threshold(position, surface)
    }

    /// Where `position` is, as the boundary restriction sees it.
    pub(super) fn place(&mut self, position: Local, surface: Surface<'_>) -> Standing {
        self.border.place(position, surface)
    }
}

/// How far the `samples` that lie on `patch` reach around `position`, towards each corner of
/// the bounding polygon (CRS units).
fn reach_of(samples: &[Local], patch: &Patch, position: Local, spacing: f64) -> Reach {
    let mut reach = [0.0_f64; BOUNDING_SIDES];
    let [u, v, _] = patch.coordinates(position);
    for &sample in samples {
        let [s, t, height] = patch.coordinates(sample);
        if (height - patch.height(s, t)).abs() > SHEET_THICKNESS_IN_SPACINGS * spacing {
            continue;
        }
        let way = [s - u, t - v];
        let distance = way[0].hypot(way[1]);
        for (reach, corner) in reach.iter_mut().zip(bounding_corners()) {
            let along = way[0] * corner[0] + way[1] * corner[1];
            if along >= CORNER_COSINE * distance {
                *reach = reach.max(along);
            }
        }
    }
    reach
}

/// The patch that stands in for `patch`, which is trusted for the share `trust`. On a surface the
/// `samples` have their `weights`. Elsewhere those with few points count as much: what the patch
/// leaves unexplained there is no noise.
fn better(
    patch: &Patch,
    trust: f64,
    site: Local,
    samples: &[Local],
    weights: &[f64],
    options: &SolverOptions,
) -> Patch {
    let weights = if trust < 1.0 { &[] } else { weights };
    let has_noise = !weights.is_empty() && patch.residual > NOISE_IN_SPACINGS * options.spacing;
    let weighted = has_noise
        .then(|| Patch::fit_weighted(site, samples, weights, options.fit_radius, options.patch));
    let patch = weighted.flatten().unwrap_or(*patch);
    sharper(&patch, site, samples, weights, options).unwrap_or(patch)
}

/// The patch of a smaller radius, where `patch` rounds an edge and the smaller one explains
/// more.
fn sharper(
    patch: &Patch,
    site: Local,
    samples: &[Local],
    weights: &[f64],
    options: &SolverOptions,
) -> Option<Patch> {
    let excess = patch.residual / options.spacing - SHARP_IN_SPACINGS;
    if excess <= 0.0 || options.patch == PatchKind::Plane {
        return None;
    }
    let share = 1.0 - LARGEST_REDUCTION * (excess / SHARPEST_EXCESS_IN_SPACINGS).min(1.0);
    let radius = options.fit_radius * share;
    Patch::fit_weighted(site, samples, weights, radius, options.patch).filter(|sharper| {
        sharper.support >= REDUCED_SUPPORT && sharper.residual < REDUCED_RESIDUAL * patch.residual
    })
}
