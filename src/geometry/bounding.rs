//! The bounding polygon: the dodecagon around a site that its cell is clipped from.

/// Sides of the bounding polygon.
pub const BOUNDING_SIDES: usize = 12;

/// How far the bounding polygon reaches from the site towards each of its corners (CRS units).
pub(crate) type Reach = [f64; BOUNDING_SIDES];

/// The directions to the corners of the bounding polygon, as `[u, v]` in the frame of the patch.
pub(crate) fn bounding_corners() -> [[f64; 2]; BOUNDING_SIDES] {
    // cos and sin of multiples of 30°, written out: the same bits on every
    // machine, whatever its mathematics library.
    const S: f64 = 0.866_025_403_784_438_6;
    [
        [1.0, 0.0],
        [S, 0.5],
        [0.5, S],
        [0.0, 1.0],
        [-0.5, S],
        [-S, 0.5],
        [-1.0, 0.0],
        [-S, -0.5],
        [-0.5, -S],
        [0.0, -1.0],
        [0.5, -S],
        [S, -0.5],
    ]
}
