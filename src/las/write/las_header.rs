//! The header of a LAS, LAZ or COPC file: version 1.4, with the variable length records.

use ::las::{
    Builder, GpsTimeType, Header, Transform, Vector, Version, Vlr, point::Format as PointFormat,
};

use super::cloud::CloudHeader;
use crate::las::format::{
    copc::first_records,
    crs::Crs,
    vlr::{EXTRA_BYTES_RECORD, SPECIFICATION_USER},
};

/// The way in which the points of a file are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PointEncoding {
    /// The points are uncompressed.
    Las,
    /// The points are compressed in chunks of equal size.
    Laz,
    /// The points are compressed in chunks that are the nodes of an octree.
    Copc,
}

/// Builds the header of a file.
///
/// # Errors
///
/// If extra bytes are longer than LAS can say, or points of the format cannot be compressed.
pub(super) fn las_header(header: &CloudHeader, encoding: PointEncoding) -> ::las::Result<Header> {
    let mut builder = Builder::from(Version::new(1, 4));
    let mut format = PointFormat::new(header.record.point_format)?;
    format.is_compressed = encoding != PointEncoding::Las;
    format.extra_bytes = u16::try_from(header.record.extra_length())?;
    builder.point_format = format;
    builder.system_identifier = "MODIFICATION".to_owned();
    builder.generating_software = concat!("lloydar ", env!("CARGO_PKG_VERSION")).to_owned();
    builder.date = creation_date();
    builder.gps_time_type = if header.has_standard_time {
        GpsTimeType::Standard
    } else {
        GpsTimeType::Week
    };
    let transform = |axis: usize| Transform {
        scale: header.quantization.scale,
        offset: header.quantization.offset[axis],
    };
    builder.transforms = Vector {
        x: transform(0),
        y: transform(1),
        z: transform(2),
    };
    builder.has_wkt_crs = true;
    if encoding == PointEncoding::Copc {
        builder.vlrs = first_records(header.record.point_format, format.extra_bytes)?.into();
    }
    builder.vlrs.extend(records(header));
    builder.into_header()
}

/// The variable length records that say the CRS, the extra bytes, what the inputs' records
/// say, and how the cloud was made.
fn records(header: &CloudHeader) -> Vec<Vlr> {
    let mut records = header.crs.as_ref().map(Crs::vlrs).unwrap_or_default();
    let descriptors: Vec<u8> = header
        .record
        .extra_bytes
        .iter()
        .flat_map(|extra| extra.descriptor.clone())
        .collect();
    if !descriptors.is_empty() {
        records.push(Vlr {
            user_id: SPECIFICATION_USER.to_owned(),
            record_id: EXTRA_BYTES_RECORD,
            description: "Extra Bytes".to_owned(),
            data: descriptors,
        });
    }
    records.extend(header.carried_records.iter().cloned());
    records.push(Vlr {
        user_id: "lloydar".to_owned(),
        record_id: 1,
        description: "how this cloud was made".to_owned(),
        // A text that is longer than a record can be is cut: it is for people to read.
        data: header.provenance.bytes().take(u16::MAX.into()).collect(),
    });
    records
}

/// The day of `SOURCE_DATE_EPOCH`, for reproducible files, else today.
pub(super) fn creation_date() -> Option<chrono::NaiveDate> {
    let fixed = std::env::var("SOURCE_DATE_EPOCH")
        .ok()
        .and_then(|text| text.trim().parse().ok())
        .and_then(|seconds| chrono::DateTime::from_timestamp(seconds, 0));
    Some(fixed.unwrap_or_else(chrono::Utc::now).date_naive())
}
