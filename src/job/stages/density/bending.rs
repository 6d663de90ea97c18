//! The spacing that follows the curvature of the surface.
//!
//! A spacing `h` on a surface of the curvature `k` turns it by the angle `k h` from one point to the next, and
//! the chord between them leaves it by `k h² / 8`. The wanted spacing keeps the angle:
//!
//! ```text
//!   h = angle / k,   not below `bent` and not above `flat`
//! ```
//!
//! The curvature of noisy points depends on the scale at which they are looked at: too fine, and noise is curvature; too
//! coarse, and an edge is none. So the scale is the spacing itself. From the coarsest, `flat`, to the finest, `bent`,
//! each halved, a scale is accepted if a quadratic patch of its size describes the surface without more curvature
//! than a spacing of that scale may have. On flat ground that is the coarsest one, where noise is averaged most:
//!
//! ```text
//!   scale h ─► means of voxels of h / 3 ─► patch of radius 1.5 h ─► k h ≤ angle, little left over? ─► angle / k
//!        ▲                                                                 │ no
//!        └───────────────────────────── h / 2 ◄────────────────────────────┘
//! ```
//!
//! What no scale accepts is an edge, a corner or a kerb, and gets `bent`, if enough of its neighbourhood is a
//! surface. In leaves and on wires it is not: they get `flat`, since more points would not describe them better.

use rayon::prelude::*;

use super::{
    sorted_points::SortedPoints,
    voxels::{Voxel, Voxels},
};
use crate::geometry::{Local, NeighborGrid, Patch, PatchKind, Quantization};

/// The angle (radians) by which a surface turns from one point to the next: the chord leaves it by 1/27 of a spacing, and
/// a circle has 21 points.
const ANGLE: f64 = 0.3;
/// The radius of a patch in spacings of its scale, and the edge of the voxels whose means it is fitted to: some 60 of
/// them lie on it.
const RADIUS_IN_SPACINGS: f64 = 1.5;
const VOXEL_IN_SPACINGS: f64 = 1.0 / 3.0;
/// What a patch may leave unexplained, in spacings of its scale, beyond noise: a step of a tenth of a spacing leaves as
/// much.
const LARGEST_RESIDUAL_IN_SPACINGS: f64 = 0.03;
/// What it may leave unexplained if it is to be a surface at all, and not leaves.
const LARGEST_SURFACE_RESIDUAL_IN_SPACINGS: f64 = 0.06;
/// Points that are less round are a wire.
const LEAST_ROUNDNESS: f64 = 0.2;
/// The variance that is put down to noise, over its estimate: points of a voxel come from the same sweep of a scanner, and
/// differ less than sweeps do. With 2, a residual of 0.02 and 530 points to the square metre, with noise of 1 cm, 20 % of a
/// road were not flat at `flat` 0.2 and `bent` 0.05, with 4 it was 0.1 %, with a residual of 0.03 none.
const NOISE_MARGIN: f64 = 4.0;
/// A patch on fewer means says nothing.
const LEAST_SUPPORT: u32 = 9;
/// A scale that is less than this times the finest is left out.
const LEAST_STEP: f64 = 1.4;
/// The radius of the neighbourhood of an edge, in finest spacings, and the least share of surfaces in it: with 0.6 half of
/// the kerbs of a street are taken for clutter, with 0.4 one in a hundred.
const EDGE_RADIUS_IN_SPACINGS: f64 = 4.0;
const LEAST_SURFACE_SHARE: f64 = 0.4;

/// A spacing that follows the curvature. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bending {
    /// The spacing where the surface is flat.
    pub(super) flat: f64,
    /// The spacing at edges.
    pub(super) bent: f64,
}

/// What is known of the spacing at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Finding {
    /// No scale so far is fine enough; the coarsest spacing that the last one allows.
    Open(f64),
    /// A scale describes the surface, with this spacing.
    Surface(f64),
    /// Nothing more can be said than this spacing.
    Unknown(f64),
}

/// What a patch says at a scale.
enum Judgement {
    /// There are too few points.
    TooFew,
    /// The patch describes the surface and allows the scale; the spacing that it wants.
    Accepted(f64),
    /// The scale is too coarse; the spacing that the patch wants, and whether it describes a surface at all.
    TooCoarse(f64, bool),
}

