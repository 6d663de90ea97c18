//! Still pictures of clouds: points as discs, shaded by what stands before what.
//!
//! Nothing but the frame is held: points are drawn as they come, in any number and order.

mod camera;
mod canvas;

pub(crate) use camera::{Camera, Scene, View};
pub(crate) use canvas::Canvas;
