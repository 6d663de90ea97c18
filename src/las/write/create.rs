//! The writer for each format.

use std::path::Path;

use super::{
    cloud::{CloudHeader, Workspace},
    copc::create_copc,
    las::create_las,
    las_header::PointEncoding,
    output_format::Format,
    pcd::create_pcd,
    ply::create_ply,
    point_order::PointOrder,
    progressive::ProgressiveBody,
    tiles::create_tiles,
    writer::CloudWriter,
};
use crate::las::error::LasError;

impl CloudWriter {
    /// Begins the cloud at `path`, under another name in the same directory. COPC, PCD and
    /// tiles need a `workspace`, in which their points are sorted, and so does a progressive order.
    ///
    /// # Errors
    ///
    /// If no file can be made there, or it would replace a directory with other files.
    pub(crate) fn create(
        path: &Path,
        format: Format,
        header: &CloudHeader,
        workspace: Option<&Workspace>,
    ) -> Result<Self, LasError> {
        format.check_replaceable(path)?;
        let progressive = workspace
            .filter(|workspace| workspace.order == PointOrder::Progressive && format.keeps_order());
        let workspace = || {
            workspace.ok_or_else(|| {
                LasError::unwritable(
                    path,
                    "its points have to be sorted, but not here; write .laz",
                )
            })
        };
        let writer = match format {
            Format::Las => create_las(path, header, PointEncoding::Las),
            Format::Laz => create_las(path, header, PointEncoding::Laz),
            Format::Ply => create_ply(path, header),
            Format::Copc => create_copc(path, header, workspace()?),
            Format::Pcd => create_pcd(path, header, workspace()?),
            Format::Tiles(format) => create_tiles(path, format, header, workspace()?),
        }?;
        match progressive {
            Some(workspace) => writer.wrapped(|ordered| {
                let path = path.to_owned();
                Ok(Box::new(ProgressiveBody::new(
                    path, header, workspace, ordered,
                )?))
            }),
            None => Ok(writer),
        }
    }
}
