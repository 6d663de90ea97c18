//! The map of the area, to be looked at and asked.

use serde_json::json;

use super::{AreaMap, TileRow};

const SCRIPT: &str = include_str!("map.js");

/// The map with its controls, its data and the script that draws it; nothing if there is
/// nothing to show.
pub(super) fn map(area: &AreaMap, tiles: &[TileRow]) -> String {
    let last = |axis: usize| area.squares.iter().map(|s| s.place[axis]).max();
    let first = |axis: usize| area.squares.iter().map(|s| s.place[axis]).min();
    let (Some(west), Some(south), Some(east), Some(north)) = (first(0), first(1), last(0), last(1))
    else {
        return String::new();
    };
    let corner = [(west, 0), (south, 1)].map(|(c, axis)| area.corner[axis] + c as f64 * area.edge);
    let finite = |value: f64| value.is_finite().then(|| (value * 1e4).round() / 1e4);
    let squares: Vec<_> = area
        .squares
        .iter()
        .map(|square| {
            json!([
                square.place[0] - west,
                square.place[1] - south,
                square.input,
                square.output,
                finite(square.delta),
                finite(square.mean),
            ])
        })
        .collect();
    let tiles: Vec<_> = tiles
        .iter()
        .map(|tile| {
            let along = |c: f64, axis: usize| (c - corner[axis]) / area.edge;
            json!([
                finite(along(tile.min[0], 0)),
                finite(along(tile.min[1], 1)),
                finite(along(tile.max[0], 0)),
                finite(along(tile.max[1], 1)),
            ])
        })
        .collect();
    let data = json!({
        "edge": area.edge,
        "corner": corner,
        "columns": east - west + 1,
        "rows": north - south + 1,
        "squares": squares,
        "tiles": tiles,
    });
    format!(
        "<p class=\"controls\"><label>coloured by <select id=\"map-by\">\
         <option value=\"delta\">δ</option>\
         <option value=\"output\">density of the output</option>\
         <option value=\"input\">density of the input</option>\
         <option value=\"spacing\">spacing</option></select></label> \
         <label><input type=\"checkbox\" id=\"map-tiles\"> tiles</label></p>\
         <canvas id=\"map\" tabindex=\"0\" role=\"img\" aria-describedby=\"map-says\" \
         aria-label=\"map of the area from above; arrow keys move from square to square\"></canvas>\
         <p class=\"soft\" id=\"map-legend\"></p>\
         <p id=\"map-says\" role=\"status\">Point at the map, or use the arrow keys.</p>\
         <script type=\"application/json\" id=\"map-data\">{}</script>\
         <script>{SCRIPT}</script>",
        // Numbers alone: nothing in it can end the element.
        data
    )
}
