//! How facets are found among the samples around a site.
//!
//! Planes are fitted to the few samples around each of the nearest samples, and scored by the samples that lie
//! on them within a tolerance (MSAC: Torr, Zisserman, *MLESAC: a new robust estimator with application to estimating
//! image geometry*, 2000; with all candidates in turn instead of random ones). The best is fitted again to the samples
//! on it, weighted by Tukey's biweight of their distances; so is the best for those that are left.

use super::{
    Local, Patch,
    facets::{Facet, Facets, Second},
};

/// Radius of the neighbourhood in which facets are sought, in radii of the fit of a patch: the planes are to be seen
/// beyond the edge. On a simulated street points within two spacings of an edge are 0.0067 spacings from the truth with
/// 1.25, 0.0061 with 1.5, 0.0055 with 1.75.
pub(crate) const FACET_RADIUS_IN_FIT_RADII: f64 = 1.75;
/// Radius of the neighbourhood of a sample that a candidate is fitted to.
const CANDIDATE_RADIUS_IN_FIT_RADII: f64 = 0.42;
/// Distance from a facet within which samples lie on it.
const TOLERANCE_IN_FIT_RADII: f64 = 0.042;
/// Number of nearest samples around which candidates are fitted.
const CANDIDATES: usize = 16;
/// Number of times that a facet is fitted to the samples on it.
const ROUNDS: usize = 3;
/// A facet that explains a smaller share of the samples is none.
const LEAST_SHARE: f64 = 0.2;
/// Facets explain at least this share of the samples that the patch was fitted to: leaves and clutter have none.
const LEAST_EXPLAINED: f64 = 0.3;
/// Facets explain more of them than the patch, by this factor.
const LEAST_GAIN: f64 = 1.05;
/// A facet lies on one side of another if the samples on the wrong side have less than this share.
const WRONG_SIDE_SHARE: f64 = 0.15;

/// A sample around a site.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetSample {
    /// The sample, seen from the site (CRS units).
    way: Local,
    /// The square of its distance from the site (CRS units squared).
    distance_squared: f64,
    /// The weight that it has by itself.
    own: f64,
    /// Its weight in a fit.
    weight: f64,
    /// Its weight in a score.
    vote: f64,
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

/// The weight by a squared distance, which falls to 0 at the square of the radius.
fn nearness(distance_squared: f64, radius_squared: f64) -> f64 {
    let share = (1.0 - distance_squared / radius_squared).max(0.0);
    share * share
}

/// How near a surface is from which a sample has the distance `height`: 1 on it, falling to 0 at the `tolerance` (both in
/// CRS units).
fn closeness(height: f64, tolerance: f64) -> f64 {
    let share = height / tolerance;
    (1.0 - share * share).max(0.0)
}

/// The mean of `closeness` over the `samples` within `radius` (CRS units) of the site, by weight.
fn explained(samples: &[FacetSample], radius: f64, closeness: impl Fn(&FacetSample) -> f64) -> f64 {
    let (mut all, mut explained) = (0.0, 0.0);
    for sample in samples {
        let weight = nearness(sample.distance_squared, radius * radius) * sample.own;
        all += weight;
        explained += weight * closeness(sample);
    }
    explained / all
}

/// The search for facets among the samples around a site, from which they are seen.
struct Search<'a> {
    /// The samples, nearest first.
    samples: &'a [FacetSample],
    /// Distance from a facet within which samples lie on it (CRS units).
    tolerance: f64,
    /// The votes of all samples.
    votes: f64,
}

