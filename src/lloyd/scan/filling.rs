//! Holes are closed, and sparse parts made dense enough, before seeds are elected.
//!
//! Far from the scanner points lie farther apart than the sites are to be; seeds that stand on
//! points leave gaps between them there (paper, section IV-A, Step 2, and V-C). So the surface
//! itself is put into the gaps: positions on a patch, half a spacing apart, which the rest of
//! the method takes for samples.
//!
//! ```text
//!    ·  ·  ·  ·  ·         ·  ·  ·  ·
//!    ·  ·  ·  + +  +   +   ·  ·  ·  ·      · sample    + filling
//!    ·  ·  ·  ·  + +  +  · ·  ·  ·  ·
//!            ◄─── fill ───►
//! ```
//!
//! A position is filled if the patch of its nearest landmark describes the scan around it, if
//! samples of that surface lie all around it (so nothing grows beyond a border), and if the
//! narrowest way across the gap is no wider than the option `fill`. Wider gaps stay open.

use std::ops::Range;

use rayon::prelude::*;

use super::surroundings::Surroundings;
use crate::{
    geometry::{Local, NeighborGrid, Patch, PatchKind, Stored, cell_of},
    lloyd::surface::{Surface, bounding_box},
};

/// Distance between the positions of the filling: a patch then finds as many as it needs.
const PITCH_IN_SPACINGS: f64 = 0.5;

/// Edge of the cells whose samples are one *landmark*, their mean. Gaps are wider than that,
/// and there are fewer landmarks than samples to examine.
const LANDMARK_CELL_IN_SPACINGS: f64 = 0.75;

/// Edge of the cells whose landmarks find what is near them together: as many landmarks stand in
/// the memory side by side.
const BLOCK_IN_SPACINGS: f64 = 4.0 * LANDMARK_CELL_IN_SPACINGS;

/// A landmark with others in all directions within this distance is at no gap.
const DENSE_IN_SPACINGS: f64 = 1.6;

/// How far the other side of a gap is searched, in widths of the widest gap: it is not always
/// straight ahead.
const SEARCH_IN_FILLS: f64 = 1.5;

/// Cells along the radius of that search: narrow gaps are searched by the cells of `DENSE_IN_SPACINGS`,
/// and a search across a wide gap does not visit thousands of them.
const CELLS_PER_SEARCH: f64 = 4.0;

/// Radius of the patch across a gap, in widths of the widest gap.
const FIT_RADIUS_IN_FILLS: f64 = 0.8;

/// The residual of a patch across a gap may be this share of the largest that a patch on
/// samples may have: a surface that is not seen must be surer than one that is. A ramp from a
/// wall to the window behind it leaves more.
const SURENESS: f64 = 0.25;

/// The positions on `surface` that close its holes up to the width of the option `fill`.
pub(super) fn filling(surface: Surface<'_>) -> Vec<Stored> {
    if surface.options.fill <= 0.0 {
        return Vec::new();
    }
    let (field, spacing) = (surface.field(), surface.spacing());
    let landmarks = landmarks(surface);
    let across_gap = SEARCH_IN_FILLS * surface.options.fill / spacing;
    let across_gap = DENSE_IN_SPACINGS.max(across_gap / CELLS_PER_SEARCH);
    let grids = Grids {
        dense: field.grid(&landmarks, DENSE_IN_SPACINGS),
        across_gap: field.grid(&landmarks, across_gap),
    };
    let block_of = |&landmark: &Local| {
        let edge = field.finest_of_layer(landmark);
        (edge.to_bits(), cell_of(landmark, BLOCK_IN_SPACINGS * edge))
    };
    landmarks
        .par_chunk_by(|a, b| block_of(a) == block_of(b))
        .map_init(Block::default, |block, landmarks| {
            let coarsest = surface.coarsest_options(landmarks.iter().copied());
            block.begin(landmarks, &grids, surface.with(&coarsest));
            let mut positions = Vec::new();
            for &landmark in landmarks {
                let options = surface.options_at(landmark);
                let surface = surface.with(&options);
                if let Some(patch) = patch_across_gap(landmark, &grids, surface, block) {
                    positions.extend(filled_around(landmark, &patch, surface, &block.near));
                }
            }
            positions
        })
        .flatten_iter()
        .collect()
}

/// What the landmarks of a block have around them.
#[derive(Default)]
struct Block {
    /// The landmarks within `DENSE_IN_SPACINGS`, and more.
    landmarks: Vec<Local>,
    /// The samples within the fit radius, and more, once they are needed.
    samples: Option<Vec<Local>>,
    /// The corners of the box around the landmarks of the block.
    corners: [Local; 2],
    /// The widest fit radius of the landmarks (CRS units).
    fit_radius: f64,
    /// Scratch: what is near one landmark.
    near: Vec<Local>,
}

