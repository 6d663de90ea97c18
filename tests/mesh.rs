//! Meshes that jobs write: between the points of their clouds, and the same whatever the tiles.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use lloydar::{
    Job, Options,
    internals::{Street, StreetOptions},
    resample,
};

use crate::running::{lloydar, points_in_order, report, run, start, street, succeed, text};

const SPACING: &str = "0.3";
/// The ASPRS classes of what has no surface, or one narrower than a spacing: foliage, wires, poles and stems.
const WITHOUT_SURFACE: [u8; 3] = [5, 14, 15];

/// The files of a cloud and of its mesh in `dir`, by their endings.
fn files_of(dir: &Path, name: &str, endings: [&str; 2]) -> [PathBuf; 2] {
    endings.map(|ending| dir.join(format!("{name}.{ending}")))
}

/// A mesh as an OBJ file has it.
struct Mesh {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
}

impl Mesh {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let numbers = |line: &str| -> Vec<f64> {
            line.split(' ')
                .skip(1)
                .map(|word| word.parse().unwrap())
                .collect()
        };
        let vertices = text
            .lines()
            .filter(|line| line.starts_with("v "))
            .map(numbers);
        let corners = |line: &str| -> Vec<usize> {
            let words = line.split(' ').skip(1);
            words
                .map(|word| word.split('/').next().unwrap().parse::<usize>().unwrap() - 1)
                .collect()
        };
        let triangles = text
            .lines()
            .filter(|line| line.starts_with("f "))
            .map(corners);
        Self {
            vertices: vertices.map(|v| [v[0], v[1], v[2]]).collect(),
            triangles: triangles.map(|t| t.try_into().unwrap()).collect(),
        }
    }

    /// For each edge whether each of its triangles runs through it upwards.
    fn edges(&self) -> HashMap<[usize; 2], Vec<bool>> {
        let mut edges: HashMap<[usize; 2], Vec<bool>> = HashMap::new();
        for &[a, b, c] in &self.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                edges
                    .entry([from.min(to), from.max(to)])
                    .or_default()
                    .push(from < to);
            }
        }
        edges
    }
}

#[test]
fn vertices_are_the_points_of_the_cloud_and_figures_those_of_the_triangles() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (cloud, path) = (dir.path().join("even.las"), dir.path().join("even.obj"));
    succeed(
        &scans,
        &cloud,
        &["--spacing", SPACING, "--mesh", text(&path)],
    );
    let mesh = Mesh::read(&path);
    let points = points_in_order(&cloud);
    assert_eq!(mesh.vertices.len(), points.len());
    let [first, origin] = [mesh.vertices[0], points[0].map(f64::from)];
    for (vertex, point) in mesh.vertices.iter().zip(&points) {
        for axis in 0..3 {
            let steps = (vertex[axis] - first[axis]) / 0.001;
            assert!((steps - (f64::from(point[axis]) - origin[axis])).abs() < 0.01);
        }
    }

    let figures = &report(&cloud)["mesh"];
    let edges = mesh.edges();
    let with = |count: usize| edges.values().filter(|runs| runs.len() == count).count();
    assert_eq!(figures["triangles"], mesh.triangles.len());
    assert_eq!(figures["inner_edges"], with(2));
    assert_eq!(figures["border_edges"], with(1));
    assert!(
        edges
            .values()
            .all(|runs| matches!(runs[..], [_] | [true, false] | [false, true]))
    );
    let corners: BTreeSet<usize> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(figures["points_used"], corners.len());
    // A street has surfaces nearly everywhere, and few borders.
    assert!(corners.len() > points.len() * 9 / 10);
    assert!(with(1) < with(2) / 15, "{} {}", with(1), with(2));
}

