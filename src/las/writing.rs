//! From records to a file, complete under its name or not there at all.
//!
//! LAS, LAZ and COPC are version 1.4 with the run's format; PLY is binary, little
//! endian, with the attributes that its readers know.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use ::las::{
    Builder, GpsTimeType, PointDataBuilder, Transform, Vector, Version, Vlr, Writer,
    point::Format as PointFormat,
};

use super::{
    Crs, LasError, RecordFormat,
    copc::{first_records, write_octree},
    ply_writing::Vertices,
    tiled::{holds_tiles, write_tiles},
};
use crate::{
    geometry::{Quantization, Stored},
    tile::{CellGrid, SpillWriter},
};

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// Uncompressed LAS.
    Las,
    /// Compressed LAS.
    Laz,
    /// Compressed LAS as an octree, for viewers to read from afar.
    Copc,
    /// Polygon file format, points only.
    Ply,
    /// A directory of tiles, each LAZ.
    Tiles,
}

impl Format {
    /// The format that the ending of `path` asks for.
    ///
    /// # Errors
    ///
    /// If it asks for none that can be written.
    pub(crate) fn of_path(path: &Path) -> Result<Self, LasError> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        if name.ends_with(".copc.laz") {
            return Ok(Self::Copc);
        }
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(e) if e == "las" => Ok(Self::Las),
            Some(e) if e == "laz" => Ok(Self::Laz),
            Some(e) if e == "ply" => Ok(Self::Ply),
            _ => Err(LasError::new(
                path,
                "name the output .copc.laz, .laz, .las or .ply",
            )),
        }
    }

    /// Refuses to replace a directory, but one that holds nothing but tiles by tiles.
    ///
    /// # Errors
    ///
    /// If such a one is at `path`.
    pub(crate) fn check_replaceable(self, path: &Path) -> Result<(), LasError> {
        match path.is_dir() && !(self == Self::Tiles && holds_tiles(path)) {
            true => Err(LasError::new(
                path,
                "is a directory that holds other things than tiles; give another name",
            )),
            false => Ok(()),
        }
    }
}

/// What a writer that has to sort its points goes by.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    /// How far points are apart, about (CRS units).
    pub(crate) spacing: f64,
    /// Edge of the tiles, if they are asked for (CRS units).
    pub(crate) tile_edge: f64,
    /// Path of temporary files, without their endings.
    pub(crate) stem: PathBuf,
    /// Memory for buffers while points come in, in bytes.
    pub(crate) buffer_bytes: usize,
    /// Memory for what is sorted, in bytes.
    pub(crate) sort_bytes: usize,
}

/// What the header of an output says.
#[derive(Clone, Debug)]
pub(crate) struct CloudHeader {
    /// Format of the records.
    pub(crate) record: RecordFormat,
    /// Scale and offset.
    pub(crate) quantization: Quantization,
    /// Coordinate reference system.
    pub(crate) crs: Option<Crs>,
    /// Variable length records of the inputs that are as true of it.
    pub(crate) kept_records: Vec<Vlr>,
    /// Whether GPS times are adjusted standard times.
    pub(crate) has_standard_time: bool,
    /// How the cloud was made, as JSON.
    pub(crate) provenance: String,
}

/// A cloud that is being written.
#[allow(missing_debug_implementations, reason = "the writer inside has none")]
pub(crate) struct CloudWriter {
    path: PathBuf,
    part: PathBuf,
    body: Body,
    failure: Failure,
    points: u64,
    finished: bool,
}

enum Body {
    Las {
        writer: Box<Writer<Sink>>,
        format: PointFormat,
        transforms: Vector<Transform>,
        quantization: Quantization,
        /// Least and greatest coordinates so far.
        bounds: [[i32; 3]; 2],
    },
    Ply {
        sink: Sink,
        vertices: Vertices,
        record_length: usize,
        count_at: u64,
    },
    Sorted(Box<Sorted>),
    /// Nothing any more: its file is complete.
    Complete,
}

