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
    /// type already, and returns the attribute. One of that name and another type is renamed, since readers refuse a name
    /// that occurs twice. The description has at most 32 bytes.
    pub(crate) fn add_real(&mut self, name: &str, description: &str) -> RealAttribute {
        let mut offset = self.standard_length();
        let described = |extra: &&mut ExtraAttribute| extra.is_described();
        for known in self.extra_bytes.iter_mut().filter(described) {
            if known.name == name {
                if known.data_type() == REAL_DATA_TYPE {
                    return RealAttribute::at(offset);
                }
                known.rename(&format!("Scanned{name}"));
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

    #[test]
    fn an_attribute_of_the_scan_with_another_type_is_renamed() {
        let mut record = RecordFormat {
            point_format: 6,
            extra_bytes: vec![ExtraAttribute::named("NormalX", 10)],
        };
        assert_eq!(record.add_real("NormalX", "of the surface").offset(), 38);
        assert_eq!(record.add_real("NormalX", "of the surface").offset(), 38);
        let described = record.extra_bytes.iter();
        let described = described.map(|e| ExtraAttribute::from_descriptor(&e.descriptor).unwrap());
        let described: Vec<_> = described.map(|e| (e.name, e.length)).collect();
        let expected = [("ScannedNormalX".to_owned(), 8), ("NormalX".to_owned(), 4)];
        assert_eq!(described, expected);
    }
}
