//! Horizontal systems by their EPSG codes: projection, unit and datum.

use proj4rs::{Proj, transform::transform};

use crate::las::format::{
    vertical::{GEOGRAPHIC, PROJECTED, horizontal_part},
    wkt_node::WktNode,
};

/// The EPSG code of WGS 84 as a datum.
const WGS84_DATUM: u16 = 6326;
/// Radians to a degree, as definitions state it.
const DEGREE: f64 = 0.017_453_292_519_943_3;
/// Geographic systems with heights, and the ones without that they extend: the registry's texts of the former have
/// no code for the datum.
const WITH_HEIGHTS: [(u16, u16); 5] = [
    (4979, 4326),
    (4937, 4258),
    (4965, 4171),
    (6319, 6318),
    (4957, 4152),
];

/// A horizontal system of the EPSG registry.
pub(super) struct Definition {
    pub(super) code: u16,
    pub(super) name: String,
    pub(super) wkt: &'static str,
    pub(super) projection: Proj,
    pub(super) is_geographic: bool,
    /// Metres to a unit of a projected system; 1 for a geographic one.
    pub(super) metres_per_unit: f64,
    pub(super) datum: Datum,
    /// Degrees on the same datum, without projection.
    degrees: Proj,
}

/// What the coordinates of a system are relative to.
#[derive(Clone, Debug)]
pub(super) struct Datum {
    pub(super) name: String,
    code: u16,
    prime_meridian: Option<String>,
    /// Whether the registry defines it as coinciding with WGS 84.
    coincides_with_wgs84: bool,
}

/// How two datums relate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DatumRelation {
    Same,
    /// Both are defined as coinciding with WGS 84: that is true to a metre or two.
    TakenAsOne,
    /// A shift would be needed.
    Shifted,
}

impl Datum {
    pub(super) fn relation(&self, other: &Self) -> DatumRelation {
        let is_same = self.code == other.code && self.prime_meridian == other.prime_meridian;
        // The realizations of NAD 83 differ by up to a metre among themselves, which only grids describe.
        let is_american = |datum: &Self| {
            let name = datum.name.to_ascii_uppercase();
            name.contains("NAD83") || name.contains("NORTH_AMERICAN_DATUM")
        };
        match () {
            () if is_same => DatumRelation::Same,
            () if is_american(self) && is_american(other) => DatumRelation::Shifted,
            () if self.coincides_with_wgs84 && other.coincides_with_wgs84 => {
                DatumRelation::TakenAsOne
            }
            () => DatumRelation::Shifted,
        }
    }
}

impl Definition {
    /// The system of an EPSG code.
    ///
    /// # Errors
    ///
    /// A text that says why it cannot be used.
    pub(super) fn of_code(code: u16) -> Result<Self, String> {
        let extended = WITH_HEIGHTS.iter().find(|(with, _)| *with == code);
        let code = extended.map_or(code, |(_, without)| *without);
        let unknown = || format!("EPSG:{code} is not a system that this program can reproject");
        let found = crs_definitions::from_code(code).ok_or_else(unknown)?;
        let system = WktNode::parse(found.wkt).ok_or_else(unknown)?;
        let is_part = horizontal_part(&system).is_some_and(|part| part != &system);
        if is_part {
            return Err(format!(
                "EPSG:{code} is a compound system; give its horizontal part: heights keep the system that they have"
            ));
        }
        let is_geographic = GEOGRAPHIC.contains(&system.name());
        if !is_geographic && !PROJECTED.contains(&system.name()) {
            return Err(unknown());
        }
        let geographic = match is_geographic {
            true => Some(&system),
            false => system.child(&GEOGRAPHIC),
        };
        let geographic = geographic.ok_or_else(unknown)?;
        let datum = geographic.child(&["DATUM"]).ok_or_else(unknown)?;
        let ellipsoid = ellipsoid(datum).ok_or_else(unknown)?;
        let unit = |node: &WktNode| node.child(&["UNIT"])?.number(0);
        let is_odd_angle =
            is_geographic && unit(&system).is_none_or(|radians| (radians - DEGREE).abs() > 1e-12);
        if is_odd_angle || found.proj4.contains("+axis") || found.proj4.contains("+proj=geocent") {
            return Err(format!(
                "EPSG:{code} does not count degrees, or lengths to the east and north, and cannot be reprojected"
            ));
        }
        let projection = projection(found.proj4, &ellipsoid);
        let build = |text: &str| {
            Proj::from_proj_string(text)
                .map_err(|e| format!("EPSG:{code} cannot be reprojected: {e}"))
        };
        let meridian = found
            .proj4
            .split_whitespace()
            .find(|w| w.starts_with("+pm="));
        Ok(Self {
            code,
            name: system.title().unwrap_or("unnamed").to_owned(),
            wkt: found.wkt,
            projection: build(&projection)?,
            degrees: build(&format!("+proj=longlat {ellipsoid}"))?,
            is_geographic,
            metres_per_unit: if is_geographic {
                1.0
            } else {
                unit(&system).ok_or_else(unknown)?
            },
            datum: Datum {
                name: datum.title().unwrap_or("unnamed").to_owned(),
                code: datum.epsg().ok_or_else(unknown)?,
                prime_meridian: meridian.map(str::to_owned),
                coincides_with_wgs84: datum.epsg() == Some(WGS84_DATUM)
                    || datum
                        .child(&["TOWGS84"])
                        .is_some_and(|shift| shift.numbers().all(|n| n == 0.0)),
            },
        })
    }

    /// Longitude and latitude, in degrees from Greenwich, of a place in this system.
    pub(super) fn degrees_at(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let mut place = match self.is_geographic {
            true => (x.to_radians(), y.to_radians(), 0.0),
            false => (x, y, 0.0),
        };
        transform(&self.projection, &self.degrees, &mut place).ok()?;
        let [longitude, latitude] = [place.0, place.1].map(f64::to_degrees);
        // Written so that NaN fails.
        (longitude.abs() <= 360.0 && latitude.abs() <= 90.0).then_some([longitude, latitude])
    }
}

/// The axes of the ellipsoid of `datum`, as PROJ writes them.
fn ellipsoid(datum: &WktNode) -> Option<String> {
    let spheroid = datum.child(&["SPHEROID"])?;
    let (a, inverse_flattening) = (spheroid.number(0)?, spheroid.number(1)?);
    Some(match inverse_flattening {
        0.0 => format!("+R={a}"),
        _ => format!("+a={a} +rf={inverse_flattening}"),
    })
}

/// The projection of `definition` without its datum: no shift can hide in it.
fn projection(definition: &str, ellipsoid: &str) -> String {
    let is_of_datum = |word: &str| {
        [
            "+datum=",
            "+towgs84=",
            "+nadgrids=",
            "+vunits=",
            "+vto_meter=",
            "+wktext",
        ]
        .iter()
        .any(|beginning| word.starts_with(beginning))
    };
    let words = definition.split_whitespace();
    let mut words: Vec<&str> = words.filter(|word| !is_of_datum(word)).collect();
    let is_of_ellipsoid = |word: &&str| {
        word.starts_with("+ellps=") || word.starts_with("+a=") || word.starts_with("+R=")
    };
    if !words.iter().any(is_of_ellipsoid) {
        words.push(ellipsoid);
    }
    words.join(" ")
}