#[test]
fn tiles_threads_memory_and_kills_do_not_show_in_the_mesh() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let mesh_of = |name: &str, spacing: &str, more: &[&str]| {
        let [cloud, mesh] = files_of(dir.path(), name, ["laz", "ply"]);
        let mut arguments = vec!["--spacing", spacing, "--mesh", text(&mesh)];
        arguments.extend(more);
        succeed(&scans, &cloud, &arguments);
        (fs::read(mesh).unwrap(), points_in_order(&cloud))
    };
    let whole = mesh_of("whole", SPACING, &["--tile-size", "1000", "--threads", "2"]);
    for more in [
        &["--tile-size", "15", "--threads", "1"][..],
        &["--memory", "160MiB", "--threads", "2"],
    ] {
        assert!(mesh_of(&more.join(""), SPACING, more) == whole, "{more:?}");
    }

    // As sparse as the scan, surfaces are rough, and hang together so that triangles must be cut out. With little memory
    // the mesh is made in several parts.
    let few = ["--tile-size", "15", "--iterations", "4"];
    let rough = mesh_of("rough", "0.12", &few);
    let figures = &report(&dir.path().join("rough.laz"))["mesh"];
    assert!(figures["points_used"].as_u64() > Some(120_000) && figures["cut"].as_u64() > Some(0));
    let little_memory = [&few[..], &["--memory", "160MiB"]].concat();
    assert!(mesh_of("little memory", "0.12", &little_memory) == rough);

    // Killed at several moments, and continued each time.
    let (cloud, mesh) = (dir.path().join("killed.laz"), dir.path().join("killed.ply"));
    let arguments = [
        "run",
        text(&scans),
        "-o",
        text(&cloud),
        "-q",
        "--spacing",
        SPACING,
        "--tile-size",
        "15",
    ];
    let arguments = [&arguments[..], &["--mesh", text(&mesh)]].concat();
    let begun = Instant::now();
    lloydar(&[&arguments[..], &["--job", text(&dir.path().join("trial"))]].concat());
    let whole_time = begun.elapsed();
    fs::remove_file(&cloud).unwrap();
    fs::remove_file(&mesh).unwrap();
    for share in [0.3, 0.6, 0.9] {
        let mut job = start(&arguments);
        thread::sleep(Duration::from_secs_f64(share * whole_time.as_secs_f64()));
        job.kill().unwrap();
        job.wait().unwrap();
    }
    if !cloud.exists() {
        succeed(
            &scans,
            &cloud,
            &[
                "--spacing",
                SPACING,
                "--tile-size",
                "15",
                "--mesh",
                text(&mesh),
            ],
        );
    }
    assert!((fs::read(&mesh).unwrap(), points_in_order(&cloud)) == whole);
}

/// The number of triangles in a GLB file.
fn triangles_in(glb: &[u8]) -> u64 {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let indices = &json["meshes"][0]["primitives"][0]["indices"];
    let accessor = &json["accessors"][indices.as_u64().unwrap() as usize];
    accessor["count"].as_u64().unwrap() / 3
}

/// The files in a directory by their names.
fn files_in(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(dir).unwrap().map(|entry| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        (name, fs::read(path).unwrap())
    });
    files.collect()
}

/// Collects the contents of a tile and of all below, whose errors are smaller.
fn collect_contents(tile: &serde_json::Value, contents: &mut Vec<String>) {
    contents.extend(tile["content"]["uri"].as_str().map(str::to_owned));
    let error = tile["geometricError"].as_f64().unwrap();
    for child in tile["children"].as_array().into_iter().flatten() {
        assert!(child["geometricError"].as_f64().unwrap() < error);
        collect_contents(child, contents);
    }
}

