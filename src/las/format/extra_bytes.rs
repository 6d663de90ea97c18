//! Extra bytes: attributes of a record beyond those of its point format.
//!
//! A variable length record of the file describes them, 192 bytes for each attribute
//! (LAS Specification 1.4 R15, tables 24 and 25):
//!
//! ```text
//!     0  reserved       2 bytes
//!     2  data type      u8
//!     3  options        u8; bit 0: the no-data value is declared
//!     4  name           32 bytes, padded with zeros
//!    40  no-data value  8 bytes (in the attribute's own type), 16 of no use
//!   160  description    32 bytes, padded with zeros
//! ```

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// The length of a descriptor in bytes.
pub(in crate::las) const DESCRIPTOR_BYTES: usize = 192;
/// The data type of 32-bit reals.
pub(in crate::las) const REAL_DATA_TYPE: u8 = 9;
/// How many scalar data types there are; their pairs follow them, then their triples.
pub(in crate::las) const SCALAR_DATA_TYPES: usize = 10;

const DATA_TYPE: usize = 2;
const OPTIONS: usize = 3;
const NAME: Range<usize> = 4..36;
const NO_DATA_START: usize = 40;
const DESCRIPTION: Range<usize> = 160..192;
/// The option that says that the no-data value is declared.
const DECLARES_NO_DATA: u8 = 1;
/// The lengths of the scalar data types 1 to 10, in bytes: u8, i8, u16, i16, u32, i32, u64,
/// i64, f32, f64.
const SCALAR_BYTES: [usize; SCALAR_DATA_TYPES] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

/// An extra-bytes attribute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ExtraAttribute {
    /// The name of the attribute; empty if nothing describes its bytes.
    pub(crate) name: String,
    /// The length of the attribute in bytes.
    pub(crate) length: usize,
    /// The descriptor of the specification (192 bytes); empty if nothing describes the bytes.
    pub(crate) descriptor: Vec<u8>,
}

impl ExtraAttribute {
    /// Reads one descriptor; `None` if it is cut short or of an unknown data type.
    pub(in crate::las) fn from_descriptor(descriptor: &[u8]) -> Option<Self> {
        let data_type = *descriptor.get(DATA_TYPE)?;
        // Types 11 to 30 are pairs and triples of 1 to 10 (deprecated, still met); for type 0
        // the options are the number of opaque bytes.
        let length = match data_type {
            0 => usize::from(*descriptor.get(OPTIONS)?),
            1..=30 => {
                let index = usize::from(data_type - 1);
                SCALAR_BYTES[index % SCALAR_DATA_TYPES] * (index / SCALAR_DATA_TYPES + 1)
            }
            _ => return None,
        };
        let name = descriptor.get(NAME)?;
        let end = name.iter().position(|&b| b == 0).unwrap_or(name.len());
        Some(Self {
            name: String::from_utf8_lossy(&name[..end]).into_owned(),
            length,
            descriptor: descriptor.get(..DESCRIPTOR_BYTES)?.to_vec(),
        })
    }

    /// An attribute of this name (cut after 32 bytes) and data type (1 to 30).
    pub(in crate::las) fn named(name: &str, data_type: u8) -> Self {
        let mut descriptor = vec![0; DESCRIPTOR_BYTES];
        descriptor[DATA_TYPE] = data_type;
        let name: Vec<u8> = name.bytes().take(NAME.len()).collect();
        descriptor[NAME][..name.len()].copy_from_slice(&name);
        Self::from_descriptor(&descriptor).unwrap_or_else(|| Self::undescribed(0))
    }

    /// Gives the attribute, which a descriptor describes, another name (cut after 32 bytes).
    pub(super) fn rename(&mut self, name: &str) {
        self.name = name.chars().take(NAME.len()).collect();
        self.descriptor[NAME].fill(0);
        self.descriptor[NAME][..self.name.len()].copy_from_slice(self.name.as_bytes());
    }

    /// An attribute of 32-bit reals.
    ///
    /// # Panics
    ///
    /// If the description is longer than 32 bytes.
    pub(super) fn real(name: &str, description: &str) -> Self {
        let mut real = Self::named(name, REAL_DATA_TYPE);
        let text = description.as_bytes();
        real.descriptor[DESCRIPTION][..text.len()].copy_from_slice(text);
        real
    }

    /// The attribute that stands for `length` bytes that nothing describes.
    pub(in crate::las) fn undescribed(length: usize) -> Self {
        Self {
            name: String::new(),
            length,
            descriptor: Vec::new(),
        }
    }

    /// Whether a descriptor says what the bytes are.
    pub(in crate::las) fn is_described(&self) -> bool {
        !self.descriptor.is_empty()
    }

    /// The number of the data type (table 25); 0 for opaque and for undescribed bytes.
    pub(in crate::las) fn data_type(&self) -> u8 {
        self.descriptor.get(DATA_TYPE).copied().unwrap_or(0)
    }

    /// Whether the attribute is a scalar with a value that stands for a missing number.
    pub(super) fn declares_no_data(&self) -> bool {
        let options = self.descriptor.get(OPTIONS).copied().unwrap_or(0);
        let is_scalar = (1..=SCALAR_DATA_TYPES).contains(&self.data_type().into());
        options & DECLARES_NO_DATA != 0 && is_scalar
    }

    /// The bytes that records get whose input lacks the attribute: the no-data value if a
    /// scalar attribute declares one, else zeros.
    pub(super) fn no_data(&self) -> Vec<u8> {
        if self.declares_no_data() {
            self.descriptor[NO_DATA_START..NO_DATA_START + self.length].to_vec()
        } else {
            vec![0; self.length]
        }
    }
}

/// The sum of the lengths of `attributes`, in bytes.
pub(in crate::las) fn total_length<'a>(
    attributes: impl IntoIterator<Item = &'a ExtraAttribute>,
) -> usize {
    attributes.into_iter().map(|extra| extra.length).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_of_an_extra_byte_follows_its_type() {
        let mut descriptor = [0_u8; 192];
        descriptor[4..8].copy_from_slice(b"roll");
        for (data_type, length) in [(1, 1), (3, 2), (6, 4), (10, 8), (19, 8), (30, 24)] {
            descriptor[2] = data_type;
            let extra = ExtraAttribute::from_descriptor(&descriptor).unwrap();
            assert_eq!((extra.length, extra.name.as_str()), (length, "roll"));
        }
        descriptor[2] = 31;
        assert_eq!(ExtraAttribute::from_descriptor(&descriptor), None);
    }
}
