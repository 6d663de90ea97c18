//! The tiles of a job between two rounds, on the disk.

use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    geometry::{Local, Rect, Stored},
    job::error::JobError,
    lloyd::{
        Candidates, CountCorrection, FirstRound, ResumedSites, SiteState, SolverOptions,
        SpacingField, WantedCount,
    },
    quality::{SumsBySurroundings, UniformityTally},
    tile::{BlockFile, TileError},
    tiling::Tile,
};

/// The tiles of a job that have done the first round. A tile has blocks of its own: its sites in
/// pieces, square by square, so that a neighbour reads what it sees and no more, of each the places
/// and the states; the candidates for meeting a count; then a table of the pieces, without which the tile has not done
/// the round.
#[derive(Debug)]
pub(crate) struct StartedTiles {
    /// The blocks may be in several files; tiles are added to the last one.
    files: Vec<BlockFile>,
    /// Edge of the square of a piece (stored units).
    square: i64,
}

/// What the first round leaves of a tile besides the states of its sites.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct StartedTile {
    /// Seconds from the points of the tile in memory to its states.
    pub(crate) seconds: f64,
    /// Uniformity of the seeds of the core.
    pub(crate) seeds: UniformityTally,
    /// Sums of the nearest distances at the start of every iteration of the round.
    pub(crate) convergence: Vec<SumsBySurroundings>,
    /// The positions in the core that close the holes of the scan.
    pub(crate) filling: Vec<Stored>,
    /// The identities of the isolated seeds in the core.
    pub(crate) isolated: Vec<Stored>,
    /// The squares whose sites are the pieces.
    pieces: Vec<Rect>,
}

impl StartedTile {
    /// What is left of a tile with a time of zero: the figures of its seeds, their convergence, the positions that close
    /// the holes, and the isolated seeds.
    pub(crate) fn new(
        seeds: UniformityTally,
        convergence: Vec<SumsBySurroundings>,
        filling: Vec<Stored>,
        isolated: Vec<Stored>,
    ) -> Self {
        Self {
            seconds: 0.0,
            seeds,
            convergence,
            filling,
            isolated,
            pieces: Vec::new(),
        }
    }
}

/// Name of the file in the job directory.
const FILE: &str = "tiles.started";

impl StartedTiles {
    /// Opens the tiles in the job directory `dir`: those in `files`, which other processes have written, and those of
    /// this process, to which tiles can be added in pieces of the edge `square` (stored units).
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the file of this process cannot be opened.
    pub(crate) fn open(
        dir: &Path,
        mut files: Vec<BlockFile>,
        square: i64,
    ) -> Result<Self, JobError> {
        files.push(BlockFile::open(&dir.join(FILE))?);
        Ok(Self::of(files, square))
    }

    /// The tiles in `files`; tiles are added to the last of these in pieces of the edge `square` (stored units).
    pub(crate) fn of(files: Vec<BlockFile>, square: i64) -> Self {
        Self { files, square }
    }

    /// Whether `tile` has done the first round.
    pub(crate) fn contains(&self, tile: u32) -> bool {
        self.with(key(tile, 0)).is_some()
    }

    fn with(&self, key: u64) -> Option<&BlockFile> {
        self.files.iter().find(|file| file.contains(key))
    }

    /// Adds a tile with what its first `round` leaves; when this returns, the tile is on the disk.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the file cannot be written.
    pub(crate) fn add(
        &mut self,
        tile: u32,
        mut started: StartedTile,
        round: FirstRound,
    ) -> Result<(), JobError> {
        let FirstRound {
            mut states,
            candidates,
            ..
        } = round;
        let edge = self.square;
        let file = self.files.last_mut().ok_or_else(damaged)?;
        let square = |state: &SiteState| {
            [state.identity.x, state.identity.y].map(|c| i64::from(c).div_euclid(edge))
        };
        states.par_sort_unstable_by_key(|state| (square(state), state.identity));
        for (piece, states) in (0..).zip(states.chunk_by(|a, b| square(a) == square(b))) {
            let place = |state: &SiteState| (state.identity, state.position);
            let places: Vec<(Stored, Local)> = states.iter().map(place).collect();
            file.append(&[
                (key(tile, places_of(piece)), &encoded(&places)),
                (key(tile, states_of(piece)), &encoded(&states)),
            ])?;
            let corner = square(&states[0]);
            started.pieces.push(Rect {
                min: corner.map(|c| c * edge),
                max: corner.map(|c| (c + 1) * edge),
            });
        }
        file.append(&[(key(tile, CANDIDATES), &encoded(&candidates))])?;
        // The table says that the pieces are there: they are on the disk before it.
        file.flush()?;
        file.append(&[(key(tile, 0), &encoded(&started))])?;
        Ok(file.flush()?)
    }

