//! PCD files, read by what their headers say.

use std::{collections::HashMap, fs, path::Path};

use crate::running::{points, report, run, street, succeed};

/// A PCD file of 32-bit values: its header, and the values of each field, in their bits.
struct Pcd {
    origin: [f64; 3],
    columns: HashMap<String, Vec<u32>>,
    points: usize,
}

impl Pcd {
    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let mut at = 0;
        let mut statements = HashMap::new();
        let mut origin = [0.0; 3];
        loop {
            let end = at + bytes[at..].iter().position(|&b| b == b'\n').unwrap();
            let line = std::str::from_utf8(&bytes[at..end]).unwrap();
            at = end + 1;
            assert!(line.len() < 1000);
            if let Some(place) = line.strip_prefix("# origin ") {
                let place: Vec<f64> = place.split(' ').map(|c| c.parse().unwrap()).collect();
                origin = place.try_into().unwrap();
            }
            let Some((word, rest)) = line.split_once(' ').filter(|(word, _)| *word != "#") else {
                continue;
            };
            let words: Vec<String> = rest.split_whitespace().map(str::to_owned).collect();
            statements.insert(word.to_owned(), words);
            if word == "DATA" {
                break;
            }
        }
        let fields = statements["FIELDS"].clone();
        assert!(
            statements["SIZE"]
                .iter()
                .chain(&statements["COUNT"])
                .all(|n| n == "4" || n == "1")
        );
        assert_eq!(statements["TYPE"].len(), fields.len());
        assert_eq!(statements["HEIGHT"], ["1"]);
        assert_eq!(statements["WIDTH"], statements["POINTS"]);
        let count: usize = statements["POINTS"][0].parse().unwrap();
        let body = &bytes[at..];
        let word = |raw: &[u8]| u32::from_le_bytes(raw.try_into().unwrap());
        let values: Vec<u32> = match statements["DATA"][0].as_str() {
            "binary" => {
                let rows: Vec<u32> = body.chunks(4).map(word).collect();
                let column = |field| rows.iter().skip(field).step_by(fields.len()).copied();
                (0..fields.len()).flat_map(column).collect()
            }
            _ => {
                assert_eq!(word(&body[..4]) as usize, body.len() - 8);
                let plain = decompressed(&body[8..]);
                assert_eq!(word(&body[4..8]) as usize, plain.len());
                plain.chunks(4).map(word).collect()
            }
        };
        assert_eq!(values.len(), count * fields.len());
        let columns = values.chunks(count).map(<[u32]>::to_vec);
        Self {
            origin,
            columns: fields.into_iter().zip(columns).collect(),
            points: count,
        }
    }

    fn positions(&self) -> Vec<[f64; 3]> {
        let axes = ["x", "y", "z"].map(|axis| &self.columns[axis]);
        (0..self.points)
            .map(|n| {
                [0, 1, 2].map(|axis| f64::from(f32::from_bits(axes[axis][n])) + self.origin[axis])
            })
            .collect()
    }
}

/// What the definition of LZF makes of a stream.
fn decompressed(stream: &[u8]) -> Vec<u8> {
    let (mut out, mut at) = (Vec::new(), 0);
    while at < stream.len() {
        let control = usize::from(stream[at]);
        at += 1;
        if control < 32 {
            out.extend(&stream[at..=at + control]);
            at += control + 1;
            continue;
        }
        let mut length = (control >> 5) + 2;
        if length == 9 {
            length += usize::from(stream[at]);
            at += 1;
        }
        let back = ((control & 31) << 8 | usize::from(stream[at])) + 1;
        at += 1;
        for _ in 0..length {
            out.push(out[out.len() - back]);
        }
    }
    out
}

#[test]
fn pcd_has_the_points_of_laz_near_an_origin_that_it_states() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let path = |name: &str| dir.path().join(name);
    let options = ["--spacing", "0.3", "--with", "normals"];
    succeed(&scans, &path("all.laz"), &options);
    succeed(&scans, &path("all.pcd"), &options);
    succeed(
        &scans,
        &path("small.pcd"),
        &[&options[..], &["--pcd", "compressed"]].concat(),
    );

    // The same coordinates, to what single precision can tell apart.
    let mut reader = las::Reader::from_path(path("all.laz")).unwrap();
    let transforms = *reader.header().transforms();
    let stored = points(&path("all.laz"));
    let binary = Pcd::read(&path("all.pcd"));
    assert!(
        binary.origin.iter().any(|c| *c != 0.0) && binary.origin.iter().all(|c| c % 1000.0 == 0.0)
    );
    let mut found: Vec<[i32; 3]> = binary
        .positions()
        .iter()
        .map(|[x, y, z]| {
            [
                transforms.x.inverse(*x).unwrap(),
                transforms.y.inverse(*y).unwrap(),
                transforms.z.inverse(*z).unwrap(),
            ]
        })
        .collect();
    found.sort_unstable();
    assert_eq!(found.len(), stored.len());
    let far = |(a, b): &(&[i32; 3], &[i32; 3])| (0..3).any(|axis| (a[axis] - b[axis]).abs() > 1);
    assert!(stored.iter().zip(&found).filter(far).count() < stored.len() / 100);

    // Attributes under the names of the library, and in both encodings the same.
    for name in ["intensity", "label", "normal_x", "normal_y", "normal_z"] {
        assert!(binary.columns.contains_key(name), "{name}");
    }
    let colored = reader.read_all().unwrap().format().has_color;
    assert_eq!(binary.columns.contains_key("rgb"), colored);
    let compressed = Pcd::read(&path("small.pcd"));
    assert!(compressed.columns == binary.columns);
    assert!(
        fs::metadata(path("small.pcd")).unwrap().len()
            < fs::metadata(path("all.pcd")).unwrap().len()
    );
}

