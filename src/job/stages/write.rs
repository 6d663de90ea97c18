//! Write: the tiles in their order, with the distances between the points, across seams as elsewhere.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    stitch::{adjacent, farthest_site, seams_of},
    tile_solver::BAND_IN_SPACINGS,
};
use crate::{
    geometry::{Local, NeighborGrid, Rect, Stored},
    job::{context::RunContext, error::JobError, progress::Progress},
    las::{Piece, RecordFormat, StoreError, Workforce, brightness},
    quality::{SpacingTally, UniformityTally},
    tile::SeamTally,
    tiling::Tile,
    views::{CloudPair, MapPart, UniformityMap},
};

/// Largest distance of a point on a seam from the core of another tile, in spacings.
const SEAM_IN_SPACINGS: f64 = 2.0;

/// The figures of the whole cloud, as written. Lengths are CRS units; where the spacing varies, those of points that are scaled
/// to the coarsest spacing, each by its own.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Stitched {
    /// How well tiles agreed on the sites that they share.
    pub(crate) seams: SeamTally,
    /// Nearest distances of all points.
    pub(crate) all: UniformityTally,
    /// Nearest distances of points within two spacings of another tile.
    pub(crate) on_seams: UniformityTally,
    /// Nearest distances of all other points.
    pub(crate) elsewhere: UniformityTally,
    /// Number of points that were written at the position of another one.
    pub(crate) duplicates: u64,
    /// The wanted spacings, if they vary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) spacings: Option<SpacingTally>,
}

/// The figures of a part of the cloud: of a tile, or of all tiles.
#[derive(Serialize, Deserialize)]
pub(super) struct Measured {
    pub(super) stitched: Stitched,
    /// The figures by squares of the plane.
    map: MapPart,
    /// δ of the points of each tile; `None` if it has too few.
    pub(super) delta_by_tile: Vec<Option<f64>>,
    /// The largest value of a colour, if it was looked for.
    pub(super) brightest: u16,
}

impl Measured {
    /// The figures of no point of `cloud`.
    fn nothing(cloud: &CloudPair<'_>) -> Self {
        Self {
            stitched: Stitched::new(cloud),
            map: MapPart::default(),
            delta_by_tile: Vec::new(),
            brightest: 0,
        }
    }

    fn add(&mut self, other: &Self) {
        self.stitched.add(&other.stitched);
        self.map.add(&other.map);
        self.delta_by_tile.extend(&other.delta_by_tile);
        self.brightest = self.brightest.max(other.brightest);
    }
}

impl Stitched {
    fn new(cloud: &CloudPair<'_>) -> Self {
        let spacing = cloud.spacing;
        let tally = || UniformityTally::new(spacing);
        Self {
            seams: SeamTally::new(spacing),
            all: tally(),
            on_seams: tally(),
            elsewhere: tally(),
            duplicates: 0,
            spacings: (cloud.spacing_at_points).map(|_| SpacingTally::new(spacing)),
        }
    }

    fn add(&mut self, other: &Self) {
        self.seams.add(&other.seams);
        self.all.add(&other.all);
        self.on_seams.add(&other.on_seams);
        self.elsewhere.add(&other.elsewhere);
        self.duplicates += other.duplicates;
        if let (Some(spacings), Some(more)) = (&mut self.spacings, &other.spacings) {
            spacings.add(more);
        }
    }

    /// Adds a point by the distance to its nearest neighbour; `None` if that is out of reach.
    fn push(&mut self, nearest: Option<f64>, is_on_seam: bool) {
        let Some(distance) = nearest else {
            self.all.push_alone();
            return;
        };
        self.duplicates += u64::from(distance == 0.0);
        self.all.push_distance(distance);
        match is_on_seam {
            true => self.on_seams.push_distance(distance),
            false => self.elsewhere.push_distance(distance),
        }
    }
}

