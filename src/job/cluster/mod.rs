//! One job that several processes do together, on one machine or on many.

mod claims;
mod handover;
mod status;
mod tile_groups;

pub(crate) use claims::Worker;
pub(super) use claims::{Claim, Ending, Kind, MOST_GROUPS};
pub(crate) use status::JobStatus;
pub(super) use tile_groups::packs;
