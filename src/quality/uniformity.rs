//! Uniformity: how evenly sites are spread.
//!
//! δ, σ and ε are those of Accelerated Lloyd's Method for Resampling 3D Point
//! Clouds, sections IV-B and V-B. δ alone can be gamed (a voxel grid has
//! δ = 0), so three figures of the cells stand beside it:
//!
//! * *energy ratio*: mean squared distance from the surface to its nearest
//!   site, times n / A, over 5√3/54 = 0.160375, the hexagonal tessellation's:
//!   1 is ideal and nothing is below it;
//! * *cell-area CV*: standard deviation over mean of the areas of the cells;
//! * *packing*: mean nearest distance over that of the hexagonal lattice with
//!   as many sites to the area, sqrt(2 A / (√3 n)).
//!
//! They are taken over the *closed* cells, which neighbours bound all around:
//! at a border of the scan the area of a cell is that of its bounding
//! polygon, and means nothing.

use serde::{Deserialize, Serialize};

use super::deviation::delta;

/// Energy of the regular hexagon over the square of its area: 5√3/54.
pub(crate) const HEXAGON_ENERGY: f64 = 0.160_375_074_774_896_5;

/// Number of bins of nearest distances to a spacing.
const BINS_PER_SPACING: f64 = 256.0;
/// Range of the bins; larger distances are in the last bin.
const RANGE_IN_SPACINGS: f64 = 4.0;

/// Number of bins of areas to the area of the hexagonal lattice's cell.
const BINS_PER_AREA: f64 = 64.0;
/// Range of the bins of areas; larger ones are in the last bin.
const RANGE_IN_AREAS: f64 = 4.0;
/// Area of the cells of the hexagonal lattice of spacing 1.
const AREA_PER_SITE: f64 = 0.866_025_403_784_438_6;
/// Cells whose areas differ from the mean by no more than this share of it are even.
const EVEN_WITHIN: f64 = 0.25;

/// The figures of one site's cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellFigures {
    /// Area (CRS units squared).
    pub area: f64,
    /// ∫ |x − site|² over the cell (CRS units to the fourth).
    pub energy: f64,
    /// Number of neighbouring cells.
    pub neighbors: u8,
}

/// A tally of sites, in bounded memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UniformityTally {
    spacing: f64,
    /// Number and sum (CRS units) of the nearest distances in each bin.
    bins: Vec<(u64, f64)>,
    /// Number of cells in each bin of areas.
    area_bins: Vec<u64>,
    count: u64,
    alone: u64,
    sum: f64,
    squares: f64,
    min: f64,
    cells: u64,
    area: f64,
    area_squares: f64,
    energy: f64,
    with_six: u64,
}

/// The figures of a [`UniformityTally`]. Lengths are CRS units; figures of nothing are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uniformity {
    /// Number of sites without another one within the search radius: strays, which the figures
    /// of distance leave out.
    pub alone: u64,
    /// Number of sites with a nearest neighbour.
    pub count: u64,
    /// δ: standard deviation of the nearest distances over their mean (paper, equation 6).
    pub delta: f64,
    /// δ without the one distance in a hundred that is largest.
    pub delta_trimmed: f64,
    /// σ: mean absolute deviation of the nearest distances.
    pub sigma: f64,
    /// σ over the mean distance.
    pub sigma_over_mean: f64,
    /// ε: cosine between the vector of the distances and a constant one.
    pub epsilon: f64,
    /// Mean nearest distance.
    pub mean: f64,
    /// Smallest nearest distance over the mean.
    pub min: f64,
    /// The first percentile of the nearest distances over their mean.
    pub p1: f64,
    /// Median of the nearest distances over their mean.
    pub p50: f64,
    /// The 99th percentile of the nearest distances over their mean.
    pub p99: f64,
    /// Number of closed cells.
    pub cells: u64,
    /// Energy of the closed cells over that of the hexagonal tessellation.
    pub energy_ratio: f64,
    /// Standard deviation over mean of the cells' areas.
    pub cell_area_cv: f64,
    /// Mean nearest distance over that of the hexagonal lattice with as many sites to the area.
    pub packing: f64,
    /// Share of closed cells with six neighbours.
    pub six_neighbors: f64,
    /// Share of closed cells whose area is within a quarter of the mean.
    pub even_cells: f64,
}

impl Uniformity {
    /// The figures of distance of `self`, with the figures of the cells of `cells`.
    #[must_use]
    pub(crate) fn with_cells_of(self, cells: &Self) -> Self {
        Self {
            cells: cells.cells,
            energy_ratio: cells.energy_ratio,
            cell_area_cv: cells.cell_area_cv,
            packing: cells.packing,
            six_neighbors: cells.six_neighbors,
            even_cells: cells.even_cells,
            ..self
        }
    }
}

