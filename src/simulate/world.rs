//! Where a street lies in the world: somewhere in a projected CRS, at an angle to its axes.

use crate::geometry::Local;

/// The position of the street's origin (world coordinates, m).
const ORIGIN: [f64; 3] = [431_000.0, 5_400_000.0, 100.0];
/// Cosine and sine of the angle from east to the direction of the street, 20°.
const DIRECTION: [f64; 2] = [0.939_692_620_785_908_4, 0.342_020_143_325_668_7];

/// Converts street coordinates to world coordinates.
pub(super) fn to_world(at: Local) -> [f64; 3] {
    let [cos, sin] = DIRECTION;
    [
        ORIGIN[0] + cos * at.x - sin * at.y,
        ORIGIN[1] + sin * at.x + cos * at.y,
        ORIGIN[2] + at.z,
    ]
}

/// Converts world coordinates to street coordinates.
pub(super) fn from_world(position: [f64; 3]) -> Local {
    let [cos, sin] = DIRECTION;
    let [x, y, z] = [0, 1, 2].map(|axis| position[axis] - ORIGIN[axis]);
    Local::new(cos * x + sin * y, cos * y - sin * x, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_world_and_back_is_no_way() {
        let at = Local::new(12.0, -3.0, 4.0);
        assert!((from_world(to_world(at)) - at).norm() < 1e-8);
    }
}
