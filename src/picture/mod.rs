//! Still pictures of clouds: points as discs, shaded by what stands before what.
//!
//! Only the frame is kept in memory: points are drawn one by one, in any number and order.

mod camera;
mod canvas;
mod sheet;

pub(crate) use camera::{Camera, Scene, View};
pub(crate) use canvas::Canvas;
pub(crate) use sheet::write_sheet;
