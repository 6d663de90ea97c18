//! How δ changes from iteration to iteration, and where it ends higher than it was.

use serde::Serialize;

use super::{chart, html::table, numbers::figure};
use crate::quality::{DistanceSums, SumsBySurroundings};

/// δ at the start of every iteration and after the last one, of all sites and by what was around them then. A δ without
/// sites is NaN.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Convergence {
    #[serde(rename = "convergence")]
    all: Vec<f64>,
    /// Of sites inside surfaces.
    #[serde(rename = "convergence_inside_surfaces")]
    inside_surfaces: Vec<f64>,
    /// Of sites where a surface ends.
    #[serde(rename = "convergence_at_borders")]
    at_borders: Vec<f64>,
    /// Of sites on leaves, wires and edges.
    #[serde(rename = "convergence_elsewhere")]
    elsewhere: Vec<f64>,
    /// The sums after the last iteration.
    #[serde(skip)]
    end: SumsBySurroundings,
}

impl Convergence {
    /// δ by the `sums` at the start of every iteration and after the last one.
    pub(super) fn of(sums: &[SumsBySurroundings]) -> Self {
        let delta = |of: &dyn Fn(&SumsBySurroundings) -> DistanceSums| -> Vec<f64> {
            sums.iter().map(|sums| of(sums).delta()).collect()
        };
        Self {
            all: delta(&SumsBySurroundings::all),
            inside_surfaces: delta(&|sums| sums.inside_surfaces),
            at_borders: delta(&|sums| sums.at_borders),
            elsewhere: delta(&|sums| sums.elsewhere),
            end: sums.last().copied().unwrap_or_default(),
        }
    }

    /// The chart of δ by iteration, and a table that says where it ends higher than it was.
    pub(super) fn section(&self) -> String {
        let end = &self.end;
        let rows = [
            (
                "inside surfaces",
                &self.inside_surfaces,
                end.inside_surfaces,
            ),
            ("where surfaces end", &self.at_borders, end.at_borders),
            ("on leaves, wires, edges", &self.elsewhere, end.elsewhere),
            ("in all", &self.all, end.all()),
        ];
        let all = end.all();
        let rows = rows.iter().filter(|(_, _, sums)| sums.count > 0);
        let rows = rows.map(|&(name, delta, sums)| row(name, delta, sums, all.count));
        let head = [
            "",
            "points",
            "δ of the seeds",
            "least δ",
            "after iterations",
            "δ at the end",
            "above the least",
        ];
        chart::line("δ by iteration", &self.all) + &table(&head, rows)
    }
}

/// The row of the sites with `sums` after the last iteration, of `all` sites.
fn row(name: &str, delta: &[f64], sums: DistanceSums, all: u64) -> Vec<String> {
    let known = delta.iter().enumerate();
    let known = known.filter(|(_, delta)| delta.is_finite());
    let (iterations, &least) = known
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .unwrap_or((0, &f64::NAN));
    let (first, last) = (delta.first(), delta.last());
    let (first, last) = (*first.unwrap_or(&f64::NAN), *last.unwrap_or(&f64::NAN));
    vec![
        name.to_owned(),
        format!("{:.1} %", 100.0 * sums.count as f64 / all.max(1) as f64),
        figure(first),
        figure(least),
        iterations.to_string(),
        figure(last),
        match last > least {
            true => format!("{:.1} %", 100.0 * (last / least - 1.0)),
            false => String::new(),
        },
    ]
}
