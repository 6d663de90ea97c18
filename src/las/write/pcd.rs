//! PCD, the format of the Point Cloud Library: a text header, and points of single precision.
//!
//! Coordinates are those of the CRS less an origin, which the header states in a comment. Fields have the names that
//! the library's point types have: `x y z intensity rgb label normal_x normal_y normal_z curvature`.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

use super::{
    cloud::{CloudHeader, Workspace},
    lzf::LzfWriter,
    ordered_records::OrderedRecords,
    part_file::PartFile,
    pcd_fields::PcdField,
    pcd_options::PcdEncoding,
    store::{SortedRecords, StoreError},
    writer::{Amendments, CompleteCloud},
};
use crate::{
    geometry::{Quantization, Rect},
    las::{
        error::LasError,
        format::{crs::Crs, ply::crs_lines},
    },
    tiling::Bounds,
};

/// Bytes of a value; all fields have values of 32 bits.
const VALUE_BYTES: u64 = 4;
/// The letters of a number of points in a header, whatever the number.
const COUNT_LETTERS: usize = 10;

/// What all PCD files of a cloud have in common.
pub(super) struct PcdCloud {
    fields: Vec<PcdField>,
    encoding: PcdEncoding,
    /// The place that has the coordinates 0, 0, 0 (CRS units).
    pub(super) origin: [f64; 3],
    /// The quantization of the records, less the origin.
    local: Quantization,
    /// The largest value of a colour: some inputs have eight bits in the field of sixteen.
    brightest: u16,
    crs: Option<Crs>,
    /// The memory for columns that wait to be written, in bytes.
    column_bytes: u64,
}

impl PcdCloud {
    /// The files of a cloud with this `header` and points within `bounds`.
    pub(super) fn new(header: &CloudHeader, workspace: &Workspace<'_>, bounds: &Bounds) -> Self {
        let quantization = header.quantization;
        let corner = |stored: [i32; 3]| {
            [0, 1, 2].map(|axis| {
                quantization.offset[axis] + f64::from(stored[axis]) * quantization.scale
            })
        };
        let options = workspace.pcd;
        let origin = options.origin.of(corner(bounds.min), corner(bounds.max));
        Self {
            fields: PcdField::of_format(&header.record),
            encoding: options.encoding,
            origin,
            local: Quantization {
                scale: quantization.scale,
                offset: [0, 1, 2].map(|axis| quantization.offset[axis] - origin[axis]),
            },
            brightest: workspace.brightest,
            crs: header.crs.clone(),
            column_bytes: workspace.sort_bytes as u64,
        }
    }

