//! The stages of a job, each of which leaves files that the next one reads.

pub(crate) mod gathering;
pub(crate) mod planning;
pub(crate) mod provenance;
pub(crate) mod queue;
pub(crate) mod scattering;
pub(crate) mod solving;
pub(crate) mod survey;
pub(crate) mod transfer;
pub(crate) mod writing;
