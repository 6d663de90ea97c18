//! Turns laser scans larger than memory into evenly spaced points.

pub mod geometry;
pub mod lloyd;
pub mod quality;
