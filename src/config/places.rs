//! Places in space as people write them: `x,y,z`, several separated by semicolons.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::quantity::read;

/// Places in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Places(pub(crate) Vec<[f64; 3]>);

impl FromStr for Places {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let place = |text: &str| -> Option<[f64; 3]> {
            let coordinate = |word: &str| word.trim().parse().ok().filter(|c: &f64| c.is_finite());
            let coordinates: Option<Vec<f64>> = text.split(',').map(coordinate).collect();
            coordinates?.try_into().ok()
        };
        let places: Option<Vec<[f64; 3]>> = text.split(';').map(place).collect();
        let places = places.ok_or_else(|| {
            format!("`{text}` is not a place; write it like x,y,z, and several like x,y,z;x,y,z")
        })?;
        Ok(Self(places))
    }
}

impl Serialize for Places {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let place = |[x, y, z]: &[f64; 3]| format!("{x},{y},{z}");
        let places: Vec<String> = self.0.iter().map(place).collect();
        to.serialize_str(&places.join(";"))
    }
}

impl<'de> Deserialize<'de> for Places {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        read(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_as_they_are_written() {
        let places = Places(vec![[1.0, -2.5, 3.0], [0.0, 0.0, 1e6]]);
        assert_eq!("1,-2.5, 3;0,0,1e6".parse(), Ok(places.clone()));
        let text = toml::Value::try_from(&places).unwrap();
        assert_eq!(text.as_str(), Some("1,-2.5,3;0,0,1000000"));
    }

    #[test]
    fn text_that_is_no_place_is_refused() {
        for bad in ["", "1,2", "1,2,3,4", "1,2,nan", "1,2,3;"] {
            assert!(bad.parse::<Places>().is_err(), "{bad}");
        }
    }
}
