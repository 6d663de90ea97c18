//! The files that a command reads, as arguments or from a list.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::{
    las::{LasError, read_list},
    store::without_secrets,
};

/// Files, directories and patterns, and a file that lists more of them.
#[derive(Args)]
pub(super) struct Inputs {
    /// LAS, LAZ, COPC and PLY files, directories of LAS and LAZ, patterns, catalogues (.vpc); also at https://, s3://,
    /// gs:// and az://
    #[arg(required_unless_present = "from_list", value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// A text file that names further inputs: a file, directory or pattern a line, relative to
    /// the working directory; lines that begin with # are comments; - is standard input
    #[arg(long, value_name = "FILE", visible_alias = "input-file-list")]
    from_list: Option<PathBuf>,
}

/// The name of an output for which no better one is known.
pub(super) const DEFAULT_OUTPUT: &str = "resampled.copc.laz";
/// The ending of the name that an output gets by its input.
const OUTPUT_ENDING: &str = ".even.copc.laz";

impl Inputs {
    /// Returns the inputs as they were given, with those of the list.
    ///
    /// # Errors
    ///
    /// If the list cannot be read. Standard input can be read once only.
    pub(super) fn paths(&self) -> Result<Vec<PathBuf>, LasError> {
        let mut paths = self.inputs.clone();
        if let Some(list) = &self.from_list {
            paths.extend(read_list(list)?);
        }
        Ok(paths)
    }

    /// Returns the inputs that were given as arguments.
    pub(super) fn arguments(&self) -> &[PathBuf] {
        &self.inputs
    }

    /// Returns the file that lists inputs, if there is one.
    pub(super) fn list(&self) -> Option<&Path> {
        self.from_list.as_deref()
    }

    /// Returns the name of the output for inputs without one: that of the only file or directory, in the working directory, else
    /// a fixed name.
    pub(super) fn default_output(&self) -> PathBuf {
        match (self.inputs.as_slice(), &self.from_list) {
            ([input], None) => output_of(input),
            _ => None,
        }
        .unwrap_or_else(|| DEFAULT_OUTPUT.into())
    }
}

/// Returns the name of the output for the only `input`; `None` for patterns, and paths without a name. What is there is a file or
/// directory, and no pattern.
fn output_of(input: &Path) -> Option<PathBuf> {
    let input = &without_secrets(input);
    let name = input.file_name()?.to_str()?;
    if name.contains(['*', '?', '[']) && !input.exists() {
        return None;
    }
    let stem = match name.to_ascii_lowercase() {
        lower if lower.ends_with(".copc.laz") => &name[..name.len() - ".copc.laz".len()],
        _ if input.is_dir() => name,
        _ => input.file_stem()?.to_str()?,
    };
    Some(format!("{stem}{OUTPUT_ENDING}").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_named_after_its_only_input() {
        let named = |input: &str| output_of(Path::new(input));
        let expected = |name: &str| Some(PathBuf::from(name));
        assert_eq!(named("scans/a.b.laz"), expected("a.b.even.copc.laz"));
        assert_eq!(named("x.COPC.laz"), expected("x.even.copc.laz"));
        assert_eq!(named("cloud.ply"), expected("cloud.even.copc.laz"));
        assert_eq!(named("city/*.laz"), None);
        assert_eq!(
            named("https://u:p@host/a.laz?key=1"),
            expected("a.even.copc.laz")
        );
        assert_eq!(named(".."), None);
        let dir = tempfile::tempdir().unwrap();
        let scans = dir.path().join("city.2026");
        std::fs::create_dir(&scans).unwrap();
        assert_eq!(output_of(&scans), expected("city.2026.even.copc.laz"));
        // What is there is a file, whatever its name could stand for.
        let numbered = dir.path().join("scan[1].laz");
        assert_eq!(output_of(&numbered), None);
        std::fs::write(&numbered, "").unwrap();
        assert_eq!(output_of(&numbered), expected("scan[1].even.copc.laz"));
    }
}
