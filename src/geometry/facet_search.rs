//! How facets are found among the samples around a site.
//!
//! Planes are fitted to the few samples around each of some samples near the site, and scored by the samples that lie
//! on them within a tolerance (MSAC: Torr, Zisserman, *MLESAC: a new robust estimator with application to estimating
//! image geometry*, 2000; with all candidates in turn instead of random ones). The best is fitted again to the samples
//! on it, weighted by Tukey's biweight of their distances; so are the best for those that are left. At the end all are
//! fitted again, each to the samples that no other facet explains: a sample at an edge is the mean of points on both
//! sides, and lies on neither.
//!
//! How far from a facet a sample may lie follows from the noise of the scan, which is what the flattest candidates have.
//! Noise must not be taken for edges. A patch that rounds an edge misses samples next to each other on the same side;
//! where it misses them by noise, the sides of neighbours have nothing to do with each other, and no search is
//! made. Two planes through the two halves of a noisy layer are one facet, and planes that run through each other
//! are none.

use super::{
    Local, Patch,
    facet_samples::{
        FacetSample, Tolerance, Voters, correlation_of_neighbors, explained, nearness,
    },
    facets::{Facet, Facets, MOST_FACETS},
};

/// Radius of the neighbourhood of a sample that a candidate is fitted to.
const CANDIDATE_RADIUS_IN_FIT_RADII: f64 = 0.42;
/// Distance from a facet within which samples lie on it where the scan has no noise.
const LEAST_TOLERANCE_IN_FIT_RADII: f64 = 0.042;
/// A larger distance would make planes of anything.
const LARGEST_TOLERANCE_IN_FIT_RADII: f64 = 0.25;
/// The distance where the scan has noise, in standard deviations of the flattest quarter of candidates, which is less than the
/// noise: they have few samples.
const TOLERANCE_IN_DEVIATIONS: f64 = 6.0;
/// The share of that distance within which facets and patch are compared: with the whole of it a patch that rounds an edge explains
/// nearly as much as the facets that meet there.
const COMPARED_TOLERANCE: f64 = 0.67;
/// Number of samples around which candidates are fitted.
const CANDIDATES: usize = 24;
/// Distance from the site within which these samples lie: of the nearest alone hardly any is far enough from an edge
/// for a plane.
const CANDIDATES_WITHIN_FIT_RADII: f64 = 1.5;
/// Number of times that a facet is fitted to the samples on it.
const PASSES: usize = 2;
/// Number of times that all facets are fitted to the samples on one of them alone.
const JOINT_PASSES: usize = 2;
/// A first facet that explains a smaller share of the samples is none.
const LEAST_SHARE: f64 = 0.2;
/// A further facet that explains a smaller share of the samples is none.
const LEAST_FURTHER_SHARE: f64 = 0.1;
/// Facets explain at least this share of the samples that the patch was fitted to: leaves and clutter have none.
const LEAST_EXPLAINED: f64 = 0.3;
/// A single facet explains as much more than the patch does: by noise alone a plane often explains a little more.
const LEAST_GAIN_OF_ONE: f64 = 0.1;
/// Several may explain a little less: each of them ends where it meets the next, and the patch does not. Without this 35 % of the places
/// along the edges of a simulated street had no site, at a noise of 0.08 spacings, and with it 34 %; points at edges are up to 3 % nearer to
/// the truth.
const LEAST_GAIN_OF_SEVERAL: f64 = -0.1;
/// Correlation between the residuals of samples next to each other from which on they may be due to an edge. On a
/// simulated street with noise of 0.09 spacings that spares two thirds of the searches.
const LEAST_CORRELATION: f64 = 0.05;
/// A patch with a larger quadratic term at the radius of its fit may follow an edge so closely that the residuals do not tell: a
/// search is made in any case. Without that 13 % of the sites on the edges of a simulated street had no search, with it 4 %, in the same time.
const LARGEST_BEND_IN_FIT_RADII: f64 = 0.2;
/// Nearly parallel planes nearer to each other than this number of tolerances are the same facet.
const APART_IN_TOLERANCES: f64 = 4.0;
/// A facet lies on one side of another if the samples on the wrong side have less than this share.
const WRONG_SIDE_SHARE: f64 = 0.15;

