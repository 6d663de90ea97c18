//! The viewer: one page with a square of input and output in three dimensions.

use std::io::Write;

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};

use super::{
    contents::Report,
    html::{STYLE, escape},
    numbers::{counted, thousands},
};
use crate::views::{ViewerPoint, ViewerSample};

/// The ending that the name of an output gets for its viewer.
pub(crate) const VIEWER_PAGE: &str = ".viewer.html";

/// The parts of three.js that are used (MIT licence, at its head), as `scripts/bundle-three`
/// makes them.
const THREE: &str = include_str!("three.min.js");
const SCRIPT: &str = include_str!("viewer.js");
/// What follows the script on pages with a mesh.
const MESH_SCRIPT: &str = include_str!("viewer_mesh.js");
/// The choice of what is shown of the output.
const MESH_CONTROL: &str = "
<label>output as <select id=\"as\"><option value=\"mesh\">mesh</option>\
<option value=\"edges\">mesh with edges</option><option value=\"points\">points</option></select></label>";
const MESH_HELP: &str = "
Triangles are blue-grey from behind; points without a triangle are drawn as points.";
const PAGE: &str = include_str!("viewer.html");
const VIEWER_STYLE: &str = include_str!("viewer.css");

impl Report {
    /// Returns the viewer as one page that needs no other file; `None` if the square has no
    /// point of the output.
    pub(crate) fn to_viewer(&self) -> Option<String> {
        let sample = &self.views.viewer_sample;
        if sample.after.is_empty() {
            return None;
        }
        let has_mesh = !sample.triangles.is_empty();
        let with_mesh = |text: &'static str| if has_mesh { text } else { "" };
        let page = PAGE
            .replace("{TITLE}", &escape(&self.run.output))
            .replace("{STYLE}", &[STYLE, VIEWER_STYLE].concat())
            .replace("{ABOUT}", &location(sample, self.length_unit))
            .replace("{BEFORE}", &shown_of_input(sample))
            .replace("{AFTER}", &shown_of_output(sample))
            .replace("{MESH CONTROL}", with_mesh(MESH_CONTROL))
            .replace("{MESH HELP}", with_mesh(MESH_HELP))
            .replace("{LEVEL CONTROL}", &level_control(sample))
            .replace("{OPTIONS}", &options(sample))
            .replace("{PLACE}", &description(self, sample).to_string());
        // These are long, and so come last: no name is searched in them.
        let long = [
            ("{POINTS BEFORE}", packed(&sample.before, false)),
            (
                "{POINTS AFTER}",
                packed(&sample.after, !sample.levels.is_empty()),
            ),
            ("{TRIANGLES}", triangles_element(&sample.triangles)),
            ("{THREE}", THREE.to_owned()),
            ("{SCRIPT}", [SCRIPT, with_mesh(MESH_SCRIPT)].concat()),
        ];
        filled(&page, &long)
    }
}

/// Returns `template` with every name replaced by its content; the names stand in it in this
/// order, once each. Returns `None` if one is missing.
fn filled(template: &str, contents: &[(&str, String)]) -> Option<String> {
    let length = contents.iter().map(|(_, content)| content.len());
    let mut filled = String::with_capacity(template.len() + length.sum::<usize>());
    let mut rest = template;
    for (name, content) in contents {
        let (head, tail) = rest.split_once(name)?;
        filled.push_str(head);
        filled.push_str(content);
        rest = tail;
    }
    filled.push_str(rest);
    Some(filled)
}

/// Returns what `viewer.js` must know of the square.
fn description(report: &Report, sample: &ViewerSample) -> Value {
    let [low, high] = sample.heights;
    let mut description = json!({
        "side": sample.side,
        "spacing": sample.spacing,
        "usual": report.evenness.output.mean / sample.spacing,
        "step": sample.step,
        "floor": low,
        "height": (high - low).max(sample.spacing),
        "before": sample.before.len(),
        "after": sample.after.len(),
        "borders": sample.borders,
    });
    if !sample.levels.is_empty() {
        description["levels"] = sample.levels.clone().into();
    }
    if !sample.triangles.is_empty() {
        description["triangles"] = sample.triangles.len().into();
    }
    description
}

