//! A set of positions, in memory or in temporary files, that is read by parts of the plane.

use super::{
    cloud::Workspace,
    election::{COLORS, ELECTION_BYTES_PER_POINT, Election},
    store::{SortedRecords, StoreError},
};
use crate::{
    geometry::{Rect, Stored},
    tiling::CellGrid,
};

/// The edge of the cells of temporary files in radii of the election that fills them.
const CELL_IN_RADII: f64 = 256.0;
/// The length of a position in a temporary file, in bytes.
const POSITION_BYTES: usize = 12;

/// A set of positions.
pub(super) enum PointSet<'a> {
    /// The positions of records, each as often as it occurs.
    Records(&'a dyn SortedRecords),
    /// Positions in temporary files, each in one of them.
    Files(Vec<Box<dyn SortedRecords>>),
    /// Positions in memory, in ascending order.
    Memory(Vec<Stored>),
}

/// An elected set, and the radius of its election (stored units).
pub(super) type ElectedSet = (PointSet<'static>, f64);

impl PointSet<'_> {
    /// The number of positions.
    pub(super) fn len(&self) -> u64 {
        match self {
            Self::Records(records) => records.points(),
            Self::Files(files) => files.iter().map(|file| file.points()).sum(),
            Self::Memory(points) => points.len() as u64,
        }
    }

    /// The positions in `rect`, in no order that may be relied on.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn read(&self, rect: &Rect) -> Result<Vec<Stored>, StoreError> {
        let mut found = Vec::new();
        let mut collect = |record: &[u8]| found.push(Stored::of_record(record));
        match self {
            Self::Records(records) => records.visit(rect, &mut collect)?,
            Self::Files(files) => {
                for file in files {
                    file.visit(rect, &mut collect)?;
                }
            }
            Self::Memory(points) => {
                let west = points.partition_point(|p| i64::from(p.x) < rect.min[0]);
                let east = points.partition_point(|p| i64::from(p.x) < rect.max[0]);
                let between = points[west..east.max(west)].iter();
                found.extend(between.filter(|&&p| rect.contains(p)));
            }
        }
        Ok(found)
    }

    /// Elects a subset by `election`. No more than the memory of the `workspace` is used; what does not fit there goes to
    /// temporary files with the number `number`.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read or written.
    pub(super) fn elect(
        &self,
        election: &Election,
        workspace: &Workspace,
        number: usize,
    ) -> Result<PointSet<'static>, StoreError> {
        let most = points_in_memory(workspace);
        let parts = self.parts(election.square(), election.reach(), most);
        if let [everything] = parts.as_slice() {
            let candidates = self.read(&everything.grown(election.reach()))?;
            return Ok(PointSet::of(election.elect(
                candidates,
                &[],
                COLORS,
                everything,
            )));
        }
        let grid = CellGrid::new((CELL_IN_RADII * election.radius()) as i64);
        let mut files: Vec<Box<dyn SortedRecords>> = Vec::new();
        for color in COLORS {
            let name = format!("octree-{number}-{color}");
            let mut file = workspace.sorting.begin(&name, grid, POSITION_BYTES)?;
            for part in &parts {
                let around = part.grown(election.reach());
                let mut earlier = Vec::new();
                for file in &files {
                    let mut collect = |record: &[u8]| earlier.push(Stored::of_record(record));
                    file.visit(&around, &mut collect)?;
                }
                let candidates = self.read(&around)?;
                let elected = election.elect(candidates, &earlier, color..color + 1, part);
                let bytes: Vec<u8> = elected.iter().flat_map(position_bytes).collect();
                file.push(&bytes)?;
            }
            files.push(file.finish()?);
        }
        let elected = PointSet::Files(files);
        if elected.len() > most {
            return Ok(elected);
        }
        let points = elected.read(&EVERYWHERE)?;
        elected.remove();
        Ok(PointSet::of(points))
    }

    /// The set of `points`, in memory.
    fn of(mut points: Vec<Stored>) -> Self {
        points.sort_unstable();
        Self::Memory(points)
    }

    /// Rectangles that contain all positions between them, whose sides are multiples of `unit` (stored units), and which
    /// contain with `reach` around them no more than `most` positions, unless they are `unit` wide.
    pub(super) fn parts(&self, unit: i64, reach: i64, most: u64) -> Vec<Rect> {
        let squares = match self {
            Self::Records(records) => records.squares(),
            Self::Files(files) => files.iter().flat_map(|file| file.squares()).collect(),
            Self::Memory(points) => match (points.first(), points.last()) {
                (Some(first), Some(last)) => vec![(rect_around(points, first, last), self.len())],
                _ => Vec::new(),
            },
        };
        let mut parts = Vec::new();
        let side = |end: fn(i64, i64) -> i64, of: fn(&Rect, usize) -> i64, axis: usize| {
            squares.iter().map(|(rect, _)| of(rect, axis)).reduce(end)
        };
        let min = |axis| side(i64::min, |rect, axis| rect.min[axis], axis).unwrap_or(0);
        let max = |axis| side(i64::max, |rect, axis| rect.max[axis], axis).unwrap_or(0);
        let below = |c: i64| c.div_euclid(unit);
        let above = |c: i64| (c - 1).div_euclid(unit) + 1;
        let whole = Rect {
            min: [below(min(0)), below(min(1))],
            max: [above(max(0)), above(max(1))],
        };
        divide(whole, unit, reach, most, squares, &mut parts);
        parts
    }

    /// Removes the temporary files.
    pub(super) fn remove(self) {
        if let Self::Files(files) = self {
            files.into_iter().for_each(SortedRecords::remove);
        }
    }
}

