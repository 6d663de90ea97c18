//! Clouds whose spacing varies, from points to sites.

use std::{collections::HashMap, ops::ControlFlow};

use super::*;
use crate::{
    geometry::{Rect, spread},
    lloyd::{
        AREA_PER_SEED, PointTag, Scan, Site, Solution, SolverOptions, ThinnedPoints, TileRegion,
        solve_watched, solve_with_rings, uniformity,
    },
};

const QUANTIZATION: Quantization = Quantization {
    scale: 1e-4,
    offset: [0.0; 3],
};

fn go_on(_: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The edge of the square.
const EDGE: f64 = 12.0;

/// The quarters of the square: where each begins, the spacing that is wanted there, and its share of the points.
const QUARTERS: [([f64; 2], f64, f64); 4] = [
    ([0.0, 0.0], 0.4, 0.05),
    ([6.0, 0.0], 0.2, 0.1),
    ([0.0, 6.0], 0.1, 0.25),
    ([6.0, 6.0], 0.05, 0.6),
];

/// Random points of a slightly wavy sheet over the square, with their tags.
fn sheet(count: u64) -> ThinnedPoints {
    let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
    let mut points = ThinnedPoints::default();
    let mut next = 0;
    for (corner, spacing, share) in QUARTERS {
        for _ in 0..(share * count as f64) as u64 {
            let [x, y] = [0, 1].map(|axis| corner[axis as usize] + 6.0 * unit(next + axis));
            let z = 0.1 * (0.7 * x).sin() + 0.002 * unit(next + 2);
            next += 3;
            points.kept.extend(QUANTIZATION.stored(Local::new(x, y, z)));
            points.tags.push(PointTag {
                share: (spacing / 0.4) as f32,
                open: 0,
                is_ground: false,
            });
        }
    }
    points
}

/// Whether the site is far enough from the border of the square.
fn is_inside(site: &Site) -> bool {
    let within = 0.5..EDGE - 0.5;
    within.contains(&site.position.x) && within.contains(&site.position.y)
}

#[test]
fn cells_have_the_size_that_is_wanted_and_grow_gently_between() {
    let options = SolverOptions {
        grading: Some(Grading::new(0.125, 1.15, 0.0)),
        ..SolverOptions::new(0.4)
    };
    let scan = Scan::prepared(sheet(1_000_000), QUANTIZATION, &options);
    let everything = TileRegion::everything();
    let solved = solve_with_rings(&scan, &everything, &options, None, &go_on);
    let (Solution { sites, .. }, rings) = solved.unwrap();

    // In its own measure the whole is as even as a cloud of one spacing.
    let inside = || sites.iter().filter(|site| is_inside(site));
    let figures = uniformity(inside(), options.spacing).figures();
    assert!(figures.energy_ratio <= 1.01, "{figures:?}");
    assert!(figures.cell_area_cv <= 0.045, "{figures:?}");

    // Where a spacing is wanted, cells are as large as it says.
    for (_, spacing, _) in QUARTERS {
        let is_wanted = |site: &&Site| (site.spacing / spacing - 1.0).abs() < 1e-6;
        let error = |site: &Site| ((site.area / AREA_PER_SEED).sqrt() / spacing - 1.0).abs();
        let mut errors: Vec<f64> = inside().filter(is_wanted).map(error).collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors.len() > 20, "{} of {spacing}", errors.len());
        let p95 = errors[errors.len() * 95 / 100];
        assert!(p95 <= 0.03, "{p95} at {spacing}");
    }

    // No cell is much longer than its neighbours.
    let mut largest: f64 = 1.0;
    for (k, site) in sites.iter().enumerate() {
        let neighbors = rings.of(k).neighbors.iter();
        let others = neighbors.map(|&other| &sites[other as usize]);
        for other in others.filter(|other| is_inside(site) && is_inside(other)) {
            largest = largest.max((site.area / other.area).sqrt());
        }
    }
    assert!(largest <= 1.35, "{largest}");
}

/// Three tiles, each of which knows no more than its halo, against the whole.
#[test]
fn tiles_agree_to_the_bit_where_the_spacing_varies() {
    let options = SolverOptions {
        iterations: 4,
        grading: Some(Grading::new(0.25, 1.3, 0.0)),
        ..SolverOptions::new(0.1)
    };
    // A strip of 8 × 1, four times as fine on its right half.
    let cloud = |columns: [f64; 2]| {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let mut points = ThinnedPoints::default();
        for k in 0..200_000 {
            let [x, y, z] = [8.0 * unit(3 * k), unit(3 * k + 1), 0.002 * unit(3 * k + 2)];
            if x >= columns[0] && x < columns[1] {
                points.kept.extend(QUANTIZATION.stored(Local::new(x, y, z)));
                points.tags.push(PointTag {
                    share: if x < 4.0 { 1.0 } else { 0.25 },
                    open: 0,
                    is_ground: false,
                });
            }
        }
        points
    };
    let halo = options.halo();
    let solve = |core: [f64; 2]| {
        let units = |x: f64| QUANTIZATION.units(x);
        let core = Rect {
            min: [units(core[0]), -1_000_000],
            max: [units(core[1]), 1_000_000],
        };
        let available = core.grown(units(halo));
        let [low, high] = [available.min[0], available.max[0]].map(|c| c as f64 * 1e-4);
        let scan = Scan::prepared(cloud([low, high]), QUANTIZATION, &options);
        let region = TileRegion {
            available,
            core,
            band: 0,
        };
        let sites = solve_watched(&scan, &region, &options, None, &go_on)
            .unwrap()
            .sites;
        let own = sites
            .into_iter()
            .filter(move |site| core.contains(site.identity));
        own.collect::<Vec<Site>>()
    };
    let whole: HashMap<Stored, Site> = solve([-9.0, 17.0])
        .into_iter()
        .map(|site| (site.identity, site))
        .collect();
    let tiles: Vec<Site> = [[-9.0, 2.6], [2.6, 4.1], [4.1, 17.0]]
        .into_iter()
        .flat_map(solve)
        .collect();
    assert_eq!(tiles.len(), whole.len());
    assert!(halo < 3.2 && tiles.len() > 5_000, "{halo} {}", tiles.len());
    let known: Vec<&Site> = tiles.iter().filter(|site| site.is_exact).collect();
    assert!(known.len() > 1000, "{}", known.len());
    for site in known {
        let other = &whole[&site.identity];
        assert_eq!(site.position, other.position);
        assert_eq!(site.spacing.to_bits(), other.spacing.to_bits());
        assert_eq!(site.area.to_bits(), other.area.to_bits());
    }
}
