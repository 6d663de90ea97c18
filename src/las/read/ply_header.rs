//! The header of a polygon file (PLY): lines of text up to `end_header`.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Take},
    path::Path,
};

use crate::las::{
    error::LasError,
    format::{
        crs::Crs,
        extra_bytes::ExtraAttribute,
        ply::{
            CRS_COMMENT, CRS_CONTINUED, EXTRA_BYTES_COMMENT, Element, Encoding,
            STANDARD_TIME_COMMENT, Scalar, attribute_of_digits,
        },
    },
};

/// The longest header that is read, in bytes: some files are no PLY after their first line.
const LONGEST_HEADER_BYTES: u64 = 1 << 20;

/// What the header of a polygon file says.
#[derive(Clone, Debug)]
pub(super) struct PlyHeader {
    pub(super) encoding: Encoding,
    /// The elements up to the vertices, those included.
    pub(super) elements: Vec<Element>,
    /// The length of the header in bytes.
    pub(super) bytes: u64,
    /// The coordinate reference system, if a comment states one.
    pub(super) crs: Option<Crs>,
    /// Whether a comment says that GPS times are adjusted standard times.
    pub(super) has_standard_time: bool,
    /// The extra bytes that comments describe.
    pub(super) described: Vec<ExtraAttribute>,
}

impl PlyHeader {
    /// Reads the header of the file at `path`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, is no PLY, or has no vertices with x, y and z.
    pub(super) fn read(path: &Path) -> Result<Self, LasError> {
        let wrong = |problem: String| LasError::new(path, problem);
        let mut lines = HeaderLines::open(path).map_err(wrong)?;
        if lines.next().map_err(wrong)? != "ply" {
            return Err(wrong("is no PLY file".into()));
        }
        let mut statements = Statements::default();
        while statements
            .take(&lines.next().map_err(wrong)?)
            .map_err(wrong)?
        {}
        statements.into_header(lines.bytes).map_err(wrong)
    }

    /// The vertices, and the elements in front of them.
    pub(super) fn vertices(&self) -> Option<(&Element, &[Element])> {
        self.elements.split_last()
    }
}

/// The lines of a header.
struct HeaderLines {
    file: Take<BufReader<File>>,
    line: Vec<u8>,
    /// The number of bytes read so far.
    bytes: u64,
}

impl HeaderLines {
    fn open(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|e| format!("cannot be read: {e}"))?;
        Ok(Self {
            file: BufReader::new(file).take(LONGEST_HEADER_BYTES),
            line: Vec::new(),
            bytes: 0,
        })
    }

    fn next(&mut self) -> Result<String, String> {
        self.line.clear();
        let read = self.file.read_until(b'\n', &mut self.line);
        let read = read.map_err(|e| format!("cannot be read: {e}"))?;
        if read == 0 {
            return Err(format!(
                "its header does not end: there is no line end_header in the first {} bytes",
                self.bytes
            ));
        }
        self.bytes += read as u64;
        Ok(String::from_utf8_lossy(&self.line).trim_end().to_owned())
    }
}

/// What the lines of a header have said so far.
#[derive(Default)]
struct Statements {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    /// Whether the vertices are complete: elements behind them are never read.
    is_past_vertices: bool,
    crs: Option<Crs>,
    has_standard_time: bool,
    described: Vec<ExtraAttribute>,
}

impl Statements {
    /// Takes in a line, and returns whether another line of the header follows.
    fn take(&mut self, line: &str) -> Result<bool, String> {
        if let Some(comment) = line.strip_prefix("comment ") {
            self.take_comment(comment);
            return Ok(true);
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", name, "1.0"] => self.encoding = Encoding::of_name(name),
            ["element", name, count] => self.take_element(name, count)?,
            ["property", ..] if self.is_past_vertices => {}
            ["property", kind, name] => {
                let kind = Scalar::of_name(kind)
                    .ok_or_else(|| format!("property {name} is of the unknown type {kind}"))?;
                if let Some(element) = self.elements.last_mut() {
                    element.properties.push((name.to_owned(), kind));
                }
            }
            ["property", "list", ..] => {
                return Err(
                    "has lists before or in its vertices; lists are read only behind \
                            them"
                        .to_owned(),
                );
            }
            ["end_header"] => return Ok(false),
            _ => {}
        }
        Ok(true)
    }

    fn take_comment(&mut self, comment: &str) {
        self.has_standard_time |= comment == STANDARD_TIME_COMMENT;
        if let Some(wkt) = comment.strip_prefix(CRS_COMMENT) {
            self.crs = Some(Crs::Wkt(wkt.trim().to_owned()));
        }
        if let (Some(more), Some(Crs::Wkt(wkt))) =
            (comment.strip_prefix(CRS_CONTINUED), &mut self.crs)
        {
            wkt.push_str(more.trim());
        }
        let described = comment.strip_prefix(EXTRA_BYTES_COMMENT);
        self.described
            .extend(described.and_then(attribute_of_digits));
    }

    fn take_element(&mut self, name: &str, count: &str) -> Result<(), String> {
        self.is_past_vertices = self.elements.last().is_some_and(|e| e.name == "vertex");
        if !self.is_past_vertices {
            self.elements.push(Element {
                name: name.to_owned(),
                count: count
                    .parse()
                    .map_err(|_| format!("its number of {name} elements is {count}"))?,
                properties: Vec::new(),
            });
        }
        Ok(())
    }

    /// The header, of `bytes` bytes, if it is complete.
    fn into_header(self, bytes: u64) -> Result<PlyHeader, String> {
        let encoding = self.encoding.ok_or("is PLY of an unknown format")?;
        let vertices = self.elements.last().filter(|e| e.name == "vertex");
        if vertices.and_then(Element::coordinate_columns).is_none() {
            return Err("has no vertices with x, y and z".to_owned());
        }
        Ok(PlyHeader {
            encoding,
            elements: self.elements,
            bytes,
            crs: self.crs,
            has_standard_time: self.has_standard_time,
            described: self.described,
        })
    }
}