    /// The header of a file, and the offsets of the two numbers of points in it.
    fn header(&self) -> (String, [u64; 2]) {
        let [x, y, z] = self.origin;
        let mut text = format!(
            "# .PCD v0.7 - Point Cloud Data file format\n# lloydar\n# origin {x} {y} {z}\n"
        );
        let wkt = self.crs.as_ref().and_then(Crs::wkt_in_one_line);
        text += &crs_lines("# ", &wkt.unwrap_or_default());
        let of_fields = |value: fn(&PcdField) -> &'static str| {
            let values = self.fields.iter().map(value);
            values.fold(String::new(), |line, value| line + " " + value)
        };
        text += "VERSION 0.7\n";
        text += &format!("FIELDS{}\n", of_fields(PcdField::name));
        text += &format!("SIZE{}\n", of_fields(|_| "4"));
        text += &format!("TYPE{}\n", of_fields(PcdField::kind));
        text += &format!("COUNT{}\n", of_fields(|_| "1"));
        text += "WIDTH ";
        let width = text.len() as u64;
        text += &padded_count(0);
        text += "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS ";
        let points = text.len() as u64;
        text += &padded_count(0);
        text += match self.encoding {
            PcdEncoding::Binary => "\nDATA binary\n",
            PcdEncoding::Compressed => "\nDATA binary_compressed\n",
        };
        (text, [width, points])
    }

    /// Writes the points of `cloud` in `rect` to `path`. `visit` sees every record.
    ///
    /// # Errors
    ///
    /// If the file cannot be written, or has more points than the format can count.
    pub(super) fn write_file(
        &self,
        path: &Path,
        cloud: &OrderedRecords<'_>,
        rect: &Rect,
        visit: &mut dyn FnMut(&[u8]),
    ) -> Result<CompleteCloud, LasError> {
        let (part, file) = PartFile::create_file(path)?;
        let (points, amendments) = self
            .write_to(file, cloud, rect, visit)
            .map_err(|e| LasError::unwritable(path, e))?;
        CompleteCloud::of_file(part, points, amendments)
    }

    /// Writes the points of `cloud` in `rect` to `file`. Returns their number, and what is to be overwritten.
    fn write_to(
        &self,
        file: File,
        cloud: &OrderedRecords<'_>,
        rect: &Rect,
        visit: &mut dyn FnMut(&[u8]),
    ) -> Result<(u64, Amendments), StoreError> {
        let mut file = BufWriter::with_capacity(1 << 20, file);
        let (header, counts) = self.header();
        file.write_all(header.as_bytes())?;
        let bytes_per_point = VALUE_BYTES * self.fields.len() as u64;
        let (points, sizes) = match self.encoding {
            PcdEncoding::Binary => (self.write_rows(&mut file, cloud, rect, visit)?, None),
            PcdEncoding::Compressed => {
                file.write_all(&[0; 8])?;
                let (points, compressed) = self.write_columns(&mut file, cloud, rect, visit)?;
                (points, Some([compressed, points * bytes_per_point]))
            }
        };
        file.flush()?;
        let most = u64::from(u32::MAX);
        if points > most || sizes.is_some_and(|sizes| sizes.iter().any(|&bytes| bytes > most)) {
            return Err(format!(
                "{points} points of {bytes_per_point} bytes are more than the format can count; write tiles \
                 (--output-tiles), or a coarser cloud"
            )
            .into());
        }
        let mut amendments = counts
            .map(|at| (at, padded_count(points).into_bytes()))
            .to_vec();
        if let Some(sizes) = sizes {
            let bytes = sizes.iter().flat_map(|&bytes| (bytes as u32).to_le_bytes());
            amendments.push((header.len() as u64, bytes.collect()));
        }
        Ok((points, amendments))
    }

    /// Writes point by point, and returns the number of points.
    fn write_rows(
        &self,
        file: &mut impl Write,
        cloud: &OrderedRecords<'_>,
        rect: &Rect,
        visit: &mut dyn FnMut(&[u8]),
    ) -> Result<u64, StoreError> {
        let mut points = 0;
        cloud.visit(rect, &mut |record| {
            visit(record);
            points += 1;
            for field in &self.fields {
                file.write_all(&field.value(record, &self.local, self.brightest))?;
            }
            Ok(())
        })?;
        Ok(points)
    }

    /// Writes field by field, compressed, and returns the numbers of points and of bytes. The first field of each pass
    /// over the points is written as it comes, others wait in memory.
    fn write_columns(
        &self,
        file: &mut impl Write,
        cloud: &OrderedRecords<'_>,
        rect: &Rect,
        visit: &mut dyn FnMut(&[u8]),
    ) -> Result<(u64, u64), StoreError> {
        let column = VALUE_BYTES * cloud.most_points_in(rect).max(1);
        let waiting = (self.column_bytes / column).min(self.fields.len() as u64) as usize;
        let mut points = 0;
        let mut compressed = LzfWriter::new(file);
        for (pass, fields) in self.fields.chunks(1 + waiting).enumerate() {
            let mut columns = vec![Vec::new(); fields.len() - 1];
            cloud.visit(rect, &mut |record| {
                if pass == 0 {
                    visit(record);
                    points += 1;
                }
                let value = |field: &PcdField| field.value(record, &self.local, self.brightest);
                compressed.push(&value(&fields[0]))?;
                for (column, field) in columns.iter_mut().zip(&fields[1..]) {
                    column.extend(value(field));
                }
                Ok(())
            })?;
            for column in columns {
                compressed.push(&column)?;
            }
        }
        Ok((points, compressed.finish()?))
    }
}

/// The number of points as the header has it.
fn padded_count(points: u64) -> String {
    format!("{points:<COUNT_LETTERS$}")
}

/// Writes the points of `sorted` as a PCD file that is to become `path`.
///
/// # Errors
///
/// If the file cannot be written, or temporary files cannot be read.
pub(super) fn write_pcd(
    path: &Path,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    progress: &dyn Fn(u64),
) -> Result<CompleteCloud, LasError> {
    let bounds = sorted.bounds();
    let pcd = PcdCloud::new(header, workspace, &bounds);
    let ordered = OrderedRecords::new(sorted, header.record.record_length(), workspace.sort_bytes);
    let cloud = pcd.write_file(path, &ordered, &whole(&bounds), &mut |_| {})?;
    progress(cloud.points());
    Ok(cloud)
}

/// The rectangle of all points within `bounds`.
fn whole(bounds: &Bounds) -> Rect {
    Rect {
        min: [0, 1].map(|axis| bounds.min[axis].into()),
        max: [0, 1].map(|axis| i64::from(bounds.max[axis]) + 1),
    }
}
