//! The way of a point from one CRS to another.

use proj4rs::{Proj, transform::transform};

use super::{
    definition::{Datum, DatumRelation, Definition},
    utm::definition_of,
};
use crate::las::format::{crs::Crs, vertical::LengthUnit};

/// The number of places along each side of a rectangle by which the rectangle around its image is found.
const SAMPLES: u32 = 17;

/// The way of points from the CRS of an input to another one.
pub(crate) struct Reprojection {
    source: Proj,
    target: Proj,
    is_from_degrees: bool,
    /// New units to an old unit of height.
    height_factor: f64,
    /// The CRS that points are brought to, with the vertical system that they had.
    pub(crate) crs: Crs,
    /// Sentences about what the way cannot keep.
    pub(crate) notes: Vec<String>,
}

impl std::fmt::Debug for Reprojection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reprojection")
            .field("crs", &self.crs)
            .finish_non_exhaustive()
    }
}

impl Reprojection {
    /// The way from `source` to the system with the EPSG code `target`; `None` if they are one.
    ///
    /// # Errors
    ///
    /// A text that says why there is none: a system is not known, or a datum would have to be shifted.
    pub(crate) fn new(source: &Crs, target: u16) -> Result<Option<Self>, String> {
        if source.horizontal_code() == Some(target) {
            return Ok(None);
        }
        let to = Definition::of_code(target)?;
        if to.is_geographic {
            return Err(format!(
                "EPSG:{target} ({}) is in degrees, in which a spacing means nothing; choose a system in metres or feet",
                to.name
            ));
        }
        let from = definition_of(source)?;
        let mut notes = Vec::new();
        match from.datum.relation(&to.datum) {
            DatumRelation::Same => {}
            DatumRelation::TakenAsOne => notes.push(format!(
                "the datums {} and {} are taken as one, as EPSG defines them; they differ by up to two metres, \
                 depending on place and time",
                from.datum.name, to.datum.name
            )),
            DatumRelation::Shifted => return Err(no_shift(&from.datum, &to)),
        }

        // Heights stay what they are, in the unit of the other coordinates.
        let vertical = source.vertical();
        let unit = LengthUnit::of_metres(to.metres_per_unit);
        let before = match &vertical {
            Some(vertical) => vertical.unit.clone(),
            None => LengthUnit::of_metres(from.metres_per_unit),
        };
        let factor = before.metres / unit.metres;
        let is_kept = (factor - 1.0).abs() < 5e-7;
        if !is_kept {
            notes.push(format!(
                "heights in {} become {}, the unit of EPSG:{target}; their datum is kept",
                before.name, unit.name
            ));
        }
        let vertical = vertical.map(|vertical| match is_kept {
            true => vertical,
            false => vertical.in_unit(unit),
        });
        let wkt = match &vertical {
            None => to.wkt.to_owned(),
            Some(vertical) => {
                let name = format!("{} + {}", to.name, vertical.name).replace('"', "\"\"");
                format!("COMPD_CS[\"{name}\",{},{}]", to.wkt, vertical.wkt())
            }
        };
        Ok(Some(Self {
            is_from_degrees: from.is_geographic,
            source: from.projection,
            target: to.projection,
            height_factor: if is_kept { 1.0 } else { factor },
            crs: Crs::Wkt(wkt),
            notes,
        }))
    }

    /// The coordinates of `point` in the other system; `None` where that has none.
    #[inline]
    pub(in crate::las) fn point(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 3]> {
        let mut place = match self.is_from_degrees {
            true => (x.to_radians(), y.to_radians(), 0.0),
            false => (x, y, 0.0),
        };
        transform(&self.source, &self.target, &mut place).ok()?;
        let there = [place.0, place.1, z * self.height_factor];
        there.iter().all(|c| c.is_finite()).then_some(there)
    }

    /// The box around the images of places in the box from `min` to `max`; `None` if none has an image.
    pub(in crate::las) fn bounds(&self, [min, max]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let along = |axis: usize, step: u32| {
            min[axis] + (max[axis] - min[axis]) * f64::from(step) / f64::from(SAMPLES - 1)
        };
        for (x, y) in (0..SAMPLES * SAMPLES).map(|n| (n % SAMPLES, n / SAMPLES)) {
            for z in [min[2], max[2]] {
                let Some(place) = self.point([along(0, x), along(1, y), z]) else {
                    continue;
                };
                for axis in 0..3 {
                    bounds[0][axis] = bounds[0][axis].min(place[axis]);
                    bounds[1][axis] = bounds[1][axis].max(place[axis]);
                }
            }
        }
        (bounds[0][0] <= bounds[1][0]).then_some(bounds)
    }

