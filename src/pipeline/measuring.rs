//! The figures of any cloud, by parts that fit in memory.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use serde::Serialize;

use super::{JobError, Survey, memory::Budget, solving::uniformity};
use crate::{
    geometry::{NeighborGrid, Stored},
    las::PointStream,
    lloyd::{Domain, Options, Scan, describe_points},
    quality::{Uniformity, UniformityTally},
    tile::{
        CellGrid, Opener, Plan, PlanOptions, ScatterOptions, Source, SourceError, Spill, scatter,
    },
};

/// What a cloud is like. Lengths are CRS units.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Points in it, coincident ones once for each.
    pub points: u64,
    /// The figures of uniformity.
    pub uniformity: Uniformity,
}

/// Points of a part.
const PART_POINTS: u64 = 500_000;
/// Reach of a patch through a finished cloud, in spacings: two rings of
/// neighbours, some eighteen points.
const FIT_RADIUS: f64 = 2.3;
/// Nearest distance of an even cloud, in hexagonal spacings: what spacings are
/// guessed by.
const PACKING: f64 = 0.85;

struct Stream(PointStream);

impl Source for Stream {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<usize, SourceError> {
        Ok(self.0.next_batch(records)?)
    }
}

/// Measures the cloud in `files`, with temporary files in a directory of its
/// own below `temporary`.
///
/// # Errors
///
/// If the cloud cannot be read, or temporary files cannot be written.
pub fn measure(
    files: &[PathBuf],
    temporary: &std::path::Path,
    memory: Option<u64>,
    threads: usize,
) -> Result<Measured, JobError> {
    let survey = Survey::of(files, None)?;
    let dir = temporary.join(format!("lloydar-measure-{}", std::process::id()));
    std::fs::create_dir_all(&dir).map_err(|e| JobError::io("make", &dir, e))?;
    let measured = measure_in(&survey, &dir, &Budget::new(memory, threads));
    // Whatever happened, the files are of no more use.
    drop(std::fs::remove_dir_all(&dir));
    measured
}

fn measure_in(
    survey: &Survey,
    dir: &std::path::Path,
    budget: &Budget,
) -> Result<Measured, JobError> {
    let lattice = survey.lattice;
    let sources: Vec<Opener<'_>> = survey
        .inputs
        .iter()
        .map(|input| {
            Box::new(move || {
                let stream = PointStream::open(input, &survey.record, lattice)?;
                Ok(Box::new(Stream(stream)) as Box<dyn Source>)
            }) as Opener<'_>
        })
        .collect();
    let options = ScatterOptions {
        record_length: survey.record.record_length(),
        threads: budget.decoders(),
        buffer_bytes: budget.buffers(),
    };
    let grid = CellGrid::for_extent(survey.extent_claimed(), 64);
    scatter(
        sources,
        grid,
        dir,
        options,
        &|_| {},
        &AtomicBool::new(false),
    )?;
    let spill = Spill::open(dir)?;
    let parts = |halo: f64| {
        Plan::make(
            &spill,
            PlanOptions {
                halo: lattice.units(halo),
                tile_edge: None,
                most_points: budget.points_per_tile(1.0).min(PART_POINTS),
            },
        )
    };

    // How far apart points are decides what is looked at around them; the first
    // part is asked.
    let first = parts(0.0)?;
    let mut places = Vec::new();
    if let Some(tile) = first.tiles.first() {
        spill.gather(&tile.core, |record| {
            places.push(lattice.local(Stored::of_record(record)));
        })?;
    }
    let extent = spill.bounds().extent() as f64 * lattice.scale;
    let guess = (extent / (places.len().max(1) as f64).sqrt()).max(lattice.scale);
    let coarse = NeighborGrid::new(&places, guess);
    let (mut sum, mut count) = (0.0, 0_u32);
    for (index, &place) in (0u32..)
        .zip(&places)
        .step_by(places.len().div_ceil(5000).max(1))
    {
        if let Some((_, squared)) = coarse.nearest(place, extent.max(guess), |other| other == index)
            && squared > 0.0
        {
            sum += squared.sqrt();
            count += 1;
        }
    }
    if count == 0 {
        return Err(JobError::Refused(
            "the cloud has no two different points: there is nothing to measure".into(),
        ));
    }
    let spacing = sum / f64::from(count) / PACKING;

    let options = Options {
        fit_radius: FIT_RADIUS * spacing,
        ..Options::new(spacing)
    };
    let plan = parts(6.0 * spacing)?;
    let mut tally = UniformityTally::new(spacing);
    for tile in &plan.tiles {
        let known = tile.core.grown(plan.halo);
        let mut points: Vec<Stored> = Vec::new();
        spill.gather(&known, |record| points.push(Stored::of_record(record)))?;
        let scan = Scan::new(points, lattice, spacing, options.fit_radius, 0);
        let domain = Domain {
            known,
            core: tile.core,
            band: plan.halo,
        };
        let sites = describe_points(&scan, &domain, &options);
        tally.add(&uniformity(&sites, &tile.core, spacing));
    }
    Ok(Measured {
        points: spill.points(),
        uniformity: tally.figures(),
    })
}
