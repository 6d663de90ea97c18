//! The solver on surfaces whose answer is known.

use lloydar::internals::{
    Acceleration, Local, PatchKind, Quantization, Rect, Restriction, Scan, SeedRule, Site,
    Solution, SolverOptions, Stored, TileRegion, Uniformity, solve, uniformity,
};

const QUANTIZATION: Quantization = Quantization {
    scale: 1e-6,
    offset: [0.0; 3],
};

/// Numbers that look like chance, the same every time.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// `n` even points of the unit sphere.
fn sphere(n: usize) -> Vec<Stored> {
    let mut dice = Dice(1);
    (0..n)
        .map(|_| {
            let z = 2.0 * dice.roll() - 1.0;
            let turn = std::f64::consts::TAU * dice.roll();
            let r = (1.0 - z * z).sqrt();
            QUANTIZATION
                .quantise([r * turn.cos(), r * turn.sin(), z])
                .unwrap()
        })
        .collect()
}

/// `n` even points over a wavy sheet of 2 × 2.
fn sheet(n: usize) -> Vec<Stored> {
    let mut dice = Dice(2);
    (0..n)
        .map(|_| {
            let (x, y) = (2.0 * dice.roll(), 2.0 * dice.roll());
            QUANTIZATION
                .quantise([x, y, 0.1 * (5.0 * x).sin() * (4.0 * y).cos()])
                .unwrap()
        })
        .collect()
}

/// `n` even points, with noise, of a floor and a wall that meet at right angles
/// in the line x = z = 0.
fn crease(n: usize, noise: f64) -> Vec<Stored> {
    let mut dice = Dice(3);
    (0..n)
        .map(|i| {
            let (away, y) = (dice.roll(), 2.0 * dice.roll());
            let off = noise * (2.0 * dice.roll() - 1.0);
            let (x, z) = if i % 2 == 0 { (away, off) } else { (off, away) };
            QUANTIZATION.quantise([x, y, z]).unwrap()
        })
        .collect()
}

/// The spacing of `n` sites on `area`.
fn spacing(area: f64, n: f64) -> f64 {
    (2.0 * area / n / 3.0_f64.sqrt()).sqrt()
}

fn run(points: Vec<Stored>, domain: &TileRegion, options: &SolverOptions) -> Solution {
    let scan = Scan::new(points, QUANTIZATION, options);
    solve(&scan, domain, options)
}

/// Energy ratio, cell-area CV, δ and packing that a sphere must meet.
struct Bars {
    energy_ratio: f64,
    cell_area_cv: f64,
    delta: f64,
    packing: f64,
}

fn check_sphere(options: &SolverOptions, bars: &Bars) -> Uniformity {
    let four_pi = 4.0 * std::f64::consts::PI;
    let solution = run(sphere(300_000), &TileRegion::everything(), options);
    let figures = uniformity(&solution.sites, options.spacing).figures();
    let said = format!("{options:?}: {figures:?}");
    assert!((9_700..10_300).contains(&solution.sites.len()), "{said}");
    assert!(figures.energy_ratio <= bars.energy_ratio, "{said}");
    assert!(figures.cell_area_cv <= bars.cell_area_cv, "{said}");
    assert!(figures.delta <= bars.delta, "{said}");
    assert!(figures.packing >= bars.packing, "{said}");
    // The cells tile the sphere: their areas are its area.
    let area: f64 = solution.sites.iter().map(|s| s.area).sum();
    assert!((area / four_pi - 1.0).abs() < 0.003, "{area}");
    // And the sites lie on it.
    let off = solution
        .sites
        .iter()
        .map(|s| (s.position.norm() - 1.0).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4);
    figures
}

#[test]
fn a_sphere_becomes_as_even_as_promised() {
    let h = spacing(4.0 * std::f64::consts::PI, 10_350.0);
    // From Poisson-disk seeds, as the paper has them.
    let bars = Bars {
        energy_ratio: 1.025,
        cell_area_cv: 0.07,
        delta: 0.053,
        packing: 0.90,
    };
    for acceleration in [Acceleration::Relaxation, Acceleration::Anderson] {
        let options = SolverOptions {
            acceleration,
            seeds: SeedRule::Poisson,
            ..SolverOptions::new(h)
        };
        check_sphere(&options, &bars);
    }
    // From seeds at the nodes of lattices.
    let bars = Bars {
        energy_ratio: 1.01,
        cell_area_cv: 0.045,
        delta: 0.048,
        packing: 0.95,
    };
    let figures = check_sphere(&SolverOptions::new(h), &bars);
    assert!(figures.six_neighbors >= 0.90, "{figures:?}");
}

