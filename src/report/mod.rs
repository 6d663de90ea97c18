//! What a job did, for people and for machines.

mod chart;
mod map;
mod page;
mod verdict;
mod viewer;

use serde::Serialize;

use crate::{
    job::{InputCount, Outcome, ResourceSample, StageCost},
    quality::{DistanceFigures, DistanceSums, DistanceTally, Uniformity, UniformityTally},
    views::{DetailView, ViewerSample},
};

pub(crate) use verdict::verdicts;

/// What is added to the name of an output for its report and for its viewer.
pub(crate) const REPORT_PAGE: &str = ".report.html";
/// See [`REPORT_PAGE`].
pub(crate) const VIEWER_PAGE: &str = ".viewer.html";

/// Bins of the histograms of nearest distances, and spacings that they span.
const BINS: usize = 80;
const SPANNED: f64 = 2.0;

/// A job's report. Lengths are CRS units; a figure that there is none of is
/// `null`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    /// Version of the program.
    pub(crate) version: String,
    /// What was asked for: option and value.
    pub(crate) settings: Vec<(String, String)>,
    /// Points read, file by file.
    pub(crate) inputs: Vec<InputCount>,
    /// The cloud that was written.
    pub(crate) output: String,
    /// Points in it.
    pub(crate) points: u64,
    /// Its length in bytes.
    pub(crate) bytes: u64,
    /// Spacing that was aimed at.
    pub(crate) spacing: f64,
    /// Uniformity of the seeds that the solver began with.
    pub(crate) seeds: Uniformity,
    /// Uniformity of the output.
    pub(crate) uniformity: Uniformity,
    /// Output to nearest input.
    pub(crate) accuracy: DistanceFigures,
    /// Input to nearest output.
    pub(crate) coverage: DistanceFigures,
    /// Distances of the output to the input, in equal bins of 0 to 2 spacings; what is farther is
    /// in the last.
    pub(crate) histogram_accuracy: Vec<u64>,
    /// The same of the input to the output.
    pub(crate) histogram_coverage: Vec<u64>,
    /// Share of the output that was left where it was elected.
    pub(crate) held: f64,
    /// Share of the output whose tile saw all that it depends on.
    pub(crate) exact: f64,
    /// What became of the seams.
    pub(crate) seams: Seams,
    /// δ at the start of every iteration, and at the end.
    pub(crate) convergence: Vec<f64>,
    /// Nearest distances of seeds and output, in equal bins of 0 to 2 spacings.
    pub(crate) histogram_seeds: Vec<u64>,
    /// The same of points of the input, as many as there are in the output,
    /// about.
    pub(crate) histogram_input: Vec<u64>,
    /// The same of the output.
    pub(crate) histogram: Vec<u64>,
    /// One place before and after.
    #[serde(skip)]
    pub(crate) detail: DetailView,
    /// A square to be walked around.
    #[serde(skip)]
    pub(crate) excerpt: ViewerSample,
    /// What came out, as a picture in PNG.
    #[serde(skip)]
    pub(crate) portrait: Vec<u8>,
    /// Figures square by square.
    #[serde(skip)]
    pub(crate) area: AreaMap,
    /// Where the output is least even.
    pub(crate) worst: Vec<WorstRow>,
    /// The tiles.
    pub(crate) tiles: Vec<TileRow>,
    /// What each stage took in this run.
    pub(crate) stages: Vec<StageCost>,
    /// The memory budget in bytes.
    pub(crate) memory_budget: u64,
    /// Most memory held, in bytes.
    pub(crate) memory_peak: Option<u64>,
    /// Most temporary files held, in bytes.
    pub(crate) temporary_peak: u64,
    /// Memory and temporary files over time.
    pub(crate) over_time: Vec<ResourceSample>,
    /// What is worth a line.
    pub(crate) notes: Vec<String>,
}

/// Seams against the rest.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Seams {
    /// Sites that several tiles delivered.
    pub(crate) shared: u64,
    /// Of those, agreed on to the bit.
    pub(crate) identical: u64,
    /// Of those, decided by their owner.
    pub(crate) resolved_by_owner: u64,
    /// Sites that their home does not know.
    pub(crate) unmatched: u64,
    /// Largest disagreement on a shared site.
    pub(crate) largest_disagreement: f64,
    /// Points written twice at one place.
    pub(crate) duplicates: u64,
    /// Within two spacings of a seam.
    pub(crate) on_seams: Uniformity,
    /// Elsewhere.
    pub(crate) elsewhere: Uniformity,
}

