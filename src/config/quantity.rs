//! Counts, sizes and shares as people write them: `2M`, `4GiB`, `2%`.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

/// A number of points: `1500000`, `100K`, `2M`, `1.5G`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Count(pub(crate) u64);

/// A number of bytes: `512MiB`, `4GiB`, `2G` (decimal), `1073741824`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Bytes(pub(crate) u64);

/// A share above 0: `2%`, `0.02`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Share(pub(crate) f64);

/// Reads a number that is followed by one of `units`, each with the factor that it stands for;
/// case does not matter. The product is rounded.
///
/// # Errors
///
/// A text that says how such a quantity is written, with an example.
fn scaled(text: &str, units: &[(&str, f64)], example: &str) -> Result<u64, String> {
    let text = text.trim();
    let end = text
        .find(|c: char| !c.is_ascii_digit() && c != '.' && c != '_')
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let factor = units
        .iter()
        .find(|(name, _)| name.eq_ignore_ascii_case(unit.trim()))
        .map(|(_, factor)| *factor);
    let value = number.replace('_', "").parse::<f64>().ok().zip(factor);
    match value.map(|(number, factor)| (number * factor).round()) {
        Some(value) if (0.0..9.0e18).contains(&value) => Ok(value as u64),
        _ => Err(format!(
            "`{text}` is not understood; write it like {example}"
        )),
    }
}

impl FromStr for Count {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let units = [("", 1.0), ("k", 1e3), ("m", 1e6), ("g", 1e9), ("b", 1e9)];
        scaled(text, &units, "100K or 2M").map(Self)
    }
}

impl FromStr for Bytes {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let units = [
            ("", 1.0),
            ("b", 1.0),
            ("k", 1e3),
            ("kb", 1e3),
            ("m", 1e6),
            ("mb", 1e6),
            ("g", 1e9),
            ("gb", 1e9),
            ("t", 1e12),
            ("tb", 1e12),
            ("kib", 1024.0),
            ("ki", 1024.0),
            ("mib", 1_048_576.0),
            ("mi", 1_048_576.0),
            ("gib", 1_073_741_824.0),
            ("gi", 1_073_741_824.0),
            ("tib", 1_099_511_627_776.0),
            ("ti", 1_099_511_627_776.0),
        ];
        scaled(text, &units, "512MiB or 4GiB").map(Self)
    }
}

impl FromStr for Share {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = match text.trim().strip_suffix('%') {
            Some(number) => (number, 0.01),
            None => (text.trim(), 1.0),
        };
        match number.trim().parse::<f64>() {
            Ok(value) if value > 0.0 && value.is_finite() => Ok(Self(value * unit)),
            _ => Err(format!("`{text}` is not a share; write it like 2% or 0.02")),
        }
    }
}

/// A quantity in a file: a string, or a plain number.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, or a text in quotes")]
enum Written {
    Integer(u64),
    Real(f64),
    Text(String),
}

/// Deserializes a quantity from a string or a plain number.
pub(super) fn read<'de, T: FromStr<Err = String>, D: Deserializer<'de>>(
    from: D,
) -> Result<T, D::Error> {
    let text = match Written::deserialize(from)? {
        Written::Integer(value) => value.to_string(),
        Written::Real(value) => value.to_string(),
        Written::Text(text) => text,
    };
    text.parse().map_err(serde::de::Error::custom)
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        read(from)
    }
}

impl<'de> Deserialize<'de> for Bytes {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        read(from)
    }
}

impl<'de> Deserialize<'de> for Share {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        read(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_read_as_people_write_them() {
        assert_eq!("100K".parse(), Ok(Count(100_000)));
        assert_eq!("1.5M".parse(), Ok(Count(1_500_000)));
        assert_eq!("2_000".parse(), Ok(Count(2000)));
        assert_eq!("512MiB".parse(), Ok(Bytes(512 << 20)));
        assert_eq!("2 GB".parse(), Ok(Bytes(2_000_000_000)));
        assert_eq!("2%".parse(), Ok(Share(0.02)));
    }

    #[test]
    fn text_that_is_no_quantity_is_refused() {
        for bad in [
            "",
            "M",
            "-5",
            "1e5M",
            "NaN",
            "5 apples",
            "99999999999999999999",
        ] {
            assert!(bad.parse::<Count>().is_err(), "{bad}");
            assert!(bad.parse::<Bytes>().is_err(), "{bad}");
        }
        for bad in ["", "0", "-2%", "nan", "inf%"] {
            assert!(bad.parse::<Share>().is_err(), "{bad}");
        }
    }
}
