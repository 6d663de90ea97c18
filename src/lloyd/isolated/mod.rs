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

mod blocks;
mod linked;
mod planes;
mod represented;
#[cfg(test)]
mod tests;

use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::{
    blocks::SeedBlocks,
    linked::visit_linked,
    planes::{SurfacePlane, lies_among_alike, lies_on_a_plane},
    represented::{
        Represented, VOXELS_OF_A_SEED, average_points, most_usual_points, own_points, usual_points,
    },
};
use super::{options::MANY_SEEDS, surface::Surface};
use crate::geometry::{ITEMS_PER_TASK, Local, NeighborGrid, by_position};

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
/// That share of a group that is alone, as clumps of wrong returns below a street are: a lamp has more.
const AVERAGE_SHARE_OF_A_GROUP_ALONE: f64 = 10.0;
/// So few points are a small group however sparse the scan is.
const FEW_POINTS_OF_A_GROUP: f64 = 4.0;

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
    blocks: SeedBlocks,
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
            blocks: SeedBlocks::new(surface, positions),
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

    /// No less than the number of points that voxels around the seed usually have.
    fn most_usual_points(&self, seed: usize) -> f64 {
        let block = self.blocks.of(seed);
        let most = || most_usual_points(self.surface, block);
        *block.most_usual_points.get_or_init(most)
    }

    /// No less than the number of points near any seed beside this one.
    fn most_near(&self, seed: usize) -> f64 {
        let block = self.blocks.of(seed);
        *block.most_near.get_or_init(|| {
            let [low, high] = block.corners_around(block.options.beside_radius());
            let mut most = 0.0_f64;
            let near = |other: u32, _| most = most.max(self.points(other as usize).near);
            self.grid.visit_box(low, high, near);
            most
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
        self.small_group(seed, |other| !self.is_lost(other))
            .is_some_and(|group| {
                let average_share = match self.is_alone(seed, &group) {
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

    /// Whether no company of the `group` of this seed is near.
    fn is_alone(&self, seed: usize, group: &[Local]) -> bool {
        let options = self.surface.options_at(self.positions[seed]);
        let mut is_alone = true;
        for &place in group {
            visit_linked(&self.grid, place, options.alone_radius(), |other, place| {
                is_alone = is_alone && (group.contains(&place) || !self.is_company(other));
            });
        }
        is_alone
    }

    /// Whether the seed is company for a small group: another drop of rain is none, nor another small group of few points. Lost
    /// seeds count among those that belong to it, so that no more of its surroundings matters than of any other seed's.
    fn is_company(&self, seed: usize) -> bool {
        let group = self.small_group(seed, |_| true);
        let is_small =
            group.is_some_and(|group| !self.are_dense(seed, &group, AVERAGE_SHARE_OF_A_GROUP));
        !is_small && !self.is_adrift(seed) && !self.is_a_speck(seed)
    }

    /// The seeds that belong to this one, itself among them, of those that `may_belong`; `None` if they are many. They are in
    /// the order of their positions: the verdict on a group is the same for all of its seeds.
    fn small_group(&self, seed: usize, may_belong: impl Fn(usize) -> bool) -> Option<Vec<Local>> {
        let place = self.positions[seed];
        let link = self.surface.options_at(place).link();
        let mut group = vec![place];
        let mut next = 0;
        while next < group.len() && group.len() < MANY_SEEDS {
            visit_linked(&self.grid, group[next], link, |other, place| {
                let are_few = group.len() < MANY_SEEDS;
                if are_few && !group.contains(&place) && may_belong(other) {
                    group.push(place);
                }
            });
            next += 1;
        }
        group.sort_unstable_by(by_position);
        (group.len() < MANY_SEEDS).then_some(group)
    }

    /// Whether the seed stands for next to nothing of what seeds around it usually do, and lies on no plane.
    fn is_a_speck(&self, seed: usize) -> bool {
        let own = self.points(seed).own;
        let is_next_to_nothing = |usual| own <= SHARE_OF_A_SPECK * (VOXELS_OF_A_SEED * usual);
        own <= AVERAGE_SHARE_OF_A_SPECK * average_points(self.surface)
            && is_next_to_nothing(self.most_usual_points(seed))
            && self.is_off_planes(seed)
            && is_next_to_nothing(self.usual_points(seed))
    }

    /// Whether the seed is thin and all that are linked to it are, however many, and they lie on no plane.
    fn is_adrift(&self, seed: usize) -> bool {
        // What is quick to find out comes first: hardly a seed is left when surroundings are looked at.
        let can_be = |seed: usize| self.is_sparse(seed) && self.can_be_thin(seed);
        if !can_be(seed) {
            return false;
        }
        let place = self.positions[seed];
        let options = self.surface.options_at(place);
        let mut linked = Vec::new();
        visit_linked(&self.grid, place, options.link(), |other, _| {
            linked.push(other);
        });
        linked.iter().all(|&other| can_be(other)) && self.is_off_planes(seed) && {
            // The surroundings of the seed with the most points tell most often that not all are thin.
            let fewest = |&other: &usize| self.points(other).fewest();
            linked.sort_unstable_by(|a, b| fewest(b).total_cmp(&fewest(a)));
            linked.into_iter().all(|other| self.is_thin(other))
        }
    }

    /// Whether the seed lies on no plane or line, neither of all seeds around it nor of the sparse ones.
    fn is_off_planes(&self, seed: usize) -> bool {
        !self.is_on_a_plane(seed) && !self.is_among_sparse(seed)
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

    /// Whether the seed stands for so few points that it can be thin.
    fn can_be_thin(&self, seed: usize) -> bool {
        let fewest = self.points(seed).fewest();
        fewest <= FEW_POINTS || fewest <= THIN_SHARE * self.most_usual_points(seed)
    }

    /// Whether the seed stands for next to nothing beside one on a surface that passes by it.
    fn is_beside_a_surface(&self, seed: usize) -> bool {
        if !is_small_beside(self.points(seed).near, self.most_near(seed)) {
            return false;
        }
        let place = self.positions[seed];
        let options = self.surface.options_at(place);
        let is_beside = |other: usize| {
            let is_off = |surface: &SurfacePlane| !surface.is_near(place, &options);
            let is_alike = |seed: usize| self.is_small_beside(seed, other);
            self.surface_of(other).is_some_and(is_off)
                && !lies_among_alike(&self.grid, place, &options, is_alike)
        };
        let mut is_beside_any = false;
        visit_linked(&self.grid, place, options.beside_radius(), |other, _| {
            is_beside_any = is_beside_any || self.is_small_beside(seed, other) && is_beside(other);
        });
        is_beside_any && !self.is_on_a_plane(seed)
    }

    /// Whether the seed stands for next to nothing compared with the `other`.
    fn is_small_beside(&self, seed: usize, other: usize) -> bool {
        is_small_beside(self.points(seed).near, self.points(other).near)
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

/// Whether a seed with so many points `near` it stands for next to nothing compared with one that has `others` near it.
fn is_small_beside(near: f64, others: f64) -> bool {
    near <= SHARE_BESIDE_A_SURFACE * others
}
