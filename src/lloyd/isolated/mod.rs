//! Isolated returns: seeds with next to nothing of the scan around them.
//!
//! Rain, birds, echoes between walls and beams that graze an edge leave points in the air. Where the output is coarser
//! than the scan, each of them becomes a site that stands for next to nothing. They are found among the seeds:
//!
//! ```text
//!     ·    ·               adrift: thin seeds, and none but thin ones linked to them, on no common plane: rain
//!   ·        ·  ·
//!        **                then one or two seeds, no other linked to them, that stand for hardly more points
//!              ·           of the scan than a seed around them: a bird, a leaf
//!   ─*──*──*──*──*──*──    beside a surface, and not on it: a seed that stands for next to nothing of what those
//!                          on the surface do; a speck: one that stands for next to nothing of what seeds around it
//!                          usually do, on no common plane with others
//! ```
//!
//! Seeds are linked if they are hardly farther apart than those of a surface. Thin seeds stand for no more points than a
//! part of a voxel around them usually has, and for fewer than seeds do on average. So a sparse surface stays, on which
//! thin seeds lie on a plane, and a lone thing stays that was scanned more densely than what is around it. Leaves around
//! a branch stay, too: a branch is no surface. The rule looks a fixed number of spacings around, so that all tiles agree.

mod linked;
mod planes;
mod represented;

use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::{
    linked::linked_to,
    planes::{SurfacePlane, lies_among_alike, lies_on_a_plane},
    represented::{Represented, VOXELS_OF_A_SEED, average_points, own_points, usual_points},
};
use super::{options::MANY_SEEDS, surface::Surface};
use crate::geometry::{ITEMS_PER_TASK, Local, NeighborGrid};

/// What becomes of isolated returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum IsolatedRule {
    /// They become points of the output like others.
    #[default]
    Keep,
    /// They are left out.
    Drop,
    /// Their points of the output get the class 7, noise.
    Mark,
}

impl IsolatedRule {
    /// Whether this is the default, which records do not state.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// So few points are few however sparse the scan is around them.
const FEW_POINTS: f64 = 2.0;
/// A seed is thin if it stands for no more points than this share of those that a voxel around it usually has.
const THIN_SHARE: f64 = 0.25;
/// A speck stands for no more points than this share of those that a seed around it usually does.
const SHARE_OF_A_SPECK: f64 = 0.02;
/// A speck stands for no more points than this share of those that a seed does on average.
const AVERAGE_SHARE_OF_A_SPECK: f64 = 0.2;
/// A seed beside a surface stands for no more than this share of the points of a seed on it.
const SHARE_BESIDE_A_SURFACE: f64 = 0.1;
/// A small group stands for no more points than so many seeds around it usually do.
const SEEDS_WORTH_OF_A_GROUP: f64 = 1.2;
/// A small group of no more points than this share of what a seed stands for on average is small however sparse the scan is
/// around it.
const AVERAGE_SHARE_OF_A_GROUP: f64 = 0.2;
/// That share where no other seed is near, as with clumps of wrong returns below a street: a lamp has more.
const AVERAGE_SHARE_OF_A_GROUP_ALONE: f64 = 3.0;
/// So few points are a small group however sparse the scan is.
const FEW_POINTS_OF_A_GROUP: f64 = 3.0;

/// Whether each of the seeds at `positions` is isolated. Those for which `matters` is false are not looked at.
pub(super) fn are_isolated(
    surface: Surface<'_>,
    positions: &[Local],
    matters: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    let seeds = Seeds::new(surface, positions);
    (0..positions.len())
        .into_par_iter()
        .with_max_len(ITEMS_PER_TASK)
        .map(|seed| matters(seed) && (seeds.is_lost(seed) || seeds.is_in_a_small_group(seed)))
        .collect()
}

/// The properties of a seed. Each is computed once, when it is first needed.
#[derive(Default)]
struct Properties {
    /// The points of the scan that the seed stands for.
    points: OnceLock<Represented>,
    /// The number of points that voxels around the seed usually have.
    usual_points: OnceLock<f64>,
    /// Whether the seed lies on a plane or line of the seeds around it.
    is_on_a_plane: OnceLock<bool>,
    /// Whether the seed lies on a plane or line of the sparse seeds around it.
    is_among_sparse: OnceLock<bool>,
    /// The surface that the seed lies on, if it is on one.
    surface: OnceLock<Option<Box<SurfacePlane>>>,
    /// Whether the seed is adrift, beside a surface, or a speck.
    is_lost: OnceLock<bool>,
}

/// The seeds of a cloud. In a tile most are in the halo, and only properties of those near its core are needed.
struct Seeds<'a> {
    surface: Surface<'a>,
    positions: &'a [Local],
    grid: NeighborGrid,
    properties: Vec<Properties>,
}