#[test]
fn a_mesh_in_tiles_has_all_triangles_once_and_coarser_levels_above() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let mesh_of = |name: &str| dir.path().join(format!("{name}-mesh"));
    let words = |name: &str| {
        let words = ["--spacing", SPACING, "--output-tiles", "15", "--mesh"];
        [
            &words.map(str::to_owned)[..],
            &[text(&mesh_of(name)).to_owned()],
        ]
        .concat()
    };
    let tiles_of = |name: &str, more: &[&str]| {
        let words = words(name);
        let words: Vec<&str> = words
            .iter()
            .map(String::as_str)
            .chain(more.iter().copied())
            .collect();
        succeed(&scans, &dir.path().join(name), &words);
        assert!(!dir.path().join(format!("{name}.job")).exists());
        files_in(&mesh_of(name))
    };
    let files = tiles_of("even", &["--threads", "2"]);
    let report = report(&dir.path().join("even"));

    // Every tile is in the index, once.
    let index: serde_json::Value = serde_json::from_slice(&files["tileset.json"]).unwrap();
    assert_eq!(index["asset"]["version"], "1.1");
    let mut contents = Vec::new();
    collect_contents(&index["root"], &mut contents);
    contents.sort();
    let tiles: Vec<&String> = files
        .keys()
        .filter(|name| *name != "tileset.json")
        .collect();
    assert!(contents.iter().eq(tiles));

    // Each level has the triangles of its mesh, and about a quarter of those below.
    let counts_of = |level: usize| {
        let prefix = format!("level{level}_");
        let tiles = files.iter().filter(|(name, _)| name.starts_with(&prefix));
        let counts: Vec<u64> = tiles.map(|(_, bytes)| triangles_in(bytes)).collect();
        (counts.len(), counts.iter().sum::<u64>())
    };
    let (mut tiles, mut triangles) = counts_of(0);
    assert!(tiles >= 6, "{tiles}");
    assert_eq!(report["mesh"]["triangles"], triangles);
    let levels = report["mesh"]["coarser_levels"].as_array().unwrap();
    for (level, expected) in (1..).zip(levels) {
        let above = counts_of(level);
        assert_eq!(expected["tiles"], above.0);
        assert_eq!(expected["triangles"], above.1);
        assert!(above.0 <= tiles);
        let share = above.1 as f64 / triangles as f64;
        assert!((0.15..0.3).contains(&share), "level {level}: {share}");
        (tiles, triangles) = above;
    }
    assert!(levels.len() >= 2 && (tiles == 1 || triangles < 2500));

    for more in [&["--threads", "1"][..], &["--memory", "160MiB"]] {
        assert!(tiles_of(&more.concat(), more) == files, "{more:?}");
    }

    // Killed while a coarser level is made, and continued.
    let killed = dir.path().join("killed");
    let output = ["run", text(&scans), "-q", "-o", text(&killed)].map(str::to_owned);
    let output = [&output[..], &words("killed")].concat();
    let mut job = start(&output.iter().map(String::as_str).collect::<Vec<_>>());
    let levels = dir.path().join("killed.job").join("levels");
    let is_running = |job: &mut std::process::Child| job.try_wait().unwrap().is_none();
    while is_running(&mut job) && !levels.exists() {
        thread::sleep(Duration::from_millis(5));
    }
    job.kill().unwrap();
    job.wait().unwrap();
    assert!(levels.exists() && !mesh_of("killed").exists());
    assert!(tiles_of("killed", &[]) == files);
}

