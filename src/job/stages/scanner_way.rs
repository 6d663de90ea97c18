//! The way of a scanner, in the coordinates of a run.

use std::path::Path;

use crate::{
    geometry::{Quantization, ScannerWay},
    las::{LasError, Waypoint, read_trajectory},
};

/// Reads the way of a scanner from the file at `path`, in the local coordinates of `quantization`.
///
/// # Errors
///
/// See [`read_trajectory`].
pub(super) fn scanner_way(
    path: &Path,
    quantization: &Quantization,
) -> Result<ScannerWay, LasError> {
    let waypoints = read_trajectory(path)?.into_iter();
    let local = |Waypoint { time, place }: Waypoint| (time, quantization.local_of_world(place));
    Ok(ScannerWay(waypoints.map(local).collect()))
}