impl<'a> Seeds<'a> {
    /// The seeds at `positions`, with no property computed yet.
    fn new(surface: Surface<'a>, positions: &'a [Local]) -> Self {
        let link = surface.options.link();
        Self {
            surface,
            positions,
            grid: surface.field().grid_of_edge(positions, link),
            properties: positions.iter().map(|_| Properties::default()).collect(),
        }
    }

    /// The points of the scan that the seed stands for.
    fn points(&self, seed: usize) -> Represented {
        *self.properties[seed].points.get_or_init(|| {
            let place = self.positions[seed];
            let options = self.surface.options_at(place);
            Represented::by(self.surface.with(&options), place)
        })
    }

    /// The number of points that voxels around the seed usually have.
    fn usual_points(&self, seed: usize) -> f64 {
        *self.properties[seed].usual_points.get_or_init(|| {
            let place = self.positions[seed];
            let options = self.surface.options_at(place);
            usual_points(self.surface.with(&options), &[place])
        })
    }

    /// Whether the seed lies on a plane or line of the seeds around it.
    fn is_on_a_plane(&self, seed: usize) -> bool {
        *self.properties[seed].is_on_a_plane.get_or_init(|| {
            let place = self.positions[seed];
            lies_on_a_plane(&self.grid, place, &self.surface.options_at(place))
        })
    }

    /// Whether the seed lies on a plane or line of the sparse seeds around it.
    fn is_among_sparse(&self, seed: usize) -> bool {
        *self.properties[seed].is_among_sparse.get_or_init(|| {
            let place = self.positions[seed];
            let options = self.surface.options_at(place);
            lies_among_alike(&self.grid, place, &options, |other| self.is_sparse(other))
        })
    }

    /// Whether the seed is adrift, beside a surface, or a speck.
    fn is_lost(&self, seed: usize) -> bool {
        *self.properties[seed].is_lost.get_or_init(|| {
            self.is_adrift(seed) || self.is_beside_a_surface(seed) || self.is_a_speck(seed)
        })
    }

    /// Whether the seed and what belongs to it, without those that are lost, are few and stand for few points.
    fn is_in_a_small_group(&self, seed: usize) -> bool {
        let place = self.positions[seed];
        let options = self.surface.options_at(place);
        self.linked_seeds(seed, options.link())
            .is_some_and(|group| {
                let average_share = match self.is_alone(&group, options.plane_radius()) {
                    true => AVERAGE_SHARE_OF_A_GROUP_ALONE,
                    false => AVERAGE_SHARE_OF_A_GROUP,
                };
                !self.are_dense(seed, &group, average_share)
            })
    }

    /// Whether the `group` of this seed stands for more points than seeds around it usually do, and than this share of those
    /// that a seed does on average.
    fn are_dense(&self, seed: usize, group: &[Local], average_share: f64) -> bool {
        let options = self.surface.options_at(self.positions[seed]);
        let surface = self.surface.with(&options);
        let (own, usual) = match group {
            [_] => (self.points(seed).own, self.usual_points(seed)),
            _ => (own_points(surface, group), usual_points(surface, group)),
        };
        // A point more than the mean is usual by chance alone.
        let usual = SEEDS_WORTH_OF_A_GROUP * VOXELS_OF_A_SEED * (usual - 1.0);
        let few = average_share * average_points(surface);
        own > FEW_POINTS_OF_A_GROUP.max(few).max(usual)
    }

    /// Whether no seed but those of the `group` is within `radius` (CRS units) of them.
    fn is_alone(&self, group: &[Local], radius: f64) -> bool {
        let around = |&seed: &Local| linked_to(&self.grid, seed, radius);
        let mut around = group.iter().flat_map(around);
        around.all(|(_, place)| group.contains(&place))
    }

