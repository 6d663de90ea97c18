//! Clutter: triangles that belong to no surface, most of them between leaves.
//!
//! ```text
//!    \ |/      _\ /        Points in leaves have patches that are trusted a little, each of one leaf. What is between three of
//!   --\_\__|__/_/\--       them lies along none, and leads from one to the other by chance.
//!     / |\ | /|  |
//! ```
//!
//! A triangle **follows** the surface if it lies along that of one of its corners, or if the surface bulges evenly over it: on a
//! sphere or around a pole an edge is a chord, at the same angle to the surface at both ends. A triangle that cuts a sharp edge
//! does not follow the surface, but its neighbours do. In leaves a few triangles follow it by chance.
//!
//! A **region** are triangles that follow the surface and hang together by their edges. One of eight or more is a surface; it stays,
//! with all triangles within two edges of it. One of four to seven stays if no other triangle touches it: it can be a traffic
//! sign. All other triangles are clutter.

use rayon::prelude::*;

use super::{
    Corners,
    edges::EdgeTable,
    holes,
    joined::Joined,
    triangle::{doubled_area, places},
};
use crate::geometry::Local;

/// The cosine of the largest angle between a triangle and a surface that it lies along: 15°.
const COSINE_OF_ALONG: f64 = 0.966;
/// The largest difference between the sines of the angles that an edge has to the surfaces of its ends, where these bulge evenly.
/// With 0.25 hardly more triangles of trees go, and a third more of thin poles.
const LARGEST_DIFFERENCE_OF_SINES: f64 = 0.35;
/// A region of so many triangles is a surface. With 16 nearly twice as many triangles of poles go that are a spacing thick.
const LEAST_OF_A_SURFACE: u32 = 8;
/// A region of so many stays if nothing touches it.
const LEAST_ALONE: u32 = 4;
/// Triangles within so many edges of a surface stay. With one, corners of boxes lose theirs.
const EDGES_AWAY: u32 = 2;
/// How far away corners can be that decide on a triangle, in spacings. Ten triangles in a row decide: the triangle, one between, and
/// eight of a surface. Every second one of them leads one edge farther. What touches a smaller region is nearer: five edges away.
/// No edge is longer than the widest hole that is closed.
pub(super) const REACH: f64 = ((LEAST_OF_A_SURFACE + EDGES_AWAY) / 2 + 1) as f64 * holes::WIDEST;

/// Takes the clutter out of `triangles`, and returns it; the order of the others is kept. There is a normal for each of `positions`
/// that is a corner.
pub(super) fn take(
    positions: &[Local],
    normals: &[Option<Local>],
    triangles: &mut Vec<Corners>,
) -> Vec<Corners> {
    let follows: Vec<bool> = triangles
        .par_iter()
        .map(|&corners| {
            let normals = corners.map(|corner| normals[corner as usize].unwrap_or_default());
            follows_surface(places(positions, corners), normals)
        })
        .collect();
    let edges = EdgeTable::new(triangles);
    let beside = || edges.all().filter_map(|(_, triangles)| triangles.both());
    let mut joined = Joined::new(triangles.len());
    for [(one, _), (other, _)] in beside() {
        if follows[one as usize] && follows[other as usize] {
            joined.join(one, other, false);
        }
    }
    let regions: Vec<u32> = (0..joined.len()).map(|it| joined.root(it).0).collect();
    let mut counts = vec![0_u32; triangles.len()];
    for &region in &regions {
        counts[region as usize] += 1;
    }
    let is_alone = are_alone(positions.len(), triangles, &regions);
    let stays_itself = |&region: &u32| {
        let (count, is_alone) = (counts[region as usize], is_alone[region as usize]);
        count >= LEAST_OF_A_SURFACE || is_alone && count >= LEAST_ALONE
    };
    let mut stays: Vec<bool> = regions.iter().map(stays_itself).collect();
    // Nothing is beside a region alone.
    for _ in 0..EDGES_AWAY {
        let before = stays.clone();
        for [(one, _), (other, _)] in beside() {
            stays[one as usize] |= before[other as usize];
            stays[other as usize] |= before[one as usize];
        }
    }
    let mut stays = stays.into_iter();
    let (kept, clutter) = triangles
        .drain(..)
        .partition(|_| stays.next() == Some(true));
    *triangles = kept;
    clutter
}

/// Whether the triangle between these `corners` follows the surface, whose normals there are given.
fn follows_surface(corners: [Local; 3], normals: [Local; 3]) -> bool {
    let across = doubled_area(corners);
    let normals = normals.map(|normal| match normal.dot(&across) < 0.0 {
        true => -normal,
        false => normal,
    });
    let along = COSINE_OF_ALONG * across.norm();
    let bulges_evenly = || {
        [(0, 1), (1, 2), (2, 0)].into_iter().all(|(one, other)| {
            let chord: Local = corners[other] - corners[one];
            let difference = (normals[one] + normals[other]).dot(&chord);
            difference.abs() <= LARGEST_DIFFERENCE_OF_SINES * chord.norm()
        })
    };
    normals.iter().any(|normal| normal.dot(&across) > along) || bulges_evenly()
}