/// A plane fitted to the samples around one of them.
struct Candidate {
    facet: Facet,
    /// The standard deviation of those samples from it (CRS units).
    deviation: f64,
}

/// The planes around some of the `samples`, spread over the neighbourhood, by the radius of the fit of the patch (CRS
/// units).
fn candidates(samples: &[FacetSample], fit_radius: f64) -> Vec<Candidate> {
    let radius = CANDIDATE_RADIUS_IN_FIT_RADII * fit_radius;
    let squared = radius * radius;
    let within = count_within(samples, CANDIDATES_WITHIN_FIT_RADII * fit_radius);
    let count = within.min(CANDIDATES);
    let centers = (0..count).map(|k| &samples[k * within / count]);
    let candidate = |center: &FacetSample| {
        // Samples that are nearer to the site, or farther from it, are not around the center.
        let distance = center.distance_squared.sqrt();
        let nearest = count_within(samples, (distance - radius).max(0.0));
        let around = samples[nearest..count_within(samples, distance + radius)].iter();
        let with_distance = around.map(|sample| (sample, (sample.way - center.way).norm_squared()));
        let weighted = with_distance
            .filter(|&(_, distance)| distance < squared)
            .map(|(sample, distance)| (sample.way, nearness(distance, squared) * sample.weight));
        let (facet, deviation) = Facet::fit(weighted)?;
        Some(Candidate { facet, deviation })
    };
    centers.filter_map(candidate).collect()
}

/// The number of `samples`, which come nearest first, that are nearer to the site than `radius` (CRS units).
fn count_within(samples: &[FacetSample], radius: f64) -> usize {
    samples.partition_point(|sample| sample.distance_squared < radius * radius)
}

/// The distance from a facet within which samples lie on it: the larger, the noisier the scan is. What the noise is the flattest
/// of the `candidates` tell, since others lie across an edge. `None` in leaves and clutter, where none is flat.
fn tolerance(candidates: &[Candidate], fit_radius: f64) -> Option<Tolerance> {
    if candidates.is_empty() {
        return None;
    }
    let mut deviations: Vec<f64> = candidates.iter().map(|one| one.deviation).collect();
    let quarter = deviations.len() / 4;
    let (_, noise, _) = deviations.select_nth_unstable_by(quarter, f64::total_cmp);
    let in_noise = TOLERANCE_IN_DEVIATIONS * *noise / fit_radius;
    let share = in_noise.max(LEAST_TOLERANCE_IN_FIT_RADII);
    (share <= LARGEST_TOLERANCE_IN_FIT_RADII).then(|| Tolerance::new(share * fit_radius))
}

/// The search for facets among the samples around a site, from which they are seen.
struct Search<'a> {
    /// The samples, nearest first.
    samples: &'a [FacetSample],
    tolerance: Tolerance,
}

