//! A vehicle drives down the street with two profile scanners, one of which faces half left and
//! one half right. They give lines of points, as in mobile mapping.

use std::f64::consts::{FRAC_PI_4, TAU};

use super::{random::unit, solids::Hit, street::Street, world::to_world};
use crate::geometry::{Local, spread};

/// The number of points that are simulated together: a slice depends on nothing but its number.
const SLICE_POINTS: u64 = 50_000;
/// The number of pulses for each point of a slice after which the slice ends. A street has
/// surfaces everywhere, so that a slice that meets so few lies beyond its end.
const MOST_PULSES_PER_POINT: u64 = 400;

/// The range of the farthest return (m).
pub(super) const LARGEST_RANGE: f64 = 60.0;
/// The height of the scanners above the road (m).
const SCANNER_HEIGHT: f64 = 2.4;
/// The speed of the vehicle (m/s).
const SPEED: f64 = 8.0;

/// The time between two waypoints of the vehicle (s).
const SECONDS_BETWEEN_WAYPOINTS: f64 = 0.5;

/// The class of stray returns: low noise.
const NOISE: u8 = 7;

/// A simulated return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedPoint {
    /// World coordinates (m).
    pub position: [f64; 3],
    /// Intensity: the brighter the nearer and the more head-on.
    pub intensity: u16,
    /// Red, green and blue.
    pub color: [u16; 3],
    /// GPS time (s).
    pub gps_time: f64,
    /// ASPRS class.
    pub class: u8,
    /// Scan angle (degrees).
    pub angle: f64,
    /// Number of the pass, from 1.
    pub pass: u16,
}

/// A slice of a pass while it is simulated.
struct Slice {
    pass: u32,
    /// The number of pulses in a turn of the mirrors.
    pulses_per_turn: f64,
    /// The hash that the noise of the slice follows from.
    hash: u64,
}

impl Street {
    /// Returns the number of points of a pass, counted from 0.
    fn points_of_pass(&self, pass: u32) -> u64 {
        let passes = u64::from(self.options.passes.max(1));
        self.options.points / passes + u64::from(u64::from(pass) < self.options.points % passes)
    }

    /// Returns the number of slices of a pass, counted from 0.
    pub fn slices(&self, pass: u32) -> u64 {
        self.points_of_pass(pass).div_ceil(SLICE_POINTS)
    }

    /// Returns the points of a slice of a pass, both counted from 0, in the order of their
    /// times.
    pub fn slice(&self, pass: u32, slice: u64) -> Vec<SimulatedPoint> {
        let total = self.points_of_pass(pass);
        let first = slice * SLICE_POINTS;
        let count = SLICE_POINTS.min(total.saturating_sub(first));
        let mut points = Vec::with_capacity(count as usize);
        // Lines are as far apart as the points of a line are at a distance of five metres.
        let per_metre = total as f64 / self.options.length;
        let lines = (per_metre / 31.0).sqrt();
        let slice = Slice {
            pass,
            pulses_per_turn: (2.0 * per_metre / lines).max(8.0),
            hash: spread(self.options.seed ^ spread(u64::from(pass) << 40 | slice)),
        };
        let mut pulse = 2 * first;
        let last = pulse + MOST_PULSES_PER_POINT * SLICE_POINTS;
        while (points.len() as u64) < count && pulse < last {
            pulse += 1;
            let share = (first as f64 + points.len() as f64) / total as f64;
            points.extend(self.pulse(&slice, pulse, share));
        }
        points
    }

    /// Returns `count` points of a scanner on a tripod, `along` metres down the street. Their
    /// density falls with the square of the range.
    pub fn station(&self, along: f64, count: u64) -> Vec<[f64; 3]> {
        let origin = Local::new(along, -3.6, 1.7);
        let random = |k: u64| unit(spread(self.options.seed ^ spread(k ^ 0x57a7)));
        let mut points = Vec::new();
        let mut pulse = 0;
        while (points.len() as u64) < count && pulse < MOST_PULSES_PER_POINT * count {
            pulse += 1;
            // Directions are evenly spread over the sphere.
            let z = 2.0 * random(3 * pulse) - 1.0;
            let (sin, cos) = (random(3 * pulse + 1) * TAU).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let direction = Local::new(across * cos, across * sin, z);
            if let Some(hit) = self.cast(origin, direction, LARGEST_RANGE) {
                let error = (random(3 * pulse + 2) - 0.5) * 12.0_f64.sqrt() * self.options.noise;
                points.push(to_world(origin + direction * (hit.range + error)));
            }
        }
        points
    }

