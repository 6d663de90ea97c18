//! The names of tiles and of their index.
//!
//! Each file is named by the south-west corner of its square, as is the custom:
//! `NAME_431000_5400000.laz`.

use std::{ffi::OsString, path::Path};

use super::tile_format::TileFormat;

/// The name of the index: GeoJSON in the CRS of the data.
pub(super) const INDEX_NAME: &str = "tiles.geojson";
/// The ending of the name of the catalogue of LAZ tiles, which is otherwise that of the cloud.
pub(super) const CATALOGUE_ENDING: &str = ".vpc";
/// The name of the index of PCD tiles that driving software reads.
pub(super) const DRIVING_INDEX_NAME: &str = "pointcloud_map_metadata.yaml";

/// The name of the tile of the cloud `cloud` whose south-west corner this is (CRS units).
pub(super) fn tile_name(cloud: &str, corner: [f64; 2], format: TileFormat) -> String {
    let [x, y] = corner.map(decimal);
    format!("{cloud}_{x}_{y}{}", format.ending())
}

/// Whether all files in the directory `dir` are tiles and their indices, so that new tiles may
/// replace it.
pub(super) fn contains_only_tiles(dir: &Path) -> bool {
    let cloud = dir.file_name().map(|name| name.to_string_lossy());
    let cloud = cloud.unwrap_or_default();
    let is_tile = |entry: OsString| {
        let entry = entry.to_string_lossy();
        let corner = entry.strip_prefix(&*cloud).and_then(|e| {
            TileFormat::ALL
                .iter()
                .find_map(|f| e.strip_suffix(f.ending()))
        });
        entry == INDEX_NAME
            || entry == DRIVING_INDEX_NAME
            || entry.strip_prefix(&*cloud) == Some(CATALOGUE_ENDING)
            || corner.is_some_and(|corner| {
                corner.starts_with('_') && !corner.contains(|c: char| c.is_ascii_alphabetic())
            })
    };
    std::fs::read_dir(dir)
        .is_ok_and(|mut entries| entries.all(|e| e.is_ok_and(|e| is_tile(e.file_name()))))
}

/// A coordinate as people write it, to a millionth.
fn decimal(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_written_without_trailing_zeros() {
        assert_eq!(decimal(431_000.0), "431000");
        assert_eq!(decimal(-0.1 * 3.0), "-0.3");
    }
}