/// Measures the points of all settled tiles of `cloud`, by `workforce`, and adds them to `map`. Calls `write` with the number of
/// each tile in the order of the plan, unless this process only helps. The largest value of a colour is found if records are
/// given by their format in `colors`.
///
/// # Errors
///
/// [`JobError`] if settled tiles cannot be read, or the output cannot be written.
pub(super) fn measure_tiles(
    run: &RunContext<'_>,
    cloud: &CloudPair<'_>,
    colors: Option<&RecordFormat>,
    map: &mut UniformityMap,
    workforce: &dyn Workforce,
    write: &mut dyn FnMut(u32) -> Result<(), JobError>,
) -> Result<Measured, JobError> {
    let (tiles, mut all) = (&cloud.plan.tiles, Measured::nothing(cloud));
    let mut measure = |piece: usize| {
        run.check_cancelled()?;
        let measured = measure_tile(cloud, colors, map, &tiles[piece])?;
        run.progress.advance(1);
        Ok::<Piece, StoreError>(vec![serde_json::to_vec(&measured)?])
    };
    let mut take = |piece: usize, measured: Piece| {
        all.add(&serde_json::from_slice(&measured.concat())?);
        Ok(write(tiles[piece].id)?)
    };
    let passed = workforce.pass("measured", tiles.len(), &mut measure, &mut take);
    passed.map_err(JobError::of_store)?;
    map.add(&all.map);
    Ok(all)
}

/// Measures the points of a settled tile, on the squares of `map`.
fn measure_tile(
    cloud: &CloudPair<'_>,
    colors: Option<&RecordFormat>,
    map: &UniformityMap,
    tile: &Tile,
) -> Result<Measured, JobError> {
    let mut measured = Measured::nothing(cloud);
    measured.stitched.seams = seams_of(cloud.settled, tile)?;
    // Measure the nearest distances, to points of neighbouring tiles, too.
    let records = cloud.settled.records(tile.id)?;
    measured.brightest = colors.map_or(0, |record| brightness(&records, record));
    let nearest = nearest_distances(cloud, tile, &records)?;

    // Tally them.
    let seam = cloud.quantization.units(SEAM_IN_SPACINGS * cloud.spacing);
    let others = adjacent(cloud.plan, tile, reach(cloud)).map(|other| other.core);
    let others: Vec<Rect> = others.collect();
    let mut tile_tally = UniformityTally::new(cloud.spacing);
    let records_of_points = records.chunks_exact(cloud.record_length);
    for (record, nearest) in records_of_points.zip(nearest) {
        let point = Stored::of_record(record);
        let scale = cloud.scale_at(record);
        if let Some(spacings) = &mut measured.stitched.spacings {
            spacings.push(cloud.spacing / scale);
        }
        let nearest = nearest.map(|distance| scale * distance);
        let square = map.square_of(point);
        measured.map.push(square, point, nearest, cloud.spacing);
        let is_on_seam = others.iter().any(|core| core.depth(point) > -seam);
        measured.stitched.push(nearest, is_on_seam);
        if let Some(distance) = nearest {
            tile_tally.push_distance(distance);
        }
    }
    let delta = tile_tally.figures().delta;
    measured
        .delta_by_tile
        .push(Some(delta).filter(|delta| delta.is_finite()));
    Ok(measured)
}

/// The distance of each point in the `records` of `tile` to the nearest other point of the cloud;
/// `None` if there is none within a band.
fn nearest_distances(
    cloud: &CloudPair<'_>,
    tile: &Tile,
    records: &[u8],
) -> Result<Vec<Option<f64>>, JobError> {
    let (quantization, spacing, length) = (cloud.quantization, cloud.spacing, cloud.record_length);
    let mut positions: Vec<Local> = records
        .chunks_exact(length)
        .map(|record| quantization.local(Stored::of_record(record)))
        .collect();
    let own = positions.len();
    let wide = tile.core.grown(reach(cloud));
    for other in adjacent(cloud.plan, tile, reach(cloud)) {
        let border = cloud.settled.border(other.id)?.into_iter();
        let near = border.filter(|&point| wide.contains(point));
        positions.extend(near.map(|point| quantization.local(point)));
    }
    let grid = NeighborGrid::new(&positions, spacing);
    Ok((0..own)
        .into_par_iter()
        .map(|index| {
            let is_own = |other: u32| other as usize == index;
            let nearest = grid.nearest(positions[index], BAND_IN_SPACINGS * spacing, is_own);
            nearest.map(|(_, squared)| squared.sqrt())
        })
        .collect())
}

/// How far points of other tiles are looked for, in stored units.
fn reach(cloud: &CloudPair<'_>) -> i64 {
    farthest_site(cloud.quantization, cloud.spacing)
}
