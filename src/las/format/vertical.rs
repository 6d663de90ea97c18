//! Vertical systems: what heights are counted from, and in which unit.

use super::wkt_node::WktNode;

/// Metres to a US survey foot.
const SURVEY_FOOT: f64 = 1200.0 / 3937.0;
/// The type of the datum in WKT 1: heights above the sea, and above an ellipsoid.
const ORTHOMETRIC: u16 = 2005;
const ELLIPSOIDAL: u16 = 2002;
/// The EPSG codes that GeoTIFF keys had for heights above ellipsoids.
const ELLIPSOID_KEYS: std::ops::RangeInclusive<u16> = 5001..=5033;

/// A unit of length.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::las) struct LengthUnit {
    pub(in crate::las) name: String,
    pub(in crate::las) metres: f64,
}

impl LengthUnit {
    /// The metre.
    pub(in crate::las) fn metre() -> Self {
        Self::of_metres(1.0)
    }

    /// The unit with this length, by its usual name.
    pub(in crate::las) fn of_metres(metres: f64) -> Self {
        let is = |unit: f64| (metres / unit - 1.0).abs() < 5e-7;
        let known = [
            ("metre", 1.0),
            ("foot", 0.3048),
            ("US survey foot", SURVEY_FOOT),
        ];
        let known = known.into_iter().find(|(_, unit)| is(*unit));
        let (name, metres) = known.unwrap_or(("unit", metres));
        Self {
            name: name.to_owned(),
            metres,
        }
    }

    fn of_node(node: &WktNode) -> Option<Self> {
        let unit = node.child(&["UNIT", "LENGTHUNIT"])?;
        Some(Self {
            name: unit.title()?.to_owned(),
            metres: unit.number(0).filter(|metres| *metres > 0.0)?,
        })
    }

    fn wkt(&self) -> String {
        let authority = match self.name.as_str() {
            "metre" => ",AUTHORITY[\"EPSG\",\"9001\"]",
            "foot" => ",AUTHORITY[\"EPSG\",\"9002\"]",
            "US survey foot" => ",AUTHORITY[\"EPSG\",\"9003\"]",
            _ => "",
        };
        format!("UNIT[\"{}\",{}{authority}]", self.name, self.metres)
    }
}

/// A vertical system.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::las) struct VerticalSystem {
    pub(in crate::las) name: String,
    datum: String,
    datum_type: u16,
    pub(in crate::las) unit: LengthUnit,
    is_downwards: bool,
    code: Option<u16>,
}

impl VerticalSystem {
    /// The system in a vertical `node`.
    fn of_node(node: &WktNode) -> Option<Self> {
        let datum = node.child(&["VERT_DATUM", "VDATUM", "VERTICALDATUM", "VRF", "DATUM"]);
        let axis = node.child(&["AXIS"]);
        let unit = LengthUnit::of_node(node).or(axis.and_then(LengthUnit::of_node));
        let datum_type = datum.and_then(|datum| datum.number(0));
        let is_ellipsoidal = datum_type == Some(f64::from(ELLIPSOIDAL));
        Some(Self {
            name: node.title()?.to_owned(),
            datum: datum
                .and_then(WktNode::title)
                .unwrap_or("unknown")
                .to_owned(),
            datum_type: if is_ellipsoidal {
                ELLIPSOIDAL
            } else {
                ORTHOMETRIC
            },
            unit: unit.unwrap_or_else(LengthUnit::metre),
            is_downwards: axis.is_some_and(|axis| axis.has_word("down")),
            code: node.epsg(),
        })
    }

    /// The system of an EPSG code in GeoTIFF keys, whose unit has this length in metres, if the keys state it.
    pub(in crate::las) fn of_code(code: u16, metres: Option<f64>) -> Self {
        // National Geodetic Vertical Datum 1929 and North American Vertical Datum 1988 in feet.
        let usual = match code {
            5702 | 6360 => SURVEY_FOOT,
            8228 => 0.3048,
            _ => 1.0,
        };
        let unit = LengthUnit::of_metres(metres.unwrap_or(usual));
        if ELLIPSOID_KEYS.contains(&code) {
            return Self::ellipsoidal(unit);
        }
        Self {
            name: format!("EPSG:{code}"),
            datum: "unknown".to_owned(),
            datum_type: ORTHOMETRIC,
            is_downwards: false,
            code: ((unit.metres / usual - 1.0).abs() < 5e-7).then_some(code),
            unit,
        }
    }

    /// Heights above the ellipsoid.
    fn ellipsoidal(unit: LengthUnit) -> Self {
        Self {
            name: "ellipsoidal height".to_owned(),
            datum: "Ellipsoid".to_owned(),
            datum_type: ELLIPSOIDAL,
            unit,
            is_downwards: false,
            code: None,
        }
    }

