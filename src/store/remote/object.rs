//! An object by its identity.
//!
//! Of what is read at scattered places (headers, tables) small pieces are kept, because each part of an input that is
//! decoded asks for them again. What is read in order is read ahead, by readers.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    io,
    ops::Range,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use bytes::Bytes;
use object_store::{GetOptions, GetRange, ObjectMeta};
use tokio::sync::{Semaphore, oneshot};

use super::{
    client::{Located, locate, runtime},
    digest::OrderedDigest,
    request::{Failure, repeated},
};
use crate::store::{address::without_secrets, identity::Identity};

/// The bytes of a small piece.
const SMALL_PIECE: u64 = 16 << 10;
/// The most small pieces of an object that are kept.
const MOST_SMALL_PIECES: usize = 256;
/// The most bytes that are kept at once because they will be read piece by piece.
const LONGEST_KEPT: u64 = 128 << 10;
/// The most bytes that a request asks for.
pub(super) const LONGEST_REQUEST: u64 = 1 << 20;
/// The most bytes of one reader that are requested before they are needed.
pub(super) const READ_AHEAD: u64 = 4 << 20;
/// The most requests that are in flight at once, of all objects.
static REQUESTS: Semaphore = Semaphore::const_new(16);

/// An object whose ranges are read.
pub(crate) struct Object {
    /// The address without secrets.
    path: PathBuf,
    located: Located,
    identity: Identity,
    /// Small pieces by their number.
    small: Mutex<BTreeMap<u64, Bytes>>,
    /// What is requested for readers to come.
    ahead: Mutex<Ahead>,
    /// The checksum of what was read, if it is wanted.
    checksum: Mutex<Option<OrderedDigest<Bytes>>>,
}

/// What is requested for readers to come.
#[derive(Default)]
struct Ahead {
    /// The requests by their first bytes.
    requests: HashMap<u64, Request>,
    /// The first bytes of what readers have requested themselves: they are there already.
    begun: HashSet<u64>,
}

/// A range that was requested.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) range: Range<u64>,
    answer: oneshot::Receiver<Result<Bytes, Failure>>,
}

impl Request {
    /// Waits for the answer.
    pub(super) fn wait(self) -> io::Result<Bytes> {
        match self.answer.blocking_recv() {
            Ok(answer) => Ok(answer?),
            Err(_) => Err(io::Error::other("the request was given up")),
        }
    }
}

impl std::fmt::Debug for Object {
    /// Shows no secret.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "Object({}, {})", self.path.display(), self.identity)
    }
}

impl Object {
    /// Finds the object at the address `path` and reads its first bytes. An object that is in use already is that one: what
    /// is known of it is not asked for again.
    ///
    /// # Errors
    ///
    /// If there is none, or it cannot be read.
    pub(in crate::store) fn find(path: &Path) -> io::Result<Arc<Self>> {
        static IN_USE: Mutex<BTreeMap<PathBuf, Weak<Object>>> = Mutex::new(BTreeMap::new());
        if let Some(object) = lock(&IN_USE).get(path).and_then(Weak::upgrade) {
            return Ok(object);
        }
        let located = locate(path)?;
        let first = runtime()?.block_on(async {
            let first = Some(0..SMALL_PIECE);
            match repeated(|| get(&located, first.clone(), None)).await {
                // A range of an empty object cannot be answered.
                Err(failure) if failure.problem.contains("416") => {
                    repeated(|| get(&located, None, None)).await
                }
                other => other,
            }
        });
        let (identity, bytes) = first?;
        let object = Arc::new(Self {
            path: without_secrets(path),
            located,
            identity,
            small: Mutex::new(BTreeMap::from([(0, bytes)])),
            ahead: Mutex::default(),
            checksum: Mutex::default(),
        });
        let mut in_use = lock(&IN_USE);
        in_use.retain(|_, object| object.strong_count() > 0);
        in_use.insert(path.to_owned(), Arc::downgrade(&object));
        Ok(object)
    }

    /// The identity when the object was found.
    pub(in crate::store) fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Requests the first bytes of `ranges`, for a reader that will be opened soon.
    pub(in crate::store) fn prefetch(self: &Arc<Self>, ranges: &[Range<u64>]) {
        let mut bytes = 0;
        for range in requests_of(ranges, self.identity.bytes) {
            if bytes >= READ_AHEAD {
                break;
            }
            bytes += range.end - range.start;
            let mut ahead = lock(&self.ahead);
            if !ahead.begun.contains(&range.start) && !ahead.requests.contains_key(&range.start) {
                ahead.requests.insert(range.start, self.send(range));
            }
        }
    }

