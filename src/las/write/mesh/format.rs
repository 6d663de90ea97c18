//! The formats in which meshes are written, by the names of files.

use std::path::Path;

use crate::las::error::LasError;

/// The format of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MeshFormat {
    /// Polygon file format, binary, little endian.
    Ply,
    /// Wavefront OBJ, text.
    Obj,
    /// Binary glTF 2.0.
    Glb,
}

impl MeshFormat {
    /// The format that the ending of `path` stands for, in either case of letters.
    ///
    /// # Errors
    ///
    /// If the ending stands for no format in which meshes are written.
    pub(crate) fn of_path(path: &Path) -> Result<Self, LasError> {
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(e) if e == "ply" => Ok(Self::Ply),
            Some(e) if e == "obj" => Ok(Self::Obj),
            Some(e) if e == "glb" => Ok(Self::Glb),
            _ => Err(LasError::new(
                path,
                "name the mesh .ply, .obj or .glb; with --output-tiles also without an ending, for a directory \
                 of tiles",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_decides_and_others_are_refused_with_those_that_are_possible() {
        let of = |name: &str| MeshFormat::of_path(Path::new(name));
        assert_eq!(of("a/roof.PLY").unwrap(), MeshFormat::Ply);
        assert_eq!(of("roof.v2.obj").unwrap(), MeshFormat::Obj);
        assert_eq!(of("roof.glb").unwrap(), MeshFormat::Glb);
        for name in ["roof.gltf", "roof", ".ply"] {
            let error = of(name).unwrap_err().to_string();
            assert!(error.contains(".ply, .obj or .glb"), "{error}");
        }
    }
}
