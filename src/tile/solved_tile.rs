//! What solving a tile leaves behind: the sites and the records of its core, and the sites of its band.
//!
//! ```text
//!   the core                                     the band, read without it
//!     magic, record length, sites   3 × u64        magic, sites   2 × u64
//!     sites                         40 bytes each: identity 3 × i32, exact u32, position 3 × f64
//!     records of the sites          record length each
//! ```

use crate::geometry::{Local, Stored};

const CORE_MAGIC: u64 = u64::from_le_bytes(*b"lloydar3");
const BAND_MAGIC: u64 = u64::from_le_bytes(*b"lloydarb");
const SITE_BYTES: usize = 40;
const CORE_HEADER_BYTES: usize = 24;
const BAND_HEADER_BYTES: usize = 16;

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
    /// What is at home in the tile.
    pub(crate) core: SolvedCore,
    /// The sites around the core, whose home is another tile, as this tile has solved
    /// them; sorted by identity.
    pub(crate) band: Vec<SolvedSite>,
}

/// The sites whose home is a tile, with their records.
#[derive(Clone, Debug, PartialEq, Default)]
pub(crate) struct SolvedCore {
    /// The sites, sorted by identity.
    pub(crate) sites: Vec<SolvedSite>,
    /// The record of the input point nearest to each site, in their order.
    pub(crate) records: Vec<u8>,
    /// The length of a record, in bytes.
    pub(crate) record_length: usize,
}

impl SolvedTile {
    /// Encodes core and band as the head of this file describes.
    pub(crate) fn to_bytes(&self) -> [Vec<u8>; 2] {
        let SolvedCore {
            sites,
            records,
            record_length,
        } = &self.core;
        let core = [CORE_MAGIC, *record_length as u64, sites.len() as u64];
        let mut core = core.map(u64::to_le_bytes).concat();
        core.reserve_exact(SITE_BYTES * sites.len() + records.len());
        sites.iter().for_each(|site| encode(site, &mut core));
        core.extend(records);
        let band = [BAND_MAGIC, self.band.len() as u64];
        let mut band = band.map(u64::to_le_bytes).concat();
        self.band.iter().for_each(|site| encode(site, &mut band));
        [core, band]
    }
}

impl SolvedCore {
    /// Decodes a core; `None` if `bytes` encode none.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [magic, record_length, sites] = words(bytes)?;
        let [record_length, sites] = [record_length, sites].map(usize::try_from);
        let (record_length, count) = (record_length.ok()?, sites.ok()?);
        let (sites, records) = bytes
            .get(CORE_HEADER_BYTES..)?
            .split_at_checked(count.checked_mul(SITE_BYTES)?)?;
        let is_core = magic == CORE_MAGIC && records.len() == count.checked_mul(record_length)?;
        is_core.then(|| Self {
            sites: sites.chunks_exact(SITE_BYTES).map(decode).collect(),
            records: records.to_vec(),
            record_length,
        })
    }
}

/// Decodes the sites of a band; `None` if `bytes` encode none.
pub(crate) fn band_from_bytes(bytes: &[u8]) -> Option<Vec<SolvedSite>> {
    let [magic, count] = words(bytes)?;
    let sites = bytes.get(BAND_HEADER_BYTES..)?;
    let is_band = magic == BAND_MAGIC
        && sites.len() == usize::try_from(count).ok()?.checked_mul(SITE_BYTES)?;
    is_band.then(|| sites.chunks_exact(SITE_BYTES).map(decode).collect())
}

/// The numbers at the beginning of `bytes`.
fn words<const N: usize>(bytes: &[u8]) -> Option<[u64; N]> {
    let mut words = [0; N];
    for (word, bytes) in words.iter_mut().zip(bytes.get(..8 * N)?.chunks_exact(8)) {
        *word = u64::from_le_bytes(bytes.try_into().ok()?);
    }
    Some(words)
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
            core: SolvedCore {
                sites: (0..5).map(site).collect(),
                records: (0..5 * 36).map(|b| b as u8).collect(),
                record_length: 36,
            },
            band: (5..12).map(site).collect(),
        }
    }

    #[test]
    fn a_decoded_tile_equals_the_encoded_one() {
        let [core, band] = tile().to_bytes();
        assert_eq!(SolvedCore::from_bytes(&core), Some(tile().core));
        assert_eq!(band_from_bytes(&band), Some(tile().band));
        assert_eq!(SolvedCore::from_bytes(&band), None);
        assert_eq!(band_from_bytes(&core), None);
    }

    #[test]
    fn a_cut_tile_is_not_decoded() {
        let [core, band] = tile().to_bytes();
        for at in 0..core.len() {
            assert_eq!(SolvedCore::from_bytes(&core[..at]), None, "cut at {at}");
        }
        for at in 0..band.len() {
            assert_eq!(band_from_bytes(&band[..at]), None, "cut at {at}");
        }
    }
}
