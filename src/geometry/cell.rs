//! A restricted Voronoi cell: the part of a patch nearer to its site than to
//! any other.
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, section III-C:
//! a bounding polygon is clipped by the bisectors between the site and its
//! neighbours, nearest first, until none can cut any more.
//!
//! ```text
//!        ______              the bounding polygon: a dodecagon
//!      /   |    \
//!     |----+-    \           a bisector cuts off what is nearer to its
//!     |    | x    |          neighbour; its edge remembers which one
//!      \   |     /
//!        ‾‾‾‾‾‾
//! ```
//!
//! The *security radius* ends it: no neighbour farther than twice the largest
//! distance from the site to a corner can cut (Lévy and Bonneel, *Variational
//! anisotropic surface meshing with Voronoi parallel linear enumeration*,
//! 2012). Corners lie on the patch, so the cell bends with it: bisectors are
//! planes of space, applied to lifted corners. Between corners the cell is
//! flat; a cell is small beside the surface's radius of curvature or the patch
//! would not describe it.

use super::{
    Local, Neighbor, Patch,
    bisector::{Bisector, lift},
    bounding::{Reach, bounding_corners},
    heights::Heights,
};

/// A cut that would give a cell more corners is not made. A cell has six, rarely more than ten.
const MAX_CORNERS: usize = 40;
/// Stands for the bounding polygon in place of a neighbour.
const RIM: u32 = u32::MAX;

/// Edges of a cell that are remembered, closed at once and followed; it has six, rarely more
/// than nine.
pub(crate) const MOST_EDGES: usize = 10;

/// A corner of a cell, and the edge that begins there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// The position in the patch's frame, seen from the site (CRS units).
    pub(super) position: Local,
    /// The neighbour whose bisector the edge from this corner to the next lies on, or [`RIM`].
    pub(super) edge: u32,
}

/// The restricted Voronoi cell of a site: a polygon with corners on the patch.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The polygon, and room for the result of the next cut.
    pub(super) polygons: [[Corner; MAX_CORNERS]; 2],
    /// The index of the polygon among the two.
    pub(super) current: usize,
    pub(super) count: usize,
}

impl Default for Cell {
    fn default() -> Self {
        Self::new()
    }
}

impl Cell {
    /// An empty cell, to be filled by [`clip`](Self::clip) again and again:
    /// nothing is allocated per seed.
    pub fn new() -> Self {
        let nowhere = Corner {
            position: Local::zeros(),
            edge: RIM,
        };
        Self {
            polygons: [[nowhere; MAX_CORNERS]; 2],
            current: 0,
            count: 0,
        }
    }

    /// Computes the cell of `site` on `patch`, within the bounding polygon of `reach`.
    ///
    /// `neighbors` must contain every other site within twice the distance to the farthest
    /// corner of the lifted bounding polygon, and be sorted by distance.
    pub fn clip(&mut self, patch: &Patch, site: Local, reach: &Reach, neighbors: &[Neighbor]) {
        let surface = patch.heights_from(site);
        let corners = bounding_corners().into_iter().zip(reach);
        self.start(corners.map(|([cos, sin], reach)| lift(&surface, reach * cos, reach * sin)));
        self.cut_by_all(patch, site, &surface, neighbors);
    }

    /// Computes the cell of `site` on `patch` in fewer steps, if neighbours bound it all around
    /// within `radius` of the site (CRS units); `false` if they do not.
    ///
    /// `neighbors` must contain every other site within twice `radius`, and be sorted
    /// by distance.
    pub fn clip_within(
        &mut self,
        patch: &Patch,
        site: Local,
        radius: f64,
        neighbors: &[Neighbor],
    ) -> bool {
        let surface = patch.heights_from(site);
        // A square around the disc has a third of the corners of the bounding polygon.
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter();
        self.start(square.map(|[u, v]| lift(&surface, radius * u, radius * v)));
        self.cut_by_all(patch, site, &surface, neighbors);
        self.is_closed() && self.farthest_squared() <= radius * radius
    }

