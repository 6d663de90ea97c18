//! How a job reports its progress; the listener decides how the reports look.

/// The unit in which a stage is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Points of the input.
    Points,
    /// Tiles.
    Tiles,
}

/// Memory and remaining time of a run at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Resident memory in bytes; `None` where the system does not report it.
    pub memory: Option<u64>,
    /// The memory budget in bytes.
    pub budget: u64,
    /// Seconds until the run is done; `None` before there is an estimate.
    pub remaining: Option<f64>,
}

/// A listener to the reports of a job.
pub trait Progress: Sync {
    /// Reports that a stage of `total` units begins, `done` of which an earlier run has done.
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit);
    /// Reports that `amount` more units are done. May be called from any thread.
    fn advance(&self, amount: u64);
    /// Reports that the stage is done.
    fn end(&self);
    /// Reports a fact about the inputs or the run that is worth a line.
    fn note(&self, text: &str);
    /// Reports memory and remaining time, several times a second, from a thread of its own.
    fn standing(&self, standing: &Standing);
}

/// A listener that ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _: &str, _: u64, _: u64, _: Unit) {}
    fn advance(&self, _: u64) {}
    fn end(&self) {}
    fn note(&self, _: &str) {}
    fn standing(&self, _: &Standing) {}
}
