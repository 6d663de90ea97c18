//! How the number of sites follows the spacing, by the voxels that the points of a scan occupy.
//!
//! The points of a plane occupy four times as many voxels as voxels that are twice as wide, those of two planes that
//! melt into one in wide voxels more, and points that stand alone as many. The logarithm to the base of two is the
//! dimension of the scan at that scale (box counting). Where it is about that of a surface the number of sites follows it.

/// The dimension below which points stand alone or in lines: of spacings that grow, some bridge gaps that narrower ones do not, and the
/// number of sites follows nothing that voxels know.
const LEAST_DIMENSION: f64 = 1.25;
/// Sites for each occupied double voxel at a spacing that is told from voxels of another. With 0.58 the first spacing tried was
/// 4 % too wide in the mean of eight scans at four counts each.
const SITES_PER_VOXEL: f64 = 0.53;
/// The slope of the logarithm of the number of sites over that of the spacing is this, and this for each dimension: regression
/// over 36 cases (nine scans at four counts each), from which the slopes differ by 0.08 (root mean square).
const SLOPE: [f64; 2] = [-0.95, -0.59];
/// Error of the logarithm of a count below which a spacing is corrected by that slope and not tried again: in those cases the
/// correction left 0.5 % (root mean square), with 0.12 it left 0.4 % for a sixth more work.
const CORRECTABLE: f64 = 0.16;
/// That error where the slope is not known.
const CORRECTABLE_OF_SPARSE: f64 = 0.05;
/// That error where there are few sites: another trial takes no time, their number follows no slope closely, and in the lattice of
/// a plane each site that comes or leaves is seen. In 33 cases of 17 simulated clouds to 1 000 and 3 000 δ is 0.050 in the geometric mean;
/// with 0.05 for the former and 0.16 for the latter it was 0.054.
const CORRECTABLE_OF_FEW: f64 = 0.02;
/// With fewer sites than this there are few.
const FEW_SITES: f64 = 10_000.0;
/// That error where there are few points, too, so that seeds are elected in no time: a spacing is tried until it is taken as it is. Over
/// ten small scans and counts the excess of the energy is 0.92 times (geometric mean) what it is with the error of few sites, and half of
/// it on a nearly plane scan, where 66 sites of 7 043 would have to leave.
const CORRECTABLE_OF_FEW_POINTS: f64 = 0.0;
/// With fewer points than this there are few.
const FEW_POINTS: u64 = 1_000_000;

/// What the voxels of a scan tell of the number of sites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scaling {
    /// The dimension of the scan; `None` if the number of sites does not follow it.
    dimension: Option<f64>,
}

impl Scaling {
    /// The scaling of a scan that occupies `voxels` voxels, and `wide` ones that are twice as wide.
    pub(super) fn of(voxels: f64, wide: f64) -> Self {
        let dimension = (voxels / wide).log2();
        Self {
            dimension: (dimension >= LEAST_DIMENSION).then_some(dimension),
        }
    }

    /// The factor by which a spacing whose double voxels are occupied by `voxels` is too narrow for `count` sites.
    pub(super) fn factor(self, voxels: f64, count: f64) -> f64 {
        let dimension = self.dimension.unwrap_or(2.0);
        (SITES_PER_VOXEL * voxels / count).powf(dimension.recip())
    }

    /// The slope of the logarithm of the number of sites over that of the spacing; `None` if it is not known.
    pub(super) fn slope(self) -> Option<f64> {
        let [constant, by_dimension] = SLOPE;
        self.dimension.map(|d| constant + by_dimension * d)
    }

    /// Error of the logarithm of `count` below which the spacing of a scan of so many `points` is corrected and not tried again.
    pub(super) fn correctable(self, count: f64, points: u64) -> f64 {
        match self.dimension {
            _ if count < FEW_SITES && points < FEW_POINTS => CORRECTABLE_OF_FEW_POINTS,
            _ if count < FEW_SITES => CORRECTABLE_OF_FEW,
            Some(_) => CORRECTABLE,
            None => CORRECTABLE_OF_SPARSE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_has_two_dimensions_and_points_that_stand_alone_none() {
        let plane = Scaling::of(4000.0, 1000.0);
        assert_eq!(plane.dimension, Some(2.0));
        assert!((plane.slope().unwrap() + 2.13).abs() < 1e-12);
        // A quarter of the sites is there with twice the spacing.
        let fewer = SITES_PER_VOXEL * 4000.0 / 4.0;
        assert!((plane.factor(4000.0, fewer) - 2.0).abs() < 1e-12);
        let alone = Scaling::of(1000.0, 990.0);
        assert_eq!((alone.dimension, alone.slope()), (None, None));
        // Few sites are tried the longest, whatever is known.
        let many = 10 * FEW_POINTS;
        assert!(alone.correctable(1e5, many) < plane.correctable(1e5, many));
        assert!(plane.correctable(1e3, many) < alone.correctable(1e5, many));
        assert_eq!(alone.correctable(1e3, many), plane.correctable(1e3, many));
        assert!(plane.correctable(1e3, 50_000) < plane.correctable(1e3, many));
        // A cloud without points.
        assert_eq!(Scaling::of(0.0, 0.0).dimension, None);
    }
}
