//! Even distances between sites, which Lloyd's method leaves less even than the areas of cells.
//!
//! A centroid does not know how far the nearest neighbour is. Where two lattices of seeds meet, some cells have five neighbours and
//! others seven, and two sites can be near to each other in cells as large as all others. Where a surface is doubtful, a
//! site at its rim is drawn away from the others. Where the scan ends, centroids press rows of sites together. So sites that are
//! too near draw apart in each iteration (as nudged sites do now and then in Gonzalez, Choksi and Nave, arXiv 2005.00094), and a
//! site with a doubtful centroid leaves neither its nearest neighbour nor one that would be alone without it.

use crate::{
    geometry::Local,
    lloyd::{SolverOptions, seeds::SeedRule},
};

/// Two sites draw apart if they are nearer than this in the first iteration. With 0.93 from the first on, the excess of the energy ratio on surfaces was
/// 4 % higher on ten clouds.
const NEAREST_AT_FIRST_IN_SPACINGS: f64 = 0.85;
/// Two sites draw apart if they are nearer than this in the last iteration; the distance grows evenly from the first one on. With 1.0 the excess of the
/// energy ratio on surfaces was 1.3 % higher.
const NEAREST_AT_LAST_IN_SPACINGS: f64 = 0.98;
/// The distance in the last iteration if seeds stand on no lattices: many of their cells have five or seven neighbours, and no room for more. With 0.98 δ on a
/// sphere was 0.055 instead of 0.053 at most.
const NEAREST_AT_LAST_WITHOUT_LATTICES_IN_SPACINGS: f64 = 0.95;
/// The share of what is missing to that distance by which two sites draw apart in one iteration, both together. Over-relaxation
/// lengthens it: with a share of 1.2 sites overshoot, and δ was 12 % higher.
const SHARE_IN_AN_ITERATION: f64 = 0.7;
/// A site at the border of a surface draws away from others that are nearer than this, in all iterations: its centroid presses rows of
/// sites together there. With the same for all sites with a doubtful centroid δ of a forest was up to 1 % higher, and its points 2 to 3 % farther from the scan.
const NEAREST_AT_BORDER_IN_SPACINGS: f64 = 1.0;
/// Its share is larger: often it does its half alone, because the other site is far enough away by its own rule. With a share of 1 δ on surfaces was
/// 2.5 % higher on ten clouds.
const SHARE_AT_BORDER: f64 = 1.4;
/// A site with a doubtful centroid does not go farther from its nearest neighbour if that is farther than this, a little
/// more than the clearance of such sites. With 0.95 δ ended 1.1 % above its least value on one of nine scans.
const NEAR_ENOUGH_IN_SPACINGS: f64 = 0.9;
/// Nor does it go farther from a neighbour that no other is nearer to, if that is farther than this. Of 97 314 seeds of a simulated tripod's
/// scan 25 were farther than 1.26 spacings from the next; without this rule 147 points were after twenty iterations. With 1.0 δ of two real
/// scans is 0.7 % lower, but the points that are farthest from others make up more of it.
const FAR_FROM_OTHERS_IN_SPACINGS: f64 = 1.03;

/// How near to each other sites may be in an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crowding {
    /// Sites that are nearer draw apart (spacings).
    nearest: f64,
    /// The share of what is missing by which both draw apart together.
    share: f64,
}

impl Crowding {
    /// The rule of `iteration`; `None` for seeds without election.
    pub(super) fn in_iteration(options: &SolverOptions, iteration: u32) -> Option<Self> {
        let first = NEAREST_AT_FIRST_IN_SPACINGS;
        let last = match options.seeds {
            SeedRule::Poisson => NEAREST_AT_LAST_WITHOUT_LATTICES_IN_SPACINGS,
            _ => NEAREST_AT_LAST_IN_SPACINGS,
        };
        let progress = f64::from(iteration + 1) / f64::from(options.iterations.max(1));
        let nearest = first + (last - first) * progress.min(1.0);
        options.seeds.is_election().then_some(Self {
            nearest,
            share: SHARE_IN_AN_ITERATION,
        })
    }

    /// The rule for a site that may stand at the border of a surface.
    pub(super) fn of_site(self, is_at_border: bool) -> Self {
        match is_at_border {
            true => Self {
                nearest: NEAREST_AT_BORDER_IN_SPACINGS,
                share: SHARE_AT_BORDER,
            },
            false => self,
        }
    }

    /// The move by which a site draws away from those `others` that are too near (CRS units).
    pub(super) fn relief(self, others: impl Iterator<Item = Way>) -> Local {
        let move_from = |other: Way| {
            let length = other.length();
            let missing = self.nearest * other.spacing - length;
            other.vector * (0.5 * self.share * missing / length)
        };
        // There is no way out of one and the same place.
        let is_too_near = |other: &Way| {
            let squared = other.vector.norm_squared();
            squared > 0.0 && squared < (self.nearest * other.spacing).powi(2)
        };
        others.filter(is_too_near).map(move_from).sum()
    }
}

/// The way to a site from another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// The vector that leads to the site (CRS units).
    pub(super) vector: Local,
    /// The smaller one of the spacings at the two (CRS units): where it varies, sites are nearer on the finer side.
    pub(super) spacing: f64,
}

impl Way {
    /// Its length (CRS units).
    fn length(self) -> f64 {
        self.vector.norm()
    }

