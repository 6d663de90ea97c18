//! The figures of the levels of an octree, or of the beginnings of a file in progressive order.

use super::{
    contents::Report,
    html::table,
    numbers::{figure, thousands},
};
use crate::{
    job::ReportedLevels,
    las::{NearestFigures, PointOrder},
};

/// Returns the section of the page; nothing if the output has no levels.
pub(super) fn levels(report: &Report) -> String {
    match &report.levels {
        Some(levels) if !levels.figures.is_empty() => section(report, levels),
        _ => String::new(),
    }
}

fn section(report: &Report, levels: &ReportedLevels) -> String {
    let unit = report.length_unit;
    let (first, about) = match levels.order {
        PointOrder::Nearby => (
            "levels of the octree",
            "each with the points of the levels above it; the spacing is what the file states, and no two points are nearer",
        ),
        PointOrder::Progressive => (
            "first points of the file",
            "however many, they are a coarser cloud",
        ),
    };
    let all = &report.evenness.output;
    let rows = levels.figures.iter().enumerate().map(|(number, of)| {
        let name = match levels.order {
            PointOrder::Nearby => format!("0 to {number}"),
            PointOrder::Progressive => {
                format!(
                    "{:.0} %",
                    100.0 * of.points as f64 / report.run.points as f64
                )
            }
        };
        row(name, of)
    });
    let all = NearestFigures {
        points: report.run.points,
        spacing: f64::NAN,
        mean: all.mean,
        cv: all.delta,
        least: all.min * all.mean,
    };
    let names = [
        first,
        "points",
        &format!("spacing, {unit}"),
        "mean nearest distance",
        "CV",
        "least over mean",
    ];
    format!("<p class=\"soft\">{about}</p>")
        + &table(&names, rows.chain([row("all".to_owned(), &all)]))
}

fn row(name: String, of: &NearestFigures) -> Vec<String> {
    vec![
        name,
        thousands(of.points),
        figure(of.spacing),
        figure(of.mean),
        figure(of.cv),
        figure(of.least / of.mean),
    ]
}
