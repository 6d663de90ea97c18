//! Points in memory to even points in memory.
//!
//! ```text
//!   points ─► checked, on one integer grid ─► spacing ─► scan ─► solver ─► positions, rings, figures
//!                                                                  └────► nearest input point of each
//! ```
//!
//! The cloud is one tile that sees everything, so that the result is that of a job on a file with the same
//! points, without files, terminal or directory. All parallel work is done in the caller's rayon pool.

mod error;
mod options;
mod resampled;

use std::{borrow::Borrow, ops::ControlFlow};

use rayon::prelude::*;

pub use error::ResampleError;
use error::SHORTEST_LENGTH;
pub use options::Options;
pub use resampled::{Resampled, Ring};

use crate::{
    geometry::{Local, NearestPoints, Quantization, Stored, longest_side},
    lloyd::{
        Scan, Site, Solution, SolverOptions, TileRegion, WantedCount, solve_with_rings, uniformity,
    },
    spacing::{Target, dominant_normals, resolve},
    tiling::{CellGrid, CloudInMemory},
};

/// Largest absolute value of a coordinate.
const FARTHEST_COORDINATE: f64 = 1e12;
/// Steps of the default grid to a spacing, at least.
const DEFAULT_STEPS_PER_SPACING: f64 = 5000.0;

/// Shares of the work that are done when the spacing is known, when the scan is sorted, and when the solver
/// has ended.
const SHARE_WITH_SPACING: f64 = 0.1;
const SHARE_WITH_SCAN: f64 = 0.15;
const SHARE_WITH_SITES: f64 = 0.95;

/// Moves points to even positions on the surfaces that `points` were scanned from.
///
/// `points` yields x, y, z of each point, by value or by reference: a slice of `[f64; 3]`, or columns that
/// are zipped. Their order does not change the result but for the indices in
/// [`Resampled::source`]. The result is that of a job on a file with the same points and the same
/// [scale](Options::scale).
///
/// It takes some 150 bytes for each input point and 2 KB for each output point while it works; a cloud
/// that is larger than memory is the task of a `Job` on files. All parallel work is done in the current rayon
/// pool.
///
/// # Errors
///
/// See [`ResampleError`]: a setting, a coordinate or a count is out of its range.
///
/// # Examples
///
/// ```
/// // A sheet of 2 × 2, scanned by a grid of points.
/// let scan: Vec<[f64; 3]> = (0..40_000)
///     .map(|i| [(i % 200) as f64 * 0.01, (i / 200) as f64 * 0.01, 0.0])
///     .collect();
/// let even = lloydar::resample(&scan, &lloydar::Options::with_spacing(0.1))?;
///
/// assert!(even.points.len() > 400);
/// assert!(even.uniformity.cell_area_cv < 0.1);
/// // Any attribute of the input can be taken along.
/// let intensity: Vec<u16> = vec![7; scan.len()];
/// let taken: Vec<u16> = even.source.iter().map(|&nearest| intensity[nearest]).collect();
/// assert_eq!(taken.len(), even.points.len());
/// # Ok::<(), lloydar::ResampleError>(())
/// ```
pub fn resample<P>(
    points: impl IntoIterator<Item = P>,
    options: &Options,
) -> Result<Resampled, ResampleError>
where
    P: Borrow<[f64; 3]>,
{
    resample_with_progress(points, options, &|_| ControlFlow::Continue(()))
}

/// Moves points to even positions, as [`resample`] does, and reports progress meanwhile.
///
/// `progress` is called with the share of the work that is done, from 0 to 1, by the threads that work; if
/// it returns [`ControlFlow::Break`], the work ends at the next step with [`ResampleError::Cancelled`].
///
/// # Errors
///
/// See [`ResampleError`].
///
/// # Examples
///
/// ```
/// use std::ops::ControlFlow;
///
/// let scan: Vec<[f64; 3]> = (0..10_000)
///     .map(|i| [(i % 100) as f64 * 0.01, (i / 100) as f64 * 0.01, 0.0])
///     .collect();
/// let options = lloydar::Options::with_count(200);
/// let stop = |_share: f64| ControlFlow::Break(());
/// let stopped = lloydar::resample_with_progress(&scan, &options, &stop);
/// assert_eq!(stopped.unwrap_err(), lloydar::ResampleError::Cancelled);
/// ```
pub fn resample_with_progress<P>(
    points: impl IntoIterator<Item = P>,
    options: &Options,
    progress: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<Resampled, ResampleError>
where
    P: Borrow<[f64; 3]>,
{
    options.check()?;
    let points: Vec<[f64; 3]> = points.into_iter().map(|point| *point.borrow()).collect();
    let cloud = Cloud::new(&points, options)?;
    let reach = |share: f64| match progress(share) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(ResampleError::Cancelled),
    };
    reach(0.0)?;
    let (solver, wanted) = cloud.solver_options(options, &|| reach(0.0))?;
    reach(SHARE_WITH_SPACING)?;
    let Cloud {
        stored,
        quantization,
        ..
    } = cloud;
    let scan = Scan::new(stored, quantization, &solver);
    reach(SHARE_WITH_SCAN)?;
    let everywhere = TileRegion::everything();
    let solved = solve_with_rings(&scan, &everywhere, &solver, wanted, &|share| {
        progress(SHARE_WITH_SCAN + (SHARE_WITH_SITES - SHARE_WITH_SCAN) * share)
    });
    let (Solution { sites, .. }, rings) = solved.map_err(|_| ResampleError::Cancelled)?;
    drop(scan);
    reach(SHARE_WITH_SITES)?;
    let resampled = Resampled {
        source: nearest_indices(&points, &sites, &quantization),
        points: sites
            .iter()
            .map(|site| quantization.world_of_local(site.position))
            .collect(),
        normals: sites.iter().map(normal).collect(),
        areas: sites.iter().map(bounded_area).collect(),
        curvatures: sites.iter().map(|site| site.curvature).collect(),
        uniformity: uniformity(&sites, solver.spacing).figures(),
        spacing: solver.spacing,
        rings,
        quantization,
    };
    reach(1.0)?;
    Ok(resampled)
}

