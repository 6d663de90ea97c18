//! A restricted Voronoi cell: the part of a patch nearer to its site than to
//! any other.
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, section III-C:
//! the patch's domain is clipped by the bisectors between the site and its
//! neighbours, nearest first, until none can cut any more.
//!
//! ```text
//!        ______              the domain: a dodecagon about the site
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
    bisector::{Bisector, lift, meeting},
    patch::Heights,
};

/// Sides of the domain before anything is cut off.
pub const BOUNDING_SIDES: usize = 12;

/// How far a domain reaches from the site towards each of its corners (CRS
/// units).
pub(crate) type Reach = [f64; BOUNDING_SIDES];
/// Every cut adds at most one corner; a cell with more sides is not met before
/// the neighbours that could make it run out.
const MAX_CORNERS: usize = 40;
/// Stands for the domain's rim where a neighbour is asked for.
const RIM: u32 = u32::MAX;

/// Edges of a cell that are remembered, closed at once and followed; it has six, rarely more
/// than nine.
pub(crate) const MOST_EDGES: usize = 10;

#[derive(Clone, Copy, Debug)]
struct Corner {
    /// In the patch's frame, from the site.
    position: Local,
    /// Who cut the edge from this corner to the next.
    edge: u32,
}

/// The restricted Voronoi cell of a site: a polygon with corners on the patch.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The polygon, and room for what the next cut leaves of it.
    polygons: [[Corner; MAX_CORNERS]; 2],
    /// Which of the two is the polygon.
    current: usize,
    count: usize,
}

