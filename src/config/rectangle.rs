//! Rectangles as people write them: `xmin,ymin,xmax,ymax`, or as PDAL has them.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A rectangle: west, south, east and north side, in CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sides(pub(crate) [f64; 4]);

impl FromStr for Sides {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> = text
            .split(|c: char| c.is_whitespace() || "([,])".contains(c))
            .filter(|word| !word.is_empty())
            .map(|word| word.parse().ok().filter(|c: &f64| c.is_finite()))
            .collect();
        // PDAL writes the two sides of an axis together.
        let sides = match numbers.as_deref() {
            Some(&[west, east, south, north]) if text.contains('[') => [west, south, east, north],
            Some(&[west, south, east, north]) => [west, south, east, north],
            _ => [0.0, 0.0, -1.0, -1.0],
        };
        match sides[0] <= sides[2] && sides[1] <= sides[3] {
            true => Ok(Self(sides)),
            false => Err(format!(
                "`{text}` is not a rectangle; write it like xmin,ymin,xmax,ymax or \
                 ([xmin,xmax],[ymin,ymax])"
            )),
        }
    }
}

impl Serialize for Sides {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&self.0.map(|c| c.to_string()).join(","))
    }
}

impl<'de> Deserialize<'de> for Sides {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(
            untagged,
            expecting = "a rectangle is four numbers, [xmin, ymin, xmax, ymax], or a text, \"xmin,ymin,xmax,ymax\""
        )]
        enum Written {
            Numbers([f64; 4]),
            Text(String),
        }
        let text = match Written::deserialize(from)? {
            Written::Numbers(sides) => sides.map(|side| side.to_string()).join(","),
            Written::Text(text) => text,
        };
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_is_read_in_both_orders() {
        let sides = Ok(Sides([1.0, -2.5, 3.0, 4.0]));
        assert_eq!("1,-2.5, 3,4".parse(), sides);
        assert_eq!("([1, 3], [-2.5, 4])".parse(), sides);
    }

    #[test]
    fn a_rectangle_in_a_file_is_four_numbers_or_a_text() {
        #[derive(Debug, Deserialize)]
        struct File {
            bounds: Sides,
        }
        let read = |value: &str| toml::from_str::<File>(&format!("bounds = {value}"));
        for value in ["[1, -2.5, 3, 4.0]", "\"1,-2.5,3,4\""] {
            assert_eq!(read(value).unwrap().bounds, Sides([1.0, -2.5, 3.0, 4.0]));
        }
        for bad in ["[1, 2, 3]", "[3, 0, 1, 1]", "[1, 2, 3, 4, 5]", "4"] {
            let error = read(bad).unwrap_err().to_string();
            assert!(error.contains("xmin,ymin,xmax,ymax"), "{bad}: {error}");
        }
    }

    #[test]
    fn text_that_is_no_rectangle_is_refused() {
        for bad in ["1,2,3", "3,0,1,1", "([0,1],[1,0])", "0,0,nan,1"] {
            assert!(bad.parse::<Sides>().is_err(), "{bad}");
        }
    }
}
