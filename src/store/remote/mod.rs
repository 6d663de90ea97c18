//! Objects: what is read of them by requests for ranges, and what is written.
//!
//! ```text
//!   client        address ─► store, with credentials of the environment
//!   request       one request, again and again until it is answered; what its failures mean
//!   object        an object by its identity: its ranges, small pieces that are kept, the checksum
//!   reader        the bytes of an object in order, requested before they are needed
//!   digest        the checksum of an object that arrives in pieces
//!   destination   a local file ─► an object, complete or not there
//! ```
//!
//! Requests run on threads of their own; those who read wait for them there.

mod client;
mod destination;
mod digest;
mod object;
mod reader;
mod request;

pub(crate) use destination::Destination;
pub(super) use object::Object;
pub(crate) use reader::ObjectReader;
