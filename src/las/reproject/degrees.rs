//! Longitude and latitude of places.

use super::{definition::Definition, utm::definition_of};
use crate::las::format::crs::Crs;

/// The way from a CRS to degrees on its own datum: up to some metres those of any other one.
pub(crate) struct Degrees(Definition);

impl Degrees {
    /// The way from `crs`; `None` if it has no code by which it is known.
    pub(crate) fn of(crs: &Crs) -> Option<Self> {
        definition_of(crs).ok().map(Self)
    }

    /// Longitude and latitude of a place; `None` where the CRS is not defined.
    pub(crate) fn at(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        self.0.degrees_at(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_origin_of_a_zone_is_on_its_meridian() {
        // Zone 33 has its meridian at 15° east, at an easting of 500 000 m; one degree there is 110 574 m of northing,
        // times 0.9996.
        let degrees = Degrees::of(&Crs::of_epsg(32_633).unwrap()).unwrap();
        let [longitude, latitude] = degrees.at([500_000.0, 0.9996 * 110_574.4]).unwrap();
        assert!(
            (longitude - 15.0).abs() < 1e-9 && (latitude - 1.0).abs() < 1e-5,
            "{longitude} {latitude}"
        );
    }
}
