//! The coordinate reference system, as files say it: WKT text or GeoTIFF keys.
//!
//! LAS 1.4 with formats 6 to 8 wants WKT. Where an input has GeoTIFF keys with
//! EPSG codes, the text of the code is written; where it has keys that name no
//! code, the keys are kept as they are.

use ::las::Vlr;
use serde::{Deserialize, Serialize};

/// A coordinate reference system.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Crs {
    /// Well-known text.
    Wkt(String),
    /// GeoTIFF keys, of which these are codes of the EPSG registry.
    GeoTiff {
        /// Horizontal system.
        horizontal: Option<u16>,
        /// Vertical system.
        vertical: Option<u16>,
        /// The records as found: record number and content.
        records: Vec<(u16, Vec<u8>)>,
        /// Whether the keys say degrees.
        is_geographic: bool,
    },
}

const PROJECTION: &str = "LASF_Projection";
const WKT_RECORD: u16 = 2112;
/// Number of the GeoTIFF record that a code below 1024 or above 32766 is no
/// code: undefined, or user-defined.
const CODES: std::ops::RangeInclusive<u16> = 1024..=32_766;

impl Crs {
    /// The system that the variable length records of a file state, WKT before
    /// GeoTIFF; `None` if they state none.
    pub(crate) fn from_vlrs<'a>(vlrs: impl Iterator<Item = &'a Vlr> + Clone) -> Option<Self> {
        let projection = vlrs.filter(|vlr| vlr.user_id == PROJECTION);
        let wkt = projection
            .clone()
            .find(|vlr| vlr.record_id == WKT_RECORD)
            .map(|vlr| {
                String::from_utf8_lossy(&vlr.data)
                    .trim_matches(['\0', ' ', '\n', '\r', '\t'])
                    .to_owned()
            })
            .filter(|text| !text.is_empty());
        if let Some(text) = wkt {
            return Some(Self::Wkt(text));
        }
        let records: Vec<(u16, Vec<u8>)> = projection
            .filter(|vlr| (34_735..=34_737).contains(&vlr.record_id))
            .map(|vlr| (vlr.record_id, vlr.data.clone()))
            .collect();
        let (_, keys) = records.iter().find(|(id, _)| *id == 34_735)?;
        let key = |wanted: u16| geo_key(keys, wanted);
        let code = |wanted: u16| key(wanted).filter(|code| CODES.contains(code));
        // Model type, geodetic, projected and vertical system.
        let (model, geodetic, projected, vertical) =
            (key(1024), code(2048), code(3072), code(4096));
        if model.is_none() && geodetic.is_none() && projected.is_none() {
            return None;
        }
        let is_geographic = model == Some(2) || projected.is_none() && geodetic.is_some();
        Some(Self::GeoTiff {
            horizontal: projected.or(geodetic.filter(|_| is_geographic)),
            vertical,
            records,
            is_geographic,
        })
    }

    /// The system of an EPSG code, if its text is known.
    pub(crate) fn of_epsg(code: u16) -> Option<Self> {
        crs_definitions::from_code(code).map(|found| Self::Wkt(found.wkt.to_owned()))
    }

    /// Whether coordinates are degrees: a spacing would mean nothing.
    pub(crate) fn is_geographic(&self) -> bool {
        match self {
            Self::Wkt(text) => {
                let head = text.trim_start().to_ascii_uppercase();
                let is_degrees = |text: &str| {
                    ["GEOGCS[", "GEOGCRS[", "GEODCRS[", "GEOGRAPHICCRS["]
                        .iter()
                        .any(|root| text.starts_with(root))
                };
                let compound = head
                    .strip_prefix("COMPD_CS[")
                    .or_else(|| head.strip_prefix("COMPOUNDCRS["));
                match compound {
                    // The horizontal part follows the name.
                    Some(rest) => rest
                        .split_once(',')
                        .is_some_and(|(_, horizontal)| is_degrees(horizontal.trim_start())),
                    None => is_degrees(&head),
                }
            }
            Self::GeoTiff { is_geographic, .. } => *is_geographic,
        }
    }

    /// Metres to a unit of its horizontal coordinates; `None` if it does not say.
    pub(crate) fn metres_per_unit(&self) -> Option<f64> {
        if let Self::GeoTiff { records, .. } = self
            && let Some((_, keys)) = records.iter().find(|(id, _)| *id == 34_735)
        {
            // The linear unit of a projected system.
            match geo_key(keys, 3076) {
                Some(9001) => return Some(1.0),
                Some(9002) => return Some(0.3048),
                Some(9003) => return Some(1200.0 / 3937.0),
                _ => {}
            }
        }
        unit_of_text(&self.wkt()?)
    }

    /// Whether both mean the same, as far as their texts or codes tell.
    pub(crate) fn same_as(&self, other: &Self) -> bool {
        match (self.wkt(), other.wkt()) {
            (Some(one), Some(other)) => {
                let bare = |text: &str| text.split_whitespace().collect::<String>();
                bare(&one) == bare(&other)
                    || self.epsg().is_some() && self.epsg() == epsg_of_text(&other)
            }
            _ => self == other,
        }
    }

    /// Codes of the EPSG registry: horizontal and vertical, where they are
    /// stated.
    fn epsg(&self) -> Option<(u16, Option<u16>)> {
        match self {
            Self::Wkt(text) => epsg_of_text(text),
            Self::GeoTiff {
                horizontal,
                vertical,
                ..
            } => horizontal.map(|code| (code, *vertical)),
        }
    }

    /// A short name for tables: the code, or the name in the text.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Wkt(text) => text.split('"').nth(1).unwrap_or("unnamed").to_owned(),
            Self::GeoTiff {
                horizontal: Some(code),
                ..
            } => format!("EPSG:{code}"),
            Self::GeoTiff { .. } => "GeoTIFF keys without a code".to_owned(),
        }
    }

    /// The well-known text: as found, or of the EPSG codes; `None` if the keys
    /// name no code.
    pub(crate) fn wkt(&self) -> Option<String> {
        let text = |code: u16| crs_definitions::from_code(code).map(|found| found.wkt);
        match self {
            Self::Wkt(text) => Some(text.clone()),
            Self::GeoTiff {
                horizontal,
                vertical,
                ..
            } => {
                let code = (*horizontal)?;
                let horizontal = text(code)?;
                // Vertical systems are not in every table of codes; without
                // its text the code alone would not be valid.
                Some(match vertical.and_then(text) {
                    Some(vertical) => {
                        format!("COMPD_CS[\"EPSG:{code} + height\",{horizontal},{vertical}]")
                    }
                    None => horizontal.to_owned(),
                })
            }
        }
    }

    /// The records to write: WKT where there is any, else the GeoTIFF keys.
    pub(crate) fn vlrs(&self) -> Vec<Vlr> {
        let vlr = |record_id, description: &str, data| Vlr {
            user_id: PROJECTION.to_owned(),
            record_id,
            description: description.to_owned(),
            data,
        };
        match (self.wkt(), self) {
            (Some(text), _) => {
                let mut data = text.into_bytes();
                data.push(0);
                vec![vlr(WKT_RECORD, "OGC WKT", data)]
            }
            (None, Self::GeoTiff { records, .. }) => records
                .iter()
                .map(|(id, data)| vlr(*id, "GeoTIFF", data.clone()))
                .collect(),
            (None, Self::Wkt(_)) => Vec::new(),
        }
    }
}

