//! Normals of the planes among points, fast and coarse: from the means of the points in double voxels.

use super::dominant_normals::DominantNormals;
use crate::{
    geometry::{
        CellIndex, CellOrder, Local, NeighborGrid, Quantization, Rect, Stored, mean_and_covariance,
        narrow_frame,
    },
    lloyd::{PointSum, SolverOptions, ThinnedPoints, Thinning, TileRegion},
};

/// Radius of the neighbourhood that has one normal.
const RADIUS_IN_SPACINGS: f64 = 1.8;
/// A neighbourhood of fewer means has no normal. On a plane there are some sixteen.
const FEWEST_MEANS: usize = 9;
/// Largest standard deviation of the means of a plane across it.
const THICKEST_IN_SPACINGS: f64 = 0.1;
/// The least variance along the narrow direction in a plane over that along the wide one. On bands that are narrower
/// the normal is doubtful.
const LEAST_ROUNDNESS: f64 = 0.4;

/// The normals of planes among `points`, one to each occupied double voxel that has one and whose middle is in `core`. They are
/// the same however far the points have been thinned, if `points` are all those within a spacing of the core: where the
/// points end, the sum of a voxel is in or out as a whole.
///
/// # Panics
///
/// Unless there are fewer than 2³² points and sums.
pub(crate) fn coarse_normals(
    points: &ThinnedPoints,
    core: &Rect,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Vec<Local> {
    let means = means(points, core, quantization, options);
    let radius = RADIUS_IN_SPACINGS * options.spacing;
    let grid = NeighborGrid::new(&means, radius);
    let mut near = Vec::new();
    let normal = |&mean: &Local| {
        grid.gather(mean, radius, &mut near);
        plane_normal(&near, THICKEST_IN_SPACINGS * options.spacing)
    };
    means.iter().filter_map(normal).collect()
}

impl DominantNormals {
    /// The directions that many planes among `points` face, at the scale of `options`.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points.
    pub fn of_points(
        points: Vec<Stored>,
        quantization: &Quantization,
        options: &SolverOptions,
    ) -> Self {
        let everywhere = TileRegion::everything().core;
        let normals = coarse_normals(&points.into(), &everywhere, quantization, options);
        Self::among(normals.into_iter())
    }
}

/// The mean of the points in each occupied double voxel whose middle is in `core`.
fn means(
    points: &ThinnedPoints,
    core: &Rect,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Vec<Local> {
    let thinning = Thinning::new(quantization, options);
    let ThinnedPoints { kept, sums, .. } = points;
    let places = kept.iter().copied().chain(sums.iter().map(PointSum::mean));
    let cells: Vec<CellIndex> = places.map(|p| thinning.double_voxel_of(p)).collect();
    let mean = |in_cell: &[u32]| {
        let mut sum = PointSum::default();
        for &index in in_cell {
            match kept.get(index as usize) {
                Some(&point) => sum.add(point),
                None => sum.merge(&sums[index as usize - kept.len()]),
            }
        }
        sum.local_mean(quantization)
    };
    let is_in_core = |in_cell: &&[u32]| {
        let middle = thinning.middle_of_double_voxel(cells[in_cell[0] as usize]);
        quantization
            .stored(middle)
            .is_some_and(|middle| core.contains(middle))
    };
    let order = CellOrder::new(&cells);
    order.cells().filter(is_in_core).map(mean).collect()
}

/// The normal of the plane through `places`, if they are no farther than `thickest` (CRS units) from it.
fn plane_normal(places: &[Local], thickest: f64) -> Option<Local> {
    if places.len() < FEWEST_MEANS {
        return None;
    }
    let (_, covariance) = mean_and_covariance(places);
    let ([wide, narrow, thin], [.., normal]) = narrow_frame(covariance)?;
    (thin <= thickest * thickest && narrow >= LEAST_ROUNDNESS * wide).then_some(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// Points of a wall that stands over the line from the origin to (3, 4), and of a bush before it.
    fn points() -> Vec<Stored> {
        let random = |k: u64, below: u64| (spread(k) % below) as i32;
        let on_wall = |i: u64| {
            let along = random(3 * i, 1000);
            Stored {
                x: 3 * along,
                y: 4 * along,
                z: random(3 * i + 1, 3000),
            }
        };
        let in_bush = |i: u64| Stored {
            x: 4000 + random(3 * i, 2000),
            y: random(3 * i + 1, 2000),
            z: random(3 * i + 2, 2000),
        };
        let on_wall = (0..40_000).map(on_wall);
        on_wall.chain((40_000..44_000).map(in_bush)).collect()
    }

    #[test]
    fn a_wall_has_one_normal_and_a_bush_has_none() {
        let options = SolverOptions::new(0.2);
        let everywhere = TileRegion::everything().core;
        let normals = coarse_normals(&points().into(), &everywhere, &QUANTIZATION, &options);
        let across = Local::new(0.8, -0.6, 0.0);
        let cosines = normals.iter().map(|normal| normal.dot(&across).abs());
        assert!(cosines.clone().fold(1.0, f64::min) > 0.9999);
        // The wall has about 19 × 31 double voxels in its plane, and those at its ends have no normal.
        assert!((300..900).contains(&normals.len()), "{}", normals.len());
    }

    #[test]
    fn thinned_points_of_a_part_have_the_same_normals() {
        let options = SolverOptions::new(0.2);
        let core = Rect {
            min: [700, 900],
            max: [2300, 3000],
        };
        let all = ThinnedPoints::from(points());
        let thinned = Thinning::new(&QUANTIZATION, &options).thinned(all.clone());
        assert!(thinned.kept.len() < all.kept.len() / 2);
        let seen = core.grown(200);
        let normals = [&all, &thinned].map(|points| {
            let is_seen = |point: &Stored| seen.contains(*point);
            let points = ThinnedPoints {
                kept: points.kept.iter().copied().filter(is_seen).collect(),
                sums: points
                    .sums
                    .iter()
                    .copied()
                    .filter(|sum| is_seen(&sum.mean()))
                    .collect(),
                ..ThinnedPoints::default()
            };
            coarse_normals(&points, &core, &QUANTIZATION, &options)
        });
        assert!(normals[0].len() > 100);
        assert_eq!(normals[0], normals[1]);
    }
}
