//! An elected set that does not fit in memory: the positions of each part of the plane as a piece of work.
//!
//! ```text
//!   section 0   positions in ascending order            3 × i32 each
//!   section 1   column, row, positions of each square   3 × u32 each
//! ```

use std::collections::BTreeMap;

use super::{
    pieces::{KeptPieces, Piece},
    store::StoreError,
};
use crate::geometry::{Rect, Stored};

const POSITIONS: usize = 0;
const SQUARES: usize = 1;
/// The length of an entry of either section, in bytes.
const ENTRY_BYTES: usize = 12;

/// An elected set in temporary files.
#[derive(Debug)]
pub(super) struct KeptSet {
    /// The part of the plane of each piece.
    parts: Vec<Rect>,
    pieces: Box<dyn KeptPieces>,
    /// The squares with positions, and the number of these.
    squares: Vec<(Rect, u64)>,
    points: u64,
}

impl KeptSet {
    /// The set whose positions in each of `parts` are one of `pieces`, counted by squares with the edge `unit` (stored units).
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn new(
        parts: Vec<Rect>,
        pieces: Box<dyn KeptPieces>,
        unit: i64,
    ) -> Result<Self, StoreError> {
        let mut squares = Vec::new();
        for piece in 0..parts.len() {
            let bytes = pieces.read(piece, SQUARES)?;
            squares.extend(entries(&bytes).map(|[column, row, count]| {
                let square = [column, row].map(i64::from);
                (rect_of_square(square, unit), u64::from(count as u32))
            }));
        }
        Ok(Self {
            points: squares.iter().map(|(_, count)| count).sum(),
            parts,
            pieces,
            squares,
        })
    }

    /// The number of positions.
    pub(super) fn len(&self) -> u64 {
        self.points
    }

    /// Equal squares with positions, and the number of positions in each.
    pub(super) fn squares(&self) -> &[(Rect, u64)] {
        &self.squares
    }

    /// The positions in `rect`.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn read(&self, rect: &Rect) -> Result<Vec<Stored>, StoreError> {
        let mut found = Vec::new();
        let touched = (0..self.parts.len()).filter(|&part| self.parts[part].intersects(rect));
        for part in touched {
            let bytes = self.pieces.read(part, POSITIONS)?;
            let positions = entries(&bytes).map(|[x, y, z]| Stored { x, y, z });
            found.extend(positions.filter(|&position| rect.contains(position)));
        }
        Ok(found)
    }

    /// Removes the temporary files.
    pub(super) fn remove(self) {
        self.pieces.remove();
    }
}

/// The piece with the elected positions of a part, counted by squares with the edge `unit` (stored units).
pub(super) fn piece_of(elected: &[Stored], unit: i64) -> Piece {
    let positions = elected.iter().map(|p| [p.x, p.y, p.z]);
    let squares = counts_by_square(elected, unit).into_iter();
    // A part has no more positions than a piece has in memory, and squares are no smaller than stored units.
    let squares = squares.map(|([column, row], count)| [column as i32, row as i32, count as i32]);
    vec![bytes_of(positions), bytes_of(squares)]
}

/// The number of `points` in each square with the edge `unit` (stored units), by column and row.
pub(super) fn counts_by_square(points: &[Stored], unit: i64) -> BTreeMap<[i64; 2], u64> {
    let mut counts = BTreeMap::new();
    for point in points {
        let square = [point.x, point.y].map(|c| i64::from(c).div_euclid(unit));
        *counts.entry(square).or_default() += 1;
    }
    counts
}

/// The rectangle of a square with the edge `unit`, in stored units.
pub(super) fn rect_of_square(square: [i64; 2], unit: i64) -> Rect {
    Rect {
        min: square.map(|c| c * unit),
        max: square.map(|c| (c + 1) * unit),
    }
}

fn bytes_of(entries: impl Iterator<Item = [i32; 3]>) -> Vec<u8> {
    entries.flatten().flat_map(i32::to_le_bytes).collect()
}

fn entries(bytes: &[u8]) -> impl Iterator<Item = [i32; 3]> {
    let integer = |at: &[u8]| at.try_into().map_or(0, i32::from_le_bytes);
    bytes
        .chunks_exact(ENTRY_BYTES)
        .map(move |entry| [0, 4, 8].map(|at| integer(&entry[at..at + 4])))
}
