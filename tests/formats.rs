//! What goes in and comes out: octrees, tiles, polygon files, filters, units, configurations.

use std::{collections::HashMap, fs, path::Path, process::Command};

use crate::running::{
    PROGRAM, lloydar, points, points_in_order, report, run, street, succeed, text,
};
use las::{CopcReader, Reader, copc::VoxelKey};

/// Whole records of a cloud, sorted.
fn records(path: &Path) -> Vec<Vec<u8>> {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    let length = all.record_len();
    let mut records: Vec<Vec<u8>> = all
        .raw_bytes()
        .chunks_exact(length)
        .map(<[u8]>::to_vec)
        .collect();
    records.sort_unstable();
    records
}

#[test]
fn an_octree_holds_every_point_where_it_belongs() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (flat, octree) = (dir.path().join("out.laz"), dir.path().join("out.copc.laz"));
    let options = ["--spacing", "0.15", "--iterations", "2"];
    succeed(&scans, &flat, &options);
    succeed(&scans, &octree, &options);
    let all = records(&flat);
    assert!(all.len() > 60_000, "{}", all.len());
    assert!(records(&octree) == all);
    assert!(!octree.with_extension("laz.job").exists());

    let mut reader = CopcReader::from_path(&octree).unwrap();
    let header = reader.header().clone();
    assert_eq!(header.number_of_points(), all.len() as u64);
    assert_eq!(header.number_of_points_by_return(1), Some(all.len() as u64));
    let info = header.copc_info_vlr().unwrap();
    let entries: HashMap<VoxelKey, _> = reader.hierarchy_entries().map(|e| (e.key, e)).collect();
    let mut seen = 0;
    let mut of_level = HashMap::<i32, u64>::new();
    for (key, entry) in &entries {
        assert!(key.l == 0 || entries.contains_key(&key.parent()), "{key:?}");
        if entry.point_count == 0 {
            continue;
        }
        let bounds = key.bounds(&info);
        let node = reader.read_entry(entry).unwrap();
        let inside = |c: f64, min: f64, max: f64| c >= min - 1e-6 && c <= max + 1e-6;
        assert!(node.x().all(|x| inside(x, bounds.min.x, bounds.max.x)));
        assert!(node.y().all(|y| inside(y, bounds.min.y, bounds.max.y)));
        assert!(node.z().all(|z| inside(z, bounds.min.z, bounds.max.z)));
        assert_eq!(node.len(), entry.point_count as usize);
        seen += node.len();
        *of_level.entry(key.l).or_default() += node.len() as u64;
    }
    assert_eq!(seen, all.len());
    assert!(entries.len() > 8 && of_level.len() > 2, "{of_level:?}");
    // Twice as dense along an edge: four times as many on a surface, up to the last level.
    let up_to = |level: i32| (0..=level).map(|l| of_level[&l]).sum::<u64>() as f64;
    let growth = up_to(1) / up_to(0);
    assert!((2.5..6.0).contains(&growth), "{of_level:?}");

    // Less memory, another cut into columns and tiles, one thread: the same octree.
    let again = dir.path().join("again.copc.laz");
    let mut small = options.to_vec();
    small.extend(["--memory", "160MiB", "--threads", "1", "--tile-size", "15"]);
    succeed(&scans, &again, &small);
    assert!(records(&again) == all);
    assert!(points_in_order(&again) == points_in_order(&octree));
}

#[test]
fn of_an_octree_only_what_is_wanted_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let octree = dir.path().join("all.copc.laz");
    let flat = dir.path().join("all.laz");
    let options = ["--spacing", "0.15", "--iterations", "0"];
    succeed(&scans, &octree, &options);
    succeed(&scans, &flat, &options);
    let header = Reader::from_path(&flat).unwrap().header().clone();
    let (min, max) = (header.bounds().min, header.bounds().max);
    let east = min.x + 0.1 * (max.x - min.x);
    let sides = format!("{},{},{east},{}", min.x, min.y, max.y);
    let wanted = ["--spacing", "0.5", "--bounds", &sides];
    let (of_octree, of_flat) = (dir.path().join("a.laz"), dir.path().join("b.laz"));
    succeed(&octree, &of_octree, &wanted);
    succeed(&flat, &of_flat, &wanted);
    assert!(records(&of_octree) == records(&of_flat));
    let read = |output: &Path| {
        let input = report(output)["inputs"][0].clone();
        [&input["read"], &input["filtered"]].map(|n| n.as_u64().unwrap())
    };
    let ([some, without], [all, dropped]) = (read(&of_octree), read(&of_flat));
    assert_eq!(some - without, all - dropped);
    assert!(2 * some < all, "{some} of {all}");
}

