//! The contents of a report: what a job read, did and wrote, in figures.

use serde::Serialize;

use super::{
    convergence::Convergence, isolated::IsolatedReturns, mesh::MeshReport, numbers::figure,
    squares::AreaMap, tallies::TileTallies,
};
use crate::{
    geometry::Quantization,
    job::{InputCount, Outcome, ReportedLevels, ResourceSample, StageCost},
    quality::{DistanceFigures, SpacingClass, SpacingTally, Uniformity},
    transients::TransientCounts,
    views::{DetailView, ViewerSample},
};

/// The number of bins of each histogram of distances.
const BINS: usize = 80;
/// The spacings that a histogram of distances spans.
pub(super) const SPANNED: f64 = 2.0;

/// The report of a job. Lengths are CRS units; a figure that does not exist is `null` in JSON.
///
/// The groups do not show in the JSON: all their fields stand side by side.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    /// What was done.
    #[serde(flatten)]
    pub(super) run: RunDescription,
    /// How even seeds and output are.
    #[serde(flatten)]
    pub(super) evenness: Evenness,
    /// How near output and input are to each other.
    #[serde(flatten)]
    pub(super) fidelity: Fidelity,
    /// How well the tiles fit together.
    #[serde(flatten)]
    pub(super) fit: TileFit,
    /// The nearest distances, iteration by iteration and in histograms.
    #[serde(flatten)]
    pub(super) nearest: NearestDistances,
    /// The isolated returns.
    pub(super) isolated: IsolatedReturns,
    /// What one pass saw and others looked through, if it was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) transients: Option<TransientCounts>,
    /// The figures of the mesh, if one was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<MeshReport>,
    /// The figures of the levels of the output, if it has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) levels: Option<ReportedLevels>,
    /// Pictures, maps and samples of points.
    #[serde(skip)]
    pub(super) views: Views,
    /// The least even places of the output.
    pub(super) worst: Vec<WorstRow>,
    /// The tiles.
    pub(super) tiles: Vec<TileRow>,
    /// Time, memory and disk of the run.
    #[serde(flatten)]
    pub(super) costs: Costs,
    /// Facts about inputs and points that are worth a line.
    pub(super) notes: Vec<String>,
    /// The name of the unit of all lengths.
    #[serde(skip)]
    pub(super) length_unit: &'static str,
}

/// What was done: program, settings, inputs and output.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RunDescription {
    /// The version of the program.
    pub(super) version: String,
    /// The settings: names, and values as JSON.
    pub(super) settings: Vec<(String, String)>,
    /// Numbers of points, file by file.
    pub(super) inputs: Vec<InputCount>,
    /// The cloud that was written.
    pub(super) output: String,
    /// The number of points that were written.
    pub(super) points: u64,
    /// The length of the output in bytes.
    pub(super) bytes: u64,
    /// The spacing at which the solver aimed; the coarsest one if it varies.
    pub(super) spacing: f64,
    /// The spacings at which the solver aimed by class, the finest first, if they vary.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) spacings: Vec<SpacingClass>,
}

impl RunDescription {
    /// Returns how far points are apart, in words.
    pub(super) fn apart(&self, length_unit: &str) -> String {
        match self.spacings.first() {
            Some(class) => format!(
                "{} to {} {length_unit} apart",
                figure(class.finest),
                figure(self.spacing)
            ),
            None => format!("{} {length_unit} apart", figure(self.spacing)),
        }
    }
}

/// How even seeds and output are.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Evenness {
    /// Uniformity of the seeds.
    pub(super) seeds: Uniformity,
    /// Uniformity of the output.
    #[serde(rename = "uniformity")]
    pub(super) output: Uniformity,
    /// Uniformity of the output where the scan describes a surface.
    pub(super) on_surfaces: Uniformity,
    /// Uniformity of the output elsewhere: on leaves, wires and clutter.
    pub(super) elsewhere: Uniformity,
}

/// How near output and input are to each other. Histograms have equal bins from 0 to
/// [`SPANNED`] spacings; the last bin contains all greater distances, too.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Fidelity {
    /// Distances from points of the output to the nearest of the input points that thinning keeps.
    pub(super) accuracy: DistanceFigures,
    /// Distances from points of the input to the nearest point of the output.
    pub(super) coverage: DistanceFigures,
    /// The histogram of the distances from the output to the input.
    pub(super) histogram_accuracy: Vec<u64>,
    /// The histogram of the distances from the input to the output.
    pub(super) histogram_coverage: Vec<u64>,
}

