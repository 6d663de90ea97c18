//! How much of a cloud is read, and how often, to choose its spacing.

use std::sync::atomic::{AtomicU64, Ordering};

use super::{SpacingError, Target, resolve, search::estimate_options};
use crate::{
    geometry::{CellIndex, Quantization, Rect, Stored, spread},
    lloyd::{IsolatedRule, Scan, SolverOptions, SolverSettings, ThinnedPoints, elect},
    tiling::{Bounds, CellGrid, CloudInMemory, CountedCloud},
};

const QUANTIZATION: Quantization = Quantization {
    scale: 0.001,
    offset: [0.0; 3],
};

/// `n` random points in a box with these sides (CRS units).
fn points(n: u64, sides: [u64; 3]) -> Vec<Stored> {
    let coordinate = |k: u64, side: u64| (spread(k) % (1000 * side).max(1)) as i32;
    (0..n)
        .map(|i| Stored {
            x: coordinate(3 * i, sides[0]),
            y: coordinate(3 * i + 1, sides[1]),
            z: coordinate(3 * i + 2, sides[2]),
        })
        .collect()
}

/// A cloud that counts how often it is gathered from, and the points that are.
struct Watched<C> {
    cloud: C,
    gathers: AtomicU64,
    gathered: AtomicU64,
}

impl<C: CountedCloud> Watched<C> {
    /// Counts the points of the squares that touch `rect`.
    fn count_read(&self, rect: &Rect) {
        let edge = self.square_edge();
        let touched = self.squares().filter(|&([x, y], _)| {
            let min = [x * edge, y * edge];
            let max = min.map(|c| c + edge);
            Rect { min, max }.intersects(rect)
        });
        let read: u64 = touched.map(|(_, points)| points).sum();
        self.gathers.fetch_add(1, Ordering::Relaxed);
        self.gathered.fetch_add(read, Ordering::Relaxed);
    }
}

impl<C: CountedCloud> CountedCloud for Watched<C> {
    type Error = C::Error;

    fn points(&self) -> u64 {
        self.cloud.points()
    }

    fn bounds(&self) -> Bounds {
        self.cloud.bounds()
    }

    fn square_edge(&self) -> i64 {
        self.cloud.square_edge()
    }

    fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        self.cloud.squares()
    }

    fn cells(
        &self,
        rect: &Rect,
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> Result<Vec<CellIndex>, C::Error> {
        self.count_read(rect);
        self.cloud.cells(rect, cell_of)
    }

    fn gather(
        &self,
        rect: &Rect,
        quantization: &Quantization,
        options: &SolverOptions,
        thinning_limit: u64,
    ) -> Result<ThinnedPoints, C::Error> {
        let points = self
            .cloud
            .gather(rect, quantization, options, thinning_limit)?;
        self.count_read(rect);
        Ok(points)
    }
}

/// What `target` gives for `points`, how often they were gathered from, and how many were read.
fn resolved(points: &[Stored], target: Target) -> (Result<(f64, u64), SpacingError<()>>, u64, u64) {
    resolved_with(&SolverSettings::default(), points, target)
}

/// What [`resolved`] returns, with these `settings` of the solver.
fn resolved_with(
    settings: &SolverSettings,
    points: &[Stored],
    target: Target,
) -> (Result<(f64, u64), SpacingError<()>>, u64, u64) {
    let go_on = || Ok::<(), ()>(());
    let cloud = Watched {
        cloud: CloudInMemory::new(points, CellGrid::new(1000), &go_on),
        gathers: AtomicU64::new(0),
        gathered: AtomicU64::new(0),
    };
    let result = resolve(&cloud, &QUANTIZATION, settings, target);
    let [gathers, gathered] = [cloud.gathers, cloud.gathered].map(AtomicU64::into_inner);
    (result, gathers, gathered)
}

#[test]
fn a_wide_spacing_is_estimated_from_each_point_once() {
    let points = points(1_500_000, [10, 8, 0]);
    for spacing in [1.0, 4.0] {
        let (result, _, gathered) = resolved(&points, Target::Spacing(spacing));
        let (_, count) = result.unwrap();
        let plane = 80.0 / (0.866 * spacing * spacing);
        assert!(
            (0.7..2.0).contains(&(count as f64 / plane)),
            "{count} sites at {spacing}"
        );
        assert!(gathered <= 1_600_000, "{gathered} points were read");
    }
}