    /// Returns the way of the scanner: its GPS times (s) and places (world coordinates, m) in all passes.
    pub(crate) fn way(&self) -> Vec<(f64, [f64; 3])> {
        let seconds = self.options.length / SPEED;
        let steps = (seconds / SECONDS_BETWEEN_WAYPOINTS).ceil().max(1.0);
        let waypoint = |pass: u32, step: u32| {
            let share = f64::from(step) / steps;
            (
                self.gps_time(pass, share),
                to_world(self.scanner(pass, share)),
            )
        };
        (0..self.options.passes)
            .flat_map(|pass| (0..=steps as u32).map(move |step| waypoint(pass, step)))
            .collect()
    }

    /// Returns where the scanner is when the vehicle has driven this share of the street: it drives down the street and
    /// back, in lanes.
    fn scanner(&self, pass: u32, share: f64) -> Local {
        let is_back = pass % 2 == 1;
        let along = if is_back { 1.0 - share } else { share };
        let lane = if is_back { 1.6 } else { -1.6 } + 0.3 * f64::from(pass / 2);
        Local::new(along * self.options.length, lane, SCANNER_HEIGHT)
    }

    /// Returns the GPS time (s) when the vehicle has driven this share of the street.
    fn gps_time(&self, pass: u32, share: f64) -> f64 {
        300_000.0 + f64::from(pass) * 3600.0 + share * self.options.length / SPEED
    }

    /// Returns the return of a pulse that is sent when the vehicle has driven this share of the
    /// street.
    fn pulse(&self, slice: &Slice, pulse: u64, share: f64) -> Option<SimulatedPoint> {
        let pass = slice.pass;
        let random = |k: u64| unit(spread(slice.hash ^ spread(4 * pulse + k)));

        let origin = self.scanner(pass, share);

        // The angle of the mirror counts from straight down; the scanners alternate.
        let turn = (pulse as f64 + 0.3 * random(0)) / slice.pulses_per_turn * TAU;
        let yaw = if pulse.is_multiple_of(2) { 1.0 } else { -1.0 } * FRAC_PI_4;
        let (sin, cos) = turn.sin_cos();
        let direction = Local::new(sin * yaw.sin(), sin * yaw.cos(), -cos);
        let Hit {
            range,
            normal,
            material,
        } = self.cast_in_pass(pass, origin, direction, LARGEST_RANGE)?;

        // The sum of three uniform errors is nearly normal, and ends at three standard
        // deviations.
        let error = (random(1) + random(2) + random(3) - 1.5) * 2.0 * self.options.noise;

        let stray = |k: u64| unit(spread(slice.hash ^ spread(!(8 * pulse + k))));
        let is_stray = stray(0) < self.options.strays;
        let range = match is_stray {
            true => self.stray_range(origin, direction, range, |k| stray(k + 1)),
            false => range,
        };
        let at = origin + direction * (range + error);

        let head_on = normal.dot(&direction).abs();
        let (class, reflectance, color) = match is_stray {
            true => (NOISE, 0.1, [0.7; 3]),
            false => material.appearance(),
        };
        let shade = 0.6 + 0.4 * normal.z.abs().max(0.5 * head_on) + 0.1 * random(3);
        Some(SimulatedPoint {
            position: to_world(at),
            intensity: (60_000.0 * reflectance * head_on / (1.0 + range / 15.0)) as u16,
            color: color.map(|c| (c * shade * 65_535.0).min(65_535.0) as u16),
            gps_time: self.gps_time(pass, share),
            class,
            angle: turn.to_degrees().rem_euclid(360.0) - 180.0,
            pass: u16::try_from(pass + 1).unwrap_or(u16::MAX),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::StreetOptions;

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
    fn strays_are_as_many_as_asked_for_and_all_others_are_true() {
        let clean = street(0.0);
        let street = Street::new(StreetOptions {
            strays: 0.02,
            ..*clean.options()
        });
        let points = all(&street);
        let (strays, others): (Vec<_>, Vec<_>) = points.iter().partition(|p| p.class == NOISE);
        let share = strays.len() as f64 / points.len() as f64;
        assert!((0.018..0.022).contains(&share), "{share}");
        let distance = |p: &&SimulatedPoint| street.distance_to_surface(p.position);
        assert!(others.iter().all(|p| distance(p) < 1e-6));
        // Of rain and echoes most are far from any surface, in front of it and behind.
        let far = strays.iter().filter(|p| distance(p) > 0.1).count();
        let below = strays.iter().filter(|p| p.position[2] < 99.0).count();
        assert!(
            10 * far > 9 * strays.len() && 10 * below > strays.len(),
            "{far} {below}"
        );
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
}
