//! The samples among which facets are sought, and how well a surface explains them.

use super::{Local, facets::Facet, lanes::LANES};

/// A sample around a site.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetSample {
    /// The sample, seen from the site (CRS units).
    pub(super) way: Local,
    /// The square of its distance from the site (CRS units squared).
    pub(super) distance_squared: f64,
    /// The weight that it has by itself.
    own: f64,
    /// Its weight in a fit.
    pub(super) weight: f64,
    /// Its weight in a score.
    pub(super) vote: f64,
}

impl FacetSample {
    /// The sample at `position` in the neighbourhood of `site` with this `radius` (CRS units). `weight` is that which it
    /// has by itself.
    pub(crate) fn new(position: Local, site: Local, weight: f64, radius: f64) -> Self {
        let way = position - site;
        let distance_squared = way.norm_squared();
        let near = nearness(distance_squared, radius * radius);
        Self {
            way,
            distance_squared,
            own: weight,
            weight: near * weight,
            vote: near * weight.sqrt(),
        }
    }
}

/// The samples that vote on facets, in groups of [`LANES`]: three coordinates seen from the site (CRS units), and the vote. The
/// processor counts the votes of a group at once, and single precision is enough to tell which facet is the best.
pub(super) struct Voters(Vec<[[f32; LANES]; 4]>);

impl Voters {
    /// The votes of these `samples`.
    pub(super) fn new(samples: &[FacetSample]) -> Self {
        let group = |samples: &[FacetSample]| {
            // The last group is filled up with samples that have no vote.
            let mut group = [[0.0; LANES]; 4];
            for (lane, sample) in samples.iter().enumerate() {
                let [x, y, z] = sample.way.into();
                for (values, value) in group.iter_mut().zip([x, y, z, sample.vote]) {
                    values[lane] = value as f32;
                }
            }
            group
        };
        Self(samples.chunks(LANES).map(group).collect())
    }

    /// The votes for `facet`: of each sample as much of its vote as it is near to the facet, in tolerances.
    pub(super) fn votes_for(&self, facet: &Facet, tolerance: Tolerance) -> f64 {
        let normal = facet.normal * tolerance.reciprocal;
        let [x, y, z, offset] =
            [normal.x, normal.y, normal.z, normal.dot(&facet.point)].map(|value| value as f32);
        let mut votes = [0.0; LANES];
        for [xs, ys, zs, vote] in &self.0 {
            for lane in 0..LANES {
                let height = x * xs[lane] + y * ys[lane] + z * zs[lane] - offset;
                votes[lane] += vote[lane] * (1.0 - height * height).max(0.0);
            }
        }
        votes.into_iter().map(f64::from).sum()
    }
}

/// The weight by a squared distance, which falls to 0 at the square of the radius.
pub(super) fn nearness(distance_squared: f64, radius_squared: f64) -> f64 {
    let share = (1.0 - distance_squared / radius_squared).max(0.0);
    share * share
}

/// The distance from a surface within which samples lie on it.
#[derive(Clone, Copy)]
pub(super) struct Tolerance {
    /// The distance (CRS units), and its reciprocal: divisions took a fifth of the time of a search.
    pub(super) distance: f64,
    reciprocal: f64,
}

impl Tolerance {
    /// Samples nearer than `distance` (CRS units) lie on a surface.
    pub(super) fn new(distance: f64) -> Self {
        Self {
            distance,
            reciprocal: 1.0 / distance,
        }
    }

    /// How near a surface is from which a sample has the distance `height` (CRS units): 1 on it, falling to 0 at the
    /// tolerance.
    #[inline]
    pub(super) fn closeness(self, height: f64) -> f64 {
        let share = height * self.reciprocal;
        (1.0 - share * share).max(0.0)
    }
}

/// The mean of `closeness` over the `samples` within `radius` (CRS units) of the site, by weight.
pub(super) fn explained(
    samples: &[FacetSample],
    radius: f64,
    closeness: impl Fn(&FacetSample) -> f64,
) -> f64 {
    let (mut all, mut explained) = (0.0, 0.0);
    for sample in samples {
        let weight = nearness(sample.distance_squared, radius * radius) * sample.own;
        all += weight;
        explained += weight * closeness(sample);
    }
    explained / all
}

/// The correlation between the `residual` of one of the `samples` and that of the sample nearest to it; 0 if no sample has
/// a residual.
pub(super) fn correlation_of_neighbors(
    samples: &[FacetSample],
    residual: impl Fn(&FacetSample) -> f64,
) -> f64 {
    let residuals: Vec<f64> = samples.iter().map(residual).collect();
    let (mut products, mut squares) = (0.0, 0.0);
    for (own, sample) in samples.iter().enumerate() {
        let (mut nearest, mut least) = (own, f64::INFINITY);
        for (other, neighbor) in samples.iter().enumerate() {
            let distance = (neighbor.way - sample.way).norm_squared();
            if distance < least && other != own {
                (nearest, least) = (other, distance);
            }
        }
        products += residuals[own] * residuals[nearest];
        squares += residuals[own] * residuals[own];
    }
    if squares > 0.0 {
        products / squares
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Dice;

    #[test]
    fn votes_in_groups_are_those_of_one_sample_after_the_other() {
        let mut dice = Dice(3);
        let mut roll = || 2.0 * dice.roll() - 1.0;
        let facet = Facet {
            point: Local::new(0.1, -0.2, 0.05),
            normal: Local::new(0.1, 0.2, 1.0).normalize(),
        };
        let tolerance = Tolerance::new(0.4);
        // The last group is full, or has room.
        for count in [0, 1, 7, 8] {
            let places = (0..count).map(|_| Local::new(roll(), roll(), roll()));
            let samples: Vec<FacetSample> = places
                .map(|place| FacetSample::new(place, Local::zeros(), 2.0, 2.0))
                .collect();
            let of_one = |s: &FacetSample| s.vote * tolerance.closeness(facet.height(s.way));
            let votes: f64 = samples.iter().map(of_one).sum();
            let in_groups = Voters::new(&samples).votes_for(&facet, tolerance);
            assert!(
                (in_groups - votes).abs() <= 1e-6 * votes,
                "{in_groups}, {votes}"
            );
        }
    }

    #[test]
    fn neighbors_agree_about_an_edge_and_not_about_noise() {
        let at =
            |k: i32| FacetSample::new(Local::new(f64::from(k), 0.0, 0.0), Local::zeros(), 1.0, 9.0);
        // Pairs of samples: 0 and 1, 3 and 4, 6 and 7.
        let samples = [0, 1, 3, 4, 6, 7].map(at);
        let column = |sample: &FacetSample| sample.way.x as i32;
        let of_pair = |sample: &FacetSample| if column(sample) / 3 == 1 { -1.0 } else { 1.0 };
        let of_one = |sample: &FacetSample| if column(sample) % 3 == 0 { -1.0 } else { 1.0 };
        assert_eq!(correlation_of_neighbors(&samples, of_pair), 1.0);
        assert_eq!(correlation_of_neighbors(&samples, of_one), -1.0);
        assert_eq!(correlation_of_neighbors(&samples, |_| 0.0), 0.0);
    }
}
