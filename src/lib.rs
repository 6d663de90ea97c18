//! Turns laser scans larger than memory into evenly spaced points.

pub mod geometry;