/// Points that are sorted by place first, for an octree or tiles.
struct Sorted {
    /// The octree's; tiles are files of their own.
    file: Option<File>,
    header: CloudHeader,
    workspace: Workspace,
    spill: SpillWriter,
}

/// Where the LAS 1.4 header keeps the counts of older readers: the number of
/// points and of points by return, which formats 6 and up must leave zero.
const LEGACY_COUNTS: (u64, usize) = (107, 24);
/// Where it keeps the bounds: most and least x, y, z.
const BOUNDS: u64 = 179;
/// Where it says where extended records begin, how many there are, how many points, and
/// how many by return.
const EXTENDED: u64 = 235;
/// Edge of the cells by which points are sorted first, in spacings.
const SORTED_CELL: f64 = 512.0;

impl CloudWriter {
    /// Begins the cloud at `path`, under another name in the same directory.
    ///
    /// # Errors
    ///
    /// If no file can be made there.
    pub(crate) fn create(
        path: &Path,
        format: Format,
        header: &CloudHeader,
        workspace: &Workspace,
    ) -> Result<Self, LasError> {
        let wrong =
            |e: &dyn std::fmt::Display| LasError::new(path, format!("cannot be written: {e}"));
        let mut name = std::ffi::OsString::from(".");
        name.push(path.file_name().ok_or_else(|| wrong(&"it has no name"))?);
        name.push(".part");
        let part = path.with_file_name(name);
        format.check_replaceable(path)?;
        let file = match format {
            Format::Tiles => {
                drop(std::fs::remove_dir_all(&part));
                std::fs::create_dir(&part).map_err(|e| wrong(&e))?;
                None
            }
            _ => Some(File::create(&part).map_err(|e| wrong(&e))?),
        };
        let failure = Failure::default();
        let sink = |file| Sink {
            file: BufWriter::with_capacity(1 << 20, file),
            failure: failure.clone(),
        };
        let body = match (format, file) {
            (Format::Ply, Some(file)) => {
                let mut sink = sink(file);
                let vertices = Vertices::new(header);
                let (text, count_at) = vertices.header(header);
                sink.write_all(text.as_bytes()).map_err(|e| wrong(&e))?;
                Body::Ply {
                    sink,
                    vertices,
                    record_length: header.record.record_length(),
                    count_at,
                }
            }
            (Format::Las | Format::Laz, Some(file)) => {
                let las = las_header(header, format).map_err(|e| wrong(&e))?;
                let (format, transforms) = (*las.point_format(), *las.transforms());
                Body::Las {
                    writer: Box::new(Writer::new(sink(file), las).map_err(|e| wrong(&e))?),
                    format,
                    transforms,
                    quantization: header.quantization,
                    bounds: [[i32::MAX; 3], [i32::MIN; 3]],
                }
            }
            (_, file) => Body::Sorted(Box::new(Sorted {
                file,
                header: header.clone(),
                workspace: workspace.clone(),
                spill: SpillWriter::create(
                    &workspace.stem,
                    CellGrid::new(header.quantization.units(SORTED_CELL * workspace.spacing)),
                    header.record.record_length(),
                    workspace.buffer_bytes,
                )
                .map_err(|e| wrong(&e))?,
            })),
        };
        let writer = Self {
            path: path.to_owned(),
            part,
            body,
            failure,
            points: 0,
            finished: false,
        };
        writer.check()?;
        Ok(writer)
    }