/// Equal squares of the plane.
#[derive(Clone, Debug)]
pub(crate) struct AreaMap {
    /// Edge of a square.
    pub(crate) edge: f64,
    /// South-west corner of the first (world coordinates).
    pub(crate) corner: [f64; 2],
    /// Those with points.
    pub(crate) squares: Vec<SquareRow>,
}

/// One square.
#[derive(Clone, Debug)]
pub(crate) struct SquareRow {
    /// How many squares east and north of the first.
    pub(crate) place: [i64; 2],
    /// Points of the input.
    pub(crate) input: u64,
    /// Points of the output.
    pub(crate) output: u64,
    /// δ of the output.
    pub(crate) delta: f64,
    /// Mean nearest distance of the output, in spacings.
    pub(crate) mean: f64,
}

/// A place where the output is less even than elsewhere.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct WorstRow {
    /// Where (world coordinates).
    pub(crate) place: [f64; 3],
    /// δ of the square around it.
    pub(crate) delta: f64,
    /// What it looks like.
    #[serde(skip)]
    pub(crate) detail: DetailView,
}

/// One tile.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct TileRow {
    /// Its number.
    pub(crate) id: u32,
    /// South-west corner (world coordinates).
    pub(crate) min: [f64; 2],
    /// North-east corner.
    pub(crate) max: [f64; 2],
    /// Points of its core.
    pub(crate) points: u64,
    /// Points of core and halo.
    pub(crate) points_seen: u64,
    /// Points it put out.
    pub(crate) sites: u64,
    /// δ of its points, as written.
    pub(crate) delta: f64,
    /// Seconds that it took.
    pub(crate) seconds: f64,
}

