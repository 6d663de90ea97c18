//! A hexagonal lattice in a plane through the origin of the run.
//!
//! ```text
//!   row 1     o   o   o        edge: the spacing
//!   row 0   o   o   o   o      distance of the rows: √3/2 spacings
//! ```
//!
//! The lattice follows from a normal alone, which is rounded to one of the directions that many planes of the cloud
//! face or to one of a few others: two tiles, and two ends of a long wall, have the same nodes. Rows run along x; where the normal is nearest to
//! x, along z. Rows of the one and of the other kind then fit each other where a surface turns
//! from z to x, and rows along x where it turns from z to y. Only products and roots are used, so
//! that every machine finds the same bits.

use super::{
    dominant_normals::{DominantNormals, unit},
    rounded_normal::RoundedNormal,
};
use crate::geometry::Local;

/// Distance between the rows of a hexagonal lattice: √3/2.
pub(super) const ROW_IN_SPACINGS: f64 = 0.866_025_403_784_438_6;

/// Area to a seed, in squared spacings: the hexagon's.
pub const AREA_PER_SEED: f64 = ROW_IN_SPACINGS;

/// The first value of the keys of lattices across dominant normals. Those of other lattices have an axis there.
const DOMINANT: i8 = 3;

/// A hexagonal lattice by the directions along and across its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lattice {
    /// The normal as it is rounded; equal lattices have equal keys.
    pub(super) key: [i8; 4],
    /// Unit vectors along and across the rows.
    axes: [Local; 2],
}

/// The node of a lattice nearest to a position.
pub(super) struct NearestNode {
    /// The row and the column of the node.
    pub(super) index: [i64; 2],
    /// The way from the node to the position along and across the rows (spacings).
    pub(super) way: [f64; 2],
}

impl Lattice {
    /// The lattice of a plane with the unit normal `normal`: that of the nearest of the `dominant` normals, or of one of the
    /// few directions.
    pub(super) fn across(normal: Local, dominant: &DominantNormals) -> Self {
        match dominant.nearest(normal) {
            Some([x, y, z]) => {
                let unit = unit([x, y, z]);
                Self::across_exactly(unit, unit.iamax(), [DOMINANT, x, y, z])
            }
            None => Self::across_rounded(normal),
        }
    }

    /// The lattice across the one of the few directions to which `normal` is rounded.
    pub(super) fn across_rounded(normal: Local) -> Self {
        let RoundedNormal {
            unit,
            largest,
            steps: [x, y, z],
        } = RoundedNormal::of(normal);
        Self::across_exactly(unit, largest, [largest as i8, x, y, z])
    }

    /// The lattice in the plane with the unit normal `normal`, whose component `largest` is the largest.
    fn across_exactly(normal: Local, largest: usize, key: [i8; 4]) -> Self {
        let mut u = Local::zeros();
        u[if largest == 0 { 2 } else { 0 }] = 1.0;
        let u = (u - normal * normal.dot(&u)).normalize();
        Self {
            key,
            axes: [u, normal.cross(&u)],
        }
    }

    /// By how much a surface with the unit normal `normal` is tilted against the lattice: one less the
    /// cosine of the angle.
    pub(super) fn tilt(&self, normal: Local) -> f64 {
        let [u, v] = self.axes;
        (1.0 - u.cross(&v).dot(&normal).abs()).max(0.0)
    }

    /// The node nearest to `position`, for an edge of `spacing` (CRS units).
    pub(super) fn nearest_node(&self, position: Local, spacing: f64) -> NearestNode {
        let [s, t] = self.axes.map(|axis| axis.dot(&position) / spacing);
        let below = (t / ROW_IN_SPACINGS).floor();
        let [lower, upper] = [below, below + 1.0].map(|row| {
            let line = row as i64;
            let shift = 0.5 * (line & 1) as f64;
            let column = (s - shift).round();
            NearestNode {
                index: [line, column as i64],
                way: [s - shift - column, t - row * ROW_IN_SPACINGS],
            }
        });
        if lower.squared() <= upper.squared() {
            lower
        } else {
            upper
        }
    }

    /// Moves `position` within the plane of the lattice to stand straight above or below the
    /// node nearest to it.
    pub(super) fn moved_to_node(&self, position: Local, spacing: f64) -> Local {
        let [along, across] = self.nearest_node(position, spacing).way;
        position - (self.axes[0] * along + self.axes[1] * across) * spacing
    }
}

impl NearestNode {
    /// Squared distance (spacings squared) from the position to the line through the node
    /// along the normal.
    pub(super) fn squared(&self) -> f64 {
        let [along, across] = self.way;
        along * along + across * across
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_of_like_normals_have_the_same_lattice() {
        let turned = |by: f64| Lattice::across_rounded(Local::new(0.03 * by, -0.02, 1.0));
        assert_eq!(turned(1.0), turned(-2.0));
        // The side from which a plane is seen does not matter.
        assert_eq!(
            Lattice::across_rounded(Local::new(0.1, 0.9, -0.2)),
            Lattice::across_rounded(-Local::new(0.1, 0.9, -0.2))
        );
        for normal in [Local::new(0.5, 0.6, 1.0), Local::new(-1.0, 0.2, 0.1)] {
            let [u, v] = Lattice::across_rounded(normal).axes;
            assert!(u.dot(&v).abs() < 1e-12 && (u.norm() - 1.0).abs() < 1e-12);
            assert!(u.cross(&v).dot(&normal.normalize()).abs() > 0.93);
        }
    }

    #[test]
    fn a_wall_with_a_dominant_normal_has_a_lattice_that_is_not_tilted() {
        let wall = Local::new(0.94, 0.34, 0.0).normalize();
        let walls = DominantNormals::among(std::iter::repeat_n(wall, 100));
        let lattice = Lattice::across(wall, &walls);
        assert!(lattice.tilt(wall) < 1e-4);
        assert!(Lattice::across_rounded(wall).tilt(wall) > 0.02);
        // Noise does not matter, and what faces elsewhere has another lattice.
        for askew in [Local::new(0.96, 0.3, 0.02), Local::new(-0.92, -0.36, 0.01)] {
            assert_eq!(Lattice::across(askew.normalize(), &walls), lattice);
        }
        let roof = Local::new(0.94, 0.34, 0.5).normalize();
        assert_eq!(Lattice::across(roof, &walls), Lattice::across_rounded(roof));
    }
}
