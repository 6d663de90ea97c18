//! How a job says where it is; the binary decides how it looks.

/// What is being counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Points of the input.
    Points,
    /// Tiles.
    Tiles,
}

/// Someone who listens to a job.
pub trait Progress: Sync {
    /// A stage begins; `total` units are ahead of it, `done` of them done by an
    /// earlier run.
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit);
    /// `amount` more units are done. Called from any thread.
    fn advance(&self, amount: u64);
    /// The stage is done.
    fn end(&self);
    /// Something worth a line.
    fn note(&self, text: &str);
}

/// Listens to nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _: &str, _: u64, _: u64, _: Unit) {}
    fn advance(&self, _: u64) {}
    fn end(&self) {}
    fn note(&self, _: &str) {}
}
