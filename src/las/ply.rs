//! Points of a polygon file (PLY), for clouds to be measured.
//!
//! Text and binary, either byte order, any scalar properties, whatever stands
//! before and after the vertices as long as its length is known.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use super::LasError;

/// A polygon file whose header was read.
#[derive(Clone, Debug)]
pub struct PlyFile {
    path: PathBuf,
    encoding: Encoding,
    /// Elements up to the vertices, those included.
    elements: Vec<Element>,
    header_bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<(String, Scalar)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    Int(usize),
    Uint(usize),
    Float(usize),
}

/// The longest header that is read: some files are no PLY after their first
/// line.
const LONGEST_HEADER: u64 = 1 << 20;

impl Scalar {
    fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int(1),
            "short" | "int16" => Self::Int(2),
            "int" | "int32" => Self::Int(4),
            "uchar" | "uint8" => Self::Uint(1),
            "ushort" | "uint16" => Self::Uint(2),
            "uint" | "uint32" => Self::Uint(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int(bytes) | Self::Uint(bytes) | Self::Float(bytes) => bytes,
        }
    }

    /// The value in `raw`, its bytes in little-endian order.
    fn value(self, raw: [u8; 8]) -> f64 {
        let word = u64::from_le_bytes(raw);
        match self {
            Self::Float(4) => f32::from_bits(word as u32).into(),
            Self::Float(_) => f64::from_bits(word),
            Self::Uint(_) => word as f64,
            Self::Int(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((word << unused) as i64 >> unused) as f64
            }
        }
    }
}

impl Element {
    fn bytes(&self) -> u64 {
        self.properties
            .iter()
            .map(|(_, kind)| kind.bytes() as u64)
            .sum()
    }
}