#[test]
fn the_library_makes_the_mesh_of_the_job() {
    let dir = tempfile::tempdir().unwrap();
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let sphere: Vec<[f64; 3]> = (0..60_000)
        .map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 60_000.0;
            let (sin, cos) = (golden * f64::from(k)).sin_cos();
            let wide = (1.0 - z * z).sqrt();
            [wide * cos, wide * sin, z]
        })
        .collect();
    let scan = dir.path().join("sphere.las");
    let mut builder = las::Builder::from((1, 4));
    builder.transforms = las::Vector {
        x: las::Transform {
            scale: 1e-5,
            offset: 0.0,
        },
        y: las::Transform {
            scale: 1e-5,
            offset: 0.0,
        },
        z: las::Transform {
            scale: 1e-5,
            offset: 0.0,
        },
    };
    builder.point_format = las::point::Format::new(6).unwrap();
    let mut writer = las::Writer::from_path(&scan, builder.into_header().unwrap()).unwrap();
    for &[x, y, z] in &sphere {
        let point = las::Point {
            x,
            y,
            z,
            gps_time: Some(0.0),
            ..las::Point::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    let (cloud, path) = (dir.path().join("even.las"), dir.path().join("even.obj"));
    Job::new([&scan], &cloud)
        .spacing(0.08)
        .mesh(&path)
        .run()
        .unwrap();
    let mesh = Mesh::read(&path);
    assert!(mesh.edges().values().all(|runs| runs.len() == 2));
    let edges = mesh.edges().len();
    assert_eq!(
        mesh.vertices.len() + mesh.triangles.len() - edges,
        2,
        "like a sphere"
    );

    let stored: Vec<[f64; 3]> = sphere
        .iter()
        .map(|p| p.map(|c| (c * 1e5).round() / 1e5))
        .collect();
    let options = Options::with_spacing(0.08).scale(1e-5);
    let even = resample(&stored, &options).unwrap();
    // By the places of the corners, beginning with the smallest: the orders of the points differ.
    let places = |triangle: [[f64; 3]; 3]| {
        let mut places = triangle.map(|place| place.map(|c| (c * 1e5).round() as i64));
        let first = (0..3).min_by_key(|&k| places[k]).unwrap();
        places.rotate_left(first);
        places
    };
    let of_job = mesh
        .triangles
        .iter()
        .map(|t| places(t.map(|k| mesh.vertices[k])));
    let triangles = even.triangles();
    let of_library = triangles
        .iter()
        .map(|t| places(t.map(|k| even.points[k as usize])));
    assert_eq!(
        of_job.collect::<BTreeSet<_>>(),
        of_library.collect::<BTreeSet<_>>()
    );
}

#[test]
fn a_mesh_looks_towards_its_scanner_and_normals_follow() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    // From below, the ground looks downwards.
    let place = |name: &str, more: &[&str]| {
        let [cloud, path] = files_of(dir.path(), name, ["las", "obj"]);
        let mut arguments = vec!["--spacing", "0.5", "--mesh", text(&path)];
        arguments.extend(more);
        succeed(&scans, &cloud, &arguments);
        let text = fs::read_to_string(&path).unwrap();
        let up = |line: &&str| {
            line.starts_with("vn ") && !line.contains(" -0.0 ") && {
                let z: f64 = line.rsplit(' ').next().unwrap().parse().unwrap();
                z > 0.9
            }
        };
        (text.lines().filter(up).count(), Mesh::read(&path).vertices)
    };
    let (above, vertices) = place("above", &[]);
    let middle = vertices[vertices.len() / 2];
    let below = format!("{},{},{}", middle[0], middle[1], middle[2] - 1000.0);
    let (turned, _) = place("below", &["--scanner", &below]);
    assert!(above > 1000 && turned < above / 10, "{above} {turned}");

    let trajectory = dir.path().join("way.csv");
    fs::write(
        &trajectory,
        format!("time,x,y,z\n0,{below}\n1e10,{below}\n"),
    )
    .unwrap();
    let (by_way, _) = place("way", &["--trajectory", text(&trajectory)]);
    assert_eq!(by_way, turned);
}

#[test]
fn wires_and_leaves_have_triangles_if_they_are_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let figures = |name: &str, more: &[&str]| {
        let [cloud, mesh] = files_of(dir.path(), name, ["laz", "ply"]);
        let words = ["--spacing", SPACING, "--mesh", text(&mesh)];
        succeed(&scans, &cloud, &[&words[..], more].concat());
        let report = report(&cloud);
        ["points_without_surface", "triangles", "clutter"]
            .map(|name| report["mesh"][name].as_u64().unwrap())
    };
    let surfaces = figures("surfaces", &[]);
    let all = figures("all", &["--mesh-of", "all"]);
    // Wires, and points with too few around them, are left.
    assert!(
        4 * all[0] < 3 * surfaces[0] && all[1] > surfaces[1],
        "{surfaces:?} {all:?}"
    );
    // Points in leaves can have a normal each; the triangles between them are clutter.
    assert!(surfaces[2] > 20 && all[2] == 0, "{surfaces:?} {all:?}");
}

#[test]
fn what_cannot_be_a_mesh_is_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("even.las");
    let refused = |more: &[&str], because: &str| {
        let mut arguments = vec!["--spacing", SPACING];
        arguments.extend(more);
        let done = run(&scans, &output, &arguments);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(
            !done.status.success() && said.contains(because),
            "{more:?}: {said}"
        );
        assert!(!output.exists());
    };
    refused(&["--mesh", "even.stl"], ".ply, .obj or .glb");
    refused(&["--scanner", "0,0,2"], "--mesh");
    refused(&["--mesh-of", "all"], "--mesh");
    refused(&["--mesh", "m.ply", "--mesh-of", "leaves"], "surfaces");
    refused(&["--mesh", "m.ply", "--scanner", "0,0"], "x,y,z");
    let mesh = dir.path().join("m.ply");
    refused(
        &["--mesh", text(&mesh), "--trajectory", "no/such.csv"],
        "trajectory",
    );
    fs::write(&mesh, "mine").unwrap();
    refused(&["--mesh", text(&mesh)], "exists already");
    assert_eq!(fs::read_to_string(&mesh).unwrap(), "mine");
}

