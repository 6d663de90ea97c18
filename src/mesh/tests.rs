//! Meshes of surfaces that are known, and of parts of them.

use std::collections::HashMap;

use super::*;
use crate::geometry::{Stored, spread};

pub(super) const QUANTIZATION: Quantization = Quantization {
    scale: 1e-4,
    offset: [0.0; 3],
};

/// A number from 0 to 1.
fn unit(k: u64) -> f64 {
    spread(k) as f64 / u64::MAX as f64
}

/// Points of a surface, moved by `noise`, as the solver leaves them: with normals, in no order.
pub(super) fn cloud(places: impl Iterator<Item = (Local, Local)>, noise: f64) -> Vec<MeshPoint> {
    (0..)
        .zip(places)
        .map(|(index, (place, normal))| {
            let roll = |k: u64| 2.0 * unit(7 * u64::from(index) + k) - 1.0;
            let moved = place + Local::new(roll(0), roll(1), roll(2)) * noise;
            MeshPoint {
                point: QUANTIZATION.stored(moved).unwrap(),
                // Of either side.
                normal: Some(if unit(u64::from(index)) < 0.5 {
                    normal
                } else {
                    -normal
                }),
                scanner: None,
                index,
                home: 0,
                cell: [0; 2],
            }
        })
        .collect()
}

/// About even points of the unit sphere: a spiral, whose neighbours are a spacing of about 1.9 / √count apart.
fn sphere(count: u32) -> impl Iterator<Item = (Local, Local)> {
    (0..count).map(move |k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let turn = f64::from(k) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let wide = (1.0 - z * z).sqrt();
        let place = Local::new(wide * turn.cos(), wide * turn.sin(), z);
        (place, place)
    })
}

const SPHERE_POINTS: u32 = 1500;
const SPHERE_SPACING: f64 = 0.095;

/// The node in this row and place of it of a hexagonal lattice of edge 1 on the plane z = 0.
fn node(place: i32, row: i32) -> Local {
    let [place, row] = [place, row].map(f64::from);
    Local::new(place + 0.5 * (row % 2.0), 0.75_f64.sqrt() * row, 0.0)
}

/// A hexagonal lattice of edge 1 on the plane z = 0, without the nodes within `hole` of (20, 20).
pub(super) fn sheet(hole: f64) -> impl Iterator<Item = (Local, Local)> {
    (0..40)
        .flat_map(move |i| (0..46).map(move |j| node(i, j)))
        .filter(move |place| (place - Local::new(20.0, 20.0, 0.0)).norm() > hole)
        .map(|place| (place, Local::z()))
}

/// Counts the triangles on every edge.
pub(super) fn edges_of(triangles: &[Corners]) -> HashMap<[u32; 2], Vec<bool>> {
    let mut edges: HashMap<[u32; 2], Vec<bool>> = HashMap::new();
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge = [from.min(to), from.max(to)];
            edges.entry(edge).or_default().push(from < to);
        }
    }
    edges
}

/// Whether every edge has two triangles that run through it in opposite directions.
fn is_watertight(triangles: &[Corners]) -> bool {
    edges_of(triangles)
        .values()
        .all(|runs| matches!(runs[..], [true, false] | [false, true]))
}

/// The edge of the cells of parts, of which the edges of parts are multiples.
const CELL_IN_SPACINGS: f64 = 5.0;

/// The mesh on the surfaces of `points` in parts: squares of this `edge` in spacings.
pub(super) fn in_parts(
    points: &[MeshPoint],
    spacing: f64,
    edge: f64,
) -> (Vec<Corners>, MeshFigures) {
    in_parts_by(MeshRules::default(), points, spacing, edge)
}

