//! By what a change of an object is noticed.

use std::fmt::Display;

use serde::{Deserialize, Serialize};

/// Length, tag and time of an object, as its store states them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Identity {
    /// The length in bytes.
    pub(crate) bytes: u64,
    /// The tag of this version of the object (`ETag`), if the store has one.
    pub(crate) tag: Option<String>,
    /// When the object was modified, in milliseconds since 1970, if the store says so and has no tag: two
    /// machines of one store may state times that differ by a second.
    pub(crate) modified: Option<i64>,
}

impl Display for Identity {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{} bytes", self.bytes)?;
        if let Some(tag) = &self.tag {
            write!(out, ", ETag {tag}")?;
        }
        if let Some(modified) = self.modified {
            write!(out, ", modified {} s after 1970", modified / 1000)?;
        }
        Ok(())
    }
}