    /// The system with another `unit`: heights from the same surface.
    pub(in crate::las) fn in_unit(self, unit: LengthUnit) -> Self {
        Self {
            name: format!("{} in {}", self.name, unit.name),
            unit,
            code: None,
            ..self
        }
    }

    /// The text in WKT 1.
    pub(in crate::las) fn wkt(&self) -> String {
        let plain = |text: &str| text.replace('"', "\"\"");
        let axis = match self.is_downwards {
            true => "AXIS[\"Depth\",DOWN]",
            false => "AXIS[\"Up\",UP]",
        };
        let authority = self.code.map_or(String::new(), |code| {
            format!(",AUTHORITY[\"EPSG\",\"{code}\"]")
        });
        format!(
            "VERT_CS[\"{}\",VERT_DATUM[\"{}\",{}],{},{axis}{authority}]",
            plain(&self.name),
            plain(&self.datum),
            self.datum_type,
            self.unit.wkt()
        )
    }
}

/// The names of compound systems, and of vertical ones.
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
/// The names of geographic and of projected systems.
pub(in crate::las) const GEOGRAPHIC: [&str; 5] = [
    "GEOGCS",
    "GEOGCRS",
    "GEOGRAPHICCRS",
    "GEODCRS",
    "GEODETICCRS",
];
pub(in crate::las) const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];

/// The horizontal part of a system: itself, or the part of a compound one.
pub(in crate::las) fn horizontal_part(system: &WktNode) -> Option<&WktNode> {
    let bound = system
        .child(&["SOURCECRS"])
        .filter(|_| system.name() == "BOUNDCRS");
    let system = bound.unwrap_or(system);
    if COMPOUND.contains(&system.name()) || bound.is_some() {
        let names = [&PROJECTED[..], &GEOGRAPHIC[..], &["BOUNDCRS"]].concat();
        return system.child(&names).and_then(horizontal_part);
    }
    Some(system)
}

/// The vertical part of a system: of a compound one, or of a geographic one with heights.
pub(in crate::las) fn vertical_part(system: &WktNode) -> Option<VerticalSystem> {
    if COMPOUND.contains(&system.name()) {
        return system.child(&VERTICAL).and_then(VerticalSystem::of_node);
    }
    let axes: Vec<&WktNode> = system.children_named(&["AXIS"]).collect();
    let up = axes.get(2).filter(|axis| axis.has_word("up"))?;
    let unit = LengthUnit::of_node(up).unwrap_or_else(LengthUnit::metre);
    Some(VerticalSystem::ellipsoidal(unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertical(text: &str) -> Option<VerticalSystem> {
        vertical_part(&WktNode::parse(text).unwrap())
    }

    #[test]
    fn heights_are_found_in_texts_of_both_versions() {
        let old = vertical(
            "COMPD_CS[\"a\",PROJCS[\"p\"],VERT_CS[\"NAVD88 height (ftUS)\",VERT_DATUM[\"NAVD88\",2005],\
             UNIT[\"US survey foot\",0.304800609601219],AXIS[\"Up\",UP],AUTHORITY[\"EPSG\",\"6360\"]]]",
        )
        .unwrap();
        assert_eq!(
            (old.name.as_str(), old.code),
            ("NAVD88 height (ftUS)", Some(6360))
        );
        let new = vertical(
            "COMPOUNDCRS[\"a\",PROJCRS[\"p\"],VERTCRS[\"EVRF\",VDATUM[\"E\"],CS[vertical,1],\
             AXIS[\"height (H)\",up,LENGTHUNIT[\"metre\",1]],ID[\"EPSG\",5730]]]",
        )
        .unwrap();
        assert_eq!((new.unit.metres, new.code), (1.0, Some(5730)));
        assert_eq!(
            vertical(&format!("COMPD_CS[\"a\",{}]", new.wkt())),
            Some(new)
        );
        assert_eq!(
            vertical("PROJCS[\"p\",AXIS[\"E\",EAST],AXIS[\"N\",NORTH]]"),
            None
        );
    }

    #[test]
    fn another_unit_is_another_system_without_a_code() {
        let feet = VerticalSystem::of_code(6360, None);
        assert!(feet.wkt().contains("0.3048006"));
        let metres = feet.in_unit(LengthUnit::metre());
        assert!(
            metres.wkt().contains("UNIT[\"metre\",1,"),
            "{}",
            metres.wkt()
        );
        assert!(!metres.wkt().contains("6360\"]]"));
        assert!(
            VerticalSystem::of_code(5030, Some(1.0))
                .wkt()
                .contains("2002")
        );
    }
}