impl Search<'_> {
    /// How near `facet` is to `position`.
    fn closeness(&self, facet: &Facet, position: Local) -> f64 {
        self.tolerance.closeness(facet.height(position))
    }

    /// The facets that explain the most samples, the best first, each by those that the former ones leave.
    fn facets(&self, mut candidates: Vec<Facet>) -> Vec<Facet> {
        let mut facets: Vec<Facet> = Vec::with_capacity(MOST_FACETS);
        let votes: f64 = self.samples.iter().map(|sample| sample.vote).sum();
        let mut left = self.samples.to_vec();
        let mut least = LEAST_SHARE * votes;
        let apart = APART_IN_TOLERANCES * self.tolerance.distance;
        while facets.len() < MOST_FACETS
            && let Some((index, facet)) = self.best(&candidates, &left, least)
        {
            candidates.remove(index);
            candidates.retain(|candidate| !candidate.is_near(&facet, apart));
            // Fitted to the samples on it, a facet may come near to a former one.
            if facets.iter().any(|former| facet.is_near(former, apart)) {
                continue;
            }
            left.retain(|sample| facet.height(sample.way).abs() > self.tolerance.distance);
            facets.push(facet);
            least = LEAST_FURTHER_SHARE * votes;
        }
        facets
    }

    /// The best facet of the samples that are `left`, and the index of the candidate that it was fitted from; `None` if
    /// those on it have less than the `least` votes.
    fn best(
        &self,
        candidates: &[Facet],
        left: &[FacetSample],
        least: f64,
    ) -> Option<(usize, Facet)> {
        let voters = Voters::new(left);
        let (index, most) = candidates
            .iter()
            .map(|facet| voters.votes_for(facet, self.tolerance))
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        if most < least {
            return None;
        }
        let mut facet = candidates[index];
        for _ in 0..PASSES {
            let on_it = left.iter().map(|sample| {
                let closeness = self.closeness(&facet, sample.way);
                (sample.way, sample.weight * closeness * closeness)
            });
            facet = Facet::fit(on_it)?.0;
        }
        Some((index, facet))
    }

    /// Fits all `facets` again, each to the samples on it and on no other. One with too few of them stays.
    fn fit_together(&self, facets: &mut [Facet]) {
        let mut weighted: [Vec<(Local, f64)>; MOST_FACETS] = Default::default();
        for sample in self.samples {
            let mut on_it = (0..facets.len())
                .map(|index| (index, self.closeness(&facets[index], sample.way)))
                .filter(|&(_, closeness)| closeness > 0.0);
            if let (Some((index, closeness)), None) = (on_it.next(), on_it.next()) {
                weighted[index].push((sample.way, sample.weight * closeness * closeness));
            }
        }
        for (facet, weighted) in facets.iter_mut().zip(weighted) {
            if let Some((fitted, _)) = Facet::fit(weighted.into_iter()) {
                *facet = fitted;
            }
        }
    }

    /// Whether the `facets` explain enough of the samples that are `near`, within `fit_radius` (CRS units), and more than the
    /// patch does, of which each sample has this `residual`.
    fn are_better(
        &self,
        facets: &[Facet],
        near: &[FacetSample],
        fit_radius: f64,
        residual: impl Fn(&FacetSample) -> f64,
    ) -> bool {
        let compared = Tolerance::new(COMPARED_TOLERANCE * self.tolerance.distance);
        let by_facets = explained(near, fit_radius, |sample| {
            let closeness = |facet: &Facet| compared.closeness(facet.height(sample.way));
            facets.iter().map(closeness).fold(0.0, f64::max)
        });
        let by_patch = explained(near, fit_radius, |sample| {
            compared.closeness(residual(sample))
        });
        let gain = match facets {
            [_] => LEAST_GAIN_OF_ONE,
            _ => LEAST_GAIN_OF_SEVERAL,
        };
        // NaN is no explanation.
        by_facets >= LEAST_EXPLAINED && by_facets > by_patch + gain
    }

    /// For each of the `facets`, the sides of the others on which it lies; 0 for both. Only samples that are `near` count: beyond the
    /// corner of a window the wall goes on, on both sides of the plane of the reveal.
    fn sides(&self, facets: &[Facet], near: &[FacetSample]) -> [[f64; MOST_FACETS]; MOST_FACETS] {
        let tolerance = self.tolerance.distance;
        let mut towards = [[0.0; MOST_FACETS]; MOST_FACETS];
        let mut away = towards;
        for sample in near {
            let mut heights = [f64::INFINITY; MOST_FACETS];
            for (height, facet) in heights.iter_mut().zip(facets) {
                *height = facet.height(sample.way);
            }
            let on_it = (0..facets.len()).filter(|&index| heights[index].abs() < tolerance);
            for own in on_it {
                for (other, &height) in heights[..facets.len()].iter().enumerate() {
                    if height > tolerance {
                        towards[own][other] += sample.vote;
                    } else if height < -tolerance {
                        away[own][other] += sample.vote;
                    }
                }
            }
        }
        let side = |towards: f64, away: f64| {
            let wrong = WRONG_SIDE_SHARE * (towards + away);
            match (towards > wrong, away > wrong) {
                (true, false) => 1.0,
                (false, true) => -1.0,
                _ => 0.0,
            }
        };
        std::array::from_fn(|own| {
            std::array::from_fn(|other| side(towards[own][other], away[own][other]))
        })
    }
}