    /// Whether it is longer than so many `spacings`.
    fn is_longer_than(self, spacings: f64) -> bool {
        self.length() > spacings * self.spacing
    }
}

/// The `step` of a site without the parts that lead away from the nearest of the `others`, and from those to which no other of them is
/// nearer than the site is, if they are far enough (CRS units).
pub(super) fn without_leaving(step: Local, others: impl Iterator<Item = Way> + Clone) -> Local {
    let by_length = |a: &Way, b: &Way| a.vector.norm_squared().total_cmp(&b.vector.norm_squared());
    let is_far_enough = |other: &Way| other.is_longer_than(NEAR_ENOUGH_IN_SPACINGS);
    let nearest = others.clone().min_by(by_length).filter(is_far_enough);
    let is_nearer_to = |third: Way, other: &Way| {
        let squared = (third.vector - other.vector).norm_squared();
        squared > 0.0 && squared < other.vector.norm_squared()
    };
    let would_be_alone = |other: &Way| {
        other.is_longer_than(FAR_FROM_OTHERS_IN_SPACINGS)
            && !others.clone().any(|third| is_nearer_to(third, other))
    };
    let alone = others.clone().filter(would_be_alone);
    nearest.into_iter().chain(alone).fold(step, |step, other| {
        let away = other.vector / other.length();
        step - away * step.dot(&away).max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> Local {
        Local::new(x, y, 0.0)
    }

    fn ways(spacing: f64, vectors: &[Local]) -> impl Iterator<Item = Way> + Clone {
        vectors.iter().map(move |&vector| Way { vector, spacing })
    }

    #[test]
    fn two_sites_that_are_too_near_draw_apart_by_their_share() {
        let options = SolverOptions::new(0.2);
        for iteration in [0, 10, 19] {
            let crowding = Crowding::in_iteration(&options, iteration).unwrap();
            let wanted = 0.2 * (0.85 + 0.13 * f64::from(iteration + 1) / 20.0);
            for distance in [0.1, 0.15, 0.17, 0.2] {
                let way = at(0.6, -0.8) * distance;
                let [here, there] = [way, -way].map(|way| crowding.relief(ways(0.2, &[way])));
                assert_eq!(here, -there);
                let gained = (way + 2.0 * here).norm() - distance;
                let missing = f64::max(wanted - distance, 0.0);
                assert!((gained - 0.7 * missing).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_site_at_a_border_draws_farther_away() {
        let crowding = Crowding::in_iteration(&SolverOptions::new(0.2), 0).unwrap();
        let relief = |is_at_border| {
            let rule = crowding.of_site(is_at_border);
            rule.relief(ways(0.2, &[at(0.18, 0.0)])).x
        };
        assert_eq!(relief(false), 0.0);
        assert!((relief(true) - 0.5 * 1.4 * 0.02).abs() < 1e-12);
    }

    #[test]
    fn neighbors_on_both_sides_leave_a_site_between_them() {
        let crowding = Crowding {
            nearest: 0.9,
            share: 0.7,
        };
        let relief = |places: &[Local]| crowding.relief(ways(1.0, places));
        let between = [at(0.8, 0.0), at(-0.8, 0.0), at(0.0, 0.95)];
        assert_eq!(relief(&between), Local::zeros());
        assert_eq!(relief(&[Local::zeros()]), Local::zeros());
    }

    #[test]
    fn a_site_slides_around_a_neighbor_that_it_would_leave() {
        let after = |step, others: &[Local]| without_leaving(step, ways(1.0, others));
        let others = [at(2.0, 0.0), at(2.2, 0.9), at(0.0, 1.0)];
        assert_eq!(after(at(0.3, 0.25), &others), at(0.3, 0.0));
        assert_eq!(after(at(0.3, -0.25), &others), at(0.3, -0.25));
        // From a neighbour that is nearer it may go, and from none there is nothing to leave.
        assert_eq!(after(at(0.3, 0.25), &[at(0.0, 0.89)]), at(0.3, 0.25));
        assert_eq!(after(at(0.3, 0.25), &[]), at(0.3, 0.25));
    }

    #[test]
    fn a_site_does_not_leave_a_neighbor_that_would_be_alone() {
        let after = |step, others: &[Local]| without_leaving(step, ways(1.0, others));
        let step = at(0.2, 0.3);
        // The vectors lead from the others to the site: one stands to its right, one below it.
        let (near, far) = (at(-0.8, 0.0), at(0.0, 1.1));
        assert_eq!(after(step, &[near, far]), at(0.2, 0.0));
        // With a third one nearer to it than the site is, the far one is not left alone.
        let third = far + at(0.6, 0.3);
        assert_eq!(after(step, &[near, far, third]), step);
        // This distance is usual.
        assert_eq!(after(step, &[near, at(0.0, 1.02)]), step);
    }

    #[test]
    fn sites_in_clumps_do_not_draw_apart() {
        for (seeds, draw_apart) in [
            (SeedRule::Hexagonal, true),
            (SeedRule::Poisson, true),
            (SeedRule::Area, false),
            (SeedRule::Random, false),
        ] {
            let options = SolverOptions {
                seeds,
                ..SolverOptions::new(0.1)
            };
            assert_eq!(Crowding::in_iteration(&options, 0).is_some(), draw_apart);
        }
    }
}