/// How well the tiles fit together.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TileFit {
    /// The share of the output that stayed at the position of its seed.
    #[serde(rename = "held")]
    pub(super) fixed: f64,
    /// The share of the output whose tile contained every point that it depends on.
    pub(super) exact: f64,
    /// Figures of the seams between tiles.
    pub(super) seams: Seams,
}

/// The nearest distances, iteration by iteration and in histograms, with bins as in
/// [`Fidelity`].
#[derive(Clone, Debug, Serialize)]
pub(super) struct NearestDistances {
    /// δ by iteration.
    #[serde(flatten)]
    pub(super) convergence: Convergence,
    /// The histogram of the seeds.
    pub(super) histogram_seeds: Vec<u64>,
    /// The histogram of a sample of the input, of approximately as many points as the output.
    pub(super) histogram_input: Vec<u64>,
    /// The histogram of the output.
    #[serde(rename = "histogram")]
    pub(super) histogram_output: Vec<u64>,
}

/// Pictures, maps and samples of points.
#[derive(Clone, Debug)]
pub(super) struct Views {
    /// A square of the plane before and after.
    pub(super) detail: DetailView,
    /// The points that the viewer shows.
    pub(super) viewer_sample: ViewerSample,
    /// A picture of the output, in PNG.
    pub(super) overview: Vec<u8>,
    /// Figures by squares of the plane.
    pub(super) map: AreaMap,
}

/// Seams against the rest of the output.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Seams {
    /// The number of sites that several tiles solved.
    pub(super) shared: u64,
    /// The number of shared sites on which all tiles agree to the bit.
    pub(super) identical: u64,
    /// The number of shared sites on which tiles differ, and that were taken from their home.
    pub(super) resolved_by_owner: u64,
    /// The number of sites that their home does not have.
    pub(super) unmatched: u64,
    /// The largest distance between two positions of a shared site.
    pub(super) largest_disagreement: f64,
    /// The number of points that were written at the position of another one.
    pub(super) duplicates: u64,
    /// Uniformity within two spacings of a seam.
    pub(super) on_seams: Uniformity,
    /// Uniformity of the rest.
    pub(super) elsewhere: Uniformity,
}

/// A place where the output is less even than elsewhere.
#[derive(Clone, Debug, Serialize)]
pub(super) struct WorstRow {
    /// The position of the place (world coordinates).
    #[serde(rename = "place")]
    pub(super) position: [f64; 3],
    /// δ of the square of the map around it.
    pub(super) delta: f64,
    /// The place before and after.
    #[serde(skip)]
    pub(super) detail: DetailView,
}

/// The figures of a tile.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TileRow {
    /// The number of the tile.
    pub(super) id: u32,
    /// The south-west corner of the core (world coordinates).
    pub(super) min: [f64; 2],
    /// The north-east corner of the core (world coordinates).
    pub(super) max: [f64; 2],
    /// The number of points of the core.
    pub(super) points: u64,
    /// The number of points of core and halo.
    pub(super) points_seen: u64,
    /// The number of points of the output.
    pub(super) sites: u64,
    /// δ of these points, as written.
    pub(super) delta: f64,
    /// The seconds in which the tile was solved.
    pub(super) seconds: f64,
}

/// Time, memory and disk of a run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Costs {
    /// Time and memory of each stage.
    pub(super) stages: Vec<StageCost>,
    /// The memory budget in bytes.
    pub(super) memory_budget: u64,
    /// The peak memory in bytes.
    pub(super) memory_peak: Option<u64>,
    /// The largest size of all temporary files in bytes.
    pub(super) temporary_peak: u64,
    /// Memory and temporary files over time.
    pub(super) over_time: Vec<ResourceSample>,
}

