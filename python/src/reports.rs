//! What a task reports: kept until somebody asks.

use std::sync::{Mutex, MutexGuard, PoisonError};

use lloydar::progress::{Progress, Standing, Unit};
use pyo3::{prelude::*, types::PyDict};

/// The reports of a task since they were taken last.
#[derive(Default)]
pub(crate) struct Reports(Mutex<State>);

#[derive(Default)]
struct State {
    stage: Stage,
    notes: Vec<String>,
}

/// What a task does at one moment.
#[derive(Clone, Default)]
pub(crate) struct Stage {
    name: String,
    unit: &'static str,
    done: u64,
    total: u64,
    standing: Standing,
}

/// The number of steps in which the progress of work without stages is counted.
const STEPS: f64 = 100.0;

impl Reports {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reports that `share` of work without stages is done.
    pub(crate) fn reach(&self, share: f64) {
        let mut state = self.state();
        let stage = &mut state.stage;
        // Threads report as they come; the share does not fall.
        stage.done = stage.done.max((STEPS * share) as u64);
        stage.total = STEPS as u64;
        if stage.name.is_empty() {
            stage.name = "resample".to_owned();
            stage.unit = "%";
        }
    }

    /// Returns the stage, and the notes since the last call.
    pub(crate) fn take(&self) -> (Stage, Vec<String>) {
        let mut state = self.state();
        (state.stage.clone(), std::mem::take(&mut state.notes))
    }
}

impl Progress for Reports {
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit) {
        let mut state = self.state();
        state.stage = Stage {
            name: stage.to_owned(),
            unit: match unit {
                Unit::Points => "points",
                Unit::Tiles => "tiles",
            },
            done,
            total,
            standing: state.stage.standing,
        };
    }

    fn advance(&self, amount: u64) {
        self.state().stage.done += amount;
    }

    fn end(&self) {
        let mut state = self.state();
        state.stage.done = state.stage.done.max(state.stage.total);
    }

    fn note(&self, text: &str) {
        self.state().notes.push(text.to_owned());
    }

    fn standing(&self, standing: &Standing) {
        self.state().stage.standing = *standing;
    }
}

impl Stage {
    /// Returns the fields of `lloydar.Progress`.
    pub(crate) fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let fields = PyDict::new(py);
        fields.set_item("stage", self.name)?;
        fields.set_item("done", self.done)?;
        // The expected number of points is an estimate.
        fields.set_item("total", self.total.max(self.done))?;
        fields.set_item("unit", self.unit)?;
        fields.set_item("memory", self.standing.memory)?;
        fields.set_item("remaining", self.standing.remaining)?;
        Ok(fields)
    }
}
