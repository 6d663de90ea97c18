//! The tables of the page.

use super::{
    contents::{Costs, Report},
    html::table,
    numbers::{figure, mebibytes, thousands},
    transients,
    wording::{setting, stage_title},
};
use crate::quality::Uniformity;

/// Returns the figures of uniformity, and those of the distances between input and output.
pub(super) fn figures(report: &Report) -> String {
    let (seeds, output) = (&report.evenness.seeds, &report.evenness.output);
    let row = |name: &str, of: &dyn Fn(&Uniformity) -> f64| {
        vec![name.to_owned(), figure(of(seeds)), figure(of(output))]
    };
    let uniformity = [
        row("δ", &|u| u.delta),
        row("δ without the largest 1 %", &|u| u.delta_trimmed),
        row("energy over hexagonal (1 is ideal)", &|u| u.energy_ratio),
        row("cell-area CV", &|u| u.cell_area_cv),
        row("packing", &|u| u.packing),
        row("share with six neighbours", &|u| u.six_neighbors),
        row("share of cells within a quarter of the mean area", &|u| {
            u.even_cells
        }),
        row("mean nearest distance", &|u| u.mean),
        row("smallest over mean", &|u| u.min),
        row("p1 over mean", &|u| u.p1),
        row("p99 over mean", &|u| u.p99),
        row("σ over mean", &|u| u.sigma_over_mean),
        row("ε", &|u| u.epsilon),
        vec![
            "points without a neighbour within four spacings (not in the figures above)".to_owned(),
            thousands(seeds.alone),
            thousands(output.alone),
        ],
    ];
    let distances = [
        ("output to thinned input", &report.fidelity.accuracy),
        ("input to output", &report.fidelity.coverage),
    ]
    .map(|(name, d)| {
        vec![
            name.to_owned(),
            figure(d.mean),
            figure(d.p99),
            figure(d.max),
            format!("{:.3} %", 100.0 * d.share_beyond),
        ]
    });
    let distance = format!("distance in {}", report.length_unit);
    table(&["", "seeds", "output"], uniformity.into_iter())
        + &table(
            &[&distance, "mean", "p99", "max", "farther than 1.5 spacings"],
            distances.into_iter(),
        )
        + &match report.isolated.count {
            0 => String::new(),
            _ => format!(
                "<p>isolated: {}. The map shows where.</p>",
                report.isolated.in_words()
            ),
        }
        + &report.transients.map_or_else(String::new, |counts| {
            format!("<p>passing: {}.</p>", transients::in_words(counts))
        })
}

/// Returns the numbers of points by the spacing that is wanted there, if it varies.
pub(super) fn spacings(report: &Report) -> String {
    let all = report.run.points.max(1) as f64;
    let rows = report.run.spacings.iter().map(|class| {
        let (finest, coarsest) = (figure(class.finest), figure(class.coarsest));
        vec![
            match finest == coarsest {
                true => finest,
                false => format!("{finest} to {coarsest}"),
            },
            thousands(class.points),
            format!("{:.1} %", 100.0 * class.points as f64 / all),
        ]
    });
    let head = format!("wanted spacing in {}", report.length_unit);
    match report.run.spacings.is_empty() {
        true => String::new(),
        false => format!(
            "{}<p class=\"soft\">Figures of uniformity are those of points that are scaled to a spacing of {} {}, each \
             by its own.</p>",
            table(&[&head, "points", "share"], rows),
            figure(report.run.spacing),
            report.length_unit
        ),
    }
}

/// Returns the figures on seams and elsewhere, and how well tiles agree.
pub(super) fn seams(report: &Report) -> String {
    let seams = &report.fit.seams;
    if report.tiles.len() == 1 {
        return "<p>one tile, no seams</p>".to_owned();
    }
    let row = |name: &str, u: &Uniformity| {
        vec![
            name.to_owned(),
            thousands(u.count),
            figure(u.delta),
            figure(u.mean),
            figure(u.min),
        ]
    };
    let rows = [
        row("within two spacings of a seam", &seams.on_seams),
        row("elsewhere", &seams.elsewhere),
    ];
    table(
        &["", "points", "δ", "mean distance", "smallest over mean"],
        rows.into_iter(),
    ) + &format!(
        "<p>{} sites were solved by several tiles. On {} of them the tiles agree to the bit; {} were \
         taken from their home, the tile in whose core they lie. The largest disagreement is {} {}. \
         For {:.2} % of all sites the tile contained every point that they depend on.</p>",
        thousands(seams.shared),
        thousands(seams.identical),
        thousands(seams.resolved_by_owner),
        figure(seams.largest_disagreement),
        report.length_unit,
        100.0 * report.fit.exact
    )
}

/// Returns time and peak memory by stage, with the peaks of the run.
pub(super) fn stages(costs: &Costs) -> String {
    let rows = costs.stages.iter().map(|stage| {
        vec![
            stage_title(&stage.stage).to_owned(),
            format!("{:.2}", stage.seconds),
            stage.peak.map_or("–".into(), mebibytes),
        ]
    });
    // A budget that is far above the peak is not in the chart.
    let dashed = match costs.memory_peak {
        Some(peak) if 1.2 * peak as f64 >= costs.memory_budget as f64 => " (dashed)",
        _ => "",
    };
    format!(
        "<p class=\"legend\"><span class=\"output\"></span> memory, up to {} of {}{dashed} \
         <span class=\"seeds\"></span> temporary files, up to {}</p>",
        costs.memory_peak.map_or("–".into(), mebibytes),
        mebibytes(costs.memory_budget),
        mebibytes(costs.temporary_peak)
    ) + &table(&["stage", "seconds", "peak memory so far"], rows)
}

/// Returns the numbers of points of each input.
pub(super) fn inputs(report: &Report) -> String {
    let rows = report.run.inputs.iter().map(|input| {
        vec![
            input.path.clone(),
            thousands(input.claimed),
            thousands(input.read),
            thousands(input.filtered),
            thousands(input.rejected),
            thousands(input.outside),
            match &input.left_out {
                Some(reason) => format!("left out: {reason}"),
                None if input.rejected + input.outside > 0 => "check".to_owned(),
                None => "complete".to_owned(),
            },
        ]
    });
    let names = [
        "file",
        "stated by the header",
        "read",
        "left out by the filter",
        "rejected",
        "outside its bounds",
        "verdict",
    ];
    table(&names, rows)
}

/// Returns the settings in words.
pub(super) fn settings(report: &Report) -> String {
    let rows = report.run.settings.iter();
    table(
        &["option", "value"],
        rows.map(|(name, value)| setting(name, value).into()),
    )
}
