//! The bounds of an input: what the header claims, and what the points say.

use std::io::{Read, Seek, SeekFrom};

use ::las::Reader;

use super::{guard::guarded, input::InputFile};
use crate::las::format::{
    chunk_table::{Chunk, CompressedChunks},
    fields::coordinates,
};

/// The bytes of the coordinates of a point, at its beginning.
const COORDINATES_BYTES: usize = 12;

/// Half a stored unit for the rounding of a coordinate, and one for that of a header which
/// was written in decimals.
pub(super) const BOUNDS_TOLERANCE: f64 = 1.5;

impl InputFile {
    /// Compares the claimed bounds with the first point of `reader`, or of the `chunks` if they are known. If they cannot
    /// be true, reads all points for their bounds, and notes it.
    pub(super) fn verify_bounds(&mut self, reader: &mut Reader, chunks: &CompressedChunks) {
        let chunks = match chunks {
            CompressedChunks::Layered(chunks) | CompressedChunks::Alike(chunks) => chunks.first(),
            CompressedChunks::Unknown => None,
        };
        // The decoder would read all of the first chunk.
        let known = chunks.and_then(|chunk| self.bounds_of_first(chunk));
        if known.is_some_and(|first| self.can_have_bounds_of(&first)) {
            return;
        }
        if let Some(first) = self.bounds_of_next(reader, 1)
            && !self.can_have_bounds_of(&first)
        {
            self.bounds = self.bounds_of_points(first, reader);
            let note = "the bounds in its header are not those of its points";
            self.notes.push(note.into());
        }
    }

    /// The bounds of the first point of `chunk`, which is not compressed.
    fn bounds_of_first(&self, chunk: &Chunk) -> Option<[[f64; 3]; 2]> {
        let mut raw = [0; COORDINATES_BYTES];
        let mut file = self.source.open(&[]).ok()?;
        file.seek(SeekFrom::Start(chunk.offset)).ok()?;
        file.read_exact(&mut raw).ok()?;
        let stored = coordinates(&raw);
        Some([self.world(stored); 2])
    }

    /// Whether the claimed bounds can be true of a file with a point at `first`.
    fn can_have_bounds_of(&self, first: &[[f64; 3]; 2]) -> bool {
        let [min, max] = self.bounds_claimed;
        (0..3).all(|axis| {
            let (scale, offset) = (self.scale[axis], self.offset[axis]);
            let range =
                (offset + f64::from(i32::MIN) * scale)..=(offset + f64::from(i32::MAX) * scale);
            // Written so that NaN fails.
            range.contains(&min[axis])
                && range.contains(&max[axis])
                && min[axis] <= first[0][axis] + BOUNDS_TOLERANCE * scale
                && max[axis] >= first[1][axis] - BOUNDS_TOLERANCE * scale
        })
    }

    /// The bounds of `first` and of all points that `reader` still has.
    fn bounds_of_points(&self, first: [[f64; 3]; 2], reader: &mut Reader) -> [[f64; 3]; 2] {
        let mut bounds = first;
        while let Some([min, max]) = self.bounds_of_next(reader, self.batch_points()) {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(min[axis]);
                bounds[1][axis] = bounds[1][axis].max(max[axis]);
            }
        }
        bounds
    }

    /// The bounds of the next points, up to `wanted`; `None` at the end, and where the file
    /// is damaged, which is reported when the points are read.
    fn bounds_of_next(&self, reader: &mut Reader, wanted: u64) -> Option<[[f64; 3]; 2]> {
        let read = guarded(|| reader.read_points(wanted));
        let batch = read?.ok().filter(|batch| !batch.is_empty())?;
        let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
        for raw in batch.raw_bytes().chunks_exact(batch.record_len()) {
            for (axis, stored) in coordinates(raw).into_iter().enumerate() {
                bounds[0][axis] = bounds[0][axis].min(stored);
                bounds[1][axis] = bounds[1][axis].max(stored);
            }
        }
        Some(bounds.map(|corner| self.world(corner)))
    }

    fn world(&self, stored: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.offset[axis] + f64::from(stored[axis]) * self.scale[axis])
    }
}
