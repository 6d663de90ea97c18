use super::*;
use crate::{
    geometry::{Quantization, Stored, spread},
    lloyd::{Scan, SolverOptions, elect},
};

const QUANTIZATION: Quantization = Quantization {
    scale: 1e-4,
    offset: [0.0; 3],
};

/// Places even in a cube of the edge `edge` over the origin.
fn even(count: u64, edge: f64) -> impl Iterator<Item = Local> {
    let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
    (0..count).map(move |k| Local::new(unit(3 * k), unit(3 * k + 1), unit(3 * k + 2)) * edge)
}

/// The scan of `places`, of which a seed stands for 50 on average.
fn scan(places: Vec<Local>) -> (Scan, SolverOptions) {
    let options = SolverOptions {
        seeds_per_point: 0.02,
        ..SolverOptions::new(0.1)
    };
    let points: Vec<Stored> = (places.iter())
        .filter_map(|&p| QUANTIZATION.stored(p))
        .collect();
    (Scan::new(points, QUANTIZATION, &options), options)
}

/// The seeds of a scan with `places`, each with whether it is isolated.
fn judged(places: Vec<Local>) -> Vec<(Local, bool)> {
    let (scan, options) = scan(places);
    let seeds = elect(&scan, &options).positions;
    let surface = Surface::new(&scan, &options);
    let isolated = are_isolated(surface, &seeds, |_| true);
    seeds.into_iter().zip(isolated).collect()
}

fn floor() -> impl Iterator<Item = Local> {
    even(40_000, 3.0).map(|p| Local::new(p.x, p.y, 0.001 * p.z))
}

#[test]
fn a_floor_has_no_isolated_seeds() {
    let judged = judged(floor().collect());
    assert!(judged.len() > 800 && judged.iter().all(|&(_, is_isolated)| !is_isolated));
}

#[test]
fn rain_is_isolated_and_what_it_falls_on_is_not() {
    let rain = even(600, 3.0).filter(|p| p.z > 0.05);
    let judged = judged(floor().chain(rain).collect());
    let share = |is_part: &dyn Fn(f64) -> bool| {
        let part = judged.iter().filter(|(place, _)| is_part(place.z));
        let (all, isolated) = part.fold((0, 0), |(all, isolated), (_, is_isolated)| {
            (all + 1, isolated + usize::from(*is_isolated))
        });
        f64::from(isolated as u32) / f64::from(all.max(1))
    };
    // A few drops lie on a line or plane with others by chance, as points of a wire do.
    assert!(share(&|z| z > 0.15) > 0.95, "{}", share(&|z| z > 0.15));
    assert!(share(&|z| z < 0.05) == 0.0);
}

#[test]
fn strays_a_spacing_above_a_surface_are_isolated_and_a_wire_there_is_not() {
    let strays = even(12, 2.6).map(|p| Local::new(0.2 + 0.5 * p.x, 0.2 + p.y, 0.1 + 0.03 * p.z));
    let wire = (0..400).map(|k| Local::new(2.0, 0.0075 * f64::from(k), 0.11));
    let judged = judged(floor().chain(strays).chain(wire).collect());
    let above = judged.iter().filter(|(place, _)| place.z > 0.08);
    let (on_wire, strays): (Vec<_>, Vec<_>) = above.partition(|(place, _)| place.x > 1.8);
    let isolated = |part: &[&(Local, bool)]| part.iter().filter(|judged| judged.1).count();
    assert!(strays.len() > 8 && isolated(&strays) == strays.len());
    assert!(on_wire.len() > 20 && 10 * isolated(&on_wire) < on_wire.len());
}

#[test]
fn specks_around_a_dense_crown_are_isolated_and_the_crown_is_not() {
    // A shell of two spacings: no plane passes by what is a spacing before it.
    let center = Local::new(1.5, 1.5, 1.0);
    let from_center = |p: &Local| (p - center).norm();
    let around =
        |count, edge: f64| even(count, edge).map(move |p| p + center - Local::repeat(0.5 * edge));
    let crown = around(200_000, 0.42).filter(|p| (0.18..0.21).contains(&from_center(p)));
    let strays = around(150, 0.8).filter(|p| (0.3..0.34).contains(&from_center(p)));
    let points = floor().chain(crown).chain(strays).collect();
    let (scan, options) = scan(points);
    let positions = elect(&scan, &options).positions;
    let seeds = Seeds::new(Surface::new(&scan, &options), &positions);
    let in_shell = |low: f64, high: f64| -> Vec<usize> {
        let is_there = |&k: &usize| (low..high).contains(&from_center(&positions[k]));
        (0..positions.len()).filter(is_there).collect()
    };
    let (strays, crown) = (in_shell(0.28, 0.36), in_shell(0.0, 0.22));
    let lost: Vec<&usize> = strays.iter().filter(|&&k| seeds.is_lost(k)).collect();
    let is_otherwise = |&&&k: &&&usize| seeds.is_adrift(k) || seeds.is_beside_a_surface(k);
    let otherwise = lost.iter().filter(is_otherwise).count();
    assert!(strays.len() >= 10 && 10 * lost.len() >= 9 * strays.len());
    assert!(otherwise < lost.len(), "{otherwise} of {}", lost.len());
    assert!(crown.len() > 40 && crown.iter().all(|&k| !seeds.is_lost(k)));
}

