//! Holes are closed, and sparse places made dense enough, before anything else
//! is done.
//!
//! Far from the scanner points lie farther apart than the sites are to be;
//! there seeds that stand on points leave gaps between them (paper, section
//! IV-A, Step 2, and V-C). So the surface itself is put into the gaps: places of
//! a patch, half a spacing apart, that the rest of the method takes for samples.
//!
//! ```text
//!    ·  ·  ·  ·  ·         ·  ·  ·  ·
//!    ·  ·  ·  + +  +   +   ·  ·  ·  ·      · sample    + filling
//!    ·  ·  ·  ·  + +  +  · ·  ·  ·  ·
//!            ◄─── fill ───►
//! ```
//!
//! A place is filled if the patch of its nearest landmark describes what was
//! scanned around it, if samples of that surface lie all around it (so nothing
//! grows beyond a border), and if the narrowest way across the gap is no wider
//! than asked for. Wider gaps stay open.

use std::ops::Range;

use rayon::prelude::*;

use super::{Scan, SolverOptions, fit::THICKNESS};
use crate::geometry::{
    AT_ONCE, Local, NeighborGrid, OccupiedCells, Patch, PatchKind, Stored, cell_of,
};

/// Distance between places of the filling, in spacings: a patch then finds as
/// many as it wants.
const PITCH: f64 = 0.5;

/// Edge of the cells, in spacings, whose samples are one *landmark*: gaps are
/// wider than that, and there are fewer of them to look at.
const LANDMARK: f64 = 0.75;

/// A landmark with others in all directions within so many spacings is at no
/// gap.
const DENSE: f64 = 1.6;

/// How far is looked for the other side of a gap, in widths of the widest: what
/// lies across is not always straight ahead.
const LOOK: f64 = 1.5;

/// Reach of the patch across a gap, in widths of the widest.
const REACH: f64 = 0.8;

/// What is not seen must be surer than what is: the patch across a gap may leave
/// this share unexplained of what one on samples may. A ramp from a wall to the
/// window behind it leaves more.
const SURENESS: f64 = 0.25;

/// Places on the surfaces of `scan` that close its holes up to the width that
/// `options` ask for.
pub(super) fn filling(scan: &Scan, options: &SolverOptions) -> Vec<Stored> {
    if options.fill <= 0.0 {
        return Vec::new();
    }
    let landmarks = landmarks(scan, LANDMARK * options.spacing);
    let grid = NeighborGrid::new(&landmarks, DENSE * options.spacing);
    let places = |near: &mut Vec<Local>, &mark: &Local| places_at(mark, &grid, scan, options, near);
    landmarks
        .par_iter()
        .with_max_len(AT_ONCE)
        .map_init(Vec::new, places)
        .flatten_iter()
        .collect()
}

/// Means of the samples in cells of `edge` (CRS units).
fn landmarks(scan: &Scan, edge: f64) -> Vec<Local> {
    let samples = scan.samples().points();
    let (cells, order) = OccupiedCells::sort(samples, |&p| cell_of(p, edge));
    let mean = |range: Range<usize>| {
        let count = range.len() as f64;
        let held = order[range].iter().map(|&place| samples[place as usize]);
        held.sum::<Local>() / count
    };
    cells
        .ranges()
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(mean)
        .collect()
}

/// The filling that is nearer to `mark` than to any other landmark. `near` is
/// scratch.
fn places_at(
    mark: Local,
    landmarks: &NeighborGrid,
    scan: &Scan,
    options: &SolverOptions,
    near: &mut Vec<Local>,
) -> Vec<Stored> {
    let spacing = options.spacing;
    landmarks.gather(mark, DENSE * spacing, near);
    if let Some(patch) = Patch::fit(mark, near, DENSE * spacing, PatchKind::Plane)
        && Surroundings::of(mark, &patch, near, spacing).longest_gap() <= 1
    {
        return Vec::new();
    }
    // Where what is near is no surface, nobody knows what is in a gap.
    scan.samples().gather(mark, options.fit_radius, near);
    if Patch::fit(mark, near, options.fit_radius, options.patch)
        .is_some_and(|patch| !patch.describes(options.fit_radius))
    {
        return Vec::new();
    }

    landmarks.gather(mark, LOOK * options.fill, near);
    let radius = options.fit_radius.max(REACH * options.fill);
    let Some(patch) = Patch::fit(mark, near, radius, options.patch) else {
        return Vec::new();
    };
    let is_surface = patch.describes(SURENESS * options.fit_radius);
    if !is_surface || !Surroundings::of(mark, &patch, near, spacing).surround() {
        return Vec::new();
    }
    let pitch = PITCH * spacing;
    let farthest = 0.5 * options.fill + pitch;
    let steps = (farthest / pitch) as i32;
    let mut places = Vec::new();
    for i in -steps..=steps {
        for j in -steps..=steps {
            let place = patch.point(f64::from(i) * pitch, f64::from(j) * pitch);
            let own = (place - mark).norm_squared();
            let is_nearer = |other: &Local| (place - other).norm_squared() < own;
            if own > farthest * farthest || scan.is_occupied(place) || near.iter().any(is_nearer) {
                continue;
            }
            let around = Surroundings::of(place, &patch, near, spacing);
            if around.surround() && around.narrowest_way() <= options.fill {
                places.extend(scan.quantization().stored(place));
            }
        }
    }
    places
}

