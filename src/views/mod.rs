//! What looks at results: one square from above before and after, the sample that the 3-D viewer
//! shows, figures by squares for a map, and pictures.
//!
//! Views read the input from its spill and the output from the settled tiles ([`cloud_pair`]), or
//! clouds from their files. They decide nothing about the output.

mod cloud_pair;
mod coloring;
mod detail;
mod error;
mod pair_picture;
mod picture;
mod square_triangles;
mod uniformity_map;
mod viewer_sample;
mod viewer_square;

pub(crate) use cloud_pair::CloudPair;
pub(crate) use coloring::Coloring;
pub(crate) use detail::DetailView;
pub(crate) use error::ViewError;
pub(crate) use pair_picture::{PairPictureOptions, render_pair};
pub(crate) use picture::{PictureOptions, draw_picture, png_path, render};
pub(crate) use square_triangles::SquareTriangles;
pub(crate) use uniformity_map::{MapPart, UniformityMap, WorstPlace};
pub(crate) use viewer_sample::{ViewerPoint, ViewerSample};
