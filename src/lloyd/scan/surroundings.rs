//! The samples of a surface around a position, by direction.

use crate::{
    geometry::{Local, Patch},
    lloyd::step::SHEET_THICKNESS_IN_SPACINGS,
};

/// The distance to the nearest sample of a surface in each of eight directions.
pub(super) struct Surroundings {
    /// The distances (CRS units), counter-clockwise; infinite where there is no sample.
    nearest: [f64; 8],
}

impl Surroundings {
    /// The surroundings of `position` on `patch`, among those of the `samples` that lie on the
    /// patch.
    pub(super) fn of(position: Local, patch: &Patch, samples: &[Local], spacing: f64) -> Self {
        let [u, v, _] = patch.coordinates(position);
        let mut nearest = [f64::INFINITY; 8];
        for &sample in samples {
            let [s, t, height] = patch.coordinates(sample);
            let (along, across) = (s - u, t - v);
            let squared = along * along + across * across;
            let is_off =
                (height - patch.height(s, t)).abs() > SHEET_THICKNESS_IN_SPACINGS * spacing;
            if squared > 0.0 && !is_off {
                let direction = &mut nearest[octant(along, across)];
                *direction = direction.min(squared);
            }
        }
        Self {
            nearest: nearest.map(f64::sqrt),
        }
    }

    /// The largest number of directions in a row without a sample.
    pub(super) fn longest_gap(&self) -> usize {
        let (mut longest, mut gap) = (0, 0);
        // Twice around, for gaps that begin before the first direction.
        for direction in self.nearest.iter().chain(&self.nearest) {
            gap = if direction.is_infinite() { gap + 1 } else { 0 };
            longest = longest.max(gap);
        }
        longest.min(8)
    }

    /// Whether there are samples all around: no half of the plane is without one.
    pub(super) fn surround(&self) -> bool {
        self.longest_gap() <= 2
    }

    /// The width of the gap across its narrowest direction: the least sum of the distances in
    /// two opposite directions (CRS units).
    pub(super) fn narrowest_way(&self) -> f64 {
        let across = |k: usize| self.nearest[k] + self.nearest[k + 4];
        (0..4).map(across).fold(f64::INFINITY, f64::min)
    }
}

/// The eighth of the plane that contains `(u, v)`, counted counter-clockwise.
fn octant(u: f64, v: f64) -> usize {
    let is_steep = v.abs() > u.abs();
    match (u >= 0.0, v >= 0.0) {
        (true, true) => usize::from(is_steep),
        (false, true) => 3 - usize::from(is_steep),
        (false, false) => 4 + usize::from(is_steep),
        (true, false) => 7 - usize::from(is_steep),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octants_go_around() {
        for k in 0..8_u8 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4 + 0.3).sin_cos();
            assert_eq!(octant(cos, sin), usize::from(k));
        }
    }
}