    /// Appends `records`, in the run's format.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    pub(crate) fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        match &mut self.body {
            Body::Las {
                writer,
                format,
                transforms,
                bounds,
                ..
            } => {
                for record in records.chunks_exact(format.len().into()) {
                    let point = Stored::of_record(record);
                    for (axis, c) in [point.x, point.y, point.z].into_iter().enumerate() {
                        bounds[0][axis] = bounds[0][axis].min(c);
                        bounds[1][axis] = bounds[1][axis].max(c);
                    }
                }
                let batch = PointDataBuilder::new()
                    .with_format(*format)
                    .with_transforms(*transforms)
                    .build_from_bytes(records.to_vec())
                    .and_then(|batch| {
                        self.points += batch.len() as u64;
                        writer.write_points(&batch)
                    });
                batch.map_err(|e| LasError::new(&self.path, format!("cannot be written: {e}")))?;
            }
            Body::Ply {
                sink,
                vertices,
                record_length,
                ..
            } => {
                let mut out = Vec::new();
                for record in records.chunks_exact(*record_length) {
                    vertices.append(record, &mut out);
                    self.points += 1;
                }
                sink.write_all(&out)
                    .map_err(|e| LasError::new(&self.path, format!("cannot be written: {e}")))?;
            }
            Body::Sorted(sorted) => {
                let Sorted { spill, header, .. } = &mut **sorted;
                spill
                    .push(records)
                    .map_err(|e| LasError::new(&self.path, format!("cannot be written: {e}")))?;
                self.points += (records.len() / header.record.record_length()) as u64;
            }
            Body::Complete => {}
        }
        self.check()
    }

    /// Points written so far.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// Completes the file, but for its name. `progress` hears of how many points have
    /// found their place in the octree, if it is one.
    ///
    /// # Errors
    ///
    /// If it cannot be completed; nothing is left of it then.
    pub(crate) fn complete(mut self, progress: &dyn Fn(u64)) -> Result<CompleteCloud, LasError> {
        let path = self.path.clone();
        let wrong =
            |e: &dyn std::fmt::Display| LasError::new(&path, format!("cannot be written: {e}"));
        let points = self.points;
        // What the header is to say in the end.
        let mut amendments: Vec<(u64, Vec<u8>)> = Vec::new();
        match std::mem::replace(&mut self.body, Body::Complete) {
            Body::Las {
                mut writer,
                quantization,
                bounds,
                ..
            } => {
                writer.close().map_err(|e| wrong(&e))?;
                // `close` leaves the last bytes in the buffer of the sink, which
                // goes to the file when the writer is dropped.
                drop(writer);
                amendments.push((LEGACY_COUNTS.0, vec![0; LEGACY_COUNTS.1]));
                amendments.push((BOUNDS, header_bounds(&quantization, &bounds, points)));
            }
            Body::Ply {
                mut sink, count_at, ..
            } => {
                amendments.push((count_at, format!("{points:<20}").into_bytes()));
                sink.flush().map_err(|e| wrong(&e))?;
            }
            Body::Sorted(sorted) => {
                let Sorted {
                    file,
                    header,
                    workspace,
                    spill,
                } = *sorted;
                let spill = spill.finish().map_err(|e| wrong(&e))?;
                let Some(file) = file else {
                    let name = path.file_name().map(|name| name.to_string_lossy());
                    let name = name.unwrap_or_default();
                    let bytes =
                        write_tiles(&self.part, &name, &spill, &header, &workspace, progress)?;
                    spill.remove();
                    return Ok(self.completed(bytes));
                };
                let las = las_header(&header, Format::Copc).map_err(|e| wrong(&e))?;
                let mut file = BufWriter::with_capacity(1 << 20, file);
                las.write_to(&mut file).map_err(|e| wrong(&e))?;
                let (mut file, table_at) = write_octree(
                    &spill,
                    &header.quantization,
                    header.quantization.units(workspace.spacing),
                    &header.record,
                    workspace.sort_bytes,
                    file,
                    progress,
                )
                .map_err(|e| wrong(&e))?;
                file.flush().map_err(|e| wrong(&e))?;
                let bounds = spill.bounds();
                let bounds = [bounds.min, bounds.max];
                amendments.push((BOUNDS, header_bounds(&header.quantization, &bounds, points)));
                // One extended record; all points are first returns.
                let mut counts = table_at.to_le_bytes().to_vec();
                counts.extend(1_u32.to_le_bytes());
                counts.extend(points.to_le_bytes());
                counts.extend(points.to_le_bytes());
                amendments.push((EXTENDED, counts));
                spill.remove();
            }
            Body::Complete => {}
        }
        self.check()?;
        let file = File::options().write(true).open(&self.part);
        let complete = file.and_then(|mut file| {
            for (at, bytes) in amendments {
                file.seek(SeekFrom::Start(at))?;
                file.write_all(&bytes)?;
            }
            file.sync_all()?;
            Ok(file.metadata()?.len())
        });
        let bytes = complete.map_err(|e: io::Error| wrong(&e))?;
        Ok(self.completed(bytes))
    }

    fn completed(mut self, bytes: u64) -> CompleteCloud {
        self.finished = true;
        CompleteCloud {
            path: self.path.clone(),
            part: self.part.clone(),
            points: self.points,
            bytes,
            delivered: false,
        }
    }

    fn check(&self) -> Result<(), LasError> {
        match self.failure.take() {
            Some(error) => Err(LasError::new(
                &self.path,
                format!("cannot be written: {error}; nothing is left under that name"),
            )),
            None => Ok(()),
        }
    }
}

