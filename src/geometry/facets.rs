//! Facets: the planes that a surface consists of near a sharp edge.
//!
//! A quadratic patch rounds an edge. Where it does, the planes that meet there describe the
//! samples better, and a position belongs on the nearest of them:
//!
//! ```text
//!       · · · · ·╲            ·   samples
//!     ───────────  ╲          ─   facets; each ends where it meets the other
//!              x │   ╲        x   a site on the rounded patch
//!                │·
//!                │·
//! ```
//!
//! Planes are fitted to the few samples around each of the nearest samples, and scored by the samples that lie
//! on them within a tolerance (MSAC: Torr, Zisserman, *MLESAC: a new robust estimator*, 2000; with all candidates in
//! turn instead of random ones). The best is fitted again to the samples on it, weighted by
//! Tukey's biweight of their distances; so is the best for those that are left.

use nalgebra::Matrix3;

use super::{Local, Patch, narrow_frame};

/// Radius of the neighbourhood in which facets are sought, in radii of the fit of a patch: the planes are to be seen
/// beyond the edge.
pub(crate) const FACET_RADIUS_IN_FIT_RADII: f64 = 1.75;
/// Radius of the neighbourhood of a sample that a candidate is fitted to.
const CANDIDATE_RADIUS_IN_FIT_RADII: f64 = 0.42;
/// Distance from a facet within which samples lie on it.
const TOLERANCE_IN_FIT_RADII: f64 = 0.042;
/// Number of nearest samples around which candidates are fitted.
const CANDIDATES: usize = 16;
/// Fewest samples of a candidate.
const LEAST_SUPPORT: usize = 5;
/// Samples of a candidate that are less round lie on a line.
const LEAST_ROUNDNESS_SQUARED: f64 = 0.02;
/// Number of times that a facet is fitted to the samples on it.
const ROUNDS: usize = 3;
/// A facet that explains a smaller share of the samples, by weight, is none.
const LEAST_SHARE: f64 = 0.2;
/// Facets explain at least this share of the samples around a position, by weight: leaves and clutter have none.
const LEAST_EXPLAINED_SHARE: f64 = 0.6;
/// Facets explain more of the samples than a patch, by this factor.
const LEAST_GAIN: f64 = 1.05;
/// Facets whose normals differ less (by the sine of their angle) do not meet near by.
const LEAST_SINE: f64 = 0.3;
/// A position nearer than this to both facets is on their edge.
const EDGE_WIDTH_IN_CAPTURES: f64 = 0.01;
/// A facet lies on one side of another if the samples on the wrong side have less than this share of the weight.
const WRONG_SIDE_SHARE: f64 = 0.15;

/// A sample around a position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetSample {
    /// The sample, seen from the position (CRS units).
    way: Local,
    /// Its weight in a fit.
    weight: f64,
    /// Its weight in a score.
    vote: f64,
}

/// A plane through `point` with this unit `normal`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Facet {
    point: Local,
    normal: Local,
}

/// A second facet, and how both end.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Second {
    facet: Facet,
    /// The side of the second facet on which the first lies: 1 towards the normal, −1 away from it, 0 for both.
    side_of_first: f64,
    /// The side of the first facet on which the second lies.
    side_of_second: f64,
}

/// The planes near an edge, one or two of them.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Facets {
    first: Facet,
    second: Option<Second>,
    /// Positions nearer to the edge than this (CRS units) are moved onto it.
    capture: f64,
}

impl FacetSample {
    /// The sample at `position` in the neighbourhood of `site` with this `radius` (CRS units). `weight` is that which it
    /// has by itself.
    pub(crate) fn new(position: Local, site: Local, weight: f64, radius: f64) -> Self {
        let way = position - site;
        let near = nearness(way.norm_squared(), radius * radius);
        Self {
            way,
            weight: near * weight,
            vote: near * weight.sqrt(),
        }
    }

    /// The square of the distance from the position (CRS units squared).
    fn distance_squared(&self) -> f64 {
        self.way.norm_squared()
    }
}

/// The weight by a squared distance, which falls to 0 at the square of the radius.
fn nearness(distance_squared: f64, radius_squared: f64) -> f64 {
    let share = (1.0 - distance_squared / radius_squared).max(0.0);
    share * share
}

impl Facet {
    /// The distance of `position` from the plane, positive towards the normal (CRS units).
    fn height(&self, position: Local) -> f64 {
        self.normal.dot(&(position - self.point))
    }

    /// The plane that fits the `weighted` positions best; `None` if they are too few, lie on a
    /// line, or are on average farther from it than `largest_residual` (CRS units).
    fn fit(weighted: impl Iterator<Item = (Local, f64)>, largest_residual: f64) -> Option<Self> {
        let (mut total, mut count) = (0.0, 0);
        let (mut sum, mut squares) = (Local::zeros(), Matrix3::zeros());
        for (position, weight) in weighted.filter(|&(_, weight)| weight > 0.0) {
            let scaled = position * weight;
            total += weight;
            count += 1;
            sum += scaled;
            squares += scaled * position.transpose();
        }
        if count < LEAST_SUPPORT {
            return None;
        }
        let point = sum / total;
        let covariance = squares / total - point * point.transpose();
        let (spread, [_, _, normal]) = narrow_frame(covariance)?;
        let is_round = spread[1] >= LEAST_ROUNDNESS_SQUARED * spread[0];
        let is_plane = spread[2] <= largest_residual * largest_residual;
        (is_round && is_plane).then_some(Self { point, normal })
    }
}

