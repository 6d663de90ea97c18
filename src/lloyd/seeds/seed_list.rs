//! The seeds of a scan.

use crate::{
    geometry::{Local, Stored},
    lloyd::Scan,
};

/// Seeds, sorted by identity.
#[derive(Clone, Debug, Default)]
pub struct Seeds {
    /// The identities of the seeds, without repeats.
    pub identities: Vec<Stored>,
    /// The positions at which the seeds start (local coordinates).
    pub positions: Vec<Local>,
}

impl Seeds {
    /// Seeds at the points `identities`, which may be in any order and repeat.
    pub(super) fn at_points(scan: &Scan, mut identities: Vec<Stored>) -> Self {
        identities.sort_unstable();
        identities.dedup();
        Self {
            positions: identities
                .iter()
                .map(|&identity| scan.quantization().local(identity))
                .collect(),
            identities,
        }
    }

    /// Seeds of the given identities and positions, in any order; of equal identities the
    /// first is kept.
    pub(super) fn at_positions(mut seeds: Vec<(Stored, Local)>) -> Self {
        seeds.sort_unstable_by_key(|&(identity, _)| identity);
        seeds.dedup_by_key(|&mut (identity, _)| identity);
        let (identities, positions) = seeds.into_iter().unzip();
        Self {
            identities,
            positions,
        }
    }
}
