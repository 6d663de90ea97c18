//! Clouds of which every beginning is a coarser cloud, written within bounded memory.
//!
//! Records are given in any order and sorted by position. Sets of about 30, 10, 3, 1, … % of them are elected ([`NestedSets`]), each
//! from the one before, so that beginnings of so many points are such sets but for a few. Last, records are sorted by the first
//! set that contains them, those of a set by a hash: from the sort of positions to that of the file by a second temporary
//! file, in which the coordinate of a record is its approximate number in the file.

use std::path::Path;

use super::{
    cloud::{CloudHeader, Workspace},
    cloud_levels::CloudLevels,
    leveled_records::LeveledRecords,
    nested_sets::{NestedSets, order_key},
    point_order::PointOrder,
    point_set::PointSet,
    store::{SortedRecords, StoreError},
    writer::{CloudWriter, CompleteCloud},
};
use crate::{
    geometry::{Rect, Stored},
    las::error::LasError,
    tiling::CellGrid,
};

/// The radius of the finest election in spacings of the cloud, unless it takes too few or too many points. On a street it takes 32 %
/// of them.
const FINEST_RADIUS_IN_SPACINGS: f64 = 1.35;
/// The number of points of the smallest set, at most.
const FEWEST_POINTS: u64 = 64;
/// The most sets: the last has 10⁻²⁰ of the points.
const MOST_SETS: usize = 40;
/// The shares of the points whose figures are reported.
const REPORTED_SHARES: [f64; 4] = [0.01, 0.03, 0.1, 0.3];
/// The number of the last place that a record may be given in the file that sorts them: it is a coordinate.
const LAST_PLACE: u64 = 1 << 30;
/// The bytes before a record in that file: its place, as a position, and the number of its set.
const HEAD_BYTES: usize = 13;
/// The cells of that file, at most.
const CELLS: u64 = 4096;
/// The memory that a record takes while it is sorted, beside itself twice, in bytes.
const SORTING_BYTES_PER_POINT: usize = 64;

/// Writes the points of `sorted` to `ordered`, which is to become `path`, in progressive order. `progress` gets the numbers of
/// points that are written. The ranks of the points in `seen` are returned with the cloud.
///
/// # Errors
///
/// If the cloud cannot be written, or temporary files cannot be read or written.
pub(super) fn write_progressive(
    mut ordered: CloudWriter,
    path: &Path,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    seen: Option<&Rect>,
    progress: &dyn Fn(u64),
) -> Result<CompleteCloud, LasError> {
    let length = header.record.record_length();
    let mut write = |records: &[u8]| -> Result<(), StoreError> {
        ordered.write(records)?;
        progress((records.len() / length) as u64);
        Ok(())
    };
    let levels = in_progressive_order(header, workspace, sorted, seen, &mut write);
    let levels = levels.map_err(|e| LasError::unwritable(path, e))?;
    Ok(ordered.complete()?.with_levels(levels))
}

/// Passes the records of `sorted` to `write` in progressive order, and returns the ranks.
fn in_progressive_order(
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    seen: Option<&Rect>,
    write: &mut dyn FnMut(&[u8]) -> Result<(), StoreError>,
) -> Result<CloudLevels, StoreError> {
    let scale = header.quantization.scale;
    let finest = FINEST_RADIUS_IN_SPACINGS * workspace.spacing / scale;
    let shares = shares().take(MOST_SETS);
    let sets = NestedSets::elect_shares(sorted, shares, finest, FEWEST_POINTS, workspace)?;
    let figures = REPORTED_SHARES.map(|share| sets.figures_of_share(share, workspace));
    let figures = figures.into_iter().collect::<Result<_, StoreError>>()?;
    let levels = CloudLevels::new(PointOrder::Progressive, &sets, figures, scale, seen)?;
    let record_length = header.record.record_length();
    let places = Places::new(&levels.points);
    let by_place = by_place(sorted, &sets, &places, workspace, record_length)?;
    sets.remove();
    for rect in ranges_of_places(&*by_place, sorting_points(workspace, record_length)) {
        let records = by_place.read(&rect)?;
        write(&in_order(&records, HEAD_BYTES + record_length))?;
    }
    by_place.remove();
    Ok(levels)
}

