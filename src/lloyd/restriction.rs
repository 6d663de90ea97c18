//! The boundary restriction: no site drifts away from what was scanned.
//!
//! Paper, section IV-E: a site that would end farther from the scan than a
//! threshold stands still for this iteration. That keeps the sites of a border
//! on it without any detection of borders, and closes gaps narrower than the
//! threshold.
//!
//! The paper's threshold is one number for the cloud, 0.5 to 1.5 times the
//! mean distance between neighbouring points. Density varies a hundredfold in
//! mobile mapping, so ours is local by default: the paper's own "promising
//! solution".

use serde::{Deserialize, Serialize};

/// How far from the scan a site may go.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restriction {
    /// As far as the spacing of the scan around the site.
    Local,
    /// This far (CRS units), everywhere: the paper's.
    Global(f64),
    /// Anywhere: what the paper's Fig. 7 (b) shows.
    None,
}

/// The finest threshold, in spacings of the output. Where the scan is much
/// denser than the output, a patch may well pass this far from the nearest
/// point (noise, curvature) and be right.
const FLOOR: f64 = 0.1;

impl Restriction {
    /// The threshold (CRS units) at a site whose neighbourhood was scanned at
    /// `input_spacing`, for an output at `spacing`.
    pub(crate) fn threshold(&self, input_spacing: f64, spacing: f64) -> f64 {
        match *self {
            Self::Local => input_spacing.clamp(FLOOR * spacing, spacing),
            Self::Global(threshold) => threshold,
            Self::None => f64::INFINITY,
        }
    }
}
