//! Stitch: the position of every site is settled from what neighbouring tiles say of it.
//!
//! One tile is in memory at a time, with the sites of its neighbours that are at home in it.

use super::tile_solver::{BAND_IN_SPACINGS, TileSolver};
use crate::{
    geometry::Stored,
    job::{directory::SolvedTiles, error::JobError, progress::Progress},
    las::RecordView,
    tile::{NeighborSites, SeamTally, SettledTiles, blend},
    tiling::{Plan, Tile},
};

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

/// Settles the sites of every tile, and writes the records of each tile, moved to the settled
/// positions, to `settled`. Returns how well the tiles agreed.
///
/// # Errors
///
/// [`JobError::Tile`] if temporary files cannot be read or written.
pub(super) fn stitch(
    solver: &TileSolver,
    solved: &SolvedTiles,
    settled: &mut SettledTiles,
    progress: &dyn Progress,
) -> Result<SeamTally, JobError> {
    let (plan, quantization) = (&solver.plan.plan, &solver.plan.quantization);
    let spacing = solver.options.spacing;
    let band = quantization.units(BAND_IN_SPACINGS * spacing);
    let mut tally = SeamTally::new(spacing);
    for tile in &plan.tiles {
        // Collect the sites of this tile in the bands of its neighbours.
        let mut own = solved.solved(tile.id)?;
        let mut neighbors = Vec::new();
        for other in adjacent(plan, tile, band) {
            let mut sites = solved.solved(other.id)?.band;
            sites.retain(|site| tile.core.contains(site.identity));
            neighbors.push(NeighborSites {
                core: other.core,
                sites,
            });
        }

        // Move each record to the settled position of its site.
        let positions = blend(&tile.core, &own.core, &neighbors, band, &mut tally);
        let records = own.records.chunks_exact_mut(own.record_length);
        for (record, position) in records.zip(positions) {
            // A site out of the range of the quantization stays at the position of its seed.
            let position = quantization
                .stored(position)
                .unwrap_or_else(|| Stored::of_record(record));
            RecordView::new(record).move_to(position);
        }
        settled.add(tile.id, &own.records)?;
        progress.advance(1);
    }
    Ok(tally)
}