/// On a floor along the axes there are more sites to a voxel than on other planes, among leaves there are fewer.
#[test]
fn what_a_spacing_gives_is_estimated_alike_on_a_floor_and_among_leaves() {
    let spacing = 0.3;
    for sides in [[20, 20, 0], [9, 9, 3]] {
        let points = points(600_000, sides);
        let (_, count) = resolved(&points, Target::Spacing(spacing)).0.unwrap();
        let options = SolverSettings::default().at(spacing, 0.01);
        let scan = Scan::new(points, QUANTIZATION, &options);
        let elected = elect(&scan, &options).identities.len();
        let ratio = count as f64 / elected as f64;
        assert!((0.93..1.07).contains(&ratio), "{count} of {elected}");
    }
}

#[test]
fn a_spacing_far_finer_than_the_scan_gives_its_points_and_closes_no_wide_holes() {
    let points = points(20_000, [100, 100, 0]);
    let (result, ..) = resolved(&points, Target::Spacing(0.01));
    let (_, count) = result.unwrap();
    assert!((19_000..25_000).contains(&count), "{count} sites");

    let go_on = || Ok::<(), ()>(());
    let cloud = CloudInMemory::new(&points, CellGrid::new(1000), &go_on);
    let settings = SolverSettings::default();
    let options = estimate_options(&cloud, &QUANTIZATION, &settings, 0.01);
    assert!(options.fill <= 16.0 * 0.01 + 1e-9, "{}", options.fill);
}

#[test]
fn a_count_that_no_spacing_gives_is_given_up_after_few_trials() {
    // Points in the air stand alone: there is no surface for more.
    let points = points(15_000, [100, 100, 100]);
    let (result, _, gathered) = resolved(&points, Target::Count(150_000));
    let Err(SpacingError::CannotCarry { reached, .. }) = result else {
        panic!("{result:?}");
    };
    assert!((12_000.0..40_000.0).contains(&reached), "{reached}");
    assert!(gathered <= 24 * 15_000, "{gathered} points were read");
}

#[test]
fn a_count_that_isolated_points_keep_from_being_met_has_the_spacing_of_all() {
    // Far finer than the points are apart each of them is isolated.
    let points = points(3_000, [60, 60, 60]);
    let target = Target::Count(2_800);
    let drop = SolverSettings {
        isolated: IsolatedRule::Drop,
        ..SolverSettings::default()
    };
    let (spacing, _) = resolved_with(&drop, &points, target).0.unwrap();
    let (of_all, _) = resolved(&points, target).0.unwrap();
    assert_eq!(spacing, of_all);
}

#[test]
fn the_count_of_a_cloud_of_few_points_is_nearly_met() {
    for first in 0..8 {
        let all = points(880, [10, 10, 10]);
        let points = &all[110 * first..110 * (first + 1)];
        for count in [20, 30, 40] {
            let (result, ..) = resolved(points, Target::Count(count));
            let (spacing, _) = result.unwrap();
            let (result, ..) = resolved(points, Target::Spacing(spacing));
            let (_, found) = result.unwrap();
            // Their number falls in steps as the spacing grows.
            assert!(
                2 * found.abs_diff(count) <= count,
                "{found} instead of {count}"
            );
        }
    }
}

#[test]
fn seeds_beyond_the_border_of_a_narrow_scan_count() {
    // Two and a half metres to a point: the first guess of the spacing is far too fine, and what is counted ends where it says.
    let points = points(1_000, [500, 5, 0]);
    for count in [120, 150, 200] {
        let (spacing, _) = resolved(&points, Target::Count(count)).0.unwrap();
        let sites_per_point = count as f64 / points.len() as f64;
        let options = SolverSettings::default().at(spacing, sites_per_point);
        let scan = Scan::new(points.clone(), QUANTIZATION, &options);
        let elected = elect(&scan, &options).identities.len() as f64;
        let ratio = elected / count as f64;
        assert!((0.94..1.06).contains(&ratio), "{elected} of {count}");
    }
}

#[test]
fn a_wall_carries_more_sites_than_it_has_points() {
    let points = points(6_000, [40, 0, 12]);
    let (spacing, _) = resolved(&points, Target::Count(8_000)).0.unwrap();
    let of_the_plane = f64::sqrt(40.0 * 12.0 / (0.866 * 8_000.0));
    assert!(
        (0.95..1.05).contains(&(spacing / of_the_plane)),
        "{spacing}"
    );
}
