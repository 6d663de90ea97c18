//! Which colour a point gets in a picture.

use serde::Deserialize;

use crate::{geometry::spread, las::DisplayAttributes};

/// What decides the colour of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Coloring {
    /// The colour of the record if the cloud has colours, otherwise the height.
    #[default]
    Auto,
    /// The height above the lowest point.
    Height,
    /// The intensity.
    Intensity,
    /// The class.
    Class,
}

/// What is known of the values that decide colours, from a sample of the points.
#[derive(Default)]
pub(super) struct ColorRanges {
    /// The largest value of red, green and blue.
    brightest: u16,
    /// The intensities, sorted once all have been added.
    intensities: Vec<u16>,
}

impl ColorRanges {
    /// Adds a point.
    pub(super) fn add(&mut self, attributes: &DisplayAttributes) {
        self.intensities.push(attributes.intensity);
        self.brightest = self.brightest.max(attributes.brightness());
    }

    /// Sorts the intensities, after the last point was added.
    pub(super) fn sort(&mut self) {
        self.intensities.sort_unstable();
    }

    /// Replaces [`Coloring::Auto`] by [`Coloring::Height`] for a cloud without colours.
    pub(super) fn resolve(&self, coloring: Coloring) -> Coloring {
        match coloring {
            Coloring::Auto if self.brightest == 0 => Coloring::Height,
            coloring => coloring,
        }
    }

    /// Returns the colour of a point; `height` is 0 for the lowest and 1 for the highest point.
    pub(super) fn color(
        &self,
        coloring: Coloring,
        attributes: &DisplayAttributes,
        height: f64,
    ) -> [u8; 3] {
        match coloring {
            Coloring::Auto => attributes.color_in_bytes(self.brightest),
            Coloring::Height => ramp(height),
            Coloring::Intensity => {
                let rank = self
                    .intensities
                    .partition_point(|&i| i < attributes.intensity);
                let share = rank as f64 / self.intensities.len().max(1) as f64;
                [(40.0 + 200.0 * share) as u8; 3]
            }
            Coloring::Class => {
                let hue = spread(attributes.class.into()).to_le_bytes();
                [0, 1, 2].map(|c| 60 + (hue[c] >> 1) + (hue[c] >> 3))
            }
        }
    }
}

/// Interpolates a colour from blue (0) over green to yellow (1).
fn ramp(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 4] = [
        [45.0, 75.0, 140.0],
        [45.0, 140.0, 150.0],
        [110.0, 180.0, 110.0],
        [240.0, 210.0, 80.0],
    ];
    let position = share.clamp(0.0, 1.0) * 3.0;
    let low = (position as usize).min(2);
    let part = position - low as f64;
    [0, 1, 2].map(|c| (STOPS[low][c] + part * (STOPS[low + 1][c] - STOPS[low][c])) as u8)
}
