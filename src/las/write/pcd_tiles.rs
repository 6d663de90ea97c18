//! The index of PCD tiles that driving software reads: `pointcloud_map_metadata.yaml` of Autoware.

use std::path::Path;

use super::tile_names::DRIVING_INDEX_NAME;
use crate::las::error::LasError;

/// Writes the index of tiles with this `edge`, by their names and south-west corners (CRS units), to `directory`. The
/// corners in it are relative to `origin`, as the points are. Returns its length in bytes.
///
/// # Errors
///
/// If a corner is no whole number, which is all that the reader takes, or the file cannot be written.
pub(super) fn write_driving_index(
    directory: &Path,
    edge: f64,
    origin: [f64; 3],
    tiles: &[(String, [f64; 2])],
) -> Result<u64, LasError> {
    let mut text = format!("x_resolution: {edge:.1}\ny_resolution: {edge:.1}\n");
    for (file, corner) in tiles {
        let [x, y] = [0, 1].map(|axis| corner[axis] - origin[axis]);
        if x.fract() != 0.0 || y.fract() != 0.0 {
            let problem = format!(
                "its tiles have corners such as {x}, {y}; their index can have whole numbers only: give \
                 --output-tiles and --pcd-origin in whole units"
            );
            return Err(LasError::new(directory, problem));
        }
        text += &format!("{}: [{x}, {y}]\n", yaml_key(file));
    }
    let path = directory.join(DRIVING_INDEX_NAME);
    std::fs::write(&path, &text).map_err(|e| LasError::unwritable(&path, e))?;
    Ok(text.len() as u64)
}

/// The name of a file as a key, in quotation marks unless all of it is sure to be read as text.
fn yaml_key(name: &str) -> String {
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "._-".contains(c));
    match is_plain {
        true => name.to_owned(),
        false => serde_json::Value::from(name).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_index_has_whole_corners_relative_to_the_origin() {
        let dir = tempfile::tempdir().unwrap();
        let tiles = [
            (
                "map_431000_5400000.pcd".to_owned(),
                [431_000.0, 5_400_000.0],
            ),
            ("my map_-20_0.pcd".to_owned(), [430_980.0, 5_400_020.0]),
        ];
        let write =
            |edge| write_driving_index(dir.path(), edge, [431_000.0, 5_400_000.0, 0.0], &tiles);
        let bytes = write(20.0).unwrap();
        let text = std::fs::read_to_string(dir.path().join(DRIVING_INDEX_NAME)).unwrap();
        assert_eq!(text.len() as u64, bytes);
        assert_eq!(
            text,
            "x_resolution: 20.0\ny_resolution: 20.0\nmap_431000_5400000.pcd: [0, 0]\n\"my map_-20_0.pcd\": [-20, 20]\n"
        );
        let half = [("a.pcd".to_owned(), [0.5, 0.0])];
        let error = write_driving_index(dir.path(), 0.5, [0.0; 3], &half).unwrap_err();
        assert!(error.to_string().contains("whole"), "{error}");
    }
}