/// The number of points that fit the memory of `workspace` while some of them are elected.
pub(super) fn points_in_memory(workspace: &Workspace) -> u64 {
    (workspace.sort_bytes / ELECTION_BYTES_PER_POINT) as u64
}

/// A rectangle that contains every position.
pub(super) const EVERYWHERE: Rect = Rect {
    min: [i32::MIN as i64; 2],
    max: [i32::MAX as i64 + 1; 2],
};

fn position_bytes(point: &Stored) -> impl Iterator<Item = u8> + use<> {
    [point.x, point.y, point.z]
        .into_iter()
        .flat_map(i32::to_le_bytes)
}

/// The rectangle around `points`, of which `first` is the westernmost and `last` the easternmost.
fn rect_around(points: &[Stored], first: &Stored, last: &Stored) -> Rect {
    let heights = points.iter().map(|p| i64::from(p.y));
    let [south, north] = heights.fold([i64::MAX, i64::MIN], |[south, north], y| {
        [south.min(y), north.max(y)]
    });
    Rect {
        min: [first.x.into(), south],
        max: [i64::from(last.x) + 1, north + 1],
    }
}

/// Divides `whole`, in units of `unit`, and adds the parts to `parts`; `squares` are those that it and its surroundings touch.
fn divide(
    whole: Rect,
    unit: i64,
    reach: i64,
    most: u64,
    squares: Vec<(Rect, u64)>,
    parts: &mut Vec<Rect>,
) {
    let rect = Rect {
        min: whole.min.map(|c| c * unit),
        max: whole.max.map(|c| c * unit),
    };
    let inside = squares.iter().any(|(square, _)| square.intersects(&rect));
    if !inside {
        return;
    }
    let points: u64 = squares.iter().map(|(_, points)| points).sum();
    let extent = [0, 1].map(|axis| whole.max[axis] - whole.min[axis]);
    if points <= most || extent == [1, 1] {
        parts.push(rect);
        return;
    }
    let axis = usize::from(extent[1] > extent[0]);
    let middle = whole.min[axis] + extent[axis] / 2;
    let (mut low, mut high) = (whole, whole);
    low.max[axis] = middle;
    high.min[axis] = middle;
    for half in [low, high] {
        let around = Rect {
            min: half.min.map(|c| c * unit - reach),
            max: half.max.map(|c| c * unit + reach),
        };
        let touched = squares.iter().filter(|(rect, _)| rect.intersects(&around));
        divide(half, unit, reach, most, touched.copied().collect(), parts);
    }
}
