//! The clouds that methods are compared on: surfaces known as formulas, sampled
//! as scanners and papers sample them; and real scans where they are at hand.

use std::{
    f64::consts::TAU,
    path::{Path, PathBuf},
    sync::Arc,
};

use lloydar::internals::{Local, PlyFile, Quantization, Stored, Street, StreetOptions};

/// Distance from a place (world coordinates) to the true surface, or to its
/// nearest edge.
pub(crate) type Truth = Box<dyn Fn([f64; 3]) -> f64 + Sync>;

/// A cloud, and how many points are to be made of it.
pub(crate) struct Cloud {
    pub(crate) name: String,
    pub(crate) points: Vec<Stored>,
    pub(crate) quantization: Quantization,
    pub(crate) count: usize,
    pub(crate) truth: Option<Truth>,
    pub(crate) edge: Option<Truth>,
    /// Whether a place (world coordinates) is on a large plane.
    pub(crate) plane: Option<Box<dyn Fn([f64; 3]) -> bool + Sync>>,
    /// Reach of the noise, where there is some.
    pub(crate) smooth: Option<f64>,
}

/// Even numbers in [0, 1), the same on every machine (SplitMix64).
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn direction(&mut self) -> Local {
        let z = 2.0 * self.roll() - 1.0;
        let (sin, cos) = (self.roll() * TAU).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Local::new(across * cos, across * sin, z)
    }
}

/// A closed surface of about unit size, as a formula.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Surface {
    Sphere,
    Torus,
    /// A sphere with bumps of a tenth of its radius.
    Bumpy,
}

const TUBE: f64 = 0.4;

impl Surface {
    pub(crate) const ALL: [Self; 3] = [Self::Sphere, Self::Torus, Self::Bumpy];

    fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::Bumpy => "bumpy sphere",
        }
    }

    /// A point, even over the surface.
    fn sample(self, dice: &mut Dice) -> Local {
        loop {
            match self {
                Self::Sphere => return dice.direction(),
                Self::Torus => {
                    let (sin, cos) = (dice.roll() * TAU).sin_cos();
                    let (s, c) = (dice.roll() * TAU).sin_cos();
                    let across = 1.0 + TUBE * c;
                    if dice.roll() * (1.0 + TUBE) < across {
                        return Local::new(across * cos, across * sin, TUBE * s);
                    }
                }
                Self::Bumpy => {
                    let d = dice.direction();
                    let (radius, gradient) = bumps(d);
                    // The gradient along the unit sphere tells the slope.
                    let along = gradient - d * gradient.dot(&d);
                    let stretch = radius * (radius * radius + along.norm_squared()).sqrt();
                    if dice.roll() * 2.2 < stretch {
                        return d * radius;
                    }
                }
            }
        }
    }

    /// To first order in the distance.
    fn distance(self, [x, y, z]: [f64; 3]) -> f64 {
        let at = Local::new(x, y, z);
        match self {
            Self::Sphere => (at.norm() - 1.0).abs(),
            Self::Torus => ((x.hypot(y) - 1.0).hypot(z) - TUBE).abs(),
            Self::Bumpy => {
                let d = at.normalize();
                let (radius, gradient) = bumps(d);
                let along = (gradient - d * gradient.dot(&d)) / at.norm();
                (at.norm() - radius).abs() / (1.0 + along.norm_squared()).sqrt()
            }
        }
    }

    fn truth(self) -> Truth {
        Box::new(move |place| self.distance(place))
    }
}

/// Radius in direction `d`, and its gradient.
fn bumps(d: Local) -> (f64, Local) {
    let [(sx, cx), (sy, cy), (sz, cz)] = [d.x, d.y, d.z].map(|c| (5.0 * c).sin_cos());
    let gradient = Local::new(cx * sy * sz, sx * cy * sz, sx * sy * cz) * 0.5;
    (1.0 + 0.1 * sx * sy * sz, gradient)
}

fn cloud(name: impl Into<String>, places: &[Local], count: usize, truth: Truth) -> Cloud {
    let quantization = Quantization {
        scale: 1e-6,
        offset: [0.0; 3],
    };
    let stored = |&place: &Local| quantization.stored(place);
    Cloud {
        name: name.into(),
        points: places.iter().filter_map(stored).collect(),
        quantization,
        count,
        truth: Some(truth),
        edge: None,
        plane: None,
        smooth: None,
    }
}

