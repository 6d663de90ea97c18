//! The figures of the mesh: in JSON, as a section of the page, and as a line of the summary.

use serde::Serialize;

use super::{
    chart,
    html::{escape, table},
    numbers::{counted, thousands},
};
use crate::{job::MeshLevel, mesh::MeshFigures};

/// The angle below which a triangle counts as thin, in degrees.
const THIN: f64 = 30.0;
/// The largest angle that the smallest of a triangle can be, in degrees: that of an equilateral triangle.
const EQUILATERAL: f64 = 60.0;
/// The number of bins of the histogram of smallest angles: half degrees.
const ANGLE_BINS: usize = 120;
/// The style of the table, whose last column is text.
const STYLE: &str = ".mesh th:last-child,.mesh td:last-child{text-align:left}\
                     .mesh td:nth-child(-n+2){white-space:nowrap;vertical-align:top}";

/// The figures of a mesh. Angles are in degrees; one that does not exist, as without triangles, is `null` in
/// JSON.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MeshReport {
    /// The file or directory of the mesh.
    file: String,
    /// The number of triangles.
    triangles: u64,
    /// The number of points that are corners of triangles.
    points_used: u64,
    /// The number of points with a normal that are corners of no triangle.
    points_unused: u64,
    /// The number of points where the scan describes no surface.
    points_without_surface: u64,
    /// The number of edges with two triangles.
    inner_edges: u64,
    /// The number of edges with one triangle.
    border_edges: u64,
    /// The number of components.
    components: u64,
    /// Points − edges + triangles.
    euler_characteristic: i64,
    /// The number of triangles that were cut out, because those around a loop have no common front.
    cut: u64,
    /// The number of triangles that were left out as clutter: they belong to no surface.
    clutter: u64,
    /// The median of the smallest angles of all triangles.
    smallest_angle_median: f64,
    /// The 1st percentile of the smallest angles.
    smallest_angle_p1: f64,
    /// The least of the smallest angles.
    smallest_angle_min: f64,
    /// The share of triangles whose smallest angle is below [`THIN`].
    share_thin: f64,
    /// The histogram of the smallest angles, in half degrees from 0° to 60°.
    histogram_smallest_angles: Vec<u64>,
    /// The coarser levels of a mesh in tiles.
    coarser_levels: Vec<MeshLevel>,
}

impl MeshReport {
    /// The figures of the mesh in `file`, and its `coarser_levels` if it is in tiles.
    pub(super) fn new(figures: &MeshFigures, coarser_levels: &[MeshLevel], file: &str) -> Self {
        let mut histogram = figures.angles().to_vec();
        // An equilateral triangle belongs to the last bin.
        let equilateral: u64 = histogram.drain(ANGLE_BINS..).sum();
        histogram[ANGLE_BINS - 1] += equilateral;
        let thin_bins = (THIN / EQUILATERAL * ANGLE_BINS as f64) as usize;
        let thin: u64 = histogram[..thin_bins].iter().sum();
        Self {
            file: file.to_owned(),
            triangles: figures.triangles,
            points_used: figures.corners,
            points_unused: figures.unused,
            points_without_surface: figures.loose,
            inner_edges: figures.inner_edges,
            border_edges: figures.border_edges,
            components: figures.components,
            euler_characteristic: figures.euler_characteristic(),
            cut: figures.cut,
            clutter: figures.clutter,
            smallest_angle_median: figures.angle(0.5),
            smallest_angle_p1: figures.angle(0.01),
            smallest_angle_min: figures.angle(0.0),
            share_thin: thin as f64 / figures.triangles as f64,
            histogram_smallest_angles: histogram,
            coarser_levels: coarser_levels.to_vec(),
        }
    }