#[test]
fn tiles_are_the_cloud_cut_apart() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (flat, tiles) = (dir.path().join("out.laz"), dir.path().join("tiles"));
    succeed(&scans, &flat, &["--spacing", "0.4"]);
    let options = ["--spacing", "0.4", "--output-tiles", "12.5"];
    succeed(&scans, &tiles, &options);
    let index = fs::read_to_string(tiles.join("tiles.geojson")).unwrap();
    let index: serde_json::Value = serde_json::from_str(&index).unwrap();
    let mut all = Vec::new();
    for feature in index["features"].as_array().unwrap() {
        let path = tiles.join(feature["properties"]["file"].as_str().unwrap());
        let own = records(&path);
        assert_eq!(feature["properties"]["points"], own.len());
        let ring = &feature["geometry"]["coordinates"][0];
        let corner = |c: usize, axis: usize| ring[c][axis].as_f64().unwrap();
        let cloud = Reader::from_path(&path).unwrap().read_all().unwrap();
        // The far sides belong to the neighbours.
        assert!(
            cloud
                .x()
                .all(|x| x > corner(0, 0) - 1e-6 && x < corner(2, 0) - 1e-6)
        );
        assert!(
            cloud
                .y()
                .all(|y| y > corner(0, 1) - 1e-6 && y < corner(2, 1) - 1e-6)
        );
        all.extend(own);
    }
    all.sort_unstable();
    assert!(all == records(&flat));
    assert!(index["features"].as_array().unwrap().len() > 4);

    // Tiles are replaced if that is asked for, and nothing else ever is.
    let refused = run(&scans, &tiles, &options);
    assert_eq!(refused.status.code(), Some(1), "{refused:?}");
    let wider = ["--spacing", "0.4", "--output-tiles", "50", "--overwrite"];
    succeed(&scans, &tiles, &wider);
    fs::write(tiles.join("thesis.txt"), "the only copy").unwrap();
    let refused = run(&scans, &tiles, &wider);
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("other things"),
        "{refused:?}"
    );
    assert!(tiles.join("thesis.txt").exists());
}

#[test]
fn colours_of_a_polygon_file_are_bytes_and_keep_all_their_bits() {
    let dir = tempfile::tempdir().unwrap();
    for (name, red, named) in [
        ("eight", 200_u16, "uchar red_high"),
        ("sixteen", 51_283, "uchar red_low"),
    ] {
        let scan = dir.path().join(format!("{name}-scan.ply"));
        let mut content = "ply\nformat ascii 1.0\nelement vertex 1600\n".to_owned();
        for property in ["double x", "double y", "double z"] {
            content += &format!("property {property}\n");
        }
        for property in ["ushort red", "ushort green", "ushort blue"] {
            content += &format!("property {property}\n");
        }
        for property in ["float nx", "float ny", "float nz"] {
            content += &format!("property {property}\n");
        }
        content += "end_header\n";
        for i in 0..1600 {
            let (x, y) = (f64::from(i % 40) * 0.1, f64::from(i / 40) * 0.1);
            content += &format!("{x} {y} 0 {red} 7 {} 0 0 1\n", red / 2);
        }
        fs::write(&scan, content).unwrap();
        let [even, back] = ["ply", "laz"].map(|ending| dir.path().join(format!("{name}.{ending}")));
        succeed(&scan, &even, &["--spacing", "0.4"]);
        let bytes = fs::read(&even).unwrap();
        let header = String::from_utf8_lossy(&bytes[..bytes.len().min(2000)]);
        for property in ["uchar red ", "float nx", named] {
            assert!(header.contains(&format!("property {property}")), "{header}");
        }
        succeed(
            &even,
            &back,
            &["--spacing", "0.01", "--iterations", "0", "--fill", "0"],
        );
        let all = records(&back);
        let color: Vec<u8> = [red, 7, red / 2]
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .collect();
        assert!(all.len() > 50 && all.iter().all(|record| record[30..36] == color));
    }
}

#[test]
fn a_polygon_file_is_an_input_like_others() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (ply, flat) = (dir.path().join("a.ply"), dir.path().join("a.laz"));
    for output in [&ply, &flat] {
        succeed(&scans, output, &["--spacing", "0.3", "--with", "normals"]);
    }
    // Seeds stand on points, and all points are farther apart than that.
    let as_it_is = ["--spacing", "0.01", "--iterations", "0", "--fill", "0"];
    let back = dir.path().join("back.laz");
    succeed(&ply, &back, &as_it_is);
    let of = |path: &Path| {
        let reader = Reader::from_path(path).unwrap();
        let header = reader.header().clone();
        (header.point_format().extra_bytes, header.number_of_points())
    };
    assert_eq!(of(&back), of(&flat));
    let both = dir.path().join("both.laz");
    let (one, other) = (text(&ply), text(&flat));
    let done = lloydar(&[
        "run",
        one,
        other,
        "-o",
        text(&both),
        "--spacing",
        "1",
        "--quiet",
    ]);
    assert!(done.status.success(), "{done:?}");
}