impl Drop for CloudWriter {
    fn drop(&mut self) {
        if !self.finished {
            // Not to be completed on the way out: it would be thrown away.
            self.failure.stop();
            remove(&self.part);
        }
    }
}

/// A cloud on the disk, under another name; removed unless it is delivered.
#[derive(Debug)]
pub(crate) struct CompleteCloud {
    path: PathBuf,
    part: PathBuf,
    points: u64,
    bytes: u64,
    delivered: bool,
}

impl CompleteCloud {
    /// Where it is until then.
    pub(crate) fn part(&self) -> &Path {
        &self.part
    }

    /// Points in it.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// Its length.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Gives it its name.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed; nothing is left of it then.
    pub(crate) fn deliver(mut self) -> Result<(), LasError> {
        let wrong = |e| LasError::new(&self.path, format!("cannot be written: {e}"));
        if self.part.is_dir() && self.path.is_dir() {
            // A directory does not replace another one that is not empty.
            let old = self.part.with_extension("old");
            remove(&old);
            std::fs::rename(&self.path, &old).map_err(wrong)?;
            std::fs::rename(&self.part, &self.path).map_err(wrong)?;
            remove(&old);
        } else {
            std::fs::rename(&self.part, &self.path).map_err(wrong)?;
        }
        self.delivered = true;
        // Of the name, too: where a directory cannot be flushed, the system does so.
        if let Some(dir) = self.path.parent()
            && let Ok(dir) = File::open(dir)
        {
            drop(dir.sync_all());
        }
        Ok(())
    }
}

impl Drop for CompleteCloud {
    fn drop(&mut self) {
        if !self.delivered {
            remove(&self.part);
        }
    }
}

/// Removes a file, or a directory with all that is in it.
fn remove(path: &Path) {
    if std::fs::remove_file(path).is_err() {
        drop(std::fs::remove_dir_all(path));
    }
}

/// The bounds of `points` points as the header has them: those of the
/// coordinates as every reader computes them, where the writer's own are a unit
/// wider now and then.
fn header_bounds(quantization: &Quantization, bounds: &[[i32; 3]; 2], points: u64) -> Vec<u8> {
    let [min, max] = bounds.map(|[x, y, z]| quantization.world(Stored { x, y, z }));
    (0..3)
        .flat_map(|axis| [max[axis], min[axis]])
        .flat_map(|c| if points == 0 { 0.0_f64 } else { c }.to_le_bytes())
        .collect()
}

