//! A mesh that is being written, whatever its format: complete under its name, or not there at
//! all.

use std::{
    fmt::Display,
    fs::File,
    io::{self, BufWriter},
    path::Path,
};

use super::{
    encoder::MeshEncoder,
    format::MeshFormat,
    glb::GlbEncoder,
    header::{MeshHeader, MeshVertex},
    obj::ObjEncoder,
    ply::PlyEncoder,
};
use crate::las::{error::LasError, write::part_file::PartFile};

/// The bytes that are collected before they are written.
const BUFFER_BYTES: usize = 1 << 20;

/// A mesh that is being written under a preliminary name; nothing is left of it if it is
/// dropped.
pub(crate) struct MeshWriter {
    // Fields are dropped in this order: the file is closed, then removed.
    file: BufWriter<File>,
    part: PartFile,
    encoder: Box<dyn MeshEncoder>,
    header: MeshHeader,
    /// The numbers of vertices and triangles written so far.
    vertices: u64,
    triangles: u64,
    /// The bounds of the vertices written so far.
    bounds: [[f64; 3]; 2],
}

impl MeshWriter {
    /// Begins the mesh at `path`, under another name in the same directory.
    ///
    /// # Errors
    ///
    /// If the format cannot hold the mesh, there is a directory at `path`, or no file can be
    /// made there.
    pub(crate) fn create(
        path: &Path,
        format: MeshFormat,
        header: &MeshHeader,
    ) -> Result<Self, LasError> {
        if path.is_dir() {
            return Err(LasError::new(path, "is a directory; give another name"));
        }
        let encoder: Box<dyn MeshEncoder> = match format {
            MeshFormat::Ply => Box::new(PlyEncoder::new(path, header)?),
            MeshFormat::Obj => Box::new(ObjEncoder::new(path, header)?),
            MeshFormat::Glb => Box::new(GlbEncoder::new(path, header)?),
        };
        let (part, file) = PartFile::create_file(path)?;
        let mut writer = Self {
            file: BufWriter::with_capacity(BUFFER_BYTES, file),
            part,
            encoder,
            header: header.clone(),
            vertices: 0,
            triangles: 0,
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
        };
        let written = writer.encoder.write_header(&mut writer.file);
        writer.report(written)?;
        Ok(writer)
    }

    /// Appends `vertices`. All vertices come before the first triangle.
    ///
    /// # Errors
    ///
    /// If they cannot be written, are more than the header says, or lie outside of its bounds.
    pub(crate) fn vertices(&mut self, vertices: &[MeshVertex]) -> Result<(), LasError> {
        for (number, vertex) in (self.vertices..).zip(vertices) {
            let position = vertex.position;
            let [min, max] = self.header.bounds;
            // Written so that NaN fails.
            if !(0..3).all(|axis| (min[axis]..=max[axis]).contains(&position[axis])) {
                return Err(self.defect(format!(
                    "vertex {number} at {position:?} is outside of the bounds {:?}",
                    self.header.bounds
                )));
            }
            for axis in 0..3 {
                self.bounds[0][axis] = self.bounds[0][axis].min(position[axis]);
                self.bounds[1][axis] = self.bounds[1][axis].max(position[axis]);
            }
        }
        self.vertices += vertices.len() as u64;
        if self.vertices > self.header.vertices || self.triangles > 0 {
            return Err(self.wrong_counts());
        }
        let written = self.encoder.write_vertices(vertices, &mut self.file);
        self.report(written)
    }

    /// Appends `triangles`, given by the numbers of their corners in the order of the
    /// vertices, counterclockwise when seen from outside.
    ///
    /// # Errors
    ///
    /// If they cannot be written, are more than the header says, come before the last vertex,
    /// or have corners that are no vertices.
    pub(crate) fn triangles(&mut self, triangles: &[[u32; 3]]) -> Result<(), LasError> {
        self.triangles += triangles.len() as u64;
        if self.triangles > self.header.triangles || self.vertices < self.header.vertices {
            return Err(self.wrong_counts());
        }
        let corners = triangles.as_flattened();
        if let Some(corner) = corners.iter().find(|&&c| u64::from(c) >= self.vertices) {
            return Err(self.defect(format!(
                "a triangle has the corner {corner}, but there are {} vertices",
                self.vertices
            )));
        }
        let written = self.encoder.write_triangles(triangles, &mut self.file);
        self.report(written)
    }

    /// Completes the mesh under its preliminary name and flushes it to the disk.
    ///
    /// # Errors
    ///
    /// If it cannot be written, or its counts or bounds are not those of the header; nothing
    /// is left of it then.
    pub(crate) fn complete(self) -> Result<CompleteMesh, LasError> {
        if [self.vertices, self.triangles] != [self.header.vertices, self.header.triangles] {
            return Err(self.wrong_counts());
        }
        if self.vertices > 0 && self.bounds != self.header.bounds {
            return Err(self.defect(format!(
                "the bounds of the vertices are {:?}, announced were {:?}",
                self.bounds, self.header.bounds
            )));
        }
        let Self { file, part, .. } = self;
        flush_to_disk(file).map_err(|e| incomplete(part.path(), e))?;
        Ok(CompleteMesh::new(part))
    }