impl Bending {
    /// How far (CRS units, in the plane) the spacing of a point depends on others.
    #[cfg(test)]
    pub(super) fn reach(self) -> f64 {
        let patch = RADIUS_IN_SPACINGS + 2.0 * VOXEL_IN_SPACINGS;
        let edge = EDGE_RADIUS_IN_SPACINGS + 2.0 * VOXEL_IN_SPACINGS;
        patch * self.flat + edge * self.bent
    }

    /// The scales, the coarsest first.
    fn scales(self) -> Vec<f64> {
        let halved = std::iter::successors(Some(self.flat), |scale| Some(0.5 * scale));
        let coarser = halved.take_while(|&scale| scale > LEAST_STEP * self.bent);
        coarser.chain([self.bent]).collect()
    }

    /// The spacing at each of `points`, in their order.
    pub(super) fn spacings(self, points: &SortedPoints, quantization: &Quantization) -> Vec<f64> {
        if self.bent >= self.flat {
            return vec![self.flat; points.stored.len()];
        }
        let mut findings = vec![Finding::Open(self.flat); points.stored.len()];
        let scales = self.scales();
        for (number, &scale) in scales.iter().enumerate() {
            let is_coarsest = number == 0;
            let voxels = Voxels::new(points, quantization, VOXEL_IN_SPACINGS * scale);
            let judgements = self.judgements(&voxels, &findings, scale);
            let is_surface = |voxel: u32| {
                matches!(
                    judgements[voxel as usize],
                    Some(Judgement::Accepted(_) | Judgement::TooCoarse(_, true))
                )
            };
            if scale == self.bent {
                return self.settled(&voxels, &findings, &judgements, is_surface);
            }
            let updated = |(finding, &voxel): (&mut Finding, &u32)| {
                let Finding::Open(before) = *finding else {
                    return;
                };
                *finding = match judgements[voxel as usize] {
                    Some(Judgement::Accepted(spacing)) => Finding::Surface(spacing),
                    Some(Judgement::TooCoarse(spacing, _)) => Finding::Open(spacing),
                    _ if is_coarsest => Finding::Unknown(self.flat),
                    _ => Finding::Unknown(before),
                };
            };
            let of_point = voxels.of_point.par_iter();
            findings.par_iter_mut().zip(of_point).for_each(updated);
        }
        vec![self.flat; points.stored.len()]
    }

    /// What patches say at `scale` of the voxels with points whose findings are open.
    fn judgements(
        self,
        voxels: &Voxels,
        findings: &[Finding],
        scale: f64,
    ) -> Vec<Option<Judgement>> {
        let mut is_open = vec![false; voxels.means.len()];
        for (finding, &voxel) in findings.iter().zip(&voxels.of_point) {
            is_open[voxel as usize] |= matches!(finding, Finding::Open(_));
        }
        let grid = NeighborGrid::new(&voxels.means, RADIUS_IN_SPACINGS * scale);
        let means = voxels.means.par_iter().zip(is_open);
        means
            .map_init(
                || (Vec::new(), Vec::new()),
                |(near, members), (&mean, is_open)| {
                    is_open.then(|| {
                        near.clear();
                        members.clear();
                        let radius = RADIUS_IN_SPACINGS * scale;
                        grid.visit_around(mean, radius, |index, point| {
                            if (point - mean).norm_squared() < radius * radius {
                                near.push(point);
                                members.push(voxels.voxels[index as usize]);
                            }
                        });
                        self.judgement(mean, near, members, scale)
                    })
                },
            )
            .collect()
    }

    /// What the patch around `mean` says at `scale`, fitted to the means `near`.
    fn judgement(self, mean: Local, near: &[Local], members: &[Voxel], scale: f64) -> Judgement {
        let radius = RADIUS_IN_SPACINGS * scale;
        let patch = Patch::fit(mean, near, radius, PatchKind::Quadratic);
        let Some(patch) = patch.filter(|patch| patch.support >= LEAST_SUPPORT) else {
            return Judgement::TooFew;
        };
        let curvature = patch.largest_curvature();
        let spacing = (ANGLE / curvature).clamp(self.bent, self.flat);
        let left = patch.residual.powi(2) - NOISE_MARGIN * noise(&patch, near, members);
        let is_clean = left <= (LARGEST_RESIDUAL_IN_SPACINGS * scale).powi(2);
        let is_surface = patch.roundness >= LEAST_ROUNDNESS
            && left <= (LARGEST_SURFACE_RESIDUAL_IN_SPACINGS * scale).powi(2);
        match is_clean && is_surface && curvature * scale <= ANGLE {
            true => Judgement::Accepted(spacing),
            false => Judgement::TooCoarse(spacing, is_surface),
        }
    }

