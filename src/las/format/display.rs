//! The attributes of a record by which it is drawn.

use super::record::RecordView;

/// The attributes by which a point is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DisplayAttributes {
    /// The intensity of the return.
    pub(crate) intensity: u16,
    /// Red, green and blue; zeros if records have no colour.
    pub(crate) color: [u16; 3],
    /// The class, by its ASPRS number.
    pub(crate) class: u8,
}

impl DisplayAttributes {
    /// The attributes of `record`, of a format with colour or without.
    ///
    /// # Panics
    ///
    /// If the record is shorter than its format.
    pub(crate) fn of_record(record: &[u8], has_color: bool) -> Self {
        let record = RecordView::new(record);
        Self {
            intensity: record.intensity(),
            color: match has_color {
                true => record.color(),
                false => [0; 3],
            },
            class: record.classification(),
        }
    }

    /// The colour in eight bits. `brightest` is the largest value of the cloud: some programs
    /// write eight bits into the field of sixteen.
    pub(crate) fn color_in_bytes(&self, brightest: u16) -> [u8; 3] {
        let shift = if brightest > 255 { 8 } else { 0 };
        self.color.map(|c| (c >> shift) as u8)
    }

    /// The largest of red, green and blue.
    pub(crate) fn brightness(&self) -> u16 {
        let [red, green, blue] = self.color;
        red.max(green).max(blue)
    }
}