/// How far it is to the nearest sample of a surface in each of eight
/// directions: infinite where there is none.
struct Surroundings {
    nearest: [f64; 8],
}

impl Surroundings {
    fn of(place: Local, patch: &Patch, samples: &[Local], spacing: f64) -> Self {
        let [u, v, _] = patch.coordinates(place);
        let mut nearest = [f64::INFINITY; 8];
        for &sample in samples {
            let [s, t, height] = patch.coordinates(sample);
            let (along, across) = (s - u, t - v);
            let squared = along * along + across * across;
            let is_off = (height - patch.height(s, t)).abs() > THICKNESS * spacing;
            if squared > 0.0 && !is_off {
                let direction = &mut nearest[octant(along, across)];
                *direction = direction.min(squared);
            }
        }
        Self {
            nearest: nearest.map(f64::sqrt),
        }
    }

    /// Most directions in a row without a sample.
    fn longest_gap(&self) -> usize {
        let (mut longest, mut gap) = (0, 0);
        // Twice around, for gaps that begin before the first direction.
        for direction in self.nearest.iter().chain(&self.nearest) {
            gap = if direction.is_infinite() { gap + 1 } else { 0 };
            longest = longest.max(gap);
        }
        longest.min(8)
    }

    /// Whether no half of the plane is without a sample.
    fn surround(&self) -> bool {
        self.longest_gap() <= 2
    }

    /// The least sum of the ways in two opposite directions.
    fn narrowest_way(&self) -> f64 {
        let across = |k: usize| self.nearest[k] + self.nearest[k + 4];
        (0..4).map(across).fold(f64::INFINITY, f64::min)
    }
}

/// The eighth of the plane that `(u, v)` lies in, counted around.
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
    use crate::geometry::{Quantization, spread};

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// Random points of a bent strip of 20 × 20, as many to the unit of area as
    /// `density` says, where `is_scanned`.
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
    fn a_hole_is_closed_if_it_is_no_wider_than_asked_for() {
        let points = || strip(30.0, |x, y| (x - 10.0).hypot(y - 10.0) > 1.4);
        let places = filled(points(), 3.2);
        let is_inside = |p: &&Local| (p.x - 10.0).hypot(p.y - 10.0) < 1.5;
        let inside = places.iter().filter(is_inside).count();
        assert!((8..60).contains(&inside), "{inside}");
        // A voxel without a point happens elsewhere, too.
        assert!(places.len() - inside < 8, "{places:?}");
        for place in &places {
            assert!(
                (place.z - 0.02 * place.x * place.x).abs() < 0.02,
                "{place:?}"
            );
        }
        // No place of the hole is left far from all of them.
        for (x, y) in [(10.0, 10.0), (9.5, 10.5), (10.8, 9.6)] {
            let near = |p: &&Local| (p.x - x).hypot(p.y - y) < 0.5;
            assert!(places.iter().any(|p| near(&p)), "({x}, {y})");
        }
        assert!(filled(points(), 0.0).is_empty());
        let middle = |p: &Local| (p.x - 10.0).hypot(p.y - 10.0) < 0.7;
        assert!(!filled(points(), 1.6).iter().any(middle));
    }

    #[test]
    fn nothing_grows_beyond_a_border() {
        let places = filled(strip(30.0, |_, _| true), 4.0);
        assert!(places.len() < 8, "{places:?}");
        let is_within = |p: &Local| (0.0..20.0).contains(&p.x) && (0.0..20.0).contains(&p.y);
        assert!(places.iter().all(is_within), "{places:?}");
        // Nor into a gap that is too wide.
        let gap = strip(30.0, |x, _| !(8.0..12.5).contains(&x));
        let inside = filled(gap, 3.0)
            .into_iter()
            .filter(|p| (8.3..12.2).contains(&p.x));
        assert_eq!(inside.count(), 0);
    }

    #[test]
    fn a_sparse_scan_is_made_dense() {
        let places = filled(strip(0.6, |_, _| true), 5.0);
        // Some four to the unit of area, but for the border.
        assert!((600..2200).contains(&places.len()), "{}", places.len());
        for place in &places {
            assert!(
                (place.z - 0.02 * place.x * place.x).abs() < 0.05,
                "{place:?}"
            );
        }
    }

    #[test]
    fn octants_go_around() {
        for k in 0..8_u8 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4 + 0.3).sin_cos();
            assert_eq!(octant(cos, sin), usize::from(k));
        }
    }
}