/// For each triangle that stands for its region whether no triangle of another one touches it; `regions` are those of `triangles`, between so
/// many points.
fn are_alone(points: usize, triangles: &[Corners], regions: &[u32]) -> Vec<bool> {
    let mut first_at = vec![None; points];
    let mut is_alone = vec![true; triangles.len()];
    for (&region, triangle) in regions.iter().zip(triangles) {
        for &corner in triangle {
            let first = *first_at[corner as usize].get_or_insert(region);
            if first != region {
                is_alone[first as usize] = false;
                is_alone[region as usize] = false;
            }
        }
    }
    is_alone
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points with normals, and triangles between them.
    #[derive(Default)]
    struct Mesh {
        positions: Vec<Local>,
        normals: Vec<Option<Local>>,
        triangles: Vec<Corners>,
    }

    impl Mesh {
        /// Adds a band of `steps` steps with two triangles each between two rows; `at` gives position and normal of the point of a
        /// row (0 or 1) after so many steps.
        fn band(mut self, steps: u32, at: impl Fn(u32, u32) -> (Local, Local)) -> Self {
            let first = self.positions.len() as u32;
            for (step, row) in (0..=steps).flat_map(|step| [(step, 0), (step, 1)]) {
                let (position, normal) = at(row, step);
                self.positions.push(position);
                self.normals.push(Some(normal));
            }
            for corner in (first..first + 2 * steps).step_by(2) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| corner + k);
                self.triangles.extend([[a, b, c], [b, c, d]]);
            }
            self
        }

        /// How many triangles are left.
        fn left(mut self) -> usize {
            let all = self.triangles.len();
            let clutter = take(&self.positions, &self.normals, &mut self.triangles);
            assert_eq!(clutter.len() + self.triangles.len(), all);
            self.triangles.len()
        }
    }

    /// A point of a band on the ground at `y`, with a normal that is tilted by `tilts` radians along the band, as the number of the point says.
    fn on_ground<const N: usize>(y: f64, tilts: [f64; N]) -> impl Fn(u32, u32) -> (Local, Local) {
        move |row, step| {
            let tilt = tilts[(2 * step + row) as usize % N];
            let position = Local::new(f64::from(step), y + f64::from(row), 0.0);
            (position, Local::new(tilt.sin(), 0.0, tilt.cos()))
        }
    }

    #[test]
    fn a_surface_and_a_sign_stay_and_scraps_go() {
        let flat = |steps: u32| Mesh::default().band(steps, on_ground(0.0, [0.0])).left();
        assert_eq!([flat(1), flat(2), flat(8)], [0, 4, 16]);
        // A triangle at the border of leaves touches a corner of the band.
        let touched = |steps: u32| {
            let mut mesh = Mesh::default()
                .band(steps, on_ground(0.0, [0.0]))
                .band(1, on_ground(2.0, [0.6, -0.9]));
            let leaf = 2 * steps + 2;
            mesh.triangles.push([1, leaf, leaf + 2]);
            mesh.left()
        };
        assert_eq!([touched(2), touched(3), touched(4)], [0, 0, 8]);
    }

    #[test]
    fn triangles_between_leaves_go_but_for_those_beside_a_surface() {
        let tilts = [0.5, -0.9, 1.2, -0.4, 0.8, -1.3];
        let mut leaves = Mesh::default().band(20, on_ground(0.0, tilts));
        assert_eq!(leaves.triangles.len(), 40);
        // The wall stands on the first edge of the band.
        let wall = |row: u32, step: u32| {
            let position = Local::new(0.0, f64::from(row), f64::from(step));
            (position, Local::x())
        };
        let first = leaves.positions.len() as u32;
        leaves = leaves.band(8, wall);
        let is_at_bottom = |corner: u32| corner == first || corner == first + 1;
        for corner in leaves.triangles.iter_mut().flatten() {
            if is_at_bottom(*corner) {
                *corner -= first;
            }
        }
        assert_eq!(leaves.left(), 16 + 2);
    }

    #[test]
    fn a_pole_stays_around_which_the_surface_turns_by_right_angles() {
        let around = |row: u32, step: u32| {
            let angle = std::f64::consts::FRAC_PI_2 * f64::from(step);
            let normal = Local::new(angle.cos(), angle.sin(), 0.0);
            (0.6 * normal + Local::z() * f64::from(row), normal)
        };
        assert_eq!(Mesh::default().band(4, around).left(), 8);
    }

    #[test]
    fn a_triangle_along_the_surface_of_one_corner_follows_it() {
        // Every third pair of points has the normal of a wall.
        let beside_walls = on_ground(0.0, [0.0, 0.0, 0.0, 0.0, 1.57, 1.57]);
        assert_eq!(Mesh::default().band(30, beside_walls).left(), 60);
    }
}
