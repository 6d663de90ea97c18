//! The camera: from positions in space to positions in the picture.

use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

/// The view of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum View {
    /// The view from above, without perspective, north up.
    Top,
    /// The view from above, aslant to the longer side of the cloud.
    #[default]
    Oblique,
    /// The view from within, at eye height, along the longer side of the cloud.
    Street,
}

/// The extent of a cloud.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene {
    /// Least coordinates.
    pub(crate) min: [f64; 3],
    /// Greatest coordinates.
    pub(crate) max: [f64; 3],
    /// The mean of all points.
    pub(crate) middle: [f64; 3],
    /// The horizontal unit vector along which the points reach farthest.
    pub(crate) along: [f64; 2],
}

impl Scene {
    /// The scene of points at `positions`, without the share `stray` at either end of each axis;
    /// `None` without points.
    pub(crate) fn of(positions: &[[f64; 3]], stray: f64) -> Option<Self> {
        let left_out = (stray * positions.len() as f64) as usize;
        let side = |axis: usize| {
            let mut sorted: Vec<f64> = positions.iter().map(|position| position[axis]).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let last = sorted.len().checked_sub(1 + left_out)?;
            Some((*sorted.get(left_out)?, *sorted.get(last)?))
        };
        let sides = [side(0)?, side(1)?, side(2)?];
        let count = positions.len() as f64;
        let middle = [0, 1, 2].map(|axis| positions.iter().map(|p| p[axis]).sum::<f64>() / count);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for position in positions {
            let [x, y] = [position[0] - middle[0], position[1] - middle[1]];
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
        }
        // The direction of the larger eigenvalue.
        let angle = 0.5 * f64::atan2(2.0 * xy, xx - yy);
        Some(Self {
            min: sides.map(|(min, _)| min),
            max: sides.map(|(_, max)| max),
            middle,
            along: [angle.cos(), angle.sin()],
        })
    }
}

/// A projection from positions in space to positions in a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    eye: Vector3<f64>,
    /// The unit vectors to the right, upwards and into the picture, as rows.
    axes: Matrix3<f64>,
    /// Pixels to a unit of length: at a distance of one, or everywhere without perspective.
    focus: f64,
    is_perspective: bool,
    middle: [f64; 2],
    nearest: f64,
}

/// Height of the eye of the street view above the lowest point, in heights of the scene.
const EYE_HEIGHT: f64 = 0.15;
/// Opening angle of the street view across the picture.
const STREET_ANGLE_IN_DEGREES: f64 = 70.0;
/// Opening angle of the oblique view across the shorter side of the picture.
const OBLIQUE_ANGLE_IN_DEGREES: f64 = 35.0;

impl Camera {
    /// A camera that shows `scene` in a picture of `size` pixels.
    pub(crate) fn new(view: View, scene: &Scene, size: [u32; 2]) -> Self {
        let (min, max) = (Vector3::from(scene.min), Vector3::from(scene.max));
        let (center, extent) = ((min + max) * 0.5, max - min);
        let along = Vector3::new(scene.along[0], scene.along[1], 0.0);
        let [width, height] = size.map(f64::from);
        let middle = [0.5 * width, 0.5 * height];
        let radius = (0.5 * extent.norm()).max(1e-6);
        match view {
            View::Top => {
                let fit = (width / extent.x.max(1e-6)).min(height / extent.y.max(1e-6));
                Self {
                    eye: Vector3::new(center.x, center.y, max.z + 1.0),
                    axes: axes(-Vector3::z(), Vector3::y()),
                    focus: 0.96 * fit,
                    is_perspective: false,
                    middle,
                    nearest: 0.0,
                }
            }
            View::Oblique => {
                // Half along and half across, from the side that is south.
                let across = Vector3::new(-along.y, along.x, 0.0);
                let across = if across.y < 0.0 { -across } else { across };
                let forward = (along * 0.7 + across - Vector3::z()).normalize();
                let half = (0.5 * OBLIQUE_ANGLE_IN_DEGREES).to_radians();
                let focus = 0.5 * height.min(width) / half.tan();
                // A ball around the whole cloud overfills the picture's shorter side at this
                // distance; most clouds are flat and wide, and fit all the same.
                let distance = 0.75 * radius / half.sin();
                Self {
                    eye: center - forward * distance,
                    axes: axes(forward, Vector3::z()),
                    focus,
                    is_perspective: true,
                    middle,
                    nearest: 0.05 * distance,
                }
            }
            View::Street => {
                let length = extent.x.hypot(extent.y);
                let forward = (along - Vector3::new(0.0, 0.0, 0.06)).normalize();
                let half = (0.5 * STREET_ANGLE_IN_DEGREES).to_radians();
                let [x, y, _] = scene.middle;
                let floor = Vector3::new(x, y, min.z + EYE_HEIGHT * extent.z);
                Self {
                    eye: floor - along * (0.42 * length),
                    axes: axes(forward, Vector3::z()),
                    focus: 0.5 * width / half.tan(),
                    is_perspective: true,
                    middle,
                    nearest: 0.005 * length,
                }
            }
        }
    }

