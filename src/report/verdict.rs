//! The four questions that a report answers first: is the output uniform, faithful, seamless
//! and complete?

use super::{
    contents::Report,
    numbers::{figure, thousands},
};

/// An answer, with the figures behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Verdict {
    /// The question, in a word.
    pub(super) question: &'static str,
    /// `yes`, or `check`: a person should read the figures and the page.
    pub(super) answer: &'static str,
    /// The figures behind the answer.
    pub(super) figures: String,
}

/// The greatest variation of the cells over that of the cells of the seeds. A half is usual on
/// smooth surfaces; leaves and wires stay at their seeds.
const LARGEST_CV_RATIO: f64 = 0.95;
/// The greatest mean distance from the output to the input, in spacings.
const LARGEST_MEAN_DISTANCE_IN_SPACINGS: f64 = 0.25;
/// The greatest share of the input that is farther than 1.5 spacings from the output.
const LARGEST_UNCOVERED_SHARE: f64 = 0.02;
/// The greatest δ on seams over δ elsewhere.
const LARGEST_SEAM_RATIO: f64 = 1.1;
/// The number of points on seams below which their δ says nothing.
const FEWEST_SEAM_POINTS: u64 = 100;

fn verdict(question: &'static str, is_good: bool, figures: String) -> Verdict {
    Verdict {
        question,
        answer: if is_good { "yes" } else { "check" },
        figures,
    }
}

/// Answers the four questions.
pub(super) fn verdicts(report: &Report) -> [Verdict; 4] {
    [
        uniform(report),
        faithful(report),
        seamless(report),
        complete(report),
    ]
}

/// Whether the solver has made the cells more even than those of the seeds.
fn uniform(report: &Report) -> Verdict {
    let (output, seeds) = (&report.evenness.output, &report.evenness.seeds);
    verdict(
        "uniform?",
        output.cell_area_cv < LARGEST_CV_RATIO * seeds.cell_area_cv,
        format!(
            "δ {}, energy {}, cell-area CV {} (seeds {})",
            figure(output.delta),
            figure(output.energy_ratio),
            figure(output.cell_area_cv),
            figure(seeds.cell_area_cv)
        ),
    )
}

/// Whether the output lies on the input, and covers it.
fn faithful(report: &Report) -> Verdict {
    let (accuracy, coverage) = (&report.fidelity.accuracy, &report.fidelity.coverage);
    let unit = report.length_unit;
    verdict(
        "faithful?",
        accuracy.mean < LARGEST_MEAN_DISTANCE_IN_SPACINGS * report.run.spacing
            && coverage.share_beyond < LARGEST_UNCOVERED_SHARE,
        format!(
            "to the thinned input {} {unit} in the mean, {} {unit} at most; {:.2} % of the input farther \
             than 1.5 spacings",
            figure(accuracy.mean),
            figure(accuracy.max),
            100.0 * coverage.share_beyond
        ),
    )
}

/// Whether the output is as even on seams as elsewhere, and has no point twice.
fn seamless(report: &Report) -> Verdict {
    let seams = &report.fit.seams;
    // Tiles that agree to the bit on all shared sites give the output that one tile would have
    // given: then δ on seams differs by what is scanned there.
    let needs_no_comparison =
        seams.identical == seams.shared || seams.on_seams.count < FEWEST_SEAM_POINTS;
    verdict(
        "seamless?",
        seams.duplicates == 0
            && (needs_no_comparison
                || seams.on_seams.delta <= LARGEST_SEAM_RATIO * seams.elsewhere.delta),
        match report.tiles.len() {
            1 => "one tile, no seams".to_owned(),
            _ => format!(
                "δ {} on seams, {} elsewhere; tiles agree on {} of {} shared sites",
                figure(seams.on_seams.delta),
                figure(seams.elsewhere.delta),
                thousands(seams.identical),
                thousands(seams.shared)
            ),
        },
    )
}

/// Whether every point that the headers state was read, and is where they say.
fn complete(report: &Report) -> Verdict {
    let inputs = &report.run.inputs;
    let read: u64 = inputs.iter().map(|input| input.read).sum();
    let rejected: u64 = inputs.iter().map(|input| input.rejected).sum();
    let filtered: u64 = inputs.iter().map(|input| input.filtered).sum();
    let outside: u64 = inputs.iter().map(|input| input.outside).sum();
    let missing: String = [
        (filtered, "left out by the filter"),
        (rejected, "rejected"),
        (outside, "outside of their header's bounds"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, reason)| format!(", {} {reason}", thousands(*count)))
    .collect();
    let (read, written) = (thousands(read), thousands(report.run.points));
    verdict(
        "complete?",
        rejected == 0 && outside == 0,
        format!("{read} points read{missing}; {written} written"),
    )
}
