//! One job that several processes do together, on one machine or on many that share nothing but
//! a directory.
//!
//! ```text
//!   scatter  ─►  handover  ─►  solve  ─►  stitch
//!   groups of    job and       groups     pieces of each work;
//!   scans        plan          of tiles   one process completes the cloud
//! ```
//!
//! Scans and tiles are divided into groups. Each process claims a group by creating a file
//! ([`claims`]), gives heartbeats while it works ([`worker`]), and takes over the groups of
//! processes that have fallen silent ([`liveness`]).

mod claims;
mod group_files;
mod handover;
mod liveness;
mod shared_stitch;
mod status;
mod tile_groups;
mod worker;

pub(super) use claims::{AttemptState, Claim, GROUP_LIMIT, WorkKind};
pub(super) use group_files::files_of_others;
pub(super) use shared_stitch::SharedStitch;
pub(crate) use status::{ClaimedGroup, JobStatus};
pub(crate) use worker::Worker;
