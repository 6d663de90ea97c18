//! The street in blocks: two pavements, two facades, furniture and potholes, each block from a
//! hash of the seed and its number.

use super::{
    facade::build_facade,
    furniture::build_furniture,
    options::StreetOptions,
    random::Random,
    road::{BLOCK_LENGTH, FACADE_Y, KERB_HEIGHT, KERB_Y, Pothole, Road},
    solids::{Material, Solids},
};
use crate::geometry::spread;

/// Builds the surfaces of a street, and its road.
pub(super) fn build(options: &StreetOptions) -> (Solids, Road) {
    let mut solids = Solids::default();
    let mut potholes = Vec::new();
    let blocks = (options.length / BLOCK_LENGTH).ceil().max(1.0) as u64;
    for block in 0..blocks {
        let mut random = Random(spread(options.seed) ^ spread(block));
        let west = block as f64 * BLOCK_LENGTH;
        for side in [-1.0, 1.0] {
            build_pavement(&mut solids, west, side);
            build_facade(&mut solids, west, side, &mut random);
            build_furniture(&mut solids, west, side, &mut random);
        }
        potholes.push([(); 2].map(|()| pothole(west, &mut random)));
    }
    (solids, Road::new(potholes))
}

/// Builds kerb and pavement of one side.
fn build_pavement(solids: &mut Solids, west: f64, side: f64) {
    let along = [BLOCK_LENGTH, 0.0, 0.0];
    solids.rectangle(
        [west, side * KERB_Y, 0.0],
        [along, [0.0, 0.0, KERB_HEIGHT]],
        Material::Pavement,
    );
    solids.rectangle(
        [west, side * KERB_Y, KERB_HEIGHT],
        [along, [0.0, side * (FACADE_Y - KERB_Y), 0.0]],
        Material::Pavement,
    );
}

fn pothole(west: f64, random: &mut Random) -> Pothole {
    Pothole {
        x: random.between(west + 2.0, west + BLOCK_LENGTH - 2.0),
        y: random.between(-3.0, 3.0),
        radius: random.between(0.3, 0.8),
        depth: random.between(0.02, 0.07),
    }
}
