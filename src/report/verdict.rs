//! The four questions that a report answers first: is the output uniform, faithful, seamless
//! and complete?

use super::{
    contents::Report,
    numbers::{counted, figure, thousands},
};
use crate::quality::Uniformity;

/// An answer, with the figures behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Verdict {
    /// The question, in a word.
    pub(super) question: &'static str,
    /// `yes`; `partly`, `no` or `check`: a person should read the figures and the page.
    pub(super) answer: &'static str,
    /// The figures behind the answer.
    pub(super) figures: String,
}

/// The greatest energy of uniform points on surfaces, over that of the hexagonal lattice.
const LARGEST_ENERGY: f64 = 1.05;
/// The least share of the cells of uniform points on surfaces that have areas within a quarter of the mean.
const LEAST_EVEN_CELLS: f64 = 0.95;
/// The least share of the points of a uniform cloud that stand on surfaces.
const LEAST_ON_SURFACES: f64 = 0.5;
/// The energy of a sphere after Poisson-disk thinning, without any iteration: from here on points are not uniform.
const ENERGY_OF_THINNING: f64 = 1.12;
/// The share of cells with areas within a quarter of the mean after Poisson-disk thinning: with fewer, points are not
/// uniform.
const EVEN_CELLS_OF_THINNING: f64 = 0.92;
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

/// Whether the points on surfaces are even, and how even the others are.
fn uniform(report: &Report) -> Verdict {
    let (on_surfaces, elsewhere) = (&report.evenness.on_surfaces, &report.evenness.elsewhere);
    let all = (on_surfaces.count + elsewhere.count).max(1);
    let share = on_surfaces.count as f64 / all as f64;
    let mut figures: Vec<String> = Vec::new();
    if on_surfaces.cells > 0 {
        figures.push(format!(
            "on surfaces ({:.0} % of the points) δ {}, energy {}, {:.1} % of the cells within a quarter of the mean area",
            100.0 * share,
            figure(on_surfaces.delta),
            figure(on_surfaces.energy_ratio),
            100.0 * on_surfaces.even_cells
        ));
    }
    if elsewhere.count > 0 {
        figures.push(format!(
            "on leaves, wires, edges ({:.0} %) δ {}, distances from {} to {} of the mean",
            100.0 * (1.0 - share),
            figure(elsewhere.delta),
            figure(elsewhere.p1),
            figure(elsewhere.p99)
        ));
    }
    Verdict {
        question: "uniform?",
        answer: evenness(on_surfaces, share),
        figures: figures.join("; "),
    }
}

/// Whether a cloud is uniform of which a `share` stand on surfaces, as evenly as the figures `on_surfaces` say.
fn evenness(on_surfaces: &Uniformity, share: f64) -> &'static str {
    let (energy, even) = (on_surfaces.energy_ratio, on_surfaces.even_cells);
    if on_surfaces.cells > 0 && (energy >= ENERGY_OF_THINNING || even < EVEN_CELLS_OF_THINNING) {
        "no"
    } else if share >= LEAST_ON_SURFACES && energy <= LARGEST_ENERGY && even >= LEAST_EVEN_CELLS {
        "yes"
    } else {
        "partly"
    }
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

/// Whether every file was read, with every point that its header states, and all points are where it says.
fn complete(report: &Report) -> Verdict {
    let inputs = &report.run.inputs;
    let read: u64 = inputs.iter().map(|input| input.read).sum();
    let rejected: u64 = inputs.iter().map(|input| input.rejected).sum();
    let filtered: u64 = inputs.iter().map(|input| input.filtered).sum();
    let outside: u64 = inputs.iter().map(|input| input.outside).sum();
    let left_out = inputs
        .iter()
        .filter(|input| input.left_out.is_some())
        .count() as u64;
    let missing: String = [
        (filtered, "left out by the filter"),
        (rejected, "rejected"),
        (outside, "outside of their header's bounds"),
        (left_out, "of the files left out"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, reason)| format!(", {} {reason}", thousands(*count)))
    .collect();
    let (read, written) = (counted(read, "point"), thousands(report.run.points));
    verdict(
        "complete?",
        rejected == 0 && outside == 0 && left_out == 0,
        format!("{read} read{missing}; {written} written"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{CellFigures, UniformityTally};

    /// Figures of a cloud with an energy ratio of 1 for cells of these areas, times `energy`.
    fn figures(areas: &[f64], energy: f64) -> Uniformity {
        let mut tally = UniformityTally::new(1.0);
        for &area in areas.iter().cycle().take(1000) {
            tally.push_distance(1.0);
            tally.push_cell(CellFigures {
                area,
                energy: 0.160_375 * energy * area,
                neighbors: 6,
            });
        }
        tally.figures()
    }

    #[test]
    fn even_points_on_surfaces_are_uniform_and_others_are_not() {
        let even = figures(&[0.8, 0.9, 1.0, 1.1, 1.2], 1.02);
        assert_eq!(evenness(&even, 0.9), "yes");
        assert_eq!(evenness(&even, 0.3), "partly");
        assert_eq!(evenness(&figures(&[1.0], 1.08), 0.9), "partly");
        assert_eq!(evenness(&figures(&[1.0], 1.13), 0.9), "no");
        // Three cells in five are within a quarter of the mean.
        let uneven = figures(&[0.6, 0.9, 1.0, 1.1, 1.4], 1.02);
        assert_eq!(evenness(&uneven, 0.9), "no");
        assert_eq!(
            evenness(&UniformityTally::new(1.0).figures(), 0.0),
            "partly"
        );
    }
}
