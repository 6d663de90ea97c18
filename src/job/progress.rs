//! How a job says where it is; the binary decides how it looks.

/// What is being counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Points of the input.
    Points,
    /// Tiles.
    Tiles,
}

/// Where a run stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Memory held, in bytes; nothing where the system does not tell.
    pub memory: Option<u64>,
    /// The budget, in bytes.
    pub budget: u64,
    /// Seconds until the run is done; nothing before that can be told.
    pub remaining: Option<f64>,
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
    /// Told several times a second, from a thread of its own.
    fn standing(&self, standing: &Standing);
}

/// Listens to nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _: &str, _: u64, _: u64, _: Unit) {}
    fn advance(&self, _: u64) {}
    fn end(&self) {}
    fn note(&self, _: &str) {}
    fn standing(&self, _: &Standing) {}
}
