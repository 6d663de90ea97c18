//! The means of points by voxels, and how the points of each scatter around it.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::sorted_points::SortedPoints;
use crate::geometry::{Local, Quantization};

/// The points of a voxel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Voxel {
    /// The number of points.
    pub(super) count: u32,
    /// The sum of the products of two coordinates from the mean (CRS units squared).
    pub(super) scatter: Matrix3<f64>,
}

/// Points by voxels, whose grid begins at the origin of the quantization.
#[derive(Debug)]
pub(super) struct Voxels {
    /// The mean positions, in the order of the voxels by x, y and z.
    pub(super) means: Vec<Local>,
    /// What else is known of each voxel.
    pub(super) voxels: Vec<Voxel>,
    /// The index of the voxel of each point.
    pub(super) of_point: Vec<u32>,
}

impl Voxels {
    /// The voxels of this `edge` (CRS units) of `points`.
    pub(super) fn new(points: &SortedPoints, quantization: &Quantization, edge: f64) -> Self {
        let units = quantization.units(edge);
        let voxel_of = |c: i32| i64::from(c).div_euclid(units);

        // Sort the points by voxel; within a voxel they stay in the order of their positions.
        let keys = points
            .stored
            .par_iter()
            .zip(0_u32..points.stored.len() as u32);
        let mut keys: Vec<([i64; 3], u32)> = keys
            .map(|(p, index)| ([p.x, p.y, p.z].map(voxel_of), index))
            .collect();
        keys.par_sort_unstable();

        // Add up the points of each voxel.
        let groups: Vec<&[([i64; 3], u32)]> = keys.chunk_by(|a, b| a.0 == b.0).collect();
        let (means, voxels) = groups
            .par_iter()
            .map(|group| {
                let members = || group.iter().map(|&(_, index)| points.local[index as usize]);
                // From the first point on, so that nothing is lost far from the origin.
                let first = points.local[group[0].1 as usize];
                let sum: Local = members().map(|p| p - first).sum();
                let mean = first + sum / group.len() as f64;
                let scatter = members().map(|p| (p - mean) * (p - mean).transpose()).sum();
                let count = group.len() as u32;
                (mean, Voxel { count, scatter })
            })
            .unzip();
        let mut of_point = vec![0; points.stored.len()];
        for (number, group) in (0..).zip(&groups) {
            for &(_, index) in *group {
                of_point[index as usize] = number;
            }
        }
        Self {
            means,
            voxels,
            of_point,
        }
    }
}

impl Voxel {
    /// The variance of a point across a surface with this unit `normal`; `None` if one point says nothing of it.
    pub(super) fn variance(&self, normal: Local) -> Option<f64> {
        let degrees = self.count.checked_sub(1).filter(|&degrees| degrees > 0)?;
        Some((normal.dot(&(self.scatter * normal)) / f64::from(degrees)).max(0.0))
    }
}
