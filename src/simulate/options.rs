//! The options of a simulated street.

use serde::{Deserialize, Serialize};

/// The street to simulate, and how it is scanned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreetOptions {
    /// The length of the street (m).
    pub length: f64,
    /// The number of times that the vehicle drives down the street.
    pub passes: u32,
    /// The number of points of all passes together.
    pub points: u64,
    /// The standard deviation of the ranges (m). No error exceeds three standard deviations.
    pub noise: f64,
    /// The share of the points that are strays, of class 7: rain, echoes, and beams that meet two surfaces.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub strays: f64,
    /// The number of cars and people of which each is there in one pass only. Their points have class 64.
    #[serde(default, skip_serializing_if = "is_none_passing")]
    pub passing: u32,
    /// The seed of the street and of the noise.
    pub seed: u64,
}

impl Default for StreetOptions {
    fn default() -> Self {
        Self {
            length: 120.0,
            passes: 2,
            points: 2_000_000,
            noise: 0.01,
            strays: 0.0,
            passing: 0,
            seed: 1,
        }
    }
}

/// Whether nothing is there in one pass only, which descriptions of streets do not state.
fn is_none_passing(passing: &u32) -> bool {
    *passing == 0
}

/// Whether there are no strays, which descriptions of streets do not state.
fn is_zero(share: &f64) -> bool {
    *share == 0.0
}