    /// The seeds that belong to this one, itself among them, without those that are lost; `None` if they are many.
    fn linked_seeds(&self, seed: usize, link: f64) -> Option<Vec<Local>> {
        let mut linked = vec![self.positions[seed]];
        let mut next = 0;
        while next < linked.len() {
            for (other, place) in linked_to(&self.grid, linked[next], link) {
                if !linked.contains(&place) && !self.is_lost(other) {
                    linked.push(place);
                }
                if linked.len() >= MANY_SEEDS {
                    return None;
                }
            }
            next += 1;
        }
        Some(linked)
    }

    /// Whether the seed stands for next to nothing of what seeds around it usually do, and lies on no plane.
    fn is_a_speck(&self, seed: usize) -> bool {
        let own = self.points(seed).own;
        let usual = || VOXELS_OF_A_SEED * self.usual_points(seed);
        own <= AVERAGE_SHARE_OF_A_SPECK * average_points(self.surface)
            && !self.is_on_a_plane(seed)
            && !self.is_among_sparse(seed)
            && own <= SHARE_OF_A_SPECK * usual()
    }

    /// Whether the seed is thin and all that are linked to it are, however many, and they lie on no plane.
    fn is_adrift(&self, seed: usize) -> bool {
        let place = self.positions[seed];
        let options = self.surface.options_at(place);
        let linked = linked_to(&self.grid, place, options.link());
        let mut linked: Vec<usize> = linked.map(|(other, _)| other).collect();
        // What is quick to find out comes first: hardly a seed of a surface is left when surroundings are looked at. Those
        // of the seed with the most points tell most often that not all are thin.
        linked.iter().all(|&other| self.is_sparse(other))
            && !self.is_on_a_plane(seed)
            && !self.is_among_sparse(seed)
            && {
                let fewest = |&other: &usize| self.points(other).fewest();
                linked.sort_unstable_by(|a, b| fewest(b).total_cmp(&fewest(a)));
                linked.into_iter().all(|other| self.is_thin(other))
            }
    }

    /// Whether the seed stands for no more points than seeds do on average.
    fn is_sparse(&self, seed: usize) -> bool {
        self.points(seed).fewest() <= f64::max(FEW_POINTS, average_points(self.surface))
    }

    /// Whether the seed stands for few points.
    fn is_thin(&self, seed: usize) -> bool {
        let fewest = self.points(seed).fewest();
        fewest <= FEW_POINTS || fewest <= THIN_SHARE * self.usual_points(seed)
    }

    /// Whether the seed stands for next to nothing beside one on a surface that passes by it.
    fn is_beside_a_surface(&self, seed: usize) -> bool {
        let place = self.positions[seed];
        let options = self.surface.options_at(place);
        let is_beside = |other: usize| {
            let is_off = |surface: &SurfacePlane| !surface.is_near(place, &options);
            let is_alike = |seed: usize| self.is_small_beside(seed, other);
            self.surface_of(other).is_some_and(is_off)
                && !lies_among_alike(&self.grid, place, &options, is_alike)
        };
        linked_to(&self.grid, place, options.beside_radius())
            .filter(|&(other, _)| self.is_small_beside(seed, other))
            .any(|(other, _)| is_beside(other))
            && !self.is_on_a_plane(seed)
    }

    /// Whether the seed stands for next to nothing compared with the `other`.
    fn is_small_beside(&self, seed: usize, other: usize) -> bool {
        self.points(seed).near <= SHARE_BESIDE_A_SURFACE * self.points(other).near
    }

    /// The surface that the seed lies on, if it is on one: of those around it that are not small beside it.
    fn surface_of(&self, seed: usize) -> Option<&SurfacePlane> {
        let surface = self.properties[seed].surface.get_or_init(|| {
            let place = self.positions[seed];
            let options = self.surface.options_at(place);
            let is_of_surface = |other: usize| !self.is_small_beside(other, seed);
            SurfacePlane::at(&self.grid, place, &options, is_of_surface).map(Box::new)
        });
        surface.as_deref()
    }
}

#[cfg(test)]
mod tests {
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
        let strays =
            even(12, 2.6).map(|p| Local::new(0.2 + 0.5 * p.x, 0.2 + p.y, 0.1 + 0.03 * p.z));
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
        let around = |count, edge: f64| {
            even(count, edge).map(move |p| p + center - Local::repeat(0.5 * edge))
        };
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
}
