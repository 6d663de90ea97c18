//! LAS and LAZ: points are written in the order in which they are given.

use std::path::{Path, PathBuf};

use ::las::{PointDataBuilder, Transform, Vector, Writer, point::Format as PointFormat};

use super::{
    cloud::CloudHeader,
    las_header::{PointEncoding, las_header},
    part_file::PartFile,
    sink::Sink,
    writer::{Amendments, CloudBody, CloudWriter},
};
use crate::{
    geometry::Quantization,
    las::{
        error::LasError,
        format::{
            fields::coordinates,
            header::{BOUNDS_START, LEGACY_COUNTS, header_bounds},
        },
    },
};

/// The points of a LAS or LAZ file.
struct LasBody {
    /// The path of the output, for errors.
    path: PathBuf,
    writer: Writer<Sink>,
    format: PointFormat,
    transforms: Vector<Transform>,
    quantization: Quantization,
    /// The least and the greatest coordinates so far, in stored units.
    bounds: [[i32; 3]; 2],
}

/// Begins a LAS or LAZ file at `path`.
///
/// # Errors
///
/// If no file can be made there.
pub(super) fn create_las(
    path: &Path,
    header: &CloudHeader,
    encoding: PointEncoding,
) -> Result<CloudWriter, LasError> {
    let (part, file) = PartFile::create_file(path)?;
    let (sink, monitor) = Sink::new(file);
    let las = las_header(header, encoding).map_err(|e| LasError::unwritable(path, e))?;
    let (format, transforms) = (*las.point_format(), *las.transforms());
    let body = LasBody {
        path: path.to_owned(),
        writer: Writer::new(sink, las).map_err(|e| LasError::unwritable(path, e))?,
        format,
        transforms,
        quantization: header.quantization,
        bounds: [[i32::MAX; 3], [i32::MIN; 3]],
    };
    CloudWriter::new(part, monitor, Box::new(body), format.len().into())
}

impl CloudBody for LasBody {
    fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        let [min, max] = &mut self.bounds;
        for record in records.chunks_exact(self.format.len().into()) {
            for (axis, c) in coordinates(record).into_iter().enumerate() {
                min[axis] = min[axis].min(c);
                max[axis] = max[axis].max(c);
            }
        }
        PointDataBuilder::new()
            .with_format(self.format)
            .with_transforms(self.transforms)
            .build_from_bytes(records.to_vec())
            .and_then(|batch| self.writer.write_points(&batch))
            .map_err(|e| LasError::unwritable(&self.path, e))
    }

    fn complete(self: Box<Self>, points: u64) -> Result<Amendments, LasError> {
        let Self {
            path,
            mut writer,
            quantization,
            bounds,
            ..
        } = *self;
        writer.close().map_err(|e| LasError::unwritable(&path, e))?;
        // `close` leaves the last bytes in the buffer of the sink, which is written when the
        // writer is dropped.
        drop(writer);
        let no_counts = vec![0; (LEGACY_COUNTS.end - LEGACY_COUNTS.start) as usize];
        let amendments = vec![
            (LEGACY_COUNTS.start, no_counts),
            (BOUNDS_START, header_bounds(&quantization, &bounds, points)),
        ];
        Ok(amendments)
    }
}
