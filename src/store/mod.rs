//! Where the bytes of inputs and outputs lie: in files, on web servers, in object stores.
//!
//! ```text
//!   address       is it a path or an address? what of it may be shown?
//!   source        an input, whose ranges are read as those of a file
//!   identity      by which a change of an input is noticed
//!   checksum      by which the output names an input
//!   remote        (feature `remote`) objects: requests, what is read ahead, uploads
//! ```
//!
//! What is remote is addressed by `https://`, `http://`, `s3://`, `gs://` or `az://`. Nothing above this
//! module knows of requests, and nothing in it of points.

mod address;
mod checksum;
mod identity;
#[cfg(not(feature = "remote"))]
mod local_only;
#[cfg(feature = "remote")]
mod remote;
mod source;

#[cfg(not(feature = "remote"))]
use local_only as remote;

pub(crate) use address::{
    has_secret, is_remote, joined, serialize_without_secrets, without_secrets,
};
pub(crate) use identity::Identity;
pub(crate) use remote::Destination;
pub(crate) use source::{Source, SourceReader};
