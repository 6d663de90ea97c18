//! The job: stages, threads, budget, resume.
//!
//! ```text
//!   survey ─► scatter ─► spacing ─► plan ─► solve ─► stitch ─► write ─► report
//! ```
//!
//! Each stage leaves files in the job directory that the next one reads, and
//! that a later run of the same job finds: what is done is not done again.

mod cluster;
mod directory;
mod error;
mod measure;
mod outcome;
mod progress;
mod resources;
mod running;

mod spacing;
mod stages;
mod tile_figures;

use stages::{
    gathering, planning, provenance, queue, scattering, solving, survey, transfer, writing,
};

pub(crate) use cluster::{JobStatus, Worker};
pub(crate) use directory::{default_directory, write_file};
pub(crate) use error::{JobError, LeftOut};
pub(crate) use measure::{measure, measure_against_surface};
pub(crate) use outcome::Outcome;
pub(crate) use planning::JobPlan;
pub use progress::{Progress, Quiet, Standing, Unit};
pub(crate) use resources::{ResourceSample, StageCost};
pub use running::Job;
pub(crate) use scattering::InputCount;

pub(crate) use tile_figures::TileFigures;

pub(crate) use survey::Survey;
