//! E57 files (ASTM E2807): scans of several stations in one.
//!
//! The reader lends its points, and cannot be kept with them in one value; so it runs in a
//! thread of its own, and sends them.

use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, SyncSender, sync_channel},
};

use e57::{CartesianCoordinate, E57Reader, Point};

use crate::las::{
    error::LasError,
    format::{crs::Crs, ply::Scalar, vertex_layout::VertexLayout},
};

/// An E57 file whose header was read.
#[derive(Clone, Debug)]
pub(super) struct E57File {
    path: PathBuf,
    crs: Option<Crs>,
    has_color: bool,
    /// The positions of the poses of its scans: where their scanners stood, if they mean that.
    stations: Vec<[f64; 3]>,
}

/// The number of points in a message of the reading thread.
const POINTS_PER_MESSAGE: usize = 4096;
/// The number of messages that wait before the reading thread does.
const WAITING_MESSAGES: usize = 2;

impl E57File {
    /// Reads the header of the file at `path`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    pub(super) fn survey(path: &Path) -> Result<Self, LasError> {
        let reader = E57Reader::from_file(path).map_err(|e| LasError::unreadable(path, e))?;
        let metadata = reader.coordinate_metadata().map(str::trim);
        let scans = reader.pointclouds();
        let poses = scans.iter().filter_map(|scan| scan.transform.as_ref());
        let place = |pose: &e57::Transform| {
            let e57::Translation { x, y, z } = pose.translation;
            [x, y, z]
        };
        Ok(Self {
            path: path.to_owned(),
            // Metadata that are no well-known text are for people.
            crs: metadata
                .filter(|text| text.contains('[') && !text.contains(char::is_control))
                .map(|text| Crs::Wkt(text.to_owned())),
            has_color: scans.iter().any(e57::PointCloud::has_color),
            stations: poses.map(place).collect(),
        })
    }

    /// The places where the scanners stood, if the poses of the scans say so: a scanner stands amid its points, which
    /// lie within `bounds`. A pose elsewhere moves points to their place in the world, and none is believed then.
    pub(super) fn stations(&self, bounds: &[[f64; 3]; 2]) -> &[[f64; 3]] {
        let [min, max] = bounds;
        let is_amid = |place: &[f64; 3]| (0..3).all(|k| min[k] <= place[k] && place[k] <= max[k]);
        match self.stations.iter().all(is_amid) {
            true => &self.stations,
            false => &[],
        }
    }

    /// The coordinate reference system, if it is stated as well-known text.
    pub(super) fn crs(&self) -> Option<Crs> {
        self.crs.clone()
    }

    /// The layout of the records that points become.
    pub(super) fn layout(&self) -> VertexLayout {
        let mut properties = Vec::new();
        let mut add = |name: &str, kind| properties.push((name.to_owned(), kind));
        for name in ["x", "y", "z"] {
            add(name, Scalar::Float(8));
        }
        add("intensity", Scalar::Uint(2));
        if self.has_color {
            for name in ["red", "green", "blue"] {
                add(name, Scalar::Float(4));
            }
        }
        VertexLayout::of(&properties)
    }

    /// The points from the first on; their values are in the order of [`layout`](Self::layout).
    pub(super) fn open(&self) -> E57Stream {
        let (sender, receiver) = sync_channel(WAITING_MESSAGES);
        let file = self.clone();
        std::thread::spawn(move || {
            // It is no error if the stream is gone, and no more points are wanted.
            if let Err(error) = file.send(&sender) {
                drop(sender.send(Err(error)));
            }
        });
        E57Stream {
            receiver,
            batch: Vec::new().into_iter(),
        }
    }

    /// Sends all points to `sender`, until it is closed.
    fn send(&self, sender: &SyncSender<Result<Vec<Values>, String>>) -> Result<(), String> {
        let broken = |e: e57::Error| format!("is damaged: {e}");
        let mut reader = E57Reader::from_file(&self.path).map_err(broken)?;
        let mut batch = Vec::with_capacity(POINTS_PER_MESSAGE);
        for cloud in reader.pointclouds() {
            for point in reader.pointcloud_simple(&cloud).map_err(broken)? {
                batch.extend(values(&point.map_err(broken)?));
                if batch.len() == POINTS_PER_MESSAGE
                    && sender.send(Ok(std::mem::take(&mut batch))).is_err()
                {
                    return Ok(());
                }
            }
        }
        drop(sender.send(Ok(batch)));
        Ok(())
    }
}

/// The values of a point: x, y, z, intensity (0 to 65 535), red, green, blue (0 to 1).
type Values = [f64; 7];