    /// Requests `range` for a reader, or finds the request that was made for it before.
    pub(super) fn request(self: &Arc<Self>, range: Range<u64>) -> Request {
        let found = {
            let mut ahead = lock(&self.ahead);
            ahead.begun.insert(range.start);
            ahead.requests.remove(&range.start)
        };
        match found {
            Some(request) if request.range == range => request,
            _ => self.send(range),
        }
    }

    /// Sends the request for `range`.
    fn send(self: &Arc<Self>, range: Range<u64>) -> Request {
        let (answer, receiver) = oneshot::channel();
        let object = self.clone();
        let wanted = range.clone();
        if let Ok(runtime) = runtime() {
            runtime.spawn(async move {
                let bytes = object.read(wanted).await;
                // Whoever asked may have gone.
                drop(answer.send(bytes));
            });
        }
        Request {
            range,
            answer: receiver,
        }
    }

    async fn read(&self, range: Range<u64>) -> Result<Bytes, Failure> {
        let permit = REQUESTS.acquire().await;
        let answer =
            repeated(|| get(&self.located, Some(range.clone()), Some(&self.identity))).await;
        drop(permit);
        let (_, bytes) = answer?;
        if let Some(digest) = lock(&self.checksum).as_mut() {
            digest.offer(range.start, bytes.clone());
        }
        Ok(bytes)
    }

    /// The small piece with the byte `at`, and the offset of its first byte.
    ///
    /// # Errors
    ///
    /// If it cannot be read.
    pub(super) fn small_piece(self: &Arc<Self>, at: u64) -> io::Result<(u64, Bytes)> {
        let number = at / SMALL_PIECE;
        let start = number * SMALL_PIECE;
        if let Some(bytes) = lock(&self.small).get(&number) {
            return Ok((start, bytes.clone()));
        }
        let end = (start + SMALL_PIECE).min(self.identity.bytes);
        let bytes = self.request(start..end).wait()?;
        self.keep_piece(number, bytes.clone());
        Ok((start, bytes))
    }

    fn keep_piece(&self, number: u64, bytes: Bytes) {
        let mut small = lock(&self.small);
        if small.len() >= MOST_SMALL_PIECES {
            // The first one has the header.
            let second = small.keys().nth(1).copied();
            second.map(|number| small.remove(&number));
        }
        small.insert(number, bytes);
    }

    /// Reads the small pieces with `range` by one request, as far as they are not kept, and returns whether all are kept now:
    /// a longer range is not read.
    ///
    /// # Errors
    ///
    /// If they cannot be read.
    pub(in crate::store) fn keep(self: &Arc<Self>, range: Range<u64>) -> io::Result<bool> {
        if range.end - range.start > LONGEST_KEPT {
            return Ok(false);
        }
        let pieces = range.start / SMALL_PIECE..range.end.div_ceil(SMALL_PIECE);
        let (first, last) = {
            let small = lock(&self.small);
            let mut missing = pieces.filter(|number| !small.contains_key(number));
            let Some(first) = missing.next() else {
                return Ok(true);
            };
            (first, missing.next_back().unwrap_or(first))
        };
        let start = first * SMALL_PIECE;
        let end = ((last + 1) * SMALL_PIECE).min(self.identity.bytes);
        let bytes = self.request(start..end).wait()?;
        for number in first..=last {
            let from = ((number - first) * SMALL_PIECE) as usize;
            let piece = bytes.slice(from..bytes.len().min(from + SMALL_PIECE as usize));
            self.keep_piece(number, piece);
        }
        Ok(true)
    }

    /// Forgets the small pieces.
    pub(in crate::store) fn forget_pieces(&self) {
        lock(&self.small).clear();
    }

    /// Computes the checksum of what is read from now on, and of the small pieces that were.
    pub(in crate::store) fn begin_checksum(&self, waiting: u64) {
        let mut checksum = lock(&self.checksum);
        if checksum.is_some() {
            return;
        }
        let mut digest = OrderedDigest::new(waiting);
        for (number, bytes) in &*lock(&self.small) {
            digest.offer(number * SMALL_PIECE, bytes.clone());
        }
        *checksum = Some(digest);
    }

