//! The street: blocks of houses, poles, wires, cars and trees, each from a hash
//! of the seed and its number.
//!
//! The street runs along x; y is across, 0 in the middle of the road.

use super::{Shape, StreetOptions};
use crate::geometry::{Local, spread};

/// Length of a block of the street (m).
pub(super) const BLOCK: f64 = 20.0;
/// Half the width of the road, and where the facades stand.
const KERB: f64 = 4.0;
const FACADE: f64 = 7.5;
const KERB_HEIGHT: f64 = 0.12;
/// Edge of the bins that shapes are sorted into.
pub(super) const BIN: f64 = 1.0;
/// Bins reach this far to both sides.
pub(super) const HALF_WIDTH: f64 = 12.0;

/// What a shape is of, for class and colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Material {
    Road,
    Pavement,
    Wall,
    Glass,
    Metal,
    Wire,
    Paint,
    Leaf,
    Wood,
}

/// A dent in the road: centre, radius, depth.
type Pothole = [f64; 4];

/// The surfaces of a street.
#[derive(Debug)]
pub struct Street {
    pub(super) options: StreetOptions,
    shapes: Vec<(Shape, Material)>,
    bins: Bins,
    /// Where two rectangles meet at an angle.
    edges: Vec<[Local; 2]>,
    edge_bins: Bins,
    potholes: Vec<Pothole>,
}

/// Numbers of what is in each bin, row by row along the street.
#[derive(Debug, Default)]
struct Bins(Vec<Vec<u32>>);

/// Numbers from a hash, one after the other.
struct Dice(u64);

impl Dice {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = spread(self.0);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Street {
    /// Builds the street of `options`.
    pub fn new(options: StreetOptions) -> Self {
        let mut street = Self {
            options,
            shapes: Vec::new(),
            bins: Bins::default(),
            edges: Vec::new(),
            edge_bins: Bins::default(),
            potholes: Vec::new(),
        };
        let blocks = (options.length / BLOCK).ceil().max(1.0) as u64;
        for block in 0..blocks {
            let mut dice = Dice(spread(options.seed) ^ spread(block));
            street.build_block(block as f64 * BLOCK, &mut dice);
        }
        let length = street.options.length;
        street.bins = Bins::new(
            length,
            street.shapes.iter().map(|(shape, _)| shape.bounds()),
        );
        street.edges = street.find_edges();
        let bounds = street.edges.iter().map(|[a, b]| (a.inf(b), a.sup(b)));
        street.edge_bins = Bins::new(length, bounds);
        street
    }

    fn build_block(&mut self, x: f64, dice: &mut Dice) {
        for side in [-1.0, 1.0] {
            self.rectangle(
                [x, side * KERB, 0.0],
                [BLOCK, 0.0, 0.0],
                [0.0, 0.0, KERB_HEIGHT],
                Material::Pavement,
            );
            self.rectangle(
                [x, side * KERB, KERB_HEIGHT],
                [BLOCK, 0.0, 0.0],
                [0.0, side * (FACADE - KERB), 0.0],
                Material::Pavement,
            );
            self.facade(x, side, dice);
            self.furniture(x, side, dice);
        }
        for _ in 0..2 {
            let [px, py] = [
                dice.between(x + 2.0, x + BLOCK - 2.0),
                dice.between(-3.0, 3.0),
            ];
            self.potholes
                .push([px, py, dice.between(0.3, 0.8), dice.between(0.02, 0.07)]);
        }
    }

    fn rectangle(&mut self, corner: [f64; 3], a: [f64; 3], b: [f64; 3], material: Material) {
        let shape = Shape::Rectangle {
            corner: corner.into(),
            edges: [a.into(), b.into()],
        };
        self.shapes.push((shape, material));
    }

    /// A closed box.
    fn cuboid(&mut self, low: [f64; 3], size: [f64; 3], material: Material) {
        let edge = |axis: usize| {
            let mut edge = [0.0; 3];
            edge[axis] = size[axis];
            edge
        };
        for axis in 0..3 {
            let (a, b) = (edge((axis + 1) % 3), edge((axis + 2) % 3));
            let mut far = low;
            far[axis] += size[axis];
            self.rectangle(low, a, b, material);
            self.rectangle(far, a, b, material);
        }
    }