/// `points` even random points of a surface to `count`.
pub(crate) fn even(surface: Surface, points: usize, count: usize) -> Cloud {
    let mut dice = Dice(1);
    let places: Vec<Local> = (0..points).map(|_| surface.sample(&mut dice)).collect();
    let name = format!(
        "{}, {} K to {} K",
        surface.name(),
        points / 1000,
        count / 1000
    );
    cloud(name, &places, count, surface.truth())
}

/// 0.9 M points of the bumpy sphere, four times as dense on one side as on the
/// other, with noise of a fifth of the output's spacing, to 100 K.
pub(crate) fn uneven() -> Cloud {
    let mut dice = Dice(2);
    let mut places = Vec::new();
    while places.len() < 900_000 {
        let place = Surface::Bumpy.sample(&mut dice);
        if dice.roll() < 0.625 + 0.375 * place.x / 1.1 {
            places.push(place + dice.direction() * (0.0025 * dice.roll()));
        }
    }
    let name = "object, 0.9 M uneven noisy points to 100 K";
    cloud(name, &places, 100_000, Surface::Bumpy.truth())
}

/// A quarter of 655 K points off the surface, in a ball of a hundredth of the
/// diagonal (paper, Fig. 13).
pub(crate) fn noisy() -> Cloud {
    let mut dice = Dice(3);
    let diagonal = 2.0 * 3.0_f64.sqrt();
    let places: Vec<Local> = (0..655_000)
        .map(|_| {
            let place = Surface::Bumpy.sample(&mut dice);
            if dice.roll() < 0.25 {
                place + dice.direction() * (0.01 * diagonal * dice.roll().cbrt())
            } else {
                place
            }
        })
        .collect();
    let name = "noise: a quarter of 655 K points perturbed, to 100 K";
    Cloud {
        smooth: Some(0.08),
        ..cloud(name, &places, 100_000, Surface::Bumpy.truth())
    }
}

/// More points out than in (paper, Fig. 12).
pub(crate) fn upsampled() -> Cloud {
    Cloud {
        name: "upsampling: torus, 120 K to 480 K".into(),
        ..even(Surface::Torus, 120_000, 480_000)
    }
}

/// A wavy sheet with a border and a round hole, fifty times as dense on one
/// side as on the other (paper, Fig. 5).
pub(crate) fn sheet() -> Cloud {
    let height = |x: f64, y: f64| 0.1 * (3.0 * x).sin() * (2.5 * y).cos();
    let mut dice = Dice(4);
    let mut places = Vec::new();
    while places.len() < 400_000 {
        let (x, y) = (2.0 * dice.roll(), 2.0 * dice.roll());
        let density = 50.0_f64.powf(0.5 * x - 1.0);
        if dice.roll() < density && (x - 0.8).hypot(y - 1.1) > 0.3 {
            places.push(Local::new(x, y, height(x, y)));
        }
    }
    let truth = move |[x, y, z]: [f64; 3]| {
        let slope = (0.3 * (3.0 * x).cos() * (2.5 * y).cos())
            .hypot(0.25 * (3.0 * x).sin() * (2.5 * y).sin());
        (z - height(x, y)).abs() / (1.0 + slope * slope).sqrt()
    };
    let name = "sheet with border and hole, density 50 : 1, 400 K to 20 K";
    cloud(name, &places, 20_000, Box::new(truth))
}

fn of_world(name: &str, world: &[[f64; 3]], count: usize, truth: Option<Truth>) -> Cloud {
    let bound = |pick: fn(f64, f64) -> f64, from: f64| {
        [0, 1, 2].map(|axis| world.iter().fold(from, |b, p| pick(b, p[axis])))
    };
    let quantization =
        Quantization::around(bound(f64::min, f64::MAX), bound(f64::max, f64::MIN), 0.0005);
    Cloud {
        name: name.into(),
        points: world
            .iter()
            .filter_map(|&p| quantization.quantise(p))
            .collect(),
        quantization,
        count,
        truth,
        edge: None,
        plane: None,
        smooth: None,
    }
}

