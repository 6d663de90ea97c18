//! Stitch and write: tiles in, one cloud out.
//!
//! Two passes over the solved tiles, each holding a tile and what its
//! neighbours say of it: the first settles where every site ends, the second
//! measures distances across seams and writes.

use std::collections::HashMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::job::{JobError, Progress, directory::SolvedTiles, solving::BAND};
use crate::{
    geometry::{Local, NeighborGrid, Quantization, Rect, Stored},
    las::{CloudWriter, RecordView},
    quality::UniformityTally,
    tile::{NeighborSites, Plan, SeamTally, SettledTiles, Tile, blend},
    views::UniformityMap,
};

/// How near to another tile is "on the seam", in spacings.
const SEAM: f64 = 2.0;

/// What the stitch found. Lengths are CRS units.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Stitched {
    /// How well tiles agreed.
    pub(crate) seams: SeamTally,
    /// Nearest distances of the whole cloud, as written.
    pub(crate) all: UniformityTally,
    /// Of sites within two spacings of another tile.
    pub(crate) on_seams: UniformityTally,
    /// Of the others.
    pub(crate) elsewhere: UniformityTally,
    /// Points written at a place where another one is.
    pub(crate) duplicates: u64,
}

/// The tiles whose cores lie within `reach` (stored units) of `tile`'s.
fn adjacent<'a>(plan: &'a Plan, tile: &'a Tile, reach: i64) -> impl Iterator<Item = &'a Tile> {
    let near = tile.core.grown(reach);
    plan.tiles
        .iter()
        .filter(move |other| other.id != tile.id && other.core.intersects(&near))
}

/// Settles the sites of every tile; the records of each tile, moved to where
/// they are written, replace its own.
pub(crate) fn settle(
    plan: &Plan,
    tiles: &SolvedTiles,
    settled: &mut SettledTiles,
    quantization: &Quantization,
    spacing: f64,
    progress: &dyn Progress,
) -> Result<SeamTally, JobError> {
    let band = quantization.units(BAND * spacing);
    let mut tally = SeamTally::new(spacing);
    for tile in &plan.tiles {
        let mut own = tiles.solved(tile.id)?;
        let mut neighbors = Vec::new();
        for other in adjacent(plan, tile, band) {
            let mut sites = tiles.solved(other.id)?.band;
            sites.retain(|site| tile.core.contains(site.identity));
            neighbors.push(NeighborSites {
                core: other.core,
                sites,
            });
        }
        let places = blend(&tile.core, &own.core, &neighbors, band, &mut tally);
        for (record, place) in own.records.chunks_exact_mut(own.record_length).zip(places) {
            // A site that is nowhere stays where it was elected.
            let place = quantization
                .stored(place)
                .unwrap_or_else(|| Stored::of_record(record));
            RecordView::new(record).move_to(place);
        }
        settled.add(tile.id, &own.records)?;
        progress.advance(1);
    }
    Ok(tally)
}

/// Writes the settled tiles, in the order of the plan, and measures the
/// distances between their points, across seams as elsewhere.
#[expect(clippy::too_many_arguments, reason = "the job's parts, each used once")]
pub(crate) fn write(
    plan: &Plan,
    settled: &SettledTiles,
    quantization: &Quantization,
    spacing: f64,
    record_length: usize,
    seams: SeamTally,
    field: &mut UniformityMap,
    writer: &mut CloudWriter,
    progress: &dyn Progress,
) -> Result<(Stitched, HashMap<u32, UniformityTally>), JobError> {
    // Sites end within a spacing or two of where they are at home.
    let reach = quantization.units(2.0 * BAND * spacing);
    let seam = quantization.units(SEAM * spacing);
    let tally = || UniformityTally::new(spacing);
    let mut stitched = Stitched {
        seams,
        all: tally(),
        on_seams: tally(),
        elsewhere: tally(),
        duplicates: 0,
    };
    let mut by_tile = HashMap::new();
    for tile in &plan.tiles {
        let records = settled.records(tile.id)?;
        let near: Vec<Rect> = adjacent(plan, tile, reach)
            .map(|other| other.core)
            .collect();
        let mut places: Vec<Local> = records
            .chunks_exact(record_length)
            .map(|record| quantization.local(Stored::of_record(record)))
            .collect();
        let own = places.len();
        for other in adjacent(plan, tile, reach) {
            let wide = tile.core.grown(reach);
            places.extend(
                settled
                    .records(other.id)?
                    .chunks_exact(record_length)
                    .map(Stored::of_record)
                    .filter(|&point| wide.contains(point))
                    .map(|point| quantization.local(point)),
            );
        }
        let grid = NeighborGrid::new(&places, spacing);
        let nearest: Vec<Option<f64>> = (0..own)
            .into_par_iter()
            .map(|index| {
                let is_own = |other: u32| other as usize == index;
                let nearest = grid.nearest(places[index], BAND * spacing, is_own);
                nearest.map(|(_, squared)| squared.sqrt())
            })
            .collect();
        let mut tile_tally = tally();
        for (record, nearest) in records.chunks_exact(record_length).zip(nearest) {
            let point = Stored::of_record(record);
            field.push(point, nearest, spacing);
            let Some(distance) = nearest else {
                stitched.all.push_alone();
                continue;
            };
            let is_on_seam = near.iter().any(|core| core.depth(point) > -seam);
            stitched.duplicates += u64::from(distance == 0.0);
            stitched.all.push_distance(distance);
            tile_tally.push_distance(distance);
            if is_on_seam {
                stitched.on_seams.push_distance(distance);
            } else {
                stitched.elsewhere.push_distance(distance);
            }
        }
        by_tile.insert(tile.id, tile_tally);
        writer.write(&records)?;
        progress.advance(1);
    }
    Ok((stitched, by_tile))
}
