//! The viewer: one page with a place before and after in three dimensions.

use std::io::Write;

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use serde_json::json;

use super::{Report, page, thousands};
use crate::views::{ViewerPoint, ViewerSample};

/// The parts of three.js that are used (MIT licence, at its top): `scripts/bundle-three`
/// makes it.
const THREE: &str = include_str!("three.min.js");
const SCRIPT: &str = include_str!("viewer.js");
const PAGE: &str = include_str!("viewer.html");
const STYLE: &str = include_str!("viewer.css");

/// The page; nothing if there is nothing to show.
pub(super) fn viewer(report: &Report) -> Option<String> {
    let excerpt = &report.excerpt;
    if excerpt.after.is_empty() {
        return None;
    }
    let [low, high] = excerpt.heights;
    let place = json!({
        "side": excerpt.side,
        "spacing": excerpt.spacing,
        "usual": report.uniformity.mean / excerpt.spacing,
        "step": excerpt.step,
        "floor": low,
        "height": (high - low).max(excerpt.spacing),
        "before": excerpt.before.len(),
        "after": excerpt.after.len(),
        "borders": excerpt.borders,
    });
    let all = excerpt.before.iter().chain(&excerpt.after);
    let has = |what: fn(&ViewerPoint) -> u8| {
        let mut values = all.clone().map(what);
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    // The first of these that the points have is what one sees first.
    let colorings = [
        ("color", "colour", excerpt.has_color),
        ("height", "height", true),
        ("intensity", "intensity", has(|shown| shown.intensity)),
        ("class", "class", has(|shown| shown.class)),
        ("distance", "spacing error", true),
    ];
    let options: String = colorings
        .iter()
        .filter(|(_, _, is_there)| *is_there)
        .map(|(value, name, _)| format!("<option value=\"{value}\">{name}</option>"))
        .collect();
    let [x, y] = excerpt.middle;
    let about = format!(
        "{0:.2} × {0:.2} around {x:.2}, {y:.2}, where {1}",
        excerpt.side,
        match excerpt.borders.len() {
            0 | 1 => "no tiles meet".to_owned(),
            tiles => format!("{tiles} tiles meet"),
        }
    );
    let page = PAGE
        .replace("{TITLE}", &page::escape(&report.output))
        .replace("{STYLE}", &[page::STYLE, STYLE].concat())
        .replace("{ABOUT}", &about)
        .replace("{BEFORE}", &before(excerpt))
        .replace("{AFTER}", &thousands(excerpt.after.len() as u64))
        .replace("{OPTIONS}", &options)
        .replace("{PLACE}", &place.to_string());
    // What is long comes last: nothing is looked for in it.
    let long = [
        ("{POINTS BEFORE}", packed(&excerpt.before)),
        ("{POINTS AFTER}", packed(&excerpt.after)),
        ("{THREE}", THREE.to_owned()),
        ("{SCRIPT}", SCRIPT.to_owned()),
    ];
    let mut rest = page.as_str();
    let mut whole = String::with_capacity(
        page.len() + long.iter().map(|(_, content)| content.len()).sum::<usize>(),
    );
    for (name, content) in &long {
        let (head, tail) = rest.split_once(name)?;
        whole.push_str(head);
        whole.push_str(content);
        rest = tail;
    }
    whole.push_str(rest);
    Some(whole)
}

fn before(excerpt: &ViewerSample) -> String {
    let shown = excerpt.before.len() as u64;
    match shown == excerpt.input_points {
        true => thousands(shown),
        false => format!(
            "{} of {}",
            thousands(shown),
            thousands(excerpt.input_points)
        ),
    }
}

/// Points as `viewer.js` unpacks them: planes of x, y and z (steps from the point before, 16
/// bits), red, green, blue, intensity, class and distance, compressed, as text.
fn packed(points: &[ViewerPoint]) -> String {
    let mut planes = Vec::with_capacity(12 * points.len());
    for axis in 0..3 {
        let mut last = 0_u16;
        for point in points {
            let place = point.position[axis];
            planes.extend(place.wrapping_sub(last).to_le_bytes());
            last = place;
        }
    }
    for channel in 0..3 {
        planes.extend(points.iter().map(|point| point.color[channel]));
    }
    planes.extend(points.iter().map(|point| point.intensity));
    planes.extend(points.iter().map(|point| point.class));
    planes.extend(points.iter().map(|point| point.distance));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    // Memory takes what it is given.
    let compressed = encoder.write_all(&planes).and_then(|()| encoder.finish());
    STANDARD.encode(compressed.unwrap_or_default())
}
