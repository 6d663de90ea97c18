//! Meshes of triangles as files: written in a stream, complete under their names or not there
//! at all.
//!
//! All vertices of a mesh come first, then all triangles, in batches of any size; nothing of
//! it stays in memory. PLY and OBJ have world coordinates. GLB has single precision and
//! therefore a local origin ([`local_frame`]); many GLB files are the tiles of one
//! [`tileset`].

mod encoder;
pub(in crate::las) mod format;
mod glb;
mod glb_document;
pub(in crate::las) mod header;
mod local_frame;
mod obj;
mod ply;
#[cfg(test)]
mod samples;
pub(in crate::las) mod tile_directory;
mod tile_tree;
pub(in crate::las) mod tileset;
pub(in crate::las) mod writer;
