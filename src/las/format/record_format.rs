//! The format of the run's records: a point format and extra bytes.

use serde::{Deserialize, Serialize};

use super::{
    extra_bytes::{ExtraAttribute, REAL_DATA_TYPE, total_length},
    fields::{AveragedField, RealAttribute, standard_length},
};

/// The format of all records of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RecordFormat {
    /// The LAS point format: 6, 7 or 8.
    pub(crate) point_format: u8,
    /// The extra bytes in the order of the record. Bytes that nothing describes come last,
    /// because nothing would say how long they are.
    pub(crate) extra_bytes: Vec<ExtraAttribute>,
}

impl RecordFormat {
    /// Adds an extra-bytes attribute of 32-bit reals, unless there is one of that name and
    /// type already, and returns the attribute. The description has at most 32 bytes.
    pub(crate) fn add_real(&mut self, name: &str, description: &str) -> RealAttribute {
        let mut offset = self.standard_length();
        for known in self.described() {
            if known.name == name && known.data_type() == REAL_DATA_TYPE {
                return RealAttribute::at(offset);
            }
            offset += known.length;
        }
        let added = ExtraAttribute::real(name, description);
        self.extra_bytes.insert(self.described().count(), added);
        RealAttribute::at(offset)
    }

    /// The extra bytes that a descriptor describes.
    fn described(&self) -> impl Iterator<Item = &ExtraAttribute> {
        self.extra_bytes.iter().filter(|extra| extra.is_described())
    }

    /// The length of a record up to the bytes that nothing describes, in bytes.
    pub(crate) fn described_length(&self) -> usize {
        self.standard_length() + total_length(self.described())
    }

    /// The length of a record without extra bytes, in bytes.
    pub(crate) fn standard_length(&self) -> usize {
        standard_length(self.point_format)
    }

    /// The length of the extra bytes of a record, in bytes.
    pub(crate) fn extra_length(&self) -> usize {
        total_length(&self.extra_bytes)
    }

    /// The length of a record in bytes.
    pub(crate) fn record_length(&self) -> usize {
        self.standard_length() + self.extra_length()
    }

    /// The fields of the records that can be averaged: the first of [`AveragedField::ALL`].
    pub(crate) fn averaged_fields(&self) -> &'static [AveragedField] {
        AveragedField::of_format(self.point_format)
    }

    /// Whether records have colour.
    pub(crate) fn has_color(&self) -> bool {
        self.point_format >= 7
    }

    /// Whether records have near infrared.
    pub(in crate::las) fn has_near_infrared(&self) -> bool {
        self.point_format >= 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_that_nothing_describes_stay_last() {
        let mut record = RecordFormat {
            point_format: 7,
            extra_bytes: vec![
                ExtraAttribute::named("roll", 4),
                ExtraAttribute::undescribed(3),
            ],
        };
        assert_eq!(record.add_real("CellArea", "of the cell").offset(), 38);
        assert_eq!(record.add_real("Curvature", "mean").offset(), 42);
        assert_eq!(record.add_real("CellArea", "of the cell").offset(), 38);
        assert_eq!(record.described_length(), 46);
        assert_eq!(record.record_length(), 49);
        assert!(record.extra_bytes[3].descriptor.is_empty());
    }
}
