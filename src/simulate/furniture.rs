//! Poles, wires, cars and trees.

use super::{
    random::Random,
    road::{BLOCK_LENGTH, KERB_HEIGHT},
    shapes::Shape,
    solids::{Material, Solids},
};
use crate::geometry::Local;

/// The height of the poles.
const POLE_HEIGHT: f64 = 7.0;
/// The number of straight pieces of a wire.
const WIRE_PIECES: u32 = 8;
/// The share of the sides of blocks with a car.
const CAR_PROBABILITY: f64 = 0.6;
/// The share of the sides of blocks with a tree.
const TREE_PROBABILITY: f64 = 0.5;
/// The number of leaves of a tree.
const LEAVES: u32 = 400;

/// Builds the furniture of one side (−1 or 1) of the block that begins at `west`.
pub(super) fn build_furniture(solids: &mut Solids, west: f64, side: f64, random: &mut Random) {
    let pole = [west + 5.0, side * 4.6];
    let radius = random.between(0.06, 0.09);
    solids.column(pole, [KERB_HEIGHT, POLE_HEIGHT], radius, Material::Metal);
    build_wire(solids, pole);
    if random.happens(CAR_PROBABILITY) {
        let x = west + random.between(8.0, 13.0);
        let y = if side > 0.0 { 2.1 } else { -3.8 };
        build_car(solids, [x, y], Material::Paint);
    }
    if random.happens(TREE_PROBABILITY) {
        let trunk = [west + random.between(14.5, 18.5), side * 5.4];
        build_tree(solids, trunk, random);
    }
}

/// Builds the wire from `pole` to the next one. Its sag is a parabola, which differs little
/// from the catenary.
fn build_wire(solids: &mut Solids, pole: [f64; 2]) {
    let height = |share: f64| POLE_HEIGHT - 0.2 - 1.6 * share * (1.0 - share);
    let position = |share: f64| Local::new(pole[0] + BLOCK_LENGTH * share, pole[1], height(share));
    for piece in 0..WIRE_PIECES {
        let ends = [piece, piece + 1].map(|end| f64::from(end) / f64::from(WIRE_PIECES));
        let wire = Shape::Cylinder {
            ends: ends.map(position),
            radius: 0.012,
        };
        solids.add(wire, Material::Wire);
    }
}

/// Builds a car along the street, a box with an ellipsoid on it, whose least corner is above `[x, y]`.
pub(super) fn build_car(solids: &mut Solids, [x, y]: [f64; 2], material: Material) {
    solids.cuboid([x, y, 0.3], [4.2, 1.7, 0.5], material);
    let roof = Shape::Ellipsoid {
        center: Local::new(x + 2.0, y + 0.85, 0.8),
        axes: Local::new(1.5, 0.75, 0.65),
    };
    solids.add(roof, material);
}

/// Builds a tree: a trunk, and balls for leaves, evenly spread in a larger ball.
fn build_tree(solids: &mut Solids, trunk: [f64; 2], random: &mut Random) {
    let radius = random.between(0.1, 0.2);
    solids.column(trunk, [KERB_HEIGHT, 3.2], radius, Material::Wood);
    for _ in 0..LEAVES {
        let angle = random.between(0.0, std::f64::consts::TAU);
        let sine = random.between(-1.0, 1.0);
        let distance = 1.5 * random.between(0.2, 1.0).cbrt();
        let across = distance * (1.0 - sine * sine).sqrt();
        let center = Local::new(
            trunk[0] + across * angle.cos(),
            trunk[1] + across * angle.sin(),
            4.2 + distance * sine,
        );
        let axes = Local::repeat(random.between(0.03, 0.07));
        solids.add(Shape::Ellipsoid { center, axes }, Material::Leaf);
    }
}
