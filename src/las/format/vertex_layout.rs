//! From the values of a vertex (PLY, E57) to a record of LAS 1.4.
//!
//! Properties that LAS has become its fields by their usual names; all others become extra
//! bytes of their name and type.

use super::{
    extra_bytes::{ExtraAttribute, total_length},
    fields::{
        CLASSIFICATION, COLOR, COORDINATES, FLAGS, GPS_TIME, INTENSITY, NEAR_INFRARED,
        POINT_SOURCE, SCAN_ANGLE, USER_DATA, standard_length,
    },
    ply::{ColorDepth, NORMAL_NAMES, Property, Scalar},
    record::RecordView,
};

/// The field of the record that a property becomes.
#[derive(Clone, Copy, Debug)]
struct TargetField {
    offset: usize,
    kind: Scalar,
    /// The factor by which values are multiplied.
    factor: f64,
}

/// The record that the values of a vertex become.
#[derive(Clone, Debug)]
pub(in crate::las) struct VertexLayout {
    /// The LAS point format: 6, 7 or 8.
    pub(in crate::las) point_format: u8,
    /// The properties that LAS has no field for.
    pub(in crate::las) extra_bytes: Vec<ExtraAttribute>,
    /// Whether a coordinate has single precision.
    pub(in crate::las) is_single: bool,
    /// The field of each property; `None` of coordinates.
    fields: Vec<Option<TargetField>>,
    /// The indices of the properties x, y and z.
    coordinates: [usize; 3],
}

impl VertexLayout {
    /// The layout of vertices with these properties.
    pub(in crate::las) fn of(properties: &[Property]) -> Self {
        let has = |wanted: &str| properties.iter().any(|(name, _)| name == wanted);
        let point_format = match (has("red"), has("nir")) {
            (_, true) => 8,
            (true, false) => 7,
            (false, false) => 6,
        };
        let mut extra_bytes = Vec::new();
        let mut end = standard_length(point_format);
        let mut coordinates = [0; 3];
        let mut fields = Vec::new();
        for (column, (name, kind)) in properties.iter().enumerate() {
            if let "x" | "y" | "z" = name.as_str() {
                coordinates[usize::from(name.as_bytes()[0] - b'x')] = column;
                fields.push(None);
                continue;
            }
            let half = ColorDepth::offset_of_byte(name, properties).map(|offset| TargetField {
                offset: COLOR[0].start + offset,
                kind: Scalar::Uint(1),
                factor: 1.0,
            });
            let field = half.or_else(|| standard_field(name, *kind, point_format));
            let field = field.unwrap_or_else(|| {
                let offset = end;
                end += kind.bytes();
                let name = las_name(name, properties);
                extra_bytes.push(ExtraAttribute::named(name, kind.data_type()));
                TargetField {
                    offset,
                    kind: *kind,
                    factor: 1.0,
                }
            });
            fields.push(Some(field));
        }
        let is_short = |&column: &usize| properties.get(column).is_some_and(|p| p.1.bytes() < 8);
        Self {
            point_format,
            extra_bytes,
            is_single: coordinates.iter().any(is_short),
            fields,
            coordinates,
        }
    }

    /// Appends the record of a vertex with these `values`, on `scale` and `offset`. Returns
    /// `false` and appends nothing if a coordinate is not finite or beyond their range.
    pub(in crate::las) fn append(
        &self,
        values: &[f64],
        scale: [f64; 3],
        offset: [f64; 3],
        records: &mut Vec<u8>,
    ) -> bool {
        let start = records.len();
        let length = standard_length(self.point_format) + total_length(&self.extra_bytes);
        records.resize(start + length, 0);
        let record = &mut records[start..];
        for axis in 0..3 {
            let stored = ((values[self.coordinates[axis]] - offset[axis]) / scale[axis]).round();
            if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&stored) {
                records.truncate(start);
                return false;
            }
            let at = COORDINATES.start + 4 * axis;
            record[at..at + 4].copy_from_slice(&(stored as i32).to_le_bytes());
        }
        RecordView::new(&mut *record).set_single_return();
        for (value, field) in values.iter().zip(&self.fields) {
            if let Some(field) = *field {
                let bytes = field.offset..field.offset + field.kind.bytes();
                field.kind.put(value * field.factor, &mut record[bytes]);
            }
        }
        true
    }
}

/// The name of the extra bytes for the property `name`: normals have the name that our outputs
/// give them.
fn las_name<'a>(name: &'a str, properties: &[Property]) -> &'a str {
    let has_normals = NORMAL_NAMES.iter().all(|(_, of_ply)| {
        let mut all = properties.iter();
        all.any(|(name, kind)| name == of_ply && *kind == Scalar::Float(4))
    });
    let normal = NORMAL_NAMES.iter().find(|(_, of_ply)| *of_ply == name);
    match normal {
        Some((of_las, _)) if has_normals => of_las,
        _ => name,
    }
}

/// The field of LAS that the property `name` of this `kind` becomes; `None` if LAS has none.
fn standard_field(name: &str, kind: Scalar, point_format: u8) -> Option<TargetField> {
    // Eight bits of colour are the upper ones of sixteen, as LAS wants it; reals are shares
    // of the whole.
    let color_factor = match kind {
        Scalar::Uint(1) => 256.0,
        Scalar::Float(_) => 65_535.0,
        _ => 1.0,
    };
    let is_byte = kind == Scalar::Uint(1);
    let is_word = matches!(kind, Scalar::Uint(1 | 2));
    let has_color = point_format > 6;
    let (offset, kind, factor) = match name {
        "red" => (COLOR[0].start, Scalar::Uint(2), color_factor),
        "green" if has_color => (COLOR[1].start, Scalar::Uint(2), color_factor),
        "blue" if has_color => (COLOR[2].start, Scalar::Uint(2), color_factor),
        "nir" => (NEAR_INFRARED.start, Scalar::Uint(2), color_factor),
        "intensity" if is_word => (INTENSITY.start, Scalar::Uint(2), 1.0),
        "flags" if is_byte => (FLAGS, Scalar::Uint(1), 1.0),
        "classification" if is_byte => (CLASSIFICATION, Scalar::Uint(1), 1.0),
        "user_data" if is_byte => (USER_DATA, Scalar::Uint(1), 1.0),
        "scan_angle" if kind == Scalar::Int(2) => (SCAN_ANGLE.start, Scalar::Int(2), 1.0),
        "point_source_id" if is_word => (POINT_SOURCE.start, Scalar::Uint(2), 1.0),
        "gps_time" => (GPS_TIME.start, Scalar::Float(8), 1.0),
        _ => return None,
    };
    Some(TargetField {
        offset,
        kind,
        factor,
    })
}