/// The mesh of `points` by these `rules` in parts: squares of this `edge` in spacings.
pub(super) fn in_parts_by(
    rules: MeshRules,
    points: &[MeshPoint],
    spacing: f64,
    edge: f64,
) -> (Vec<Corners>, MeshFigures) {
    let home = |point: Stored| {
        let units = QUANTIZATION.units(edge * spacing);
        [point.x, point.y].map(|c| i64::from(c).div_euclid(units))
    };
    let mut homes: Vec<[i64; 2]> = points.iter().map(|p| home(p.point)).collect();
    homes.sort_unstable();
    homes.dedup();
    let reach = QUANTIZATION.units(rules.reach_in_spacings() * spacing);
    let (mut sides, mut figures, mut parts) = (Sides::default(), MeshFigures::default(), vec![]);
    for (number, own) in (0..).zip(&homes) {
        let units = QUANTIZATION.units(edge * spacing);
        let near = |&&MeshPoint { point, .. }: &&MeshPoint| {
            let beyond =
                |c: i32, k: i64| (k * units - i64::from(c)).max(i64::from(c) - (k + 1) * units);
            beyond(point.x, own[0]) <= reach && beyond(point.y, own[1]) <= reach
        };
        let cell_edge = QUANTIZATION.units(CELL_IN_SPACINGS * spacing);
        let seen = points.iter().filter(near).map(|&point| MeshPoint {
            home: homes.binary_search(&home(point.point)).unwrap() as u32,
            cell: [point.point.y, point.point.x].map(|c| i64::from(c).div_euclid(cell_edge) as i32),
            ..point
        });
        let mut part = MeshedPart::new(number, seen.collect(), &QUANTIZATION, spacing, rules);
        let first = sides.add(&mut part);
        figures.merge(&part.figures);
        parts.push((first, part.triangles));
    }
    let sides = sides.settle(&mut figures);
    let mut all: Vec<Corners> = parts
        .into_iter()
        .flat_map(|(first, triangles)| triangles.into_iter().map(move |t| (first, t)))
        .filter_map(|(first, t)| sides.turned(t.corners, first + t.component))
        .collect();
    all.sort_unstable();
    (all, figures)
}

#[test]
fn a_sphere_is_watertight_and_looks_outwards() {
    for noise in [0.0, 0.01] {
        let points = cloud(sphere(SPHERE_POINTS), noise);
        let (triangles, figures) = mesh_of_whole(points.clone(), &QUANTIZATION, SPHERE_SPACING);
        assert!(is_watertight(&triangles));
        assert_eq!(figures.euler_characteristic(), 2);
        assert_eq!(
            (figures.components, figures.border_edges, figures.unused),
            (1, 0, 0)
        );
        assert_eq!(figures.triangles, triangles.len() as u64);
        for corners in triangles {
            let [a, b, c] = corners.map(|k| QUANTIZATION.local(points[k as usize].point));
            assert!((b - a).cross(&(c - a)).dot(&a) > 0.0);
        }
    }
}

#[test]
fn the_mesh_does_not_depend_on_the_order_of_the_points() {
    let points = cloud(sphere(SPHERE_POINTS), 0.015);
    let mut shuffled = points.clone();
    shuffled.sort_by_key(|point| spread(u64::from(point.index)));
    let mesh = |points| mesh_of_whole(points, &QUANTIZATION, SPHERE_SPACING);
    assert_eq!(mesh(points), mesh(shuffled));
}

#[test]
fn parts_make_the_mesh_of_the_whole() {
    // Rough places everywhere: stars disagree, and there are holes, folds and loose points.
    let mut points = cloud(sheet(6.0), 0.33);
    for point in &mut points {
        point.normal = point
            .normal
            .filter(|_| unit(1000 + u64::from(point.index)) > 0.05);
    }
    let (whole, figures) = mesh_of_whole(points.clone(), &QUANTIZATION, 1.0);
    assert!(
        figures.border_edges > 100 && figures.loose > 50,
        "{} {}",
        figures.border_edges,
        figures.loose
    );
    for edge in [30.0, 13.0, 5.0] {
        let (parts, of_parts) = in_parts(&points, 1.0, edge);
        assert_eq!(parts, whole, "parts of {edge} spacings");
        assert_eq!(of_parts, figures, "parts of {edge} spacings");
    }
}

#[test]
fn parts_that_see_a_share_of_the_cloud_make_the_mesh_of_the_whole() {
    // A long strip, so rough that much of it is clutter.
    let strip = (0..8 * 400).map(|k| (node(k / 8, k % 8), Local::z()));
    let points = cloud(strip, 0.3);
    for (of, keeps_edges) in [
        (MeshedPoints::Surfaces, false),
        (MeshedPoints::Surfaces, true),
        (MeshedPoints::All, false),
    ] {
        let rules = MeshRules {
            points: of,
            keeps_edges,
        };
        let whole = in_parts_by(rules, &points, 1.0, 1e6);
        assert!(whole.1.triangles > 500 && whole.1.cut + whole.1.border_edges > 100);
        assert_eq!(whole.1.clutter > 100, of == MeshedPoints::Surfaces);
        for edge in [20.0, 5.0] {
            assert!(
                in_parts_by(rules, &points, 1.0, edge) == whole,
                "{rules:?} {edge}"
            );
        }
    }
}