#[test]
fn every_rule_and_acceleration_ends_more_even_than_it_began() {
    let h = spacing(4.3, 4_000.0);
    for seeds in [SeedRule::Poisson, SeedRule::Area, SeedRule::Random] {
        for acceleration in [
            Acceleration::None,
            Acceleration::Relaxation,
            Acceleration::Anderson,
            Acceleration::AndersonGlobal,
        ] {
            let options = SolverOptions {
                seeds,
                acceleration,
                seeds_per_point: 0.04,
                ..SolverOptions::new(h)
            };
            let solution = run(sheet(100_000), &TileRegion::everything(), &options);
            let before = solution.seeds.figures();
            let after = uniformity(&solution.sites, h).figures();
            assert!(
                after.energy_ratio < before.energy_ratio
                    && after.cell_area_cv < before.cell_area_cv,
                "{seeds:?}, {acceleration:?}"
            );
        }
    }
}

/// A patch of the plane in which the hexagonal lattice itself is the scan: no
/// site inside may move.
#[test]
fn the_hexagonal_lattice_is_a_fixed_point() {
    let h = 0.02;
    let quantization: Vec<Stored> = (-40..40)
        .flat_map(|i| (-40..40).map(move |j| (f64::from(i), f64::from(j))))
        .map(|(i, j)| {
            QUANTIZATION
                .quantise([h * (i + 0.5 * j), h * j * 0.75_f64.sqrt(), 0.0])
                .unwrap()
        })
        .collect();
    // All points are farther apart than the election's radius: all are seeds.
    let options = SolverOptions {
        fit_radius: 2.2 * h,
        iterations: 5,
        ..SolverOptions::new(h)
    };
    let solution = run(quantization.clone(), &TileRegion::everything(), &options);
    assert_eq!(solution.sites.len(), quantization.len());
    let still = |site: &&Site| {
        let start = QUANTIZATION.local(site.identity);
        start.norm() < 0.3 && (site.position - start).norm() < 1e-4 * h
    };
    let inside = solution
        .sites
        .iter()
        .filter(|s| QUANTIZATION.local(s.identity).norm() < 0.3);
    assert_eq!(solution.sites.iter().filter(still).count(), inside.count());
}

