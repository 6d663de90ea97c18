//! Points of a polygon file (PLY).
//!
//! Text and binary are read, in either byte order, with any scalar properties, and whatever
//! elements stand before and behind the vertices as long as their length is known.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use super::ply_header::PlyHeader;
use crate::las::{
    error::LasError,
    format::{
        crs::Crs,
        extra_bytes::ExtraAttribute,
        ply::{Encoding, Scalar},
        vertex_layout::VertexLayout,
    },
};

/// A polygon file whose header was read.
#[derive(Clone, Debug)]
pub struct PlyFile {
    path: PathBuf,
    header: PlyHeader,
}

impl PlyFile {
    /// Reads the header of the file at `path`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, is no PLY, or has no vertices with x, y and z.
    pub fn survey(path: &Path) -> Result<Self, LasError> {
        Ok(Self {
            path: path.to_owned(),
            header: PlyHeader::read(path)?,
        })
    }

    /// The coordinate reference system, if a comment states one.
    pub(super) fn crs(&self) -> Option<Crs> {
        self.header.crs.clone()
    }

    /// Whether a comment says that GPS times are adjusted standard times.
    pub(super) fn has_standard_time(&self) -> bool {
        self.header.has_standard_time
    }

    /// The layout of the records that vertices become.
    pub(super) fn layout(&self) -> VertexLayout {
        let vertices = self.header.vertices();
        let properties = vertices.map(|(vertices, _)| vertices.properties.as_slice());
        let mut layout = VertexLayout::of(properties.unwrap_or_default());
        for extra in &mut layout.extra_bytes {
            let is_same = |known: &&ExtraAttribute| {
                known.name == extra.name && known.data_type() == extra.data_type()
            };
            if let Some(known) = self.header.described.iter().find(is_same) {
                *extra = known.clone();
            }
        }
        layout
    }

    /// Opens the file at its first vertex.
    ///
    /// # Errors
    ///
    /// If the file cannot be read that far.
    pub fn open(&self) -> Result<PlyStream, LasError> {
        let unreadable = |e: std::io::Error| LasError::unreadable(&self.path, e);
        let file = File::open(&self.path).map_err(unreadable)?;
        let mut body = BufReader::with_capacity(1 << 20, file);
        let no_vertices = || LasError::new(&self.path, "has no vertices with x, y and z");
        let (vertices, before) = self.header.vertices().ok_or_else(no_vertices)?;
        let mut skipped = self.header.bytes;
        let mut line = String::new();
        if self.header.encoding == Encoding::Text {
            body.seek_relative(skipped as i64).map_err(unreadable)?;
            for _ in 0..before.iter().map(|element| element.count).sum() {
                line.clear();
                body.read_line(&mut line).map_err(unreadable)?;
            }
        } else {
            for element in before {
                skipped = skipped.saturating_add(element.count.saturating_mul(element.bytes()));
            }
            let skipped = i64::try_from(skipped).unwrap_or(i64::MAX);
            body.seek_relative(skipped).map_err(unreadable)?;
        }
        Ok(PlyStream {
            path: self.path.clone(),
            encoding: self.header.encoding,
            kinds: vertices.properties.iter().map(|(_, kind)| *kind).collect(),
            coordinates: vertices.coordinate_columns().ok_or_else(no_vertices)?,
            values: Vec::new(),
            body,
            read: 0,
            claimed: vertices.count,
            line,
            record: vec![0; vertices.bytes() as usize],
        })
    }
}

/// The vertices of a polygon file, one after the other.
#[derive(Debug)]
pub struct PlyStream {
    path: PathBuf,
    encoding: Encoding,
    /// The types of the properties.
    kinds: Vec<Scalar>,
    /// The indices of the properties x, y and z.
    coordinates: [usize; 3],
    body: BufReader<File>,
    /// The number of vertices read so far, and of those that the header claims.
    read: u64,
    claimed: u64,
    /// The line that was read last, if the file is text.
    line: String,
    /// The bytes of the vertex that was read last, if the file is binary.
    record: Vec<u8>,
    /// The values of the properties of the vertex that was read last.
    values: Vec<f64>,
}

impl PlyStream {
    /// The position of the next vertex; `None` after the last.
    ///
    /// # Errors
    ///
    /// If the file ends early, or a value is no number.
    pub fn next_position(&mut self) -> Result<Option<[f64; 3]>, LasError> {
        let coordinates = self.coordinates;
        let values = self.next_vertex()?;
        Ok(values.map(|values| coordinates.map(|column| values[column])))
    }

    /// The values of the next vertex, in the order of its properties; `None` after the
    /// last.
    ///
    /// # Errors
    ///
    /// If the file ends early, or a value is no number.
    pub(super) fn next_vertex(&mut self) -> Result<Option<&[f64]>, LasError> {
        if self.read == self.claimed {
            return Ok(None);
        }
        self.values.clear();
        let found = match self.encoding {
            Encoding::Text => self.read_text(),
            Encoding::LittleEndian | Encoding::BigEndian => self.read_binary(),
        };
        found.map_err(|why| {
            LasError::new(
                &self.path,
                format!(
                    "is truncated or damaged after vertex {} of {}: {why}",
                    self.read, self.claimed
                ),
            )
        })?;
        self.read += 1;
        Ok(Some(&self.values))
    }