impl PlyFile {
    /// Reads the header of the file at `path`.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is no PLY, or has no vertices with x, y and z.
    pub fn survey(path: &Path) -> Result<Self, LasError> {
        let wrong = |problem: String| LasError::new(path, problem);
        let file = File::open(path).map_err(|e| wrong(format!("cannot be read: {e}")))?;
        let mut lines = BufReader::new(file).take(LONGEST_HEADER);
        let mut header_bytes = 0;
        let mut line = Vec::new();
        let mut next = || -> Result<String, LasError> {
            line.clear();
            let read = lines
                .read_until(b'\n', &mut line)
                .map_err(|e| wrong(format!("cannot be read: {e}")))?;
            if read == 0 {
                return Err(wrong("its header does not end".into()));
            }
            header_bytes += read as u64;
            Ok(String::from_utf8_lossy(&line).trim_end().to_owned())
        };
        if next()? != "ply" {
            return Err(wrong("is no PLY file".into()));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut is_past_vertices = false;
        loop {
            let text = next()?;
            let words: Vec<&str> = text.split_whitespace().collect();
            match words[..] {
                ["format", name, "1.0"] => {
                    encoding = match name {
                        "ascii" => Some(Encoding::Text),
                        "binary_little_endian" => Some(Encoding::LittleEndian),
                        "binary_big_endian" => Some(Encoding::BigEndian),
                        _ => None,
                    }
                }
                ["element", name, count] => {
                    // What follows the vertices is never read.
                    is_past_vertices = elements.last().is_some_and(|e| e.name == "vertex");
                    if !is_past_vertices {
                        elements.push(Element {
                            name: name.to_owned(),
                            count: count
                                .parse()
                                .map_err(|_| wrong(format!("holds {count} of {name}")))?,
                            properties: Vec::new(),
                        });
                    }
                }
                ["property", ..] if is_past_vertices => {}
                ["property", kind, name] => {
                    let kind = Scalar::of_name(kind)
                        .ok_or_else(|| wrong(format!("property {name} is an unknown {kind}")))?;
                    if let Some(element) = elements.last_mut() {
                        element.properties.push((name.to_owned(), kind));
                    }
                }
                ["property", "list", ..] => {
                    return Err(wrong("has lists before or in its vertices".into()));
                }
                ["end_header"] => break,
                _ => {}
            }
        }
        let encoding = encoding.ok_or_else(|| wrong("is PLY of an unknown format".into()))?;
        let places = elements
            .last()
            .filter(|element| element.name == "vertex")
            .and_then(columns);
        if places.is_none() {
            return Err(wrong("has no vertices with x, y and z".into()));
        }
        Ok(Self {
            path: path.to_owned(),
            encoding,
            elements,
            header_bytes,
        })
    }

    /// Opens the file at its first vertex.
    ///
    /// # Errors
    ///
    /// If it cannot be read that far.
    pub fn open(&self) -> Result<PlyStream, LasError> {
        let wrong = |e: std::io::Error| LasError::new(&self.path, format!("cannot be read: {e}"));
        let mut body = BufReader::with_capacity(1 << 20, File::open(&self.path).map_err(wrong)?);
        let (vertices, before) = self
            .elements
            .split_last()
            .ok_or_else(|| LasError::new(&self.path, "has no vertices"))?;
        let mut skipped = self.header_bytes;
        let mut line = String::new();
        if self.encoding == Encoding::Text {
            body.seek_relative(skipped as i64).map_err(wrong)?;
            for _ in 0..before.iter().map(|element| element.count).sum() {
                line.clear();
                body.read_line(&mut line).map_err(wrong)?;
            }
        } else {
            for element in before {
                skipped = skipped.saturating_add(element.count.saturating_mul(element.bytes()));
            }
            let skipped = i64::try_from(skipped).unwrap_or(i64::MAX);
            body.seek_relative(skipped).map_err(wrong)?;
        }
        let columns = columns(vertices)
            .ok_or_else(|| LasError::new(&self.path, "has no vertices with x, y and z"))?;
        Ok(PlyStream {
            path: self.path.clone(),
            encoding: self.encoding,
            columns,
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
    /// Of x, y and z: which property it is, at which byte, of which kind.
    columns: [(usize, usize, Scalar); 3],
    body: BufReader<File>,
    read: u64,
    claimed: u64,
    line: String,
    record: Vec<u8>,
}

impl PlyStream {
    /// The next vertex; `None` after the last.
    ///
    /// # Errors
    ///
    /// If the file ends early, or holds what is no number.
    pub fn next_place(&mut self) -> Result<Option<[f64; 3]>, LasError> {
        if self.read == self.claimed {
            return Ok(None);
        }
        let place = match self.encoding {
            Encoding::Text => self.text(),
            Encoding::LittleEndian | Encoding::BigEndian => self.binary(),
        };
        let place = place.map_err(|why| {
            LasError::new(
                &self.path,
                format!(
                    "is truncated or damaged after vertex {} of {}: {why}",
                    self.read, self.claimed
                ),
            )
        })?;
        self.read += 1;
        Ok(Some(place))
    }

    fn text(&mut self) -> Result<[f64; 3], String> {
        self.line.clear();
        let read = self.body.read_line(&mut self.line);
        if read.map_err(|e| e.to_string())? == 0 {
            return Err("the file ends".into());
        }
        let mut place = [0.0; 3];
        for (c, &(column, _, _)) in place.iter_mut().zip(&self.columns) {
            let word = self
                .line
                .split_whitespace()
                .nth(column)
                .unwrap_or("nothing");
            *c = word.parse().map_err(|_| format!("{word} is no number"))?;
        }
        Ok(place)
    }

    fn binary(&mut self) -> Result<[f64; 3], String> {
        let read = self.body.read_exact(&mut self.record);
        read.map_err(|e| e.to_string())?;
        Ok(self.columns.map(|(_, at, kind)| {
            let mut raw = [0; 8];
            raw[..kind.bytes()].copy_from_slice(&self.record[at..at + kind.bytes()]);
            if self.encoding == Encoding::BigEndian {
                raw[..kind.bytes()].reverse();
            }
            kind.value(raw)
        }))
    }
}

/// Of x, y and z: which property it is, at which byte, of which kind.
fn columns(vertices: &Element) -> Option<[(usize, usize, Scalar); 3]> {
    let find = |wanted: &str| {
        let mut at = 0;
        for (column, (name, kind)) in vertices.properties.iter().enumerate() {
            if name == wanted {
                return Some((column, at, *kind));
            }
            at += kind.bytes();
        }
        None
    };
    Some([find("x")?, find("y")?, find("z")?])
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
        let mut places = Vec::new();
        while let Some(place) = stream.next_place()? {
            places.push(place);
        }
        Ok(places)
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
    fn a_damaged_file_is_told_where() {
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
    fn integers_keep_their_sign() {
        assert_eq!(Scalar::Int(2).value([0xfe, 0xff, 0, 0, 0, 0, 0, 0]), -2.0);
        assert_eq!(Scalar::Uint(1).value([0xfe, 0, 0, 0, 0, 0, 0, 0]), 254.0);
    }
}
