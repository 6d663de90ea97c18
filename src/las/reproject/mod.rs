//! From the CRS of an input to another one, as its points are read.
//!
//! Projections are those of PROJ, by the crate `proj4rs`, with the definitions of the EPSG registry. Datums are never
//! shifted: two systems on different datums are refused, unless both are defined as coinciding with WGS 84.

mod definition;
mod degrees;
mod target;
mod transformation;
mod utm;

pub(super) use degrees::Degrees;
pub(crate) use target::ReprojectionTarget;
pub(crate) use transformation::Reprojection;
pub(crate) use utm::{UtmZone, zone_around};