fn of_street(name: &str, street: Street, world: &[[f64; 3]], count: usize) -> Cloud {
    let street = Arc::new(street);
    let [truth, edges] = [&street, &street].map(Arc::clone);
    Cloud {
        truth: Some(Box::new(move |place| truth.distance_to_surface(place))),
        edge: Some(Box::new(move |place| edges.distance_to_edge(place))),
        plane: Some(Box::new(move |place| street.is_on_large_plane(place))),
        ..of_world(name, world, count, None)
    }
}

fn street_of(points: u64) -> Street {
    Street::new(StreetOptions {
        points,
        ..StreetOptions::default()
    })
}

/// A mobile-mapping street (paper, Fig. 1, by its size).
pub(crate) fn street(points: u64, count: usize) -> Cloud {
    let street = street_of(points);
    let slices = (0..2).flat_map(|pass| (0..street.slices(pass)).map(move |s| (pass, s)));
    let world: Vec<[f64; 3]> = slices
        .flat_map(|(pass, slice)| street.slice(pass, slice))
        .map(|p| p.position)
        .collect();
    let name = format!("street, {:.1} M to {} K", points as f64 / 1e6, count / 1000);
    of_street(&name, street, &world, count)
}

/// A scan from a tripod, as dense as the inverse square of the range (paper,
/// Fig. 10, by its size).
pub(crate) fn station() -> Cloud {
    let street = street_of(1);
    let world = street.station(60.0, 881_000);
    of_street("tripod, 881 K to 100 K", street, &world, 100_000)
}

/// Positions of a LAS or LAZ file, or of the vertices of a PLY file.
fn read(path: &Path) -> Result<Vec<[f64; 3]>, Box<dyn std::error::Error>> {
    if path.extension().is_some_and(|e| e == "ply") {
        let mut stream = PlyFile::survey(path)?.open()?;
        let mut places = Vec::new();
        while let Some(place) = stream.next_position()? {
            places.push(place);
        }
        return Ok(places);
    }
    let mut reader = las::Reader::from_path(path)?;
    let count = reader.header().number_of_points();
    let points = reader.read_points(count)?;
    let places = points.x().zip(points.y()).zip(points.z());
    Ok(places.map(|((x, y), z)| [x, y, z]).collect())
}

/// Real scans of more than 20 000 points below `folder`.
pub(crate) fn scans(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = ["street", "airborne", "formats", "objects"]
        .iter()
        .filter_map(|part| std::fs::read_dir(folder.join(part)).ok())
        .flat_map(|entries| entries.filter_map(|entry| Some(entry.ok()?.path())))
        .filter(|path| {
            let extension = path.extension().and_then(|e| e.to_str());
            extension.is_some_and(|e| ["las", "laz", "ply"].contains(&e))
        })
        .collect();
    files.sort();
    files
}

/// A real scan to one in `ratio` of its points; `None` if it has too few.
pub(crate) fn scan(path: &Path, ratio: usize) -> Option<Cloud> {
    let world = read(path).ok().filter(|world| world.len() >= 20_000)?;
    let name = path.file_stem()?.to_string_lossy();
    let name = format!("{name}, {} K to 1/{ratio}", world.len() / 1000);
    Some(of_world(&name, &world, world.len() / ratio, None))
}

/// A third of the points of 30 K random vertices.
pub(crate) fn white_noise(path: &Path) -> Option<Cloud> {
    let mut world = read(path).ok()?;
    let mut dice = Dice(5);
    for place in 0..30_000.min(world.len()) {
        let rest = (world.len() - place) as f64;
        let other = place + (dice.roll() * rest) as usize;
        world.swap(place, other);
    }
    world.truncate(30_000);
    let size = world.iter().flatten().fold(0.0_f64, |s, c| s.max(c.abs()));
    let mut cloud = of_world("igea, 30 K random vertices to 10 K", &world, 10_000, None);
    cloud.quantization = Quantization {
        scale: size * 1e-6,
        offset: [0.0; 3],
    };
    cloud.points = world
        .iter()
        .filter_map(|&p| cloud.quantization.quantise(p))
        .collect();
    Some(cloud)
}
