//! The methods that are compared, and the figures of what they make.

use std::{collections::BTreeMap, time::Instant};

use lloydar::internals::{
    AREA_PER_SEED, Acceleration, DistanceFigures, DistanceTally, DominantNormals, Local,
    NeighborGrid, PatchKind, Restriction, Scan, SeedRule, Site, SolverOptions, Stored, TileRegion,
    Uniformity, describe_positions, elect, solve, uniformity,
};

use crate::clouds::{Cloud, Dice};

/// A way to make evenly spaced points of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// As lloydar does unless told otherwise.
    Ours,
    /// The same without acceleration.
    Plain,
    /// The same with planes for patches, the method of Chen et al.
    Planes,
    /// Area-weighted seeds, one Anderson mixture and one threshold for the
    /// cloud.
    Paper,
    /// Poisson-disk seeds, and nothing else.
    Poisson,
    Random,
    /// Means of the points of the cells of a cubic lattice.
    Voxel,
}

impl Method {
    pub(crate) const ALL: [Self; 7] = [
        Self::Ours,
        Self::Plain,
        Self::Planes,
        Self::Paper,
        Self::Poisson,
        Self::Random,
        Self::Voxel,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Ours => "**lloydar**",
            Self::Plain => "no acceleration",
            Self::Planes => "planar patches",
            Self::Paper => "the paper's settings",
            Self::Poisson => "Poisson seeds alone",
            Self::Random => "random",
            Self::Voxel => "voxel means",
        }
    }

    /// Whether the method can make as many points as are asked for: thinning
    /// makes none.
    pub(crate) fn can(self, cloud: &Cloud) -> bool {
        cloud.count <= cloud.points.len() || !matches!(self, Self::Poisson | Self::Random)
    }

    pub(crate) fn options(self, cloud: &Cloud, spacing: f64) -> SolverOptions {
        let mut options = SolverOptions::new(spacing);
        if let Some(smooth) = cloud.smooth {
            options.smooth = smooth;
        }
        let seeds_per_point = cloud.count as f64 / cloud.points.len() as f64;
        options.fill *= seeds_per_point.max(1.0).sqrt();
        match self {
            Self::Ours | Self::Random | Self::Voxel => {}
            Self::Plain => options.acceleration = Acceleration::None,
            Self::Planes => options.patch = PatchKind::Plane,
            Self::Paper => {
                options.seeds = SeedRule::Area;
                options.fill = 0.0;
                options.acceleration = Acceleration::AndersonGlobal;
                options.restriction = Restriction::Global(1.5 * mean_nearest(cloud));
                options.seeds_per_point = seeds_per_point;
            }
            Self::Poisson => {
                options.seeds = SeedRule::Poisson;
                options.iterations = 0;
                options.fill = 0.0;
                options.smooth = 0.0;
            }
        }
        options
    }

    /// The options with which `cloud` is solved: as those of the method, and with the directions that its planes face.
    pub(crate) fn solver_options(self, cloud: &Cloud, spacing: f64) -> SolverOptions {
        let mut options = self.options(cloud, spacing);
        if options.seeds == SeedRule::Hexagonal {
            let points = cloud.points.clone();
            options.dominant_normals =
                DominantNormals::of_points(points, &cloud.quantization, &options);
        }
        options
    }
}

/// Mean distance between neighbouring points; the paper's threshold is 0.5 to 1.5
/// of it.
fn mean_nearest(cloud: &Cloud) -> f64 {
    let spread = 2000.0 / cloud.points.len() as f64;
    let extent = extent(cloud);
    let options = SolverOptions::new(extent / 500.0);
    let scan = Scan::as_scanned(cloud.points.clone(), cloud.quantization, &options);
    let distances = scan.sampled_distances(spread, extent, |_| true);
    distances.iter().sum::<f64>() / distances.len() as f64
}

fn extent(cloud: &Cloud) -> f64 {
    let bound = |axis: fn(&Stored) -> i32| {
        let all = cloud.points.iter().map(axis);
        f64::from(all.clone().max().unwrap_or(0)) - f64::from(all.min().unwrap_or(0))
    };
    let size = bound(|p| p.x).max(bound(|p| p.y)).max(bound(|p| p.z));
    size * cloud.quantization.scale
}