impl Block {
    /// Prepares for `landmarks`.
    fn begin(&mut self, landmarks: &[Local], grids: &Grids, surface: Surface<'_>) {
        self.corners = bounding_box(landmarks.iter().copied());
        self.fit_radius = surface.options.fit_radius;
        let reach = Local::repeat(DENSE_IN_SPACINGS * surface.spacing());
        let [low, high] = self.corners;
        self.samples = None;
        self.landmarks.clear();
        let add = |_, landmark| self.landmarks.push(landmark);
        grids.dense.visit_box(low - reach, high + reach, add);
    }

    /// Makes `near` the landmarks nearer to `position` than `radius` (CRS units), which is at
    /// most `DENSE_IN_SPACINGS`.
    fn find_landmarks(&mut self, position: Local, radius: f64) {
        keep_within(&self.landmarks, position, radius, &mut self.near);
    }

    /// Makes `near` the samples within the fit radius of `position`.
    fn find_samples(&mut self, position: Local, surface: Surface<'_>) {
        let radius = surface.options.fit_radius;
        let samples = self.samples.get_or_insert_with(|| {
            let [low, high] = self.corners;
            let (reach, mut found) = (Local::repeat(self.fit_radius.max(radius)), Vec::new());
            let samples = surface.scan.samples();
            samples.visit_box(low - reach, high + reach, |_, sample| found.push(sample));
            found
        });
        keep_within(samples, position, radius, &mut self.near);
    }
}

/// Makes `near` those of `positions` that are nearer to `center` than `radius` (CRS units).
fn keep_within(positions: &[Local], center: Local, radius: f64, near: &mut Vec<Local>) {
    let is_near = |position: &Local| (position - center).norm_squared() < radius * radius;
    near.clear();
    near.extend(positions.iter().copied().filter(is_near));
}

/// The landmarks by cells as wide as what is searched.
struct Grids {
    /// For the landmarks within `DENSE_IN_SPACINGS`.
    dense: NeighborGrid,
    /// For the landmarks on the other side of a gap.
    across_gap: NeighborGrid,
}

/// The landmarks: means of the samples in cells.
fn landmarks(surface: Surface<'_>) -> Vec<Local> {
    let samples = surface.scan.samples().points();
    let (cells, order) = surface.field().cells(samples, LANDMARK_CELL_IN_SPACINGS);
    let mean = |range: Range<usize>| {
        let count = range.len() as f64;
        let in_cell = order[range].iter().map(|&index| samples[index as usize]);
        in_cell.sum::<Local>() / count
    };
    cells
        .ranges()
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(mean)
        .collect()
}

/// The patch across the gap at `landmark`, if there is a gap in a surface. It fills `near` of `block`
/// with the landmarks on both sides of the gap.
fn patch_across_gap(
    landmark: Local,
    landmarks: &Grids,
    surface: Surface<'_>,
    block: &mut Block,
) -> Option<Patch> {
    let (options, spacing) = (surface.options, surface.spacing());
    let dense = DENSE_IN_SPACINGS * spacing;
    block.find_landmarks(landmark, dense);
    if let Some(patch) = Patch::fit(landmark, &block.near, dense, PatchKind::Plane)
        && Surroundings::of(landmark, &patch, &block.near, spacing).longest_gap() <= 1
    {
        return None;
    }
    // Where the samples nearby are no surface, nothing is known of a gap.
    block.find_samples(landmark, surface);
    if Patch::fit(landmark, &block.near, options.fit_radius, options.patch)
        .is_some_and(|patch| !patch.describes(options.fit_radius))
    {
        return None;
    }
    // Few patches across a gap describe a surface: only there the other side is searched. The
    // margin is for rounding.
    let near = &mut block.near;
    let radius = options.fit_radius.max(FIT_RADIUS_IN_FILLS * options.fill);
    let fit = |near: &[Local], margin: f64| {
        let patch = Patch::fit(landmark, near, radius, options.patch);
        patch.filter(|patch| patch.describes(margin * SURENESS * options.fit_radius))
    };
    landmarks.across_gap.gather(landmark, radius, near);
    fit(near, 1.001)?;
    let across_gap = SEARCH_IN_FILLS * options.fill;
    landmarks.across_gap.gather(landmark, across_gap, near);
    let patch = fit(near, 1.0)?;
    let surroundings = Surroundings::of(landmark, &patch, near, spacing);
    surroundings.surround().then_some(patch)
}

