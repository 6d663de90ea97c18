//! PLY: binary, little endian, points only.
//!
//! The returns are left out; all other attributes have the names that our own reader knows, and
//! colours and normals those that programs for meshes know. Extra bytes have their own names, and
//! comments with what LAS says of them.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use super::{
    cloud::CloudHeader,
    part_file::PartFile,
    sink::Sink,
    writer::{Amendments, CloudBody, CloudWriter},
};
use crate::{
    geometry::{Quantization, Stored},
    las::{
        error::LasError,
        format::{
            fields::COLOR,
            ply::{
                ColorDepth, EXTRA_BYTES_COMMENT, STANDARD_TIME_COMMENT, descriptor_digits,
                first_lines,
            },
            vertex_properties::VertexProperty,
        },
    },
};

/// The vertices of a polygon file.
struct PlyBody {
    /// The path of the output, for errors.
    path: PathBuf,
    sink: Sink,
    quantization: Quantization,
    properties: Vec<VertexProperty>,
    record_length: usize,
    /// The offset of the number of vertices in the header, in bytes.
    count_offset: u64,
    /// The offset of the names of the colours in the header, in bytes; `None` without colours.
    color_offset: Option<u64>,
    /// Whether a colour greater than 255 was written.
    is_deep: bool,
}

/// Begins a polygon file at `path`.
///
/// # Errors
///
/// If no file can be made there.
pub(super) fn create_ply(path: &Path, header: &CloudHeader) -> Result<CloudWriter, LasError> {
    let (part, file) = PartFile::create_file(path)?;
    let (mut sink, monitor) = Sink::new(file);
    let properties = VertexProperty::of_format(&header.record);
    let (text, count_offset, color_offset) = ply_header(header, &properties);
    sink.write_all(text.as_bytes())
        .map_err(|e| LasError::unwritable(path, e))?;
    let record_length = header.record.record_length();
    let body = PlyBody {
        path: path.to_owned(),
        sink,
        quantization: header.quantization,
        properties,
        record_length,
        count_offset,
        color_offset,
        is_deep: false,
    };
    CloudWriter::new(part, monitor, Box::new(body), record_length)
}

/// The number of vertices as the header has it: always twenty letters long.
fn padded_count(points: u64) -> String {
    format!("{points:<20}")
}

/// The header of the file, and in it the offsets of the number of vertices and of the names of
/// the colours, if there are any.
fn ply_header(header: &CloudHeader, properties: &[VertexProperty]) -> (String, u64, Option<u64>) {
    let mut text = first_lines(header.crs.as_ref());
    if header.has_standard_time {
        text += &format!("comment {STANDARD_TIME_COMMENT}\n");
    }
    for extra in &header.record.extra_bytes {
        if extra.is_described() {
            let digits = descriptor_digits(extra);
            text += &format!("comment {EXTRA_BYTES_COMMENT}{digits}\n");
        }
    }
    text += "element vertex ";
    let count_offset = text.len() as u64;
    text += &padded_count(0);
    text += "\nproperty double x\nproperty double y\nproperty double z\n";
    let has_color = header.record.has_color();
    let color_offset = has_color.then_some(text.len() as u64);
    let mut color_properties = 0;
    if has_color {
        text += &ColorDepth::Sixteen.header_lines();
        color_properties = ColorDepth::Sixteen.names().len();
    }
    for VertexProperty { name, kind, .. } in &properties[color_properties..] {
        text += &format!("property {kind} {name}\n");
    }
    text += "end_header\n";
    (text, count_offset, color_offset)
}

impl CloudBody for PlyBody {
    fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        let mut out = Vec::new();
        for record in records.chunks_exact(self.record_length) {
            for c in self.quantization.world(Stored::of_record(record)) {
                out.extend(c.to_le_bytes());
            }
            for property in &self.properties {
                property.append(record, &mut out);
            }
            if self.color_offset.is_some() {
                self.is_deep |= COLOR.iter().any(|bytes| record[bytes.start + 1] > 0);
            }
        }
        self.sink
            .write_all(&out)
            .map_err(|e| LasError::unwritable(&self.path, e))
    }

    fn complete(mut self: Box<Self>, points: u64) -> Result<Amendments, LasError> {
        self.sink
            .flush()
            .map_err(|e| LasError::unwritable(&self.path, e))?;
        let mut changes = vec![(self.count_offset, padded_count(points).into_bytes())];
        if let (Some(offset), false) = (self.color_offset, self.is_deep) {
            changes.push((offset, ColorDepth::Eight.header_lines().into_bytes()));
        }
        Ok(changes)
    }
}
