//! A cloud of which only a part is in memory at a time, and its counterpart in memory.

use std::ops::Range;

use rayon::prelude::*;

use super::{Bounds, CellGrid, MAX_OCCUPIED_CELLS};
use crate::{
    geometry::{CellIndex, DistinctCells, Quantization, Rect, Stored},
    lloyd::{SolverOptions, ThinnedPoints, Thinning},
};

/// A cloud whose points are counted by squares of the plane and can be gathered by rectangles.
///
/// What decides a spacing or a plan depends on these counts and points alone, so that a cloud on disk and
/// the same cloud in memory get the same spacing.
pub(crate) trait CountedCloud: Sync {
    /// What goes wrong when points are gathered.
    type Error: Send;

    /// Number of points.
    fn points(&self) -> u64;

    /// The bounding box of all points.
    fn bounds(&self) -> Bounds;

    /// Edge of a counting square in stored units.
    fn square_edge(&self) -> i64;

    /// Number of points that may be gathered and be in memory at a time, whatever is done with them.
    fn most_gathered(&self) -> u64 {
        u64::MAX
    }

    /// The occupied counting squares: each by its south-west corner in units of squares, with the number of
    /// its points.
    fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_;

    /// The points in `rect`, in no order that may be relied on. If they are more than `thinning_limit`,
    /// they are thinned to no fewer than a scan for `options` keeps; at most twice as many as are kept, or
    /// `thinning_limit` points, are in memory at a time.
    ///
    /// # Errors
    ///
    /// If a part of the cloud cannot be read.
    fn gather(
        &self,
        rect: &Rect,
        quantization: &Quantization,
        options: &SolverOptions,
        thinning_limit: u64,
    ) -> Result<ThinnedPoints, Self::Error>;

    /// The cells in which the points in `rect` lie by `cell_of`, each once, in order.
    ///
    /// # Errors
    ///
    /// If a part of the cloud cannot be read.
    fn cells(
        &self,
        rect: &Rect,
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> Result<Vec<CellIndex>, Self::Error>;

    /// Completes what is known of the spacing at `points` that were gathered for `options`, where it varies: they are
    /// thinned, and rules look at the points around each.
    fn complete(
        &self,
        _points: &mut ThinnedPoints,
        _quantization: &Quantization,
        _options: &SolverOptions,
    ) {
    }
}

/// Points in memory, sorted by counting square.
#[derive(Debug)]
pub(crate) struct CloudInMemory<'a, S> {
    grid: CellGrid,
    bounds: Bounds,
    points: Vec<Stored>,
    /// The occupied squares in their order, each with the positions of its points in `points`.
    squares: Vec<([i64; 2], Range<usize>)>,
    /// Called before points are gathered; its error is returned in their place.
    stop: &'a S,
}

impl<'a, S> CloudInMemory<'a, S> {
    /// Sorts `points` by the squares of `grid`, or of the first coarser grid that has few enough cells;
    /// `stop` is called before points are gathered.
    pub(crate) fn new(points: &[Stored], mut grid: CellGrid, stop: &'a S) -> Self {
        let mut bounds = Bounds::empty();
        points.iter().for_each(|&point| bounds.grow(point));
        let mut cells: Vec<_> = points.par_iter().map(|&point| grid.cell(point)).collect();
        loop {
            cells.par_sort_unstable();
            cells.dedup();
            if cells.len() <= MAX_OCCUPIED_CELLS {
                break;
            }
            grid = grid.coarser();
            cells.iter_mut().for_each(|cell| *cell = cell.parent());
        }
        let mut points = points.to_vec();
        points.par_sort_unstable_by_key(|&point| (grid.square_of(point), point));
        let mut squares: Vec<([i64; 2], Range<usize>)> = Vec::new();
        for (index, &point) in points.iter().enumerate() {
            let square = grid.square_of(point);
            match squares.last_mut() {
                Some((last, range)) if *last == square => range.end = index + 1,
                _ => squares.push((square, index..index + 1)),
            }
        }
        Self {
            grid,
            bounds,
            points,
            squares,
            stop,
        }
    }