/// What a Lloyd step and the figures of uniformity need of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Area (CRS units squared).
    pub area: f64,
    /// Centroid, not projected: inside the cell's hull, perhaps off the patch.
    pub centroid: Local,
    /// ∫ |x − site|² over the cell: its share of the energy (paper, eq. 2).
    pub energy: f64,
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

    /// Computes the cell of `site` on `patch`, within the domain of `reach`.
    ///
    /// `neighbors` must hold every other site within twice the distance to the
    /// farthest corner of the lifted domain, and be sorted by distance.
    pub fn clip(&mut self, patch: &Patch, site: Local, reach: &Reach, neighbors: &[Neighbor]) {
        let surface = patch.heights_from(site);
        let corners = bounding_corners().into_iter().zip(reach);
        self.start(corners.map(|([cos, sin], reach)| lift(&surface, reach * cos, reach * sin)));
        self.cut_by_all(patch, site, &surface, neighbors);
    }

    /// The same for a cell that is bounded by neighbours all around, within
    /// `radius` of the site, and in fewer steps; `false` if it is not.
    ///
    /// `neighbors` must hold every other site within twice `radius`, and be sorted
    /// by distance.
    pub fn clip_within(
        &mut self,
        patch: &Patch,
        site: Local,
        radius: f64,
        neighbors: &[Neighbor],
    ) -> bool {
        let surface = patch.heights_from(site);
        // A square about the disc has a third of a domain's corners.
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter();
        self.start(square.map(|[u, v]| lift(&surface, radius * u, radius * v)));
        self.cut_by_all(patch, site, &surface, neighbors);
        self.is_closed() && self.farthest_squared() <= radius * radius
    }

    /// The same where the cell is known to have had edges with the neighbours of
    /// `ring`, counter-clockwise, not long ago: its corners are where the bisectors
    /// of two that follow each other meet, but for few that came or went. `false` if
    /// that does not lead to a cell within `radius`. What `ring` held
    /// is lost.
    ///
    /// `neighbors` must hold every other site within twice `radius`.
    pub fn close(
        &mut self,
        patch: &Patch,
        site: Local,
        radius: f64,
        ring: &mut Vec<Neighbor>,
        neighbors: &[Neighbor],
    ) -> bool {
        let surface = patch.heights_from(site);
        if !self.close_ring(patch, site, &surface, radius, ring) {
            return false;
        }
        // What else can cut off a corner, in an order that does not depend on the caller's.
        let security = self.security_squared();
        let is_other = |neighbor: &&Neighbor| {
            neighbor.distance_squared <= security
                && neighbor.distance_squared > 0.0
                && self.neighbors().all(|edge| edge != neighbor.index)
        };
        ring.clear();
        ring.extend(neighbors.iter().filter(is_other));
        Neighbor::sort(ring);
        for neighbor in &*ring {
            self.cut_by(neighbor, &Bisector::new(patch, site, neighbor), &surface);
        }
        true
    }

    /// The polygon between the bisectors of `ring`, less those that have no edge any
    /// more.
    fn close_ring(
        &mut self,
        patch: &Patch,
        site: Local,
        surface: &Heights,
        radius: f64,
        ring: &mut Vec<Neighbor>,
    ) -> bool {
        if ring.len() > MOST_EDGES {
            return false;
        }
        let mut bisectors = [Bisector::default(); MOST_EDGES];
        for (bisector, neighbor) in bisectors.iter_mut().zip(&*ring) {
            *bisector = Bisector::new(patch, site, neighbor);
        }
        while ring.len() >= 3 {
            let count = ring.len();
            let bisectors = &mut bisectors[..count];
            if !self.meet_around(bisectors, ring, surface, radius) {
                return false;
            }
            let corners = &self.polygons[0][..count];
            // Each edge must run counter-clockwise still.
            let is_behind = |&k: &usize| {
                let before = if k == 0 { count - 1 } else { k - 1 };
                let way = corners[k].position - corners[before].position;
                let towards = bisectors[k].direction;
                towards.x * way.y - towards.y * way.x <= 0.0
            };
            let Some(gone) = (0..count).find(is_behind) else {
                return true;
            };
            ring.remove(gone);
            bisectors[gone..].rotate_left(1);
        }
        false
    }

    /// Makes a polygon of the places where each of `bisectors` meets the next;
    /// `false` if one of them does not, or beyond `radius`.
    fn meet_around(
        &mut self,
        bisectors: &[Bisector],
        ring: &[Neighbor],
        surface: &Heights,
        radius: f64,
    ) -> bool {
        let count = ring.len();
        self.current = 0;
        self.count = count;
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            match meeting(&bisectors[k], &bisectors[next], surface, radius) {
                Some(position) if position.norm_squared() <= radius * radius => {
                    self.polygons[0][k] = Corner {
                        position,
                        edge: ring[next].index,
                    };
                }
                _ => return false,
            }
        }
        true
    }

    /// Clips the cell on, by `neighbors` that are farther than those that did before, and
    /// sorted by distance, too.
    pub(crate) fn clip_on(&mut self, patch: &Patch, site: Local, neighbors: &[Neighbor]) {
        self.cut_by_all(patch, site, &patch.heights_from(site), neighbors);
    }

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

    /// Cuts off what is nearer to `neighbor`; whether anything was.
    fn cut_by(&mut self, neighbor: &Neighbor, bisector: &Bisector, surface: &Heights) -> bool {
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
        if farthest <= 0.0 || count + 2 > MAX_CORNERS {
            return false;
        }
        let mut kept = 0;
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            let (here, there) = (&corners[k], &corners[next]);
            if sides[k] <= 0.0 {
                cut[kept] = *here;
                kept += 1;
            }
            if (sides[k] <= 0.0) != (sides[next] <= 0.0) {
                let way = there.position - here.position;
                // Over a straight way the patch is a parabola, and so is the
                // distance from the bisector, with one root between the ends.
                let bend = surface.bend(way.x, way.y) * bisector.direction.z;
                let half = 0.5 * (sides[next] - sides[k] - bend);
                let root = (half * half - bend * sides[k]).max(0.0).sqrt();
                let sum = -(half + root.copysign(half));
                let [one, other] = [sides[k] / sum, sum / bend];
                let t = if (0.0..=1.0).contains(&one) {
                    one
                } else {
                    other.clamp(0.0, 1.0)
                };
                cut[kept] = Corner {
                    position: lift(
                        surface,
                        here.position.x + way.x * t,
                        here.position.y + way.y * t,
                    ),
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

    fn corners(&self) -> &[Corner] {
        &self.polygons[self.current][..self.count]
    }

    /// The sides of the polygon, from corner to corner.
    fn sides(&self) -> impl Iterator<Item = (Local, Local)> + '_ {
        let corners = self.corners();
        corners.iter().enumerate().map(move |(k, corner)| {
            let next = if k + 1 == corners.len() { 0 } else { k + 1 };
            (corner.position, corners[next].position)
        })
    }

    fn farthest_squared(&self) -> f64 {
        self.corners()
            .iter()
            .map(|c| c.position.norm_squared())
            .fold(0.0, f64::max)
    }

    /// Square of the security radius: no site farther away than this can cut
    /// the cell as it is.
    pub(crate) fn security_squared(&self) -> f64 {
        4.0 * self.farthest_squared()
    }

    /// A place of the cell, on the patch: even over the cell for `dice` even
    /// in [0, 1)²; `None` if nothing is left of the cell.
    pub(crate) fn place(&self, patch: &Patch, site: Local, dice: [f64; 2]) -> Option<Local> {
        let [u, v, w] = patch.coordinates(site);
        let foot = Local::new(0.0, 0.0, patch.height(u, v) - w);
        let twice_area = |a: Local, b: Local| (a - foot).cross(&(b - foot)).norm();
        let total: f64 = self.sides().map(|(a, b)| twice_area(a, b)).sum();
        let mut rest = dice[0] * total;
        for (a, b) in self.sides() {
            let area = twice_area(a, b);
            if rest < area {
                // Evenly over the triangle: the root spreads along the fan.
                let along = (rest / area).sqrt();
                let x = foot + (a - foot) * along + (b - a) * (along * dice[1]);
                return Some(patch.point(u + x.x, v + x.y));
            }
            rest -= area;
        }
        None
    }

    /// Whether neighbours bound the cell all around: no edge is the domain's.
    pub(crate) fn is_closed(&self) -> bool {
        self.count >= 3 && self.corners().iter().all(|c| c.edge != RIM)
    }

    /// Number of edges that neighbours made.
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

    /// The edges that neighbours made: whose, and from where to where, in the frame of
    /// the patch, from the site.
    pub(super) fn edges(&self) -> impl Iterator<Item = (u32, Local, Local)> + '_ {
        let edges = self.corners().iter().map(|corner| corner.edge);
        edges
            .zip(self.sides())
            .filter(|&(edge, _)| edge != RIM)
            .map(|(edge, (from, to))| (edge, from, to))
    }

    /// Area, centroid and energy of the cell of `site`, as the fan of
    /// triangles from the site's foot; `None` if nothing is left of it.
    pub fn moments(&self, patch: &Patch, site: Local) -> Option<Moments> {
        let foot = lift(&patch.heights_from(site), 0.0, 0.0);
        let (mut area, mut weighted, mut energy) = (0.0, Local::zeros(), 0.0);
        for (a, b) in self.sides() {
            let triangle = 0.5 * (a - foot).cross(&(b - foot)).norm();
            area += triangle;
            weighted += (a + b + foot) * (triangle / 3.0);
            energy += triangle / 6.0
                * (a.dot(&a)
                    + b.dot(&b)
                    + foot.dot(&foot)
                    + a.dot(&b)
                    + b.dot(&foot)
                    + foot.dot(&a));
        }
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let c = weighted / area;
        Some(Moments {
            area,
            centroid: site + patch.axes[0] * c.x + patch.axes[1] * c.y + patch.axes[2] * c.z,
            energy,
        })
    }
}

