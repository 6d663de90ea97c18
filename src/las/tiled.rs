//! A cloud as a directory of files, one for each square of the plane.
//!
//! Squares are multiples of their edge in world coordinates; a point on a side belongs to
//! the square east or north of it. Each file is named by the south-west corner of its
//! square, as is the custom: `NAME_431000_5400000.laz`.

use std::{collections::BTreeSet, path::Path};

use serde_json::json;

use super::{CloudHeader, CloudWriter, Crs, Format, LasError, Workspace};
use crate::{
    geometry::{Rect, Stored},
    tile::Spill,
};

/// Bytes of records that are handed on at a time.
const BATCH_BYTES: usize = 4 << 20;
/// The index, in GeoJSON, in the CRS of the data.
const INDEX: &str = "tiles.geojson";

/// Writes the points of `spill` into the directory `dir`, and an index. `progress` hears
/// of points that are written. Returns how many bytes there are.
pub(super) fn write_tiles(
    dir: &Path,
    name: &str,
    spill: &Spill,
    header: &CloudHeader,
    workspace: &Workspace,
    progress: &dyn Fn(u64),
) -> Result<u64, LasError> {
    let squares = Squares {
        edge: workspace.tile_edge,
        scale: header.quantization.scale,
        offset: header.quantization.offset,
    };
    let (mut bytes, mut points) = (0, 0);
    let mut features = Vec::new();
    for square in squares.occupied(spill) {
        let corner = square.map(|place| decimal(place as f64 * squares.edge));
        let file = format!("{name}_{}_{}.laz", corner[0], corner[1]);
        let path = dir.join(&file);
        let wrong =
            |e: &dyn std::fmt::Display| LasError::new(&path, format!("cannot be written: {e}"));
        let mut writer = CloudWriter::create(&path, Format::Laz, header, workspace)?;
        let mut waiting = Vec::new();
        let mut heights = [i32::MAX, i32::MIN];
        let mut failure = None;
        let gathered = spill.gather(&squares.rect(square), |record| {
            let z = Stored::of_record(record).z;
            heights = [heights[0].min(z), heights[1].max(z)];
            waiting.extend_from_slice(record);
            if waiting.len() >= BATCH_BYTES && failure.is_none() {
                failure = writer.write(&waiting).err();
                waiting.clear();
            }
        });
        gathered.map_err(|e| wrong(&e))?;
        if let Some(error) = failure {
            return Err(error);
        }
        writer.write(&waiting)?;
        let cloud = writer.complete(&|_| {})?;
        if cloud.points() == 0 {
            // Its neighbours' points share a counting square with it.
            continue;
        }
        progress(cloud.points());
        bytes += cloud.bytes();
        points += cloud.points();
        let [low, high] =
            heights.map(|z| header.quantization.offset[2] + f64::from(z) * squares.scale);
        features.push(json!({
            "type": "Feature",
            "properties": {
                "file": file, "points": cloud.points(), "bytes": cloud.bytes(),
                "zmin": low, "zmax": high,
            },
            "geometry": { "type": "Polygon", "coordinates": [squares.outline(square)] },
        }));
        cloud.deliver()?;
    }
    if points != spill.points() {
        let lost = format!(
            "{points} of {} points have a tile; please report this",
            spill.points()
        );
        return Err(LasError::new(dir, lost));
    }
    let index = json!({
        "type": "FeatureCollection",
        "name": name,
        "wkt": header.crs.as_ref().and_then(Crs::wkt),
        "features": features,
    });
    let text = index.to_string();
    let path = dir.join(INDEX);
    std::fs::write(&path, &text)
        .map_err(|e| LasError::new(&path, format!("cannot be written: {e}")))?;
    Ok(bytes + text.len() as u64)
}

/// Whether all that is in the directory `dir` are tiles and their index: it may be
/// replaced then.
pub(super) fn holds_tiles(dir: &Path) -> bool {
    let name = dir.file_name().map(|name| name.to_string_lossy());
    let name = name.unwrap_or_default();
    let is_tile = |entry: std::ffi::OsString| {
        let entry = entry.to_string_lossy();
        let corner = entry
            .strip_prefix(&*name)
            .and_then(|e| e.strip_suffix(".laz"));
        entry == INDEX
            || corner.is_some_and(|corner| {
                corner.starts_with('_') && !corner.contains(|c: char| c.is_ascii_alphabetic())
            })
    };
    std::fs::read_dir(dir)
        .is_ok_and(|mut entries| entries.all(|e| e.is_ok_and(|e| is_tile(e.file_name()))))
}

/// Equal squares of the plane, on a lattice.
struct Squares {
    edge: f64,
    scale: f64,
    offset: [f64; 3],
}

impl Squares {
    /// The first stored coordinate that is not west or south of a side.
    fn side(&self, place: i64, axis: usize) -> i64 {
        let side = (place as f64 * self.edge - self.offset[axis]) / self.scale;
        // What rounding has put a hair above a whole number is on it.
        (side - 1e-6).ceil() as i64
    }

    fn rect(&self, square: [i64; 2]) -> Rect {
        Rect {
            min: [self.side(square[0], 0), self.side(square[1], 1)],
            max: [self.side(square[0] + 1, 0), self.side(square[1] + 1, 1)],
        }
    }

    /// The square of a stored coordinate.
    fn place(&self, c: i64, axis: usize) -> i64 {
        let world = self.offset[axis] + c as f64 * self.scale;
        let mut place = (world / self.edge).floor() as i64;
        // Rounding must not part it from its side.
        while c < self.side(place, axis) {
            place -= 1;
        }
        while c >= self.side(place + 1, axis) {
            place += 1;
        }
        place
    }

    /// The squares that may hold points, from south to north.
    fn occupied(&self, spill: &Spill) -> Vec<[i64; 2]> {
        let (grid, bounds) = (spill.grid(), spill.bounds());
        let mut found = BTreeSet::new();
        for (square, _) in spill.squares() {
            let rect = grid.rect_of_square(square);
            let range = |axis: usize| {
                let first = rect.min[axis].max(bounds.min[axis].into());
                let last = (rect.max[axis] - 1).min(bounds.max[axis].into());
                self.place(first, axis)..=self.place(last, axis)
            };
            for y in range(1) {
                found.extend(range(0).map(|x| (y, x)));
            }
        }
        found.into_iter().map(|(y, x)| [x, y]).collect()
    }

    fn outline(&self, [x, y]: [i64; 2]) -> [[f64; 2]; 5] {
        [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1), (x, y)]
            .map(|(x, y)| [x as f64 * self.edge, y as f64 * self.edge])
    }
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
    fn every_coordinate_has_one_square() {
        for (edge, scale, offset) in [
            (50.0, 0.001, 431_060.0),
            (0.1, 0.001, -3.0),
            (7.3, 0.0005, 12.25),
        ] {
            let squares = Squares {
                edge,
                scale,
                offset: [offset; 3],
            };
            for c in (-200_000..200_000).step_by(37).chain(-120..120) {
                let place = squares.place(c, 0);
                assert!(squares.side(place, 0) <= c && c < squares.side(place + 1, 0));
                let world = offset + c as f64 * scale;
                assert!((place as f64 * edge - world) < 1e-6 * scale.max(1e-3));
            }
        }
        assert_eq!(decimal(431_000.0), "431000");
        assert_eq!(decimal(-0.1 * 3.0), "-0.3");
    }
}