    fn report(&self, written: io::Result<()>) -> Result<(), LasError> {
        written.map_err(|e| incomplete(self.part.path(), e))
    }

    fn wrong_counts(&self) -> LasError {
        self.defect(format!(
            "{} vertices and {} triangles were written, announced were {} and {}",
            self.vertices, self.triangles, self.header.vertices, self.header.triangles
        ))
    }

    fn defect(&self, what: String) -> LasError {
        let problem = format!("{what}; this is a defect of the program, please report it");
        LasError::new(self.part.path(), problem)
    }
}

/// The error that the output at `path` could not be completed because of `cause`.
fn incomplete(path: &Path, cause: impl Display) -> LasError {
    LasError::unwritable(path, format!("{cause}; nothing is left under that name"))
}

/// Writes what was collected, and flushes it to the disk.
fn flush_to_disk(file: BufWriter<File>) -> io::Result<()> {
    let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.sync_all()
}

/// A complete mesh, a file or a directory of tiles, under its preliminary name; removed unless
/// it is delivered.
#[derive(Debug)]
pub(crate) struct CompleteMesh {
    part: PartFile,
}

impl CompleteMesh {
    /// The mesh in `part`.
    pub(super) fn new(part: PartFile) -> Self {
        Self { part }
    }

    /// Gives the mesh its final name.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed; nothing is left of it then.
    pub(crate) fn deliver(self) -> Result<(), LasError> {
        self.part.deliver()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::write::mesh::samples::Sample;

    /// A change of the mesh after it was announced.
    type Change = fn(&mut Sample);

    /// Writes a sphere that `change` has changed under an announced header, and returns the
    /// error. Nothing may be left of it.
    fn failure(format: MeshFormat, change: Change) -> String {
        let dir = tempfile::tempdir().unwrap();
        let header = Sample::sphere().header();
        let mut sample = Sample::sphere();
        change(&mut sample);
        let write = || -> Result<CompleteMesh, LasError> {
            let mut writer = MeshWriter::create(&dir.path().join("mesh"), format, &header)?;
            writer.vertices(&sample.vertices)?;
            writer.triangles(&sample.triangles)?;
            writer.complete()
        };
        let error = write().unwrap_err().to_string();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        error
    }

    #[test]
    fn a_mesh_that_is_not_the_announced_one_is_refused() {
        for format in [MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Glb] {
            let cases: [(Change, &str); 6] = [
                (|sample| sample.vertices.truncate(7), "7 vertices and 960"),
                (|sample| sample.triangles.truncate(7), "482 vertices and 7"),
                (|sample| sample.triangles.push([0, 1, 2]), "961 triangles"),
                (|sample| sample.triangles[3][1] = 482, "the corner 482"),
                (
                    |sample| sample.vertices[5].position[1] = f64::NAN,
                    "vertex 5",
                ),
                (
                    |sample| sample.vertices[0] = sample.vertices[1],
                    "the bounds",
                ),
            ];
            for (change, expected) in cases {
                let error = failure(format, change);
                assert!(error.contains(expected), "{error}");
            }
        }
    }

    #[test]
    fn a_writer_that_is_dropped_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mesh.glb");
        let sphere = Sample::sphere();
        let mut writer = MeshWriter::create(&path, MeshFormat::Glb, &sphere.header()).unwrap();
        writer.vertices(&sphere.vertices).unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        drop(writer);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn an_earlier_mesh_stays_until_the_new_one_is_complete() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mesh.ply");
        std::fs::write(&path, "earlier").unwrap();
        let sphere = Sample::sphere();
        let writer = MeshWriter::create(&path, MeshFormat::Ply, &sphere.header()).unwrap();
        drop(writer);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "earlier");
        sphere.write(&path).unwrap();
        assert!(std::fs::read(&path).unwrap().starts_with(b"ply\n"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mesh.ply");
        // The preliminary file is a device on which there is never any space.
        std::os::unix::fs::symlink("/dev/full", dir.path().join(".mesh.ply.part")).unwrap();
        let sphere = Sample::sphere();
        let mut writer = MeshWriter::create(&path, MeshFormat::Ply, &sphere.header()).unwrap();
        writer.vertices(&sphere.vertices).unwrap();
        writer.triangles(&sphere.triangles).unwrap();
        let error = writer.complete().unwrap_err().to_string();
        assert!(error.contains("No space left"), "{error}");
        assert!(error.contains("nothing is left"), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
