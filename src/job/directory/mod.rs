//! The job directory: its owner, its files, and the room on its disk.

pub(crate) mod ownership;
pub(crate) mod room;
pub(crate) mod scratch;
pub(crate) mod stamps;
pub(crate) mod tiles;

pub(crate) use ownership::{JobDirectory, Stamp, bytes_in, default_directory, write_among_others};
