//! The summary of a job for a terminal.

use super::{
    contents::Report,
    numbers::{counted, mebibytes},
    transients,
    verdict::verdicts,
    wording::stage_title,
};

/// The share of the time of a run below which the summary leaves a stage out.
const SHORT_STAGE: f64 = 0.01;

impl Report {
    /// Returns a few lines for a terminal.
    pub(crate) fn summary(&self) -> String {
        let mut text = format!(
            "{}, {}: {}\n",
            counted(self.run.points, "point"),
            self.run.apart(self.length_unit),
            self.run.output
        );
        for verdict in verdicts(self) {
            let (question, answer) = (verdict.question, verdict.answer);
            text += &format!("{question:<9} {answer:<6} {}\n", verdict.figures);
        }
        if self.isolated.count > 0 {
            text += &format!("isolated  {}\n", self.isolated.in_words());
        }
        if let Some(counts) = self.transients {
            text += &format!("passing   {}\n", transients::in_words(counts));
        }
        if let Some(mesh) = &self.mesh {
            text += &format!("mesh      {}\n", mesh.summary());
        }
        let costs = &self.costs;
        let all: f64 = costs.stages.iter().map(|stage| stage.seconds).sum();
        let stages = costs.stages.iter();
        let stages: Vec<String> = stages
            .filter(|stage| stage.seconds > SHORT_STAGE * all)
            .map(|stage| format!("{} {:.1}", stage_title(&stage.stage), stage.seconds))
            .collect();
        text += &format!("time      {all:.1} s: {}\n", stages.join(", "));
        text += &format!(
            "memory    {} of {}; temporary files {}\n",
            costs.memory_peak.map_or("–".into(), mebibytes),
            mebibytes(costs.memory_budget),
            mebibytes(costs.temporary_peak)
        );
        text
    }
}