#[test]
fn on_a_street_surfaces_have_no_holes_and_triangles_lie_on_them() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let options = fs::read_to_string(scans.join("street.json")).unwrap();
    let truth = Street::new(serde_json::from_str::<StreetOptions>(&options).unwrap());
    let (cloud, path) = (dir.path().join("even.las"), dir.path().join("even.obj"));
    let spacing = 0.25;
    succeed(
        &scans,
        &cloud,
        &["--spacing", "0.25", "--mesh", text(&path)],
    );
    let mesh = Mesh::read(&path);

    // Where the surfaces of the street were scanned, and what has none, by cells of half a spacing.
    let cell = |[x, y, z]: [f64; 3]| [x, y, z].map(|c| (c / (0.5 * spacing)).floor() as i64);
    let mut scanned: HashMap<[i64; 3], Vec<[f64; 3]>> = HashMap::new();
    let mut without_surface = scanned.clone();
    for file in ["pass-1.laz", "pass-2.laz"] {
        let all = las::Reader::from_path(scans.join(file))
            .unwrap()
            .read_all()
            .unwrap();
        for (((x, y), z), class) in all.x().zip(all.y()).zip(all.z()).zip(all.classification()) {
            let places = match WITHOUT_SURFACE.contains(&class) {
                true => &mut without_surface,
                false => &mut scanned,
            };
            places.entry(cell([x, y, z])).or_default().push([x, y, z]);
        }
    }
    let distance =
        |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    let is_among = |points: &HashMap<[i64; 3], Vec<[f64; 3]>>, place: [f64; 3]| {
        let [i, j, k] = cell(place);
        let cells = (0..27).map(|n| [i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1]);
        cells
            .filter_map(|cell| points.get(&cell))
            .flatten()
            .any(|&p| distance(p, place) < 0.5 * spacing)
    };
    let mut opposite: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for ([from, to], tip) in [([a, b], c), ([b, c], a), ([c, a], b)] {
            opposite
                .entry([from.min(to), from.max(to)])
                .or_default()
                .push(tip);
        }
    }
    let (mut far, mut open) = (0, 0);
    for (&[from, to], tips) in &opposite {
        let [a, b, c] = [from, to, tips[0]].map(|k| mesh.vertices[k]);
        let middle = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
        if truth.distance_to_edge(middle) <= 2.0 * spacing || is_among(&without_surface, middle) {
            continue;
        }
        far += 1;
        // What lies beyond an open edge is a border if the scan has nothing there.
        let beyond =
            [0.4, 0.8, 1.2].map(|far| [0, 1, 2].map(|k| middle[k] + far * (middle[k] - c[k])));
        let goes_on = beyond.into_iter().all(|place| is_among(&scanned, place));
        open += usize::from(tips.len() == 1 && goes_on);
    }
    assert!(far > 50_000, "{far}");
    assert!(1000 * open <= far, "{open} of {far}");

    // Across a sharp edge a triangle cuts the corner.
    let mean = |places: &mut dyn Iterator<Item = [f64; 3]>| {
        let (mut sum, mut count) = (0.0, 0.0);
        let inner = |place: &[f64; 3]| truth.distance_to_edge(*place) > 2.0 * spacing;
        places.filter(inner).for_each(|place| {
            sum += truth.distance_to_surface(place);
            count += 1.0;
        });
        sum / count
    };
    let used: BTreeSet<usize> = mesh.triangles.iter().flatten().copied().collect();
    let of_points = mean(&mut used.iter().map(|&k| mesh.vertices[k]));
    let centre = |&corners: &[usize; 3]| {
        let [a, b, c] = corners.map(|k| mesh.vertices[k]);
        [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
    };
    let of_centres = mean(&mut mesh.triangles.iter().map(centre));
    assert!(of_centres <= 1.1 * of_points, "{of_centres} {of_points}");

    // Slivers at borders would make it 35.8°.
    let least_percent = report(&cloud)["mesh"]["smallest_angle_p1"].as_f64();
    assert!(least_percent > Some(37.0), "{least_percent:?}");
}
