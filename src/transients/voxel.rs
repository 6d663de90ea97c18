//! Voxels of one size, by their places in a grid.

use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
};

use crate::geometry::{Local, spread};

/// The edge of a voxel (m).
pub(crate) const VOXEL_EDGE: f64 = 0.25;

/// A voxel, by its place in the grid.
pub(super) type Voxel = [i32; 3];

/// What is known of voxels.
pub(super) type VoxelMap<T> = HashMap<Voxel, T, BuildHasherDefault<VoxelHasher>>;

/// A grid of voxels over local coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VoxelGrid {
    /// The edge of a voxel (CRS units).
    pub(crate) edge: f64,
}

impl VoxelGrid {
    /// The voxel at `place`, and where in it that is, in edges.
    pub(super) fn locate(self, place: Local) -> (Voxel, Local) {
        let scaled = place / self.edge;
        let corner = scaled.map(f64::floor);
        (
            [corner.x, corner.y, corner.z].map(|c| c as i32),
            scaled - corner,
        )
    }

    /// The voxel at `place`.
    pub(super) fn voxel(self, place: Local) -> Voxel {
        self.locate(place).0
    }
}

/// The 26 voxels around `voxel`, by face, edge or corner.
pub(super) fn around(voxel: Voxel) -> impl Iterator<Item = Voxel> {
    let steps = (0..27).filter(|&step| step != 13);
    steps.map(move |step| {
        let by = [step / 9, step / 3 % 3, step % 3];
        [0, 1, 2].map(|axis| voxel[axis].wrapping_add(by[axis] - 1))
    })
}

/// A hasher of voxels: the coordinates come one by one.
#[derive(Default)]
pub(super) struct VoxelHasher(u64);

impl Hasher for VoxelHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = spread(self.0 ^ u64::from_le_bytes(word));
        }
    }
}