impl Report {
    /// The report of a job that wrote `output` by `settings`.
    pub(crate) fn new(outcome: &Outcome, output: &str, settings: Vec<(String, String)>) -> Self {
        let spacing = outcome.plan.spacing;
        let tally = || UniformityTally::new(spacing);
        let (mut input, mut seeds, mut after) = (tally(), tally(), tally());
        let (mut accuracy, mut coverage) =
            (DistanceTally::new(spacing), DistanceTally::new(spacing));
        let mut convergence: Vec<DistanceSums> = Vec::new();
        let (mut sites, mut held, mut exact) = (0, 0, 0);
        for tile in &outcome.tiles {
            input.add(&tile.input);
            seeds.add(&tile.seeds);
            after.add(&tile.uniformity);
            accuracy.add(&tile.accuracy);
            coverage.add(&tile.coverage);
            convergence.resize(
                tile.convergence.len().max(convergence.len()),
                DistanceSums::default(),
            );
            for (sum, part) in convergence.iter_mut().zip(&tile.convergence) {
                sum.add(part);
            }
            sites += tile.sites;
            held += tile.fixed;
            exact += tile.exact;
        }
        let stitched = &outcome.stitched;
        // Distances as written, across seams; cells as the tiles saw them.
        let uniformity = stitched.all.figures().with_cells_of(&after.figures());
        let quantization = outcome.plan.quantization;
        let corner = |c: [i64; 2]| {
            [0, 1].map(|axis| c[axis] as f64 * quantization.scale + quantization.offset[axis])
        };
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            settings,
            inputs: outcome.inputs.clone(),
            output: output.to_owned(),
            points: outcome.written.points,
            bytes: outcome.written.bytes,
            spacing,
            seeds: seeds.figures(),
            uniformity,
            accuracy: accuracy.figures(),
            coverage: coverage.figures(),
            histogram_accuracy: accuracy.histogram(BINS, SPANNED),
            histogram_coverage: coverage.histogram(BINS, SPANNED),
            held: held as f64 / sites as f64,
            exact: exact as f64 / sites as f64,
            seams: Seams {
                shared: stitched.seams.shared,
                identical: stitched.seams.identical,
                resolved_by_owner: stitched.seams.resolved_by_owner,
                unmatched: stitched.seams.unmatched,
                largest_disagreement: stitched.seams.disagreements().max,
                duplicates: stitched.duplicates,
                on_seams: stitched.on_seams.figures(),
                elsewhere: stitched.elsewhere.figures(),
            },
            convergence: convergence.iter().map(DistanceSums::delta).collect(),
            histogram_input: input.histogram(BINS, SPANNED),
            histogram_seeds: seeds.histogram(BINS, SPANNED),
            histogram: stitched.all.histogram(BINS, SPANNED),
            detail: outcome.views.detail.clone(),
            excerpt: outcome.views.viewer_sample.clone(),
            portrait: outcome.views.overview.clone(),
            area: area(outcome),
            worst: outcome
                .views
                .worst
                .iter()
                .map(|worst| WorstRow {
                    place: worst.position,
                    delta: worst.delta,
                    detail: worst.detail.clone(),
                })
                .collect(),
            tiles: outcome
                .tiles
                .iter()
                .zip(&outcome.written.delta_by_tile)
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
                .collect(),
            stages: outcome.costs.stages.clone(),
            memory_budget: outcome.plan.budget,
            memory_peak: outcome.costs.stages.iter().filter_map(|s| s.peak).max(),
            temporary_peak: outcome
                .costs
                .samples
                .iter()
                .map(|h| h.disk)
                .max()
                .unwrap_or(0),
            over_time: outcome.costs.samples.clone(),
            notes: outcome.notes.clone(),
        }
    }

    /// The report as JSON.
    ///
    /// # Panics
    ///
    /// Never: a report is numbers and text.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report is numbers and text")
    }

    /// The report as one page that needs nothing else.
    pub(crate) fn to_html(&self) -> String {
        page::page(self)
    }

    /// A page to walk around a place in, before and after, that needs nothing else; nothing
    /// if there is no point to be seen.
    pub(crate) fn to_viewer(&self) -> Option<String> {
        viewer::viewer(self)
    }

    /// A few lines for a terminal.
    pub(crate) fn summary(&self) -> String {
        let mut text = format!(
            "{} points, {} apart: {}\n",
            thousands(self.points),
            figure(self.spacing),
            self.output
        );
        for verdict in verdicts(self) {
            text += &format!(
                "{:<9} {:<5} {}\n",
                verdict.question, verdict.answer, verdict.figures
            );
        }
        let all: f64 = self.stages.iter().map(|stage| stage.seconds).sum();
        let stages = self.stages.iter();
        // Those that matter: the report has all.
        let stages: Vec<String> = stages
            .filter(|stage| stage.seconds > 0.01 * all)
            .map(|stage| format!("{} {:.1}", stage.stage, stage.seconds))
            .collect();
        let mebibytes = |bytes: u64| thousands(bytes.div_ceil(1 << 20));
        let peak = self.memory_peak.map_or("–".into(), mebibytes);
        text += &format!("time      {all:.1} s: {}\n", stages.join(", "));
        text += &format!(
            "memory    {peak} of {} MiB; temporary files {} MiB\n",
            mebibytes(self.memory_budget),
            mebibytes(self.temporary_peak)
        );
        text
    }
}

fn area(outcome: &Outcome) -> AreaMap {
    let spacing = outcome.plan.spacing;
    let (edge, corner) = outcome
        .views
        .uniformity_map
        .edge_and_corner(&outcome.plan.quantization);
    let squares = outcome
        .views
        .uniformity_map
        .squares()
        .map(|(place, square)| {
            let distances = &square.distances;
            SquareRow {
                place,
                input: square.input,
                output: square.output,
                // Of a handful of points it says nothing.
                delta: match distances.count {
                    0..10 => f64::NAN,
                    _ => distances.delta(),
                },
                mean: distances.sum / distances.count as f64 / spacing,
            }
        });
    AreaMap {
        edge,
        corner,
        squares: squares.collect(),
    }
}

/// `1234567` as `1 234 567`.
pub(crate) fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

/// A figure with four digits, or a dash where there is none.
pub(crate) fn figure(value: f64) -> String {
    if !value.is_finite() {
        "–".to_owned()
    } else if value != 0.0 && value.abs() < 1e-3 {
        format!("{value:.2e}")
    } else if value.abs() < 100.0 {
        format!("{value:.4}")
    } else {
        format!("{value:.1}")
    }
}
