//! The frame that points are drawn on.

use std::io::Write;

/// Largest radius of a disc: a point just before the eye must not hide everything.
const LARGEST_RADIUS_IN_PIXELS: f64 = 20.0;
/// How strongly a pixel is darkened by what stands before it.
const SHADING: f64 = 60.0;
/// Distance between a pixel and those that are compared with its depth.
const SHADING_REACH_IN_PIXELS: i64 = 2;
/// The colour of pixels without points.
pub(super) const PAPER_COLOR: [u8; 3] = [251, 251, 249];

/// Colours and depths of all pixels, row by row from the upper left.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    size: [u32; 2],
    depths: Vec<f32>,
    colors: Vec<[u8; 3]>,
}

impl Canvas {
    /// An empty frame of `size` pixels, to the right and downwards.
    pub(crate) fn new(size: [u32; 2]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self {
            size,
            depths: vec![f32::INFINITY; pixels],
            colors: vec![PAPER_COLOR; pixels],
        }
    }

    /// Draws a disc of `radius` pixels around `position` behind everything nearer; of two equally
    /// near discs the darker one is visible, whatever the order.
    pub(crate) fn disc(&mut self, position: [f64; 2], depth: f64, radius: f64, color: [u8; 3]) {
        let radius = radius.clamp(0.5, LARGEST_RADIUS_IN_PIXELS);
        let [width, height] = self.size.map(i64::from);
        let (left, right) = range(position[0], radius, width);
        let (top, bottom) = range(position[1], radius, height);
        let depth = depth as f32;
        for y in top..bottom {
            for x in left..right {
                let [dx, dy] = [x as f64 + 0.5 - position[0], y as f64 + 0.5 - position[1]];
                if radius > 1.0 && dx * dx + dy * dy > radius * radius {
                    continue;
                }
                let pixel = (y * width + x) as usize;
                let known = (self.depths[pixel], self.colors[pixel]);
                if (depth, color) < known {
                    self.depths[pixel] = depth;
                    self.colors[pixel] = color;
                }
            }
        }
    }

    /// The picture with eye-dome lighting: a pixel is the darker, the farther the pixels around it
    /// stand before it. The bytes are red, green, blue, row by row.
    pub(crate) fn shaded(&self) -> Vec<u8> {
        let [width, height] = self.size.map(i64::from);
        let mut picture = Vec::with_capacity(3 * self.colors.len());
        for y in 0..height {
            for x in 0..width {
                let pixel = (y * width + x) as usize;
                let depth = self.depths[pixel];
                let mut light = 1.0;
                if depth.is_finite() {
                    let around = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j)));
                    let before: f64 = around
                        .map(|(i, j)| {
                            let (x, y) = (
                                x + SHADING_REACH_IN_PIXELS * i,
                                y + SHADING_REACH_IN_PIXELS * j,
                            );
                            if !(0..width).contains(&x) || !(0..height).contains(&y) {
                                return 0.0;
                            }
                            let other = self.depths[(y * width + x) as usize];
                            // Relative to the distance, so that near and far are shaded alike.
                            f64::from((depth / other).ln().max(0.0))
                        })
                        .filter(|share| share.is_finite())
                        .sum();
                    light = 0.25 + 0.75 * (-SHADING * before / 8.0).exp();
                }
                picture.extend(self.colors[pixel].map(|c| (f64::from(c) * light).round() as u8));
            }
        }
        picture
    }

    /// Width and height, in pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Writes the shaded picture as PNG.
    ///
    /// # Errors
    ///
    /// If `out` takes no more.
    pub(crate) fn write_png(&self, out: impl Write) -> std::io::Result<()> {
        write_rgb(&self.shaded(), self.size, out)
    }
}

/// Writes `pixels`, three bytes each, of a picture of `size` as PNG.
///
/// # Errors
///
/// If `out` takes no more.
pub(super) fn write_rgb(pixels: &[u8], size: [u32; 2], out: impl Write) -> std::io::Result<()> {
    let mut encoder = png::Encoder::new(out, size[0], size[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(std::io::Error::other)?;
    writer
        .write_image_data(pixels)
        .and_then(|()| writer.finish())
        .map_err(std::io::Error::other)
}

/// The range of pixels on one axis that a disc around `middle` may cover.
fn range(middle: f64, radius: f64, most: i64) -> (i64, i64) {
    // `as` saturates, and takes what is not a number for zero.
    let first = (middle - radius).floor() as i64;
    let last = (middle + radius).ceil() as i64;
    (first.clamp(0, most), last.clamp(0, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_is_seen_whatever_the_order() {
        let discs = [
            ([20.0, 20.0], 9.0, 6.0, [200, 0, 0]),
            ([22.0, 20.0], 3.0, 4.0, [0, 200, 0]),
            ([18.0, 21.0], 3.0, 4.0, [0, 0, 200]),
            ([-3.0, 500.0], 1.0, 2.0, [9, 9, 9]),
        ];
        let drawn = |order: &[usize]| {
            let mut canvas = Canvas::new([40, 30]);
            for &i in order {
                let (position, depth, radius, color) = discs[i];
                canvas.disc(position, depth, radius, color);
            }
            canvas
        };
        let (forth, back) = (drawn(&[0, 1, 2, 3]), drawn(&[3, 2, 1, 0]));
        assert_eq!(forth.colors, back.colors);
        assert_eq!(forth.colors[20 * 40 + 20], [0, 0, 200]);
        assert_eq!(forth.colors[20 * 40 + 24], [0, 200, 0]);
        assert_eq!(forth.colors[15 * 40 + 20], [200, 0, 0]);
        assert_eq!(forth.colors[0], PAPER_COLOR);
        // Behind the green disc it is darker than on it.
        let picture = forth.shaded();
        assert!(picture[3 * (15 * 40 + 22)] < 200);
        assert_eq!(picture[3 * (20 * 40 + 23) + 1], 200);
    }

    #[test]
    fn a_picture_is_a_picture() {
        let mut file = Vec::new();
        Canvas::new([7, 5]).write_png(&mut file).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (7, 5));
        assert_eq!(pixels[..3], PAPER_COLOR);
    }
}