#[test]
fn without_the_boundary_restriction_sites_drift_from_the_border() {
    let h = 0.05;
    let beyond = |restriction| {
        let options = SolverOptions {
            restriction,
            ..SolverOptions::new(h)
        };
        let solution = run(sheet(60_000), &TileRegion::everything(), &options);
        solution
            .sites
            .iter()
            .map(|s| {
                (-s.position.x)
                    .max(s.position.x - 2.0)
                    .max(-s.position.y)
                    .max(s.position.y - 2.0)
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let input_spacing = (4.3_f64 / 60_000.0).sqrt();
    assert!(beyond(Restriction::Local) <= 1.5 * input_spacing);
    assert!(beyond(Restriction::Global(0.5 * input_spacing)) <= 0.5 * input_spacing + 1e-9);
    assert!(beyond(Restriction::None) > 3.0 * input_spacing);
}

/// `n` even points, with noise, of a floor of 0.3 × 2 and of a wall over the middle of it, which ends [`WALL_END`] above it.
fn floor_and_wall(n: usize) -> Vec<Stored> {
    let mut dice = Dice(5);
    (0..n)
        .map(|i| {
            let (y, across) = (2.0 * dice.roll(), 0.3 * dice.roll());
            let off = 0.004 * (dice.roll() - 0.5);
            let [x, z] = match i % 2 {
                0 => [off, WALL_END + across],
                _ => [across - 0.15, off],
            };
            QUANTIZATION.quantise([x, y, z]).unwrap()
        })
        .collect()
}

/// The height of the end of the wall over the floor.
const WALL_END: f64 = 0.05;

#[test]
fn sites_do_not_hang_in_the_air_where_a_wall_ends_above_the_floor() {
    let n = 40_000;
    let input_spacing = (0.6 / (n / 2) as f64).sqrt();
    let options = SolverOptions::new(0.05);
    let solution = run(floor_and_wall(n), &TileRegion::everything(), &options);
    let heights = solution.sites.iter().map(|site| site.position.z);
    let lowest = heights.filter(|&z| z > 0.01).fold(f64::INFINITY, f64::min);
    assert!(
        WALL_END - lowest < 0.8 * input_spacing,
        "{lowest} by {input_spacing}"
    );
}

#[test]
fn planes_are_fitted_where_they_are_asked_for() {
    let h = spacing(4.0 * std::f64::consts::PI, 600.0);
    let off = |patch| {
        let options = SolverOptions {
            patch,
            ..SolverOptions::new(h)
        };
        let solution = run(sphere(40_000), &TileRegion::everything(), &options);
        solution
            .sites
            .iter()
            .map(|s| (s.position.norm() - 1.0).abs())
            .sum::<f64>()
            / solution.sites.len() as f64
    };
    // A plane through a curved neighbourhood lies inside of it.
    assert!(off(PatchKind::Quadratic) < 0.1 * off(PatchKind::Plane));
}

/// Two halves of a sheet, solved alone, against the whole of it.
#[test]
fn edges_are_rounded_less_than_half_as_much_as_by_planes() {
    let off_the_edge = |patch: PatchKind| {
        let options = SolverOptions {
            patch,
            ..SolverOptions::new(0.05)
        };
        let scan = crease(60_000, 0.002);
        let sites = run(scan, &TileRegion::everything(), &options).sites;
        let near: Vec<f64> = sites
            .iter()
            .map(|site| site.position)
            .filter(|p| p.x.hypot(p.z) < 0.1)
            .map(|p| {
                let to_floor = p.z.hypot(p.x.min(0.0));
                let to_wall = p.x.hypot(p.z.min(0.0));
                to_floor.min(to_wall)
            })
            .collect();
        near.iter().sum::<f64>() / near.len() as f64
    };
    let (quadratic, plane) = (
        off_the_edge(PatchKind::Quadratic),
        off_the_edge(PatchKind::Plane),
    );
    assert!(quadratic < 0.5 * plane, "{quadratic} {plane}");
}

#[test]
fn a_tile_that_sees_enough_has_the_bits_of_the_whole() {
    let h = spacing(4.3, 30_000.0);
    let options = SolverOptions {
        iterations: 12,
        ..SolverOptions::new(h)
    };
    let whole = run(sheet(400_000), &TileRegion::everything(), &options);
    let middle = 1_000_000;
    let halo = QUANTIZATION.units(options.halo());
    for (from, to) in [(-10, middle), (middle, 2_000_010)] {
        let core = Rect {
            min: [from, -10],
            max: [to, 2_000_010],
        };
        let known = Rect {
            min: core.min.map(|c| c - halo),
            max: core.max.map(|c| c + halo),
        };
        let seen: Vec<Stored> = sheet(400_000)
            .into_iter()
            .filter(|&p| known.contains(p))
            .collect();
        assert!(seen.len() < 320_000);
        let domain = TileRegion {
            available: known,
            core,
            band: QUANTIZATION.units(3.0 * h),
        };
        let part = run(seen, &domain, &options);
        let mut compared = 0;
        for site in part.sites.iter().filter(|s| core.contains(s.identity)) {
            let twin = whole
                .sites
                .binary_search_by_key(&site.identity, |s| s.identity);
            let twin = whole.sites[twin.expect("the same seeds are elected")];
            assert_eq!(site.position, twin.position);
            compared += 1;
        }
        assert!(compared > 13_000);
    }
}

#[test]
fn degenerate_scans_are_survived() {
    let line: Vec<Stored> = (0..20_000)
        .map(|x| Stored {
            x: 50 * x,
            y: 0,
            z: 0,
        })
        .collect();
    let equal = vec![Stored { x: 1, y: 2, z: 3 }; 20_000];
    let grid: Vec<Stored> = (0..150)
        .flat_map(|x| {
            (0..150).map(move |y| Stored {
                x: 6000 * x,
                y: 6000 * y,
                z: 0,
            })
        })
        .collect();
    for (points, least) in [(line, 20), (equal, 1), (grid, 300), (Vec::new(), 0)] {
        let solution = run(points, &TileRegion::everything(), &SolverOptions::new(0.04));
        assert!(solution.sites.len() >= least);
        assert!(
            solution
                .sites
                .iter()
                .all(|s| s.position.iter().all(|c: &f64| c.is_finite()))
        );
    }
}

#[test]
fn a_scan_of_noise_keeps_its_seeds() {
    let mut dice = Dice(5);
    let fog: Vec<Stored> = (0..30_000)
        .map(|_| {
            QUANTIZATION
                .quantise([dice.roll(), dice.roll(), dice.roll()])
                .unwrap()
        })
        .collect();
    let solution = run(fog, &TileRegion::everything(), &SolverOptions::new(0.1));
    // Where nothing is a surface, nothing may move.
    let moved = |s: &&Site| (s.position - QUANTIZATION.local(s.identity)).norm() > 1e-12;
    let held = solution.sites.iter().filter(|s| s.is_fixed).count();
    assert!(
        held * 10 > solution.sites.len() * 7,
        "{held} of {}",
        solution.sites.len()
    );
    assert!(
        solution
            .sites
            .iter()
            .filter(|s| s.is_fixed)
            .filter(moved)
            .count()
            * 4
            < held
    );
    let _: Local = solution.sites[0].position;
}