    /// Returns the figures in a line for a terminal.
    pub(super) fn summary(&self) -> String {
        let angles = match self.triangles {
            0 => String::new(),
            _ => format!(
                ", smallest angle {:.0}° in the median, {:.0}° at the 1st percentile",
                self.smallest_angle_median, self.smallest_angle_p1
            ),
        };
        let cut = match self.cut {
            0 => String::new(),
            triangles => format!(", {} cut out", counted(triangles, "triangle")),
        };
        let clutter = match self.clutter {
            0 => String::new(),
            triangles => format!(", {} left out as clutter", thousands(triangles)),
        };
        format!(
            "{}{angles}; {}, {}{cut}{clutter}: {}",
            counted(self.triangles, "triangle"),
            counted(self.border_edges, "border edge"),
            counted(self.components, "component"),
            self.file
        )
    }

    /// Returns the figures with their meaning, and the histogram of the smallest angles, as a section of the page.
    pub(super) fn section(&self) -> String {
        let file = format!("<p>{}</p>", escape(&self.file));
        let rows = self.counts().into_iter().chain(self.angles());
        let rows = rows.map(|(name, figure, meaning)| vec![name.into(), figure, meaning.into()]);
        let figures = format!(
            "<style>{STYLE}</style><div class=\"mesh\">{}</div>",
            table(&["", "mesh", "what it means"], rows)
        );
        file + &figures + &self.histogram() + &self.levels()
    }

    /// Returns the coarser levels as a table; nothing if there are none.
    fn levels(&self) -> String {
        if self.coarser_levels.is_empty() {
            return String::new();
        }
        let row = |level: &MeshLevel| {
            vec![
                format!("{}", level.spacing),
                thousands(level.points),
                thousands(level.triangles),
                thousands(level.tiles),
            ]
        };
        let rows = self.coarser_levels.iter().map(row);
        "<p>Coarser levels, which viewers show from afar:</p>".to_owned()
            + &table(&["spacing", "points", "triangles", "tiles"], rows)
    }

    /// The names, values and meanings of the figures that are counted.
    fn counts(&self) -> Vec<(&'static str, String, &'static str)> {
        let mut rows = vec![
            (
                "triangles",
                thousands(self.triangles),
                "Between neighbouring points of the output: the corners are points of the cloud, and none is added.",
            ),
            (
                "points used",
                thousands(self.points_used),
                "Corners of triangles.",
            ),
            (
                "points unused",
                thousands(self.points_unused),
                "They have a normal and no triangle: their neighbours are too far away, or belong to another surface, or all their triangles were clutter.",
            ),
            (
                "points without surface",
                thousands(self.points_without_surface),
                "The scan describes no surface there, as on leaves and wires. They are in the cloud only.",
            ),
            (
                "edges with two triangles",
                thousands(self.inner_edges),
                "The inside of surfaces. No edge has more than two, so that every edge is either inside or a border.",
            ),
            (
                "border edges",
                thousands(self.border_edges),
                "They have one triangle: the scan ends, lies in a shadow or has a hole wider than a few spacings.",
            ),
            (
                "components",
                thousands(self.components),
                "Pieces without a common edge. Many small ones mean that the scan is sparse for this spacing, \
                 or that something grows there.",
            ),
            (
                "Euler characteristic",
                self.euler_characteristic.to_string(),
                "Points used − edges + triangles: 1 for each piece like a sheet and 2 for each closed one, less 1 for each \
                 hole and 2 for each handle.",
            ),
        ];
        if self.cut > 0 {
            rows.push((
                "triangles cut out",
                thousands(self.cut),
                "Triangles around a loop had no common front there, as on a strip of Möbius; the least flat edges were cut.",
            ));
        }
        if self.clutter > 0 {
            rows.push((
                "triangles left out as clutter",
                thousands(self.clutter),
                "They belong to no surface, as those from one leaf to another. --mesh-of all keeps them.",
            ));
        }
        rows
    }

    /// The names, values and meanings of the figures of angles.
    fn angles(&self) -> [(&'static str, String, &'static str); 4] {
        let degrees = |angle: f64| match angle.is_finite() {
            true => format!("{angle:.1}°"),
            false => "–".to_owned(),
        };
        let share = match self.share_thin.is_finite() {
            true => format!("{:.2} %", 100.0 * self.share_thin),
            false => "–".to_owned(),
        };
        [
            (
                "smallest angle, median",
                degrees(self.smallest_angle_median),
                "Half of the triangles have a larger one. 60° is an equilateral triangle.",
            ),
            (
                "smallest angle, 1st percentile",
                degrees(self.smallest_angle_p1),
                "One triangle in a hundred is thinner. Simulations ask for 20° to 30°.",
            ),
            (
                "smallest angle, least",
                degrees(self.smallest_angle_min),
                "The thinnest triangle of all, most often at a border.",
            ),
            (
                "triangles below 30°",
                share,
                "Thin triangles: heights interpolated in them and normals of them are less certain.",
            ),
        ]
    }