    /// A wall with windows set back behind it, a cornice, and now and then a
    /// gap to the next house.
    fn facade(&mut self, x: f64, side: f64, dice: &mut Dice) {
        let height = dice.between(7.0, 13.0);
        let gap = if dice.between(0.0, 1.0) < 0.2 {
            3.0
        } else {
            0.0
        };
        let (west, east) = (x, x + BLOCK - gap);
        let (wall, base) = (side * FACADE, KERB_HEIGHT);
        let reveal = side * dice.between(0.15, 0.25);
        // Columns of windows: a strip of wall, a strip with openings, …
        let pitch = dice.between(2.4, 3.4);
        let width = 1.1;
        let mut at = west;
        let strip = |street: &mut Self, from: f64, to: f64, low: f64, high: f64| {
            if to > from && high > low {
                street.rectangle(
                    [from, wall, low],
                    [to - from, 0.0, 0.0],
                    [0.0, 0.0, high - low],
                    Material::Wall,
                );
            }
        };
        while at + pitch + width < east {
            let (left, right) = (at + pitch - width, at + pitch);
            strip(self, at, left, base, height);
            let mut low = base;
            let mut sill = base + 1.0;
            while sill + 2.2 < height {
                let top = sill + 1.5;
                strip(self, left, right, low, sill);
                self.rectangle(
                    [left, wall + reveal, sill],
                    [width, 0.0, 0.0],
                    [0.0, 0.0, 1.5],
                    Material::Glass,
                );
                for (corner, edge) in [
                    ([left, wall, sill], [width, 0.0, 0.0]),
                    ([left, wall, top], [width, 0.0, 0.0]),
                    ([left, wall, sill], [0.0, 0.0, 1.5]),
                    ([right, wall, sill], [0.0, 0.0, 1.5]),
                ] {
                    self.rectangle(corner, edge, [0.0, reveal, 0.0], Material::Wall);
                }
                low = top;
                sill = top + 1.3;
            }
            strip(self, left, right, low, height);
            at = right;
        }
        strip(self, at, east, base, height);
        for end in [west, east] {
            self.rectangle(
                [end, wall, base],
                [0.0, side * 4.0, 0.0],
                [0.0, 0.0, height - base],
                Material::Wall,
            );
        }
        let out = if side > 0.0 { wall - 0.25 } else { wall };
        self.cuboid(
            [west, out, height - 0.5],
            [east - west, 0.25, 0.3],
            Material::Wall,
        );
    }

    /// Pole, wire, car and tree of one side.
    fn furniture(&mut self, x: f64, side: f64, dice: &mut Dice) {
        let pole = [x + 5.0, side * 4.6];
        let top = 7.0;
        let up = |at: [f64; 2], low: f64, high: f64| {
            [
                Local::new(at[0], at[1], low),
                Local::new(at[0], at[1], high),
            ]
        };
        self.shapes.push((
            Shape::Cylinder {
                ends: up(pole, KERB_HEIGHT, top),
                radius: dice.between(0.06, 0.09),
            },
            Material::Metal,
        ));
        // The wire sags: a catenary is a parabola here, in eight pieces.
        let sag = |share: f64| top - 0.2 - 1.6 * share * (1.0 - share);
        for piece in 0..8 {
            let [a, b] = [piece, piece + 1].map(|k| f64::from(k) / 8.0);
            let place = |share: f64| Local::new(pole[0] + BLOCK * share, pole[1], sag(share));
            self.shapes.push((
                Shape::Cylinder {
                    ends: [place(a), place(b)],
                    radius: 0.012,
                },
                Material::Wire,
            ));
        }
        if dice.between(0.0, 1.0) < 0.6 {
            let at = x + dice.between(8.0, 13.0);
            let low = if side > 0.0 { 2.1 } else { -3.8 };
            self.cuboid([at, low, 0.3], [4.2, 1.7, 0.5], Material::Paint);
            self.shapes.push((
                Shape::Ellipsoid {
                    center: Local::new(at + 2.0, low + 0.85, 0.8),
                    axes: Local::new(1.5, 0.75, 0.65),
                },
                Material::Paint,
            ));
        }
        if dice.between(0.0, 1.0) < 0.5 {
            let tree = [x + dice.between(14.5, 18.5), side * 5.4];
            self.shapes.push((
                Shape::Cylinder {
                    ends: up(tree, KERB_HEIGHT, 3.2),
                    radius: dice.between(0.1, 0.2),
                },
                Material::Wood,
            ));
            for _ in 0..400 {
                let [a, b] = [
                    dice.between(0.0, std::f64::consts::TAU),
                    dice.between(-1.0, 1.0),
                ];
                let size = 1.5 * dice.between(0.2, 1.0).cbrt();
                let flat = size * (1.0 - b * b).sqrt();
                let center = Local::new(
                    tree[0] + flat * a.cos(),
                    tree[1] + flat * a.sin(),
                    4.2 + size * b,
                );
                let axes = Local::repeat(dice.between(0.03, 0.07));
                self.shapes
                    .push((Shape::Ellipsoid { center, axes }, Material::Leaf));
            }
        }
    }