fn las_header(header: &CloudHeader, written: Format) -> ::las::Result<::las::Header> {
    let mut builder = Builder::from(Version::new(1, 4));
    let mut format = PointFormat::new(header.record.point_format)?;
    format.is_compressed = written != Format::Las;
    format.extra_bytes = u16::try_from(header.record.extra_length())?;
    builder.point_format = format;
    builder.system_identifier = "MODIFICATION".to_owned();
    builder.generating_software = concat!("lloydar ", env!("CARGO_PKG_VERSION")).to_owned();
    builder.date = creation_date();
    builder.gps_time_type = if header.has_standard_time {
        GpsTimeType::Standard
    } else {
        GpsTimeType::Week
    };
    let transform = |axis: usize| Transform {
        scale: header.quantization.scale,
        offset: header.quantization.offset[axis],
    };
    builder.transforms = Vector {
        x: transform(0),
        y: transform(1),
        z: transform(2),
    };
    builder.has_wkt_crs = true;
    if written == Format::Copc {
        builder.vlrs = first_records(header.record.point_format, format.extra_bytes)?.into();
    }
    builder
        .vlrs
        .extend(header.crs.as_ref().map(Crs::vlrs).unwrap_or_default());
    let descriptors: Vec<u8> = header
        .record
        .extra_bytes
        .iter()
        .flat_map(|extra| extra.descriptor.clone())
        .collect();
    if !descriptors.is_empty() {
        builder.vlrs.push(Vlr {
            user_id: "LASF_Spec".to_owned(),
            record_id: 4,
            description: "Extra Bytes".to_owned(),
            data: descriptors,
        });
    }
    builder.vlrs.extend(header.kept_records.iter().cloned());
    builder.vlrs.push(Vlr {
        user_id: "lloydar".to_owned(),
        record_id: 1,
        description: "how this cloud was made".to_owned(),
        // Longer than a record can be is cut: it is for people to read.
        data: header.provenance.bytes().take(u16::MAX.into()).collect(),
    });
    builder.into_header()
}

/// The day of `SOURCE_DATE_EPOCH`, for reproducible files, else today.
fn creation_date() -> Option<chrono::NaiveDate> {
    let fixed = std::env::var("SOURCE_DATE_EPOCH")
        .ok()
        .and_then(|text| text.trim().parse().ok())
        .and_then(|seconds| chrono::DateTime::from_timestamp(seconds, 0));
    Some(fixed.unwrap_or_else(chrono::Utc::now).date_naive())
}

/// The first failure of a sink, which its owner asks for.
#[derive(Clone, Default)]
struct Failure(Arc<Mutex<FailureState>>);

#[derive(Default)]
struct FailureState {
    first: Option<io::Error>,
    stopped: bool,
}

impl Failure {
    fn with<T>(&self, f: impl FnOnce(&mut FailureState) -> T) -> T {
        f(&mut self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner))
    }
    fn take(&self) -> Option<io::Error> {
        self.with(|state| state.first.take())
    }
    fn stop(&self) {
        self.with(|state| state.stopped = true);
    }
    fn record(&self, error: io::Error) {
        self.with(|state| {
            state.stopped = true;
            state.first.get_or_insert(error);
        });
    }
}

/// A file that, once it has failed, takes everything and keeps nothing.
///
/// The writer of `las` completes its file when it is dropped, and panics if
/// that fails: on a full disk it would. So it is never told; the owner asks
/// after every batch.
struct Sink {
    file: BufWriter<File>,
    failure: Failure,
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.failure.with(|state| state.stopped)
            && let Err(error) = self.file.write_all(bytes)
        {
            self.failure.record(error);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.failure.with(|state| state.stopped)
            && let Err(error) = self.file.flush()
        {
            self.failure.record(error);
        }
        Ok(())
    }
}

impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        if !self.failure.with(|state| state.stopped) {
            match self.file.seek(to) {
                Ok(at) => return Ok(at),
                Err(error) => self.failure.record(error),
            }
        }
        Ok(0)
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        drop(self.flush());
    }
}
