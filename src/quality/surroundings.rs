//! The nearest distances of sites by what is around them: a surface, its border, or none.

use serde::{Deserialize, Serialize};

use super::DistanceSums;

/// What is around a site.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Surroundings {
    /// A surface, all around.
    Inside,
    /// A surface that ends there: neighbours do not bound the cell.
    Border,
    /// No surface that the scan describes: leaves, a wire, an edge or clutter.
    Elsewhere,
}

impl Surroundings {
    /// What is around a site that is on a surface or not, and whose cell neighbours bound or not.
    pub(crate) fn of(is_on_surface: bool, is_closed: bool) -> Self {
        match (is_on_surface, is_closed) {
            (true, true) => Self::Inside,
            (true, false) => Self::Border,
            (false, _) => Self::Elsewhere,
        }
    }
}

/// The sums over nearest distances that determine δ, by the surroundings of the sites.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SumsBySurroundings {
    pub(crate) inside_surfaces: DistanceSums,
    pub(crate) at_borders: DistanceSums,
    pub(crate) elsewhere: DistanceSums,
}

impl SumsBySurroundings {
    /// The sums over `distances` (CRS units), added in their order.
    pub(crate) fn of(distances: impl Iterator<Item = (Surroundings, f64)>) -> Self {
        let mut sums = Self::default();
        for (surroundings, distance) in distances {
            let part = match surroundings {
                Surroundings::Inside => &mut sums.inside_surfaces,
                Surroundings::Border => &mut sums.at_borders,
                Surroundings::Elsewhere => &mut sums.elsewhere,
            };
            part.push(distance);
        }
        sums
    }

    /// Adds the sums of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        self.inside_surfaces.add(&other.inside_surfaces);
        self.at_borders.add(&other.at_borders);
        self.elsewhere.add(&other.elsewhere);
    }

    /// The sums over all sites.
    pub(crate) fn all(&self) -> DistanceSums {
        let mut all = self.inside_surfaces;
        all.add(&self.at_borders);
        all.add(&self.elsewhere);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sites_are_those_of_all_surroundings() {
        let distances = [
            (Surroundings::Inside, 1.0),
            (Surroundings::Elsewhere, 5.0),
            (Surroundings::Inside, 1.5),
            (Surroundings::Border, 2.0),
        ];
        let sums = SumsBySurroundings::of(distances.into_iter());
        let of = |distances: &[f64]| DistanceSums::of(distances.iter().copied());
        assert_eq!(sums.inside_surfaces, of(&[1.0, 1.5]));
        assert_eq!(sums.at_borders, of(&[2.0]));
        assert_eq!(sums.elsewhere, of(&[5.0]));
        assert_eq!(sums.all(), of(&[1.0, 1.5, 2.0, 5.0]));
        let mut twice = sums;
        twice.add(&sums);
        assert_eq!(twice.all().count, 8);
        assert_eq!(twice.at_borders, of(&[2.0, 2.0]));
    }
}
