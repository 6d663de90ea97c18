//! A store in memory for tests: records in the order in which they came.

use std::{path::Path, sync::Arc};

use super::{
    cloud::Workspace,
    pcd_options::PcdOptions,
    pieces::{KeptPieces, MakePiece, Piece, TakePiece, Workforce},
    store::{RecordSorter, SortedRecords, SortingSpace, StoreError},
};
use crate::{
    geometry::{Rect, Stored},
    tiling::{Bounds, CellGrid},
};

#[derive(Debug)]
pub(super) struct MemorySpace;

/// One process that keeps pieces in memory.
#[derive(Debug)]
pub(super) struct InMemory;

#[derive(Debug)]
struct PiecesInMemory(Vec<Piece>);

/// Records of a length, and the grid by which they are counted.
pub(super) struct MemoryRecords {
    bytes: Vec<u8>,
    length: usize,
    grid: CellGrid,
}

/// A workspace for points one hundredth of a unit apart, with so many bytes of memory.
pub(super) fn workspace(spacing: f64, sort_bytes: usize) -> Workspace<'static> {
    Workspace {
        spacing,
        tile_edge: 0.0,
        pcd: PcdOptions::default(),
        brightest: 0,
        sorting: Arc::new(MemorySpace),
        workforce: &InMemory,
        sort_bytes,
    }
}

impl Workforce for InMemory {
    fn shared_directory(&self) -> Option<&Path> {
        None
    }

    fn keep(
        &self,
        _name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
    ) -> Result<Box<dyn KeptPieces>, StoreError> {
        let pieces = (0..count).map(make).collect::<Result<_, _>>()?;
        Ok(Box::new(PiecesInMemory(pieces)))
    }

    fn pass(
        &self,
        _name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
        take: &mut TakePiece<'_>,
    ) -> Result<(), StoreError> {
        (0..count).try_for_each(|piece| take(piece, make(piece)?))
    }
}

impl KeptPieces for PiecesInMemory {
    fn read(&self, piece: usize, section: usize) -> Result<Vec<u8>, StoreError> {
        Ok(self.0[piece][section].clone())
    }

    fn remove(self: Box<Self>) {}
}

impl SortingSpace for MemorySpace {
    fn begin(
        &self,
        _name: &str,
        grid: CellGrid,
        length: usize,
    ) -> Result<Box<dyn RecordSorter>, StoreError> {
        Ok(Box::new(MemoryRecords {
            bytes: Vec::new(),
            length,
            grid,
        }))
    }
}

impl RecordSorter for MemoryRecords {
    fn push(&mut self, records: &[u8]) -> Result<(), StoreError> {
        self.bytes.extend(records);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn SortedRecords>, StoreError> {
        Ok(self)
    }
}

impl SortedRecords for MemoryRecords {
    fn points(&self) -> u64 {
        (self.bytes.len() / self.length) as u64
    }

    fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::empty();
        let records = self.bytes.chunks_exact(self.length);
        records.for_each(|record| bounds.grow(Stored::of_record(record)));
        bounds
    }

    fn squares(&self) -> Vec<(Rect, u64)> {
        let records = self.bytes.chunks_exact(self.length);
        let mut squares: Vec<[i64; 2]> = records
            .map(|record| self.grid.square_of(Stored::of_record(record)))
            .collect();
        squares.sort_unstable();
        let equal = squares.chunk_by(|a, b| a == b);
        equal
            .map(|equal| (self.grid.rect_of_square(equal[0]), equal.len() as u64))
            .collect()
    }

    fn visit(&self, rect: &Rect, visit: &mut dyn FnMut(&[u8])) -> Result<(), StoreError> {
        let records = self.bytes.chunks_exact(self.length);
        records
            .filter(|record| rect.contains(Stored::of_record(record)))
            .for_each(visit);
        Ok(())
    }

    fn read(&self, rect: &Rect) -> Result<Vec<u8>, StoreError> {
        let mut found = Vec::new();
        self.visit(rect, &mut |record| found.extend(record))?;
        Ok(found)
    }

    fn remove(self: Box<Self>) {}
}
