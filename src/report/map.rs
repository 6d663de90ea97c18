//! The map of the area: the squares coloured by a figure, all figures of a square on request.

use serde_json::json;

use super::{contents::TileRow, squares::AreaMap};

const SCRIPT: &str = include_str!("map.js");

/// Returns the map with its controls, its data and the script that draws it; nothing if there is
/// no square with points.
pub(super) fn map(area: &AreaMap, tiles: &[TileRow]) -> String {
    let last = |axis: usize| area.squares.iter().map(|s| s.index[axis]).max();
    let first = |axis: usize| area.squares.iter().map(|s| s.index[axis]).min();
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
                square.index[0] - west,
                square.index[1] - south,
                square.input,
                square.output,
                finite(square.delta),
                finite(square.mean),
                square.isolated,
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
         <option value=\"spacing\">spacing</option>\
         <option value=\"isolated\">isolated returns</option></select></label> \
         <label><input type=\"checkbox\" id=\"map-tiles\"> tiles</label></p>\
         <canvas id=\"map\" tabindex=\"0\" role=\"img\" aria-describedby=\"map-says\" \
         aria-label=\"map of the area from above; arrow keys move from square to square\"></canvas>\
         <p class=\"soft\" id=\"map-legend\"></p>\
         <p id=\"map-says\" role=\"status\">Figures of the square under the pointer; arrow keys choose a square, too.</p>\
         <script type=\"application/json\" id=\"map-data\">{}</script>\
         <script>{SCRIPT}</script>",
        // The data are numbers only: no text in them can end the element.
        data
    )
}
