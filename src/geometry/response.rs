//! The response of the centroid of a cell to small moves of the sites, to first order.
//!
//! Where an edge of a planar cell lies, the bisector moves outwards by
//!
//! ```text
//!   [ y · dx + (n − y) · dn ] / |n|
//! ```
//!
//! at the position y of the edge, as the site moves by dx and the neighbour at n by dn (all seen
//! from the site). The area that it sweeps over moves the centroid C by dC = ∫ (y − C) v(y) dy / A
//! over the edges. The integrand is of degree two, so edge by edge the integral is known:
//! with middle m and way w, |w| ((m − C) ⊗ m + w ⊗ w / 12) before dx.

use super::{Cell, Local, MOST_EDGES, Moments, Patch};

/// A linear map of moves in the plane of a patch: [uu, uv, vu, vv].
type Linear = [f32; 4];

/// The derivatives of the centroid of a cell by the positions of its site and of the neighbours
/// with which it shares edges.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct Response {
    own: Linear,
    neighbors: [Linear; MOST_EDGES],
}

impl Response {
    /// The response of `cell`, which has `moments`, on `patch`; `position` gives that of a
    /// neighbour.
    pub(crate) fn new(
        cell: &Cell,
        moments: &Moments,
        patch: &Patch,
        site: Local,
        position: impl Fn(u32) -> Local,
    ) -> Self {
        let plane = |way: Local| [patch.axes[0].dot(&way), patch.axes[1].dot(&way)];
        let centroid = plane(moments.centroid - site);
        let mut own = [0.0; 4];
        let mut neighbors = [[0.0; 4]; MOST_EDGES];
        for ((edge, from, to), kept) in cell.edges().zip(&mut neighbors) {
            let n = plane(position(edge) - site);
            let way = [to.x - from.x, to.y - from.y];
            let middle = [0.5 * (from.x + to.x), 0.5 * (from.y + to.y)];
            let squares = (way[0] * way[0] + way[1] * way[1]) / (n[0] * n[0] + n[1] * n[1]);
            let factor = squares.sqrt() / moments.area;
            for row in 0..2 {
                let lever = middle[row] - centroid[row];
                for column in 0..2 {
                    let spread = way[row] * way[column] / 12.0;
                    let k = 2 * row + column;
                    own[k] += factor * (lever * middle[column] + spread);
                    kept[k] = (factor * (lever * (n[column] - middle[column]) - spread)) as f32;
                }
            }
        }
        Self {
            own: own.map(|entry| entry as f32),
            neighbors,
        }
    }

    /// The move of the centroid when the site moves by `own` and its neighbours, in the order of
    /// the cell's edges, by `others` (CRS units).
    pub(crate) fn of(
        &self,
        patch: &Patch,
        own: Local,
        others: impl Iterator<Item = Local>,
    ) -> Local {
        let [mut u, mut v] = [0.0; 2];
        let mut add = |map: &Linear, way: Local| {
            let [s, t] = [patch.axes[0].dot(&way), patch.axes[1].dot(&way)];
            let [uu, uv, vu, vv] = map.map(f64::from);
            u += uu * s + uv * t;
            v += vu * s + vv * t;
        };
        add(&self.own, own);
        for (map, way) in self.neighbors.iter().zip(others) {
            add(map, way);
        }
        patch.axes[0] * u + patch.axes[1] * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        BOUNDING_SIDES, spread,
        test_cells::{bent, sorted},
    };

    /// The cell of the first of `sites` among the others, and its moments.
    fn clipped(patch: &Patch, sites: &[Local]) -> (Cell, Moments) {
        let site = sites[0];
        let mut cell = Cell::new();
        let neighbors = sorted(site, &sites[1..]);
        cell.clip(patch, site, &[1.2; BOUNDING_SIDES], &neighbors);
        let moments = cell.moments(patch, site).unwrap();
        (cell, moments)
    }

    /// Clipping anew is the slow twin: the difference grows with the square of the moves, or on
    /// a bent patch with the curvature of the cell.
    #[test]
    fn a_centroid_responds_to_small_moves_as_if_its_cell_were_clipped_anew() {
        let (mut largest, mut wrong) = (0.0_f64, 0);
        for (curvature, tolerance) in [(0.0, 0.0), (0.2, 0.04)] {
            let patch = bent(curvature);
            for seed in 0..60_u64 {
                let roll = |k: u64| spread(1000 * seed + k) as f64 / u64::MAX as f64 - 0.5;
                // An uneven hexagonal lattice.
                let nodes = (-2..=2_i32).flat_map(|i| (-2..=2_i32).map(move |j| (i, j)));
                let mut sites: Vec<Local> = nodes
                    .map(|(i, j)| {
                        let x = f64::from(i) + 0.5 * f64::from(j);
                        let k = 2 * (5 * (i + 2) + j + 2) as u64;
                        let uneven = Local::new(roll(k), roll(k + 1), 0.0) * 0.4;
                        patch.foot_point(Local::new(x, 0.866 * f64::from(j), 0.0) + uneven)
                    })
                    .collect();
                sites.swap(0, 12);
                let (cell, moments) = clipped(&patch, &sites);
                let position = |neighbor: u32| sites[1 + neighbor as usize];
                let response = Response::new(&cell, &moments, &patch, sites[0], position);
                for size in [0.01, 0.04] {
                    let moves: Vec<Local> = (0..sites.len() as u64)
                        .map(|k| Local::new(roll(100 + 2 * k), roll(101 + 2 * k), 0.0) * size)
                        .collect();
                    let moved: Vec<Local> = sites
                        .iter()
                        .zip(&moves)
                        .map(|(&site, way)| patch.foot_point(site + way))
                        .collect();
                    let (_, anew) = clipped(&patch, &moved);
                    let others = cell
                        .neighbors()
                        .map(|neighbor| moves[1 + neighbor as usize]);
                    let followed = moments.centroid + response.of(&patch, moves[0], others);
                    let way = anew.centroid - moments.centroid;
                    let error = anew.centroid - followed;
                    let [way, error] = [way, error].map(|v| v.x.hypot(v.y));
                    let is_right = error <= 2.0 * size * size + tolerance * size;
                    assert!(is_right || curvature > 0.0, "{error} of {way}, seed {seed}");
                    wrong += u32::from(!is_right);
                    largest = largest.max(way / size);
                }
            }
        }
        // Clipping leaves out bits between the corners of a bent patch, now here, now there.
        assert!(wrong <= 6 && largest > 0.2, "{wrong}, {largest}");
    }
}
