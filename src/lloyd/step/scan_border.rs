//! The border of the scan near a site, as far as its fit knows it, and where that lets the site be.
//!
//! A threshold that leads sites across the gaps between the points of a scan leads them as far beyond its border, into the air;
//! there a simulated street had its points farthest from the truth. So with a local threshold a position near a border that no
//! point is near to must have the scan all around it, or the site returns to the border:
//!
//! ```text
//!     ·   ·  ·   ·              ·   ·  ·
//!       ·   x   ·  ·              ·   ·   ·   x
//!     ·   ·   ·   ·             ·  ·    ·
//!
//!     in a gap: the mean        beyond a border:
//!     of the points is near     it is far, and that way leads back
//! ```

use serde::{Deserialize, Serialize};

use super::restriction::Restriction;
use crate::{geometry::Local, lloyd::surface::Surface};

/// Share of the radius of a fit within which the scan lies all around a site that is far from a border. Farther away there can
/// be another surface, as the floor below the end of a wall.
const INNER_RADIUS_IN_FIT_RADII: f64 = 0.5;

/// The scan lies all around a site if the mean of the samples within that radius is nearer than this share of it. On a straight
/// border it is 0.42 away.
const LARGEST_INNER_OFFSET: f64 = 0.3;

/// A position with a point within this share of the threshold is on the scan, whatever is around it.
const NEAR_IN_THRESHOLDS: f64 = 0.5;

/// Radius of the ball whose points tell a gap from what lies beyond a border, but for that of the fit if that is smaller.
const BALL_IN_THRESHOLDS: f64 = 1.8;

/// In a smaller ball there are too few points to tell.
const LEAST_BALL_IN_THRESHOLDS: f64 = 1.5;

/// Distance of the mean of the points in a disc from its center, in radii, if the center is on a straight border: 4 / 3π.
const OFFSET_AT_BORDER: f64 = 0.42;

/// A site returns by this share of what the mean is farther away. A position that is a little beyond a border has the mean
/// farther away by 0.56 of that distance, so that the site returns by half of it: points are at random, and the mean is, too.
const RETURNED_SHARE: f64 = 0.9;

/// Where a position is, as the boundary restriction sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Standing {
    /// On the scan, or in a gap of it.
    OnScan,
    /// Beyond a border of the scan, to which this way leads back (CRS units).
    BeyondBorder(Local),
    /// Farther from the scan than the threshold.
    Away,
}

/// The border of the scan near a site, if there is one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ScanBorder {
    /// Spacing of the scan (CRS units).
    pub(super) input_spacing: f64,
    /// Whether the scan lies all around, so that no border is near.
    is_inner: bool,
    /// The point that was found last: the next position of the site is near it, too, more often than not.
    #[serde(skip, default = "nowhere")]
    witness: Local,
}

impl ScanBorder {
    /// The border near `site` of a scan of this `input_spacing`, by the `samples` within the `radius` of the fit (CRS units).
    pub(super) fn new(site: Local, samples: &[Local], input_spacing: f64, radius: f64) -> Self {
        let inner = INNER_RADIUS_IN_FIT_RADII * radius;
        Self {
            input_spacing,
            is_inner: lie_all_around(site, samples, inner, LARGEST_INNER_OFFSET),
            witness: nowhere(),
        }
    }

    /// Where `position` is.
    pub(super) fn place(&mut self, position: Local, surface: Surface<'_>) -> Standing {
        let threshold = self.threshold(surface);
        let ball = (BALL_IN_THRESHOLDS * threshold).min(surface.options.fit_radius);
        let tells_borders = surface.options.restriction == Restriction::Local
            && !self.is_inner
            && ball >= LEAST_BALL_IN_THRESHOLDS * threshold;
        if tells_borders && self.is_near(position, NEAR_IN_THRESHOLDS * threshold, surface) {
            return Standing::OnScan;
        }
        if !self.is_near(position, threshold, surface) {
            return Standing::Away;
        }
        let way_back = tells_borders.then(|| way_back(position, ball, surface));
        way_back
            .flatten()
            .map_or(Standing::OnScan, Standing::BeyondBorder)
    }

    /// Whether `position` is no farther from the scan than the threshold of the boundary restriction, be it beyond a border.
    pub(super) fn is_within_threshold(&mut self, position: Local, surface: Surface<'_>) -> bool {
        self.is_near(position, self.threshold(surface), surface)
    }

    /// The threshold of the boundary restriction (CRS units).
    fn threshold(&self, surface: Surface<'_>) -> f64 {
        let restriction = surface.options.restriction;
        restriction.threshold(self.input_spacing, surface.spacing())
    }

    /// Whether some point of the scan is within `radius` (CRS units) of `position`.
    fn is_near(&mut self, position: Local, radius: f64, surface: Surface<'_>) -> bool {
        if radius.is_infinite() {
            return position.iter().all(|c| c.is_finite());
        }
        // All comparisons refuse NaN.
        if (position - self.witness).norm_squared() <= radius * radius {
            return true;
        }
        let found = surface.scan.some_point_within(position, radius);
        self.witness = found.unwrap_or(self.witness);
        found.is_some()
    }
}

