//! A wall with things before it, seen by two passes.

use super::{
    DoubtfulVoxels, Moment, SightLine, TransientVoxels, VOXEL_EDGE, Visits, VoxelGrid,
    doubtful::BESIDE, visits::LONGEST_VISIT,
};
use crate::geometry::{Dice, Local};

const GRID: VoxelGrid = VoxelGrid { edge: VOXEL_EDGE };

/// A point, from where and when it was seen.
#[derive(Clone, Copy)]
struct Seen {
    scanner: Local,
    point: Local,
    seconds: f64,
}

/// What `lines` sight lines of a pass see that begins after so many seconds: a wall 10 m away from the scanner's way,
/// which is 20 m long, and 5 m away what is there, by the place and chance.
fn pass(seconds: f64, lines: usize, is_hit: impl Fn(f64, f64, &mut Dice) -> bool) -> Vec<Seen> {
    let mut dice = Dice(lines as u64 ^ seconds.to_bits());
    let sees = |_| {
        let along = 20.0 * dice.roll();
        let scanner = Local::new(along, 0.0, 2.0);
        let on_wall = Local::new(along + 6.0 * dice.roll() - 3.0, 10.0, 4.0 * dice.roll());
        let half_way = (scanner + on_wall) / 2.0;
        let point = match is_hit(half_way.x, half_way.z, &mut dice) {
            true => half_way,
            false => on_wall,
        };
        Seen {
            scanner,
            point,
            seconds: seconds + along,
        }
    };
    (0..lines).map(sees).collect()
}

fn visits(seen: &[Seen]) -> Visits {
    let mut visits = Visits::new(GRID);
    for seen in seen {
        visits.add(seen.point, Moment::after(seen.seconds));
    }
    visits
}

fn doubtful(seen: &[Seen]) -> DoubtfulVoxels {
    let doubtful = DoubtfulVoxels::among(visits(seen));
    for seen in seen {
        if let Some(line) = SightLine::new(seen.scanner, seen.point, GRID) {
            doubtful.look(line, Moment::after(seen.seconds));
        }
    }
    doubtful
}

fn found(seen: &[Seen]) -> TransientVoxels {
    doubtful(seen).decide()
}

/// Whether a place half way to the wall is that of a car.
fn is_car(x: f64, z: f64) -> bool {
    (8.0..12.0).contains(&x) && z < 2.5
}

#[test]
fn a_car_that_one_pass_saw_is_found_and_nothing_else() {
    let first = pass(0.0, 100_000, |x, z, _| is_car(x, z));
    let second = pass(1000.0, 100_000, |_, _, _| false);
    let both = [&first[..], &second].concat();
    let transients = found(&both);
    let of_car = |seen: &&Seen| seen.point.y < 9.0;
    let left = both
        .iter()
        .filter(of_car)
        .filter(|seen| !transients.contain(seen.point));
    assert_eq!(left.count(), 0);
    assert!(
        !both
            .iter()
            .any(|seen| !of_car(&seen) && transients.contain(seen.point))
    );
    assert_eq!(transients.counts.things, 1);
    assert_eq!(
        transients.counts.points,
        both.iter().filter(of_car).count() as u64
    );

    // Neither the order of the points nor the way to the disk and back shows.
    let backwards: Vec<Seen> = both.iter().rev().copied().collect();
    assert_eq!(found(&backwards), transients);
    assert_eq!(
        TransientVoxels::from_bytes(&transients.to_bytes()),
        Some(transients.clone())
    );
    assert_eq!(
        TransientVoxels::from_bytes(&transients.to_bytes()[1..]),
        None
    );

    // A second pass a moment later is one with the first.
    let soon = pass(LONGEST_VISIT / 2.0, 100_000, |_, _, _| false);
    assert_eq!(found(&[first, soon].concat()).counts.things, 0);
}

