//! What a cloud is written with: the contents of its header, and the means to sort it.

use std::sync::Arc;

use ::las::Vlr;
use serde::{Deserialize, Serialize};

use super::{pcd_options::PcdOptions, pieces::Workforce, store::SortingSpace};
use crate::{
    geometry::Quantization,
    las::format::{crs::Crs, record_format::RecordFormat},
};

/// What the header of an output says.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct CloudHeader {
    /// The format of the records.
    pub(crate) record: RecordFormat,
    /// The scale and the offset.
    pub(crate) quantization: Quantization,
    /// The coordinate reference system.
    pub(crate) crs: Option<Crs>,
    /// The variable length records of the inputs that are as true of the output.
    #[serde(with = "records")]
    pub(crate) carried_records: Vec<Vlr>,
    /// Whether GPS times are adjusted standard times.
    pub(crate) has_standard_time: bool,
    /// How the cloud was made, as JSON.
    pub(crate) provenance: String,
}

/// What is needed to write a cloud whose points are sorted.
#[derive(Clone)]
pub(crate) struct Workspace<'a> {
    /// The approximate distance of neighbouring points (CRS units), where they are nearest to each other.
    pub(crate) spacing: f64,
    /// The edge of the tiles (CRS units), if tiles are written.
    pub(crate) tile_edge: f64,
    /// How PCD files are written.
    pub(crate) pcd: PcdOptions,
    /// The largest value of a colour.
    pub(crate) brightest: u16,
    /// The space for temporary files.
    pub(crate) sorting: Arc<dyn SortingSpace>,
    /// The process or the processes that do the work.
    pub(crate) workforce: &'a dyn Workforce,
    /// The memory for points that are sorted, in bytes.
    pub(crate) sort_bytes: usize,
}

/// Variable length records in text.
mod records {
    use ::las::Vlr;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// User, record number, description and data of a record.
    type Record = (String, u16, String, Vec<u8>);

    pub(super) fn serialize<S: Serializer>(
        records: &[Vlr],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let record = |vlr: &Vlr| -> Record {
            let Vlr {
                user_id,
                record_id,
                description,
                data,
            } = vlr.clone();
            (user_id, record_id, description, data)
        };
        records
            .iter()
            .map(record)
            .collect::<Vec<Record>>()
            .serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<Vlr>, D::Error> {
        let records = Vec::<Record>::deserialize(deserializer)?;
        let vlr = |(user_id, record_id, description, data)| Vlr {
            user_id,
            record_id,
            description,
            data,
        };
        Ok(records.into_iter().map(vlr).collect())
    }
}
