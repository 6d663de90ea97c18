//! The report of a job: what it read, did and wrote, for people and for machines.
//!
//! [`Report`] has all figures, and is the JSON. [`page`] is the report as a page, [`viewer`] a
//! page with a square of the cloud in three dimensions, [`summary`] a few lines for a terminal.

mod chart;
mod contents;
mod convergence;
mod figure_tables;
mod html;
mod isolated;
mod levels;
mod map;
mod mesh;
mod numbers;
mod page;
mod scenes;
mod squares;
mod summary;
mod tallies;
mod tile_map;
mod transients;
mod verdict;
mod viewer;
mod wording;

pub(crate) use contents::Report;
pub(crate) use numbers::{counted, figure, thousands};
pub(crate) use viewer::VIEWER_PAGE;
pub(crate) use wording::stage_title;

/// The ending that the name of an output gets for its report.
pub(crate) const REPORT_PAGE: &str = ".report.html";
