//! What becomes of the sites next to a sharp edge.

use serde::{Deserialize, Serialize};

/// Where sites next to a sharp edge end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum EdgeRule {
    /// On the fitted patches, which round an edge a little.
    #[default]
    Smooth,
    /// On the planes that meet there, where planes describe the scan better than a patch does.
    Sharp,
    /// As with `Sharp`, and those next to the edge on the edge itself, as far apart as the output is elsewhere, so that a mesh keeps it.
    On,
}

/// Sites nearer to an edge than this are moved onto it where there is room. Of sites as dense as the hexagonal lattice one lies
/// within 0.433 spacings of a line for each spacing of its length; but where the lattice has its rows at right angles to the
/// line, every other one of them can be half a spacing away.
const CAPTURE_IN_SPACINGS: f64 = 0.7;

impl EdgeRule {
    /// Whether this is the default, which records do not state.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Distance (CRS units) from an edge within which sites are moved onto it, at a `spacing`; `None` if patches may round
    /// edges.
    pub(super) fn capture(self, spacing: f64) -> Option<f64> {
        match self {
            Self::Smooth => None,
            Self::Sharp => Some(0.0),
            Self::On => Some(CAPTURE_IN_SPACINGS * spacing),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Dice, Local, Quantization, Stored},
        lloyd::{Scan, SolverOptions, TileRegion, solve},
    };

    /// The gaps (spacings) between the sites that end on the edge of a step that is 20 spacings long, turned by `angle` (degrees) about the
    /// vertical, in their order; away from the ends of the edge.
    fn gaps_on_a_step(angle: f64) -> Vec<f64> {
        let spacing = 0.1;
        let quantization = Quantization {
            scale: 1e-6,
            offset: [0.0; 3],
        };
        let options = SolverOptions {
            edge_capture: EdgeRule::On.capture(spacing),
            ..SolverOptions::new(spacing)
        };
        let mut dice = Dice(7);
        let (sin, cos) = angle.to_radians().sin_cos();
        let points: Vec<Stored> = (0..40_000)
            .filter_map(|k| {
                let [away, along, noise] = [0.8, 2.0, 0.004].map(|length| length * dice.roll());
                let (across, z) = match k % 2 {
                    0 => (-away, noise),
                    _ => (noise, -away),
                };
                let place = Local::new(cos * across - sin * along, sin * across + cos * along, z);
                quantization.stored(place)
            })
            .collect();
        let scan = Scan::new(points, quantization, &options);
        let solution = solve(&scan, &TileRegion::everything(), &options);
        let mut along: Vec<f64> = solution
            .sites
            .iter()
            .map(|site| site.position)
            .filter(|p| (cos * p.x + sin * p.y).hypot(p.z) < 0.05 * spacing)
            .map(|p| cos * p.y - sin * p.x)
            .filter(|along| (0.2..1.8).contains(along))
            .collect();
        along.sort_by(f64::total_cmp);
        along.windows(2).map(|w| (w[1] - w[0]) / spacing).collect()
    }

    #[test]
    fn sites_stand_in_a_row_on_a_sharp_edge() {
        // At 0° the rows of the lattice stand at right angles to the edge, and every other one stays beside it.
        let gaps: Vec<f64> = [0.0, 10.0, 20.0, 30.0, 45.0]
            .into_iter()
            .flat_map(gaps_on_a_step)
            .collect();
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        let wide = gaps.iter().filter(|&&gap| gap > 1.4).count();
        assert!(mean < 1.15, "{mean} {gaps:.2?}");
        assert!(gaps.iter().all(|&gap| gap > 0.6), "{gaps:.2?}");
        assert!(10 * wide < 2 * gaps.len(), "{wide} {gaps:.2?}");
    }
}
