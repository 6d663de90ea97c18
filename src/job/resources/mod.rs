//! What a run may use and what it uses: memory, disk and time.

mod budget;
mod clock;
mod forecast;
mod memory;

pub(crate) use budget::{Budget, mebibytes, points_for, tile_bytes};
pub(crate) use clock::{Clock, ResourceSample, StageCost};
pub(crate) use forecast::Forecast;
pub(crate) use memory::{peak_resident, resident};