#[test]
fn a_bird_is_isolated_and_a_lamp_that_was_scanned_more_densely_is_not() {
    let small = |count, at: Local| even(count, 0.08).map(move |p| p + at);
    // A seed stands for 50 points on average, and on the floor for about 80.
    let bird = small(120, Local::new(1.0, 1.0, 1.0));
    let lamp = small(2_000, Local::new(2.0, 2.0, 1.0));
    let judged = judged(floor().chain(bird).chain(lamp).collect());
    let high = judged.iter().filter(|(place, _)| place.z > 0.5);
    let (birds, lamps): (Vec<_>, Vec<_>) = high.partition(|(place, _)| place.x < 1.5);
    assert!(!birds.is_empty() && birds.iter().all(|(_, is_isolated)| *is_isolated));
    assert!(!lamps.is_empty() && lamps.iter().all(|(_, is_isolated)| !is_isolated));
}

#[test]
fn a_bird_in_the_rain_is_isolated_and_one_beside_a_wire_is_not() {
    let bird = |at: Local| even(120, 0.06).map(move |p| p + at);
    let (high, low) = (Local::new(1.0, 1.0, 1.0), Local::new(2.0, 2.0, 0.5));
    // The drop and the wire are more than a link from their birds, and near enough to be company.
    let drop = high + Local::new(0.2, 0.03, 0.03);
    let wire = (0..400).map(|k| Local::new(0.0075 * f64::from(k), 2.2, 0.53));
    let points = floor().chain(bird(high)).chain([drop]).chain(bird(low));
    let judged = judged(points.chain(wire).collect());
    let near = |at: Local| -> Vec<bool> {
        let middle = at + Local::repeat(0.03);
        let of_bird = judged
            .iter()
            .filter(|(place, _)| (place - middle).norm() < 0.06);
        of_bird.map(|&(_, is_isolated)| is_isolated).collect()
    };
    assert!(!near(high).is_empty() && near(high).iter().all(|&is_isolated| is_isolated));
    assert!(!near(low).is_empty() && near(low).iter().all(|&is_isolated| !is_isolated));
}

#[test]
fn two_seeds_that_belong_together_are_one_group() {
    let rain = even(600, 3.0).filter(|p| p.z > 0.05);
    let (scan, options) = scan(floor().chain(rain).collect());
    let positions = elect(&scan, &options).positions;
    let seeds = Seeds::new(Surface::new(&scan, &options), &positions);
    let group_of = |seed: usize| seeds.small_group(seed, |_| true);
    let mut pairs = 0;
    for seed in 0..positions.len() {
        let group = group_of(seed);
        for place in group.iter().flatten() {
            let member = positions.iter().position(|other| other == place);
            assert_eq!(group_of(member.unwrap()), group);
        }
        pairs += usize::from(group.is_some_and(|group| group.len() == 2));
    }
    assert!(pairs > 10, "{pairs}");
}

#[test]
fn a_sparse_wall_behind_a_dense_floor_stays() {
    // A point to the cell of a seed, as rain has.
    let wall = even(900, 3.0).map(|p| Local::new(p.x, 3.3, 0.3 + p.z));
    let judged = judged(floor().chain(wall).collect());
    let on_wall: Vec<_> = judged.iter().filter(|(place, _)| place.y > 3.2).collect();
    let isolated = on_wall
        .iter()
        .filter(|(_, is_isolated)| *is_isolated)
        .count();
    assert!(
        on_wall.len() > 300 && 20 * isolated < on_wall.len(),
        "{isolated} of {}",
        on_wall.len()
    );
}

#[test]
fn bounds_of_a_block_are_those_of_all_its_seeds() {
    let rain = even(600, 3.0).filter(|p| p.z > 0.05);
    let clump = even(400, 0.2).map(|p| p + Local::new(1.0, 1.0, 0.0));
    let (scan, options) = scan(floor().chain(rain).chain(clump).collect());
    let positions = elect(&scan, &options).positions;
    let seeds = Seeds::new(Surface::new(&scan, &options), &positions);
    let (mut alike, mut below) = (0, 0);
    for seed in 0..positions.len() {
        assert!(seeds.usual_points(seed) <= seeds.most_usual_points(seed));
        visit_linked(
            &seeds.grid,
            positions[seed],
            options.beside_radius(),
            |other, _| {
                assert!(seeds.points(other).near <= seeds.most_near(seed));
                alike += usize::from(seeds.points(other).near == seeds.most_near(seed));
                below += usize::from(10.0 * seeds.points(other).near < seeds.most_near(seed));
            },
        );
    }
    assert!(alike > 0 && below > 0, "{alike} {below}");
}
