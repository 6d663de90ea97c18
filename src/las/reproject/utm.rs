//! The UTM zone of a place, on the datum that its coordinates have.

use super::definition::Definition;
use crate::las::format::crs::Crs;

/// The latitudes that UTM is for, in degrees.
const LATITUDES: std::ops::RangeInclusive<f64> = -80.0..=84.0;
/// The EPSG codes in which the zones are looked for.
const CODES: std::ops::RangeInclusive<u16> = 2000..=32_766;
/// The number of places that an area is looked at, along each of its sides.
const SAMPLES: u32 = 5;

/// A zone of UTM on a datum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UtmZone {
    /// The EPSG code.
    pub(crate) code: u16,
    /// The name: `WGS 84 / UTM zone 33N`.
    pub(crate) name: String,
}

/// The zone around the middle of `areas`, each a CRS with the least and the greatest coordinates in it, on the datum of
/// the first.
///
/// # Errors
///
/// A text that says why there is none, with the number of the area.
pub(crate) fn zone_around(areas: &[(&Crs, [[f64; 2]; 2])]) -> Result<UtmZone, (usize, String)> {
    let (mut west, mut south) = (f64::INFINITY, f64::INFINITY);
    let (mut east, mut north) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    let mut reference = None;
    let mut first = None;
    for (number, (crs, [min, max])) in areas.iter().enumerate() {
        let wrong = |problem: String| (number, problem);
        let definition = definition_of(crs).map_err(wrong)?;
        let mut is_anywhere = false;
        for place in places(*min, *max) {
            let Some([longitude, latitude]) = definition.degrees_at(place) else {
                continue;
            };
            // Longitudes are counted from the first one, so that the antimeridian is a line as any other.
            let reference = *reference.get_or_insert(longitude);
            let turned = (longitude - reference + 180.0).rem_euclid(360.0) - 180.0;
            (west, east) = (west.min(turned), east.max(turned));
            (south, north) = (south.min(latitude), north.max(latitude));
            is_anywhere = true;
        }
        if !is_anywhere {
            return Err(wrong(format!(
                "its coordinates are up to {}, {}, which {} does not have: its header states a wrong CRS; give the \
                 right one with --crs",
                max[0],
                max[1],
                crs.name()
            )));
        }
        first.get_or_insert(definition);
    }
    let (Some(first), Some(reference)) = (first, reference) else {
        return Err((0, "has no points, and so no middle".to_owned()));
    };
    let longitude = (reference + 0.5 * (west + east) + 180.0).rem_euclid(360.0) - 180.0;
    let latitude = 0.5 * (south + north);
    if !LATITUDES.contains(&latitude) {
        return Err((
            0,
            format!(
                "its middle is at a latitude of {latitude:.1}°, where UTM is not defined; give --reproject EPSG:3413 \
             (north) or EPSG:3031 (south)"
            ),
        ));
    }
    let number = ((longitude + 180.0) / 6.0).floor().rem_euclid(60.0) as u32 + 1;
    zone_on(&first, number, latitude < 0.0).ok_or_else(|| {
        let hemisphere = if latitude < 0.0 { 'S' } else { 'N' };
        (0, format!(
            "EPSG has no UTM zone {number}{hemisphere} on the datum {}; give --reproject with the code of a system on \
             that datum",
            first.datum.name
        ))
    })
}

/// The definition of the horizontal part of `crs`.
///
/// # Errors
///
/// A text that says why there is none.
pub(super) fn definition_of(crs: &Crs) -> Result<Definition, String> {
    let code = crs.horizontal_code().ok_or_else(|| {
        format!(
            "its CRS ({}) has no EPSG code, by which it could be reprojected; give the code with --crs EPSG:…",
            crs.name()
        )
    })?;
    let definition = Definition::of_code(code)?;
    if let (Some(stated), false) = (crs.metres_per_unit(), definition.is_geographic)
        && (stated / definition.metres_per_unit - 1.0).abs() > 5e-7
    {
        return Err(format!(
            "its CRS has the code EPSG:{code}, whose unit is {} m, but states a unit of {stated} m; give the right \
             code with --crs EPSG:…",
            definition.metres_per_unit
        ));
    }
    Ok(definition)
}

/// Places on a grid over the area from `min` to `max`.
fn places(min: [f64; 2], max: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let along = move |axis: usize, step: u32| {
        min[axis] + (max[axis] - min[axis]) * f64::from(step) / f64::from(SAMPLES - 1)
    };
    (0..SAMPLES).flat_map(move |y| (0..SAMPLES).map(move |x| [along(0, x), along(1, y)]))
}

/// The zone with this number on the datum of `definition`.
fn zone_on(definition: &Definition, number: u32, is_south: bool) -> Option<UtmZone> {
    let hemisphere = if is_south { 'S' } else { 'N' };
    let ending = format!("UTM zone {number}{hemisphere}");
    let of_zone = format!("+proj=utm +zone={number} ");
    CODES.into_iter().find_map(|code| {
        let found = crs_definitions::from_code(code)?;
        if !found.proj4.starts_with(&of_zone) || found.proj4.contains("+south") != is_south {
            return None;
        }
        let zone = Definition::of_code(code).ok()?;
        let is_wanted = zone.name.ends_with(&ending)
            && zone.metres_per_unit == 1.0
            && zone.datum.relation(&definition.datum) == super::definition::DatumRelation::Same;
        is_wanted.then_some(UtmZone {
            code,
            name: zone.name,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(code: u16, min: [f64; 2], max: [f64; 2]) -> Result<u16, String> {
        let crs = Crs::of_epsg(code).unwrap();
        zone_around(&[(&crs, [min, max])])
            .map(|zone| zone.code)
            .map_err(|(_, problem)| problem)
    }

    #[test]
    fn the_zone_is_that_of_the_middle_on_the_datum_of_the_scan() {
        assert_eq!(zone(4326, [14.9, 49.9], [15.1, 50.1]), Ok(32_633));
        assert_eq!(zone(4326, [-70.7, -33.5], [-70.6, -33.4]), Ok(32_719));
        assert_eq!(zone(4258, [9.0, 48.0], [9.1, 48.1]), Ok(25_832));
        assert_eq!(zone(4269, [-123.1, 44.0], [-123.0, 44.1]), Ok(26_910));
        assert_eq!(zone(4152, [-123.1, 44.0], [-123.0, 44.1]), Ok(3740));
        assert_eq!(
            zone(2994, [630_000.0, 850_000.0], [640_000.0, 860_000.0]),
            Ok(3740)
        );
        assert_eq!(zone(4326, [179.95, 10.0], [179.99, 10.1]), Ok(32_660));
    }

    #[test]
    fn scans_on_both_sides_of_the_antimeridian_have_one_zone() {
        let crs = Crs::of_epsg(4326).unwrap();
        let areas = [
            (&crs, [[179.9, 10.0], [179.99, 10.1]]),
            (&crs, [[-179.99, 10.0], [-179.5, 10.1]]),
        ];
        assert_eq!(zone_around(&areas).unwrap().code, 32_601);
    }

    #[test]
    fn metres_that_claim_to_be_degrees_have_no_zone() {
        let error = zone(4326, [431_000.0, 5_400_000.0], [431_100.0, 5_400_100.0]).unwrap_err();
        assert!(error.contains("--crs"), "{error}");
        let error = zone(4326, [10.0, 86.0], [11.0, 87.0]).unwrap_err();
        assert!(error.contains("EPSG:3413"), "{error}");
    }
}
