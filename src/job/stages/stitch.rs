//! Stitch: the position of every site is settled from what neighbouring tiles say of it.
//!
//! One tile is in memory at a time, with the sites of its neighbours that are at home in it.

use super::tile_solver::{BAND_IN_SPACINGS, TileSolver};
use crate::{
    geometry::{Quantization, Stored},
    job::{context::RunContext, directory::SolvedTiles, error::JobError, progress::Progress},
    las::{Piece, RecordView, Workforce},
    tile::{NeighborSites, SeamTally, SettledTiles, TileError, blend},
    tiling::{Plan, Tile},
};

/// Largest distance at which sites end from the core in which they are at home, in spacings.
const FARTHEST_SITE_IN_SPACINGS: f64 = 2.0 * BAND_IN_SPACINGS;

/// The tiles of `plan` other than `tile` whose cores lie within `reach` (stored units) of its core.
pub(super) fn adjacent<'a>(
    plan: &'a Plan,
    tile: &'a Tile,
    reach: i64,
) -> impl Iterator<Item = &'a Tile> {
    let near = tile.core.grown(reach);
    plan.tiles
        .iter()
        .filter(move |other| other.id != tile.id && other.core.intersects(&near))
}

/// Settles the sites of every tile by `workforce`: the records of each tile are moved to the settled positions.
///
/// # Errors
///
/// [`JobError::Tile`] if temporary files cannot be read or written.
pub(super) fn stitch(
    run: &RunContext<'_>,
    solver: &TileSolver,
    solved: &SolvedTiles,
    workforce: &dyn Workforce,
) -> Result<SettledTiles, JobError> {
    let tiles = &solver.plan.plan.tiles;
    let settled = workforce.keep("settled", tiles.len(), &mut |piece| {
        run.check_cancelled()?;
        let settled = settle(solver, solved, &tiles[piece])?;
        run.progress.advance(1);
        Ok(settled)
    });
    Ok(SettledTiles::new(settled.map_err(JobError::of_store)?))
}

/// How well the tiles agree on the sites of `tile`.
///
/// # Errors
///
/// [`JobError::Tile`] if it cannot be read.
pub(super) fn seams_of(settled: &SettledTiles, tile: &Tile) -> Result<SeamTally, JobError> {
    let seams = serde_json::from_slice(&settled.sums(tile.id)?);
    seams.map_err(|_| JobError::Tile(TileError::damaged("the settled tiles".as_ref())))
}

/// Settles the sites of a tile.
fn settle(solver: &TileSolver, solved: &SolvedTiles, tile: &Tile) -> Result<Piece, JobError> {
    let (plan, quantization) = (&solver.plan.plan, &solver.plan.quantization);
    let spacing = solver.options.spacing;
    let band = quantization.units(BAND_IN_SPACINGS * spacing);
    // Collect the sites of this tile in the bands of its neighbours.
    let mut own = solved.core(tile.id)?;
    let mut neighbors = Vec::new();
    for other in adjacent(plan, tile, band) {
        let mut sites = solved.band(other.id)?;
        sites.retain(|site| tile.core.contains(site.identity));
        neighbors.push(NeighborSites {
            core: other.core,
            sites,
        });
    }

    // Move each record to the settled position of its site.
    let mut seams = SeamTally::new(spacing);
    let positions = blend(&tile.core, &own.sites, &neighbors, band, &mut seams);
    let records = own.records.chunks_exact_mut(own.record_length);
    for (record, position) in records.zip(positions) {
        // A site out of the range of the quantization stays at the position of its seed.
        let position = quantization
            .stored(position)
            .unwrap_or_else(|| Stored::of_record(record));
        RecordView::new(record).move_to(position);
    }
    let reach = farthest_site(quantization, spacing);
    let seams = serde_json::to_vec(&seams).expect("tallies are plain numbers");
    let (core, length) = (&tile.core, own.record_length);
    Ok(SettledTiles::piece(core, own.records, length, reach, seams))
}

/// The largest distance at which sites end from the core in which they are at home, in stored units.
pub(super) fn farthest_site(quantization: &Quantization, spacing: f64) -> i64 {
    quantization.units(FARTHEST_SITE_IN_SPACINGS * spacing)
}