/// Returns the attributes that points can be coloured by, as options of a list; the first is
/// shown at the start.
fn options(sample: &ViewerSample) -> String {
    let points = sample.before.iter().chain(&sample.after);
    let varies = |attribute: fn(&ViewerPoint) -> u8| {
        let mut values = points.clone().map(attribute);
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    let colorings = [
        ("color", "colour", sample.has_color),
        ("height", "height", true),
        ("intensity", "intensity", varies(|point| point.intensity)),
        ("class", "class", varies(|point| point.class)),
        ("distance", "spacing error", true),
    ];
    colorings
        .iter()
        .filter(|(_, _, is_useful)| *is_useful)
        .map(|(value, name, _)| format!("<option value=\"{value}\">{name}</option>"))
        .collect()
}

/// Returns the slider through the levels of the output; nothing if there are none.
fn level_control(sample: &ViewerSample) -> String {
    match sample.levels.len() {
        0 | 1 => String::new(),
        levels => format!(
            "\n<label>levels <input type=\"range\" id=\"level\" min=\"0\" max=\"{0}\" step=\"1\" value=\"{0}\">\
             <output id=\"level-says\" for=\"level\"></output></label>",
            levels - 1
        ),
    }
}

/// Returns in words which square is shown.
fn location(sample: &ViewerSample, unit: &str) -> String {
    let [x, y] = sample.middle;
    let tiles = match sample.borders.len() {
        0 | 1 => "within one tile".to_owned(),
        tiles => format!("where {tiles} tiles meet"),
    };
    format!(
        "{0:.2} × {0:.2} {unit} around {x:.2}, {y:.2}, {tiles}",
        sample.side
    )
}

/// Returns how many points of the input are shown, and of how many.
fn shown_of_input(sample: &ViewerSample) -> String {
    let shown = sample.before.len() as u64;
    match shown == sample.input_points {
        true => thousands(shown),
        false => format!("{} of {}", thousands(shown), thousands(sample.input_points)),
    }
}

/// Returns how many points of the output are shown, with their triangles if there are any.
fn shown_of_output(sample: &ViewerSample) -> String {
    let points = counted(sample.after.len() as u64, "point");
    match sample.triangles.len() as u64 {
        0 => points,
        triangles => format!("{points}, {}", counted(triangles, "triangle")),
    }
}

/// Returns the element with `triangles` as `viewer_mesh.js` unpacks them; nothing if there are none.
fn triangles_element(triangles: &[[u32; 3]]) -> String {
    match triangles.is_empty() {
        true => String::new(),
        false => format!(
            "\n<script type=\"text/plain\" id=\"triangles\">{}</script>",
            packed_triangles(triangles)
        ),
    }
}

/// Returns triangles in ascending order, the least corner first: the least corner (difference from the triangle before) and
/// the two others (differences from the least), each in four planes of bytes, compressed, as text. A triangle takes
/// two to three bytes of it: those of a square with 150 000 points some 0.8 MB.
fn packed_triangles(triangles: &[[u32; 3]]) -> String {
    let mut last = 0;
    let differences = triangles.iter().map(|&[a, b, c]| {
        let steps = [a - last, b - a, c - a];
        last = a;
        steps.map(u32::to_le_bytes)
    });
    let differences: Vec<[[u8; 4]; 3]> = differences.collect();
    let mut planes = Vec::with_capacity(12 * triangles.len());
    for corner in 0..3 {
        for byte in 0..4 {
            planes.extend(differences.iter().map(|steps| steps[corner][byte]));
        }
    }
    compressed(&planes)
}

/// Returns points as `viewer.js` unpacks them: planes of x, y and z (differences from the point
/// before, in steps, 16 bits), red, green, blue, intensity, class, distance and, if there are
/// levels, level, compressed, as text.
fn packed(points: &[ViewerPoint], has_levels: bool) -> String {
    let mut planes = Vec::with_capacity(12 * points.len());
    for axis in 0..3 {
        let mut last = 0_u16;
        for point in points {
            let coordinate = point.position[axis];
            planes.extend(coordinate.wrapping_sub(last).to_le_bytes());
            last = coordinate;
        }
    }
    for channel in 0..3 {
        planes.extend(points.iter().map(|point| point.color[channel]));
    }
    planes.extend(points.iter().map(|point| point.intensity));
    planes.extend(points.iter().map(|point| point.class));
    planes.extend(points.iter().map(|point| point.distance));
    if has_levels {
        planes.extend(points.iter().map(|point| point.level));
    }
    compressed(&planes)
}

/// Returns `planes` compressed, as text.
fn compressed(planes: &[u8]) -> String {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory does not fail.
    let compressed = encoder.write_all(planes).and_then(|()| encoder.finish());
    STANDARD.encode(compressed.unwrap_or_default())
}
