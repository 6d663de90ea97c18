//! What solving a tile leaves behind: its sites, and the records of its core.
//!
//! ```text
//!   magic, record length, core sites, band sites   4 × u64
//!   core sites, then band sites                    40 bytes each: identity 3 × i32,
//!                                                  exact u32, position 3 × f64
//!   records of the core's sites                    record length each
//! ```

use crate::geometry::{Local, Stored};

const MAGIC: u64 = u64::from_le_bytes(*b"lloydar2");
const SITE_BYTES: usize = 40;
const HEADER_BYTES: usize = 32;

/// A site after its tile was solved. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolvedSite {
    /// The input point at which the site was elected. The tile whose core contains it is the home
    /// of the site.
    pub identity: Stored,
    /// The position after the last iteration (local coordinates).
    pub position: Local,
    /// Whether the tile contains the whole dependency cone of the site, so that every tile that
    /// does computes the same bits.
    pub is_exact: bool,
}

/// The result of solving one tile.
#[derive(Clone, Debug, PartialEq, Default)]
pub(crate) struct SolvedTile {
    /// The sites whose home is this tile, sorted by identity.
    pub(crate) core: Vec<SolvedSite>,
    /// The sites in the band around the core, whose home is another tile, as this tile has solved
    /// them; sorted by identity.
    pub(crate) band: Vec<SolvedSite>,
    /// The record of the input point nearest to each site of the core, in their order.
    pub(crate) records: Vec<u8>,
    /// The length of a record, in bytes.
    pub(crate) record_length: usize,
}

impl SolvedTile {
    /// Encodes the tile as the head of this file describes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let sites = self.core.len() + self.band.len();
        let mut bytes = Vec::with_capacity(HEADER_BYTES + SITE_BYTES * sites + self.records.len());
        for number in [
            MAGIC,
            self.record_length as u64,
            self.core.len() as u64,
            self.band.len() as u64,
        ] {
            bytes.extend(number.to_le_bytes());
        }
        for site in self.core.iter().chain(&self.band) {
            encode(site, &mut bytes);
        }
        bytes.extend(&self.records);
        bytes
    }

    /// Decodes a tile; `None` if `bytes` encode none.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let word = |offset: usize| -> Option<u64> {
            Some(u64::from_le_bytes(
                bytes.get(offset..offset + 8)?.try_into().ok()?,
            ))
        };
        if word(0)? != MAGIC {
            return None;
        }
        let [record_length, core, band] = [word(8)?, word(16)?, word(24)?].map(usize::try_from);
        let (record_length, core, band) = (record_length.ok()?, core.ok()?, band.ok()?);
        let sites_bytes = core.checked_add(band)?.checked_mul(SITE_BYTES)?;
        let sites = bytes.get(HEADER_BYTES..HEADER_BYTES.checked_add(sites_bytes)?)?;
        let records = bytes.get(HEADER_BYTES + sites_bytes..)?;
        if records.len() != core.checked_mul(record_length)? {
            return None;
        }
        let mut sites = sites.chunks_exact(SITE_BYTES).map(decode);
        Some(Self {
            core: sites.by_ref().take(core).collect(),
            band: sites.collect(),
            records: records.to_vec(),
            record_length,
        })
    }
}

fn encode(site: &SolvedSite, bytes: &mut Vec<u8>) {
    for c in [site.identity.x, site.identity.y, site.identity.z] {
        bytes.extend(c.to_le_bytes());
    }
    bytes.extend(u32::from(site.is_exact).to_le_bytes());
    for c in site.position.iter() {
        bytes.extend(c.to_le_bytes());
    }
}

fn decode(bytes: &[u8]) -> SolvedSite {
    let integer = |offset: usize| {
        i32::from_le_bytes(
            bytes[offset..offset + 4]
                .try_into()
                .expect("four bytes were taken"),
        )
    };
    let real = |offset: usize| {
        f64::from_le_bytes(
            bytes[offset..offset + 8]
                .try_into()
                .expect("eight bytes were taken"),
        )
    };
    SolvedSite {
        identity: Stored {
            x: integer(0),
            y: integer(4),
            z: integer(8),
        },
        is_exact: integer(12) != 0,
        position: Local::new(real(16), real(24), real(32)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile() -> SolvedTile {
        let site = |i: i32| SolvedSite {
            identity: Stored { x: i, y: -i, z: 7 },
            position: Local::new(f64::from(i) * 0.1, 1.0 / 3.0, -2.5),
            is_exact: i % 2 == 0,
        };
        SolvedTile {
            core: (0..5).map(site).collect(),
            band: (5..12).map(site).collect(),
            records: (0..5 * 36).map(|b| b as u8).collect(),
            record_length: 36,
        }
    }

    #[test]
    fn a_decoded_tile_equals_the_encoded_one() {
        assert_eq!(SolvedTile::from_bytes(&tile().to_bytes()), Some(tile()));
    }

    #[test]
    fn a_cut_tile_is_not_decoded() {
        let bytes = tile().to_bytes();
        for at in 0..bytes.len() {
            assert_eq!(SolvedTile::from_bytes(&bytes[..at]), None, "cut at {at}");
        }
    }
}