#[test]
fn the_figures_are_those_of_the_triangles() {
    let points = cloud(sheet(6.0), 0.4);
    let (triangles, figures) = mesh_of_whole(points.clone(), &QUANTIZATION, 1.0);
    let edges = edges_of(&triangles);
    let count = |number: usize| edges.values().filter(|runs| runs.len() == number).count() as u64;
    assert_eq!(
        (figures.border_edges, figures.inner_edges),
        (count(1), count(2))
    );
    assert!(
        edges
            .values()
            .all(|runs| runs.len() == 1 || runs[..] == [true, false] || runs[..] == [false, true])
    );
    let mut corners: Vec<u32> = triangles.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    assert_eq!(figures.corners, corners.len() as u64);
    assert_eq!(figures.unused, (points.len() - corners.len()) as u64);
}

#[test]
fn narrow_holes_are_closed_and_wide_ones_are_borders() {
    let borders = |hole: f64| {
        let points = cloud(sheet(hole), 0.02);
        mesh_of_whole(points, &QUANTIZATION, 1.0).1.border_edges
    };
    let outside = borders(0.0);
    assert!(outside > 100, "{outside}");
    assert_eq!(borders(1.2), outside, "a hole of two spacings");
    assert!(borders(5.0) > outside + 20, "a hole of ten spacings");
}

#[test]
fn a_sheet_looks_upwards_or_towards_its_scanner() {
    let looks_up = |scanner: Option<Local>| {
        let mut points = cloud(sheet(0.0), 0.02);
        points.iter_mut().for_each(|point| point.scanner = scanner);
        let (triangles, figures) = mesh_of_whole(points.clone(), &QUANTIZATION, 1.0);
        assert_eq!(figures.components, 1);
        let up = |corners: &Corners| {
            let [a, b, c] = corners.map(|k| QUANTIZATION.local(points[k as usize].point));
            (b - a).cross(&(c - a)).z > 0.0
        };
        let ups = triangles.iter().filter(|corners| up(corners)).count();
        assert!(ups == 0 || ups == triangles.len());
        ups > 0
    };
    assert!(looks_up(None));
    assert!(looks_up(Some(Local::new(20.0, 20.0, 5.0))));
    assert!(!looks_up(Some(Local::new(20.0, 20.0, -5.0))));
}

#[test]
fn a_strip_of_moebius_is_cut_open() {
    // Half a turn on the way around: no side can be the outer one.
    let count = 120;
    let places = (0..count).flat_map(|k| {
        let turn = std::f64::consts::TAU * f64::from(k) / f64::from(count);
        (-4..=4).map(move |across| {
            let out = Local::new(turn.cos(), turn.sin(), 0.0);
            let way = out * (0.5 * turn).cos() + Local::z() * (0.5 * turn).sin();
            let along = Local::new(-turn.sin(), turn.cos(), 0.0);
            let offset = f64::from(across) + if k % 2 == 0 { 0.0 } else { 0.5 };
            (out * 19.1 + way * offset, way.cross(&along))
        })
    });
    // Clutter stays, so that rough strips do.
    let rules = MeshRules {
        points: MeshedPoints::All,
        keeps_edges: false,
    };
    let mesh = |noise: f64, edge: f64| in_parts_by(rules, &cloud(places.clone(), noise), 1.0, edge);
    let (triangles, figures) = mesh(0.01, 1e6);
    assert!(triangles.len() > 1500);
    assert_eq!(figures.components, 1);
    // No more than once across.
    assert!((1..=20).contains(&figures.cut), "{}", figures.cut);
    // Where it is cut does not depend on the parts.
    for noise in [0.01, 0.2, 0.3] {
        let whole = mesh(noise, 1e6);
        assert!(whole.1.cut > 0);
        assert!(mesh(noise, 10.0) == whole && mesh(noise, 15.0) == whole);
    }
    let one_way = |runs: &Vec<bool>| runs.len() == 1 || runs[0] != runs[1];
    assert!(edges_of(&triangles).values().all(one_way));
}

