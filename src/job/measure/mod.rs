//! The figures of any cloud, by parts that fit in memory.
//!
//! The cloud, and the scans it is compared with, go into one spill of bare
//! coordinates with a mark of whose they are; part by part both are there.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde::Serialize;

use crate::job::{
    JobError,
    resources::{Budget, mebibytes},
    stages::transfer::FARTHEST_MATCH_IN_SPACINGS,
};
use crate::{
    geometry::{NeighborGrid, Quantization, Stored},
    las::{InputFile, PointFilter, PointStream, RecordFormat, expand_inputs},
    lloyd::{Scan, SolverOptions, TileRegion, describe_points, uniformity},
    quality::{DistanceFigures, DistanceTally, Uniformity, UniformityTally},
    tile::{
        CellGrid, Opener, Plan, PlanOptions, PointCounts, ScatterOptions, Source, SourceError,
        Spill, TileError, scatter,
    },
};

/// What a cloud is like. Lengths are CRS units.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// Points in it, coincident ones once for each.
    pub(crate) points: u64,
    /// The figures of uniformity.
    pub(crate) uniformity: Uniformity,
    /// The hexagonal spacing of as many points on the cloud's surface, about:
    /// the unit of what follows.
    pub(crate) spacing: f64,
    /// From the cloud to the nearest point of the scans it is compared with,
    /// looked for within eight spacings.
    pub(crate) accuracy: Option<DistanceFigures>,
    /// From the scans to the nearest point of the cloud, likewise.
    pub(crate) coverage: Option<DistanceFigures>,
    /// From the cloud to surfaces that are known, where they were asked.
    pub(crate) truth: Option<DistanceFigures>,
}

/// Points of a part.
const PART_POINTS: u64 = 500_000;
/// Memory for each of them: nearly all are seeds.
const BYTES_PER_POINT: f64 = 1200.0;
/// Reach of a patch through a finished cloud, in spacings: two rings of
/// neighbours, some eighteen points.
const FIT_RADIUS: f64 = 2.3;
/// Nearest distance of an even cloud, in hexagonal spacings: what spacings are
/// guessed by.
const PACKING: f64 = 0.85;
/// What a part must see around it for the cells at its rim, in spacings.
const HALO: f64 = 6.0;

/// Whose a point is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mark {
    Cloud,
    Scan,
}

/// Bytes of a point's coordinates …
const COORDINATES: usize = 12;
/// … and of a marked point.
const MARKED: usize = COORDINATES + 1;

impl Mark {
    fn of_record(record: &[u8]) -> Self {
        if record[COORDINATES] == 0 {
            Self::Cloud
        } else {
            Self::Scan
        }
    }

    fn byte(self) -> u8 {
        u8::from(self == Self::Scan)
    }
}

/// The points of a file, with a mark.
struct Marked {
    stream: PointStream,
    length: usize,
    mark: Mark,
}

impl Marked {
    fn open(
        input: &InputFile,
        mark: Mark,
        quantization: Quantization,
    ) -> Result<Box<dyn Source>, SourceError> {
        let record = RecordFormat::for_inputs(std::slice::from_ref(input))?;
        let (all, filter) = (0..input.points_claimed, PointFilter::default());
        Ok(Box::new(Self {
            stream: PointStream::open(input, all, &record, quantization, &filter)?,
            length: record.record_length(),
            mark,
        }))
    }
}

impl Source for Marked {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        let counts = self.stream.next_batch(records)?;
        let mut kept = 0;
        for place in (0..records.len()).step_by(self.length) {
            records.copy_within(place..place + COORDINATES, kept);
            records[kept + COORDINATES] = self.mark.byte();
            kept += MARKED;
        }
        records.truncate(kept);
        Ok(counts)
    }
}

/// Measures the cloud in `files`, and how it compares with the scans in
/// `against` if there are any, with temporary files in a directory of its own
/// below `temporary`.
///
/// # Errors
///
/// If a file cannot be read, or temporary files cannot be written.
pub(crate) fn measure(
    files: &[PathBuf],
    against: &[PathBuf],
    temporary: &Path,
    memory: Option<u64>,
    threads: usize,
) -> Result<Measured, JobError> {
    let mut marked = Vec::new();
    for (mark, paths) in [(Mark::Cloud, files), (Mark::Scan, against)] {
        if !paths.is_empty() {
            for path in expand_inputs(paths)? {
                marked.push((mark, InputFile::survey(&path)?));
            }
        }
    }
    let dir = temporary.join(format!("lloydar-measure-{}", std::process::id()));
    std::fs::create_dir_all(&dir).map_err(|e| JobError::io("make", &dir, e))?;
    let measured = measure_in(&marked, &dir, &Budget::new(memory, threads));
    // Whatever happened, the files are of no more use.
    drop(std::fs::remove_dir_all(&dir));
    measured
}

/// Distances of the points of the cloud in `files` from a surface that is known:
/// `distance` is asked for each, in world coordinates.
///
/// # Errors
///
/// If a file cannot be read.
pub(crate) fn measure_against_surface(
    files: &[PathBuf],
    spacing: f64,
    distance: impl Fn([f64; 3]) -> f64,
) -> Result<DistanceFigures, JobError> {
    let mut tally = DistanceTally::new(spacing);
    for path in expand_inputs(files)? {
        let marked = [(Mark::Cloud, InputFile::survey(&path)?)];
        let quantization = InputFile::common_quantization(marked.iter().map(|(_, file)| file));
        let wrong = |e: SourceError| JobError::Tile(TileError::Sources(vec![(0, e)]));
        let mut source = Marked::open(&marked[0].1, Mark::Cloud, quantization).map_err(wrong)?;
        let mut records = Vec::new();
        while source.next_batch(&mut records).map_err(wrong)?.read > 0 {
            for record in records.chunks_exact(MARKED) {
                tally.push(distance(quantization.world(Stored::of_record(record))));
            }
        }
    }
    Ok(tally.figures())
}

