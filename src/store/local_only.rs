//! Objects of a program that was built without the feature `remote`: there are none.

use std::{
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    path::Path,
    sync::Arc,
};

use super::identity::Identity;

fn refused() -> io::Error {
    let problem = "is remote, which this program was built without; build it with --features remote, or copy the file here";
    io::Error::new(io::ErrorKind::Unsupported, problem)
}

/// An object, of which there is none.
#[derive(Debug)]
pub(crate) enum Object {}

impl Object {
    /// Refuses the address.
    pub(super) fn find(_: &Path) -> io::Result<Arc<Self>> {
        Err(refused())
    }

    pub(super) fn identity(&self) -> &Identity {
        match *self {}
    }

    pub(super) fn prefetch(&self, _: &[Range<u64>]) {
        match *self {}
    }

    pub(super) fn forget_pieces(&self) {
        match *self {}
    }

    pub(super) fn begin_checksum(&self, _: u64) {
        match *self {}
    }

    pub(super) fn checksum(&self) -> io::Result<String> {
        match *self {}
    }

    pub(super) fn keep(&self, _: Range<u64>) -> io::Result<bool> {
        match *self {}
    }
}

/// An object that is being read, of which there is none.
#[derive(Debug)]
pub(crate) enum ObjectReader {}

impl ObjectReader {
    pub(super) fn open(object: &Arc<Object>, _: &[Range<u64>]) -> io::Result<Self> {
        match **object {}
    }

    pub(super) fn expect(&mut self, _: &[Range<u64>]) {
        match *self {}
    }
}

impl Read for ObjectReader {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        match *self {}
    }
}

impl Seek for ObjectReader {
    fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
        match *self {}
    }
}

/// A place in a store for the files of an output, of which there is none.
#[derive(Debug)]
pub(crate) enum Destination {}

impl Destination {
    /// Refuses the address.
    pub(crate) fn of(_: &Path) -> io::Result<Self> {
        Err(refused())
    }

    pub(crate) fn exists(&self) -> io::Result<bool> {
        match *self {}
    }

    pub(crate) fn upload(&self, _: &Path, _: &dyn Fn() -> bool) -> io::Result<()> {
        match *self {}
    }
}
