//! Choices between named rules, with the names that they have in flags and files.

use serde::{Deserialize, Serialize};

/// Where a point of the output takes colour, near infrared and intensity from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ColorRule {
    /// The nearest input point.
    #[default]
    Nearest,
    /// The mean of the input points in the cell.
    Mean,
}

/// Where a point of the output takes its class from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ClassRule {
    /// The nearest input point.
    #[default]
    Nearest,
    /// The class that most input points in the cell have. If several classes have equally
    /// many points, it is the class of the nearest point if that is among them, else the
    /// class with the least number.
    Majority,
}

/// An attribute that is computed from the solution: the scan does not have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Computed {
    /// The normal of the surface: three components of a unit vector that points upwards.
    Normals,
    /// The mean curvature of the surface (1 / CRS unit).
    Curvature,
    /// The area of the point's cell (square CRS units).
    Area,
    /// The number of input points in the cell over its area (1 / square CRS unit).
    Density,
    /// The distance to the nearest input point (CRS units).
    Distance,
    /// The spacing that is wanted at the point (CRS units).
    Spacing,
}
