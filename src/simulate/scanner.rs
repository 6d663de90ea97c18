//! A vehicle drives down the street with two profile scanners, one looking half
//! left and one half right; lines of points as mobile mapping gives them.

use serde::{Deserialize, Serialize};

use super::street::{Material, Street};
use crate::geometry::{Local, spread};

/// Points simulated together: a slice depends on nothing but its number.
pub(crate) const SLICE: u64 = 50_000;

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreetOptions {
    /// Length of the street (m).
    pub length: f64,
    /// Times that the vehicle drives down it.
    pub passes: u32,
    /// Points of all passes.
    pub points: u64,
    /// Standard deviation of the ranges (m); errors end at three of it.
    pub noise: f64,
    /// Decides everything that is not said here.
    pub seed: u64,
}

impl Default for StreetOptions {
    fn default() -> Self {
        Self {
            length: 120.0,
            passes: 2,
            points: 2_000_000,
            noise: 0.01,
            seed: 1,
        }
    }
}

/// A simulated return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedPoint {
    /// World coordinates (m).
    pub position: [f64; 3],
    /// Brighter the nearer and the more head-on.
    pub intensity: u16,
    /// Red, green, blue.
    pub color: [u16; 3],
    /// Seconds.
    pub gps_time: f64,
    /// ASPRS class.
    pub class: u8,
    /// Scan angle (degrees).
    pub angle: f64,
    /// Number of the pass, from 1.
    pub pass: u16,
}

/// Farthest return (m).
const RANGE: f64 = 60.0;
const SCANNER_HEIGHT: f64 = 2.4;
const SPEED: f64 = 8.0;
/// The street lies somewhere in a projected system, turned out of its axes.
const ORIGIN: [f64; 3] = [431_000.0, 5_400_000.0, 100.0];
const TURN: [f64; 2] = [0.939_692_620_785_908_4, 0.342_020_143_325_668_7];

impl Street {
    /// Points of pass `pass`, from 0.
    pub(crate) fn points_of_pass(&self, pass: u32) -> u64 {
        let passes = u64::from(self.options.passes.max(1));
        self.options.points / passes + u64::from(u64::from(pass) < self.options.points % passes)
    }

    /// Slices of pass `pass`.
    pub fn slices(&self, pass: u32) -> u64 {
        self.points_of_pass(pass).div_ceil(SLICE)
    }

    /// The points of slice `slice` of pass `pass`, in the order of their times.
    pub fn slice(&self, pass: u32, slice: u64) -> Vec<SimulatedPoint> {
        let total = self.points_of_pass(pass);
        let first = slice * SLICE;
        let count = SLICE.min(total.saturating_sub(first));
        let mut points = Vec::with_capacity(count as usize);
        // Lines as far apart as points on a line are at five metres.
        let per_metre = total as f64 / self.options.length;
        let lines = (per_metre / 31.0).sqrt();
        let per_line = (2.0 * per_metre / lines).max(8.0);
        let key = spread(self.options.seed ^ spread(u64::from(pass) << 40 | slice));
        let mut pulse = 2 * first;
        // A street has surfaces all along; a slice that meets none for this
        // long is beyond its end.
        let most = pulse + 400 * SLICE;
        while (points.len() as u64) < count && pulse < most {
            pulse += 1;
            let share = (first as f64 + points.len() as f64) / total as f64;
            if let Some(point) = self.pulse(pass, pulse, share, per_line, key) {
                points.push(point);
            }
        }
        points
    }

