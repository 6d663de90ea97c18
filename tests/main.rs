//! Tests of the program and of the library from outside, one executable of them all: each
//! executable is linked with the whole library again, and waits for those before it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod cluster;
mod count;
mod density;
mod docs;
mod edges;
mod formats;
mod isolated;
mod layers;
mod levels;
mod mesh;
mod mesh_views;
mod newcomer;
mod pcd;
mod program;
#[cfg(feature = "remote")]
mod range_server;
#[cfg(feature = "remote")]
mod remote;
mod reproject;
mod resample;
mod running;
mod solver;
mod sources;
mod transients;
mod unbreakable;