impl Report {
    /// Makes the report of a job that wrote `output`, and its mesh to `mesh` if there is one, by `settings`,
    /// whose values are JSON, with lengths in the unit of the name `length_unit`.
    pub(crate) fn new(
        outcome: &Outcome,
        output: &str,
        mesh: Option<&str>,
        settings: Vec<(String, String)>,
        length_unit: &'static str,
    ) -> Self {
        let tallies = TileTallies::of(outcome);
        let mut sites = tallies.on_surfaces.clone();
        sites.add(&tallies.elsewhere);
        let map = AreaMap::of(outcome);
        Self {
            run: RunDescription {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                settings,
                inputs: outcome.inputs.clone(),
                output: output.to_owned(),
                points: outcome.written.points,
                bytes: outcome.written.bytes,
                spacing: outcome.plan.spacing,
                spacings: (outcome.stitched.spacings.as_ref())
                    .map_or(Vec::new(), SpacingTally::classes),
            },
            evenness: Evenness {
                seeds: tallies.seeds.figures(),
                // Distances as written, across seams; cells as the tiles solved them.
                output: (outcome.stitched.all.figures()).with_cells_of(&sites.figures()),
                on_surfaces: tallies.on_surfaces.figures(),
                elsewhere: tallies.elsewhere.figures(),
            },
            fidelity: Fidelity {
                accuracy: tallies.accuracy.figures(),
                coverage: tallies.coverage.figures(),
                histogram_accuracy: tallies.accuracy.histogram(BINS, SPANNED),
                histogram_coverage: tallies.coverage.histogram(BINS, SPANNED),
            },
            fit: TileFit {
                fixed: tallies.fixed as f64 / tallies.count as f64,
                exact: tallies.exact as f64 / tallies.count as f64,
                seams: Seams::of(outcome),
            },
            nearest: NearestDistances {
                convergence: Convergence::of(&tallies.convergence),
                histogram_seeds: tallies.seeds.histogram(BINS, SPANNED),
                histogram_input: tallies.input.histogram(BINS, SPANNED),
                histogram_output: outcome.stitched.all.histogram(BINS, SPANNED),
            },
            isolated: IsolatedReturns::of(outcome, &map),
            transients: outcome.transients,
            mesh: (outcome.mesh.as_ref().zip(mesh))
                .map(|(figures, file)| MeshReport::new(figures, &outcome.mesh_levels, file)),
            levels: outcome.written.levels.clone(),
            views: Views {
                detail: outcome.views.detail.clone(),
                viewer_sample: outcome.views.viewer_sample.clone(),
                overview: outcome.views.overview.clone(),
                map,
            },
            worst: worst_rows(outcome),
            tiles: tile_rows(outcome),
            costs: Costs::of(outcome),
            notes: outcome.notes.clone(),
            length_unit,
        }
    }

    /// Returns the report as JSON.
    ///
    /// # Panics
    ///
    /// Never: a report is numbers and text.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report is numbers and text")
    }
}

impl Seams {
    fn of(outcome: &Outcome) -> Self {
        let stitched = &outcome.stitched;
        Self {
            shared: stitched.seams.shared,
            identical: stitched.seams.identical,
            resolved_by_owner: stitched.seams.resolved_by_owner,
            unmatched: stitched.seams.unmatched,
            largest_disagreement: stitched.seams.disagreements().max,
            duplicates: stitched.duplicates,
            on_seams: stitched.on_seams.figures(),
            elsewhere: stitched.elsewhere.figures(),
        }
    }
}

impl Costs {
    fn of(outcome: &Outcome) -> Self {
        let (stages, samples) = (&outcome.costs.stages, &outcome.costs.samples);
        Self {
            stages: stages.clone(),
            memory_budget: outcome.plan.budget,
            memory_peak: stages.iter().filter_map(|stage| stage.peak).max(),
            temporary_peak: samples.iter().map(|sample| sample.disk).max().unwrap_or(0),
            over_time: samples.clone(),
        }
    }
}

fn worst_rows(outcome: &Outcome) -> Vec<WorstRow> {
    let worst = outcome.views.worst.iter().map(|worst| WorstRow {
        position: worst.position,
        delta: worst.delta,
        detail: worst.detail.clone(),
    });
    worst.collect()
}

fn tile_rows(outcome: &Outcome) -> Vec<TileRow> {
    let Quantization { scale, offset } = outcome.plan.quantization;
    let corner = |c: [i64; 2]| [0, 1].map(|axis| c[axis] as f64 * scale + offset[axis]);
    let tiles = outcome.tiles.iter().zip(&outcome.written.delta_by_tile);
    tiles
        .map(|(figures, &delta)| TileRow {
            id: figures.tile.id,
            min: corner(figures.tile.core.min),
            max: corner(figures.tile.core.max),
            points: figures.tile.points_core,
            points_seen: figures.tile.points_seen,
            sites: figures.sites,
            delta,
            seconds: figures.seconds,
        })
        .collect()
}
