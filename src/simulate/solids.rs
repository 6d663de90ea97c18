//! The surfaces of a street, with what they are made of.

use super::shapes::Shape;
use crate::geometry::Local;

/// The class of what is there in one pass only, of those that LAS leaves to its users.
pub(super) const PASSING: u8 = 64;

/// What a surface is made of, which decides its class and its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Material {
    Road,
    Pavement,
    Wall,
    Glass,
    Metal,
    Wire,
    Paint,
    Leaf,
    Wood,
    /// Cars and people that are there in one pass only.
    Passing,
}

impl Material {
    /// Returns the ASPRS class, the reflectance to the laser, and red, green and blue as shares.
    pub(super) fn appearance(self) -> (u8, f64, [f64; 3]) {
        match self {
            Self::Road => (11, 0.3, [0.28, 0.28, 0.30]),
            Self::Pavement => (2, 0.5, [0.55, 0.53, 0.50]),
            Self::Wall => (6, 0.7, [0.72, 0.58, 0.45]),
            Self::Glass => (6, 0.2, [0.25, 0.32, 0.40]),
            Self::Metal => (15, 0.6, [0.40, 0.42, 0.45]),
            Self::Wire => (14, 0.4, [0.12, 0.12, 0.12]),
            Self::Paint => (1, 0.8, [0.65, 0.12, 0.12]),
            Self::Leaf => (5, 0.5, [0.20, 0.50, 0.15]),
            Self::Wood => (5, 0.4, [0.35, 0.25, 0.15]),
            Self::Passing => (PASSING, 0.6, [0.15, 0.25, 0.65]),
        }
    }
}

/// A point at which a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// The distance along the ray.
    pub(super) range: f64,
    /// The normal of the surface, of length 1.
    pub(super) normal: Local,
    pub(super) material: Material,
}

impl Hit {
    /// Returns where the ray meets the surface of this shape and material, if it does.
    pub(super) fn of(
        (shape, material): &(Shape, Material),
        origin: Local,
        direction: Local,
    ) -> Option<Self> {
        let (range, normal) = shape.hit(origin, direction)?;
        Some(Self {
            range,
            normal,
            material: *material,
        })
    }
}

/// Surfaces in the order in which they were built.
#[derive(Debug, Default)]
pub(super) struct Solids(pub(super) Vec<(Shape, Material)>);

impl Solids {
    /// Adds a surface.
    pub(super) fn add(&mut self, shape: Shape, material: Material) {
        self.0.push((shape, material));
    }

    /// Adds a rectangle with this corner and these two edges from it.
    pub(super) fn rectangle(&mut self, corner: [f64; 3], edges: [[f64; 3]; 2], material: Material) {
        let shape = Shape::Rectangle {
            corner: corner.into(),
            edges: edges.map(Local::from),
        };
        self.add(shape, material);
    }

    /// Adds the six sides of a box with this least corner and this size.
    pub(super) fn cuboid(&mut self, low: [f64; 3], size: [f64; 3], material: Material) {
        let edge = |axis: usize| {
            let mut edge = [0.0; 3];
            edge[axis] = size[axis];
            edge
        };
        for axis in 0..3 {
            let edges = [edge((axis + 1) % 3), edge((axis + 2) % 3)];
            let mut far = low;
            far[axis] += size[axis];
            self.rectangle(low, edges, material);
            self.rectangle(far, edges, material);
        }
    }

    /// Adds the mantle of a vertical cylinder above `[x, y]`, between two heights.
    pub(super) fn column(
        &mut self,
        [x, y]: [f64; 2],
        heights: [f64; 2],
        radius: f64,
        material: Material,
    ) {
        let ends = heights.map(|z| Local::new(x, y, z));
        self.add(Shape::Cylinder { ends, radius }, material);
    }
}
