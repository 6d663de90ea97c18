//! Quantities as people write them: `2M`, `4GiB`, `2%`, `5cm`.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number of points: `1500000`, `100K`, `2M`, `1.5G`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Count(pub(crate) u64);

/// A number of bytes: `512MiB`, `4GiB`, `2G` (decimal), `1073741824`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Bytes(pub(crate) u64);

/// A share above 0: `2%`, `0.02`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Share(pub(crate) f64);

/// A length: in units of the CRS if it has none of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Length {
    /// How many of the unit.
    pub(crate) value: f64,
    /// The unit.
    pub(crate) unit: Option<Unit>,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// `mm`
    Millimetre,
    /// `cm`
    Centimetre,
    /// `m`
    Metre,
    /// `in`
    Inch,
    /// `ft`: the international foot.
    Foot,
    /// `us-ft`: the foot of the U.S. survey.
    SurveyFoot,
}

impl Unit {
    const ALL: [Self; 6] = [
        Self::Millimetre,
        Self::Centimetre,
        Self::Metre,
        Self::Inch,
        Self::Foot,
        Self::SurveyFoot,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
            Self::Inch => "in",
            Self::Foot => "ft",
            Self::SurveyFoot => "us-ft",
        }
    }

    /// Its length in metres.
    pub(crate) fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 0.001,
            Self::Centimetre => 0.01,
            Self::Metre => 1.0,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
            Self::SurveyFoot => 1200.0 / 3937.0,
        }
    }
}

impl Length {
    /// A length in units of the CRS.
    pub(crate) fn plain(value: f64) -> Self {
        Self { value, unit: None }
    }
}

impl FromStr for Length {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        // The longest name that fits: `m` ends `mm` and `cm`, too. What is left must be
        // a number, so that `inf` is no number of feet.
        let of_unit = |unit: Unit| {
            let number = text.strip_suffix(unit.name())?.trim_end();
            let is_number = number.ends_with(|c: char| c.is_ascii_digit() || c == '.');
            is_number.then_some((number, Some(unit)))
        };
        let (number, unit) = Unit::ALL
            .into_iter()
            .find_map(of_unit)
            .unwrap_or((text, None));
        let value = number.parse().map_err(|_| {
            format!("`{text}` is no length; write it like 0.05 (in CRS units), 5cm or 0.2ft")
        })?;
        Ok(Self { value, unit })
    }
}

impl std::fmt::Display for Length {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.value, self.unit.map_or("", Unit::name))
    }
}

impl Serialize for Length {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.unit {
            None => to.serialize_f64(self.value),
            Some(_) => to.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        read(from)
    }
}

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
        // PDAL's way has the sides of each axis together.
        let sides = match numbers.as_deref() {
            Some(&[west, east, south, north]) if text.contains('[') => [west, south, east, north],
            Some(&[west, south, east, north]) => [west, south, east, north],
            _ => [0.0, 0.0, -1.0, -1.0],
        };
        match sides[0] <= sides[2] && sides[1] <= sides[3] {
            true => Ok(Self(sides)),
            false => Err(format!(
                "`{text}` is no rectangle; write it like xmin,ymin,xmax,ymax or \
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
        read(from)
    }
}

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
            _ => Err(format!("`{text}` is no share; write it like 2% or 0.02")),
        }
    }
}

/// In a file a quantity is a string, or a plain number.
#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Integer(u64),
    Real(f64),
    Text(String),
}

fn read<'de, T: FromStr<Err = String>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
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
        for (text, value, unit) in [
            ("0.05", 0.05, None),
            ("5cm", 5.0, Some(Unit::Centimetre)),
            ("5 mm", 5.0, Some(Unit::Millimetre)),
            (".2us-ft", 0.2, Some(Unit::SurveyFoot)),
            ("0.2ft", 0.2, Some(Unit::Foot)),
            ("1e-2m", 0.01, Some(Unit::Metre)),
        ] {
            assert_eq!(text.parse(), Ok(Length { value, unit }), "{text}");
        }
        let sides = Ok(Sides([1.0, -2.5, 3.0, 4.0]));
        assert_eq!("1,-2.5, 3,4".parse(), sides);
        assert_eq!("([1, 3], [-2.5, 4])".parse(), sides);
    }

    #[test]
    fn what_is_no_quantity_is_refused() {
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
        for bad in ["", "m", "5 miles", "cm5", "0.2 ft ft"] {
            assert!(bad.parse::<Length>().is_err(), "{bad}");
        }
        for bad in ["1,2,3", "3,0,1,1", "([0,1],[1,0])", "0,0,nan,1"] {
            assert!(bad.parse::<Sides>().is_err(), "{bad}");
        }
    }
}
