//! The progress of a job on standard error: bars on a terminal, plain lines elsewhere, JSON
//! lines for machines. Standard output is for results.

use std::{
    io::IsTerminal,
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

use super::printing::say;
use crate::{
    job::{Progress, Standing, Unit},
    report::{counted, stage_title, thousands},
};

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Display {
    /// A bar for each stage.
    Bars,
    /// A line of text now and then.
    Lines,
    /// A line of JSON now and then.
    Json,
    /// Nothing but errors; the summary is left out, too.
    Nothing,
}

impl Display {
    /// Chooses by the flags, and by whether standard error is a terminal.
    pub(super) fn choose(quiet: bool, json: bool) -> Self {
        match (quiet, json) {
            (true, _) => Self::Nothing,
            (_, true) => Self::Json,
            _ if std::io::stderr().is_terminal() => Self::Bars,
            _ => Self::Lines,
        }
    }
}

/// The least time between two lines of text about the same stage.
const BETWEEN_LINES: Duration = Duration::from_secs(10);
/// The least time between two lines of JSON about the same stage.
const BETWEEN_EVENTS: Duration = Duration::from_secs(1);

/// The stage that the job is in.
struct Stage {
    name: String,
    unit: Unit,
    /// The expected number of units.
    total: u64,
    done: u64,
    /// The number of units that an earlier run has done; they do not count in the speed.
    before: u64,
    start: Instant,
    bar: Option<ProgressBar>,
}

/// A listener that shows the stages of a job.
pub(super) struct Terminal {
    display: Display,
    state: Mutex<State>,
}

struct State {
    stage: Option<Stage>,
    standing: Standing,
    last_line: Instant,
}

impl Terminal {
    pub(super) fn new(display: Display) -> Self {
        Self {
            display,
            state: Mutex::new(State {
                stage: None,
                standing: Standing::default(),
                last_line: Instant::now(),
            }),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn line(&self, stage: &Stage, standing: &Standing, event: &str) {
        let seconds = stage.start.elapsed().as_secs_f64();
        match self.display {
            Display::Json => {
                let line = serde_json::json!({
                    "event": event, "stage": stage.name, "done": stage.done,
                    "total": stage.total, "seconds": seconds,
                    "remaining_in_stage": stage.remaining(),
                    "remaining": standing.remaining,
                    "memory": standing.memory, "budget": standing.budget,
                });
                say!("{line}");
            }
            Display::Lines => {
                let rest = match event {
                    "progress" => format!("; {}", stage.outlook(standing)),
                    _ => String::new(),
                };
                let total = stage.total_of_units();
                say!(
                    "{:<8} {} of {total} in {seconds:.1} s{rest}",
                    stage_title(&stage.name),
                    thousands(stage.done),
                );
            }
            Display::Bars | Display::Nothing => {}
        }
    }
}

impl Stage {
    /// Returns the seconds until the stage is done, at its speed up to now.
    fn remaining(&self) -> Option<f64> {
        let now = self.done.checked_sub(self.before).filter(|&n| n > 0)?;
        let rest = self.total.saturating_sub(self.done) as f64;
        Some(self.start.elapsed().as_secs_f64() * rest / now as f64)
    }

    /// Returns the expected number of units with their name: an estimate, which is not below the
    /// number that is done.
    fn total_of_units(&self) -> String {
        let total = self.total.max(self.done);
        let unit = match self.unit {
            Unit::Points => "point",
            Unit::Tiles => "tile",
        };
        counted(total, unit)
    }

    /// Returns how much is done, and how fast.
    fn count(&self) -> String {
        let (done, total) = (self.done, self.total.max(self.done));
        match self.unit {
            Unit::Tiles => format!("{done} of {}", self.total_of_units()),
            Unit::Points => {
                let millions = |points: u64| 1e-6 * points as f64;
                let speed = millions(done - self.before) / self.start.elapsed().as_secs_f64();
                format!(
                    "{:.1} of {:.1} M points, {speed:.1} M/s",
                    millions(done),
                    millions(total)
                )
            }
        }
    }

    /// Returns the memory in use, and the time until the end of the run, or, if that is not
    /// known, of the stage.
    fn outlook(&self, standing: &Standing) -> String {
        let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
        let memory = standing.memory.map(|memory| {
            let (used, budget) = (mebibytes(memory), mebibytes(standing.budget));
            format!("memory {used} of {budget} MiB")
        });
        let rest = match (standing.remaining, self.remaining()) {
            (Some(all), _) => Some(format!("{} left", duration(all))),
            (None, Some(stage)) => Some(format!("{} left in this stage", duration(stage))),
            (None, None) => None,
        };
        let parts: Vec<String> = memory.into_iter().chain(rest).collect();
        parts.join(", ")
    }
}

/// Returns minutes and seconds, `1:35` for 95, with hours before them if there are any.
pub(super) fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0).round() as u64;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    match hours {
        0 => format!("{minutes}:{:02}", seconds % 60),
        _ => format!("{hours}:{minutes:02}:{:02}", seconds % 60),
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit) {
        let bar = (self.display == Display::Bars).then(|| {
            let style = ProgressStyle::with_template("{prefix:8} {wide_bar} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(total)
                .with_style(style)
                .with_prefix(stage_title(stage).to_owned());
            bar.set_position(done);
            bar.reset_eta();
            bar
        });
        let stage = Stage {
            name: stage.to_owned(),
            unit,
            total,
            done,
            before: done,
            start: Instant::now(),
            bar,
        };
        let mut state = self.state();
        if self.display == Display::Json {
            self.line(&stage, &state.standing, "begin");
        }
        state.last_line = Instant::now();
        state.stage = Some(stage);
    }

    fn advance(&self, amount: u64) {
        if let Some(stage) = &mut self.state().stage {
            stage.done += amount;
            if let Some(bar) = &stage.bar {
                bar.inc(amount);
            }
        }
    }

    fn end(&self) {
        let mut state = self.state();
        if let Some(stage) = state.stage.take() {
            match &stage.bar {
                Some(bar) => bar.finish_with_message(stage.count()),
                None => self.line(&stage, &state.standing, "end"),
            }
        }
    }

    fn standing(&self, standing: &Standing) {
        let mut state = self.state();
        state.standing = *standing;
        let State {
            stage: Some(stage), ..
        } = &*state
        else {
            return;
        };
        let between = match self.display {
            Display::Json => BETWEEN_EVENTS,
            _ => BETWEEN_LINES,
        };
        if let Some(bar) = &stage.bar {
            bar.set_message(format!("{}; {}", stage.count(), stage.outlook(standing)));
        } else if state.last_line.elapsed() >= between {
            self.line(stage, standing, "progress");
            state.last_line = Instant::now();
        }
    }

    fn note(&self, text: &str) {
        match self.display {
            Display::Json => say!("{}", serde_json::json!({ "event": "note", "text": text })),
            Display::Nothing => {}
            Display::Bars | Display::Lines => say!("{text}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_read_at_a_glance() {
        let said = [0.4, 95.0, 3599.6, 36_061.0].map(duration);
        assert_eq!(said, ["0:00", "1:35", "1:00:00", "10:01:01"]);
    }
}
