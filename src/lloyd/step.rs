//! One Lloyd step of one site: its patch, its neighbours, its cell.

use crate::geometry::{Cell, Local, Moments, Neighbor, NeighborGrid, Patch};

use super::{Options, Scan};

/// Radius of a cell's domain, in spacings. Seeds cover the scan at 0.77
/// spacings, so no cell inside a surface reaches it.
pub(super) const DOMAIN_RADIUS: f64 = 1.0;

/// A patch stays in use until its site has moved this far from where it was
/// fitted, in spacings: the fit's weights fall off over 1.2.
const PATCH_SKIN: f64 = 0.1;

/// A worse residual than this share of a spacing, and the patch does not
/// describe its neighbourhood: leaves, clutter, two sheets.
const WORST_RESIDUAL: f64 = 0.15;

/// A rounder neighbourhood than this has a surface; a narrower is a wire.
const LEAST_ROUNDNESS: f64 = 0.2;

/// A patch and what the fit saw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) patch: Patch,
    /// Where the site was when the patch was fitted.
    anchor: Local,
    /// Spacing of the scan around it (CRS units).
    pub(super) input_spacing: f64,
}

impl Fit {
    /// Whether the patch still stands for the surface at `site`.
    pub(super) fn serves(&self, site: Local, spacing: f64) -> bool {
        let skin = PATCH_SKIN * spacing;
        (site - self.anchor).norm_squared() <= skin * skin
    }

    /// Whether the patch describes its neighbourhood well enough to move by.
    pub(super) fn is_trusted(&self, options: &Options) -> bool {
        self.patch.residual <= WORST_RESIDUAL * options.fit_radius.max(options.spacing)
            && self.patch.roundness >= LEAST_ROUNDNESS
    }
}

/// Fits the patch at `site`; `None` where the scan does not carry one.
/// `samples` is scratch.
pub(super) fn local_patch(
    scan: &Scan,
    site: Local,
    options: &Options,
    samples: &mut Vec<Local>,
) -> Option<Fit> {
    let radius = options.fit_radius;
    let mut points = 0_u64;
    samples.clear();
    scan.samples().visit_around(site, radius, |index, sample| {
        if (sample - site).norm_squared() < radius * radius {
            samples.push(sample);
            points += u64::from(scan.count(index));
        }
    });
    let patch = Patch::fit(site, samples, radius, options.patch)?;
    Some(Fit {
        patch,
        anchor: site,
        input_spacing: radius * (std::f64::consts::PI / points as f64).sqrt(),
    })
}

/// The sites of one iteration, to be looked up around each.
pub(super) struct Neighborhoods {
    grid: NeighborGrid,
}

impl Neighborhoods {
    /// Sites on a grid of about the `spacing` (CRS units).
    pub(super) fn new(sites: &[Local], spacing: f64) -> Self {
        Self {
            grid: NeighborGrid::new(sites, 1.1 * spacing),
        }
    }

    /// Fills `neighbors` with every other site within `radius` of `site`,
    /// nearest first, equally near ones in the order of their identities.
    pub(super) fn gather(&self, site: Local, radius: f64, neighbors: &mut Vec<Neighbor>) {
        neighbors.clear();
        let radius_squared = radius * radius;
        let mut met_itself = false;
        self.grid.visit_around(site, radius, |index, position| {
            let distance_squared = (position - site).norm_squared();
            if distance_squared == 0.0 && !met_itself {
                met_itself = true;
            } else if distance_squared <= radius_squared {
                neighbors.push(Neighbor {
                    distance_squared,
                    index,
                    position,
                });
            }
        });
        neighbors.sort_unstable_by(|a, b| {
            a.distance_squared
                .total_cmp(&b.distance_squared)
                .then(a.index.cmp(&b.index))
        });
    }
}

/// Clips the cell of `site`, having gathered the neighbours that can matter.
///
/// Returns the cell's moments, if it has any, and the squared radius of the
/// ball that had to be known for them.
pub(super) fn restricted_cell(
    fit: &Fit,
    site: Local,
    options: &Options,
    neighborhoods: &Neighborhoods,
    neighbors: &mut Vec<Neighbor>,
    cell: &mut Cell,
) -> Option<Moments> {
    let radius = DOMAIN_RADIUS * options.spacing;
    // A first ball of 1.6 spacings holds what cuts a good cell; the few that
    // are not sure with it look farther.
    for reach in [1.6, 2.0 * DOMAIN_RADIUS * 1.25] {
        neighborhoods.gather(site, reach * options.spacing, neighbors);
        cell.clip(&fit.patch, site, radius, neighbors);
        if cell.security_squared() <= (reach * options.spacing).powi(2) {
            break;
        }
    }
    cell.moments(&fit.patch, site)
}