    /// Returns the histogram of the smallest angles, with a legend.
    fn histogram(&self) -> String {
        chart::histograms(
            "histogram of the smallest angles of the triangles, in degrees",
            &[("output", &self.histogram_smallest_angles)],
            EQUILATERAL,
        ) + "<p class=\"soft\">Smallest angles of the triangles, in degrees. Points at even distances have triangles near \
             60°; a long tail to the left is a mesh with slivers.</p>"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles with angles of 45°, one equilateral triangle and one of 20°.
    fn figures() -> MeshFigures {
        let mut figures = MeshFigures::default();
        (figures.corners, figures.unused, figures.loose) = (10, 1200, 3);
        (figures.inner_edges, figures.border_edges) = (1, 10);
        figures.components = 3;
        for angle in [45.2_f64, 45.2, 60.0, 20.2] {
            figures.push_triangle(angle.to_radians().cos());
        }
        figures
    }

    #[test]
    fn figures_of_a_mesh_are_those_that_were_counted() {
        let report = MeshReport::new(&figures(), &[], "a.ply");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["triangles"], 4);
        assert_eq!(json["points_unused"], 1200);
        assert_eq!(json["euler_characteristic"], 3);
        assert_eq!(json["smallest_angle_median"], 45.25);
        assert_eq!(json["smallest_angle_min"], 20.25);
        assert_eq!(json["share_thin"], 0.25);
        let bins = json["histogram_smallest_angles"].as_array().unwrap();
        assert_eq!((bins.len(), &bins[90]), (120, &2.into()));
        assert_eq!((&bins[40], &bins[119]), (&1.into(), &1.into()));
        assert_eq!(
            report.summary(),
            "4 triangles, smallest angle 45° in the median, 20° at the 1st percentile; \
             10 border edges, 3 components: a.ply"
        );
    }

    #[test]
    fn triangles_that_are_left_out_are_named_where_there_are_any() {
        let mut figures = figures();
        let without = MeshReport::new(&figures, &[], "a.ply");
        for out in ["cut out", "left out as clutter"] {
            assert!(!without.section().contains(out) && !without.summary().contains(out));
        }
        (figures.cut, figures.clutter) = (2, 34);
        let with = MeshReport::new(&figures, &[], "a.ply");
        assert!(
            with.section().contains("cut out") && with.section().contains("left out as clutter")
        );
        let summary = with.summary();
        assert!(
            summary.contains(", 2 triangles cut out, 34 left out as clutter: a.ply"),
            "{summary}"
        );
    }

    #[test]
    fn coarser_levels_are_a_table_where_there_are_any() {
        let level = MeshLevel {
            spacing: 0.2,
            points: 5000,
            triangles: 9876,
            tiles: 3,
        };
        let with = MeshReport::new(&figures(), &[level], "tiles").section();
        assert!(with.contains("Coarser levels") && with.contains(&thousands(9876)));
        let without = MeshReport::new(&figures(), &[], "tiles").section();
        assert!(!without.contains("Coarser levels"));
    }

    #[test]
    fn a_mesh_without_triangles_has_no_angles() {
        let report = MeshReport::new(&MeshFigures::default(), &[], "<empty>.ply");
        assert_eq!(
            report.summary(),
            "0 triangles; 0 border edges, 0 components: <empty>.ply"
        );
        let json = serde_json::to_value(&report).unwrap();
        assert!(json["smallest_angle_median"].is_null() && json["share_thin"].is_null());
        assert!(
            report.section().contains("&lt;empty&gt;.ply") && !report.section().contains("NaN")
        );
    }
}
