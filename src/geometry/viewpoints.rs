//! Where the scanner was when it saw a point.

use super::Local;

/// The longest time between two waypoints over which the scanner is taken to have moved straight, in seconds.
const LONGEST_GAP: f64 = 10.0;
/// The time before or after a waypoint at which the scanner is certain to have been near it, in seconds.
const NEAR_A_WAYPOINT: f64 = 1.0;

/// Where the scanner was.
#[derive(Clone, Debug, Default)]
pub(crate) enum Viewpoints {
    /// It is not known.
    #[default]
    Unknown,
    /// It stood in these places (local coordinates); each point was seen from the nearest.
    Places(Vec<Local>),
    /// It moved.
    Moving(ScannerWay),
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
            Self::Moving(way) => way.near(time),
        }
    }
}

/// The GPS times (seconds) and places (local coordinates) of a scanner's way, in the order of the times.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ScannerWay(pub(crate) Vec<(f64, Local)>);

impl ScannerWay {
    /// The first and the last time.
    pub(crate) fn times(&self) -> Option<[f64; 2]> {
        let time = |&(time, _): &(f64, Local)| time;
        Some([self.0.first().map(time)?, self.0.last().map(time)?])
    }

    /// Where the scanner was at a time: on its way or, where the way has a gap or has ended, at the waypoint whose time is
    /// nearest.
    fn near(&self, time: f64) -> Option<Local> {
        self.on_way(time)
            .or_else(|| self.nearest(time).map(|(_, place)| place))
    }

    /// Where the scanner certainly was at a time; `None` where its way has a gap, or has ended.
    pub(crate) fn at(&self, time: f64) -> Option<Local> {
        let is_near = |(waypoint, _): &(f64, Local)| (waypoint - time).abs() <= NEAR_A_WAYPOINT;
        let near = || self.nearest(time).filter(is_near);
        self.on_way(time).or_else(|| near().map(|(_, place)| place))
    }

    /// The place at a time between two waypoints without a gap.
    fn on_way(&self, time: f64) -> Option<Local> {
        let [before, after] = self.around(time);
        let ((start, from), (end, to)) = (before?, after?);
        (end - start <= LONGEST_GAP).then(|| from + (to - from) * ((time - start) / (end - start)))
    }

    fn nearest(&self, time: f64) -> Option<(f64, Local)> {
        let distance = |(waypoint, _): &(f64, Local)| (waypoint - time).abs();
        let around = self.around(time).into_iter().flatten();
        around.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The last waypoint before a time, and the first one that is not; none for NaN.
    fn around(&self, time: f64) -> [Option<(f64, Local)>; 2] {
        let after = self.0.partition_point(|&(waypoint, _)| waypoint < time);
        match time.is_nan() {
            true => [None, None],
            false => [self.0[..after].last().copied(), self.0.get(after).copied()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scanner_moves_straight_between_waypoints() {
        let place = |x: f64| Local::new(x, 0.0, 2.0);
        let way = ScannerWay(vec![
            (10.0, place(0.0)),
            (12.0, place(4.0)),
            (60.0, place(9.0)),
        ]);
        let at = |time: f64| way.near(time).unwrap().x;
        assert_eq!(
            [at(5.0), at(10.0), at(11.0), at(12.0)],
            [0.0, 0.0, 2.0, 4.0]
        );
        assert_eq!(
            [at(20.0), at(50.0), at(99.0)],
            [4.0, 9.0, 9.0],
            "a gap has no middle"
        );
        let at = |time: f64| way.at(time).map(|place| place.x);
        assert_eq!([at(9.5), at(11.0), at(12.5)], [0.0, 2.0, 4.0].map(Some));
        assert_eq!(
            [at(8.0), at(20.0), at(59.5), at(62.0)],
            [None, None, Some(9.0), None]
        );
        assert_eq!(way.near(f64::NAN), None);
        assert_eq!(ScannerWay(Vec::new()).near(1.0), None);
        assert_eq!(way.times(), Some([10.0, 60.0]));
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