/// The values of `point`; `None` if it is only a direction in which nothing was hit.
fn values(point: &Point) -> Option<Values> {
    let CartesianCoordinate::Valid { x, y, z } = point.cartesian else {
        return None;
    };
    let [red, green, blue] = point
        .color
        .as_ref()
        .map_or([0.0; 3], |c| [c.red, c.green, c.blue].map(f64::from));
    // Intensities from 0 to 1 become sixteen bits, as LAS has them.
    let intensity = f64::from(point.intensity.unwrap_or(0.0)) * 65_535.0;
    Some([x, y, z, intensity, red, green, blue])
}

/// The points of an E57 file, one after the other.
pub(super) struct E57Stream {
    receiver: Receiver<Result<Vec<Values>, String>>,
    batch: std::vec::IntoIter<Values>,
}

impl Iterator for E57Stream {
    type Item = Result<Values, String>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(values) = self.batch.next() {
                return Some(Ok(values));
            }
            match self.receiver.recv().ok()? {
                Ok(batch) => self.batch = batch.into_iter(),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use e57::{E57Writer, Record, RecordValue, Transform, Translation};

    use super::*;
    use crate::las::read::input::InputFile;

    #[test]
    fn points_are_read_and_directions_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scan.e57");
        let mut writer = E57Writer::from_file(&path, "file").unwrap();
        let prototype = vec![
            Record::CARTESIAN_X_F64,
            Record::CARTESIAN_Y_F64,
            Record::CARTESIAN_Z_F64,
            Record::CARTESIAN_INVALID_STATE,
            Record::COLOR_RED_U8,
            Record::COLOR_GREEN_U8,
            Record::COLOR_BLUE_U8,
        ];
        let mut cloud = writer.add_pointcloud("cloud", prototype).unwrap();
        for i in 0..10_000_i64 {
            let c = i as f64 * 0.25;
            cloud
                .add_point(vec![
                    RecordValue::Double(c),
                    RecordValue::Double(-c),
                    RecordValue::Double(1e6),
                    RecordValue::Integer(if i % 5 == 0 { 2 } else { 0 }),
                    RecordValue::Integer(255),
                    RecordValue::Integer(i % 256),
                    RecordValue::Integer(0),
                ])
                .unwrap();
        }
        cloud.finalize().unwrap();
        writer.finalize().unwrap();
        let input = InputFile::survey(&path).unwrap();
        assert_eq!((input.kind(), input.points_claimed), ("E57", 8000));
        assert_eq!(input.bounds, [[0.25, -2499.75, 1e6], [2499.75, -0.25, 1e6]]);
        assert!(input.format().has_color);
        let file = E57File::survey(&path).unwrap();
        let first = file.open().next().unwrap().unwrap();
        assert_eq!(first[..4], [0.25, -0.25, 1e6, 0.0]);
        assert_eq!(first[4], 1.0);
        assert!((first[5] - 1.0 / 255.0).abs() < 1e-6);
    }

    #[test]
    fn scanners_stand_where_poses_amid_the_points_say() {
        let dir = tempfile::tempdir().unwrap();
        let stations = |name: &str, places: &[[f64; 3]], points: [f64; 2]| {
            let path = dir.path().join(name);
            let mut writer = E57Writer::from_file(&path, "file").unwrap();
            for &[x, y, z] in places {
                let prototype = vec![
                    Record::CARTESIAN_X_F64,
                    Record::CARTESIAN_Y_F64,
                    Record::CARTESIAN_Z_F64,
                ];
                let mut cloud = writer.add_pointcloud(name, prototype).unwrap();
                cloud.set_transform(Some(Transform {
                    translation: Translation { x, y, z },
                    ..Transform::default()
                }));
                for c in points {
                    cloud.add_point(vec![RecordValue::Double(c); 3]).unwrap();
                }
                cloud.finalize().unwrap();
            }
            writer.finalize().unwrap();
            InputFile::survey(&path).unwrap().stations().to_vec()
        };
        let amid = [[0.0, 0.0, 1.0], [4.0, 3.0, 1.0]];
        assert_eq!(stations("amid.e57", &amid, [-5.0, 5.0]), amid);
        assert!(stations("moved.e57", &[[4e5, 5e6, 100.0]], [20.0, 90.0]).is_empty());
    }

    #[test]
    fn a_truncated_file_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scan.e57");
        std::fs::write(&path, b"ASTM-E57 and no more").unwrap();
        let error = InputFile::survey(&path).unwrap_err().to_string();
        assert!(error.contains("scan.e57"), "{error}");
    }
}