/// For each site the index of the point nearest to it; of equally near ones the smallest.
fn nearest_indices(points: &[[f64; 3]], sites: &[Site], quantization: &Quantization) -> Vec<usize> {
    let local = |&point: &[f64; 3]| quantization.local_of_world(point);
    let points: Vec<Local> = points.par_iter().map(local).collect();
    let tree = NearestPoints::new(&points);
    let nearest = |site: &Site| {
        tree.nearest(site.position)
            .map_or(0, |(index, _)| index as usize)
    };
    sites.par_iter().map(nearest).collect()
}

fn normal(site: &Site) -> [f64; 3] {
    site.normal.map_or([f64::NAN; 3], Into::into)
}

fn bounded_area(site: &Site) -> f64 {
    site.bounded_area().unwrap_or(f64::NAN)
}

/// Points that were checked, on one integer grid.
struct Cloud {
    stored: Vec<Stored>,
    quantization: Quantization,
    /// The longer horizontal side of the bounding box.
    horizontal_extent: f64,
}

impl Cloud {
    /// Checks `points` and rounds them to the grid that `options` ask for.
    fn new(points: &[[f64; 3]], options: &Options) -> Result<Self, ResampleError> {
        if points.is_empty() {
            return Err(ResampleError::NoPoints);
        }
        if u32::try_from(points.len()).is_err() {
            return Err(ResampleError::TooManyPoints {
                points: points.len(),
            });
        }
        // Written so that NaN fails.
        let is_valid = |point: &[f64; 3]| point.iter().all(|c| c.abs() <= FARTHEST_COORDINATE);
        let invalid = |index: usize| ResampleError::InvalidPoint {
            index,
            coordinates: points[index],
        };
        if let Some(index) = points.par_iter().position_first(|point| !is_valid(point)) {
            return Err(invalid(index));
        }
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            for axis in 0..3 {
                min[axis] = min[axis].min(point[axis]);
                max[axis] = max[axis].max(point[axis]);
            }
        }
        let extent = longest_side(min, max);
        if extent > 0.0 && extent < SHORTEST_LENGTH {
            return Err(ResampleError::TooSmall { extent });
        }
        let quantization = quantization(min, max, points.len(), options);
        let quantise = |(index, &point): (usize, &[f64; 3])| {
            quantization.quantise(point).ok_or_else(|| invalid(index))
        };
        let stored: Result<Vec<Stored>, ResampleError> =
            points.par_iter().enumerate().map(quantise).collect();
        Ok(Self {
            stored: stored?,
            quantization,
            horizontal_extent: f64::max(max[0] - min[0], max[1] - min[1]),
        })
    }

    /// Options of the solver at the spacing that meets the target of `options`, and the number of points if that is the
    /// target.
    fn solver_options(
        &self,
        options: &Options,
        stop: &(impl Fn() -> Result<(), ResampleError> + Sync),
    ) -> Result<(SolverOptions, Option<WantedCount>), ResampleError> {
        let scale = self.quantization.scale;
        let grid = CellGrid::for_run(self.horizontal_extent, scale);
        let counted = CloudInMemory::new(&self.stored, grid, stop);
        let (spacing, count) = resolve(
            &counted,
            &self.quantization,
            &options.solver,
            options.target,
        )?;
        let sites_per_point = count as f64 / self.stored.len() as f64;
        let wanted = options
            .target
            .wanted_count(count, options.exact, &options.solver);
        let mut solver = options.solver.at(spacing, sites_per_point);
        solver.dominant_normals = dominant_normals(&counted, &self.quantization, &solver)?;
        Ok((solver, wanted))
    }
}

/// The grid for `points` points between `min` and `max`.
fn quantization(min: [f64; 3], max: [f64; 3], points: usize, options: &Options) -> Quantization {
    if let Some(scale) = options.scale {
        let spacing = options.target.spacing_of_a_square(min, max);
        return Quantization::for_spacing(min, max, scale, spacing);
    }
    let target = match options.target {
        Target::Ratio(ratio) => Target::Count(((points as f64 * ratio) as u64).max(1)),
        target => target,
    };
    // Points that are all equal have no spacing; any scale serves them.
    let spacing = target.spacing_of_a_square(min, max).filter(|&s| s > 0.0);
    let finest = spacing.unwrap_or(1.0) / DEFAULT_STEPS_PER_SPACING;
    Quantization::around(min, max, 10_f64.powf(finest.log10().floor()))
}
