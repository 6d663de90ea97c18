//! The job: from scans to an even cloud, within threads and memory, continued after a stop.
//!
//! ```text
//!   survey ─► scatter ─► spacing ─► plan ─► solve ─► stitch ─► write ─► report
//!             spill      spacing    plan    tiles    settled   sorted
//!             .bin       .json      .json   .solved  .pieces   .bin
//! ```
//!
//! Each stage leaves files in the job directory, named in the lower line, that the next stage reads.
//! A later run of the same job finds them and does not repeat completed work.
//!
//! * [`request`] is the builder that programs use; [`description`] states inputs, output and
//!   settings, validated; [`placement`] says where its files lie; [`complete`] has the order of the stages, and [`run`] gives what they
//!   made its name; [`context`] contains what every stage works with; [`mesh_levels`] makes the
//!   coarser levels of a mesh, each as a job of its own.
//! * [`stages`] has a file for each stage.
//! * [`directory`] and [`resources`] manage disk, memory and time.
//! * [`cluster`] lets several processes share a job; [`measure`] gives the figures of any cloud.

mod cluster;
mod complete;
mod context;
mod description;
mod directory;
mod error;
mod measure;
mod mesh_levels;
mod numbers;
mod outcome;
mod placement;
mod progress;
mod request;
mod resources;
mod run;
mod stages;
mod tile_figures;

pub(crate) use cluster::{ClaimedGroup, JobStatus, Worker};
pub(crate) use description::{JobDescription, memory_budget};
pub(crate) use directory::write_file;
pub use error::JobError;
pub(crate) use measure::{Measured, measure, measure_against_surface};
#[cfg(feature = "report")]
pub(crate) use numbers::{counted, thousands};
pub use outcome::Outcome;
pub(crate) use outcome::{MeshLevel, ReportedLevels};
pub(crate) use placement::Placement;
pub use progress::{Progress, Quiet, Standing, Unit};
pub use request::Job;
pub(crate) use resources::{ResourceSample, StageCost};
pub(crate) use stages::{InputCount, plan::JobPlan};
