//! The format and the quantization of a run: what loses nothing of its inputs.

use super::input::InputFile;
use crate::{
    geometry::Quantization,
    las::{
        error::LasError,
        format::{extra_bytes::ExtraAttribute, record_format::RecordFormat},
    },
};

impl RecordFormat {
    /// The format that loses nothing of `inputs`: 8 if one has near infrared, 7 if one has
    /// colour, else 6; the extra bytes of all inputs, by name. Bytes that nothing describes
    /// become one attribute as long as the longest.
    ///
    /// # Errors
    ///
    /// If two inputs give one name to attributes of different lengths.
    pub(crate) fn for_inputs(inputs: &[InputFile]) -> Result<Self, LasError> {
        let point_format = inputs
            .iter()
            .map(|input| {
                let format = input.format();
                6 + u8::from(format.has_color) + u8::from(format.has_nir)
            })
            .max()
            .unwrap_or(6);
        let mut extra_bytes: Vec<ExtraAttribute> = Vec::new();
        let mut undescribed = 0;
        for input in inputs {
            for extra in &input.extra_bytes {
                if !extra.is_described() {
                    undescribed = undescribed.max(extra.length);
                    continue;
                }
                match extra_bytes.iter().find(|known| known.name == extra.name) {
                    Some(known) if known.length == extra.length => {}
                    Some(known) => return Err(contradiction(input, extra, known)),
                    None => extra_bytes.push(extra.clone()),
                }
            }
        }
        if undescribed > 0 {
            extra_bytes.push(ExtraAttribute::undescribed(undescribed));
        }
        Ok(Self {
            point_format,
            extra_bytes,
        })
    }
}

fn contradiction(input: &InputFile, extra: &ExtraAttribute, known: &ExtraAttribute) -> LasError {
    LasError::new(
        &input.path,
        format!(
            "its extra bytes `{}` are {} bytes long, those of an earlier input {}; convert one \
             of them first",
            extra.name, extra.length, known.length
        ),
    )
}

impl InputFile {
    /// The quantization for the points of all `inputs`, as fine as the finest of theirs.
    pub(crate) fn common_quantization<'a>(inputs: impl Iterator<Item = &'a Self>) -> Quantization {
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut scale = f64::INFINITY;
        for input in inputs {
            for axis in 0..3 {
                min[axis] = min[axis].min(input.bounds[0][axis]);
                max[axis] = max[axis].max(input.bounds[1][axis]);
            }
            scale = scale.min(input.finest_scale());
        }
        Quantization::around(min, max, scale)
    }
}
