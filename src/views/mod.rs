//! What looks at results: one square before and after, the sample that the 3-D viewer shows,
//! figures by squares for a map, and pictures.

mod detail;
mod error;
mod picture;
mod uniformity_map;
mod viewer_sample;

pub(crate) use detail::{CloudPair, DetailView};
pub(crate) use error::ViewError;
pub(crate) use picture::{Coloring, PictureOptions, draw_picture, render};
pub(crate) use uniformity_map::{UniformityMap, WorstPlace};
pub(crate) use viewer_sample::{ViewerPoint, ViewerSample};
