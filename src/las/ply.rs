//! Points of a polygon file (PLY).
//!
//! Text and binary, either byte order, any scalar properties, whatever stands
//! before and after the vertices as long as its length is known. Vertices become
//! records of LAS: properties that LAS has by the names that are usual, all others as
//! extra bytes of their name and type.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use super::{
    Crs, ExtraByte, LasError,
    format::record::{
        CLASSIFICATION, COLOR, FLAGS, GPS_TIME, INTENSITY, NEAR_INFRARED, POINT_SOURCE, SCAN_ANGLE,
        USER_DATA, standard_length,
    },
};

/// A polygon file whose header was read.
#[derive(Clone, Debug)]
pub struct PlyFile {
    path: PathBuf,
    encoding: Encoding,
    /// Elements up to the vertices, those included.
    elements: Vec<Element>,
    header_bytes: u64,
    /// What comments say of the coordinates, as our own writer puts it.
    crs: Option<Crs>,
    has_standard_time: bool,
    /// Extra bytes that comments describe.
    described: Vec<ExtraByte>,
}

/// How a comment begins that states the coordinate reference system …
pub(super) const CRS_COMMENT: &str = "crs ";
/// … that describes an extra-bytes attribute, as LAS does, in hexadecimal digits …
pub(super) const EXTRA_COMMENT: &str = "extra bytes ";
/// … and that GPS times are adjusted standard times.
pub(super) const TIME_COMMENT: &str = "gps time is adjusted standard time";

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
pub(super) enum Scalar {
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

impl Scalar {
    /// Writes `value` to `raw`, little endian; saturates.
    fn put(self, value: f64, raw: &mut [u8]) {
        match self {
            Self::Float(4) => raw.copy_from_slice(&(value as f32).to_le_bytes()),
            Self::Float(_) => raw.copy_from_slice(&value.to_le_bytes()),
            Self::Uint(bytes) => {
                let most = (1_u64 << (8 * bytes)) - 1;
                let value = (value.round() as u64).min(most);
                raw.copy_from_slice(&value.to_le_bytes()[..bytes]);
            }
            Self::Int(bytes) => {
                let most = (1_i64 << (8 * bytes - 1)) - 1;
                let value = (value.round() as i64).clamp(-most - 1, most);
                raw.copy_from_slice(&value.to_le_bytes()[..bytes]);
            }
        }
    }

    /// The number by which extra bytes tell their type (LAS 1.4, table 25).
    fn data_type(self) -> u8 {
        match self {
            Self::Uint(1) => 1,
            Self::Int(1) => 2,
            Self::Uint(2) => 3,
            Self::Int(2) => 4,
            Self::Uint(_) => 5,
            Self::Int(_) => 6,
            Self::Float(4) => 9,
            Self::Float(_) => 10,
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
        let (mut crs, mut has_standard_time, mut described) = (None, false, Vec::new());
        loop {
            let text = next()?;
            if let Some(comment) = text.strip_prefix("comment ") {
                has_standard_time |= comment == TIME_COMMENT;
                if let Some(wkt) = comment.strip_prefix(CRS_COMMENT) {
                    crs = Some(Crs::Wkt(wkt.trim().to_owned()));
                }
                described.extend(comment.strip_prefix(EXTRA_COMMENT).and_then(described_by));
                continue;
            }
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
            crs,
            has_standard_time,
            described,
        })
    }

    /// The coordinate reference system, if a comment states one.
    pub(super) fn crs(&self) -> Option<Crs> {
        self.crs.clone()
    }

    /// Whether a comment says that GPS times are adjusted standard times.
    pub(super) fn has_standard_time(&self) -> bool {
        self.has_standard_time
    }