    /// The borders of rectangles that lie on another one at an angle, or on the
    /// road.
    fn find_edges(&self) -> Vec<[Local; 2]> {
        let rectangle = |number: u32| match self.shapes[number as usize].0 {
            Shape::Rectangle { corner, edges } => Some((corner, edges)),
            _ => None,
        };
        let mut found = Vec::new();
        for own in 0..self.shapes.len() as u32 {
            let Some((corner, [a, b])) = rectangle(own) else {
                continue;
            };
            let normal = a.cross(&b).normalize();
            let borders = [(corner, a), (corner + b, a), (corner, b), (corner + a, b)];
            for (start, along) in borders {
                let middle = start + along * 0.5;
                let meets = |&other: &u32| {
                    rectangle(other).is_some_and(|(_, [a, b])| {
                        normal.dot(&a.cross(&b).normalize()).abs() < 0.9
                            && self.shapes[other as usize].0.distance(middle) < 1e-9
                    })
                };
                let bin = self.bins.bin(bin_of(middle));
                if bin.iter().any(meets) || self.distance_to_road(middle) < 1e-9 {
                    found.push([start, start + along]);
                }
            }
        }
        found
    }

    /// Whether there is road below or above `point`.
    fn is_road(&self, point: Local) -> bool {
        point.y.abs() <= KERB && (0.0..=self.end()).contains(&point.x)
    }

    /// Where the road ends.
    fn end(&self) -> f64 {
        (self.potholes.len() / 2) as f64 * BLOCK
    }

    /// Distance from `point` to the road below, above or beside it; the road is
    /// nearly level.
    fn distance_to_road(&self, point: Local) -> f64 {
        let (x, y) = (point.x.clamp(0.0, self.end()), point.y.clamp(-KERB, KERB));
        (point - Local::new(x, y, self.road(x, y))).norm()
    }

    /// Height of the road at `(x, y)`.
    fn road(&self, x: f64, y: f64) -> f64 {
        // Two potholes to a block, in the order of the blocks.
        let block = (x / BLOCK).floor().clamp(0.0, 1e9) as usize;
        let near = self.potholes.get(2 * block..2 * block + 2).unwrap_or(&[]);
        let crown = 0.06 * (1.0 - (y / KERB).powi(2));
        near.iter().fold(crown, |z, &[px, py, radius, depth]| {
            let r = ((x - px).powi(2) + (y - py).powi(2)) / (radius * radius);
            z - if r < 1.0 {
                depth * (1.0 - r).powi(2)
            } else {
                0.0
            }
        })
    }

    fn hit_road(&self, origin: Local, direction: Local) -> Option<f64> {
        if direction.z >= -0.03 {
            // It would meet the road beyond the range, if at all.
            return None;
        }
        // The road is nearly flat: from its plane a few corrections reach it.
        let mut t = -origin.z / direction.z;
        for _ in 0..60 {
            let at = origin + direction * t;
            let next = (self.road(at.x, at.y) - origin.z) / direction.z;
            let step = next - t;
            t += 0.7 * step;
            if step.abs() < 1e-9 {
                let at = origin + direction * t;
                return (self.is_road(at) && t > 0.0).then_some(t);
            }
        }
        None
    }

    /// The first surface that the ray meets within `range`: its distance, the
    /// normal and the material.
    pub(super) fn cast(
        &self,
        origin: Local,
        direction: Local,
        range: f64,
    ) -> Option<(f64, Local, Material)> {
        let mut best = self
            .hit_road(origin, direction)
            .filter(|&t| t < range)
            .map(|t| (t, Local::z(), Material::Road));
        // Bin by bin along the ray, as seen from above.
        let flat = direction.x.hypot(direction.y);
        let mut cell = [
            (origin.x / BIN).floor() as i64,
            (origin.y / BIN).floor() as i64,
        ];
        let step = [direction.x, direction.y].map(|d| if d < 0.0 { -1 } else { 1 });
        let width = [direction.x, direction.y].map(|d| (BIN / d).abs());
        let mut border = [0, 1].map(|axis| {
            let (o, d) = (origin[axis], direction[axis]);
            let edge = (cell[axis] + i64::from(d >= 0.0)) as f64 * BIN;
            if d == 0.0 {
                f64::INFINITY
            } else {
                (edge - o) / d
            }
        });
        let mut entered = 0.0;
        while entered < range && best.is_none_or(|(t, ..)| entered <= t) {
            for &number in self.bins.bin(cell) {
                let (shape, material) = &self.shapes[number as usize];
                if let Some((t, normal)) = shape.hit(origin, direction)
                    && t < best.map_or(range, |(b, ..)| b)
                {
                    best = Some((t, normal, *material));
                }
            }
            let axis = usize::from(border[1] < border[0]);
            entered = border[axis];
            border[axis] += width[axis];
            cell[axis] += step[axis];
            if flat == 0.0 || (cell[1] as f64).abs() > HALF_WIDTH + 1.0 {
                break;
            }
        }
        best
    }

