//! `render`: a picture of a cloud.

use std::path::PathBuf;

use clap::Args;

use super::{exit::DONE, inputs::Inputs, options::by_name};
use crate::{
    job::{JobError, write_file},
    picture::View,
    views::{Coloring, PictureOptions, png_path, render},
};

/// Which clouds are drawn, and how.
#[derive(Args)]
pub(super) struct RenderArguments {
    #[command(flatten)]
    files: Inputs,
    /// The picture (.png)
    #[arg(short, long, value_name = "FILE", default_value = "cloud.png", value_parser = png_path)]
    output: PathBuf,
    /// top, oblique or street: from within, along the longer side
    #[arg(long, default_value = "oblique", value_parser = by_name::<View>)]
    view: View,
    /// auto (colour if there is one, else height), height, intensity or class
    #[arg(long, default_value = "auto", value_parser = by_name::<Coloring>)]
    by: Coloring,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1600x900", value_parser = pixels)]
    size: [u32; 2],
    /// Diameter of the points, in CRS units [default: by the density of the points]
    #[arg(long, value_name = "LENGTH")]
    point_size: Option<f64>,
}

/// Reads `1600x900`: pixels to the right and downwards.
pub(super) fn pixels(text: &str) -> Result<[u32; 2], String> {
    let size = text.split_once('x').and_then(|(width, height)| {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
        Some([side(width)?, side(height)?])
    });
    size.ok_or_else(|| format!("`{text}` is not a size in pixels; write it like 1600x900"))
}

/// Draws clouds and writes the picture.
pub(super) fn draw(arguments: &RenderArguments) -> Result<u8, JobError> {
    let picture = PictureOptions {
        view: arguments.view,
        coloring: arguments.by,
        size: arguments.size,
        point_size: arguments.point_size,
    };
    write_file(
        &arguments.output,
        &render(&arguments.files.paths()?, &picture)?,
    )?;
    Ok(DONE)
}