    /// The spacings, once the finest scale is judged.
    fn settled(
        self,
        voxels: &Voxels,
        findings: &[Finding],
        judgements: &[Option<Judgement>],
        is_surface: impl Fn(u32) -> bool,
    ) -> Vec<f64> {
        // A voxel is one of a surface if the finest scale describes one, or a coarser one did at one of its points.
        let mut surface: Vec<bool> = (0..voxels.means.len() as u32).map(is_surface).collect();
        for (finding, &voxel) in findings.iter().zip(&voxels.of_point) {
            surface[voxel as usize] |= matches!(finding, Finding::Surface(_));
        }
        let radius = EDGE_RADIUS_IN_SPACINGS * self.bent;
        let grid = NeighborGrid::new(&voxels.means, radius);
        let edge_spacing = |mean: Local| {
            let mut counts = [0_u32; 2];
            grid.visit_around(mean, radius, |index, point| {
                if (point - mean).norm_squared() <= radius * radius {
                    counts[0] += u32::from(surface[index as usize]);
                    counts[1] += 1;
                }
            });
            let is_edge = f64::from(counts[0]) >= LEAST_SURFACE_SHARE * f64::from(counts[1]);
            if is_edge { self.bent } else { self.flat }
        };
        let of_voxel: Vec<f64> = judgements
            .par_iter()
            .zip(&voxels.means)
            .map(|(judgement, &mean)| match judgement {
                Some(Judgement::Accepted(spacing)) => *spacing,
                Some(Judgement::TooCoarse(..)) => edge_spacing(mean),
                Some(Judgement::TooFew) | None => f64::NAN,
            })
            .collect();
        let spacing = |(finding, &voxel): (&Finding, &u32)| match *finding {
            Finding::Surface(spacing) | Finding::Unknown(spacing) => spacing,
            Finding::Open(before) => {
                let found = of_voxel[voxel as usize];
                if found.is_nan() { before } else { found }
            }
        };
        findings.iter().zip(&voxels.of_point).map(spacing).collect()
    }
}

