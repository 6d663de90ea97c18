//! Cars and people that are there in one pass and not in the others: what a survey would rather not have seen.

use super::{
    furniture::build_car,
    options::StreetOptions,
    random::Random,
    road::{BLOCK_LENGTH, KERB_HEIGHT},
    shapes::Shape,
    solids::{Hit, Material, Solids},
};
use crate::geometry::{Local, spread};

/// How far from its middle (m) a car or a person reaches, at most.
const REACH: f64 = 2.6;

/// A car or a person.
#[derive(Debug)]
struct Passing {
    /// The pass in which it is there, from 0.
    pass: u32,
    middle: Local,
    solids: Solids,
}

/// All that is there in one pass only.
#[derive(Debug)]
pub(super) struct AllPassing(Vec<Passing>);

impl AllPassing {
    /// Spreads cars, on the road, and people, on the pavements, over a street in turn.
    pub(super) fn build(options: &StreetOptions) -> Self {
        let mut random = Random(spread(options.seed ^ 0x9a55));
        // A car between two blocks ends a few metres before the end of the street.
        let gaps = ((options.length / BLOCK_LENGTH) as u32).max(2) - 1;
        let passing = (0..options.passing).map(|number| {
            let number_of_kind = number / 2;
            let mut solids = Solids::default();
            let middle = match number % 2 {
                0 => {
                    // Cars that park in all passes leave room between the blocks.
                    let block = f64::from(number_of_kind % gaps);
                    let side = [1.0, -1.0][(number_of_kind / gaps % 2) as usize];
                    let x = BLOCK_LENGTH * block + random.between(17.3, 23.6);
                    let y = side * random.between(1.9, 2.9);
                    build_car(&mut solids, [x, y - 0.85], Material::Passing);
                    Local::new(x + 2.1, y, 0.8)
                }
                _ => {
                    let side = if random.happens(0.5) { 1.0 } else { -1.0 };
                    let x = random.between(4.0, options.length - 4.0);
                    let middle = Local::new(x, side * random.between(4.9, 6.8), KERB_HEIGHT + 0.87);
                    let person = Shape::Ellipsoid {
                        center: middle,
                        axes: Local::new(0.25, 0.2, 0.87),
                    };
                    solids.add(person, Material::Passing);
                    middle
                }
            };
            Passing {
                pass: number_of_kind % options.passes.max(1),
                middle,
                solids,
            }
        });
        Self(passing.collect())
    }

    /// The first of these surfaces that a ray of `pass` meets within `range`.
    pub(super) fn cast(
        &self,
        pass: u32,
        origin: Local,
        direction: Local,
        range: f64,
    ) -> Option<Hit> {
        let is_near_the_ray = |passing: &&Passing| {
            let to_middle = passing.middle - origin;
            let along = to_middle.dot(&direction);
            let across = to_middle.norm_squared() - along * along;
            along > -REACH && along < range + REACH && across < REACH * REACH
        };
        let near = self.0.iter().filter(|passing| passing.pass == pass);
        let solids = near.filter(is_near_the_ray).flat_map(|p| &p.solids.0);
        let hits = solids.filter_map(|solid| Hit::of(solid, origin, direction));
        let within = hits.filter(|hit| hit.range < range);
        within.min_by(|a, b| a.range.total_cmp(&b.range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Street, solids::PASSING, world::from_world};

    #[test]
    fn everything_is_seen_in_its_pass_alone() {
        let street = Street::new(StreetOptions {
            length: 60.0,
            points: 600_000,
            passes: 3,
            passing: 8,
            noise: 0.0,
            ..StreetOptions::default()
        });
        let all = AllPassing::build(street.options());
        assert_eq!(all.0.len(), 8);
        for pass in 0..3 {
            let points = (0..street.slices(pass)).flat_map(|slice| street.slice(pass, slice));
            let seen: Vec<Local> = points
                .filter(|point| point.class == PASSING)
                .map(|point| from_world(point.position))
                .collect();
            let is_of = |passing: &Passing, at: &Local| (at - passing.middle).norm() < REACH;
            let here = || all.0.iter().filter(|passing| passing.pass == pass);
            assert!(
                seen.iter()
                    .all(|at| here().any(|passing| is_of(passing, at)))
            );
            for passing in here() {
                let points = seen.iter().filter(|at| is_of(passing, at)).count();
                assert!(points > 10, "{points} of {passing:?}");
            }
        }
    }

    #[test]
    fn the_way_is_where_points_were_seen_from() {
        let street = Street::new(StreetOptions {
            length: 60.0,
            points: 4_000,
            ..StreetOptions::default()
        });
        let way = street.way();
        for pass in 0..2 {
            for point in street.slice(pass, 0) {
                let next = way
                    .partition_point(|(time, _)| *time < point.gps_time)
                    .max(1);
                let [(before, from), (after, to)] = [way[next - 1], way[next]];
                let share = (point.gps_time - before) / (after - before);
                let scanner = from_world(from) + (from_world(to) - from_world(from)) * share;
                // The scanners face half left and half right: what is seen lies in one of two planes.
                let to_point = from_world(point.position) - scanner;
                let aside = (to_point.x.abs() - to_point.y.abs()).abs();
                assert!(aside < 0.02, "{aside} at {to_point}");
            }
        }
    }
}
