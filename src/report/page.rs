//! The report as one page: styles and charts inside, nothing fetched.

use super::{
    chart,
    contents::{Report, SPANNED},
    figure_tables::{figures, inputs, seams, settings, spacings, stages},
    html::{STYLE, escape, prose},
    levels::levels,
    map,
    mesh::MeshReport,
    numbers::counted,
    scenes::{before_and_after, overview, worst},
    tile_map::tile_map,
    verdict::verdicts,
};

impl Report {
    /// Returns the report as one page that needs no other file.
    pub(crate) fn to_html(&self) -> String {
        let body: String = sections(self)
            .iter()
            .filter(|(_, content)| !content.is_empty())
            .map(|(title, content)| format!("<section><h2>{title}</h2>{content}</section>"))
            .collect();
        format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>lloydar report</title><style>{STYLE}</style></head><body><main>\
             <h1>{}, {}</h1><p class=\"soft\">{} · lloydar {}</p>\
             <div class=\"cards\">{}</div>{body}</main></body></html>\n",
            counted(self.run.points, "point"),
            self.run.apart(self.length_unit),
            escape(&self.run.output),
            self.run.version,
            cards(self)
        )
    }
}

/// Returns titles and contents; a section without content is left out.
fn sections(report: &Report) -> [(&'static str, String); 17] {
    [
        ("Output", overview(&report.views.overview)),
        ("Figures", figures(report)),
        ("Points by spacing", spacings(report)),
        ("A square before and after", before_and_after(report)),
        ("Nearest distances, in spacings", nearest_distances(report)),
        ("δ by iteration", report.nearest.convergence.section()),
        (
            "Distances between input and output, in spacings",
            distances(report),
        ),
        (
            "Mesh",
            (report.mesh.as_ref()).map_or(String::new(), MeshReport::section),
        ),
        ("Levels", levels(report)),
        ("Map", map::map(&report.views.map, &report.tiles)),
        ("Least even squares", worst(&report.worst)),
        ("Tiles, coloured by δ", tile_map(&report.tiles)),
        ("Seams", seams(report)),
        ("Time and memory", costs(report)),
        ("Inputs", inputs(report)),
        ("Settings", settings(report)),
        ("Notes", notes(&report.notes)),
    ]
}

/// Returns the answers to the four questions, with their figures.
fn cards(report: &Report) -> String {
    verdicts(report)
        .iter()
        .map(|verdict| {
            format!(
                "<div class=\"card {}\"><span>{}</span> <b>{}</b><br><span class=\"soft\">{}</span></div>",
                verdict.answer,
                verdict.question,
                verdict.answer,
                prose(&verdict.figures)
            )
        })
        .collect()
}

fn nearest_distances(report: &Report) -> String {
    let nearest = &report.nearest;
    chart::histograms(
        "histograms of nearest distances: input, seeds and output",
        &[
            ("input", &nearest.histogram_input),
            ("seeds", &nearest.histogram_seeds),
            ("output", &nearest.histogram_output),
        ],
        SPANNED,
    ) + "<p class=\"legend\"><span class=\"input\"></span> input \
         <span class=\"seeds\"></span> seeds \
         <span class=\"output\"></span> output</p>"
}

/// Returns the histograms of the distances between input and output.
fn distances(report: &Report) -> String {
    let fidelity = &report.fidelity;
    // Shares make the two comparable: the input has many more points than the output.
    let shares = |counts: &[u64]| -> Vec<u64> {
        let all: u64 = counts.iter().sum();
        let share = |&count: &u64| (1e6 * count as f64 / all.max(1) as f64) as u64;
        counts.iter().map(share).collect()
    };
    chart::histograms(
        "histograms of distances: input to output and output to input",
        &[
            ("input", &shares(&fidelity.histogram_coverage)),
            ("output", &shares(&fidelity.histogram_accuracy)),
        ],
        SPANNED,
    ) + "<p class=\"legend\"><span class=\"input\"></span> from the input to the output: coverage \
         <span class=\"output\"></span> from the output to the input: accuracy</p>\
         <p class=\"soft\">shares of all points; of the input those that thinning keeps; the last bar is \
         two spacings and more</p>"
}

/// Returns the chart and the table of time, memory and disk.
fn costs(report: &Report) -> String {
    let costs = &report.costs;
    chart::over_time(&costs.over_time, &costs.stages, costs.memory_budget) + &stages(costs)
}

fn notes(notes: &[String]) -> String {
    let items = notes.iter();
    let items: String = items
        .map(|note| format!("<li>{}</li>", escape(note)))
        .collect();
    match items.is_empty() {
        true => items,
        false => format!("<ul>{items}</ul>"),
    }
}
