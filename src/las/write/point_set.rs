//! A set of positions, in memory or in temporary files, that is read by parts of the plane.

use super::{
    cloud::Workspace,
    election::{ELECTION_BYTES_PER_POINT, Election},
    kept_set::{KeptSet, counts_by_square, piece_of, rect_of_square},
    store::{SortedRecords, StoreError},
};
use crate::geometry::{Rect, Stored};

/// The most points of a piece of work that processes share.
const MOST_SHARED: u64 = 1 << 18;

/// A set of positions.
pub(super) enum PointSet<'a> {
    /// The positions of records, each as often as it occurs.
    Records(&'a dyn SortedRecords),
    /// Positions in temporary files.
    Kept(KeptSet),
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
            Self::Kept(kept) => kept.len(),
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
        match self {
            Self::Records(records) => records.visit(rect, &mut |record| {
                found.push(Stored::of_record(record));
            })?,
            Self::Kept(kept) => found = kept.read(rect)?,
            Self::Memory(points) => {
                let west = points.partition_point(|p| i64::from(p.x) < rect.min[0]);
                let east = points.partition_point(|p| i64::from(p.x) < rect.max[0]);
                let between = points[west..east.max(west)].iter();
                found.extend(between.filter(|&&p| rect.contains(p)));
            }
        }
        Ok(found)
    }

    /// Elects a subset by `election`. No more than the memory of the `workspace` is used; what does not fit there is kept as
    /// pieces of a work with the number `number`.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read or written.
    pub(super) fn elect(
        &self,
        election: &Election,
        workspace: &Workspace<'_>,
        number: usize,
    ) -> Result<PointSet<'static>, StoreError> {
        let most = points_together(workspace);
        let parts = self.parts(election.block(), &|part| election.around(part), most);
        // Processes that share the work elect even a small set once.
        if let [everything] = parts.as_slice()
            && !workspace.workforce.is_shared()
        {
            let candidates = self.read(&election.around(everything))?;
            return Ok(PointSet::Memory(election.elect(candidates, everything)));
        }
        let name = format!("elected-{number}");
        let pieces = workspace.workforce.keep(&name, parts.len(), &mut |piece| {
            let part = &parts[piece];
            let candidates = self.read(&election.around(part))?;
            let elected = election.elect(candidates, part);
            Ok(piece_of(&elected, election.block()))
        })?;
        let elected = PointSet::Kept(KeptSet::new(parts, pieces, election.block())?);
        if elected.len() > points_in_memory(workspace) {
            return Ok(elected);
        }
        let mut points = elected.read(&Rect::EVERYWHERE)?;
        points.sort_unstable();
        elected.remove();
        Ok(PointSet::Memory(points))
    }

    /// Rectangles that contain all positions between them, whose sides are multiples of `unit` (stored units), and which
    /// contain, with what is `around` them, no more than `most` positions, unless they are `unit` wide.
    pub(super) fn parts(&self, unit: i64, around: &dyn Fn(&Rect) -> Rect, most: u64) -> Vec<Rect> {
        let squares = match self {
            Self::Records(records) => records.squares(),
            Self::Kept(kept) => kept.squares().to_vec(),
            Self::Memory(points) => squares_of(points, unit),
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
        let division = Division { unit, around, most };
        division.divide(whole, squares, &mut parts);
        parts
    }

    /// Removes the temporary files.
    pub(super) fn remove(self) {
        if let Self::Kept(kept) = self {
            kept.remove();
        }
    }
}

/// The number of points that fit the memory of `workspace` while some of them are elected.
fn points_in_memory(workspace: &Workspace<'_>) -> u64 {
    (workspace.sort_bytes / ELECTION_BYTES_PER_POINT) as u64
}

/// The number of points that are taken together: as many as fit the memory of `workspace`, or fewer if processes share the
/// work.
pub(super) fn points_together(workspace: &Workspace<'_>) -> u64 {
    let fitting = points_in_memory(workspace);
    match workspace.workforce.is_shared() {
        true => fitting.min(MOST_SHARED),
        false => fitting,
    }
}

/// Equal squares with these `points`, and the number of points in each; their edge is `unit` (stored units).
fn squares_of(points: &[Stored], unit: i64) -> Vec<(Rect, u64)> {
    let counts = counts_by_square(points, unit);
    let counted = counts.into_iter();
    counted
        .map(|(square, count)| (rect_of_square(square, unit), count))
        .collect()
}

/// The division of the plane into parts.
struct Division<'a> {
    /// The sides of parts are multiples of this (stored units).
    unit: i64,
    /// What a part has to see.
    around: &'a dyn Fn(&Rect) -> Rect,
    /// The most positions that a part should see.
    most: u64,
}

impl Division<'_> {
    /// Divides `whole`, in units, and adds the parts to `parts`; `squares` are those that it and its surroundings touch.
    fn divide(&self, whole: Rect, squares: Vec<(Rect, u64)>, parts: &mut Vec<Rect>) {
        let rect = self.stored(whole);
        let inside = squares.iter().any(|(square, _)| square.intersects(&rect));
        if !inside {
            return;
        }
        let points: u64 = squares.iter().map(|(_, points)| points).sum();
        let extent = [0, 1].map(|axis| whole.max[axis] - whole.min[axis]);
        if points <= self.most || extent == [1, 1] {
            parts.push(rect);
            return;
        }
        let axis = usize::from(extent[1] > extent[0]);
        let middle = whole.min[axis] + extent[axis] / 2;
        let (mut low, mut high) = (whole, whole);
        low.max[axis] = middle;
        high.min[axis] = middle;
        for half in [low, high] {
            let around = (self.around)(&self.stored(half));
            let touched = squares.iter().filter(|(rect, _)| rect.intersects(&around));
            self.divide(half, touched.copied().collect(), parts);
        }
    }

    /// The rectangle in stored units.
    fn stored(&self, rect: Rect) -> Rect {
        Rect {
            min: rect.min.map(|c| c * self.unit),
            max: rect.max.map(|c| c * self.unit),
        }
    }
}
