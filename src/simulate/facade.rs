//! Facades: walls with windows set back behind them, a cornice, and gaps between houses.

use super::{
    random::Random,
    road::{BLOCK_LENGTH, FACADE_Y, KERB_HEIGHT},
    solids::{Material, Solids},
};

/// The width of a window.
const WINDOW_WIDTH: f64 = 1.1;
/// The height of a window.
const WINDOW_HEIGHT: f64 = 1.5;
/// The share of the facades with a gap to the next house.
const GAP_PROBABILITY: f64 = 0.2;

/// A wall along the street, with openings.
struct Wall<'a> {
    solids: &'a mut Solids,
    /// The position across the street.
    y: f64,
    /// The heights of foot and top.
    heights: [f64; 2],
    /// How far windows are set back, with the sign of the side.
    reveal: f64,
}

/// Builds the facade of one side (−1 or 1) of the block that begins at `west`.
pub(super) fn build_facade(solids: &mut Solids, west: f64, side: f64, random: &mut Random) {
    let height = random.between(7.0, 13.0);
    let gap = match random.happens(GAP_PROBABILITY) {
        true => 3.0,
        false => 0.0,
    };
    let east = west + BLOCK_LENGTH - gap;
    let reveal = side * random.between(0.15, 0.25);
    let mut wall = Wall {
        solids,
        y: side * FACADE_Y,
        heights: [KERB_HEIGHT, height],
        reveal,
    };
    // Columns of windows between strips of wall.
    let pitch = random.between(2.4, 3.4);
    let mut x = west;
    while x + pitch + WINDOW_WIDTH < east {
        let (left, right) = (x + pitch - WINDOW_WIDTH, x + pitch);
        wall.strip([x, left], wall.heights);
        wall.window_column([left, right]);
        x = right;
    }
    wall.strip([x, east], wall.heights);
    wall.side_walls([west, east], side);
    wall.cornice([west, east], side);
}

impl Wall<'_> {
    /// Builds a rectangle of wall, unless it is empty.
    fn strip(&mut self, [from, to]: [f64; 2], [low, high]: [f64; 2]) {
        if to > from && high > low {
            self.solids.rectangle(
                [from, self.y, low],
                [[to - from, 0.0, 0.0], [0.0, 0.0, high - low]],
                Material::Wall,
            );
        }
    }

    /// Builds windows above each other, and the wall between them.
    fn window_column(&mut self, [left, right]: [f64; 2]) {
        let [mut low, height] = self.heights;
        let mut sill = low + 1.0;
        while sill + 2.2 < height {
            let top = sill + WINDOW_HEIGHT;
            self.strip([left, right], [low, sill]);
            self.window([left, right], sill);
            low = top;
            sill = top + 1.3;
        }
        self.strip([left, right], [low, height]);
    }

    /// Builds a pane, and the four sides of its recess.
    fn window(&mut self, [left, right]: [f64; 2], sill: f64) {
        let top = sill + WINDOW_HEIGHT;
        let (across, upwards) = ([WINDOW_WIDTH, 0.0, 0.0], [0.0, 0.0, WINDOW_HEIGHT]);
        self.solids.rectangle(
            [left, self.y + self.reveal, sill],
            [across, upwards],
            Material::Glass,
        );
        let back = [0.0, self.reveal, 0.0];
        for (corner, edge) in [
            ([left, self.y, sill], across),
            ([left, self.y, top], across),
            ([left, self.y, sill], upwards),
            ([right, self.y, sill], upwards),
        ] {
            self.solids.rectangle(corner, [edge, back], Material::Wall);
        }
    }

    /// Builds the two walls that lead away from the street.
    fn side_walls(&mut self, ends: [f64; 2], side: f64) {
        let [base, height] = self.heights;
        for end in ends {
            self.solids.rectangle(
                [end, self.y, base],
                [[0.0, side * 4.0, 0.0], [0.0, 0.0, height - base]],
                Material::Wall,
            );
        }
    }

    /// Builds the cornice, a box before the top of the wall.
    fn cornice(&mut self, [west, east]: [f64; 2], side: f64) {
        let y = if side > 0.0 { self.y - 0.25 } else { self.y };
        self.solids.cuboid(
            [west, y, self.heights[1] - 0.5],
            [east - west, 0.25, 0.3],
            Material::Wall,
        );
    }
}
