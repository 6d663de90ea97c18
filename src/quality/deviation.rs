//! δ, the deviation of the nearest distances: their standard deviation over their mean.
//!
//! ```text
//!   δ² = (1 / n) Σ (dᵢ / d̄ − 1)² = n Σ dᵢ² / (Σ dᵢ)² − 1
//! ```
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, equation (6). The second form
//! needs three sums only, which can be added part by part.

use serde::{Deserialize, Serialize};

/// δ² of `count` distances with the sum `sum` and the sum of squares `squares`. Rounding can
/// make it slightly negative; it is NaN for no distance.
pub(crate) fn delta_squared(count: f64, sum: f64, squares: f64) -> f64 {
    count * squares / (sum * sum) - 1.0
}

/// δ of `count` distances with the sum `sum` and the sum of squares `squares`; NaN for no
/// distance.
pub(crate) fn delta(count: f64, sum: f64, squares: f64) -> f64 {
    delta_squared(count, sum, squares)
        .clamp(0.0, f64::INFINITY)
        .sqrt()
}

/// The sums over nearest distances that determine δ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct DistanceSums {
    /// Number of distances.
    pub(crate) count: u64,
    /// Sum of the distances (CRS units).
    pub(crate) sum: f64,
    /// Sum of the squared distances (CRS units squared).
    pub(crate) squares: f64,
}

impl DistanceSums {
    /// The sums over `distances` (CRS units), added in their order.
    pub(crate) fn of(distances: impl Iterator<Item = f64>) -> Self {
        let mut sums = Self::default();
        distances.for_each(|distance| sums.push(distance));
        sums
    }

    /// Adds one distance (CRS units).
    pub(crate) fn push(&mut self, distance: f64) {
        self.count += 1;
        self.sum += distance;
        self.squares += distance * distance;
    }

    /// Adds the sums of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// δ of the distances; NaN without any.
    pub(crate) fn delta(&self) -> f64 {
        delta(self.count as f64, self.sum, self.squares)
    }
}