/// The variance across `patch` that noise gives to the means `near`, by the scatter of the points in their voxels. The median
/// of the voxels is not misled by those in which there is an edge.
fn noise(patch: &Patch, near: &[Local], members: &[Voxel]) -> f64 {
    let variance = |(&mean, voxel): (&Local, &Voxel)| {
        let [u, v, _] = patch.coordinates(mean);
        let variance = voxel.variance(patch.normal_at(u, v))?;
        // The median of a χ² distribution over its mean, after Wilson and Hilferty.
        let degrees = f64::from(voxel.count - 1);
        Some(variance / (1.0 - 2.0 / (9.0 * degrees)).powi(3))
    };
    let mut variances: Vec<f64> = near.iter().zip(members).filter_map(variance).collect();
    if variances.is_empty() {
        return 0.0;
    }
    let middle = variances.len() / 2;
    let (_, &mut median, _) = variances.select_nth_unstable_by(middle, f64::total_cmp);
    let shares = members.iter().map(|voxel| 1.0 / f64::from(voxel.count));
    median * shares.sum::<f64>() / members.len() as f64
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::{
        geometry::{Stored, spread},
        simulate::{SimulatedPoint, Street, StreetOptions},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.0005,
        offset: [431_000.0, 5_400_000.0, 100.0],
    };

    /// A simulated street, with at most four points to a voxel of two fifths of `finest`.
    fn street(finest: f64, points: u64) -> (Street, Vec<(Stored, SimulatedPoint)>) {
        let street = Street::new(StreetOptions {
            length: 40.0,
            points,
            ..StreetOptions::default()
        });
        let all = (0..2).flat_map(|pass| (0..street.slices(pass)).map(move |slice| (pass, slice)));
        let all = all.flat_map(|(pass, slice)| street.slice(pass, slice));
        let mut voxels: HashMap<[i64; 3], Vec<(u64, Stored, SimulatedPoint)>> = HashMap::new();
        for point in all {
            let stored = QUANTIZATION.quantise(point.position).unwrap();
            let edge = QUANTIZATION.units(finest / 2.5);
            let voxel = [stored.x, stored.y, stored.z].map(|c| i64::from(c).div_euclid(edge));
            let rank = [stored.x, stored.y, stored.z];
            let rank = rank.iter().fold(1, |hash, &c| spread(hash ^ c as u64));
            voxels.entry(voxel).or_default().push((rank, stored, point));
        }
        let mut thinned = Vec::new();
        for (_, mut points) in voxels {
            points.sort_by_key(|(rank, ..)| *rank);
            thinned.extend(points.into_iter().take(4).map(|(_, s, p)| (s, p)));
        }
        (street, thinned)
    }

    /// What stands where on the street, by what is known of it.
    fn share_below(
        group: impl Fn(&Street, &SimulatedPoint) -> bool,
        cloud: &(Street, Vec<(Stored, SimulatedPoint)>),
        points: &SortedPoints,
        spacings: &[f64],
        limit: f64,
    ) -> f64 {
        let (street, thinned) = cloud;
        let of_point = points.order.iter().zip(spacings);
        let group: Vec<f64> = of_point
            .filter(|(index, _)| group(street, &thinned[**index as usize].1))
            .map(|(_, &spacing)| spacing)
            .collect();
        assert!(group.len() > 1000, "{}", group.len());
        let below = group.iter().filter(|&&spacing| spacing < limit).count();
        below as f64 / group.len() as f64
    }

    #[test]
    fn noise_does_not_bend_a_road_and_kerbs_are_found() {
        let (flat, bent) = (0.5, 0.1);
        let cloud = street(bent, 800_000);
        let stored: Vec<Stored> = cloud.1.iter().map(|(s, _)| *s).collect();
        let points = SortedPoints::new(&stored, &QUANTIZATION);
        let spacings = Bending { flat, bent }.spacings(&points, &QUANTIZATION);
        assert!(spacings.iter().all(|h| (bent..=flat).contains(h)));
        let below = |group: &dyn Fn(&Street, &SimulatedPoint) -> bool, limit: f64| {
            share_below(group, &cloud, &points, &spacings, limit)
        };
        let to_edge = |street: &Street, p: &SimulatedPoint| street.distance_to_edge(p.position);
        let road = below(
            &|s, p| p.class == 11 && to_edge(s, p) > 1.6 * flat,
            0.8 * flat,
        );
        assert!(road < 0.005, "{road}");
        let is_low = |p: &SimulatedPoint| p.class != 6 && p.position[2] < 100.4;
        let kerb = below(&|s, p| is_low(p) && to_edge(s, p) < 0.6 * bent, 1.2 * bent);
        assert!(kerb > 0.9, "{kerb}");
        let facade = below(&|s, p| p.class == 6 && to_edge(s, p) < bent, 0.8 * flat);
        assert!(facade > 0.6, "{facade}");
    }

    /// A cylinder and a plane beside it, without noise.
    #[test]
    fn a_cylinder_has_the_spacing_of_its_radius() {
        let radius = 0.8;
        let mut stored = Vec::new();
        for i in 0..400 {
            for j in 0..100 {
                let (along, around) = (0.02 * f64::from(j), 0.0075 * f64::from(i));
                let on_cylinder = Local::new(radius * around.cos(), along, radius * around.sin());
                let on_plane = Local::new(10.0 + 0.02 * f64::from(i % 100), along, 0.3);
                let offset = Local::from(QUANTIZATION.offset);
                for position in [on_cylinder, on_plane] {
                    stored.extend(QUANTIZATION.quantise((position + offset).into()));
                }
            }
        }
        let points = SortedPoints::new(&stored, &QUANTIZATION);
        let bending = Bending {
            flat: 0.4,
            bent: 0.1,
        };
        let spacings = bending.spacings(&points, &QUANTIZATION);
        for (point, spacing) in points.local.iter().zip(spacings) {
            let is_inside = (0.6..1.4).contains(&point.y) && point.z > 0.25;
            match point.x > 5.0 {
                true => assert_eq!(spacing, 0.4),
                false if is_inside => assert!(
                    (spacing / (ANGLE * radius) - 1.0).abs() < 0.15,
                    "{spacing} at {point}"
                ),
                false => {}
            }
        }
    }
}
