//! What the report and the viewer show of a mesh.

use std::{fs, io::Read, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;

use crate::running::{lloydar, report, street, text};

/// Runs a job that prints its summary, and returns the summary.
fn summary(scans: &Path, output: &Path, more: &[&str]) -> String {
    let mut arguments = vec!["run", text(scans), "-o", text(output), "--spacing", "0.3"];
    arguments.extend(more);
    let done = lloydar(&arguments);
    assert!(done.status.success(), "{done:?}");
    String::from_utf8(done.stdout).unwrap()
}

/// The number that follows `name` in a page or a header.
fn number_after(text: &str, name: &str) -> u64 {
    let after = text.split_once(name).unwrap().1;
    let digits: String = after.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap()
}

/// The corners of the triangles of a viewer, unpacked as its script does.
fn triangles(viewer: &str) -> Vec<[u32; 3]> {
    let start = viewer.split_once("id=\"triangles\">").unwrap().1;
    let packed = STANDARD.decode(start.split_once('<').unwrap().0).unwrap();
    let mut planes = Vec::new();
    ZlibDecoder::new(&packed[..])
        .read_to_end(&mut planes)
        .unwrap();
    let count = planes.len() / 12;
    let number = |corner: usize, triangle: usize| {
        let byte = |k: usize| planes[(4 * corner + k) * count + triangle];
        u32::from_le_bytes([0, 1, 2, 3].map(byte))
    };
    let mut first = 0;
    let corners = (0..count).map(|triangle| {
        first += number(0, triangle);
        [
            first,
            first + number(1, triangle),
            first + number(2, triangle),
        ]
    });
    corners.collect()
}

#[test]
fn a_mesh_is_counted_in_the_report_and_drawn_in_the_viewer() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let [with, mesh] = ["with.laz", "even.ply"].map(|name| dir.path().join(name));
    let said = summary(&scans, &with, &["--mesh", text(&mesh)]);
    assert!(said.contains("\nmesh      ") && said.contains("even.ply"));

    // The figures are those of the file, and agree with each other.
    let report = report(&with);
    let of = |figure: &str| report["mesh"][figure].as_u64().unwrap();
    let ply = fs::read(&mesh).unwrap();
    let header = String::from_utf8_lossy(&ply[..2000.min(ply.len())]).into_owned();
    assert_eq!(number_after(&header, "element face "), of("triangles"));
    assert_eq!(
        of("points_used") + of("points_unused") + of("points_without_surface"),
        report["points"].as_u64().unwrap()
    );
    assert_eq!(
        3 * of("triangles"),
        2 * of("inner_edges") + of("border_edges")
    );
    let bins = report["mesh"]["histogram_smallest_angles"].as_array();
    let counted: u64 = bins.unwrap().iter().map(|bin| bin.as_u64().unwrap()).sum();
    assert_eq!(counted, of("triangles"));
    assert!(report["mesh"]["smallest_angle_median"].as_f64().unwrap() > 50.0);
    let page = fs::read_to_string(format!("{}.report.html", with.display())).unwrap();
    assert!(page.contains("<h2>Mesh</h2>"));
    // Pictures are letters of all kinds.
    let mut outside_pictures = page.split('"').filter(|part| !part.starts_with("data:"));
    assert!(outside_pictures.all(|part| !part.contains("NaN")));

    // The street fits into the square: nearly all triangles are shown, between the points of the sample.
    let viewer = fs::read_to_string(format!("{}.viewer.html", with.display())).unwrap();
    let shown = triangles(&viewer);
    assert_eq!(number_after(&viewer, "\"triangles\":"), shown.len() as u64);
    assert!(shown.len() as f64 > 0.9 * of("triangles") as f64);
    let points = number_after(&viewer, "\"after\":");
    assert!(
        shown
            .iter()
            .flatten()
            .all(|&corner| u64::from(corner) < points)
    );
    assert!(shown.is_sorted() && shown.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn pages_without_a_mesh_say_nothing_of_one() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let without = dir.path().join("without.laz");
    let said = summary(&scans, &without, &[]);
    assert!(!said.contains("\nmesh "));
    assert!(report(&without).get("mesh").is_none());
    let page = fs::read_to_string(format!("{}.report.html", without.display())).unwrap();
    assert!(!page.contains("<h2>Mesh</h2>"));
    let viewer = fs::read_to_string(format!("{}.viewer.html", without.display())).unwrap();
    for name in [
        "id=\"triangles\"",
        "\"triangles\":",
        "id=\"as\"",
        "{MESH",
        "{TRIANGLES}",
    ] {
        assert!(!viewer.contains(name), "{name}");
    }
}