fn measure_in(
    files: &[(Mark, InputFile)],
    dir: &Path,
    budget: &Budget,
) -> Result<Measured, JobError> {
    let quantization = InputFile::common_quantization(files.iter().map(|(_, file)| file));
    let sources: Vec<Opener<'_>> = files
        .iter()
        .map(|(mark, file)| {
            Box::new(move |_| Marked::open(file, *mark, quantization)) as Opener<'_>
        })
        .collect();
    let options = ScatterOptions {
        record_length: MARKED,
        threads: budget.decoders(),
        buffer_bytes: budget.buffers(),
        // A measurement is not resumed.
        checkpoint_bytes: u64::MAX,
        keep_going: false,
    };
    let extent = files.iter().fold(0.0, |extent: f64, (_, file)| {
        let [min, max] = file.bounds;
        extent.max(max[0] - min[0]).max(max[1] - min[1])
    });
    let grid = CellGrid::for_extent((extent / quantization.scale) as i64, 64);
    let stem = &dir.join("spill");
    scatter(
        sources,
        grid,
        stem,
        options,
        &|_| {},
        &AtomicBool::new(false),
    )?;
    let spill = Spill::open(stem)?;
    let parts = |halo: f64| {
        let options = PlanOptions {
            halo: quantization.units(halo),
            margin: 0,
            tile_edge: None,
            most_cost: PART_POINTS.min(budget.points(BYTES_PER_POINT)),
        };
        let plan = Plan::by_points(spill.squares(), spill.grid().square(), &options);
        let needed = budget.needed(plan.most_cost() as f64 * BYTES_PER_POINT);
        if needed > budget.total {
            return Err(JobError::Refused(format!(
                "--memory {} is too little: the densest place holds {} points; give at least {}",
                mebibytes(budget.total),
                plan.most_cost(),
                mebibytes(needed)
            )));
        }
        Ok(plan)
    };
    let spacing = spacing(&spill, &parts(0.0)?, quantization)?;
    let has_scans = files.iter().any(|(mark, _)| *mark == Mark::Scan);
    let reach = if has_scans {
        FARTHEST_MATCH_IN_SPACINGS
    } else {
        HALO
    };
    let plan = parts(reach * spacing)?;

    let options = SolverOptions {
        fit_radius: FIT_RADIUS * spacing,
        ..SolverOptions::new(spacing)
    };
    let mut points = 0;
    let mut tally = UniformityTally::new(spacing);
    let mut accuracy = DistanceTally::new(spacing);
    let mut coverage = DistanceTally::new(spacing);
    for tile in &plan.tiles {
        let known = tile.core.grown(plan.halo);
        let (cloud, scan) = gather(&spill, &known)?;
        points += cloud.iter().filter(|&&p| tile.core.contains(p)).count() as u64;
        for (from, to, tally) in [
            (&cloud, &scan, &mut accuracy),
            (&scan, &cloud, &mut coverage),
        ] {
            if has_scans {
                let to: Vec<_> = to.iter().map(|&p| quantization.local(p)).collect();
                let grid = NeighborGrid::new(&to, spacing);
                for &point in from.iter().filter(|&&p| tile.core.contains(p)) {
                    let near = grid.nearest(quantization.local(point), reach * spacing, |_| false);
                    tally.push(near.map_or(reach * spacing, |(_, squared)| squared.sqrt()));
                }
            }
        }
        let scan = Scan::as_scanned(cloud, quantization, &options);
        let domain = TileRegion {
            known,
            core: tile.core,
            band: plan.halo,
        };
        let sites = describe_points(&scan, &domain, &options);
        let in_core = sites
            .iter()
            .filter(|site| tile.core.contains(site.identity));
        tally.add(&uniformity(in_core, spacing));
    }
    Ok(Measured {
        points,
        uniformity: tally.figures(),
        spacing,
        accuracy: has_scans.then(|| accuracy.figures()),
        coverage: has_scans.then(|| coverage.figures()),
        truth: None,
    })
}

/// The points of cloud and scans in `rect`.
fn gather(
    spill: &Spill,
    rect: &crate::geometry::Rect,
) -> Result<(Vec<Stored>, Vec<Stored>), JobError> {
    let (mut cloud, mut scan) = (Vec::new(), Vec::new());
    spill.gather(rect, |record| {
        let point = Stored::of_record(record);
        match Mark::of_record(record) {
            Mark::Cloud => cloud.push(point),
            Mark::Scan => scan.push(point),
        }
    })?;
    Ok((cloud, scan))
}

/// How far apart the cloud's points are, in hexagonal spacings, about: the first
/// of `parts` that holds enough of them is asked.
fn spacing(spill: &Spill, parts: &Plan, quantization: Quantization) -> Result<f64, JobError> {
    let mut places = Vec::new();
    for tile in &parts.tiles {
        let (cloud, _) = gather(spill, &tile.core)?;
        places.extend(cloud.into_iter().map(|point| quantization.local(point)));
        if places.len() >= 1000 {
            break;
        }
    }
    let extent = spill.bounds().extent() as f64 * quantization.scale;
    let guess = (extent / (places.len().max(1) as f64).sqrt()).max(quantization.scale);
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
    Ok(sum / f64::from(count) / PACKING)
}