#[test]
fn lengths_with_a_unit_mean_it_in_any_crs() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let cloud = |name: &str, options: &[&str]| {
        let output = dir.path().join(name);
        succeed(&scans, &output, options);
        points(&output)
    };
    let metres = cloud("a.laz", &["--spacing", "0.4"]);
    assert!(cloud("b.laz", &["--spacing", "40cm"]) == metres);
    // The same numbers, said to be feet.
    cloud("c.laz", &["--spacing", "121.92mm", "--crs", "EPSG:2994"]);
    let spacing = report(&dir.path().join("c.laz"))["spacing"]
        .as_f64()
        .unwrap();
    assert!((spacing - 0.4).abs() < 1e-12, "{spacing}");
    let header = Reader::from_path(dir.path().join("c.laz"))
        .unwrap()
        .header()
        .clone();
    let wkt = header.vlrs().iter().find(|vlr| vlr.is_wkt_crs()).unwrap();
    assert!(
        String::from_utf8_lossy(&wkt.data).contains("Oregon"),
        "{wkt:?}"
    );
    let refused = run(
        &scans,
        &dir.path().join("d.laz"),
        &["--spacing", "1", "--crs", "EPSG:4326"],
    );
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("degrees"),
        "{refused:?}"
    );
}

#[test]
fn every_configuration_runs() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let mut found = 0;
    for entry in fs::read_dir("configs").unwrap() {
        let config = entry.unwrap().path();
        let output = dir
            .path()
            .join(config.file_stem().unwrap())
            .with_extension("laz");
        // One of the examples has rules for the spacing.
        let option = match config.ends_with("density.toml") {
            true => "--density",
            false => "--config",
        };
        let options = [
            option,
            text(&config),
            "--spacing",
            "0.4",
            "--iterations",
            "3",
        ];
        succeed(&scans, &output, &options);
        assert!(!points(&output).is_empty());
        // What is printed is a file of the same options.
        let printed = lloydar(&["config", option, text(&config), "--seed", "5"]);
        assert!(printed.status.success(), "{printed:?}");
        let again = dir.path().join("printed.toml");
        fs::write(&again, &printed.stdout).unwrap();
        let same = lloydar(&["config", "--config", text(&again)]);
        let values = |printed: &[u8]| -> toml::Table {
            toml::from_str(&String::from_utf8_lossy(printed)).unwrap()
        };
        assert_eq!(values(&same.stdout), values(&printed.stdout));
        assert_eq!(values(&same.stdout)["seed"].as_integer(), Some(5));
        found += 1;
    }
    assert_eq!(found, 6);
}

#[test]
fn the_program_describes_itself() {
    let dir = tempfile::tempdir().unwrap();
    let man = dir.path().join("man");
    assert!(lloydar(&["man", "-o", text(&man)]).status.success());
    let page = fs::read_to_string(man.join("lloydar-run.1")).unwrap();
    assert!(page.contains("output\\-tiles"), "{page}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let printed = lloydar(&["completions", shell]);
        assert!(
            String::from_utf8_lossy(&printed.stdout).contains("output-tiles"),
            "{shell}"
        );
    }
}

/// The same bytes whenever they are written, and who wrote them from what.
#[test]
fn provenance_is_kept_and_reproducible() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let written = |name: &str| {
        let output = dir.path().join(name);
        let mut command = Command::new(PROGRAM);
        command.env("SOURCE_DATE_EPOCH", "86400");
        command.args([
            "run",
            text(&scans),
            "-o",
            text(&output),
            "--spacing",
            "1",
            "--quiet",
        ]);
        let done = command.output().unwrap();
        assert!(done.status.success(), "{done:?}");
        fs::read(&output).unwrap()
    };
    let bytes = written("a.copc.laz");
    assert!(bytes == written("b.copc.laz"));
    let header = Reader::from_path(dir.path().join("a.copc.laz"))
        .unwrap()
        .header()
        .clone();
    assert_eq!(header.date().unwrap().to_string(), "1970-01-02");
    let own = header
        .vlrs()
        .iter()
        .find(|vlr| vlr.user_id == "lloydar")
        .unwrap();
    let provenance: serde_json::Value = serde_json::from_slice(&own.data).unwrap();
    let checksum = provenance["inputs"][0]["sha256"].as_str().unwrap();
    assert_eq!(checksum.len(), 64);
    assert_eq!(provenance["settings"]["iterations"], 20);
}
