//! From sites to figures of uniformity.

use super::site::Site;
use crate::quality::{CellFigures, UniformityTally};

/// The tallies of the `sites` on surfaces and of the others, for an output at `spacing` (CRS units), the coarsest one if it
/// varies.
pub(crate) fn uniformity_by_surface<'a>(
    sites: impl IntoIterator<Item = &'a Site>,
    spacing: f64,
) -> [UniformityTally; 2] {
    let (on_surfaces, elsewhere): (Vec<&Site>, Vec<&Site>) =
        sites.into_iter().partition(|site| site.is_on_surface());
    [on_surfaces, elsewhere].map(|sites| uniformity(sites, spacing))
}

/// Tallies the nearest distances of `sites`, and the closed cells of those that are not fixed,
/// for an output at `spacing` (CRS units). Where the spacing varies, figures are those of sites that are scaled to the
/// coarsest spacing, each by its own: distances over the spacing there, areas over its square, energies over its fourth power.
pub fn uniformity<'a>(sites: impl IntoIterator<Item = &'a Site>, spacing: f64) -> UniformityTally {
    let mut tally = UniformityTally::new(spacing);
    for site in sites {
        // Equal spacings give 1 to the bit.
        let scale = spacing / site.spacing;
        if site.nearest.is_finite() {
            tally.push_distance(scale * site.nearest);
        } else {
            tally.push_alone();
        }
        if let Some(area) = site.bounded_area() {
            tally.push_cell(CellFigures {
                area: scale.powi(2) * area,
                energy: scale.powi(4) * site.energy,
                neighbors: site.neighbors,
            });
        }
    }
    tally
}