/// Metres to a unit of the projected system in `text`, in WKT 1 or 2: the first unit of
/// length that is not of the system beneath, nor of a parameter.
fn unit_of_text(text: &str) -> Option<f64> {
    let mut names: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut is_quoted = false;
    for (at, c) in text.char_indices() {
        match c {
            '"' => is_quoted = !is_quoted,
            _ if is_quoted => {}
            '[' | '(' => {
                let name = std::mem::take(&mut word).to_ascii_uppercase();
                let is_projected = |name: &String| name == "PROJCS" || name == "PROJCRS";
                let is_beneath = |name: &String| {
                    name.contains("GEO") || name == "CONVERSION" || name == "PARAMETER"
                };
                if (name == "UNIT" || name == "LENGTHUNIT")
                    && names.iter().any(is_projected)
                    && !names.iter().any(is_beneath)
                {
                    let rest = text[at..].splitn(3, '"').nth(2)?;
                    let number = rest.trim_start_matches([',', ' ']);
                    let end = number.find([',', ']', ')'])?;
                    return number[..end].trim().parse().ok();
                }
                names.push(name);
            }
            ']' | ')' => {
                names.pop();
                word.clear();
            }
            _ if c.is_alphanumeric() => word.push(c),
            _ => word.clear(),
        }
    }
    None
}