    /// `count` points of a scanner on a tripod, `along` metres down the street:
    /// as dense as the inverse square of the range.
    pub fn station(&self, along: f64, count: u64) -> Vec<[f64; 3]> {
        let origin = Local::new(along, -3.6, 1.7);
        let unit = |k: u64| {
            (spread(self.options.seed ^ spread(k ^ 0x57a7)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut points = Vec::new();
        let mut pulse = 0;
        while (points.len() as u64) < count && pulse < 400 * count {
            pulse += 1;
            // Even over the sphere.
            let z = 2.0 * unit(3 * pulse) - 1.0;
            let (sin, cos) = (unit(3 * pulse + 1) * std::f64::consts::TAU).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let direction = Local::new(across * cos, across * sin, z);
            if let Some((range, ..)) = self.cast(origin, direction, RANGE) {
                let error = (unit(3 * pulse + 2) - 0.5) * 12.0_f64.sqrt() * self.options.noise;
                points.push(to_world(origin + direction * (range + error)));
            }
        }
        points
    }

    fn pulse(
        &self,
        pass: u32,
        pulse: u64,
        share: f64,
        per_line: f64,
        key: u64,
    ) -> Option<SimulatedPoint> {
        let unit =
            |k: u64| (spread(key ^ spread(4 * pulse + k)) >> 11) as f64 / (1_u64 << 53) as f64;
        let is_back = pass % 2 == 1;
        let along = if is_back { 1.0 - share } else { share };
        let lane = if is_back { 1.6 } else { -1.6 } + 0.3 * f64::from(pass / 2);
        let origin = Local::new(along * self.options.length, lane, SCANNER_HEIGHT);
        // The mirror's angle from straight down; scanners take turns.
        let turn = (pulse as f64 + 0.3 * unit(0)) / per_line * std::f64::consts::TAU;
        let yaw = if pulse.is_multiple_of(2) { 1.0 } else { -1.0 } * std::f64::consts::FRAC_PI_4;
        let (sin, cos) = turn.sin_cos();
        let direction = Local::new(sin * yaw.sin(), sin * yaw.cos(), -cos);
        let (range, normal, material) = self.cast(origin, direction, RANGE)?;
        // The sum of three even errors is near enough to normal, and ends at
        // three standard deviations.
        let error = (unit(1) + unit(2) + unit(3) - 1.5) * 2.0 * self.options.noise;
        let at = origin + direction * (range + error);
        let head_on = normal.dot(&direction).abs();
        let (class, albedo, color) = look(material);
        let shade = 0.6 + 0.4 * normal.z.abs().max(0.5 * head_on) + 0.1 * unit(3);
        Some(SimulatedPoint {
            position: to_world(at),
            intensity: (60_000.0 * albedo * head_on / (1.0 + range / 15.0)) as u16,
            color: color.map(|c| (c * shade * 65_535.0).min(65_535.0) as u16),
            gps_time: 300_000.0 + f64::from(pass) * 3600.0 + share * self.options.length / SPEED,
            class,
            angle: turn.to_degrees().rem_euclid(360.0) - 180.0,
            pass: u16::try_from(pass + 1).unwrap_or(u16::MAX),
        })
    }

    /// What it was made by.
    pub fn options(&self) -> &StreetOptions {
        &self.options
    }

    /// Distance from `position` (world coordinates, m) to the nearest true
    /// surface.
    pub fn distance_to_surface(&self, position: [f64; 3]) -> f64 {
        self.distance(from_world(position))
    }

    /// Distance from `position` (world coordinates, m) to the nearest edge of
    /// kerbs, boxes, walls and windows; infinite beyond 40 m.
    pub fn distance_to_edge(&self, position: [f64; 3]) -> f64 {
        self.edge_distance(from_world(position))
    }
}

/// ASPRS class, brightness to the laser, and colour.
fn look(material: Material) -> (u8, f64, [f64; 3]) {
    match material {
        Material::Road => (11, 0.3, [0.28, 0.28, 0.30]),
        Material::Pavement => (2, 0.5, [0.55, 0.53, 0.50]),
        Material::Wall => (6, 0.7, [0.72, 0.58, 0.45]),
        Material::Glass => (6, 0.2, [0.25, 0.32, 0.40]),
        Material::Metal => (15, 0.6, [0.40, 0.42, 0.45]),
        Material::Wire => (14, 0.4, [0.12, 0.12, 0.12]),
        Material::Paint => (1, 0.8, [0.65, 0.12, 0.12]),
        Material::Leaf => (5, 0.5, [0.20, 0.50, 0.15]),
        Material::Wood => (5, 0.4, [0.35, 0.25, 0.15]),
    }
}

fn to_world(at: Local) -> [f64; 3] {
    let [cos, sin] = TURN;
    [
        ORIGIN[0] + cos * at.x - sin * at.y,
        ORIGIN[1] + sin * at.x + cos * at.y,
        ORIGIN[2] + at.z,
    ]
}

fn from_world(position: [f64; 3]) -> Local {
    let [cos, sin] = TURN;
    let [x, y, z] = [0, 1, 2].map(|axis| position[axis] - ORIGIN[axis]);
    Local::new(cos * x + sin * y, cos * y - sin * x, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn street(noise: f64) -> Street {
        Street::new(StreetOptions {
            length: 100.0,
            points: 40_001,
            noise,
            ..StreetOptions::default()
        })
    }

    fn all(street: &Street) -> Vec<SimulatedPoint> {
        (0..2)
            .flat_map(|pass| (0..street.slices(pass)).map(move |slice| (pass, slice)))
            .flat_map(|(pass, slice)| street.slice(pass, slice))
            .collect()
    }

    #[test]
    fn without_noise_points_lie_on_the_true_surfaces() {
        let street = street(0.0);
        let points = all(&street);
        assert_eq!(points.len(), 40_001);
        for point in &points {
            let distance = street.distance_to_surface(point.position);
            assert!(distance < 1e-6, "{distance} at {:?}", point.position);
        }
        // Every kind of surface is met.
        for class in [2, 5, 6, 11, 14, 15, 1] {
            assert!(points.iter().any(|p| p.class == class), "class {class}");
        }
    }

    #[test]
    fn noise_keeps_within_three_standard_deviations() {
        let street = street(0.02);
        let farthest = all(&street)
            .iter()
            .map(|p| street.distance_to_surface(p.position))
            .fold(0.0, f64::max);
        assert!((0.02..0.0601).contains(&farthest), "{farthest}");
    }

    #[test]
    fn the_distance_matches_that_to_every_shape() {
        let street = street(0.0);
        for point in all(&street).iter().step_by(97) {
            let mut at = from_world(point.position);
            at.z += 0.7;
            at.y *= 0.9;
            assert!((street.distance(at) - street.distance_to_all(at)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_world_and_back_is_no_way() {
        let at = Local::new(12.0, -3.0, 4.0);
        assert!((from_world(to_world(at)) - at).norm() < 1e-8);
    }
}