#[test]
fn pcd_has_the_same_bytes_for_any_tiles_threads_and_memory() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    for encoding in ["binary", "compressed"] {
        let (one, other) = (dir.path().join("one.pcd"), dir.path().join("other.pcd"));
        let options = [
            "--spacing",
            "0.25",
            "--iterations",
            "2",
            "--overwrite",
            "--pcd",
            encoding,
        ];
        succeed(&scans, &one, &options);
        let small = ["--tile-size", "15", "--threads", "1", "--memory", "160MiB"];
        succeed(&scans, &other, &[&options[..], &small].concat());
        assert!(
            fs::read(&one).unwrap() == fs::read(&other).unwrap(),
            "{encoding}"
        );
    }
}

#[test]
fn pcd_tiles_have_the_index_that_autoware_reads() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (flat, map) = (dir.path().join("flat.pcd"), dir.path().join("map"));
    let options = ["--spacing", "0.4", "--pcd-origin", "mgrs"];
    succeed(&scans, &flat, &options);
    succeed(
        &scans,
        &map,
        &[&options[..], &["--output-tiles", "20", "--format", "pcd"]].concat(),
    );

    let index = fs::read_to_string(map.join("pointcloud_map_metadata.yaml")).unwrap();
    let mut lines = index.lines();
    assert_eq!(lines.next(), Some("x_resolution: 20.0"));
    assert_eq!(lines.next(), Some("y_resolution: 20.0"));
    let whole = Pcd::read(&flat);
    assert!(whole.origin[..2].iter().all(|c| c % 100_000.0 == 0.0));
    let mut total = 0;
    for line in lines {
        let (file, corner) = line.split_once(": ").unwrap();
        let corner = corner.strip_prefix('[').unwrap().strip_suffix(']').unwrap();
        let corner: Vec<i32> = corner.split(", ").map(|c| c.parse().unwrap()).collect();
        let tile = Pcd::read(&map.join(file));
        assert_eq!(tile.origin, whole.origin);
        total += tile.points;
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let side = f64::from(corner[axis]);
            // Single precision may round a point onto the side.
            let within = |bits: &u32| {
                (side - 0.01..=side + 20.01).contains(&f64::from(f32::from_bits(*bits)))
            };
            assert!(tile.columns[name].iter().all(within), "{line}");
        }
    }
    assert_eq!(total, whole.points);

    // A directory of tiles may be replaced; edges that the index cannot have are refused before any work.
    let again = [
        &options[..],
        &["--output-tiles", "20", "--format", "pcd", "--overwrite"],
    ]
    .concat();
    succeed(&scans, &map, &again);
    let odd = run(
        &scans,
        &dir.path().join("odd"),
        &[
            "--spacing",
            "0.4",
            "--output-tiles",
            "12.5",
            "--format",
            "pcd",
        ],
    );
    let problem = String::from_utf8_lossy(&odd.stderr).into_owned();
    assert!(
        !odd.status.success() && problem.contains("whole"),
        "{problem}"
    );
}

#[test]
fn an_origin_that_is_too_far_is_noted_with_what_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.pcd");
    for (origin, loss) in [
        ("431000,5400000,0", None),
        ("0,0,0", Some("rounded by up to 0.2500 m")),
    ] {
        succeed(
            &scans,
            &output,
            &["--spacing", "1", "--overwrite", "--pcd-origin", origin],
        );
        let notes = report(&output)["notes"].to_string();
        assert_eq!(notes.contains("--pcd-origin"), loss.is_some(), "{notes}");
        assert!(loss.is_none_or(|loss| notes.contains(loss)), "{notes}");
    }
}

#[test]
fn options_of_pcd_are_refused_where_none_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    for (output, options, remedy) in [
        ("out.pcd", ["--format", "pcd"].as_slice(), "--output-tiles"),
        ("out.laz", &["--pcd", "binary"], "name the output .pcd"),
        (
            "tiles",
            &["--pcd-origin", "mgrs", "--output-tiles", "20"],
            "--format pcd",
        ),
    ] {
        let output = dir.path().join(output);
        let unused = run(&scans, &output, &[&["--spacing", "1"], options].concat());
        let said = String::from_utf8_lossy(&unused.stderr).into_owned();
        assert_eq!(unused.status.code(), Some(2), "{said}");
        assert!(said.contains(remedy), "{said}");
        assert!(!output.exists());
    }
}
