//! Catalogues of scans: Virtual Point Clouds, which list files with their bounds.
//!
//! A `.vpc` file is a collection of STAC items (GeoJSON), as `pdal_wrench build_vpc` and QGIS write it:
//!
//! ```text
//!   FeatureCollection
//!     Feature     assets.data.href       the file, relative to the catalogue
//!                 properties.proj:bbox   its bounds in its CRS: 4 or 6 numbers
//!                 properties.proj:wkt2   that CRS (or proj:code, proj:epsg)
//! ```
//!
//! What the bounds rule out is not opened. An item without bounds that can be true is.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use serde_json::Value;

use super::point_filter::PointFilter;
use crate::{
    las::error::LasError,
    store::{Source, joined},
};

/// The longest catalogue that is read, in bytes: some million files.
const LONGEST_CATALOGUE: u64 = 1 << 30;
/// How much bounds may be rounded, in CRS units.
const ROUNDING: f64 = 0.01;

/// A file of a catalogue.
struct Item {
    path: PathBuf,
    /// The least and the greatest x and y, if the catalogue states them.
    rectangle: Option<[[f64; 2]; 2]>,
}

/// Whether the name of `path` is that of a catalogue.
pub(super) fn is_catalogue(path: &Path) -> bool {
    // An address may have a query after its name.
    let name = crate::store::without_secrets(path);
    name.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("vpc"))
}

/// Lists those files of the catalogue at `path` in which there may be a point that `filter` accepts.
///
/// If the files have several CRSs, the filter's could be that of any of them, and all are listed.
///
/// # Errors
///
/// If the catalogue cannot be read, is none, has an item without a file, or has no such file.
pub(super) fn files_in(path: &Path, filter: &PointFilter) -> Result<Vec<PathBuf>, LasError> {
    let wrong = |problem: String| LasError::new(path, problem);
    let source = Source::find(path).map_err(|e| LasError::unreadable(path, e))?;
    let text = source
        .text(LONGEST_CATALOGUE)
        .map_err(|e| LasError::unreadable(path, e))?;
    let catalogue: Value = serde_json::from_str(&text)
        .map_err(|e| wrong(format!("is no catalogue: it is no JSON: {e}")))?;
    let features = catalogue["features"]
        .as_array()
        .filter(|_| catalogue["type"] == "FeatureCollection");
    let features = features
        .ok_or_else(|| wrong("is no catalogue: it has no collection of features".into()))?;
    let items: Vec<Item> = features
        .iter()
        .enumerate()
        .map(|(number, feature)| {
            item(path, feature).map_err(|problem| wrong(format!("item {number} {problem}")))
        })
        .collect::<Result<_, _>>()?;
    let systems: BTreeSet<String> = features.iter().map(crs_of).collect();
    let is_wanted = |item: &&Item| {
        systems.len() > 1
            || item.rectangle.is_none_or(|[min, max]| {
                filter.may_accept(min.map(|c| c - ROUNDING), max.map(|c| c + ROUNDING))
            })
    };
    let wanted: Vec<PathBuf> = items
        .iter()
        .filter(is_wanted)
        .map(|item| item.path.clone())
        .collect();
    match (items.is_empty(), wanted.is_empty()) {
        (true, _) => Err(wrong("lists no file".into())),
        (false, true) => Err(wrong(format!(
            "lists no file with points in the bounds or the polygon that were asked for, of {} in all{}",
            items.len(),
            extent(&items)
        ))),
        _ => Ok(wanted),
    }
}

/// The item that `feature` describes.
fn item(catalogue: &Path, feature: &Value) -> Result<Item, String> {
    let href = href_of(&feature["assets"]).ok_or("has no asset with a file (assets.data.href)")?;
    let path = joined(catalogue, href).map_err(|problem| format!("({href}) {problem}"))?;
    if is_catalogue(&path) {
        return Err(format!(
            "({href}) is a catalogue itself; give its files, or that catalogue"
        ));
    }
    Ok(Item {
        path,
        rectangle: rectangle_of(&feature["properties"]["proj:bbox"]),
    })
}

/// The address of the scan among `assets`: of the one named data, or with the role of data, or the only one.
fn href_of(assets: &Value) -> Option<&str> {
    let assets = assets.as_object()?;
    let is_data = |asset: &&Value| {
        asset["roles"]
            .as_array()
            .is_some_and(|roles| roles.contains(&"data".into()))
    };
    let asset = assets.get("data").or_else(|| assets.values().find(is_data));
    let asset = asset.or_else(|| assets.values().next().filter(|_| assets.len() == 1))?;
    asset["href"].as_str().filter(|href| !href.is_empty())
}