    /// How its vertices become records.
    pub(super) fn layout(&self) -> PlyLayout {
        let properties = self.elements.last().map(|e| e.properties.as_slice());
        let mut layout = PlyLayout::of(properties.unwrap_or_default());
        for extra in &mut layout.extra_bytes {
            let same = |known: &&ExtraByte| {
                known.name == extra.name && known.descriptor[2] == extra.descriptor[2]
            };
            if let Some(known) = self.described.iter().find(same) {
                *extra = known.clone();
            }
        }
        layout
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
        let places = columns(vertices)
            .ok_or_else(|| LasError::new(&self.path, "has no vertices with x, y and z"))?;
        Ok(PlyStream {
            path: self.path.clone(),
            encoding: self.encoding,
            kinds: vertices.properties.iter().map(|(_, kind)| *kind).collect(),
            places,
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
    kinds: Vec<Scalar>,
    /// Which properties x, y and z are.
    places: [usize; 3],
    body: BufReader<File>,
    read: u64,
    claimed: u64,
    line: String,
    record: Vec<u8>,
    values: Vec<f64>,
}

impl PlyStream {
    /// The place of the next vertex; `None` after the last.
    ///
    /// # Errors
    ///
    /// If the file ends early, or holds what is no number.
    pub fn next_place(&mut self) -> Result<Option<[f64; 3]>, LasError> {
        let places = self.places;
        let values = self.next_vertex()?;
        Ok(values.map(|values| places.map(|column| values[column])))
    }

    /// The values of the next vertex, in the order of its properties; `None` after the
    /// last.
    ///
    /// # Errors
    ///
    /// As [`next_place`](Self::next_place).
    pub(super) fn next_vertex(&mut self) -> Result<Option<&[f64]>, LasError> {
        if self.read == self.claimed {
            return Ok(None);
        }
        self.values.clear();
        let found = match self.encoding {
            Encoding::Text => self.text(),
            Encoding::LittleEndian | Encoding::BigEndian => self.binary(),
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

    fn text(&mut self) -> Result<(), String> {
        self.line.clear();
        let read = self.body.read_line(&mut self.line);
        if read.map_err(|e| e.to_string())? == 0 {
            return Err("the file ends".into());
        }
        let mut words = self.line.split_whitespace();
        for _ in &self.kinds {
            let word = words.next().unwrap_or("nothing");
            let value = word.parse().map_err(|_| format!("{word} is no number"))?;
            self.values.push(value);
        }
        Ok(())
    }

    fn binary(&mut self) -> Result<(), String> {
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

/// The attribute whose description these hexadecimal digits are.
fn described_by(hex: &str) -> Option<ExtraByte> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let descriptor: Option<Vec<u8>> = hex.trim().as_bytes().chunks(2).map(byte).collect();
    ExtraByte::from_descriptor(&descriptor?)
}

/// Which properties x, y and z are.
fn columns(vertices: &Element) -> Option<[usize; 3]> {
    let find = |wanted: &str| {
        vertices
            .properties
            .iter()
            .position(|(name, _)| name == wanted)
    };
    Some([find("x")?, find("y")?, find("z")?])
}

/// Where the values of a vertex go in a record of LAS 1.4.
#[derive(Clone, Debug)]
pub(super) struct PlyLayout {
    /// LAS point format: 6, 7 or 8.
    pub(super) point_format: u8,
    /// What LAS has no place for.
    pub(super) extra_bytes: Vec<ExtraByte>,
    /// Which of the coordinates are of single precision: all, if one is.
    pub(super) is_single: bool,
    /// Of each property: where in the record it goes, as what, times what.
    fields: Vec<Option<(usize, Scalar, f64)>>,
    places: [usize; 3],
}

impl PlyLayout {
    pub(super) fn of(properties: &[(String, Scalar)]) -> Self {
        let has = |wanted: &str| properties.iter().any(|(name, _)| name == wanted);
        let point_format = match (has("red"), has("nir")) {
            (_, true) => 8,
            (true, false) => 7,
            (false, false) => 6,
        };
        let mut extra_bytes = Vec::new();
        let mut end = standard_length(point_format);
        let mut places = [0; 3];
        let mut fields = Vec::new();
        for (column, (name, kind)) in properties.iter().enumerate() {
            // Eight bits of colour are the upper ones of sixteen, as LAS wants it.
            let sixteen_bits = match kind {
                Scalar::Uint(1) => 256.0,
                Scalar::Float(_) => 65_535.0,
                _ => 1.0,
            };
            let is_small = matches!(kind, Scalar::Uint(1 | 2));
            let field = match name.as_str() {
                "x" | "y" | "z" => {
                    places[usize::from(name.as_bytes()[0] - b'x')] = column;
                    None
                }
                "red" => Some((COLOR[0].start, Scalar::Uint(2), sixteen_bits)),
                "green" if point_format > 6 => {
                    Some((COLOR[1].start, Scalar::Uint(2), sixteen_bits))
                }
                "blue" if point_format > 6 => Some((COLOR[2].start, Scalar::Uint(2), sixteen_bits)),
                "nir" => Some((NEAR_INFRARED.start, Scalar::Uint(2), sixteen_bits)),
                "intensity" if is_small => Some((INTENSITY.start, Scalar::Uint(2), 1.0)),
                "flags" if *kind == Scalar::Uint(1) => Some((FLAGS, Scalar::Uint(1), 1.0)),
                "classification" if *kind == Scalar::Uint(1) => {
                    Some((CLASSIFICATION, Scalar::Uint(1), 1.0))
                }
                "user_data" if *kind == Scalar::Uint(1) => Some((USER_DATA, Scalar::Uint(1), 1.0)),
                "scan_angle" if *kind == Scalar::Int(2) => {
                    Some((SCAN_ANGLE.start, Scalar::Int(2), 1.0))
                }
                "point_source_id" if is_small => Some((POINT_SOURCE.start, Scalar::Uint(2), 1.0)),
                "gps_time" => Some((GPS_TIME.start, Scalar::Float(8), 1.0)),
                _ => {
                    let at = end;
                    end += kind.bytes();
                    extra_bytes.push(ExtraByte::named(name, kind.data_type()));
                    Some((at, *kind, 1.0))
                }
            };
            fields.push(field);
        }
        Self {
            point_format,
            extra_bytes,
            is_single: places
                .iter()
                .any(|&column| properties.get(column).is_some_and(|(_, k)| k.bytes() < 8)),
            fields,
            places,
        }
    }

    /// Appends the record of a vertex at `values`; `false` if its place is not within
    /// reach of `scale` and `offset`.
    pub(super) fn append(
        &self,
        values: &[f64],
        scale: [f64; 3],
        offset: [f64; 3],
        records: &mut Vec<u8>,
    ) -> bool {
        let start = records.len();
        let extra: usize = self.extra_bytes.iter().map(|extra| extra.length).sum();
        let standard = standard_length(self.point_format);
        records.resize(start + standard + extra, 0);
        let record = &mut records[start..];
        for axis in 0..3 {
            let stored = ((values[self.places[axis]] - offset[axis]) / scale[axis]).round();
            if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&stored) {
                records.truncate(start);
                return false;
            }
            record[4 * axis..4 * axis + 4].copy_from_slice(&(stored as i32).to_le_bytes());
        }
        record[14] = 0x11;
        for (value, field) in values.iter().zip(&self.fields) {
            if let Some((at, kind, times)) = *field {
                kind.put(value * times, &mut record[at..at + kind.bytes()]);
            }
        }
        true
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
    fn what_las_has_no_place_for_becomes_extra_bytes() {
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

    #[test]
    fn integers_keep_their_sign() {
        assert_eq!(Scalar::Int(2).value([0xfe, 0xff, 0, 0, 0, 0, 0, 0]), -2.0);
        assert_eq!(Scalar::Uint(1).value([0xfe, 0, 0, 0, 0, 0, 0, 0]), 254.0);
    }
}
