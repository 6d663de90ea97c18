//! The coordinate reference system as files state it: WKT or GeoTIFF keys.
//!
//! LAS 1.4 with formats 6 to 8 requires WKT. Where an input has GeoTIFF keys with
//! EPSG codes, the text of the code is written; where its keys name no code, the keys are
//! written as they are.

use ::las::Vlr;
use serde::{Deserialize, Serialize};

use super::{
    geotiff,
    vertical::{VerticalSystem, horizontal_part, vertical_part},
    wkt,
    wkt_node::WktNode,
};

/// A coordinate reference system.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Crs {
    /// Well-known text.
    Wkt(String),
    /// GeoTIFF keys, and what they say.
    GeoTiff {
        /// The EPSG code of the horizontal system, if the keys name one.
        horizontal: Option<u16>,
        /// The EPSG code of the vertical system, if the keys name one.
        vertical: Option<u16>,
        /// The records as found: record number and content.
        records: Vec<(u16, Vec<u8>)>,
        /// Whether the coordinates are degrees.
        is_geographic: bool,
    },
}

/// The user of all records that state a coordinate reference system.
const PROJECTION_USER: &str = "LASF_Projection";
/// The number of the record that has well-known text.
const WKT_RECORD: u16 = 2112;

impl Crs {
    /// The system that the variable length records of a file state, WKT before
    /// GeoTIFF; `None` if they state none.
    pub(crate) fn from_vlrs<'a>(vlrs: impl Iterator<Item = &'a Vlr> + Clone) -> Option<Self> {
        let projection = vlrs.filter(|vlr| vlr.user_id == PROJECTION_USER);
        let text = projection
            .clone()
            .find(|vlr| vlr.record_id == WKT_RECORD)
            .map(|vlr| {
                String::from_utf8_lossy(&vlr.data)
                    .trim_matches(['\0', ' ', '\n', '\r', '\t'])
                    .to_owned()
            })
            .filter(|text| !text.is_empty());
        if let Some(text) = text {
            return Some(Self::Wkt(text));
        }
        Self::from_geotiff(
            projection
                .filter(|vlr| geotiff::KEY_RECORDS.contains(&vlr.record_id))
                .map(|vlr| (vlr.record_id, vlr.data.clone()))
                .collect(),
        )
    }

    /// The system that records of GeoTIFF keys state; `None` if they state none.
    fn from_geotiff(records: Vec<(u16, Vec<u8>)>) -> Option<Self> {
        let directory = directory_of(&records)?;
        let model = geotiff::value_of_key(directory, geotiff::MODEL_TYPE);
        let code = |key: u16| geotiff::code_of_key(directory, key);
        let geodetic = code(geotiff::GEODETIC_SYSTEM);
        let projected = code(geotiff::PROJECTED_SYSTEM);
        let vertical = code(geotiff::VERTICAL_SYSTEM);
        if model.is_none() && geodetic.is_none() && projected.is_none() {
            return None;
        }
        let is_geographic =
            model == Some(geotiff::GEOGRAPHIC_MODEL) || projected.is_none() && geodetic.is_some();
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

    /// Whether coordinates are degrees, so that no spacing can be given in them.
    pub(crate) fn is_geographic(&self) -> bool {
        match self {
            Self::Wkt(text) => wkt::is_geographic(text),
            Self::GeoTiff { is_geographic, .. } => *is_geographic,
        }
    }

    /// Metres to a unit of the horizontal coordinates; `None` if the system does not say.
    pub(crate) fn metres_per_unit(&self) -> Option<f64> {
        if let Self::GeoTiff { records, .. } = self
            && let Some(metres) = directory_of(records).and_then(geotiff::metres_per_linear_unit)
        {
            return Some(metres);
        }
        wkt::metres_per_unit(&self.wkt()?)
    }

    /// Whether both are one system, as far as their texts or codes say.
    pub(crate) fn same_as(&self, other: &Self) -> bool {
        match (self.wkt(), other.wkt()) {
            (Some(one), Some(other)) => {
                let bare = |text: &str| text.split_whitespace().collect::<String>();
                bare(&one) == bare(&other)
                    || self.epsg().is_some() && self.epsg() == wkt::epsg_codes(&other)
            }
            _ => self == other,
        }
    }

    /// The horizontal and the vertical EPSG code, where they are stated.
    fn epsg(&self) -> Option<(u16, Option<u16>)> {
        match self {
            Self::Wkt(text) => wkt::epsg_codes(text),
            Self::GeoTiff {
                horizontal,
                vertical,
                ..
            } => horizontal.map(|code| (code, *vertical)),
        }
    }

    /// The EPSG code of the horizontal system, if it is stated.
    pub(in crate::las) fn horizontal_code(&self) -> Option<u16> {
        match self {
            Self::Wkt(text) => horizontal_part(&WktNode::parse(text)?)?.epsg(),
            Self::GeoTiff { horizontal, .. } => *horizontal,
        }
    }

    /// The vertical system, if one is stated.
    pub(in crate::las) fn vertical(&self) -> Option<VerticalSystem> {
        match self {
            Self::Wkt(text) => vertical_part(&WktNode::parse(text)?),
            Self::GeoTiff {
                vertical, records, ..
            } => {
                let metres = directory_of(records).and_then(geotiff::metres_per_vertical_unit);
                vertical.map(|code| VerticalSystem::of_code(code, metres))
            }
        }
    }

    /// A short name for tables: the EPSG code, or the name in the text.
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

    /// The [well-known text](Self::wkt) without breaks of lines.
    pub(crate) fn wkt_in_one_line(&self) -> Option<String> {
        let wkt = self.wkt()?;
        let words: Vec<&str> = wkt.split_whitespace().collect();
        Some(words.join(" "))
    }

    /// The well-known text as found, or that of the EPSG codes; `None` if the keys
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
                Some(match vertical.and(self.vertical()) {
                    Some(vertical) => {
                        let vertical = vertical.wkt();
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
            user_id: PROJECTION_USER.to_owned(),
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

/// The directory of GeoTIFF keys among `records`.
fn directory_of(records: &[(u16, Vec<u8>)]) -> Option<&[u8]> {
    let mut records = records.iter();
    records
        .find(|(id, _)| *id == geotiff::DIRECTORY_RECORD)
        .map(|(_, keys)| keys.as_slice())
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
            user_id: PROJECTION_USER.into(),
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
