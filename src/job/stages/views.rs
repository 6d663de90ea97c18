//! Views of the result for the report: an overview picture, detail views, and the viewer sample.

use crate::{
    job::error::JobError,
    las::CloudLevels,
    picture::View,
    views::{
        CloudPair, Coloring, DetailView, PictureOptions, SquareTriangles, UniformityMap,
        ViewerSample, WorstPlace, draw_picture,
    },
};

/// The options of the overview picture.
const OVERVIEW: PictureOptions = PictureOptions {
    view: View::Oblique,
    coloring: Coloring::Auto,
    size: [1280, 640],
    point_size: None,
};

/// Views of the input and the output of a job.
#[derive(Clone, Debug)]
pub(crate) struct ResultViews {
    /// One square before and after.
    pub(crate) detail: DetailView,
    /// The points that the 3-D viewer shows.
    pub(crate) viewer_sample: ViewerSample,
    /// A picture of the output, in PNG.
    pub(crate) overview: Vec<u8>,
    /// Figures of input and output by squares.
    pub(crate) uniformity_map: UniformityMap,
    /// The places where the output is least even.
    pub(crate) worst: Vec<WorstPlace>,
}

impl ResultViews {
    /// Makes the views of `cloud`, which has `points`. The detail view lies in the tile with the
    /// number `tile`, and the viewer sample in the square of `mesh`, with the `levels` of its points.
    ///
    /// # Errors
    ///
    /// [`JobError`] if temporary files cannot be read.
    pub(super) fn new(
        cloud: &CloudPair<'_>,
        uniformity_map: UniformityMap,
        points: u64,
        tile: u32,
        mesh: &SquareTriangles,
        levels: Option<&CloudLevels>,
    ) -> Result<Self, JobError> {
        let overview = || {
            draw_picture(
                &OVERVIEW,
                points,
                cloud.has_color,
                cloud.quantization,
                &|draw| cloud.visit_output(draw),
            )
        };
        let details = || -> Result<_, JobError> {
            let worst = worst_places(cloud, &uniformity_map)?;
            let detail = cloud.detail_in_middle_of(tile)?;
            Ok((worst, detail, cloud.viewer_sample(mesh, levels)?))
        };
        let (overview, details) = rayon::join(overview, details);
        let (worst, detail, viewer_sample) = details?;
        Ok(Self {
            detail,
            viewer_sample,
            overview: overview?,
            uniformity_map,
            worst,
        })
    }
}

/// The places of `cloud` where the output is least even, by its `map`.
fn worst_places(cloud: &CloudPair<'_>, map: &UniformityMap) -> Result<Vec<WorstPlace>, JobError> {
    let places = map.least_even_points().into_iter();
    let worst = places.map(|(delta, point)| {
        Ok(WorstPlace {
            position: cloud.quantization.world(point),
            delta,
            detail: cloud.detail_around([point.x.into(), point.y.into()])?,
        })
    });
    worst.collect()
}