    /// The position of `position` in the picture (pixels from its upper left corner), its distance
    /// along the view, and the pixels to a unit of length there; `None` behind the eye.
    pub(crate) fn project(&self, position: [f64; 3]) -> Option<([f64; 2], f64, f64)> {
        let seen = self.axes * (Vector3::from(position) - self.eye);
        let scale = match self.is_perspective {
            true if seen.z < self.nearest => return None,
            true => self.focus / seen.z,
            false => self.focus,
        };
        let position = [
            self.middle[0] + seen.x * scale,
            self.middle[1] - seen.y * scale,
        ];
        Some((position, seen.z, scale))
    }
}

/// The unit vectors to the right, upwards and `forward`, as rows.
fn axes(forward: Vector3<f64>, up: Vector3<f64>) -> Matrix3<f64> {
    let right = forward.cross(&up).normalize();
    let up = right.cross(&forward);
    Matrix3::from_rows(&[right.transpose(), up.transpose(), forward.transpose()])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scene of points along a diagonal, with two strays.
    fn scene() -> Scene {
        let mut positions: Vec<[f64; 3]> = (0..1000)
            .map(|i| f64::from(i) / 999.0)
            .map(|share| [100.0 * share, 50.0 * share, 10.0 * (7.0 * share).fract()])
            .collect();
        positions.extend([[1e6, -1e6, 0.0], [-1e6, 1e6, 0.0]]);
        Scene::of(&positions, 0.002).unwrap()
    }

    #[test]
    fn a_scene_is_where_most_points_are() {
        let scene = scene();
        assert!(scene.min[0] > -1.0 && scene.max[0] < 101.0 && scene.max[1] < 51.0);
        let positions: Vec<[f64; 3]> = (0..50)
            .map(|i| [2.0 * f64::from(i), f64::from(i), 0.0])
            .collect();
        let [x, y] = Scene::of(&positions, 0.0).unwrap().along;
        assert!((y / x - 0.5).abs() < 1e-9);
        assert!(Scene::of(&[], 0.0).is_none());
    }

    #[test]
    fn east_is_right_and_north_is_up() {
        let camera = Camera::new(View::Top, &scene(), [400, 300]);
        let at = |x, y| camera.project([x, y, 0.0]).unwrap().0;
        let [[west, south], [east, north]] = [at(0.0, 0.0), at(100.0, 50.0)];
        assert!(west < east && north < south);
        assert!(west >= 0.0 && east <= 400.0 && north >= 0.0 && south <= 300.0);
    }

    #[test]
    fn what_is_near_is_large_and_what_is_behind_is_not_seen() {
        for view in [View::Oblique, View::Street] {
            let camera = Camera::new(view, &scene(), [400, 300]);
            let eye: [f64; 3] = camera.eye.into();
            let ahead = |d: f64| {
                let position = camera.eye + camera.axes.row(2).transpose() * d;
                camera.project(position.into())
            };
            assert!(camera.project(eye).is_none() && ahead(-5.0).is_none());
            let (near, far) = (ahead(30.0).unwrap(), ahead(60.0).unwrap());
            assert!(near.2 > far.2 && near.1 < far.1);
            assert!((near.0[0] - 200.0).abs() < 1e-9 && (near.0[1] - 150.0).abs() < 1e-9);
        }
    }
}
