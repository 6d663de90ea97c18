//! What a solved tile leaves behind: its sites, and the records of its core.
//!
//! One file a tile, complete or not there: its presence is the checkpoint.
//!
//! ```text
//!   magic, record length, core sites, band sites   4 × u64
//!   core sites, then band sites                    40 bytes each
//!   records of the core's sites                    record length each
//! ```

use std::path::{Path, PathBuf};

use super::{TileError, read_whole, write_whole};
use crate::geometry::{Local, Stored};

const MAGIC: u64 = u64::from_le_bytes(*b"lloydar2");
const SITE_BYTES: usize = 40;
const HEADER_BYTES: usize = 32;

/// A site as its tile left it. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolvedSite {
    /// The point it was elected at; decides its home.
    pub identity: Stored,
    /// Where it ended.
    pub position: Local,
    /// Whether the tile saw everything it depends on.
    pub is_exact: bool,
}

/// The result of solving one tile.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SolvedTile {
    /// Sites at home in the tile's core, by identity.
    pub core: Vec<SolvedSite>,
    /// Sites at home around it, as this tile sees them, by identity.
    pub band: Vec<SolvedSite>,
    /// For every site of the core the record of the nearest input point.
    pub records: Vec<u8>,
    /// Length of a record in bytes.
    pub record_length: usize,
}

/// The name of the file of tile `tile` in the job directory `dir`.
pub fn solved_path(dir: &Path, tile: u32) -> PathBuf {
    dir.join(format!("tile-{tile:06}.solved"))
}

impl SolvedTile {
    /// Writes the file of tile `tile` in `dir`, complete or not at all.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] with the file's name.
    pub fn write(&self, dir: &Path, tile: u32) -> Result<u64, TileError> {
        let path = solved_path(dir, tile);
        let mut bytes =
            Vec::with_capacity(HEADER_BYTES + SITE_BYTES * self.core.len() + self.records.len());
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
        write_whole(&path, &bytes).map_err(|source| TileError::io("write", &path, source))?;
        Ok(bytes.len() as u64)
    }

    /// Reads the file of tile `tile` in `dir`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read, [`TileError::Damaged`] if it is
    /// not what [`write`](Self::write) wrote.
    pub fn read(dir: &Path, tile: u32) -> Result<Self, TileError> {
        let path = solved_path(dir, tile);
        let content = read_whole(&path).map_err(|source| TileError::io("read", &path, source))?;
        let tile = content.and_then(|content| decode_tile(&content));
        tile.ok_or_else(|| TileError::damaged(&path))
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

fn decode_tile(content: &[u8]) -> Option<SolvedTile> {
    let word = |at: usize| -> Option<u64> {
        Some(u64::from_le_bytes(
            content.get(at..at + 8)?.try_into().ok()?,
        ))
    };
    if word(0)? != MAGIC {
        return None;
    }
    let [record_length, core, band] = [word(8)?, word(16)?, word(24)?].map(usize::try_from);
    let (record_length, core, band) = (record_length.ok()?, core.ok()?, band.ok()?);
    let sites_bytes = core.checked_add(band)?.checked_mul(SITE_BYTES)?;
    let sites = content.get(HEADER_BYTES..HEADER_BYTES.checked_add(sites_bytes)?)?;
    let records = content.get(HEADER_BYTES + sites_bytes..)?;
    if records.len() != core.checked_mul(record_length)? {
        return None;
    }
    let mut sites = sites.chunks_exact(SITE_BYTES).map(decode);
    Some(SolvedTile {
        core: sites.by_ref().take(core).collect(),
        band: sites.collect(),
        records: records.to_vec(),
        record_length,
    })
}

fn decode(bytes: &[u8]) -> SolvedSite {
    let integer = |at: usize| {
        i32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes were taken"))
    };
    let real = |at: usize| {
        f64::from_le_bytes(
            bytes[at..at + 8]
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
    fn a_tile_is_read_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        tile().write(dir.path(), 3).unwrap();
        assert_eq!(SolvedTile::read(dir.path(), 3).unwrap(), tile());
    }

    #[test]
    fn a_cut_tile_is_no_tile() {
        let dir = tempfile::tempdir().unwrap();
        tile().write(dir.path(), 0).unwrap();
        let content = read_whole(&solved_path(dir.path(), 0)).unwrap().unwrap();
        assert!(decode_tile(&content).is_some());
        for at in 0..content.len() {
            assert_eq!(decode_tile(&content[..at]), None, "cut at {at}");
        }
        write_whole(&solved_path(dir.path(), 1), b"nonsense").unwrap();
        let error = SolvedTile::read(dir.path(), 1).unwrap_err().to_string();
        assert!(error.contains("tile-000001.solved"), "{error}");
    }
}
