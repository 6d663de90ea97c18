//! The samples of the scan around a block of sites.

use crate::{
    geometry::{FacetSample, Local},
    lloyd::surface::Surface,
};

/// The samples in and around a box, for the patches at positions in the box.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    /// Each sample with the number of points that its voxel keeps, and its weight.
    in_box: Vec<(Local, u32, f32)>,
    /// Scratch: the samples of one patch.
    in_ball: Vec<Local>,
    /// Scratch: their weights.
    weights: Vec<f64>,
    /// Scratch: the samples among which facets are sought.
    of_facets: Vec<FacetSample>,
}

impl Samples {
    /// Collects the samples that patches at positions from `low` to `high` may need.
    pub(crate) fn gather_box(&mut self, surface: Surface<'_>, low: Local, high: Local) {
        let reach = Local::repeat(surface.options.fit_radius);
        self.in_box.clear();
        let scan = surface.scan;
        scan.samples()
            .visit_box(low - reach, high + reach, |index, sample| {
                self.in_box
                    .push((sample, scan.count(index), scan.weight(index)));
            });
    }

    /// The samples of the box nearer to `position` than `radius` (CRS units), their weights, and
    /// the number of points that their voxels keep.
    pub(crate) fn in_ball(&mut self, position: Local, radius: f64) -> (&[Local], &[f64], u64) {
        let mut points = 0;
        self.in_ball.clear();
        self.weights.clear();
        for &(sample, count, weight) in &self.in_box {
            if (sample - position).norm_squared() < radius * radius {
                self.in_ball.push(sample);
                self.weights.push(f64::from(weight));
                points += u64::from(count);
            }
        }
        (&self.in_ball, &self.weights, points)
    }

    /// The samples in the wide neighbourhood of `position`, wherever the box is, and the number of points that each is the mean of. The
    /// result of an earlier [`in_ball`](Self::in_ball) is lost.
    pub(super) fn in_wide_ball(
        &mut self,
        position: Local,
        surface: Surface<'_>,
    ) -> (&[Local], &[f64]) {
        let scan = surface.scan;
        self.in_ball.clear();
        self.weights.clear();
        visit_wide_ball(position, surface, |index, sample| {
            self.in_ball.push(sample);
            self.weights.push(scan.points_of_sample(index));
        });
        (&self.in_ball, &self.weights)
    }

    /// The samples among which the facets near `position` are sought, wherever the box is.
    pub(super) fn of_facets(
        &mut self,
        position: Local,
        surface: Surface<'_>,
    ) -> &mut [FacetSample] {
        let radius = surface.options.wide_radius();
        let (scan, found) = (surface.scan, &mut self.of_facets);
        found.clear();
        visit_wide_ball(position, surface, |index, sample| {
            let weight = f64::from(scan.weight(index));
            found.push(FacetSample::new(sample, position, weight, radius));
        });
        found
    }

    /// The samples of the scan within the fit radius of `position`, wherever the box is. The
    /// result of an earlier [`in_ball`](Self::in_ball) is lost.
    pub(super) fn in_fit_radius(&mut self, position: Local, surface: Surface<'_>) -> &[Local] {
        let radius = surface.options.fit_radius;
        let samples = surface.scan.samples();
        samples.gather(position, radius, &mut self.in_ball);
        &self.in_ball
    }
}

/// Calls `visit` with the index and the place of every sample in the wide neighbourhood of `position`.
fn visit_wide_ball(position: Local, surface: Surface<'_>, mut visit: impl FnMut(u32, Local)) {
    let radius = surface.options.wide_radius();
    let samples = surface.scan.samples();
    samples.visit_around(position, radius, |index, sample| {
        if (sample - position).norm_squared() < radius * radius {
            visit(index, sample);
        }
    });
}
