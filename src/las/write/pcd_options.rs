//! How PCD files are written.

use serde::{Deserialize, Serialize};

/// How PCD files are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PcdOptions {
    /// The encoding of the points.
    pub(crate) encoding: PcdEncoding,
    /// The place that has the coordinates 0, 0, 0.
    pub(crate) origin: PcdOrigin,
}

/// The encoding of the points of a PCD file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PcdEncoding {
    /// Point by point.
    #[default]
    Binary,
    /// Field by field, compressed by LZF.
    Compressed,
}

/// The place that has the coordinates 0, 0, 0 in PCD files, whose coordinates have 24 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PcdOrigin {
    /// That of the CRS, or, along an axis with coordinates beyond 10 000, the multiple of 1000 nearest to the middle.
    #[default]
    Near,
    /// The south-west corner of the square of 100 km around the middle, as the grid of MGRS has it in UTM.
    Mgrs,
    /// This place (CRS units).
    At([f64; 3]),
}

/// The farthest coordinates that are left as they are: 24 bits resolve them to a thousandth.
const FARTHEST_AS_IT_IS: f64 = 10_000.0;
/// The step of [`PcdOrigin::Near`].
const NEAR_STEP: f64 = 1000.0;
/// The edge of a square of MGRS in metres.
const MGRS_SQUARE: f64 = 100_000.0;

impl PcdOrigin {
    /// The largest error (CRS units) of the coordinates of points from `min` to `max` that are written with this origin.
    pub(crate) fn largest_rounding(self, min: [f64; 3], max: [f64; 3]) -> f64 {
        let origin = self.of(min, max);
        let distances = (0..3).flat_map(|axis| [min, max].map(|c| (c[axis] - origin[axis]).abs()));
        let farthest = distances.fold(0.0, f64::max);
        // Half of the step between numbers of 24 bits that are so large.
        (farthest.log2().floor() - 24.0).exp2()
    }

    /// The origin for points from `min` to `max` (CRS units).
    pub(super) fn of(self, min: [f64; 3], max: [f64; 3]) -> [f64; 3] {
        let middle = [0, 1, 2].map(|axis| 0.5 * (min[axis] + max[axis]));
        match self {
            Self::At(place) => place,
            Self::Mgrs => {
                let [x, y] = [0, 1].map(|axis| (middle[axis] / MGRS_SQUARE).floor() * MGRS_SQUARE);
                [x, y, 0.0]
            }
            Self::Near => [0, 1, 2].map(|axis| {
                match min[axis].abs().max(max[axis].abs()) > FARTHEST_AS_IT_IS {
                    // Zero is added so that no origin is −0.
                    true => (middle[axis] / NEAR_STEP).round() * NEAR_STEP + 0.0,
                    false => 0.0,
                }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_origin_is_near_what_is_far() {
        let (min, max) = (
            [431_020.0, 5_399_900.0, 80.0],
            [431_130.0, 5_400_050.0, 95.0],
        );
        assert_eq!(PcdOrigin::Near.of(min, max), [431_000.0, 5_400_000.0, 0.0]);
        assert_eq!(PcdOrigin::Mgrs.of(min, max), [400_000.0, 5_300_000.0, 0.0]);
        assert_eq!(PcdOrigin::At([1.0; 3]).of(min, max), [1.0; 3]);
        assert_eq!(PcdOrigin::Near.of([-5.0; 3], [9000.0; 3]), [0.0; 3]);
    }

    #[test]
    fn the_largest_rounding_is_half_the_step_of_the_farthest_coordinate() {
        for far in [1.0, 130.0, 8191.5, 8192.0, 5_400_050.0_f32] {
            let step = f64::from(far.next_up()) - f64::from(far);
            let rounding = PcdOrigin::At([0.0; 3]).largest_rounding([-0.5; 3], [far.into(); 3]);
            assert_eq!(rounding, step / 2.0, "{far}");
        }
        assert_eq!(PcdOrigin::Near.largest_rounding([0.0; 3], [0.0; 3]), 0.0);
    }
}