    /// Reads what the first round left of `tile`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile has not done the round, or its block is damaged.
    pub(crate) fn started(&self, tile: u32) -> Result<StartedTile, JobError> {
        self.decoded(key(tile, 0))
    }

    /// Reads the positions in `rect` that close the holes of the scan, of all `tiles`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if a tile has not done the round, or a block is damaged.
    pub(crate) fn filling_in(&self, rect: &Rect, tiles: &[Tile]) -> Result<Vec<Stored>, JobError> {
        let mut found = Vec::new();
        for tile in tiles.iter().filter(|tile| tile.core.intersects(rect)) {
            let filling = self.started(tile.id)?.filling;
            found.extend(filling.into_iter().filter(|&p| rect.contains(p)));
        }
        Ok(found)
    }

    /// The sites that leave and come so that all `tiles` together have as many as are `wanted`, and the number that
    /// they have without them.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if a tile has not done the round, or a block is damaged.
    pub(crate) fn correction(
        &self,
        wanted: WantedCount,
        tiles: &[Tile],
        options: &SolverOptions,
    ) -> Result<(CountCorrection, u64), JobError> {
        let candidates = |tile: &Tile| self.decoded::<Candidates>(key(tile.id, CANDIDATES));
        let mut sites = 0;
        for tile in tiles {
            sites += candidates(tile)?.sites;
        }
        let parts = tiles.iter().map(candidates);
        let correction = CountCorrection::choose(wanted, sites, parts, options)?;
        Ok((correction, sites))
    }

    /// Reads the sites in `rect`, of all `tiles`, to go on with the spacings of `field` after `correction`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if a tile has not done the round, or a block is damaged.
    pub(crate) fn sites_in<'a>(
        &self,
        rect: &Rect,
        tiles: &[Tile],
        field: &SpacingField,
        correction: &'a CountCorrection,
    ) -> Result<ResumedSites<'a>, JobError> {
        let mut pieces = Vec::new();
        for tile in tiles.iter().filter(|tile| tile.core.intersects(rect)) {
            let of_tile = (0..).zip(self.started(tile.id)?.pieces);
            let seen = of_tile.filter(|(_, square)| square.intersects(rect));
            pieces.extend(seen.map(|(piece, _)| (tile.id, piece)));
        }
        let mut known = Vec::new();
        for &(tile, piece) in &pieces {
            let places: Vec<(Stored, Local)> = self.decoded(key(tile, places_of(piece)))?;
            known.extend(places.iter().filter(|(place, _)| rect.contains(*place)));
        }
        let coming = correction.coming().iter();
        known.extend(coming.filter(|(place, _)| rect.contains(*place)));
        let mut sites = ResumedSites::new(known, field, correction);
        for &(tile, piece) in &pieces {
            sites.add(self.decoded(key(tile, states_of(piece)))?);
        }
        Ok(sites)
    }

    fn decoded<T: DeserializeOwned>(&self, key: u64) -> Result<T, JobError> {
        let bytes = self.with(key).ok_or_else(damaged)?.read(key)?;
        Ok(postcard::from_bytes(&bytes).map_err(|_| damaged())?)
    }
}

fn damaged() -> TileError {
    TileError::Damaged {
        path: FILE.to_owned(),
    }
}

fn encoded<T: Serialize + ?Sized>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).expect("numbers are encoded in memory")
}

