//! The bytes of an object in order, requested before they are needed.
//!
//! ```text
//!   expected    ██████ ████████│▒▒▒▒▒▒▒▒ ▒▒▒▒▒▒▒▒ ░░░░░░░░ ░░░░
//!               read           │ requested        not yet
//!                             at
//! ```
//!
//! A reader knows the ranges that it will be asked for. The next ones are in flight while it is decoded what came
//! before, so that only the first answer is waited for. What was not expected comes in small pieces.

use std::{
    collections::VecDeque,
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    sync::Arc,
};

use bytes::Bytes;

use super::object::{Object, READ_AHEAD, Request, requests_of};

/// An object that is being read.
#[derive(Debug)]
pub(crate) struct ObjectReader {
    object: Arc<Object>,
    /// The offset of the next byte.
    at: u64,
    /// The piece that was read last, by the offset of its first byte.
    piece: Option<(u64, Bytes)>,
    /// What is in flight, in the order of reading.
    requested: VecDeque<Request>,
    /// What is to be requested then.
    expected: VecDeque<Range<u64>>,
}

impl ObjectReader {
    /// Opens `object` at its first byte; `ranges` are read ahead.
    ///
    /// # Errors
    ///
    /// Never: what fails is a request, when it is waited for. Opening a file may fail.
    pub(in crate::store) fn open(object: &Arc<Object>, ranges: &[Range<u64>]) -> io::Result<Self> {
        let mut reader = Self {
            object: object.clone(),
            at: 0,
            piece: None,
            requested: VecDeque::new(),
            expected: VecDeque::new(),
        };
        reader.expect(ranges);
        Ok(reader)
    }

    /// Expects `ranges` to be read after what is expected already.
    pub(in crate::store) fn expect(&mut self, ranges: &[Range<u64>]) {
        self.expected
            .extend(requests_of(ranges, self.object.identity().bytes));
        self.read_ahead();
    }

    /// Requests what is expected, as far as it is read ahead.
    fn read_ahead(&mut self) {
        let length = |range: &Range<u64>| range.end - range.start;
        let mut bytes: u64 = self
            .requested
            .iter()
            .map(|request| length(&request.range))
            .sum();
        while bytes < READ_AHEAD
            && let Some(range) = self.expected.pop_front()
        {
            bytes += length(&range);
            self.requested.push_back(self.object.request(range));
        }
    }

    /// Makes the piece with the next byte the present one.
    fn advance(&mut self) -> io::Result<()> {
        let is_expected = self
            .requested
            .iter()
            .any(|request| request.range.contains(&self.at))
            || self.expected.iter().any(|range| range.contains(&self.at));
        if !is_expected {
            self.piece = Some(self.object.small_piece(self.at)?);
            return Ok(());
        }
        // What was passed over is no longer waited for.
        loop {
            self.read_ahead();
            let Some(request) = self.requested.pop_front() else {
                return Err(io::ErrorKind::UnexpectedEof.into());
            };
            if request.range.contains(&self.at) {
                let start = request.range.start;
                self.read_ahead();
                self.piece = Some((start, request.wait()?));
                return Ok(());
            }
        }
    }

    /// What the present piece has of the next bytes.
    fn rest_of_piece(&self) -> &[u8] {
        let rest = self.piece.as_ref().and_then(|(start, bytes)| {
            let skipped = self.at.checked_sub(*start)?;
            bytes.get(usize::try_from(skipped).ok()?..)
        });
        rest.unwrap_or_default()
    }
}

impl Read for ObjectReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.at >= self.object.identity().bytes || buffer.is_empty() {
            return Ok(0);
        }
        if self.rest_of_piece().is_empty() {
            self.advance()?;
        }
        let rest = self.rest_of_piece();
        let read = rest.len().min(buffer.len());
        buffer[..read].copy_from_slice(&rest[..read]);
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for ObjectReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let to = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.object.identity().bytes.checked_add_signed(by),
        };
        self.at = to.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}