/// The shares of all points that are elected: 0.3, 0.1, 0.03, 0.01, …
fn shares() -> impl Iterator<Item = f64> {
    let of_decade = |decade: i32| [0.3, 0.1].map(|share| share * 0.1_f64.powi(decade));
    (0..).flat_map(of_decade)
}

/// The number of records that fit the memory of `workspace` while they are sorted.
fn sorting_points(workspace: &Workspace<'_>, record_length: usize) -> u64 {
    let bytes = 2 * (HEAD_BYTES + record_length) + SORTING_BYTES_PER_POINT;
    (workspace.sort_bytes / bytes) as u64
}

/// The approximate numbers of records in the file, which ascend as exact ones do.
struct Places {
    /// For each set, the number of points of those before it, and the number that it adds to them.
    sets: Vec<[u64; 2]>,
    /// The number of points that have the same place, at most.
    points_per_place: u64,
}

impl Places {
    /// The places of the points of sets of these cumulative numbers.
    fn new(points: &[u64]) -> Self {
        let before = std::iter::once(0).chain(points.iter().copied());
        let all = points.last().copied().unwrap_or(0);
        Self {
            sets: (before.zip(points))
                .map(|(before, points)| [before, points - before])
                .collect(),
            points_per_place: all / LAST_PLACE + 1,
        }
    }

    /// The place of a point of a set.
    fn of(&self, set: u8, point: Stored) -> i32 {
        let [before, added] = self.sets[usize::from(set)];
        let within = (u128::from(order_key(point)) * u128::from(added)) >> 64;
        // At most `LAST_PLACE`.
        ((before + within as u64) / self.points_per_place) as i32
    }

    /// The grid of the file that sorts by place.
    fn grid(&self) -> CellGrid {
        let [before, added] = self.sets.last().copied().unwrap_or([0, 0]);
        CellGrid::new(((before + added) / self.points_per_place / CELLS) as i64)
    }
}

/// Copies the records of `sorted` to a temporary file, in which their positions are their places in the output.
fn by_place(
    sorted: &dyn SortedRecords,
    sets: &NestedSets<'_>,
    places: &Places,
    workspace: &Workspace<'_>,
    record_length: usize,
) -> Result<Box<dyn SortedRecords>, StoreError> {
    let length = HEAD_BYTES + record_length;
    let mut file = workspace.sorting.begin("ranked", places.grid(), length)?;
    let most = sorting_points(workspace, record_length);
    for part in PointSet::Records(sorted).parts(1 << 8, &|part| *part, most) {
        let leveled = LeveledRecords::read(sorted, sets, &part, record_length)?;
        let mut bytes = Vec::new();
        for (point, set, record) in leveled.iter() {
            bytes.extend(places.of(set, point).to_le_bytes());
            bytes.extend([0; 8]);
            bytes.push(set);
            bytes.extend(record);
        }
        file.push(&bytes)?;
    }
    file.finish()
}

/// Rectangles of records with consecutive places, in ascending order, with no more than `most` records each if possible.
fn ranges_of_places(by_place: &dyn SortedRecords, most: u64) -> Vec<Rect> {
    let mut squares = by_place.squares();
    squares.sort_unstable_by_key(|(rect, _)| rect.min[0]);
    let mut ranges: Vec<(Rect, u64)> = Vec::new();
    for (rect, points) in squares {
        match ranges.last_mut() {
            Some((last, sum)) if *sum + points <= most => {
                last.max[0] = rect.max[0];
                *sum += points;
            }
            _ => ranges.push((rect, points)),
        }
    }
    ranges.into_iter().map(|(rect, _)| rect).collect()
}