/// δ at the start of every iteration and at the end, from seeds of `rule`, and
/// the seconds it took.
pub(crate) fn curve(
    cloud: &Cloud,
    spacing: f64,
    rule: SeedRule,
    acceleration: Acceleration,
) -> (Vec<f64>, f64) {
    let options = SolverOptions {
        seeds: rule,
        acceleration,
        ..Method::Ours.solver_options(cloud, spacing)
    };
    let scan = scan(cloud, &options);
    let start = Instant::now();
    let solution = solve(&scan, &TileRegion::everything(), &options);
    let seconds = start.elapsed().as_secs_f64();
    (solution.delta_by_iteration(), seconds)
}

/// What a method made, and how even it is.
pub(crate) struct Outcome {
    pub(crate) seconds: f64,
    pub(crate) figures: Uniformity,
    /// To the truth where it is known, else to the scan.
    pub(crate) accuracy: DistanceFigures,
    pub(crate) coverage: DistanceFigures,
    /// As the accuracy, of sites within two spacings of an edge; NaN where no
    /// edges are known.
    pub(crate) at_edges: DistanceFigures,
    /// The energy ratio of closed cells on large planes, on patches that are trusted fully and more than 1.5 spacings from an
    /// edge; NaN where no planes are known.
    pub(crate) on_planes: f64,
    /// Sites farther from the scan than it is dense around them.
    pub(crate) astray: usize,
    pub(crate) held: f64,
    pub(crate) open: f64,
}