    /// The smallest distance between places that steps of `scale` along the axes lead to from `place`.
    pub(in crate::las) fn step(&self, place: [f64; 3], scale: [f64; 3]) -> Option<f64> {
        let here = self.point(place)?;
        let steps = (0..3).filter_map(|axis| {
            let mut beside = place;
            beside[axis] += scale[axis];
            let there = self.point(beside)?;
            let squared: f64 = (0..3).map(|k| (there[k] - here[k]).powi(2)).sum();
            Some(squared.sqrt())
        });
        steps.filter(|step| *step > 0.0).min_by(f64::total_cmp)
    }
}

/// The reason why there is no way to `target` from coordinates on another datum.
fn no_shift(datum: &Datum, target: &Definition) -> String {
    format!(
        "its datum is {}, that of EPSG:{} ({}) is {}: between them lies a shift of up to metres, which takes grids or \
         parameters that this program does not have; choose a system on {} (--reproject auto does), or reproject with a \
         program that has them (PDAL with PROJ)",
        datum.name, target.code, target.name, target.datum.name, datum.name
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places in one system and in another, as pyproj 3.7.2 (PROJ 9.5.1) has them, to a tenth of a millimetre.
    const PLACES: [(u16, u16, [f64; 2], [f64; 2]); 11] = [
        (
            4326,
            32_633,
            [13.376698, 52.516275],
            [389_849.783_5, 5_819_700.667_0],
        ),
        (
            4326,
            32_719,
            [-70.65, -33.45],
            [346_642.695_0, 6_297_606.832_5],
        ),
        (4326, 32_660, [179.99, -0.5], [832_851.662_2, -55_340.879_5]),
        (4326, 32_631, [5.99, 83.9], [535_457.200_0, 9_317_850.302_3]),
        (
            4171,
            2154,
            [2.294481, 48.85837],
            [648_235.877_7, 6_862_268.358_3],
        ),
        (
            4326,
            3857,
            [13.376698, 52.516275],
            [1_489_087.209_9, 6_894_018.358_2],
        ),
        (
            32_632,
            32_633,
            [780_000.0, 5_830_000.0],
            [373_213.557_7, 5_823_624.986_8],
        ),
        (
            2994,
            3740,
            [636_000.0, 851_000.0],
            [494_101.984_0, 4_878_046.787_8],
        ),
        (4269, 2992, [-123.07, 44.05], [636_891.185_0, 848_943.514_7]),
        (
            2180,
            25_834,
            [637_000.0, 486_000.0],
            [500_430.263_4, 5_785_840.244_4],
        ),
        (
            4156,
            5514,
            [14.42, 50.09],
            [-742_949.431_0, -1_042_796.966_2],
        ),
    ];

    fn way(source: u16, target: u16) -> Reprojection {
        Reprojection::new(&Crs::of_epsg(source).unwrap(), target)
            .unwrap()
            .unwrap()
    }

    fn refusal(source: &Crs, target: u16) -> String {
        Reprojection::new(source, target).unwrap_err()
    }

    #[test]
    fn places_are_where_proj_has_them() {
        for (source, target, from, to) in PLACES {
            let [x, y] = from;
            let [x, y, z] = way(source, target).point([x, y, 0.0]).unwrap();
            let off = (x - to[0]).hypot(y - to[1]);
            assert!(off < 2e-4 && z == 0.0, "{source} to {target}: {off}");
        }
    }

    /// Published values: the worked example of transverse Mercator on Airy 1830 in the Ordnance Survey's "A guide to
    /// coordinate systems in Great Britain" (52° 39′ 27.2531″ N, 1° 43′ 4.5177″ E), of the same datum throughout.
    #[test]
    fn the_example_of_the_ordnance_survey_is_met() {
        let latitude = 52.0 + 39.0 / 60.0 + 27.2531 / 3600.0;
        let longitude = 1.0 + 43.0 / 60.0 + 4.5177 / 3600.0;
        let [x, y, _] = way(4277, 27_700).point([longitude, latitude, 0.0]).unwrap();
        assert!((x - 651_409.903).hypot(y - 313_177.270) < 0.002, "{x} {y}");
    }

    #[test]
    fn a_shift_of_the_datum_is_refused_and_not_made_silently() {
        for (source, target) in [
            (4267, 26_910),
            (4277, 32_630),
            (4314, 25_832),
            (2994, 26_910),
            (4152, 2992),
        ] {
            let problem = refusal(&Crs::of_epsg(source).unwrap(), target);
            assert!(problem.contains("grids"), "{source} to {target}: {problem}");
        }
        assert!(way(4326, 25_833).notes[0].contains("two metres"));
        assert!(way(4326, 32_633).notes.is_empty());
        assert!(way(4314, 31_467).notes.is_empty());
    }

    #[test]
    fn what_cannot_be_a_target_is_refused_with_the_reason() {
        let crs = Crs::of_epsg(4326).unwrap();
        for (target, why) in [(4258, "degrees"), (7405, "compound"), (1, "not a system")] {
            let problem = refusal(&crs, target);
            assert!(problem.contains(why), "{target}: {problem}");
        }
        assert!(refusal(&Crs::Wkt("PROJCS[\"mine\"]".into()), 32_633).contains("--crs"));
        assert!(
            Reprojection::new(&Crs::of_epsg(32_633).unwrap(), 32_633)
                .unwrap()
                .is_none()
        );
    }

    #[test]
    fn the_vertical_system_is_kept_and_heights_have_the_unit_of_the_plane() {
        let horizontal = Crs::of_epsg(4326).unwrap().wkt().unwrap();
        let compound =
            |vertical: &str| Crs::Wkt(format!("COMPD_CS[\"a\",{horizontal},{vertical}]"));
        let metres = compound(
            "VERT_CS[\"EGM2008 height\",VERT_DATUM[\"EGM2008 geoid\",2005],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"3855\"]]",
        );
        let way = Reprojection::new(&metres, 32_633).unwrap().unwrap();
        assert_eq!(way.point([15.0, 50.0, 321.5]).unwrap()[2], 321.5);
        let wkt = way.crs.wkt().unwrap();
        assert!(
            wkt.starts_with("COMPD_CS[\"WGS 84 / UTM zone 33N + EGM2008 height\",PROJCS["),
            "{wkt}"
        );
        assert!(wkt.contains("AUTHORITY[\"EPSG\",\"3855\"]") && way.notes.is_empty());
        assert_eq!(way.crs.horizontal_code(), Some(32_633));

        let feet = compound(
            "VERT_CS[\"NAVD88\",VERT_DATUM[\"NAVD88\",2005],UNIT[\"US survey foot\",0.304800609601219]]",
        );
        let way = Reprojection::new(&feet, 32_633).unwrap().unwrap();
        let height = way.point([15.0, 50.0, 3937.0]).unwrap()[2];
        assert!((height - 1200.0).abs() < 1e-6, "{height}");
        assert!(
            way.notes[0].contains("US survey foot become metre"),
            "{:?}",
            way.notes
        );
        assert!(way.crs.wkt().unwrap().contains("NAVD88 in metre"));
    }

    #[test]
    fn heights_above_the_ellipsoid_are_said_to_be_such() {
        let way = way(4979, 32_633);
        assert!(
            way.crs
                .wkt()
                .unwrap()
                .contains("VERT_DATUM[\"Ellipsoid\",2002]")
        );
        assert_eq!(way.point([15.0, 50.0, 10.0]).unwrap()[2], 10.0);
    }

    #[test]
    fn the_box_is_around_the_image() {
        let way = way(4326, 32_633);
        let [min, max] = way.bounds([[13.0, 48.0, 0.0], [17.0, 51.0, 9.0]]).unwrap();
        let [x, y, _] = way.point([15.0, 48.0, 0.0]).unwrap();
        assert!((x - 500_000.0).abs() < 1e-6 && (min[1] - y).abs() < 1e-6);
        assert!(min[0] < 360_000.0 && max[0] > 640_000.0 && (min[2], max[2]) == (0.0, 9.0));
        assert_eq!(way.bounds([[0.0, 95.0, 0.0], [1.0, 99.0, 0.0]]), None);
    }
}