/// Whether the `samples` nearer to `center` than `radius` (CRS units) lie all around it: the distance to their mean is less
/// than this `largest_offset`, in radii. Without any there they do not.
pub(in crate::lloyd) fn lie_all_around(
    center: Local,
    samples: &[Local],
    radius: f64,
    largest_offset: f64,
) -> bool {
    let (mut count, mut sum) = (0.0, Local::zeros());
    for way in samples.iter().map(|sample| sample - center) {
        if way.norm_squared() < radius * radius {
            sum += way;
            count += 1.0;
        }
    }
    sum.norm() < largest_offset * radius * count
}

/// The way back to the border of the scan from `position`, if that is beyond one: if the mean of the points within the radius
/// `ball` (CRS units) is farther away than on a border.
fn way_back(position: Local, ball: f64, surface: Surface<'_>) -> Option<Local> {
    let offset = surface.scan.mean_within(position, ball)? - position;
    let excess = 1.0 - OFFSET_AT_BORDER * ball / offset.norm();
    (excess > 0.0).then(|| offset * (RETURNED_SHARE * excess))
}

/// A position that is near nothing.
fn nowhere() -> Local {
    Local::repeat(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::Quantization,
        lloyd::{Restriction, Scan, SolverOptions},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// Where `(x, y)` is on a plane with a point every 0.1, which ends at x = 0, for an output at 0.5.
    fn standing(restriction: Restriction, [x, y]: [f64; 2]) -> Standing {
        let columns = (-40..=0).flat_map(|i| (-40..40).map(move |j| [i, j]));
        let points = columns
            .map(|[i, j]| Local::new(0.1 * f64::from(i), 0.1 * f64::from(j), 0.0))
            .filter_map(|place| QUANTIZATION.stored(place))
            .collect();
        let options = SolverOptions {
            restriction,
            ..SolverOptions::new(0.5)
        };
        let scan = Scan::as_scanned(points, QUANTIZATION, &options);
        let position = Local::new(x, y, 0.0);
        let radius = options.fit_radius;
        let within = scan.points().iter().map(|&point| QUANTIZATION.local(point));
        let within: Vec<Local> = within
            .filter(|point| (point - position).norm() < radius)
            .collect();
        let mut border = ScanBorder::new(position, &within, 0.1, radius);
        border.place(position, Surface::new(&scan, &options))
    }

    #[test]
    fn a_gap_is_on_the_scan_and_what_is_as_far_from_it_beyond_the_border_is_not() {
        // Both are 0.07 from the nearest points.
        assert_eq!(
            standing(Restriction::Local, [-0.55, 0.05]),
            Standing::OnScan
        );
        let Standing::BeyondBorder(way) = standing(Restriction::Local, [0.05, 0.05]) else {
            panic!("on the scan");
        };
        assert!((-0.05..0.0).contains(&way.x), "{way}");
        assert!(way.yz().norm() < 1e-12, "{way}");
        assert_eq!(standing(Restriction::Local, [0.2, 0.0]), Standing::Away);
    }

    #[test]
    fn what_is_filled_ends_at_a_border() {
        // Five rows of returns, farther apart than sites are to be: the holes between them are closed.
        let rows = (-4..=0).flat_map(|i| (-4..=4).map(move |j| [i, j]));
        let points = rows
            .map(|[i, j]| Local::new(1.5 * f64::from(i), 1.5 * f64::from(j), 0.0))
            .filter_map(|place| QUANTIZATION.stored(place))
            .collect();
        let options = SolverOptions::new(1.0);
        let scan = Scan::new(points, QUANTIZATION, &options);
        let standing = |x: f64| {
            let position = Local::new(x, 0.7, 0.0);
            let mut border = ScanBorder::new(position, &[], 1.5, options.fit_radius);
            border.place(position, Surface::new(&scan, &options))
        };
        assert_eq!(standing(-0.8), Standing::OnScan);
        assert_eq!(standing(0.8), Standing::Away);
        let Standing::BeyondBorder(way) = standing(0.5) else {
            panic!("{:?}", standing(0.5));
        };
        assert!(way.x < -0.1, "{way}");
    }

    #[test]
    fn the_rule_of_the_paper_knows_no_border() {
        let global = |x| standing(Restriction::Global(0.1), [x, 0.0]);
        assert_eq!(global(0.09), Standing::OnScan);
        assert_eq!(global(0.11), Standing::Away);
        let far = standing(Restriction::None, [9.0, 0.0]);
        assert_eq!(far, Standing::OnScan);
        let nowhere = standing(Restriction::None, [f64::NAN, 0.0]);
        assert_eq!(nowhere, Standing::Away);
    }
}