pub(crate) fn run(cloud: &Cloud, method: Method, spacing: f64) -> Outcome {
    let options = method.solver_options(cloud, spacing);
    let start = Instant::now();
    let places = match method {
        Method::Random => random(cloud),
        Method::Voxel => voxel_means(cloud),
        _ => {
            let scan = scan(cloud, &options);
            let solution = solve(&scan, &TileRegion::everything(), &options);
            solution.sites.iter().map(|site| site.position).collect()
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    judge(cloud, &places, seconds)
}

pub(crate) fn scan(cloud: &Cloud, options: &SolverOptions) -> Scan {
    Scan::new(cloud.points.clone(), cloud.quantization, options)
}

/// The spacing at which `method` makes the cloud's count.
pub(crate) fn spacing(cloud: &Cloud, method: Method) -> f64 {
    // Were it a cube.
    let mut spacing = (6.0 * extent(cloud).powi(2) / cloud.count as f64).sqrt() * 0.5;
    for _ in 0..12 {
        let options = method.solver_options(cloud, spacing);
        let made = elect(&scan(cloud, &options), &options).identities.len();
        let error = made as f64 / cloud.count as f64;
        if (error - 1.0).abs() < 0.003 {
            break;
        }
        spacing *= error.sqrt();
    }
    spacing
}

fn random(cloud: &Cloud) -> Vec<Local> {
    let share = cloud.count as f64 / cloud.points.len() as f64;
    let mut dice = Dice(6);
    let chosen = cloud.points.iter().filter(|_| dice.roll() < share);
    chosen.map(|&p| cloud.quantization.local(p)).collect()
}

fn voxel_means(cloud: &Cloud) -> Vec<Local> {
    let means = |edge: f64| -> Vec<Local> {
        let mut cells: BTreeMap<[i32; 3], (Local, f64)> = BTreeMap::new();
        for &point in &cloud.points {
            let place = cloud.quantization.local(point);
            let cell = [0, 1, 2].map(|axis| (place[axis] / edge).floor() as i32);
            let (sum, count) = cells.entry(cell).or_default();
            *sum += place;
            *count += 1.0;
        }
        cells.into_values().map(|(sum, n)| sum / n).collect()
    };
    let mut edge = extent(cloud) / (cloud.count as f64).sqrt();
    for _ in 0..5 {
        let made = means(edge).len() as f64;
        edge *= (made / cloud.count as f64).sqrt();
    }
    means(edge)
}

/// The same measure for every method: cells on the patches of the scan, at the
/// spacing that this number of points would have on the surface.
fn judge(cloud: &Cloud, places: &[Local], seconds: f64) -> Outcome {
    let spacing = hexagonal_spacing(cloud, places);
    let options = Method::Ours.options(cloud, spacing);
    let scan = scan(cloud, &options);
    let sites = describe_positions(&scan, &TileRegion::everything(), &options, places);
    let positions: Vec<Local> = sites.iter().map(|site| site.position).collect();
    let grid = NeighborGrid::new(&positions, spacing);
    let tally = uniformity(&sites, spacing);
    let mut accuracy = DistanceTally::new(spacing);
    let mut coverage = DistanceTally::new(spacing);
    let mut at_edges = DistanceTally::new(spacing);
    let mut on_planes: Vec<&Site> = Vec::new();
    let mut astray = 0;
    for site in &sites {
        let near = scan.nearest(site.position, 8.0 * spacing);
        let to_scan = near.map_or(8.0 * spacing, |(_, distance)| distance);
        let [x, y, z] = site.position.into();
        let [a, b, c] = cloud.quantization.offset;
        let place = [x + a, y + b, z + c];
        let off = cloud.truth.as_ref().map_or(to_scan, |truth| truth(place));
        accuracy.push(off);
        let to_edge = cloud.edge.as_ref().map(|edge| edge(place));
        if to_edge.is_some_and(|distance| distance <= 2.0 * spacing) {
            at_edges.push(off);
        }
        let is_plane = cloud.plane.as_ref().is_some_and(|plane| plane(place));
        let is_inside = to_edge.is_some_and(|distance| distance > 1.5 * spacing);
        if is_plane && is_inside && site.trust >= 1.0 {
            on_planes.push(site);
        }
        astray += usize::from(to_scan > 0.5 * spacing && is_astray(&scan, site.position, to_scan));
    }
    for point in scan.representatives() {
        let place = scan.quantization().local(point);
        let near = grid.nearest(place, 8.0 * spacing, |_| false);
        coverage.push(near.map_or(8.0 * spacing, |(_, squared)| squared.sqrt()));
    }
    let share = |of: fn(&Site) -> bool| {
        sites.iter().filter(|site| of(site)).count() as f64 / sites.len() as f64
    };
    Outcome {
        seconds,
        figures: tally.figures(),
        accuracy: accuracy.figures(),
        coverage: coverage.figures(),
        at_edges: at_edges.figures(),
        on_planes: uniformity(on_planes, spacing).figures().energy_ratio,
        astray,
        held: share(|site| site.is_fixed),
        open: share(|site| !site.is_closed),
    }
}

fn is_counted(site: &Site) -> bool {
    site.is_closed && !site.is_fixed
}

/// Whether a place lies farther from the scan than the scan's own points lie
/// from each other around it.
fn is_astray(scan: &Scan, place: Local, distance: f64) -> bool {
    let radius = 3.0 * distance;
    let mut around = 0;
    scan.samples().visit_around(place, radius, |index, sample| {
        if (sample - place).norm() <= radius {
            around += scan.count(index);
        }
    });
    // So many points on a disc are this far apart.
    distance > radius * (std::f64::consts::PI / f64::from(around.max(1))).sqrt()
}

/// The edge of a hexagonal lattice as dense as `places` lie on surfaces.
fn hexagonal_spacing(cloud: &Cloud, places: &[Local]) -> f64 {
    // Mean nearest distances are 0.55 (random) to 0.96 (even) of it: found from
    // the area of cells, in two steps.
    let extent = extent(cloud);
    let grid = NeighborGrid::new(places, extent / (places.len() as f64).sqrt());
    let every = places.len().div_ceil(20_000);
    let near: Vec<f64> = (0..places.len())
        .step_by(every)
        .filter_map(|own| grid.nearest(places[own], extent, |other| other as usize == own))
        .map(|(_, squared)| squared.sqrt())
        .collect();
    let mut spacing = 1.1 * near.iter().sum::<f64>() / near.len() as f64;
    for _ in 0..2 {
        let options = Method::Ours.options(cloud, spacing);
        let scan = scan(cloud, &options);
        let sites = describe_positions(&scan, &TileRegion::everything(), &options, places);
        let areas: Vec<f64> = sites
            .iter()
            .filter(|s| is_counted(s))
            .map(|s| s.area)
            .collect();
        if areas.len() > 100 {
            let mean = areas.iter().sum::<f64>() / areas.len() as f64;
            spacing = (mean / AREA_PER_SEED).sqrt();
        }
    }
    spacing
}
