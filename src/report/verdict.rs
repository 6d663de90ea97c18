//! Four questions that the morning asks.

use super::{Report, figure, thousands};

/// An answer, with the figures behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// What was asked.
    pub(crate) question: &'static str,
    /// `yes` or `look`.
    pub(crate) answer: &'static str,
    /// Why.
    pub(crate) figures: String,
}

/// Lloyd must have made the cells more even than Poisson seeds are: less than
/// this share of the seeds' CV. A half is usual on smooth surfaces, and leaves
/// and wires are left as seeds.
const EVENER: f64 = 0.95;
/// Output this near to the input on average is on the surface, in spacings.
const NEAR: f64 = 0.25;
/// Input farther than 1.5 spacings from any output, at most.
const UNCOVERED: f64 = 0.02;
/// δ on seams over δ elsewhere.
const SEAM: f64 = 1.1;

fn verdict(question: &'static str, good: bool, figures: String) -> Verdict {
    Verdict {
        question,
        answer: if good { "yes" } else { "look" },
        figures,
    }
}

/// What was read and written; of what is missing, only what there is.
fn complete(written: u64, read: u64, [filtered, rejected, outside]: [u64; 3]) -> String {
    let missing = [
        (filtered, "left out as asked"),
        (rejected, "rejected"),
        (outside, "outside of their header's bounds"),
    ];
    let missing: String = missing
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!(", {} {what}", thousands(*count)))
        .collect();
    let (read, written) = (thousands(read), thousands(written));
    format!("{read} points read{missing}; {written} written")
}

/// Uniform? Faithful? Seamless? Complete?
pub(crate) fn verdicts(report: &Report) -> [Verdict; 4] {
    let (u, s) = (&report.uniformity, &report.seeds);
    let seams = &report.seams;
    let read: u64 = report.inputs.iter().map(|input| input.read).sum();
    let rejected: u64 = report.inputs.iter().map(|input| input.rejected).sum();
    let filtered: u64 = report.inputs.iter().map(|input| input.filtered).sum();
    let outside: u64 = report.inputs.iter().map(|input| input.outside).sum();
    // Tiles that agree to the bit on all they share put out what one tile would
    // have: then δ differs on seams by what is scanned there. Nor does it say
    // anything of a few points.
    let hides_no_seam = seams.identical == seams.shared || seams.on_seams.count < 100;
    [
        verdict(
            "uniform?",
            u.cell_area_cv < EVENER * s.cell_area_cv,
            format!(
                "δ {}, energy {}, cell-area CV {} (seeds {})",
                figure(u.delta),
                figure(u.energy_ratio),
                figure(u.cell_area_cv),
                figure(s.cell_area_cv)
            ),
        ),
        verdict(
            "faithful?",
            report.accuracy.mean < NEAR * report.spacing
                && report.coverage.share_beyond < UNCOVERED,
            format!(
                "to input {} mean, {} max; {:.2} % uncovered",
                figure(report.accuracy.mean),
                figure(report.accuracy.max),
                100.0 * report.coverage.share_beyond
            ),
        ),
        verdict(
            "seamless?",
            seams.duplicates == 0
                && (hides_no_seam || seams.on_seams.delta <= SEAM * seams.elsewhere.delta),
            format!(
                "δ {} on seams, {} elsewhere; {} of {} sites agree",
                figure(seams.on_seams.delta),
                figure(seams.elsewhere.delta),
                seams.identical,
                seams.shared
            ),
        ),
        verdict(
            "complete?",
            rejected == 0 && outside == 0,
            complete(report.points, read, [filtered, rejected, outside]),
        ),
    ]
}