/// The key of a block of `tile`: 0 is the table, the pieces follow.
fn key(tile: u32, block: u32) -> u64 {
    u64::from(tile) << 32 | u64::from(block)
}

/// The block with the candidates of a tile.
const CANDIDATES: u32 = u32::MAX;

/// The block with the identities and positions of a piece.
fn places_of(piece: u32) -> u32 {
    2 * piece + 1
}

/// The block with the states of a piece.
fn states_of(piece: u32) -> u32 {
    2 * piece + 2
}

#[cfg(test)]
mod tests {
    use std::{fs, ops::ControlFlow};

    use super::*;
    use crate::{
        geometry::Quantization,
        lloyd::{Scan, SolverOptions, TileRegion, solve_first_round},
    };

    const SQUARE: i64 = 700;

    fn rect(from: i64, to: i64) -> Rect {
        Rect {
            min: [from, 0],
            max: [to, 2000],
        }
    }

    fn tile(id: u32, from: i64, to: i64) -> Tile {
        Tile {
            id,
            core: rect(from, to),
            points_core: 0,
            points_seen: 0,
            cost: 0,
        }
    }

    /// What the first round leaves of a plane of 2 × 2.
    fn round() -> FirstRound {
        let points = (0..40_000).map(|k| Stored {
            x: k % 200 * 10,
            y: k / 200 * 10,
            z: k % 3,
        });
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        let options = SolverOptions::new(0.1);
        let scan = Scan::new(points.collect(), quantization, &options);
        let go_on = |_: f64| ControlFlow::Continue(());
        let region = TileRegion::everything();
        solve_first_round(&scan, &region, &options, true, &go_on).unwrap()
    }

    fn started(filling: Vec<Stored>) -> StartedTile {
        StartedTile::new(UniformityTally::new(0.1), Vec::new(), filling, Vec::new())
    }

    #[test]
    fn what_a_tile_sees_of_all_tiles_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let tiles = [tile(0, 0, 900), tile(1, 900, 2001)];
        let states = round().states;
        let filling: Vec<Stored> = states.iter().map(|state| state.identity).collect();
        let mut file = StartedTiles::open(dir.path(), Vec::new(), SQUARE).unwrap();
        for tile in &tiles {
            let mut own = states.clone();
            own.retain(|state| tile.core.contains(state.identity));
            let filling = own.iter().map(|state| state.identity).collect();
            let round = FirstRound {
                states: own,
                ..round()
            };
            file.add(tile.id, started(filling), round).unwrap();
        }

        let file = StartedTiles::open(dir.path(), Vec::new(), SQUARE).unwrap();
        let uncorrected = CountCorrection::default();
        for seen in [rect(0, 2001), rect(300, 650), rect(850, 950), rect(-10, 0)] {
            let found = file
                .sites_in(&seen, &tiles, &SpacingField::constant(0.1), &uncorrected)
                .unwrap();
            let expected = states.iter().filter(|s| seen.contains(s.identity));
            let mut expected: Vec<Stored> = expected.map(|state| state.identity).collect();
            expected.sort_unstable();
            let mut found = found.identities().to_vec();
            found.sort_unstable();
            assert_eq!(found, expected);
            let mut found = file.filling_in(&seen, &tiles).unwrap();
            found.sort_unstable();
            let filling = filling.iter().copied().filter(|&p| seen.contains(p));
            let mut expected: Vec<Stored> = filling.collect();
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_tile_without_its_table_has_not_been_started() {
        let dir = tempfile::tempdir().unwrap();
        let mut file = StartedTiles::open(dir.path(), Vec::new(), SQUARE).unwrap();
        file.add(0, started(Vec::new()), round()).unwrap();
        file.add(1, started(Vec::new()), round()).unwrap();
        let path = dir.path().join(FILE);
        let whole = fs::read(&path).unwrap();
        for kept in [whole.len() - 1, whole.len() - 200, whole.len() / 4 * 3] {
            fs::write(&path, &whole[..kept]).unwrap();
            let file = StartedTiles::open(dir.path(), Vec::new(), SQUARE).unwrap();
            assert!(file.contains(0) && !file.contains(1), "{kept}");
        }
    }
}
