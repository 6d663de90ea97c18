//! The CRS that inputs are reprojected to, as people write it.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The CRS that inputs are reprojected to: `auto` or `EPSG:32633`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(crate) enum ReprojectionTarget {
    /// The UTM zone of the middle of all inputs, on the datum of the first.
    Auto,
    /// The system of an EPSG code.
    Epsg(u16),
}

impl FromStr for ReprojectionTarget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim().to_ascii_uppercase();
        if text == "AUTO" {
            return Ok(Self::Auto);
        }
        let code = text
            .strip_prefix("EPSG:")
            .and_then(|code| code.parse().ok());
        code.map(Self::Epsg)
            .ok_or_else(|| format!("`{text}` is no CRS; write it like EPSG:32633, or auto"))
    }
}

impl TryFrom<String> for ReprojectionTarget {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<ReprojectionTarget> for String {
    fn from(target: ReprojectionTarget) -> Self {
        match target {
            ReprojectionTarget::Auto => "auto".to_owned(),
            ReprojectionTarget::Epsg(code) => format!("EPSG:{code}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_read_as_it_is_written() {
        for text in ["auto", "EPSG:32633"] {
            let target: ReprojectionTarget = text.parse().unwrap();
            assert_eq!(String::from(target), text);
        }
        assert_eq!("epsg:2154".parse(), Ok(ReprojectionTarget::Epsg(2154)));
        for bad in ["", "32633", "EPSG:", "EPSG:99999", "utm33"] {
            assert!(bad.parse::<ReprojectionTarget>().is_err(), "{bad}");
        }
    }
}