    /// Distance from `point` (street coordinates) to the nearest surface.
    pub(super) fn distance(&self, point: Local) -> f64 {
        let to_shape = |number: u32| self.shapes[number as usize].0.distance(point);
        self.bins
            .nearest(point, self.distance_to_road(point), to_shape)
    }

    /// Distance from `point` (street coordinates) to the nearest edge at which
    /// two plane surfaces meet, infinite beyond 40 m.
    pub(super) fn edge_distance(&self, point: Local) -> f64 {
        let to_edge = |number: u32| {
            let [a, b] = self.edges[number as usize];
            let along = b - a;
            let share = (point - a).dot(&along) / along.norm_squared();
            (point - a - along * share.clamp(0.0, 1.0)).norm()
        };
        self.edge_bins.nearest(point, f64::INFINITY, to_edge)
    }

    #[cfg(test)]
    pub(super) fn distance_to_all(&self, point: Local) -> f64 {
        let road = self.distance_to_road(point);
        self.shapes
            .iter()
            .map(|(shape, _)| shape.distance(point))
            .fold(road, f64::min)
    }
}

/// Row and column of the bin above or below `point`.
fn bin_of(point: Local) -> [i64; 2] {
    [point.x, point.y].map(|c| (c / BIN).floor() as i64)
}

impl Bins {
    /// Sorts things of these bounds, over a street of `length`.
    fn new(length: f64, bounds: impl Iterator<Item = (Local, Local)>) -> Self {
        let columns = (2.0 * HALF_WIDTH / BIN) as usize;
        let rows = ((length + 3.0 * BLOCK) / BIN).ceil() as usize;
        let mut bins = vec![Vec::new(); rows * columns];
        for (number, (low, high)) in (0_u32..).zip(bounds) {
            let range = |low: f64, high: f64, most: usize| {
                let place = |c: f64| (c / BIN).floor().max(0.0) as usize;
                place(low)..=place(high).min(most - 1)
            };
            for row in range(low.x - 1e-6 + BLOCK, high.x + 1e-6 + BLOCK, rows) {
                for column in range(
                    low.y - 1e-6 + HALF_WIDTH,
                    high.y + 1e-6 + HALF_WIDTH,
                    columns,
                ) {
                    bins[row * columns + column].push(number);
                }
            }
        }
        Self(bins)
    }

    fn bin(&self, [x, y]: [i64; 2]) -> &[u32] {
        let columns = (2.0 * HALF_WIDTH / BIN) as i64;
        let row = x + (BLOCK / BIN) as i64;
        let column = y + (HALF_WIDTH / BIN) as i64;
        if row < 0 || !(0..columns).contains(&column) {
            return &[];
        }
        self.0
            .get((row * columns + column) as usize)
            .map_or(&[], Vec::as_slice)
    }

    /// The least `distance` of anything to `point`, or `limit` if that is less.
    fn nearest(&self, point: Local, limit: f64, distance: impl Fn(u32) -> f64) -> f64 {
        let [x, y] = bin_of(point);
        let mut best = limit;
        let mut ring: i64 = 0;
        // Rings of bins, until none farther out can hold anything nearer.
        while (ring - 1) as f64 * BIN < best && ring < 40 {
            for dx in -ring..=ring {
                for dy in -ring..=ring {
                    if dx.abs().max(dy.abs()) == ring {
                        for &number in self.bin([x + dx, y + dy]) {
                            best = best.min(distance(number));
                        }
                    }
                }
            }
            ring += 1;
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_where_planes_meet_and_nowhere_else() {
        let street = Street::new(StreetOptions {
            length: 100.0,
            ..StreetOptions::default()
        });
        let to_edge = |x, y, z| street.edge_distance(Local::new(x, y, z));
        // Along the kerb, on top and at the foot.
        assert!(to_edge(31.0, KERB, KERB_HEIGHT) < 1e-9);
        assert!(to_edge(31.0, -KERB, 0.0) < 1e-9);
        // In the middle of the road the feet of the kerbs are the nearest, but for
        // a car's box.
        assert!((3.9..4.01).contains(&to_edge(1.0, 0.0, 0.0)));
        // The twin asks every edge.
        for k in 0..200_u32 {
            let [x, y, z] = [7, 11, 13].map(|by| f64::from(k * by % 101) / 101.0);
            let place = Local::new(100.0 * x, 16.0 * y - 8.0, 9.0 * z);
            let to_segment = |&[a, b]: &[Local; 2]| {
                let along = b - a;
                let share = (place - a).dot(&along) / along.norm_squared();
                (place - a - along * share.clamp(0.0, 1.0)).norm()
            };
            let twin = street
                .edges
                .iter()
                .map(to_segment)
                .fold(f64::INFINITY, f64::min);
            assert!((street.edge_distance(place) - twin).abs() < 1e-12);
        }
    }
}