/// The records of `length` bytes in the order of the file, without their heads.
fn in_order(records: &[u8], length: usize) -> Vec<u8> {
    let mut order: Vec<(u8, u64, Stored, &[u8])> = records
        .chunks_exact(length)
        .map(|record| {
            let (head, record) = record.split_at(HEAD_BYTES);
            let point = Stored::of_record(record);
            (head[HEAD_BYTES - 1], order_key(point), point, record)
        })
        .collect();
    order.sort_unstable();
    let records = order.into_iter().flat_map(|(.., record)| record);
    records.copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        las::{
            format::record_format::RecordFormat,
            write::{
                store::SortingSpace,
                stored_in_memory::{MemorySpace, workspace},
            },
        },
    };

    /// The records in progressive order, with so many bytes of memory, and the numbers of points of the sets.
    fn ordered(records: &[u8], header: &CloudHeader, bytes: usize) -> (Vec<u8>, Vec<u64>) {
        let length = header.record.record_length();
        let mut sorter = MemorySpace.begin("", CellGrid::new(800), length).unwrap();
        sorter.push(records).unwrap();
        let (sorted, mut found) = (sorter.finish().unwrap(), Vec::new());
        let mut write = |records: &[u8]| {
            found.extend_from_slice(records);
            Ok(())
        };
        let workspace = workspace(1.0, bytes);
        let levels = in_progressive_order(header, &workspace, &*sorted, None, &mut write).unwrap();
        (found, levels.points)
    }

    #[test]
    fn first_points_are_the_smaller_sets_in_any_memory_and_all_points_are_there() {
        let header = CloudHeader {
            record: RecordFormat {
                point_format: 6,
                extra_bytes: Vec::new(),
            },
            quantization: Quantization {
                scale: 0.01,
                offset: [0.0; 3],
            },
            crs: None,
            carried_records: Vec::new(),
            has_standard_time: false,
            provenance: String::new(),
        };
        let length = header.record.record_length();
        let mut records = Vec::new();
        for i in 0..6000_u64 {
            let c = |k: u64| (spread(3 * i + k) % 8000) as i32 - 2000;
            let mut record = vec![0; length];
            for (bytes, c) in record.chunks_exact_mut(4).zip([c(0), c(1), c(2) / 100]) {
                bytes.copy_from_slice(&c.to_le_bytes());
            }
            records.extend(record);
        }
        let (wide, points) = ordered(&records, &header, 1 << 30);
        let (narrow, _) = ordered(&records, &header, 200 * 900);
        assert!(wide == narrow);
        let bytes_of = |records: &[u8]| {
            let mut sorted: Vec<Vec<u8>> =
                records.chunks_exact(length).map(<[u8]>::to_vec).collect();
            sorted.sort_unstable();
            sorted
        };
        assert!(bytes_of(&wide) == bytes_of(&records));
        // Every set has its share of the points, and no two of them stand much closer than on a lattice.
        let position: Vec<Stored> = wide.chunks_exact(length).map(Stored::of_record).collect();
        assert!(points.len() > 4, "{points:?}");
        for (share, &first) in shares().zip(points.iter().rev().skip(1)) {
            let wanted = share * position.len() as f64;
            assert!((1.0..1.3).contains(&(first as f64 / wanted)), "{points:?}");
            let lattice = (64e6 / 0.75_f64.sqrt() / first as f64).sqrt();
            let first = &position[..first as usize];
            for (i, a) in first.iter().enumerate() {
                let squared = |b: &Stored| {
                    let [x, y, z] = [a.x - b.x, a.y - b.y, a.z - b.z].map(f64::from);
                    x * x + y * y + z * z
                };
                assert!(first[..i].iter().all(|b| squared(b).sqrt() > 0.6 * lattice));
            }
        }
    }
}
