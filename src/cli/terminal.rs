//! How a job looks while it runs: bars on a terminal, plain lines elsewhere,
//! JSON lines for machines. All on standard error; standard output is for
//! results.

use std::{
    io::IsTerminal,
    sync::Mutex,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};
use lloydar::{
    pipeline::{Progress, Unit},
    report::thousands,
};

use super::printing::say;

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    Bars,
    Lines,
    Json,
    Nothing,
}

impl Look {
    /// By the flags, and by where standard error goes.
    pub(super) fn choose(quiet: bool, json: bool) -> Self {
        match (quiet, json) {
            (true, _) => Self::Nothing,
            (_, true) => Self::Json,
            _ if std::io::stderr().is_terminal() => Self::Bars,
            _ => Self::Lines,
        }
    }
}

/// Lines no more often than this where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

struct Stage {
    name: String,
    unit: Unit,
    total: u64,
    done: u64,
    /// Done by an earlier run: not to be counted in the speed.
    before: u64,
    start: Instant,
    last_line: Instant,
    bar: Option<ProgressBar>,
}

/// Shows the stages of a job.
pub(super) struct Terminal {
    look: Look,
    stage: Mutex<Option<Stage>>,
}

impl Terminal {
    pub(super) fn new(look: Look) -> Self {
        Self {
            look,
            stage: Mutex::new(None),
        }
    }

    fn with<T>(&self, f: impl FnOnce(&mut Option<Stage>) -> T) -> T {
        f(&mut self
            .stage
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    fn line(&self, stage: &Stage, event: &str) {
        let seconds = stage.start.elapsed().as_secs_f64();
        match self.look {
            Look::Json => {
                let line = serde_json::json!({
                    "event": event, "stage": stage.name, "done": stage.done,
                    "total": stage.total, "seconds": seconds,
                    "remaining": stage.remaining(),
                });
                say!("{line}");
            }
            Look::Lines => {
                let rest = match stage.remaining() {
                    Some(rest) if event == "progress" => format!(", about {rest:.0} s to go"),
                    _ => String::new(),
                };
                say!(
                    "{:<8} {} of {} {} in {seconds:.1} s{rest}",
                    stage.name,
                    thousands(stage.done),
                    thousands(stage.total),
                    match stage.unit {
                        Unit::Points => "points",
                        Unit::Tiles => "tiles",
                    }
                );
            }
            Look::Bars | Look::Nothing => {}
        }
    }
}

impl Stage {
    fn remaining(&self) -> Option<f64> {
        let now = self.done.checked_sub(self.before).filter(|&n| n > 0)?;
        let rest = self.total.saturating_sub(self.done) as f64;
        Some(self.start.elapsed().as_secs_f64() * rest / now as f64)
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit) {
        let bar = (self.look == Look::Bars).then(|| {
            let template = match unit {
                Unit::Points => {
                    "{prefix:8} {wide_bar} {human_pos}/{human_len} points {per_sec} {eta:>4}"
                }
                Unit::Tiles => "{prefix:8} {wide_bar} {pos}/{len} tiles {eta:>4}",
            };
            let style = ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(total)
                .with_style(style)
                .with_prefix(stage.to_owned());
            bar.set_position(done);
            bar.reset_eta();
            bar
        });
        let now = Instant::now();
        let stage = Stage {
            name: stage.to_owned(),
            unit,
            total,
            done,
            before: done,
            start: now,
            last_line: now,
            bar,
        };
        if self.look == Look::Json {
            self.line(&stage, "begin");
        }
        self.with(|held| *held = Some(stage));
    }

    fn advance(&self, amount: u64) {
        self.with(|held| {
            let Some(stage) = held else { return };
            stage.done += amount;
            if let Some(bar) = &stage.bar {
                bar.inc(amount);
            } else if stage.last_line.elapsed() >= BETWEEN_LINES {
                stage.last_line = Instant::now();
                self.line(stage, "progress");
            }
        });
    }

    fn end(&self) {
        if let Some(stage) = self.with(Option::take) {
            match &stage.bar {
                Some(bar) => bar.finish(),
                None => self.line(&stage, "end"),
            }
        }
    }

    fn note(&self, text: &str) {
        match self.look {
            Look::Json => say!("{}", serde_json::json!({ "event": "note", "text": text })),
            Look::Nothing => {}
            Look::Bars | Look::Lines => say!("{text}"),
        }
    }
}