/// The filling on `patch` that is nearer to `landmark` than to any other of the landmarks
/// `near`.
fn filled_around(
    landmark: Local,
    patch: &Patch,
    surface: Surface<'_>,
    near: &[Local],
) -> Vec<Stored> {
    let (options, spacing) = (surface.options, surface.spacing());
    let pitch = PITCH_IN_SPACINGS * spacing;
    // What landmarks surround is no farther than the farthest of them, however wide the holes are that are closed.
    let reach = near.iter().map(|other| (other - landmark).norm_squared());
    let reach = reach.fold(0.0, f64::max).sqrt();
    let farthest = (0.5 * options.fill).min(reach) + pitch;
    let steps = (farthest / pitch) as i32;
    let mut positions = Vec::new();
    for i in -steps..=steps {
        for j in -steps..=steps {
            let position = patch.point(f64::from(i) * pitch, f64::from(j) * pitch);
            let own = (position - landmark).norm_squared();
            let is_nearer = |other: &Local| (position - other).norm_squared() < own;
            if own > farthest * farthest
                || surface.scan.is_occupied(position)
                || near.iter().any(is_nearer)
            {
                continue;
            }
            let around = Surroundings::of(position, patch, near, spacing);
            if around.surround() && around.narrowest_way() <= options.fill {
                positions.extend(surface.quantization().stored(position));
            }
        }
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        lloyd::{Scan, SolverOptions},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// Random points of a bent strip of 20 × 20 where `is_scanned`, `density` to the unit of
    /// area.
    fn strip(density: f64, is_scanned: impl Fn(f64, f64) -> bool) -> Vec<Stored> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        (0..(400.0 * density) as u64)
            .map(|i| (20.0 * unit(2 * i), 20.0 * unit(2 * i + 1)))
            .filter(|&(x, y)| is_scanned(x, y))
            .filter_map(|(x, y)| QUANTIZATION.stored(Local::new(x, y, 0.02 * x * x)))
            .collect()
    }

    fn filled(points: Vec<Stored>, fill: f64) -> Vec<Local> {
        let options = SolverOptions {
            fill,
            ..SolverOptions::new(1.0)
        };
        let scan = Scan::new(points, QUANTIZATION, &options);
        scan.filling()
            .iter()
            .map(|&p| QUANTIZATION.local(p))
            .collect()
    }

    #[test]
    fn a_hole_is_closed_if_it_is_no_wider_than_the_option() {
        let points = || strip(30.0, |x, y| (x - 10.0).hypot(y - 10.0) > 1.4);
        let positions = filled(points(), 3.2);
        let is_inside = |p: &&Local| (p.x - 10.0).hypot(p.y - 10.0) < 1.5;
        let inside = positions.iter().filter(is_inside).count();
        assert!((8..60).contains(&inside), "{inside}");
        // Some voxels have no point elsewhere, too.
        assert!(positions.len() - inside < 8, "{positions:?}");
        for position in &positions {
            assert!(
                (position.z - 0.02 * position.x * position.x).abs() < 0.02,
                "{position:?}"
            );
        }
        // No position of the hole is far from all of the filling.
        for (x, y) in [(10.0, 10.0), (9.5, 10.5), (10.8, 9.6)] {
            let near = |p: &&Local| (p.x - x).hypot(p.y - y) < 0.5;
            assert!(positions.iter().any(|p| near(&p)), "({x}, {y})");
        }
        assert!(filled(points(), 0.0).is_empty());
        let middle = |p: &Local| (p.x - 10.0).hypot(p.y - 10.0) < 0.7;
        assert!(!filled(points(), 1.6).iter().any(middle));
    }

    #[test]
    fn nothing_grows_beyond_a_border() {
        let positions = filled(strip(30.0, |_, _| true), 4.0);
        assert!(positions.len() < 8, "{positions:?}");
        let is_within = |p: &Local| (0.0..20.0).contains(&p.x) && (0.0..20.0).contains(&p.y);
        assert!(positions.iter().all(is_within), "{positions:?}");
        // Nothing grows into a gap that is too wide.
        let gap = strip(30.0, |x, _| !(8.0..12.5).contains(&x));
        let inside = filled(gap, 3.0)
            .into_iter()
            .filter(|p| (8.3..12.2).contains(&p.x));
        assert_eq!(inside.count(), 0);
    }

    #[test]
    fn a_sparse_scan_is_made_dense() {
        let positions = filled(strip(0.6, |_, _| true), 5.0);
        // Four to the unit of area are expected, except along the border.
        assert!(
            (600..2200).contains(&positions.len()),
            "{}",
            positions.len()
        );
        for position in &positions {
            assert!(
                (position.z - 0.02 * position.x * position.x).abs() < 0.05,
                "{position:?}"
            );
        }
    }
}
