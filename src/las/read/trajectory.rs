//! The way of a moving scanner: a table of times and places.

use std::path::Path;

use crate::las::error::LasError;

/// Where the scanner was at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Waypoint {
    /// The GPS time, in seconds as the points have them.
    pub(crate) time: f64,
    /// The place in world coordinates.
    pub(crate) place: [f64; 3],
}

/// The names that the column of each number can have, in lower case.
const COLUMNS: [&[&str]; 4] = [
    &["time", "gps_time", "gpstime", "t", "timestamp"],
    &["x", "easting", "east"],
    &["y", "northing", "north"],
    &["z", "height", "altitude", "elevation"],
];

/// Reads the way of a scanner from a text file: a line for each time, with time, x, y and z between commas, semicolons
/// or spaces. A first line of names may give them another order; lines that begin with # are left out. The
/// result is in the order of the times.
///
/// # Errors
///
/// [`LasError`] if the file cannot be read, with the number of the line if one has no four numbers.
pub(crate) fn read_trajectory(path: &Path) -> Result<Vec<Waypoint>, LasError> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| LasError::new(path, format!("cannot be read as a trajectory: {e}")))?;
    let mut order = [0, 1, 2, 3];
    let mut waypoints = Vec::new();
    let lines = (1..).zip(text.lines().map(str::trim));
    let mut lines = lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .peekable();
    if let Some(&(_, first)) = lines.peek()
        && let Some(named) = order_of(first)
    {
        order = named;
        lines.next();
    }
    for (number, line) in lines {
        let words: Vec<&str> = words(line).collect();
        let numbers = order.map(|k| words.get(k).and_then(|word| word.parse().ok()));
        let is_finite = |number: &f64| number.is_finite();
        let [Some(time), Some(x), Some(y), Some(z)] =
            numbers.map(|n: Option<f64>| n.filter(is_finite))
        else {
            return Err(LasError::new(
                path,
                format!("line {number} is `{line}`; a trajectory has time,x,y,z in every line"),
            ));
        };
        waypoints.push(Waypoint {
            time,
            place: [x, y, z],
        });
    }
    if waypoints.is_empty() {
        return Err(LasError::new(
            path,
            "contains no time and place; a trajectory has time,x,y,z",
        ));
    }
    waypoints.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(waypoints)
}

/// The columns of time, x, y and z, if `line` names them.
fn order_of(line: &str) -> Option<[usize; 4]> {
    let names: Vec<String> = words(line).map(str::to_ascii_lowercase).collect();
    let column = |known: &&[&str]| names.iter().position(|name| known.contains(&name.as_str()));
    let columns: Option<Vec<usize>> = COLUMNS.iter().map(column).collect();
    columns?.try_into().ok()
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| c == ',' || c == ';' || c.is_whitespace())
        .map(|word| word.trim_matches('"'))
        .filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Waypoint>, LasError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read_trajectory(file.path())
    }

    #[test]
    fn a_trajectory_is_read_in_any_order_of_columns_and_times() {
        let way = [(1.0, [10.0, 20.0, 2.0]), (2.5, [11.0, 20.0, 2.0])];
        let way = way.map(|(time, place)| Waypoint { time, place });
        assert_eq!(read("1,10,20,2\n2.5, 11, 20, 2\n").unwrap(), way);
        assert_eq!(
            read("# made by hand\n2.5 11 20 2\n\n1 10 20 2").unwrap(),
            way
        );
        let named = "\"X\";Y;Z;roll;gps_time\n10;20;2;0.1;1\n11;20;2;0.2;2.5";
        assert_eq!(read(named).unwrap(), way);
    }

    #[test]
    fn a_line_without_four_numbers_is_named() {
        let error = read("time,x,y,z\n1,2,3,4\n1,2,nan,4")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 3") && error.contains("1,2,nan,4"),
            "{error}"
        );
        assert!(
            read("time,x,y,z\n")
                .unwrap_err()
                .to_string()
                .contains("no time")
        );
    }
}