/// The search for facets among the samples around a position, from which they are seen.
struct Search<'a> {
    samples: &'a [FacetSample],
    tolerance: f64,
    /// The votes of all samples.
    votes: f64,
}

impl Search<'_> {
    /// The planes of the neighbourhoods of the nearest samples. `radius` is that of these neighbourhoods (CRS units).
    fn candidates(&self, radius: f64) -> impl Iterator<Item = Facet> {
        let squared = radius * radius;
        self.samples
            .iter()
            .take(CANDIDATES)
            .filter_map(move |center| {
                let around = self.samples.iter().map(|sample| {
                    let distance_squared = (sample.way - center.way).norm_squared();
                    (
                        sample.way,
                        nearness(distance_squared, squared) * sample.weight,
                    )
                });
                Facet::fit(around, self.tolerance)
            })
    }

    /// How near to `facet` a sample is: 1 on it, falling to 0 at the tolerance.
    fn closeness(&self, facet: &Facet, sample: &FacetSample) -> f64 {
        let height = facet.height(sample.way) / self.tolerance;
        (1.0 - height * height).max(0.0)
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
            let on_it = self
                .samples
                .iter()
                .filter(|sample| left(sample))
                .map(|sample| {
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
                let sum = if height > 0.0 {
                    &mut towards
                } else {
                    &mut away
                };
                *sum += sample.vote;
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
        let order = |a: &FacetSample, b: &FacetSample| {
            a.distance_squared().total_cmp(&b.distance_squared())
        };
        samples.sort_by(order);
        let search = Search {
            votes: samples.iter().map(|sample| sample.vote).sum(),
            tolerance: TOLERANCE_IN_FIT_RADII * fit_radius,
            samples,
        };
        let radius = CANDIDATE_RADIUS_IN_FIT_RADII * fit_radius;
        let candidates: Vec<Facet> = search.candidates(radius).collect();
        let first = search.best(&candidates, |_| true)?;
        let is_left = |sample: &FacetSample| first.height(sample.way).abs() > search.tolerance;
        let second = search.best(&candidates, is_left);

        // Both are judged by the samples that the patch was fitted to.
        let (mut all, mut by_facets, mut by_patch) = (0.0, 0.0, 0.0);
        for sample in search.samples {
            let [u, v, w] = patch.coordinates(site + sample.way);
            let height = (w - patch.height(u, v)) / search.tolerance;
            let on_first = search.closeness(&first, sample);
            let on_second = second.map_or(0.0, |second| search.closeness(&second, sample));
            let near = nearness(sample.distance_squared(), fit_radius * fit_radius);
            all += near * sample.weight;
            by_facets += near * sample.weight * on_first.max(on_second);
            by_patch += near * sample.weight * (1.0 - height * height).max(0.0);
        }
        if by_facets < LEAST_EXPLAINED_SHARE * all || by_facets < LEAST_GAIN * by_patch {
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

    /// The foot point of `position` on the nearest facet, or on the edge where the facet ends before it.
    pub(crate) fn foot_point(&self, position: Local) -> Local {
        let (facet, other) = self.nearest(position);
        let foot = position - facet.normal * facet.height(position);
        let Some((other, side)) = other else {
            return foot;
        };
        let edge = to_edge(foot, &facet, &other).filter(|edge| {
            let is_beyond = other.height(foot) * side < 0.0;
            is_beyond || self.has_edge() && (edge - foot).norm() <= self.capture
        });
        edge.unwrap_or(foot)
    }

    /// The unit normal, of either sign, of the facet on which `position` lies; `None` if that is the edge.
    pub(crate) fn normal(&self, position: Local) -> Option<Local> {
        let (facet, other) = self.nearest(position);
        let is_on_edge = other.is_some_and(|(other, _)| {
            other.height(position).abs() <= EDGE_WIDTH_IN_CAPTURES * self.capture
        });
        (!is_on_edge).then_some(facet.normal)
    }

    /// Whether both facets end where they meet.
    fn has_edge(&self) -> bool {
        let ends = |second: &Second| second.side_of_first != 0.0 && second.side_of_second != 0.0;
        self.second.as_ref().is_some_and(ends)
    }

    /// The facet nearest to `position`, and the other with the side of it on which the nearest lies.
    fn nearest(&self, position: Local) -> (Facet, Option<(Facet, f64)>) {
        let first = self.first;
        match self.second {
            None => (first, None),
            Some(second) => {
                let heights = [first, second.facet].map(|facet| facet.height(position).abs());
                match heights[0] <= heights[1] {
                    true => (first, Some((second.facet, second.side_of_first))),
                    false => (second.facet, Some((first, second.side_of_second))),
                }
            }
        }
    }
}

/// The point of the line where `facet` meets `other` that is nearest to `position`, which is on `facet`; `None` if they
/// are nearly parallel.
fn to_edge(position: Local, facet: &Facet, other: &Facet) -> Option<Local> {
    let across = other.normal - facet.normal * facet.normal.dot(&other.normal);
    let squared = across.norm_squared();
    let is_steep = squared >= LEAST_SINE * LEAST_SINE;
    is_steep.then(|| position - across * (other.height(position) / squared))
}