    /// The points in `rect`, unless the job is to stop.
    fn points_in<E>(&self, rect: &Rect) -> Result<impl Iterator<Item = Stored>, E>
    where
        S: Fn() -> Result<(), E>,
    {
        (self.stop)()?;
        let edge = self.grid.square();
        let [first, last] =
            [rect.min, rect.max.map(|c| c - 1)].map(|c| c.map(|c| c.div_euclid(edge)));
        let mut touched: Vec<Range<usize>> = Vec::new();
        // Squares are sorted by column, then by row: those of a column that the rectangle touches are
        // next to each other.
        let mut rest = &self.squares[self.squares.partition_point(|(s, _)| *s < first)..];
        while let Some(&([column, row], _)) = rest.first() {
            if column > last[0] {
                break;
            }
            if row < first[1] {
                rest = &rest[rest.partition_point(|(s, _)| *s < [column, first[1]])..];
            } else if row > last[1] {
                rest = &rest[rest.partition_point(|(s, _)| *s < [column + 1, first[1]])..];
            } else {
                touched.push(rest[0].1.clone());
                rest = &rest[1..];
            }
        }
        let rect = *rect;
        let points = touched.into_iter().flat_map(|range| &self.points[range]);
        Ok(points.copied().filter(move |&point| rect.contains(point)))
    }
}

impl<S, E> CountedCloud for CloudInMemory<'_, S>
where
    S: Fn() -> Result<(), E> + Sync,
    E: Send,
{
    type Error = E;

    fn points(&self) -> u64 {
        self.points.len() as u64
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }

    fn square_edge(&self) -> i64 {
        self.grid.square()
    }

    fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        let squares = self.squares.iter();
        squares.map(|(square, range)| (*square, range.len() as u64))
    }

    fn gather(
        &self,
        rect: &Rect,
        quantization: &Quantization,
        options: &SolverOptions,
        thinning_limit: u64,
    ) -> Result<ThinnedPoints, E> {
        let gathered: Vec<Stored> = self.points_in(rect)?.collect();
        let gathered = ThinnedPoints::from(gathered);
        Ok(match gathered.len() as u64 > thinning_limit {
            true => Thinning::new(quantization, options).thinned(gathered),
            false => gathered,
        })
    }

    fn cells(
        &self,
        rect: &Rect,
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> Result<Vec<CellIndex>, E> {
        let mut cells = DistinctCells::default();
        for point in self.points_in(rect)? {
            cells.add(cell_of(point));
        }
        Ok(cells.into_sorted())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gathered_points_are_those_in_the_rectangle() {
        let coordinate = |k: u64| (crate::geometry::spread(k) % 4000) as i32 - 2000;
        let points: Vec<Stored> = (0..5000)
            .map(|i| Stored {
                x: coordinate(3 * i),
                y: coordinate(3 * i + 1),
                z: coordinate(3 * i + 2),
            })
            .collect();
        let go_on = || Ok::<(), ()>(());
        let cloud = CloudInMemory::new(&points, CellGrid::new(100), &go_on);
        let counted: u64 = cloud.squares().map(|(_, count)| count).sum();
        assert_eq!(counted, 5000);
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        for rect in [
            [[-300, -200], [150, 1000]],
            [[-9000, -9000], [9000, 9000]],
            [[0, 0], [1, 1]],
            [[1999, -5000], [5000, 5000]],
        ] {
            let rect = Rect {
                min: rect[0],
                max: rect[1],
            };
            let options = SolverOptions::new(0.1);
            let mut gathered = cloud
                .gather(&rect, &quantization, &options, u64::MAX)
                .unwrap()
                .kept;
            let mut expected: Vec<Stored> = points
                .iter()
                .copied()
                .filter(|&p| rect.contains(p))
                .collect();
            gathered.sort_unstable();
            expected.sort_unstable();
            assert_eq!(gathered, expected);
        }
    }

    #[test]
    fn a_cloud_of_far_strays_is_counted_by_a_coarse_grid() {
        let points: Vec<Stored> = (0..20_000_i32)
            .map(|i| Stored {
                x: i * 100_000,
                y: -i * 90_000,
                z: 0,
            })
            .collect();
        let go_on = || Ok::<(), ()>(());
        let cloud = CloudInMemory::new(&points, CellGrid::new(8), &go_on);
        let cells: std::collections::HashSet<_> =
            points.iter().map(|&point| cloud.grid.cell(point)).collect();
        assert!(cells.len() <= MAX_OCCUPIED_CELLS, "{} cells", cells.len());
        assert!(
            cells.len() > MAX_OCCUPIED_CELLS / 8,
            "{} cells",
            cells.len()
        );
    }
}
