//! Lists of inputs: one file, directory or pattern a line.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use crate::las::error::LasError;

/// Reads the inputs that the text file `list` names, or standard input if `list` is `-`: one file, directory or pattern a
/// line, as they are written as arguments, so that relative ones are relative to the working directory. Empty
/// lines and lines that begin with `#` are left out.
///
/// # Errors
///
/// If the file cannot be read, is no text, or names no input.
pub(crate) fn read_list(list: &Path) -> Result<Vec<PathBuf>, LasError> {
    let read = match list == Path::new("-") {
        true => {
            let mut text = String::new();
            std::io::stdin().read_to_string(&mut text).map(|_| text)
        }
        false => std::fs::read_to_string(list),
    };
    let inputs = inputs_in(&read.map_err(|error| LasError::unreadable(list, error))?);
    if inputs.is_empty() {
        let problem = "the list names no input; write one file, directory or pattern a line";
        return Err(LasError::new(list, problem));
    }
    Ok(inputs)
}

/// The inputs that the lines of `text` name.
fn inputs_in(text: &str) -> Vec<PathBuf> {
    // Programs of Windows put a mark before the first line.
    let lines = text.trim_start_matches('\u{feff}').lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(PathBuf::from)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_an_input_a_line_and_comments() {
        let text = "\u{feff}# scans\r\na b.laz\r\n\n  city/*.laz\n #c.laz\n./#d.laz";
        let inputs = ["a b.laz", "city/*.laz", "./#d.laz"].map(PathBuf::from);
        assert_eq!(inputs_in(text), inputs);
    }

    #[test]
    fn a_list_that_names_nothing_is_refused_with_its_name() {
        let dir = tempfile::tempdir().unwrap();
        let list = dir.path().join("scans.txt");
        assert!(
            read_list(&list)
                .unwrap_err()
                .to_string()
                .contains("scans.txt")
        );
        std::fs::write(&list, "# none\n").unwrap();
        let error = read_list(&list).unwrap_err().to_string();
        assert!(
            error.contains("scans.txt: the list names no input"),
            "{error}"
        );
        std::fs::write(&list, [0xff, 0xfe, b'a', 0]).unwrap();
        assert!(
            read_list(&list)
                .unwrap_err()
                .to_string()
                .contains("cannot be read")
        );
    }
}
