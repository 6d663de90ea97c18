//! From cell to cell of a grid along a ray: J. Amanatides, A. Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*,
//! Eurographics 1987.

/// The cells of a grid with `D` axes that a ray passes, in order and without end, each with the distance along the ray at
/// which the ray enters it.
#[derive(Clone, Debug)]
pub(crate) struct GridWalk<const D: usize> {
    cell: [i32; D],
    entered: f64,
    /// Which way the ray passes the cells, by axis.
    step: [i32; D],
    /// The distance along the ray between two borders of cells.
    width: [f64; D],
    /// The distance along the ray to the next border.
    border: [f64; D],
}

impl<const D: usize> GridWalk<D> {
    /// The cells of this `edge` from `origin` on.
    pub(crate) fn new(origin: [f64; D], direction: [f64; D], edge: f64) -> Self {
        let cell = origin.map(|o| (o / edge).floor() as i32);
        let to_border = |axis: usize| {
            let d = direction[axis];
            let border = f64::from(cell[axis]) + if d < 0.0 { 0.0 } else { 1.0 };
            match d == 0.0 {
                true => f64::INFINITY,
                false => (border * edge - origin[axis]) / d,
            }
        };
        Self {
            cell,
            entered: 0.0,
            step: direction.map(|d| if d < 0.0 { -1 } else { 1 }),
            width: direction.map(|d| (edge / d).abs()),
            border: std::array::from_fn(to_border),
        }
    }
}

impl<const D: usize> Iterator for GridWalk<D> {
    type Item = ([i32; D], f64);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let passed = (self.cell, self.entered);
        let mut axis = 0;
        for other in 1..D {
            if self.border[other] < self.border[axis] {
                axis = other;
            }
        }
        self.entered = self.border[axis];
        self.border[axis] += self.width[axis];
        self.cell[axis] = self.cell[axis].wrapping_add(self.step[axis]);
        Some(passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_in_the_order_of_a_ray_across_them() {
        let walk = GridWalk::new([0.5, 1.5], [-0.6, 0.8], 2.0);
        let passed: Vec<_> = walk.take(4).collect();
        let distances = [0.0, 0.5 / 0.8, 0.5 / 0.6, 2.5 / 0.8];
        for ((cell, entered), (expected, distance)) in passed.into_iter().zip(
            [[0, 0], [0, 1], [-1, 1], [-1, 2]]
                .into_iter()
                .zip(distances),
        ) {
            assert_eq!(cell, expected);
            assert!((entered - distance).abs() < 1e-12, "{entered} {distance}");
        }
        // A ray along an axis stays in its row.
        let along = GridWalk::new([0.5, 0.5, 0.5], [0.0, -1.0, 0.0], 1.0);
        assert!(along.zip(0..9).all(|((cell, _), k)| cell == [0, -k, 0]));
    }
}
