//! Turns laser scans larger than memory into evenly spaced points.

pub mod config;
pub mod geometry;
pub mod las;
pub mod lloyd;
pub mod pipeline;
pub mod quality;
pub mod report;
pub mod simulate;
pub mod tile;
