//! The job: stages, threads, budget, resume.
//!
//! ```text
//!   survey ─► scatter ─► spacing ─► plan ─► solve ─► stitch ─► write ─► report
//! ```
//!
//! Each stage leaves files in the job directory that the next one reads, and
//! that a later run of the same job finds: what is done is not done again.

mod clock;
mod directory;
mod disk;
mod error;
mod excerpt;
mod field;
mod forecast;
mod gathering;
mod glimpse;
mod handover;
mod job;
mod measuring;
mod memory;
mod outcome;
mod planning;
mod progress;
mod provenance;
mod queue;
mod rendering;
mod scattering;
mod scratch;
mod sharing;
mod solving;
mod spacing;
mod stamps;
mod status;
mod survey;
mod tile_groups;
mod tiles;
mod transfer;
mod writing;

pub use clock::{Held, StageCost};
pub use directory::default_directory;
pub use disk::write_file;
pub use error::{JobError, LeftOut};
pub use excerpt::{Excerpt, ShownPoint};
pub use field::{Field, FieldSquare, WorstPlace};
pub use glimpse::Glimpse;
pub use job::Job;
pub use measuring::{Measured, measure, measure_against_surface};
pub use memory::{memory_limit, peak_resident};
pub use outcome::Outcome;
pub use planning::JobPlan;
pub use progress::{Progress, Quiet, Standing, Unit};
pub use rendering::{Coloring, Picture, render};
pub use scattering::InputCount;
pub use sharing::Worker;
pub use solving::TileFigures;
pub use status::{BegunGroup, JobStatus};
pub use survey::Survey;
pub use writing::Stitched;