/// Directions to the corners of a domain, as `[u, v]` in the frame of the patch.
pub(crate) fn bounding_corners() -> [[f64; 2]; BOUNDING_SIDES] {
    // cos and sin of multiples of 30°, written out: the same bits on every
    // machine, whatever its mathematics library.
    const S: f64 = 0.866_025_403_784_438_6;
    [
        [1.0, 0.0],
        [S, 0.5],
        [0.5, S],
        [0.0, 1.0],
        [-0.5, S],
        [-S, 0.5],
        [-1.0, 0.0],
        [-S, -0.5],
        [-0.5, -S],
        [0.0, -1.0],
        [0.5, -S],
        [S, -0.5],
    ]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::PatchKind;

    fn flat() -> Patch {
        let grid: Vec<Local> = (-5..=5)
            .flat_map(|i| (-5..=5).map(move |j| Local::new(f64::from(i), f64::from(j), 0.0) * 0.3))
            .collect();
        Patch::fit(Local::zeros(), &grid, 2.0, PatchKind::Quadratic).unwrap()
    }

    /// `others` by their distance from `site`, each with its place among them.
    pub(in crate::geometry) fn sorted(site: Local, others: &[Local]) -> Vec<Neighbor> {
        let mut neighbors: Vec<Neighbor> = (0..)
            .zip(others)
            .map(|(index, &position)| Neighbor {
                distance_squared: (position - site).norm_squared(),
                index,
                position,
            })
            .collect();
        neighbors.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
        neighbors
    }

    fn hexagonal(rings: i32) -> Vec<Local> {
        let mut sites = Vec::new();
        for i in -rings..=rings {
            for j in -rings..=rings {
                if (i, j) != (0, 0) {
                    sites.push(Local::new(
                        f64::from(i) + 0.5 * f64::from(j),
                        f64::from(j) * 0.75_f64.sqrt(),
                        0.0,
                    ));
                }
            }
        }
        sites
    }

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

    /// A paraboloid of `curvature` about the z axis.
    pub(in crate::geometry) fn bent(curvature: f64) -> Patch {
        let place = |i: i32, j: i32| {
            let (x, y) = (0.3 * f64::from(i), 0.3 * f64::from(j));
            Local::new(x, y, 0.5 * curvature * (x * x + y * y))
        };
        let grid: Vec<Local> = (-5..=5)
            .flat_map(|i| (-5..=5).map(move |j| place(i, j)))
            .collect();
        Patch::fit(Local::zeros(), &grid, 2.0, PatchKind::Quadratic).unwrap()
    }

    /// The domain's way is the slow twin of the square's.
    #[test]
    fn a_cell_bounded_by_neighbors_is_the_same_from_a_square() {
        for (curvature, tolerance) in [(0.0, 1e-12), (0.1, 1e-3)] {
            let patch = bent(curvature);
            let mut met = 0;
            for seed in 0..40_u64 {
                let roll =
                    |k: u64| crate::geometry::spread(100 * seed + k) as f64 / u64::MAX as f64;
                let moved = |(k, place): (u64, Local)| {
                    let by = Local::new(roll(2 * k) - 0.5, roll(2 * k + 1) - 0.5, 0.0) * 0.3;
                    patch.foot_point(place + by)
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

    /// Clipping is the slow twin of closing; on a bent patch its corners lie on chords.
    #[test]
    fn a_cell_closed_where_it_was_is_the_same_as_a_clipped_one() {
        for (curvature, tolerance) in [(0.0, 1e-12), (0.1, 1e-2)] {
            let patch = bent(curvature);
            let (mut met, mut changed) = (0, 0);
            for seed in 0..80_u64 {
                let roll =
                    |k: u64| crate::geometry::spread(100 * seed + k) as f64 / u64::MAX as f64;
                let moved = |by: f64, shift: u64| {
                    let moved = |(k, place): (u64, Local)| {
                        let [x, y] = [2 * k, 2 * k + 1].map(|k| roll(k + shift) - 0.5);
                        patch.foot_point(place + Local::new(x, y, 0.0) * by)
                    };
                    (0..).zip(hexagonal(3)).map(moved).collect::<Vec<Local>>()
                };
                let site = patch.foot_point(Local::zeros());
                let (mut cell, mut twin) = (Cell::new(), Cell::new());
                let reach = [1.0; BOUNDING_SIDES];
                twin.clip(&patch, site, &reach, &sorted(site, &moved(0.6, 0)));
                let links: Vec<u32> = twin.neighbors().collect();
                let neighbors = sorted(site, &moved(0.7, 9));
                twin.clip(&patch, site, &reach, &neighbors);
                let linked = |&link: &u32| *neighbors.iter().find(|n| n.index == link).unwrap();
                let mut ring: Vec<Neighbor> = links.iter().map(linked).collect();
                if !cell.close(&patch, site, 0.8, &mut ring, &neighbors) {
                    continue;
                }
                met += 1;
                let [own, other] = [&cell, &twin].map(|c| c.moments(&patch, site).unwrap());
                assert!((own.area - other.area).abs() < tolerance);
                assert!((own.centroid - other.centroid).norm() < tolerance);
                let sorted_neighbors = |cell: &Cell| {
                    let mut neighbors: Vec<u32> = cell.neighbors().collect();
                    neighbors.sort_unstable();
                    neighbors
                };
                let now = sorted_neighbors(&cell);
                assert!(curvature > 0.0 || now == sorted_neighbors(&twin));
                let mut before = links;
                before.sort_unstable();
                changed += usize::from(now != before);
            }
            assert!(met > 30 && changed > 5, "{met}, {changed}");
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
            let place = site
                + patch.axes[0] * corner.position.x
                + patch.axes[1] * corner.position.y
                + patch.axes[2] * corner.position.z;
            let off = (place - site).norm() - (place - other).norm();
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
    fn a_lonely_site_keeps_its_domain_open() {
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

    /// The naive twin: a fine raster of the domain, each pixel given to its
    /// nearest site.
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
