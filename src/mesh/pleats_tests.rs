//! Meshes of a surface with sharp edges, on which points stand.

use std::collections::HashMap;

use super::{
    tests::{QUANTIZATION, cloud, edges_of, in_parts, in_parts_by, sheet},
    *,
};

/// The width of a pleat.
const PLEAT: f64 = 5.3;

/// The distance from the surface of [`pleats`].
fn off_pleats(place: Local) -> f64 {
    let across = place.x * 2.0_f64.sqrt();
    let (number, rest) = ((across / PLEAT).floor(), across.rem_euclid(PLEAT));
    let height = if number % 2.0 == 0.0 {
        rest
    } else {
        PLEAT - rest
    };
    (place.z * 2.0_f64.sqrt() - height).abs() / 2.0_f64.sqrt()
}

/// A sheet in pleats with right angles, each point near an edge on the edge itself. Along the edges points are denser than a lattice is,
/// so that triangles along an edge have no small angles.
fn pleats() -> impl Iterator<Item = (Local, Local)> {
    sheet(6.0).map(|(place, _)| {
        let (number, rest) = ((place.x / PLEAT).floor(), place.x.rem_euclid(PLEAT));
        let (rest, is_on_edge) = match rest {
            rest if rest < 0.42 => (0.0, true),
            rest if rest > PLEAT - 0.42 => (PLEAT, true),
            rest => (rest, false),
        };
        let is_even = number % 2.0 == 0.0;
        let (height, slope) = if is_even {
            (rest, -1.0)
        } else {
            (PLEAT - rest, 1.0)
        };
        let [x, z] = [number * PLEAT + rest, height].map(|c| c / 2.0_f64.sqrt());
        let normal = if is_on_edge {
            Local::z()
        } else {
            Local::new(slope, 0.0, 1.0).normalize()
        };
        (Local::new(x, 0.7 * place.y, z), normal)
    })
}

#[test]
fn turned_diagonals_keep_edges_and_borders_in_all_parts() {
    let rules = MeshRules {
        keeps_edges: true,
        ..MeshRules::default()
    };
    for noise in [0.02, 0.2] {
        let points = cloud(pleats(), noise);
        let (before, cut) = in_parts(&points, 1.0, 1e6);
        let (after, kept) = in_parts_by(rules, &points, 1.0, 1e6);
        let off = |triangles: &[Corners]| {
            let centre = |corners: &Corners| {
                let places = corners.map(|k| QUANTIZATION.local(points[k as usize].point));
                places.iter().sum::<Local>() / 3.0
            };
            triangles
                .iter()
                .map(|corners| off_pleats(centre(corners)))
                .sum::<f64>()
        };
        assert!(before != after, "noise of {noise}");
        if noise < 0.1 {
            assert_eq!(cut.cut + kept.cut, 0);
            let (off, off_before) = (off(&after), off(&before));
            assert!(off < 0.8 * off_before, "{off} {off_before}");
        }
        let runs = edges_of(&after);
        assert!(
            runs.values()
                .all(|runs| runs.len() == 1 || runs[0] != runs[1] && runs.len() == 2)
        );
        let borders = |runs: &HashMap<[u32; 2], Vec<bool>>| {
            let mut open: Vec<[u32; 2]> = runs
                .iter()
                .filter(|(_, runs)| runs.len() == 1)
                .map(|(&edge, _)| edge)
                .collect();
            open.sort_unstable();
            open
        };
        // Which triangles are cut out can be another matter.
        if cut.cut + kept.cut == 0 {
            assert_eq!(borders(&runs), borders(&edges_of(&before)));
        }
        assert_eq!(kept.corners, cut.corners);
        for edge in [30.0, 10.0, 5.0] {
            let parts = in_parts_by(rules, &points, 1.0, edge);
            assert!(
                parts == (after.clone(), kept.clone()),
                "parts of {edge} spacings"
            );
        }
    }
}
