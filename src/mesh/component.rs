//! The sums of a component of a mesh, and the side that it is seen from.
//!
//! A component looks towards the scanner, if it is known where that stood. Otherwise it looks upwards, if the sum of
//! its triangles does by a tenth of their area at least; else outwards, if it encloses a volume; else, as a
//! wall without a ground, northwards or eastwards. All sums are of integers, so that they do not depend
//! on the parts.

use crate::geometry::Stored;

/// The least share of the area that looks upwards in the mean, for a component to look upwards.
const LEAST_UPWARD_SHARE: f64 = 0.1;
/// The least volume that a component encloses, as a share of that of a sphere of its area.
const LEAST_ENCLOSED_SHARE: f64 = 0.01;

/// Sums over the turned triangles of a component, in stored units.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Component {
    pub(super) triangles: u64,
    /// The sum of the vectors of the doubled areas.
    doubled_areas: [i128; 3],
    /// The sum of the doubled areas.
    doubled_area: i128,
    /// Six times the volume of the tetrahedra between the triangles and the origin.
    volume: i128,
    /// The sum of the first corners.
    corners: [i128; 3],
    /// The doubled area of the triangles that look towards the scanner less that of those that look
    /// away.
    towards_scanner: i128,
}

impl Component {
    /// Adds a turned triangle; it looks towards the scanner, or away, or that is not known.
    pub(super) fn add(&mut self, [a, b, c]: [Stored; 3], looks_at_scanner: Option<bool>) {
        let way = |from: Stored, to: Stored| {
            [(from.x, to.x), (from.y, to.y), (from.z, to.z)]
                .map(|(f, t)| i64::from(t) - i64::from(f))
        };
        let (u, v) = (way(a, b), way(a, c));
        let cross = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        let corner = [a.x, a.y, a.z].map(i128::from);
        self.triangles += 1;
        for axis in 0..3 {
            let cross = i128::from(cross[axis]);
            self.doubled_areas[axis] += cross;
            self.volume += corner[axis] * cross;
            self.corners[axis] += corner[axis];
        }
        let squared: f64 = cross.iter().map(|&c| (c as f64) * (c as f64)).sum();
        let doubled_area = squared.sqrt().round() as i128;
        self.doubled_area += doubled_area;
        self.towards_scanner += match looks_at_scanner {
            Some(true) => doubled_area,
            Some(false) => -doubled_area,
            None => 0,
        };
    }

    /// Adds the sums of another component, whose triangles were turned the same way or not.
    pub(super) fn merge(&mut self, other: &Self, is_reversed: bool) {
        let sign = if is_reversed { -1 } else { 1 };
        self.triangles += other.triangles;
        for axis in 0..3 {
            self.doubled_areas[axis] += sign * other.doubled_areas[axis];
            self.corners[axis] += other.corners[axis];
        }
        self.doubled_area += other.doubled_area;
        self.volume += sign * other.volume;
        self.towards_scanner += sign * other.towards_scanner;
    }

    /// Whether the component looks the wrong way.
    pub(super) fn looks_away(&self) -> bool {
        if self.towards_scanner != 0 {
            return self.towards_scanner < 0;
        }
        let [x, y, z] = self.doubled_areas.map(|sum| sum as f64);
        let area = self.doubled_area as f64;
        if z.abs() >= LEAST_UPWARD_SHARE * area {
            return z < 0.0;
        }
        // The volume as seen from the middle of the component.
        let count = self.triangles.max(1) as f64;
        let seen_from =
            |axis: usize| self.corners[axis] as f64 / count * self.doubled_areas[axis] as f64;
        let volume = self.volume as f64 - (0..3).map(seen_from).sum::<f64>();
        // Six times the volume of a sphere, by its doubled area.
        let sphere = (area * 0.5).powi(3).sqrt() / std::f64::consts::PI.sqrt();
        if volume.abs() >= LEAST_ENCLOSED_SHARE * sphere {
            return volume < 0.0;
        }
        (y, x) < (0.0, 0.0)
    }
}