#[test]
fn nothing_and_points_without_surface_have_no_triangles() {
    assert!(mesh_of_whole(Vec::new(), &QUANTIZATION, 1.0).0.is_empty());
    let mut points = cloud(sheet(0.0), 0.02);
    points.iter_mut().for_each(|point| point.normal = None);
    let (triangles, figures) = mesh_of_whole(points.clone(), &QUANTIZATION, 1.0);
    assert!(triangles.is_empty());
    assert_eq!(figures.loose, points.len() as u64);
    // All in one place.
    let normal = Some(Local::z());
    let point = Stored { x: 3, y: 4, z: 5 };
    points
        .iter_mut()
        .for_each(|p| (p.point, p.normal) = (point, normal));
    assert!(mesh_of_whole(points, &QUANTIZATION, 1.0).0.is_empty());
}

#[test]
fn points_without_surface_have_triangles_if_they_are_asked_for() {
    let mut points = cloud(sphere(SPHERE_POINTS), 0.02 * SPHERE_SPACING);
    let with_normals = in_parts(&points, SPHERE_SPACING, 1e6).0;
    points.iter_mut().for_each(|point| point.normal = None);
    let rules = MeshRules {
        points: MeshedPoints::All,
        keeps_edges: true,
    };
    let all = |edge| in_parts_by(rules, &points, SPHERE_SPACING, edge);
    let (triangles, figures) = all(1e6);
    assert!(is_watertight(&triangles));
    assert_eq!((figures.loose, figures.components), (0, 1));
    assert_eq!(figures.triangles, with_normals.len() as u64);
    assert_eq!(all(30.0), (triangles, figures));

    // Points in a row have no neighbours around them.
    let row = (0..100).map(|k| (Local::new(f64::from(k), 0.0, 0.0), Local::z()));
    let mut row = cloud(row, 0.05);
    row.iter_mut().for_each(|point| point.normal = None);
    let (triangles, figures) = in_parts_by(rules, &row, 1.0, 1e6);
    assert!(triangles.is_empty());
    assert_eq!(figures.loose, 100);
}

/// The corners of `triangles`, and the number of components that hang together by edges.
fn used_and_components(triangles: &[Corners]) -> (Vec<u32>, usize) {
    let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut joined = joined::Joined::new(triangles.len());
    let mut components = triangles.len();
    for (_, on_edge) in edges::EdgeTable::new(triangles).all() {
        if let Some([(one, _), (other, _)]) = on_edge.both() {
            let joining = joined.join(one, other, false);
            components -= usize::from(matches!(joining, joined::Joining::New { .. }));
        }
    }
    (used, components)
}

#[test]
fn a_trimmed_fringe_leaves_every_point_and_what_hangs_together() {
    let (mut taken, mut closed) = (0, 0);
    for (noise, share) in [(0.1, 0.3), (0.3, 0.2), (0.45, 0.4), (0.45, 0.1)] {
        // Points without a normal make holes and borders of all shapes.
        let mut points = cloud(sheet(6.0), noise);
        points.sort_unstable_by_key(|point| point.point);
        let positions: Vec<Local> = points
            .iter()
            .map(|point| QUANTIZATION.local(point.point))
            .collect();
        let is_on_surface = |point: &&MeshPoint| unit(2000 + u64::from(point.index)) > share;
        let normals: Vec<Option<Local>> = points
            .iter()
            .map(|point| Some(point).filter(is_on_surface)?.normal)
            .collect();
        let candidates = stars::candidates(&positions, &normals, 1.0);
        let mut triangles = agreement::agreed(&positions, candidates);
        let may_be_border = holes::close(&positions, 1.0, &mut triangles);
        let mut trimmed = triangles.clone();
        fringe::trim(&positions, 1.0, may_be_border, &mut trimmed);
        let is_same = used_and_components(&trimmed) == used_and_components(&triangles);
        assert!(is_same, "noise of {noise}, {share} without a normal");
        // What is known of the borders beforehand saves time, and no more.
        let mut by_all = triangles.clone();
        fringe::trim(&positions, 1.0, vec![true; positions.len()], &mut by_all);
        assert_eq!(by_all, trimmed);
        taken += triangles.len() - trimmed.len();
        // Holes that were kept open are closed then, and nothing else changes.
        holes::close(&positions, 1.0, &mut trimmed);
        assert!(edges_of(&trimmed).values().all(|runs| runs.len() <= 2));
        let is_kept = |corners| trimmed.binary_search(corners).is_ok();
        assert!(by_all.iter().all(is_kept));
        closed += trimmed.len() - by_all.len();
    }
    assert!(taken > 100 && closed > 0, "{taken} {closed}");
}