    fn read_text(&mut self) -> Result<(), String> {
        self.line.clear();
        let read = self.body.read_line(&mut self.line);
        if read.map_err(|e| e.to_string())? == 0 {
            return Err("the file ends".into());
        }
        let mut words = self.line.split_whitespace();
        for _ in &self.kinds {
            let word = words.next().ok_or("a value is missing")?;
            let value = word.parse().map_err(|_| format!("{word} is no number"))?;
            self.values.push(value);
        }
        Ok(())
    }

    fn read_binary(&mut self) -> Result<(), String> {
        let read = self.body.read_exact(&mut self.record);
        read.map_err(|e| e.to_string())?;
        let mut at = 0;
        for kind in &self.kinds {
            let mut raw = [0; 8];
            raw[..kind.bytes()].copy_from_slice(&self.record[at..at + kind.bytes()]);
            if self.encoding == Encoding::BigEndian {
                raw[..kind.bytes()].reverse();
            }
            self.values.push(kind.value(raw));
            at += kind.bytes();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERTICES: [[f64; 3]; 2] = [[1.5, -2.0, 300.25], [0.0, 7.0, -0.5]];

    fn read(content: &[u8]) -> Result<Vec<[f64; 3]>, LasError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cloud.ply");
        std::fs::write(&path, content).unwrap();
        let mut stream = PlyFile::survey(&path)?.open()?;
        let mut positions = Vec::new();
        while let Some(position) = stream.next_position()? {
            positions.push(position);
        }
        Ok(positions)
    }

    fn binary(format: &str, bytes_of: impl Fn(f32) -> [u8; 4]) -> Vec<u8> {
        let mut content = format!(
            "ply\nformat {format} 1.0\ncomment of two\nelement camera 1\nproperty short id\n\
             element vertex 2\nproperty float x\nproperty uchar red\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
             end_header\n"
        )
        .into_bytes();
        content.extend([9, 9]);
        for [x, y, z] in VERTICES {
            content.extend(bytes_of(x as f32));
            content.push(200);
            content.extend(bytes_of(y as f32));
            content.extend(bytes_of(z as f32));
        }
        content.extend([0; 13]);
        content
    }

    #[test]
    fn every_encoding_gives_the_same_vertices() {
        let text =
            b"ply\nformat ascii 1.0\nelement vertex 2\nproperty double z\nproperty float y\n\
            property int intensity\nproperty float x\nend_header\n\
            300.25 -2 17 1.5\n-0.5 7e0 3 0\n";
        assert_eq!(read(text).unwrap(), VERTICES);
        assert_eq!(
            read(&binary("binary_little_endian", f32::to_le_bytes)).unwrap(),
            VERTICES
        );
        assert_eq!(
            read(&binary("binary_big_endian", f32::to_be_bytes)).unwrap(),
            VERTICES
        );
    }

    #[test]
    fn the_error_says_where_a_file_is_damaged() {
        let mut short = binary("binary_little_endian", f32::to_le_bytes);
        short.truncate(short.len() - 20);
        let error = read(&short).unwrap_err().to_string();
        assert!(error.contains("vertex 1 of 2"), "{error}");
        for (content, expected) in [
            (&b"plx\n"[..], "is no PLY"),
            (b"ply\nformat ascii 1.0\n", "does not end"),
            (b"ply\nformat ascii 1.0\nend_header\n", "no vertices"),
            (
                b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                  property float z\nend_header\n1 two 3\n",
                "two is no number",
            ),
        ] {
            let error = read(content).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn properties_that_las_has_no_field_for_become_extra_bytes() {
        let content = b"ply\nformat ascii 1.0\ncomment crs PROJCS[\"a\"]\nelement vertex 1\n\
            property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
            property uchar green\nproperty uchar blue\nproperty short roll\n\
            property float intensity\nproperty double gps_time\nend_header\n\
            1 2 3 255 7 0 -300 0.25 9.5\n";
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cloud.ply");
        std::fs::write(&path, content).unwrap();
        let file = PlyFile::survey(&path).unwrap();
        assert_eq!(file.crs(), Some(Crs::Wkt("PROJCS[\"a\"]".into())));
        let layout = file.layout();
        assert_eq!(layout.point_format, 7);
        let names: Vec<_> = layout.extra_bytes.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["roll", "intensity"]);
        let mut records = Vec::new();
        let mut stream = file.open().unwrap();
        let values = stream.next_vertex().unwrap().unwrap();
        assert!(layout.append(values, [0.5; 3], [0.0; 3], &mut records));
        assert_eq!(records.len(), 42);
        assert_eq!(records[..12], [2, 0, 0, 0, 4, 0, 0, 0, 6, 0, 0, 0]);
        assert_eq!(records[22..30], 9.5_f64.to_le_bytes());
        assert_eq!(records[30..36], [0, 255, 0, 7, 0, 0]);
        assert_eq!(records[36..38], (-300_i16).to_le_bytes());
        assert_eq!(records[38..42], 0.25_f32.to_le_bytes());
        assert!(!layout.append(&[f64::NAN; 9], [0.5; 3], [0.0; 3], &mut records));
        assert_eq!(records.len(), 42);
    }
}