/// The outermost authority codes of a WKT 1 text.
fn epsg_of_text(text: &str) -> Option<(u16, Option<u16>)> {
    let code = |part: &str| -> Option<u16> {
        let start = part.rfind("AUTHORITY[\"EPSG\",\"")? + "AUTHORITY[\"EPSG\",\"".len();
        part[start..].split('"').next()?.parse().ok()
    };
    let upper = text.trim_start();
    if upper.starts_with("COMPD_CS[") {
        let vertical = upper.find("VERT_CS[")?;
        // The code of the compound system itself may stand last.
        let end = upper[vertical..]
            .rfind("],AUTHORITY")
            .map_or(upper.len(), |e| vertical + e);
        return Some((code(&upper[..vertical])?, code(&upper[vertical..end])));
    }
    code(upper).map(|code| (code, None))
}

/// The value of a key that is held in the directory itself.
fn geo_key(directory: &[u8], wanted: u16) -> Option<u16> {
    let words: Vec<u16> = directory
        .chunks_exact(2)
        .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
        .collect();
    words
        .chunks_exact(4)
        .skip(1)
        .find(|entry| entry[0] == wanted && entry[1] == 0)
        .map(|entry| entry[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(entries: &[(u16, u16)]) -> Vlr {
        let mut words = vec![1, 1, 0, entries.len() as u16];
        for &(key, value) in entries {
            words.extend([key, 0, 1, value]);
        }
        Vlr {
            user_id: PROJECTION.into(),
            record_id: 34_735,
            description: String::new(),
            data: words.iter().flat_map(|w: &u16| w.to_le_bytes()).collect(),
        }
    }

    #[test]
    fn projected_keys_become_the_text_of_their_code() {
        let vlr = keys(&[(1024, 1), (3072, 32_633)]);
        let crs = Crs::from_vlrs([&vlr].into_iter()).unwrap();
        assert!(crs.wkt().unwrap().contains("UTM zone 33N"));
        assert!(!crs.is_geographic());
        let text = Crs::Wkt(crs.wkt().unwrap());
        assert!(crs.same_as(&text) && text.same_as(&crs));
    }

    #[test]
    fn degrees_are_recognised_in_keys_and_text() {
        let vlr = keys(&[(1024, 2), (2048, 4326)]);
        assert!(Crs::from_vlrs([&vlr].into_iter()).unwrap().is_geographic());
        let compound = Crs::Wkt("COMPD_CS[\"a\",GEOGCS[\"WGS 84\"],VERT_CS[\"h\"]]".into());
        assert!(compound.is_geographic());
        let projected = Crs::Wkt("PROJCS[\"a\",GEOGCS[\"WGS 84\"]]".into());
        assert!(!projected.is_geographic());
    }

    #[test]
    fn the_unit_is_that_of_the_projection() {
        let of = |text: &str| Crs::Wkt(text.to_owned()).metres_per_unit();
        let old = "COMPD_CS[\"a, b\",PROJCS[\"x [ft]\",GEOGCS[\"g\",UNIT[\"degree\",0.0174]],\
            PROJECTION[\"p\"],PARAMETER[\"q\",1],UNIT[\"US survey foot\", 0.3048006096,\
            AUTHORITY[\"EPSG\",\"9003\"]]],VERT_CS[\"h\",UNIT[\"metre\",1]]]";
        assert_eq!(of(old), Some(0.304_800_609_6));
        let new = "PROJCRS[\"x\",BASEGEOGCRS[\"g\",DATUM[\"d\",ELLIPSOID[\"e\",1,2,\
            LENGTHUNIT[\"metre\",1]]]],CONVERSION[\"c\",PARAMETER[\"q\",1,\
            LENGTHUNIT[\"metre\",1]]],CS[Cartesian,2],AXIS[\"E\",east,\
            LENGTHUNIT[\"foot\",0.3048]]]";
        assert_eq!(of(new), Some(0.3048));
        assert_eq!(of("GEOGCS[\"g\",UNIT[\"degree\",0.0174]]"), None);
        assert_eq!(of("PROJCS[\"cut"), None);
        let keys = Crs::from_vlrs([&keys(&[(1024, 1), (3072, 2994)])].into_iter()).unwrap();
        assert_eq!(keys.metres_per_unit(), Some(0.3048));
    }

    #[test]
    fn different_zones_differ() {
        let zone = |code| Crs::from_vlrs([&keys(&[(1024, 1), (3072, code)])].into_iter()).unwrap();
        assert!(zone(32_632).same_as(&zone(32_632)));
        assert!(!zone(32_632).same_as(&zone(32_633)));
    }

    #[test]
    fn cut_or_empty_keys_are_no_system() {
        let mut vlr = keys(&[(1024, 1), (3072, 32_633)]);
        vlr.data.truncate(7);
        assert_eq!(Crs::from_vlrs([&vlr].into_iter()), None);
        vlr.data.clear();
        assert_eq!(Crs::from_vlrs([&vlr].into_iter()), None);
    }
}