    /// Clips the cell further, by `neighbors` that are farther than those that it was clipped
    /// by, and sorted by distance.
    pub(crate) fn clip_on(&mut self, patch: &Patch, site: Local, neighbors: &[Neighbor]) {
        self.cut_by_all(patch, site, &patch.heights_from(site), neighbors);
    }

    /// Begins with the polygon of `corners`.
    fn start(&mut self, corners: impl Iterator<Item = Local>) {
        self.current = 0;
        self.count = 0;
        for position in corners {
            self.polygons[0][self.count] = Corner {
                position,
                edge: RIM,
            };
            self.count += 1;
        }
    }

    /// Cuts by `neighbors`, which are sorted by distance, until none can cut any more.
    fn cut_by_all(
        &mut self,
        patch: &Patch,
        site: Local,
        surface: &Heights,
        neighbors: &[Neighbor],
    ) {
        let mut security = self.security_squared();
        for neighbor in neighbors {
            if neighbor.distance_squared > security {
                break;
            }
            // A coincident site has no bisector: the two share their cell.
            if neighbor.distance_squared > 0.0
                && self.cut_by(neighbor, &Bisector::new(patch, site, neighbor), surface)
            {
                security = self.security_squared();
            }
        }
    }

    /// Cuts off the part that is nearer to `neighbor`; whether there was any.
    pub(super) fn cut_by(
        &mut self,
        neighbor: &Neighbor,
        bisector: &Bisector,
        surface: &Heights,
    ) -> bool {
        let count = self.count;
        let (first, second) = self.polygons.split_at_mut(1);
        let (corners, cut) = if self.current == 0 {
            (&first[0], &mut second[0])
        } else {
            (&second[0], &mut first[0])
        };
        // Positive beyond the bisector.
        let mut sides = [0.0_f64; MAX_CORNERS];
        let mut farthest = f64::NEG_INFINITY;
        for (side, corner) in sides.iter_mut().zip(&corners[..count]) {
            *side = bisector.beyond(corner.position);
            farthest = farthest.max(*side);
        }
        if farthest <= 0.0 {
            return false;
        }
        let mut kept = 0;
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            let (here, there) = (&corners[k], &corners[next]);
            if kept + 2 > MAX_CORNERS {
                return false;
            }
            if sides[k] <= 0.0 {
                cut[kept] = *here;
                kept += 1;
            }
            if (sides[k] <= 0.0) != (sides[next] <= 0.0) {
                let ends = [here.position, there.position];
                cut[kept] = Corner {
                    position: bisector.crossing(ends, [sides[k], sides[next]], surface),
                    // Leaving the kept side, the new edge is the neighbour's.
                    edge: if sides[k] <= 0.0 {
                        neighbor.index
                    } else {
                        here.edge
                    },
                };
                kept += 1;
            }
        }
        self.current = 1 - self.current;
        self.count = kept;
        true
    }

    #[inline]
    fn corners(&self) -> &[Corner] {
        &self.polygons[self.current][..self.count]
    }

    /// The sides of the polygon, from corner to corner, seen from the site.
    #[inline]
    pub(super) fn sides(&self) -> impl Iterator<Item = (Local, Local)> + '_ {
        let corners = self.corners();
        corners.iter().enumerate().map(move |(k, corner)| {
            let next = if k + 1 == corners.len() { 0 } else { k + 1 };
            (corner.position, corners[next].position)
        })
    }

    #[inline]
    fn farthest_squared(&self) -> f64 {
        self.corners()
            .iter()
            .map(|c| c.position.norm_squared())
            .fold(0.0, f64::max)
    }

    /// Square of the security radius: no site farther away than this can cut
    /// the cell as it is.
    #[inline]
    pub(crate) fn security_squared(&self) -> f64 {
        4.0 * self.farthest_squared()
    }

    /// Whether neighbours bound the cell all around: no edge is the bounding polygon's.
    #[inline]
    pub(crate) fn is_closed(&self) -> bool {
        self.count >= 3 && self.corners().iter().all(|c| c.edge != RIM)
    }

    /// Number of edges that lie on bisectors with neighbours.
    pub(crate) fn neighbor_count(&self) -> usize {
        self.neighbors().count()
    }

    /// The neighbours whose bisectors are edges of the cell.
    pub fn neighbors(&self) -> impl Iterator<Item = u32> + '_ {
        self.corners()
            .iter()
            .map(|c| c.edge)
            .filter(|&edge| edge != RIM)
    }

    /// The neighbour that bounds each edge, counter-clockwise as seen from the tip of the
    /// patch's third axis; `None` for the edges of the bounding polygon.
    pub(crate) fn edge_neighbors(
        &self,
    ) -> impl DoubleEndedIterator<Item = Option<u32>> + ExactSizeIterator + '_ {
        let edges = self.corners().iter().map(|corner| corner.edge);
        edges.map(|edge| (edge != RIM).then_some(edge))
    }

    /// The edges that lie on bisectors: the neighbour, and both ends in the frame of the patch,
    /// seen from the site.
    #[inline]
    pub(super) fn edges(&self) -> impl Iterator<Item = (u32, Local, Local)> + '_ {
        let edges = self.corners().iter().map(|corner| corner.edge);
        edges
            .zip(self.sides())
            .filter(|&(edge, _)| edge != RIM)
            .map(|(edge, (from, to))| (edge, from, to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        BOUNDING_SIDES,
        test_cells::{bent, flat, hexagonal, sorted},
    };

    #[test]
    fn the_cell_of_a_hexagonal_lattice_is_the_regular_hexagon() {
        let (patch, site) = (flat(), Local::zeros());
        let mut cell = Cell::new();
        cell.clip(
            &patch,
            site,
            &[1.0; BOUNDING_SIDES],
            &sorted(site, &hexagonal(4)),
        );
        let moments = cell.moments(&patch, site).unwrap();
        let area = 0.75_f64.sqrt();
        assert!(cell.is_closed());
        assert_eq!(cell.neighbor_count(), 6);
        assert!((moments.area - area).abs() < 1e-9);
        assert!(moments.centroid.norm() < 1e-9);
        // 5√3/54 times the square of the area: the energy of the hexagon.
        let hexagon = 5.0 * 3.0_f64.sqrt() / 54.0;
        assert!((moments.energy / (area * area) - hexagon).abs() < 1e-6);
    }

    /// Clipping the bounding polygon is the slow twin of clipping a square.
    #[test]
    fn a_cell_bounded_by_neighbors_is_the_same_from_a_square() {
        for (curvature, tolerance) in [(0.0, 1e-12), (0.1, 1e-3)] {
            let patch = bent(curvature);
            let mut met = 0;
            for seed in 0..40_u64 {
                let roll =
                    |k: u64| crate::geometry::spread(100 * seed + k) as f64 / u64::MAX as f64;
                let moved = |(k, position): (u64, Local)| {
                    let by = Local::new(roll(2 * k) - 0.5, roll(2 * k + 1) - 0.5, 0.0) * 0.3;
                    patch.foot_point(position + by)
                };
                let others: Vec<Local> = (0..).zip(hexagonal(3)).map(moved).collect();
                let site = patch.foot_point(Local::zeros());
                let neighbors = sorted(site, &others);
                let (mut cell, mut twin) = (Cell::new(), Cell::new());
                twin.clip(&patch, site, &[1.0; BOUNDING_SIDES], &neighbors);
                if cell.clip_within(&patch, site, 0.8, &neighbors) {
                    met += 1;
                    let [own, other] = [&cell, &twin].map(|c| c.moments(&patch, site).unwrap());
                    assert!((own.area - other.area).abs() < tolerance);
                    assert!((own.centroid - other.centroid).norm() < tolerance);
                    assert_eq!(cell.neighbor_count(), twin.neighbor_count());
                } else {
                    assert!(!twin.is_closed() || twin.security_squared() > 1.6 * 1.6 - 1e-9);
                }
            }
            assert!(met > 20, "{met}");
        }
    }

    /// Where a bent patch crosses a bisector is a root, not the chord's share.
    #[test]
    fn corners_on_a_bent_patch_are_as_far_from_the_neighbors_as_from_the_site() {
        let patch = bent(1.2);
        let site = patch.foot_point(Local::zeros());
        let other = patch.foot_point(Local::new(0.7, 0.4, 0.0));
        let mut cell = Cell::new();
        cell.clip(
            &patch,
            site,
            &[1.0; BOUNDING_SIDES],
            &sorted(site, &[other]),
        );
        let mut met = 0;
        for corner in cell.corners() {
            let position = site
                + patch.axes[0] * corner.position.x
                + patch.axes[1] * corner.position.y
                + patch.axes[2] * corner.position.z;
            let off = (position - site).norm() - (position - other).norm();
            assert!(off < 1e-9);
            met += usize::from(off.abs() < 1e-9);
        }
        assert_eq!(met, 2);
    }

    #[test]
    fn sites_beyond_the_security_radius_change_nothing() {
        let (patch, site) = (flat(), Local::zeros());
        let (mut near, mut far) = (Cell::new(), Cell::new());
        near.clip(
            &patch,
            site,
            &[1.0; BOUNDING_SIDES],
            &sorted(site, &hexagonal(1)),
        );
        far.clip(
            &patch,
            site,
            &[1.0; BOUNDING_SIDES],
            &sorted(site, &hexagonal(6)),
        );
        assert_eq!(near.moments(&patch, site), far.moments(&patch, site));
        assert!(far.security_squared() < 1.4);
    }

    #[test]
    fn a_lonely_site_keeps_its_bounding_polygon() {
        let (patch, site) = (flat(), Local::zeros());
        let mut cell = Cell::new();
        cell.clip(&patch, site, &[1.0; BOUNDING_SIDES], &[]);
        let moments = cell.moments(&patch, site).unwrap();
        assert!(!cell.is_closed());
        // The regular dodecagon of circumradius 1 has area 3.
        assert!((moments.area - 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_coincident_site_is_survived() {
        let (patch, site) = (flat(), Local::zeros());
        let mut sites = hexagonal(3);
        sites.push(site);
        let mut cell = Cell::new();
        cell.clip(&patch, site, &[1.0; BOUNDING_SIDES], &sorted(site, &sites));
        assert!(cell.moments(&patch, site).unwrap().area > 0.8);
    }

    /// The slow twin gives each pixel of a fine raster to its nearest site.
    #[test]
    fn cells_match_a_raster_of_nearest_sites() {
        let patch = flat();
        let site = Local::new(0.1, -0.05, 0.0);
        let others: Vec<Local> = (0..40u64)
            .map(|i| {
                let unit = |k| crate::geometry::spread(k) as f64 / u64::MAX as f64 - 0.5;
                Local::new(unit(2 * i), unit(2 * i + 1), 0.0) * 4.0
            })
            .collect();
        let mut cell = Cell::new();
        cell.clip(&patch, site, &[1.2; BOUNDING_SIDES], &sorted(site, &others));
        let moments = cell.moments(&patch, site).unwrap();

        let (mut area, mut centroid) = (0.0, Local::zeros());
        let step = 0.004;
        for i in -400..=400 {
            for j in -400..=400 {
                let x = site + Local::new(f64::from(i), f64::from(j), 0.0) * step;
                let own = (x - site).norm_squared();
                if others.iter().all(|o| (x - o).norm_squared() > own) {
                    area += step * step;
                    centroid += x * (step * step);
                }
            }
        }
        assert!(cell.is_closed());
        assert!((moments.area - area).abs() < 0.01);
        assert!((moments.centroid - centroid / area).norm() < 0.01);
    }
}