    /// The checksum, for which what was not read yet is read.
    ///
    /// # Errors
    ///
    /// If it cannot be read.
    pub(in crate::store) fn checksum(self: &Arc<Self>) -> io::Result<String> {
        if lock(&self.checksum).is_none() {
            self.begin_checksum(READ_AHEAD);
        }
        let next = || lock(&self.checksum).as_ref().map_or(0, OrderedDigest::next);
        let bytes = self.identity.bytes;
        while next() < bytes {
            // What waits is taken as soon as the gap before it is closed.
            let start = next();
            let gap = (start + READ_AHEAD).min(bytes);
            let gap = lock(&self.checksum)
                .as_ref()
                .and_then(OrderedDigest::first_waiting)
                .map_or(gap, |w| gap.min(w));
            let missing = start..gap;
            let pieces: Vec<Request> = requests_of(std::slice::from_ref(&missing), bytes)
                .map(|range| self.request(range))
                .collect();
            for piece in pieces {
                piece.wait()?;
            }
        }
        let digest = lock(&self.checksum).take();
        Ok(digest.map(OrderedDigest::finish).unwrap_or_default())
    }
}

/// The requests for `ranges` of an object of `bytes` bytes, in their order: what touches is one range, what is long is
/// several.
pub(super) fn requests_of(ranges: &[Range<u64>], bytes: u64) -> impl Iterator<Item = Range<u64>> {
    let mut joined: Vec<Range<u64>> = Vec::new();
    for range in ranges {
        let range = range.start..range.end.min(bytes);
        match joined.last_mut() {
            _ if range.is_empty() => {}
            Some(last) if last.end == range.start => last.end = range.end,
            _ => joined.push(range),
        }
    }
    joined.into_iter().flat_map(|range| {
        let starts = range.clone().step_by(LONGEST_REQUEST as usize);
        starts.map(move |start| start..(start + LONGEST_REQUEST).min(range.end))
    })
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads `range` of an object, or all of it, and checks that it has the identity `expected`.
async fn get(
    located: &Located,
    range: Option<Range<u64>>,
    expected: Option<&Identity>,
) -> Result<(Identity, Bytes), Failure> {
    let tag = expected.and_then(|expected| expected.tag.clone());
    let options = GetOptions {
        range: range.clone().map(GetRange::Bounded),
        // A weak tag is never matched.
        if_match: tag.filter(|tag| !tag.starts_with("W/")),
        ..GetOptions::default()
    };
    let answer = located.store.get_opts(&located.path, options).await?;
    let found = identity(&answer.meta);
    if let Some(expected) = expected
        && *expected != found
    {
        let problem = format!(
            "has changed while it was read: it had {expected}, and has {found}; run again once it is complete"
        );
        return Err(Failure::lasting(io::ErrorKind::InvalidData, problem));
    }
    let wanted = range.map_or(found.bytes, |range| {
        range.end.min(found.bytes).saturating_sub(range.start)
    });
    let bytes = answer
        .bytes()
        .await
        .map_err(|error| match Failure::from(error) {
            // An answer that breaks off is asked for again, whatever the reason.
            failure if failure.kind == io::ErrorKind::Other => Failure::passing(failure.problem),
            failure => failure,
        })?;
    match bytes.len() as u64 == wanted {
        true => Ok((found, bytes)),
        false => Err(Failure::passing(format!(
            "its server sent {} of {wanted} bytes",
            bytes.len()
        ))),
    }
}

fn identity(meta: &ObjectMeta) -> Identity {
    let modified = Some(meta.last_modified.timestamp_millis()).filter(|&modified| modified != 0);
    Identity {
        bytes: meta.size,
        tag: meta.e_tag.clone(),
        modified: modified.filter(|_| meta.e_tag.is_none()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_for_what_is_wanted_and_no_more() {
        let requests =
            |ranges: &[Range<u64>], bytes| requests_of(ranges, bytes).collect::<Vec<_>>();
        assert_eq!(requests(&[0..10, 10..30, 40..50], 45), [0..30, 40..45]);
        assert_eq!(requests(&[50..60, 5..9, 7..7], 100), [50..60, 5..9]);
        let long = 3 * LONGEST_REQUEST + 5;
        let range = 1..long;
        let found = requests(std::slice::from_ref(&range), u64::MAX);
        assert_eq!(found.len(), 4);
        assert_eq!(found[3], 3 * LONGEST_REQUEST + 1..long);
    }
}
