//! Lengths as people write them: `0.05`, `5cm`, `0.2ft`.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::quantity::read;

/// A length. It is in CRS units if it has no unit of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Length {
    /// The number of units.
    pub(crate) value: f64,
    /// The unit; `None` stands for that of the CRS.
    pub(crate) unit: Option<Unit>,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A millimetre: `mm`.
    Millimetre,
    /// A centimetre: `cm`.
    Centimetre,
    /// A metre: `m`.
    Metre,
    /// An inch: `in`.
    Inch,
    /// The international foot: `ft`.
    Foot,
    /// The U.S. survey foot: `us-ft`.
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

    /// Returns the length of the unit in metres.
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
    /// Returns a length in CRS units.
    pub(crate) fn plain(value: f64) -> Self {
        Self { value, unit: None }
    }
}

impl FromStr for Length {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        // `mm` and `cm` end with `m`, too, and stand before it in the list. The rest must end
        // like a number, so that no unit is cut off the end of another word.
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
            format!("`{text}` is not a length; write it like 0.05 (in CRS units), 5cm or 0.2ft")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_read_with_and_without_a_unit() {
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
    }

    #[test]
    fn text_that_is_no_length_is_refused() {
        for bad in ["", "m", "5 miles", "cm5", "0.2 ft ft"] {
            assert!(bad.parse::<Length>().is_err(), "{bad}");
        }
    }
}