/// The rectangle of the box `bounds`; `None` if it cannot be true.
fn rectangle_of(bounds: &Value) -> Option<[[f64; 2]; 2]> {
    let bounds: Vec<f64> = bounds
        .as_array()?
        .iter()
        .map(Value::as_f64)
        .collect::<Option<_>>()?;
    let rectangle = match bounds.as_slice() {
        &[west, south, east, north] | &[west, south, _, east, north, _] => {
            [[west, south], [east, north]]
        }
        _ => return None,
    };
    let [min, max] = rectangle;
    // Written so that NaN fails.
    (min[0] <= max[0] && min[1] <= max[1]).then_some(rectangle)
}

/// The CRS of an item as it is stated.
fn crs_of(feature: &Value) -> String {
    let names = ["proj:wkt2", "proj:code", "proj:epsg", "proj:projjson"];
    let stated = names
        .iter()
        .map(|name| &feature["properties"][name])
        .find(|value| !value.is_null());
    stated.map(Value::to_string).unwrap_or_default()
}

/// A sentence on where the files of a catalogue lie, if it says so.
fn extent(items: &[Item]) -> String {
    let rectangles = items.iter().filter_map(|item| item.rectangle);
    let extent = rectangles.reduce(|[min, max], [low, high]| {
        [
            [min[0].min(low[0]), min[1].min(low[1])],
            [max[0].max(high[0]), max[1].max(high[1])],
        ]
    });
    extent.map_or_else(String::new, |[min, max]| {
        format!(
            "; they lie from x {} to {} and from y {} to {}",
            min[0], max[0], min[1], max[1]
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(text: &str, bounds: Option<[f64; 4]>) -> Result<Vec<PathBuf>, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("city.vpc");
        std::fs::write(&path, text).unwrap();
        let filter = PointFilter {
            bounds,
            ..PointFilter::default()
        };
        let files = files_in(&path, &filter).map_err(|e| e.to_string())?;
        Ok(files
            .iter()
            .map(|file| file.strip_prefix(dir.path()).unwrap_or(file).to_owned())
            .collect())
    }

    fn item(href: &str, bounds: &str, epsg: u32) -> String {
        format!(
            r#"{{"type": "Feature", "assets": {{"overview": {{"href": "o.copc.laz"}}, "data": {{"href": "{href}"}}}},
                "properties": {{"proj:bbox": {bounds}, "proj:epsg": {epsg}}}}}"#
        )
    }

    fn catalogue(items: &[String]) -> String {
        format!(
            r#"{{"type": "FeatureCollection", "features": [{}]}}"#,
            items.join(",")
        )
    }

    #[test]
    fn only_files_that_overlap_the_bounds_are_listed() {
        let text = catalogue(&[
            item("./a.laz", "[0, 0, 5, 10, 10, 9]", 25832),
            item("b.laz", "[10.5, 0, 20, 10]", 25832),
            item("../c.laz", "[30, 0, 40, 10]", 25832),
            item("unknown.laz", "null", 25832),
            item("odd.laz", "[9, 9, 1, 1]", 25832),
        ]);
        let listed = files(&text, Some([2.0, 2.0, 11.0, 3.0])).unwrap();
        assert_eq!(
            listed,
            ["a.laz", "b.laz", "unknown.laz", "odd.laz"].map(PathBuf::from)
        );
        assert_eq!(files(&text, None).unwrap().len(), 5);
    }

    #[test]
    fn bounds_of_several_systems_rule_nothing_out() {
        let text = catalogue(&[
            item("a.laz", "[0, 0, 1, 1]", 25832),
            item("b.laz", "[0, 0, 1, 1]", 25833),
        ]);
        assert_eq!(files(&text, Some([5.0, 5.0, 6.0, 6.0])).unwrap().len(), 2);
    }

    #[test]
    fn what_is_no_catalogue_is_refused_with_the_reason() {
        for (text, reason) in [
            ("LASF", "no JSON"),
            (r#"{"type": "Feature"}"#, "no collection"),
            (
                r#"{"type": "FeatureCollection", "features": 7}"#,
                "no collection",
            ),
            (&catalogue(&[]), "lists no file"),
            (&catalogue(&["{}".into()]), "item 0 has no asset"),
            (&catalogue(&["null".into()]), "item 0 has no asset"),
            (
                &catalogue(&[item("", "[0, 0, 1, 1]", 1)]),
                "item 0 has no asset",
            ),
            (
                &catalogue(&[item("b.VPC", "[0, 0, 1, 1]", 1)]),
                "catalogue itself",
            ),
            (
                r#"{"type": "FeatureCollection", "features": [{"bbox": [NaN]}]}"#,
                "no JSON",
            ),
        ] {
            let error = files(text, None).unwrap_err();
            assert!(
                error.contains(reason) && error.contains("city.vpc"),
                "{text}: {error}"
            );
        }
        let far = catalogue(&[item("a.laz", "[0, 0, 1, 1]", 1)]);
        let error = files(&far, Some([5.0, 5.0, 6.0, 6.0])).unwrap_err();
        assert!(
            error.contains("of 1 in all") && error.contains("x 0 to 1"),
            "{error}"
        );
    }
}
