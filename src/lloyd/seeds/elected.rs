//! The seeds of an election: nodes of lattices and points of the scan.

use rayon::prelude::*;

use super::{
    election::{
        EDGE_RADIUS_IN_SPACINGS, ELECTION_RADIUS_IN_SPACINGS, Election, FILLING_RADIUS_IN_SPACINGS,
        GAP_RADIUS_IN_SPACINGS, NODE_RADIUS_IN_SPACINGS,
    },
    nodes::{Nodes, RankedNodes},
    rule::SeedRule,
};
use crate::{geometry::Stored, lloyd::surface::Surface};

/// The seeds of an election, in no particular order.
pub(super) fn elected(surface: Surface<'_>) -> Vec<Stored> {
    let scan = surface.scan;
    let mut election = Election::new(surface);
    if surface.options.seeds == SeedRule::Poisson {
        election.elect(scan.points().iter().copied(), ELECTION_RADIUS_IN_SPACINGS);
        return election.seeds;
    }
    // Where one lattice goes on into the next, nodes are nearer to each other than seeds may be: they are elected, too.
    let nodes = Nodes::new(surface);
    let RankedNodes {
        on_edges,
        trusted,
        doubtful,
    } = nodes.on_surface(surface);
    let mut edges = Election::new(surface);
    edges.elect_in_order(on_edges, EDGE_RADIUS_IN_SPACINGS);
    let [trusted, doubtful] = [trusted, doubtful]
        .map(|nodes| edges.clear_of_seeds(nodes, EDGE_RADIUS_IN_SPACINGS, |_, _| 1.0));
    election.elect_in_order(trusted, NODE_RADIUS_IN_SPACINGS);
    election.elect_in_order(doubtful, ELECTION_RADIUS_IN_SPACINGS);
    election.seeds.append(&mut edges.seeds);
    // One point to a voxel says where a surface is. Elsewhere every point counts: what no seed
    // covers there is not covered later.
    let is_on_surface = |voxel: &&[Stored]| nodes.have(scan.quantization().local(voxel[0]));
    let (surfaces, loose) = {
        let voxels = scan.points_by_voxel();
        let (surfaces, loose): (Vec<_>, Vec<_>) = voxels.partition(is_on_surface);
        (surfaces, loose.concat())
    };
    let share_at = election.radius_shares();
    if surface.field().is_constant() {
        let surfaces = surfaces.into_par_iter();
        let surfaces: Vec<Stored> = surfaces.filter_map(|v| scan.representative(v)).collect();
        election.elect(surfaces.into_iter(), GAP_RADIUS_IN_SPACINGS);
    } else {
        // Where the spacing grows there are no nodes, and the seeds stand as densely as it says.
        election.elect_points(&surfaces.concat(), &share_at);
    }
    let on_surfaces = election.seeds.len();
    let bricks = election.bricks(&loose);
    election.elect_loose(&bricks, &share_at);
    let nearest = election.center(on_surfaces, &bricks);
    // Seeds that moved have left some points uncovered.
    election.elect_left(on_surfaces, &loose, &nearest, &share_at);
    election.elect(scan.filling().iter().copied(), FILLING_RADIUS_IN_SPACINGS);
    election.seeds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        lloyd::{
            Scan, SolverOptions,
            seeds::{
                AREA_PER_SEED, SeedRule,
                election::{ELECTION_RADIUS_IN_SPACINGS, radius_share},
            },
        },
    };

    /// `n` uniform random points of the unit square.
    fn sheet(n: u64) -> Vec<Stored> {
        let coordinate = |k: u64| (spread(k) % 1_000_000) as i32;
        (0..n)
            .map(|i| Stored {
                x: coordinate(2 * i),
                y: coordinate(2 * i + 1),
                z: 0,
            })
            .collect()
    }

    fn scan(points: Vec<Stored>, spacing: f64) -> Scan {
        let quantization = Quantization {
            scale: 1e-6,
            offset: [0.0; 3],
        };
        let options = SolverOptions {
            seed: 7,
            ..SolverOptions::new(spacing)
        };
        Scan::as_scanned(points, quantization, &options)
    }

    #[test]
    fn no_two_seeds_are_nearer_than_the_radius_and_every_point_is_covered() {
        let scan = scan(sheet(20_000), 0.03);
        let radius = ELECTION_RADIUS_IN_SPACINGS * 0.03;
        let options = SolverOptions {
            seeds: SeedRule::Poisson,
            ..SolverOptions::new(0.03)
        };
        let seeds = elected(Surface::new(&scan, &options));
        let is_near = |a: &Stored, b: &Stored| {
            let position = |s: &Stored| scan.quantization().local(*s);
            (position(a) - position(b)).norm() < radius
        };
        for (i, a) in seeds.iter().enumerate() {
            assert!(seeds[..i].iter().all(|b| !is_near(a, b)));
        }
        let is_covered = |point: &Stored| seeds.iter().any(|seed| is_near(seed, point));
        assert!(scan.points().iter().all(is_covered));
    }

    #[test]
    fn the_election_meets_the_density() {
        let spacing = 0.01;
        let wanted = 1.0 / (AREA_PER_SEED * spacing * spacing);
        let scan = scan(sheet(400_000), spacing);
        for seeds in [SeedRule::Poisson, SeedRule::Hexagonal] {
            let options = SolverOptions {
                seeds,
                ..SolverOptions::new(spacing)
            };
            let ratio = elected(Surface::new(&scan, &options)).len() as f64 / wanted;
            assert!((0.98..1.03).contains(&ratio), "{seeds:?}: {ratio}");
        }
    }

    #[test]
    fn an_election_among_few_points_meets_the_density() {
        let spacing = 0.01;
        let wanted = 1.0 / (AREA_PER_SEED * spacing * spacing);
        for points_to_a_seed in [3.0, 5.0, 10.0, 30.0] {
            let scan = scan(sheet((points_to_a_seed * wanted) as u64), spacing);
            let options = SolverOptions::new(spacing);
            let mut election = Election::new(Surface::new(&scan, &options));
            election.elect_points(scan.points(), |_, _| radius_share(points_to_a_seed));
            let ratio = election.seeds.len() as f64 / wanted;
            assert!((1.0..1.09).contains(&ratio), "{points_to_a_seed}: {ratio}");
        }
    }

    #[test]
    fn an_election_does_not_depend_on_points_far_away() {
        let near = |points: Vec<Stored>, seeds: SeedRule| {
            let options = SolverOptions {
                seeds,
                ..SolverOptions::new(0.02)
            };
            let elected = elected(Surface::new(&scan(points, 0.02), &options));
            let mut near: Vec<Stored> = elected.into_iter().filter(|s| s.x < 300_000).collect();
            near.sort_unstable();
            near
        };
        let all = sheet(50_000);
        let part: Vec<Stored> = all.iter().copied().filter(|p| p.x < 600_000).collect();
        for seeds in [SeedRule::Poisson, SeedRule::Hexagonal] {
            assert_eq!(near(all.clone(), seeds), near(part.clone(), seeds));
        }
    }
}