impl Facets {
    /// Finds the facets near `site` among the `samples` around it, where they explain more of those within `fit_radius`
    /// (CRS units) than `patch` does, which was fitted to such samples. Positions nearer to an edge than `capture` (CRS
    /// units) are to be moved onto it. The samples are brought into the order of their distances.
    pub(crate) fn find(
        site: Local,
        samples: &mut [FacetSample],
        patch: &Patch,
        fit_radius: f64,
        capture: f64,
    ) -> Option<Self> {
        samples.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
        let near = &samples[..count_within(samples, fit_radius)];
        let residual = |sample: &FacetSample| {
            let [u, v, w] = patch.coordinates(site + sample.way);
            w - patch.height(u, v)
        };
        let bend = patch.max_quadratic_term(fit_radius);
        if bend < LARGEST_BEND_IN_FIT_RADII * fit_radius
            && correlation_of_neighbors(near, residual) < LEAST_CORRELATION
        {
            return None;
        }
        let candidates = candidates(samples, fit_radius);
        let tolerance = tolerance(&candidates, fit_radius)?;
        let search = Search { samples, tolerance };
        let flat = candidates
            .iter()
            .filter(|one| one.deviation <= tolerance.distance);
        let mut facets = search.facets(flat.map(|one| one.facet).collect());
        for _ in 0..JOINT_PASSES {
            search.fit_together(&mut facets);
        }
        if !search.are_better(&facets, near, fit_radius, residual) {
            return None;
        }
        let sides = search.sides(&facets, near);
        let run_through_each_other = sides[0][1] == 0.0 && sides[1][0] == 0.0;
        if facets.len() == 2 && run_through_each_other {
            return None;
        }
        for facet in &mut facets {
            facet.point += site;
        }
        Some(Self {
            all: facets,
            sides,
            capture,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Dice, PatchKind, WIDE_RADIUS_IN_FIT_RADII};

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
        let radius = WIDE_RADIUS_IN_FIT_RADII * RADIUS;
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
    fn a_ridge_is_found_in_noise_that_is_larger_than_the_least_tolerance() {
        let noise = 4.0 * LEAST_TOLERANCE_IN_FIT_RADII * RADIUS;
        let [mut on_facets, mut on_patches] = [0.0; 2];
        for k in 0..40 {
            let x = 0.01 * f64::from(k) - 0.2;
            let site = Local::new(x, 0.2, roof(x, 0.2));
            let (facets, patch) = found(roof, noise, site);
            let rounded = patch.foot_point(site);
            let off = |p: Local| (p.z - roof(p.x, p.y)).abs();
            on_patches += off(rounded);
            on_facets += off(facets.map_or(rounded, |facets| facets.foot_point(rounded)));
        }
        assert!(on_facets < 0.5 * on_patches, "{on_facets} {on_patches}");
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
    fn noise_is_no_edge() {
        // Planes through parts of such a layer explain more of it than a patch does, at each of these sites.
        let noise = 4.0 * LEAST_TOLERANCE_IN_FIT_RADII * RADIUS;
        let sites = (0..40).map(|k| Local::new(0.05 * f64::from(k) - 1.0, 0.3, 0.0));
        let edges = sites.filter(|&site| found(|_, _| 0.0, noise, site).0.is_some());
        let edges = edges.count();
        assert!(edges <= 2, "{edges}");
    }

    #[test]
    fn planes_through_two_halves_of_a_layer_are_one_facet() {
        let above = Facet {
            point: Local::new(0.0, 0.0, 0.1),
            normal: Local::z(),
        };
        let below = Facet {
            point: Local::zeros(),
            normal: -Local::z(),
        };
        let across = Facet {
            point: Local::zeros(),
            normal: Local::x(),
        };
        assert!(above.is_near(&below, 0.2) && !above.is_near(&below, 0.05));
        assert!(!above.is_near(&across, 0.2));
    }

    #[test]
    fn the_order_of_the_samples_does_not_matter() {
        let site = Local::new(0.1, 0.05, -0.05);
        let radius = WIDE_RADIUS_IN_FIT_RADII * RADIUS;
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
