//! The job: stages, threads, budget, resume.
//!
//! ```text
//!   survey ─► scatter ─► spacing ─► plan ─► solve ─► stitch ─► write ─► report
//! ```
//!
//! Each stage leaves files in the job directory that the next one reads, and
//! that a later run of the same job finds: what is done is not done again.

mod clock;
mod cluster;
mod directory;
mod disk;
mod error;
mod forecast;
mod gathering;

mod measure;
mod memory;
mod outcome;
mod planning;
mod progress;
mod provenance;
mod queue;
mod running;
mod scattering;
mod scratch;

mod solving;
mod spacing;
mod stamps;

mod survey;

mod tiles;
mod transfer;
mod writing;

pub(crate) use clock::{ResourceSample, StageCost};
pub(crate) use cluster::{JobStatus, Worker};
pub(crate) use directory::default_directory;
pub(crate) use disk::write_file;
pub(crate) use error::{JobError, LeftOut};
pub(crate) use measure::{measure, measure_against_surface};
pub(crate) use outcome::Outcome;
pub(crate) use planning::JobPlan;
pub use progress::{Progress, Quiet, Standing, Unit};
pub use running::Job;
pub(crate) use scattering::InputCount;

pub(crate) use solving::TileFigures;

pub(crate) use survey::Survey;
