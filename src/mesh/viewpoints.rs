//! Where the scanner was when it saw a point.

use crate::geometry::Local;

/// The longest time between two waypoints of a trajectory over which the scanner is taken to have moved straight, in
/// seconds; beyond the nearer waypoint counts.
const LONGEST_GAP: f64 = 10.0;

/// Where the scanner was.
#[derive(Clone, Debug, Default)]
pub(crate) enum Viewpoints {
    /// It is not known.
    #[default]
    Unknown,
    /// It stood in these places (local coordinates); each point was seen from the nearest.
    Places(Vec<Local>),
    /// It moved: the GPS times (seconds) and places of its way, in the order of the times.
    Way(Vec<(f64, Local)>),
}

impl Viewpoints {
    /// Where the scanner was when it saw a point at `position` at the GPS `time`; `None` if that is not known.
    pub(crate) fn of(&self, position: Local, time: f64) -> Option<Local> {
        match self {
            Self::Unknown => None,
            Self::Places(places) => places.iter().copied().min_by(|a, b| {
                let distance = |place: &Local| (place - position).norm_squared();
                distance(a).total_cmp(&distance(b))
            }),
            Self::Way(way) => at_time(way, time),
        }
    }
}

/// The place on a way at a time; the nearer end of the way for a time before or after it.
fn at_time(way: &[(f64, Local)], time: f64) -> Option<Local> {
    if time.is_nan() {
        return None;
    }
    let after = way.partition_point(|&(t, _)| t < time);
    let (Some(&(end, to)), Some(&(start, from))) = (way.get(after), way[..after].last()) else {
        return way.get(after).or(way.last()).map(|&(_, place)| place);
    };
    let share = (time - start) / (end - start);
    if end - start > LONGEST_GAP {
        return Some(if share < 0.5 { from } else { to });
    }
    Some(from + (to - from) * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scanner_moves_straight_between_waypoints() {
        let place = |x: f64| Local::new(x, 0.0, 2.0);
        let way = Viewpoints::Way(vec![
            (10.0, place(0.0)),
            (12.0, place(4.0)),
            (60.0, place(9.0)),
        ]);
        let at = |time: f64| way.of(Local::zeros(), time).unwrap().x;
        assert_eq!(
            [at(5.0), at(10.0), at(11.0), at(12.0)],
            [0.0, 0.0, 2.0, 4.0]
        );
        assert_eq!(
            [at(20.0), at(50.0), at(99.0)],
            [4.0, 9.0, 9.0],
            "a gap has no middle"
        );
        assert_eq!(way.of(Local::zeros(), f64::NAN), None);
        assert_eq!(Viewpoints::Way(Vec::new()).of(Local::zeros(), 1.0), None);
    }

    #[test]
    fn a_point_was_seen_from_the_nearest_place() {
        let places = Viewpoints::Places(vec![Local::zeros(), Local::new(10.0, 0.0, 0.0)]);
        assert_eq!(
            places.of(Local::new(6.0, 0.0, 0.0), 0.0),
            Some(Local::new(10.0, 0.0, 0.0))
        );
        assert_eq!(Viewpoints::Unknown.of(Local::zeros(), 0.0), None);
    }
}