impl Search<'_> {
    /// The planes of the neighbourhoods of the nearest samples. `radius` is that of these neighbourhoods (CRS units).
    fn candidates(&self, radius: f64) -> Vec<Facet> {
        let squared = radius * radius;
        let nearest = self.samples.iter().take(CANDIDATES);
        let candidate = |center: &FacetSample| {
            // Samples beyond this distance from the site are not around the center, either.
            let farthest = (center.distance_squared.sqrt() + radius).powi(2);
            let count = self
                .samples
                .partition_point(|sample| sample.distance_squared < farthest);
            let around = self.samples[..count].iter().map(|sample| {
                let near = nearness((sample.way - center.way).norm_squared(), squared);
                (sample.way, near * sample.weight)
            });
            Facet::fit(around, self.tolerance)
        };
        nearest.filter_map(candidate).collect()
    }

    /// How near `facet` is to a sample.
    fn closeness(&self, facet: &Facet, sample: &FacetSample) -> f64 {
        closeness(facet.height(sample.way), self.tolerance)
    }

    /// The share of the votes that `facet` explains among the samples that are `left`.
    fn share(&self, facet: &Facet, left: impl Fn(&FacetSample) -> bool) -> f64 {
        let explained = self.samples.iter().filter(|sample| left(sample));
        let explained = explained.map(|sample| sample.vote * self.closeness(facet, sample));
        explained.sum::<f64>() / self.votes
    }

    /// The best facet of the samples that are `left`.
    fn best(
        &self,
        candidates: &[Facet],
        left: impl Fn(&FacetSample) -> bool + Copy,
    ) -> Option<Facet> {
        let (mut facet, share) = candidates
            .iter()
            .map(|facet| (*facet, self.share(facet, left)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        if share < LEAST_SHARE {
            return None;
        }
        for _ in 0..ROUNDS {
            let left = self.samples.iter().filter(|sample| left(sample));
            let on_it = left.map(|sample| {
                let closeness = self.closeness(&facet, sample);
                (sample.way, sample.weight * closeness * closeness)
            });
            facet = Facet::fit(on_it, f64::INFINITY)?;
        }
        Some(facet)
    }

    /// The side of `other` on which the samples on `facet` lie; 0 if they lie on both.
    fn side(&self, facet: &Facet, other: &Facet) -> f64 {
        let (mut towards, mut away) = (0.0, 0.0);
        for sample in self.samples {
            let height = other.height(sample.way);
            if facet.height(sample.way).abs() < self.tolerance && height.abs() > self.tolerance {
                match height > 0.0 {
                    true => towards += sample.vote,
                    false => away += sample.vote,
                }
            }
        }
        let wrong = WRONG_SIDE_SHARE * (towards + away);
        match (towards > wrong, away > wrong) {
            (true, false) => 1.0,
            (false, true) => -1.0,
            _ => 0.0,
        }
    }
}

impl Facets {
    /// Finds the facets near `site` among the `samples` around it, where they explain more of those within `fit_radius`
    /// (CRS units) than `patch` does, which was fitted to them. Positions nearer to an edge than `capture` (CRS units)
    /// are to be moved onto it. The samples are brought into the order of their distances.
    pub(crate) fn find(
        site: Local,
        samples: &mut [FacetSample],
        patch: &Patch,
        fit_radius: f64,
        capture: f64,
    ) -> Option<Self> {
        let tolerance = TOLERANCE_IN_FIT_RADII * fit_radius;
        let by_patch = explained(samples, fit_radius, |sample| {
            let [u, v, w] = patch.coordinates(site + sample.way);
            closeness(w - patch.height(u, v), tolerance)
        });
        if LEAST_GAIN * by_patch >= 1.0 {
            return None;
        }
        samples.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
        let search = Search {
            votes: samples.iter().map(|sample| sample.vote).sum(),
            tolerance,
            samples,
        };
        let candidates = search.candidates(CANDIDATE_RADIUS_IN_FIT_RADII * fit_radius);
        let first = search.best(&candidates, |_| true)?;
        let is_left = |sample: &FacetSample| first.height(sample.way).abs() > search.tolerance;
        let second = search.best(&candidates, is_left);
        let by_facets = explained(search.samples, fit_radius, |sample| {
            let on_second = second.map_or(0.0, |second| search.closeness(&second, sample));
            search.closeness(&first, sample).max(on_second)
        });
        // Written so that NaN fails.
        if !(by_facets >= LEAST_EXPLAINED && by_facets >= LEAST_GAIN * by_patch) {
            return None;
        }
        let moved = |facet: Facet| Facet {
            point: site + facet.point,
            ..facet
        };
        Some(Self {
            first: moved(first),
            capture,
            second: second.map(|second| Second {
                side_of_first: search.side(&first, &second),
                side_of_second: search.side(&second, &first),
                facet: moved(second),
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Dice, PatchKind};

    const RADIUS: f64 = 1.2;

    /// The facets near `site` on a `surface` over the plane, sampled every 0.2 with `noise`, and the patch there.
    fn found(
        surface: impl Fn(f64, f64) -> f64,
        noise: f64,
        site: Local,
    ) -> (Option<Facets>, Patch) {
        let mut dice = Dice(9);
        let mut places = Vec::new();
        for i in -20..20 {
            for j in -20..20 {
                let [x, y] = [i, j].map(|k| 0.2 * f64::from(k) + 0.1 * dice.roll());
                let height = surface(x, y) + noise * (dice.roll() - 0.5);
                places.push(Local::new(x, y, height));
            }
        }
        let patch = Patch::fit(site, &places, RADIUS, PatchKind::Quadratic).unwrap();
        let radius = FACET_RADIUS_IN_FIT_RADII * RADIUS;
        let near = places.iter().filter(|&p| (p - site).norm() < radius);
        let mut samples: Vec<FacetSample> = near
            .map(|&p| FacetSample::new(p, site, 1.0, radius))
            .collect();
        let facets = Facets::find(site, &mut samples, &patch, RADIUS, 0.0);
        (facets, patch)
    }

    /// A roof with its ridge along y, whose sides fall by half of the distance from it.
    fn roof(x: f64, _: f64) -> f64 {
        -0.5 * x.abs()
    }

    #[test]
    fn a_site_at_a_ridge_is_put_on_the_roof_that_a_patch_rounds() {
        for (x, noise) in [(0.0, 0.0), (0.15, 0.02), (-0.3, 0.02), (0.5, 0.02)] {
            let (facets, patch) = found(roof, noise, Local::new(x, 0.0, roof(x, 0.0)));
            let rounded = patch.foot_point(Local::new(x, 0.0, roof(x, 0.0)));
            let off = |p: Local| (p.z - roof(p.x, p.y)).abs();
            let foot = facets.expect("a ridge").foot_point(rounded);
            assert!(off(foot) < 0.012, "{x}: {} of {}", off(foot), off(rounded));
        }
    }

    #[test]
    fn what_is_smooth_or_in_disorder_has_no_facets() {
        assert!(
            found(|x, y| 0.1 * (x * x + y * y), 0.02, Local::zeros())
                .0
                .is_none()
        );
        assert!(found(|_, _| 0.0, 0.02, Local::zeros()).0.is_none());
        assert!(found(|_, _| 0.0, 1.5, Local::zeros()).0.is_none());
    }

    #[test]
    fn the_order_of_the_samples_does_not_matter() {
        let site = Local::new(0.1, 0.05, -0.05);
        let radius = FACET_RADIUS_IN_FIT_RADII * RADIUS;
        let mut dice = Dice(4);
        let mut places = Vec::new();
        for _ in 0..400 {
            let [x, y] = [0, 1].map(|_| 4.0 * dice.roll() - 2.0);
            places.push(Local::new(x, y, roof(x, y)));
        }
        let patch = Patch::fit(site, &places, RADIUS, PatchKind::Quadratic).unwrap();
        let find = |places: &[Local]| {
            let near = places.iter().filter(|&p| (p - site).norm() < radius);
            let samples = near.map(|&p| FacetSample::new(p, site, 1.0, radius));
            Facets::find(site, &mut samples.collect::<Vec<_>>(), &patch, RADIUS, 0.0)
        };
        let facets = find(&places);
        places.reverse();
        assert!(facets.is_some());
        assert_eq!(facets, find(&places));
    }
}
