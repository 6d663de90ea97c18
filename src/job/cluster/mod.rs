//! One job that several processes do together, on one machine or on many that share nothing but
//! a directory.
//!
//! ```text
//!   scatter  ─►  handover  ─►  solve  ─►  stitch
//!   groups of    job and       groups     one process
//!   scans        plan          of tiles
//! ```
//!
//! Scans and tiles are divided into groups. Each process claims a group by creating a file
//! ([`claims`]), gives heartbeats while it works ([`worker`]), and takes over the groups of
//! processes that have fallen silent ([`liveness`]).

mod claims;
mod group_files;
mod handover;
mod liveness;
mod status;
mod tile_groups;
mod worker;

pub(super) use claims::{AttemptState, Claim, GROUP_LIMIT, WorkKind};
pub(super) use group_files::files_of_others;
pub(crate) use status::JobStatus;
pub(crate) use worker::Worker;
