//! The job directory: which job it belongs to, which files it contains, and the room on its disk.
//!
//! ```text
//!   ownership     job.json and the lock: one job, one process at a time
//!   file_names    which names are those of a job's files
//!   json_files    small files, written completely or not at all
//!   stamp         length and time of a file, by which changes are noticed
//!   input_stamps  the stamps of all inputs when the job began
//!   started_tiles the tiles between two rounds
//!   solved_tiles  the results of the tiles
//!   room          the space that the disks must have
//!   scratch       temporary files of the last stage, on another disk
//! ```

mod file_names;
mod input_stamps;
mod json_files;
mod ownership;
mod room;
mod scratch;
mod solved_tiles;
mod stamp;
mod started_tiles;

pub(crate) use file_names::{
    PLAN_FILE, UPLOAD_DIRECTORY, WRITTEN_DIRECTORY, bytes_in, is_of_tiles,
};
pub(crate) use input_stamps::InputStamps;
pub(crate) use json_files::{write_among_others, write_file};
pub(crate) use ownership::{JobDirectory, default_directory};
pub(crate) use room::{DiskNeed, check_room, directory_of};
pub(crate) use scratch::Scratch;
pub(crate) use solved_tiles::SolvedTiles;
pub(crate) use stamp::Stamp;
pub(crate) use started_tiles::{StartedTile, StartedTiles};
