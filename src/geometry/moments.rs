//! Area, centroid and energy of a cell, and random points of it, by the fan of triangles from
//! the foot of its site.

use super::{Local, Patch, bisector::lift, cell::Cell};

/// The area, the centroid and the energy of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Area (CRS units squared).
    pub area: f64,
    /// Centroid, not projected: inside the hull of the cell, perhaps off the patch.
    pub centroid: Local,
    /// ∫ |x − site|² over the cell (CRS units to the fourth): its share of the energy (paper,
    /// equation 2).
    pub energy: f64,
}

impl Cell {
    /// The corner of the cell of `site` on `patch` that is farthest from the site.
    pub(crate) fn farthest_corner(&self, patch: &Patch, site: Local) -> Option<Local> {
        let corners = self.sides().map(|(corner, _)| corner);
        let farthest = corners.max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
        farthest.map(|corner| patch.seen_from(site, corner))
    }

    /// The moments of the cell of `site` on `patch`; `None` if nothing is left of the cell.
    pub fn moments(&self, patch: &Patch, site: Local) -> Option<Moments> {
        let foot = lift(&patch.heights_from(site), 0.0, 0.0);
        let (mut area, mut weighted, mut energy) = (0.0, Local::zeros(), 0.0);
        for (a, b) in self.sides() {
            let triangle = 0.5 * (a - foot).cross(&(b - foot)).norm();
            area += triangle;
            weighted += (a + b + foot) * (triangle / 3.0);
            energy += triangle / 6.0
                * (a.dot(&a)
                    + b.dot(&b)
                    + foot.dot(&foot)
                    + a.dot(&b)
                    + b.dot(&foot)
                    + foot.dot(&a));
        }
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let c = weighted / area;
        Some(Moments {
            area,
            centroid: patch.seen_from(site, c),
            energy,
        })
    }

    /// The way from the centroid of the cell of `site` on `patch` to its centroid by a density, which `density` gives at a
    /// position and which is taken to be linear between the corners of the cell and its foot; `None` if nothing is left of
    /// the cell.
    pub(crate) fn shift_by_density(
        &self,
        patch: &Patch,
        site: Local,
        density: impl Fn(Local) -> f64,
    ) -> Option<Local> {
        let foot = lift(&patch.heights_from(site), 0.0, 0.0);
        let at = |place: Local| density(patch.seen_from(site, place));
        let at_foot = at(foot);
        let (mut area, mut mass) = (0.0, 0.0);
        let (mut middle, mut weighted) = (Local::zeros(), Local::zeros());
        for (a, b) in self.sides() {
            let triangle = 0.5 * (a - foot).cross(&(b - foot)).norm();
            let (at_a, at_b) = (at(a), at(b));
            let (sum, places) = (at_a + at_b + at_foot, a + b + foot);
            area += triangle;
            middle += places * (triangle / 3.0);
            mass += sum * (triangle / 3.0);
            weighted += (places * sum + a * at_a + b * at_b + foot * at_foot) * (triangle / 12.0);
        }
        let shift = weighted / mass - middle / area;
        let is_finite = shift.iter().all(|c| c.is_finite());
        is_finite.then(|| patch.seen_from(site, shift) - patch.seen_from(site, Local::zeros()))
    }

    /// A point of the cell on the patch, uniform over the cell if `dice` is uniform in [0, 1)²;
    /// `None` if nothing is left of the cell.
    pub(crate) fn random_point(&self, patch: &Patch, site: Local, dice: [f64; 2]) -> Option<Local> {
        let [u, v, w] = patch.coordinates(site);
        let foot = Local::new(0.0, 0.0, patch.height(u, v) - w);
        let twice_area = |a: Local, b: Local| (a - foot).cross(&(b - foot)).norm();
        let total: f64 = self.sides().map(|(a, b)| twice_area(a, b)).sum();
        let mut rest = dice[0] * total;
        for (a, b) in self.sides() {
            let area = twice_area(a, b);
            if rest < area {
                // Evenly over the triangle: the root spreads along the fan.
                let along = (rest / area).sqrt();
                let x = foot + (a - foot) * along + (b - a) * (along * dice[1]);
                return Some(patch.point(u + x.x, v + x.y));
            }
            rest -= area;
        }
        None
    }
}
