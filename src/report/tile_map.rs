//! The map of the tiles, coloured by δ.

use super::{
    contents::TileRow,
    numbers::{counted, figure, thousands},
};

/// The longer side of the map, in units of the drawing.
const LONGER_SIDE: f64 = 1000.0;

/// Returns the smallest and the greatest of finite values; an empty range for none.
fn range(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    (
        finite.clone().fold(f64::INFINITY, f64::min),
        finite.fold(f64::NEG_INFINITY, f64::max),
    )
}

/// Returns the map of `tiles`, seen from above; nothing if they cover no area.
pub(super) fn tile_map(tiles: &[TileRow]) -> String {
    let (west, _) = range(tiles.iter().map(|tile| tile.min[0]));
    let (south, _) = range(tiles.iter().map(|tile| tile.min[1]));
    let (_, east) = range(tiles.iter().map(|tile| tile.max[0]));
    let (_, north) = range(tiles.iter().map(|tile| tile.max[1]));
    if !(east > west && north > south) {
        return String::new();
    }
    let (low, high) = range(tiles.iter().map(|tile| tile.delta));
    let scale = LONGER_SIDE / (east - west).max(north - south);
    let rectangle = |tile: &TileRow| {
        let share = ((tile.delta - low) / (high - low).max(1e-12)).clamp(0.0, 1.0);
        // From blue, even, to orange, uneven. Red without δ.
        let hue = match tile.delta.is_finite() {
            true => 210.0 - 180.0 * share,
            false => 0.0,
        };
        format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
             fill=\"hsl({hue:.0} 60% 50%)\"><title>tile {}: δ {}, {} from {}, {:.1} s</title></rect>",
            (tile.min[0] - west) * scale,
            (north - tile.max[1]) * scale,
            (tile.max[0] - tile.min[0]) * scale,
            (tile.max[1] - tile.min[1]) * scale,
            tile.id,
            figure(tile.delta),
            counted(tile.sites, "point"),
            thousands(tile.points),
            tile.seconds
        )
    };
    let rectangles: String = tiles.iter().map(rectangle).collect();
    format!(
        "<svg class=\"map\" viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" aria-label=\"map of tiles\">{rectangles}</svg>\
         <p class=\"soft\">blue: δ {} – orange: δ {}; hover for figures</p>",
        (east - west) * scale,
        (north - south) * scale,
        figure(low),
        figure(high)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_of_no_tiles_is_empty() {
        assert_eq!(tile_map(&[]), "");
    }
}