impl UniformityTally {
    /// An empty tally, for sites approximately `spacing` apart (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            bins: vec![(0, 0.0); (BINS_PER_SPACING * RANGE_IN_SPACINGS) as usize + 1],
            area_bins: vec![0; (BINS_PER_AREA * RANGE_IN_AREAS) as usize + 1],
            count: 0,
            alone: 0,
            sum: 0.0,
            squares: 0.0,
            // JSON cannot express infinity.
            min: f64::MAX,
            cells: 0,
            area: 0.0,
            area_squares: 0.0,
            energy: 0.0,
            with_six: 0,
        }
    }

    /// Adds a site's distance to its nearest neighbour (CRS units).
    pub(crate) fn push_distance(&mut self, distance: f64) {
        let last = self.bins.len() - 1;
        let bin = (distance / self.spacing * BINS_PER_SPACING) as usize;
        let bin = &mut self.bins[bin.min(last)];
        bin.0 += 1;
        bin.1 += distance;
        self.count += 1;
        self.sum += distance;
        self.squares += distance * distance;
        self.min = self.min.min(distance);
    }

    /// Adds a site that has no neighbour within the search radius.
    pub(crate) fn push_alone(&mut self) {
        self.alone += 1;
    }

    /// Adds a site's closed cell.
    pub fn push_cell(&mut self, cell: CellFigures) {
        self.cells += 1;
        let areas = cell.area / (AREA_PER_SITE * self.spacing * self.spacing);
        let last = self.area_bins.len() - 1;
        self.area_bins[((areas * BINS_PER_AREA) as usize).min(last)] += 1;
        self.area += cell.area;
        self.area_squares += cell.area * cell.area;
        self.energy += cell.energy;
        self.with_six += u64::from(cell.neighbors == 6);
    }

    /// Adds the sites of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        for (bin, more) in self.bins.iter_mut().zip(&other.bins) {
            bin.0 += more.0;
            bin.1 += more.1;
        }
        for (bin, more) in self.area_bins.iter_mut().zip(&other.area_bins) {
            *bin += more;
        }
        self.count += other.count;
        self.alone += other.alone;
        self.sum += other.sum;
        self.squares += other.squares;
        self.min = self.min.min(other.min);
        self.cells += other.cells;
        self.area += other.area;
        self.area_squares += other.area_squares;
        self.energy += other.energy;
        self.with_six += other.with_six;
    }

    /// The number of nearest distances in each of `bins` equal parts of 0 to `spacings` spacings.
    pub(crate) fn histogram(&self, bins: usize, spacings: f64) -> Vec<u64> {
        let mut counts = vec![0; bins];
        for (k, &(count, _)) in self.bins.iter().enumerate() {
            let part = (k as f64 + 0.5) / BINS_PER_SPACING / spacings;
            if let Some(bin) = counts.get_mut((part * bins as f64) as usize) {
                *bin += count;
            }
        }
        counts
    }

    /// The figures of all sites so far.
    pub fn figures(&self) -> Uniformity {
        let n = self.count as f64;
        let mean = self.sum / n;
        let cells = self.cells as f64;
        let cell_area = self.area / cells;
        let sigma = self
            .bins
            .iter()
            .filter(|bin| bin.0 > 0)
            .map(|&(count, sum)| (sum - count as f64 * mean).abs())
            .sum::<f64>()
            / n;
        Uniformity {
            alone: self.alone,
            count: self.count,
            delta: delta(n, self.sum, self.squares),
            delta_trimmed: self.delta_trimmed(),
            sigma,
            sigma_over_mean: sigma / mean,
            epsilon: self.sum / (n * self.squares).sqrt(),
            mean,
            min: self.min / mean,
            p1: self.quantile(0.01) / mean,
            p50: self.quantile(0.5) / mean,
            p99: self.quantile(0.99) / mean,
            cells: self.cells,
            energy_ratio: self.energy / self.area / cell_area / HEXAGON_ENERGY,
            cell_area_cv: delta(cells, self.area, self.area_squares),
            packing: mean / (2.0 * cell_area / 3.0_f64.sqrt()).sqrt(),
            six_neighbors: self.with_six as f64 / cells,
            even_cells: self.even_cells() as f64 / cells,
        }
    }

    /// The mean distance of the bin in which the share `share` of the sites is reached.
    fn quantile(&self, share: f64) -> f64 {
        let rank = (share * self.count as f64).ceil() as u64;
        let mut seen = 0;
        self.bins
            .iter()
            .find(|bin| {
                seen += bin.0;
                bin.0 > 0 && seen >= rank
            })
            .map_or(f64::NAN, |&(count, sum)| sum / count as f64)
    }

    /// The number of cells whose area is within a quarter of the mean, by the centres of the bins.
    fn even_cells(&self) -> u64 {
        let mean = self.area / self.cells as f64 / (AREA_PER_SITE * self.spacing * self.spacing);
        let is_even = |bin: usize| {
            let area = (bin as f64 + 0.5) / BINS_PER_AREA;
            (area / mean - 1.0).abs() <= EVEN_WITHIN
        };
        let bins = self.area_bins.iter().enumerate();
        let even = bins.filter(|&(bin, _)| is_even(bin));
        even.map(|(_, &count)| count).sum()
    }

    /// δ without the largest hundredth of the distances, by the means of the bins.
    fn delta_trimmed(&self) -> f64 {
        let mut rest = self.count - self.count / 100;
        let kept = rest as f64;
        let (mut sum, mut squares) = (0.0, 0.0);
        for &(count, total) in self.bins.iter().filter(|bin| bin.0 > 0) {
            let taken = rest.min(count);
            let mean = total / count as f64;
            sum += mean * taken as f64;
            squares += mean * mean * taken as f64;
            rest -= taken;
        }
        delta(kept, sum, squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hexagonal_lattice_is_ideal() {
        let mut tally = UniformityTally::new(1.0);
        let area = 0.75_f64.sqrt();
        for _ in 0..1000 {
            tally.push_distance(1.0);
            tally.push_cell(CellFigures {
                area,
                energy: HEXAGON_ENERGY * area * area,
                neighbors: 6,
            });
        }
        let figures = tally.figures();
        assert!(figures.delta < 1e-7 && figures.sigma < 1e-12);
        assert!((figures.energy_ratio - 1.0).abs() < 1e-9);
        assert!((figures.packing - 1.0).abs() < 1e-9);
        assert!(figures.cell_area_cv < 1e-6);
        assert_eq!(figures.six_neighbors, 1.0);
        assert_eq!(figures.even_cells, 1.0);
        assert!((figures.epsilon - 1.0).abs() < 1e-12);
    }

    #[test]
    fn cells_are_even_within_a_quarter_of_the_mean() {
        let mut tally = UniformityTally::new(1.0);
        // Of a mean of 0.9 all but the smallest and the largest fifth of the cells.
        for share in [0.6, 0.8, 1.0, 1.2, 1.4].repeat(20) {
            tally.push_cell(CellFigures {
                area: 0.9 * share,
                energy: 0.1,
                neighbors: 6,
            });
        }
        assert!((tally.figures().even_cells - 0.6).abs() < 1e-12);
    }

    #[test]
    fn the_figures_match_their_definitions() {
        let distances: Vec<f64> = (0..5000)
            .map(|i| 0.5 + 0.3 * f64::from(i * 7919 % 5000) / 5000.0)
            .collect();
        let mut tally = UniformityTally::new(1.0);
        for &d in &distances {
            tally.push_distance(d);
        }
        let n = distances.len() as f64;
        let mean = distances.iter().sum::<f64>() / n;
        let delta = (distances
            .iter()
            .map(|d| (d / mean - 1.0).powi(2))
            .sum::<f64>()
            / n)
            .sqrt();
        let sigma = distances.iter().map(|d| (d - mean).abs()).sum::<f64>() / n;
        let figures = tally.figures();
        assert!((figures.delta - delta).abs() < 1e-9);
        // Only the bin that holds the mean is not exact.
        assert!((figures.sigma - sigma).abs() < 1e-4);
        assert!((figures.p50 * mean - 0.65).abs() < 1e-3);
        assert!((figures.epsilon.powi(-2) - 1.0 - delta * delta).abs() < 1e-9);
        assert!(figures.delta_trimmed < figures.delta);
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let distance = |i: i32| 0.25 * f64::from(i % 9 + 1);
        let (mut whole, mut part, mut other) = (
            UniformityTally::new(1.0),
            UniformityTally::new(1.0),
            UniformityTally::new(1.0),
        );
        for i in 0..900 {
            let part = if i % 2 == 0 { &mut part } else { &mut other };
            for tally in [&mut whole, part] {
                tally.push_distance(distance(i));
                tally.push_cell(CellFigures {
                    area: distance(i),
                    energy: distance(i) * distance(i),
                    neighbors: 5 + (i % 3) as u8,
                });
                tally.push_alone();
            }
        }
        part.add(&other);
        assert_eq!(part, whole);
    }
}
