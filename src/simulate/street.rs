//! The street as a whole: the first surface on a ray, and distances to surfaces and edges.

use super::{
    bins::{BIN_EDGE, BINNED_HALF_WIDTH, Bins},
    blocks::build,
    edges::Edges,
    options::StreetOptions,
    passing::AllPassing,
    road::{FACADE_Y, Road},
    solids::{Hit, Material, Solids},
    world::from_world,
};
use crate::geometry::{GridWalk, Local};

/// Between the facades only road and pavements are lower (m).
const LOW: f64 = 0.22;
/// Whatever is as near to the plane of a facade is on it (m).
const NEAR_FACADE: f64 = 0.02;

/// The surfaces of a street.
#[derive(Debug)]
pub struct Street {
    pub(super) options: StreetOptions,
    solids: Solids,
    bins: Bins,
    edges: Edges,
    road: Road,
    passing: AllPassing,
}

impl Street {
    /// Builds a street.
    pub fn new(options: StreetOptions) -> Self {
        let (solids, road) = build(&options);
        let bounds = solids.0.iter().map(|(shape, _)| shape.bounds());
        let bins = Bins::new(options.length, bounds);
        let edges = Edges::find(options.length, &solids, &bins, &road);
        let passing = AllPassing::build(&options);
        Self {
            options,
            solids,
            bins,
            edges,
            road,
            passing,
        }
    }

    /// Returns the options that the street was built by.
    pub fn options(&self) -> &StreetOptions {
        &self.options
    }

    /// Returns the distance from `position` (world coordinates, m) to the nearest true surface.
    pub fn distance_to_surface(&self, position: [f64; 3]) -> f64 {
        self.distance(from_world(position))
    }

    /// Returns the distance from `position` (world coordinates, m) to the nearest edge of
    /// kerbs, boxes, walls and windows; infinite beyond 40 m.
    pub fn distance_to_edge(&self, position: [f64; 3]) -> f64 {
        self.edges.distance(from_world(position))
    }

    /// Returns whether `position` (world coordinates, m), next to a true surface, lies on one of the large planes: the road, a
    /// pavement or a facade.
    pub fn is_on_large_plane(&self, position: [f64; 3]) -> bool {
        let at = from_world(position);
        let across = at.y.abs();
        let is_on_ground = across < FACADE_Y && at.z < LOW;
        is_on_ground || (across - FACADE_Y).abs() < NEAR_FACADE
    }

    /// Returns the first surface that the ray meets within `range`.
    pub(super) fn cast(&self, origin: Local, direction: Local, range: f64) -> Option<Hit> {
        let on_road = self.road.hit(origin, direction);
        let mut first = on_road.filter(|&t| t < range).map(|range| Hit {
            range,
            normal: Local::z(),
            material: Material::Road,
        });
        // The bins below or above the ray, until it is beside the street.
        let walk = GridWalk::new([origin.x, origin.y], [direction.x, direction.y], BIN_EDGE);
        let passed = walk.take_while(|&([_, across], entered)| {
            entered < range && f64::from(across).abs() <= BINNED_HALF_WIDTH + 1.0
        });
        for (bin, entered) in passed {
            if first.is_some_and(|hit| entered > hit.range) {
                break;
            }
            for &number in self.bins.bin(bin.map(i64::from)) {
                if let Some(hit) = Hit::of(&self.solids.0[number as usize], origin, direction)
                    && hit.range < first.map_or(range, |hit| hit.range)
                {
                    first = Some(hit);
                }
            }
        }
        first
    }

    /// Returns the first surface that the ray meets within `range` during `pass`: of the street, or of what is there
    /// in that pass only.
    pub(super) fn cast_in_pass(
        &self,
        pass: u32,
        origin: Local,
        direction: Local,
        range: f64,
    ) -> Option<Hit> {
        let of_street = self.cast(origin, direction, range);
        let before = of_street.map_or(range, |hit| hit.range);
        self.passing
            .cast(pass, origin, direction, before)
            .or(of_street)
    }

    /// Returns the distance from `point` (street coordinates) to the nearest surface.
    fn distance(&self, point: Local) -> f64 {
        let to_shape = |number: u32| self.solids.0[number as usize].0.distance(point);
        self.bins
            .nearest(point, self.road.distance(point), to_shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::road::{KERB_HEIGHT, KERB_Y};

    fn street() -> Street {
        Street::new(StreetOptions {
            length: 100.0,
            ..StreetOptions::default()
        })
    }

    #[test]
    fn edges_are_where_planes_meet_and_nowhere_else() {
        let street = street();
        let to_edge = |x, y, z| street.edges.distance(Local::new(x, y, z));
        // Along the kerb, on top and at the foot.
        assert!(to_edge(31.0, KERB_Y, KERB_HEIGHT) < 1e-9);
        assert!(to_edge(31.0, -KERB_Y, 0.0) < 1e-9);
        // In the middle of the road the feet of the kerbs are the nearest edges, except for
        // the box of a car.
        assert!((3.9..4.01).contains(&to_edge(1.0, 0.0, 0.0)));
        for k in 0..200_u32 {
            let [x, y, z] = [7, 11, 13].map(|by| f64::from(k * by % 101) / 101.0);
            let point = Local::new(100.0 * x, 16.0 * y - 8.0, 9.0 * z);
            let twin = street.edges.distance_by_all(point);
            assert!((street.edges.distance(point) - twin).abs() < 1e-12);
        }
    }

    #[test]
    fn the_distance_matches_that_to_every_shape() {
        let street = street();
        for k in 0..400_u32 {
            let [x, y, z] = [7, 11, 13].map(|by| f64::from(k * by % 401) / 401.0);
            let point = Local::new(100.0 * x, 16.0 * y - 8.0, 9.0 * z);
            let shapes = street.solids.0.iter();
            let distances = shapes.map(|(shape, _)| shape.distance(point));
            let twin = distances.fold(street.road.distance(point), f64::min);
            assert!((street.distance(point) - twin).abs() < 1e-12);
        }
    }
}