#[test]
fn nothing_is_found_in_one_visit_and_that_is_known_without_sight_lines() {
    let first = pass(0.0, 20_000, |x, z, _| is_car(x, z));
    let soon = pass(LONGEST_VISIT - 21.0, 20_000, |_, _, _| false);
    let later = pass(LONGEST_VISIT + 21.0, 20_000, |_, _, _| false);
    for (seen, is_one) in [
        (&[][..], true),
        (&first, true),
        (&[&first[..], &soon].concat(), true),
        (&[&first[..], &later].concat(), false),
    ] {
        assert_eq!(visits(seen).are_one(), is_one);
        if is_one {
            let known = TransientVoxels::of_one_visit(GRID);
            let searched = found(seen);
            assert_eq!([searched.counts.things, searched.counts.points], [0, 0]);
            assert!(seen.iter().all(|seen| !known.contain(seen.point)));
            assert_eq!(TransientVoxels::from_bytes(&known.to_bytes()), Some(known));
        }
    }
}

#[test]
fn what_is_there_stays() {
    let stays = |is_hit: &dyn Fn(f64, f64, &mut Dice) -> bool, first: usize, second: usize| {
        let first = pass(0.0, first, is_hit);
        let second = pass(1000.0, second, is_hit);
        assert!(first.iter().any(|seen| seen.point.y < 9.0));
        found(&[first, second].concat()).counts.things == 0
    };
    // A car that parks.
    assert!(stays(&|x, z, _| is_car(x, z), 100_000, 100_000));
    // A net that the first pass met here and there, and the second, with less lines, hardly ever.
    assert!(stays(
        &|x, z, dice| is_car(x, z) && dice.roll() < 0.03,
        100_000,
        5_000
    ));
    // A car behind which nothing was seen by the second pass.
    let first = pass(0.0, 100_000, |x, z, _| is_car(x, z));
    let mut second = pass(1000.0, 100_000, |_, _, _| false);
    second.retain(|seen| {
        !is_car(
            (seen.scanner.x + seen.point.x) / 2.0,
            seen.point.z / 2.0 + 1.0,
        )
    });
    assert_eq!(found(&[first, second].concat()).counts.things, 0);
}

#[test]
fn sight_lines_are_counted_where_they_pass() {
    let first = pass(0.0, 3_000, |x, z, _| is_car(x, z));
    let second = pass(1000.0, 3_000, |x, _, dice| x > 15.0 && dice.roll() < 0.5);
    let both = [first, second].concat();
    let fast = doubtful(&both);
    let mut all = 0;
    for (visit, passed) in fast.visits.iter().zip(&fast.passed) {
        let lines = |is_own: bool| {
            let passing = both.iter().filter(|seen| {
                let line = SightLine::new(seen.scanner, seen.point, GRID);
                visit.times.contain(Moment::after(seen.seconds)) == is_own
                    && line.is_some_and(|line| {
                        line.nearest_within(visit.middle(GRID), BESIDE * GRID.edge)
                            .is_some()
                    })
            });
            passing.count()
        };
        let [own, others] = [&passed.own, &passed.others]
            .map(|count| count.load(std::sync::atomic::Ordering::Relaxed) as usize);
        assert_eq!([own, others], [lines(true), lines(false)], "{visit:?}");
        all += own + others;
    }
    assert!(all > 1_000, "{all}");
}

#[test]
fn a_line_passes_the_voxels_in_which_its_places_are() {
    let mut dice = Dice(5);
    for _ in 0..200 {
        let mut end = || Local::new(dice.roll(), dice.roll(), dice.roll()) * 9.0;
        let Some(line) = SightLine::new(end(), end(), GRID) else {
            continue;
        };
        let passed: Vec<_> = line.voxels(GRID).collect();
        let mut by_steps: Vec<_> = (0..=100_000)
            .map(|step| {
                GRID.voxel(line.start + line.direction * (line.length * f64::from(step) / 1e5))
            })
            .collect();
        by_steps.dedup();
        // Steps may miss a corner that the line passes.
        assert!(by_steps.iter().all(|voxel| passed.contains(voxel)));
        assert!(
            passed.len() <= by_steps.len() + 2,
            "{passed:?} {by_steps:?}"
        );
    }
    assert!(SightLine::new(Local::zeros(), Local::new(1.0, 0.0, 0.0), GRID).is_none());
    assert!(SightLine::new(Local::zeros(), Local::new(301.0, 0.0, 0.0), GRID).is_none());
    assert!(SightLine::new(Local::zeros(), Local::repeat(f64::NAN), GRID).is_none());
}
