//! What comes out: even points, and what is known of each.

use crate::{
    geometry::{Local, Quantization},
    lloyd::Rings,
    mesh::{MeshPoint, mesh_of_whole},
    quality::Uniformity,
    tiling::{CellGrid, CellKey},
};

/// An even cloud, in the unit of the input. All vectors have one entry for each output point, in the same
/// order.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Resampled {
    /// Positions on the surfaces of the input: x, y, z.
    pub points: Vec<[f64; 3]>,
    /// Index of the input point that is nearest to each output point; of equally near input points the
    /// smallest index. Any attribute of the input can be taken along by it.
    pub source: Vec<usize>,
    /// Unit normals of the surface, with z ≥ 0; NaN where the input describes no surface.
    pub normals: Vec<[f64; 3]>,
    /// Areas of the Voronoi cells on the surface; NaN where neighbours do not bound the cell all around, or
    /// the input describes no surface.
    pub areas: Vec<f64>,
    /// Mean curvatures of the surface, in 1 / unit, positive where the surface bends towards the normal; NaN
    /// where the input describes no surface.
    pub curvatures: Vec<f64>,
    /// How evenly the points are spread.
    pub uniformity: Uniformity,
    /// The spacing of the output: the requested one, or the one found for a count or a ratio.
    pub spacing: f64,
    pub(super) rings: Rings,
    /// The grid on which the positions are told apart.
    pub(super) quantization: Quantization,
}

/// The neighbours of an output point, in their order around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Ring<'a> {
    /// Indices of the output points whose Voronoi cells share an edge with the point's own, counter-clockwise
    /// seen from the tip of the normal. Empty where the input describes no surface.
    pub neighbors: &'a [u32],
    /// Whether neighbours bound the cell all around. If they do not, the point lies at a border of the
    /// cloud, and the first and the last neighbour are at the two sides of the gap.
    pub is_closed: bool,
}

impl Resampled {
    /// The ring of neighbours of the output point `index`.
    ///
    /// # Panics
    ///
    /// If there is no output point `index`.
    pub fn ring(&self, index: usize) -> Ring<'_> {
        let ring = self.rings.of(index);
        Ring {
            neighbors: ring.neighbors,
            is_closed: ring.is_closed,
        }
    }

    /// The triangles between the output points, by their indices: a mesh of the surfaces, without a seam.
    ///
    /// No edge has more than two triangles. Holes that are narrower than a few spacings are closed, borders are
    /// open, and points where the input describes no surface have no triangles. The corners of a triangle
    /// run counter-clockwise as seen from its side: upwards, or outwards where a component of the mesh encloses a
    /// volume. It is the mesh that a `Job` writes for the same points.
    ///
    /// They are found at each call, in a few percent of the time that [`resample`](crate::resample) took.
    ///
    /// ```
    /// let scan: Vec<[f64; 3]> = (0..40_000)
    ///     .map(|i| [(i % 200) as f64 * 0.01, (i / 200) as f64 * 0.01, 0.0])
    ///     .collect();
    /// let even = lloydar::resample(&scan, &lloydar::Options::with_spacing(0.1))?;
    ///
    /// let triangles = even.triangles();
    /// assert!(triangles.len() > even.points.len());
    /// assert!(triangles.iter().flatten().all(|&corner| (corner as usize) < even.points.len()));
    /// # Ok::<(), lloydar::ResampleError>(())
    /// ```
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let cells =
            CellGrid::new(CellGrid::of_mesh_cells(self.spacing, &self.quantization).square());
        let all = self.points.iter().zip(&self.normals);
        let points = (0..).zip(all).filter_map(|(index, (&point, &normal))| {
            let point = self.quantization.quantise(point)?;
            let CellKey { row, column } = cells.cell(point);
            Some(MeshPoint {
                point,
                // As a file has it.
                normal: has_direction(normal)
                    .then(|| Local::from(normal.map(|component| f64::from(component as f32)))),
                scanner: None,
                index,
                home: 0,
                cell: [row, column],
            })
        });
        mesh_of_whole(points.collect(), &self.quantization, self.spacing).0
    }
}

fn has_direction(normal: [f64; 3]) -> bool {
    normal.iter().all(|component| component.is_finite())
}
