//! The boundary restriction: no site drifts away from the scan.
//!
//! Paper, section IV-E: a site that would end farther from the scan than a threshold stands
//! still for this iteration. That keeps the sites of a border on it without any detection of
//! borders, and closes gaps narrower than the threshold.
//!
//! The paper's threshold is one number for the cloud, 0.5 to 1.5 times the mean distance
//! between neighbouring points. Density varies a hundredfold in mobile mapping, so ours is
//! local by default: the paper's own "promising solution". With it no site stands beyond a border, either:
//! see [`scan_border`](super::scan_border).

use serde::{Deserialize, Serialize};

/// How far from the scan a site may move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restriction {
    /// A site may move as far from the scan as the scan's spacing around it, but not beyond a border.
    Local,
    /// A site may move this far from the scan (CRS units), everywhere: the paper's rule.
    Global(f64),
    /// A site may move anywhere: the paper's Fig. 7 (b).
    None,
}

/// The smallest local threshold. Where the scan is much denser than the output, noise and
/// curvature leave a right patch this far from the nearest point.
const FLOOR_IN_SPACINGS: f64 = 0.1;

/// The largest local threshold. A border is told by a ball that is wider than the threshold by four fifths, and has to fit into
/// the neighbourhood of a fit. Where the scan is sparser than the output its holes are filled, and what is filled ends at a
/// border, too: with a threshold of a spacing the sites of a small filled part spread beyond it. On the scan of a simulated
/// tripod, 100 K points without isolated returns, δ was 0.076 with a threshold of a spacing, and is 0.068 with this one.
const CEILING_IN_SPACINGS: f64 = 0.6;

impl Restriction {
    /// The threshold (CRS units) at a site around which the scan has the spacing
    /// `input_spacing`, for an output at `spacing`.
    pub(super) fn threshold(self, input_spacing: f64, spacing: f64) -> f64 {
        match self {
            Self::Local => {
                let [floor, ceiling] = [FLOOR_IN_SPACINGS, CEILING_IN_SPACINGS];
                input_spacing.clamp(floor * spacing, ceiling * spacing)
            }
            Self::Global(threshold) => threshold,
            Self::None => f64::INFINITY,
        }
    }
}
