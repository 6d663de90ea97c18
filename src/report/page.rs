//! The report as one page: styles and charts inside, nothing fetched.

use std::path::Path;

use base64::Engine;

use super::{
    Report, SPANNED, TileRow, VIEWER_PAGE, WorstRow, chart, figure, map, thousands, verdicts,
};
use crate::{quality::Uniformity, views::DetailView};

pub(super) const STYLE: &str = "
:root{color-scheme:light dark;--ink:#1b2430;--paper:#fbfbf9;--soft:#66707c;--rule:#d9dcd6;
--good:#1a7f4b;--look:#b4540a;--input:#b9c0c8;--seeds:#c9b27c;--output:#2b6cb0}
@media(prefers-color-scheme:dark){:root{--ink:#e8eaed;--paper:#14181d;--soft:#9aa4af;--rule:#2f3740;
--good:#5fd39a;--look:#f0a35e;--input:#4a535d;--seeds:#7d6b3c;--output:#63a4e6}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:62rem;
margin:0 auto;padding:1rem}
h1{font-size:1.6rem}h2{font-size:1.15rem;margin-top:2.2rem;border-top:1px solid var(--rule);padding-top:1rem}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(13rem,1fr));gap:.8rem}
.card{border:1px solid var(--rule);border-radius:.6rem;padding:.8rem}
.card b{font-size:1.2rem}.yes b{color:var(--good)}.look b{color:var(--look)}
.wide{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{text-align:right;padding:.25rem .6rem;border-bottom:1px solid var(--rule)}
th:first-child,td:first-child{text-align:left;overflow-wrap:anywhere}
svg{width:100%;height:auto}svg text{fill:var(--soft);font-size:12px}
.axis{stroke:var(--rule)}.line{fill:none;stroke:var(--output);stroke-width:2}
.line.disk{stroke:var(--seeds)}.limit{stroke:var(--look);stroke-dasharray:6 4}
.input{fill:var(--input)}.seeds{fill:var(--seeds)}.output{fill:var(--output);opacity:.75}
.soft{color:var(--soft)}.legend span{display:inline-block;width:.8em;height:.8em;margin-left:1em}
.legend .input{background:var(--input)}.legend .seeds{background:var(--seeds)}
.legend .output{background:var(--output)}
a{color:var(--output)}
canvas{width:100%;height:auto;image-rendering:pixelated;border:1px solid var(--rule)}
canvas:focus-visible{outline:3px solid var(--output)}
.controls label{margin-right:1.5em}select{font:inherit}
.places{display:grid;grid-template-columns:repeat(auto-fit,minmax(17rem,1fr));gap:1rem}
figure{margin:0;break-inside:avoid}figcaption{color:var(--soft);font-size:.9rem}
.portrait{width:100%;height:auto;border-radius:.6rem}
.map rect{stroke:var(--paper);stroke-width:.3%}
@media print{body{max-width:none}}";

/// Text as it may stand in a page.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

fn table(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let cells = |row: &[String], tag: &str| -> String {
        row.iter()
            .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)))
            .collect()
    };
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    let rows: String = rows
        .map(|row| format!("<tr>{}</tr>", cells(&row, "td")))
        .collect();
    format!(
        "<div class=\"wide\" tabindex=\"0\"><table><thead><tr>{}</tr></thead><tbody>{rows}</tbody></table></div>",
        cells(&head, "th")
    )
}

pub(super) fn page(report: &Report) -> String {
    let cards: String = verdicts(report)
        .iter()
        .map(|v| {
            format!(
                "<div class=\"card {}\"><span>{}</span> <b>{}</b><br><span class=\"soft\">{}</span></div>",
                v.answer,
                v.question,
                v.answer,
                escape(&v.figures)
            )
        })
        .collect();
    let sections = [
        ("What came out", portrait(&report.portrait)),
        ("Figures", figures(report)),
        ("One place, before and after", before_and_after(report)),
        (
            "Nearest distances, in spacings",
            chart::histograms(
                "histograms of nearest distances: input, seeds and output",
                &[
                    ("input", &report.histogram_input),
                    ("seeds", &report.histogram_seeds),
                    ("output", &report.histogram),
                ],
                SPANNED,
            ) + "<p class=\"legend\"><span class=\"input\"></span> input \
                 <span class=\"seeds\"></span> seeds \
                 <span class=\"output\"></span> output</p>",
        ),
        (
            "δ by iteration",
            chart::line("δ by iteration", &report.convergence),
        ),
        (
            "Distances between input and output, in spacings",
            distances(report),
        ),
        ("The area", map::map(&report.area, &report.tiles)),
        ("Where it is least even", worst(&report.worst)),
        ("Tiles, coloured by δ", tile_map(&report.tiles)),
        ("Seams", seams(report)),
        ("Time and memory", stages(report)),
        ("Inputs", inputs(report)),
        (
            "Settings",
            table(
                &["option", "value"],
                report
                    .settings
                    .iter()
                    .map(|(k, v)| vec![k.clone(), v.clone()]),
            ),
        ),
        ("Notes", notes(report)),
    ];
    let body: String = sections
        .iter()
        .filter(|(_, content)| !content.is_empty())
        .map(|(title, content)| format!("<section><h2>{title}</h2>{content}</section>"))
        .collect();
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>lloydar report</title><style>{STYLE}</style></head><body><main>\
         <h1>{} points, {} apart</h1><p class=\"soft\">{} · lloydar {}</p>\
         <div class=\"cards\">{cards}</div>{body}</main></body></html>\n",
        thousands(report.points),
        figure(report.spacing),
        escape(&report.output),
        report.version
    )
}

fn figures(report: &Report) -> String {
    let row = |name: &str, of: &dyn Fn(&Uniformity) -> f64| {
        vec![
            name.to_owned(),
            figure(of(&report.seeds)),
            figure(of(&report.uniformity)),
        ]
    };
    let uniformity = [
        row("δ", &|u| u.delta),
        row("δ without the largest 1 %", &|u| u.delta_trimmed),
        row("energy over hexagonal (1 is ideal)", &|u| u.energy_ratio),
        row("cell-area CV", &|u| u.cell_area_cv),
        row("packing", &|u| u.packing),
        row("share of six neighbours", &|u| u.six_neighbors),
        row("mean nearest distance", &|u| u.mean),
        row("smallest over mean", &|u| u.min),
        row("p1 over mean", &|u| u.p1),
        row("p99 over mean", &|u| u.p99),
        row("σ over mean", &|u| u.sigma_over_mean),
        row("ε", &|u| u.epsilon),
        vec![
            "alone within four spacings: in none of these".to_owned(),
            thousands(report.seeds.alone),
            thousands(report.uniformity.alone),
        ],
    ];
    let distances = [
        ("output to input", &report.accuracy),
        ("input to output", &report.coverage),
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
    table(&["", "seeds", "output"], uniformity.into_iter())
        + &table(
            &["distance", "mean", "p99", "max", "beyond 1.5 spacings"],
            distances.into_iter(),
        )
}

/// The picture of what came out.
fn portrait(png: &[u8]) -> String {
    match png.is_empty() {
        true => String::new(),
        false => format!(
            "<img class=\"portrait\" alt=\"the output, drawn from above and aslant\" \
             src=\"data:image/png;base64,{}\">",
            base64::engine::general_purpose::STANDARD.encode(png)
        ),
    }
}

/// The least even places, each with a picture.
fn worst(places: &[WorstRow]) -> String {
    let cards: String = places
        .iter()
        .map(|worst| {
            let [x, y, z] = worst.place;
            format!(
                "<figure>{}<figcaption>δ {} around {x:.2}, {y:.2}, {z:.2}</figcaption></figure>",
                chart::before_and_after(&worst.detail),
                figure(worst.delta),
            )
        })
        .collect();
    match cards.is_empty() {
        true => cards,
        false => format!(
            "<p class=\"soft\">The squares of the map with the largest δ, each around its oddest \
             point: before and after, from above.</p><div class=\"places\">{cards}</div>"
        ),
    }
}

/// Tiles as seen from above.
fn tile_map(tiles: &[TileRow]) -> String {
    let fold = |of: &dyn Fn(&TileRow) -> f64, with: fn(f64, f64) -> f64, from: f64| {
        tiles
            .iter()
            .map(of)
            .filter(|v| v.is_finite())
            .fold(from, with)
    };
    let (west, south) = (
        fold(&|t| t.min[0], f64::min, f64::INFINITY),
        fold(&|t| t.min[1], f64::min, f64::INFINITY),
    );
    let (east, north) = (
        fold(&|t| t.max[0], f64::max, f64::NEG_INFINITY),
        fold(&|t| t.max[1], f64::max, f64::NEG_INFINITY),
    );
    if tiles.is_empty() || !(east > west && north > south) {
        return String::new();
    }
    let (low, high) = (
        fold(&|t| t.delta, f64::min, f64::INFINITY),
        fold(&|t| t.delta, f64::max, 0.0),
    );
    let scale = 1000.0 / (east - west).max(north - south);
    let rects: String = tiles
        .iter()
        .map(|tile| {
            let share = ((tile.delta - low) / (high - low).max(1e-12)).clamp(0.0, 1.0);
            // From blue, even, to orange, uneven; lighter towards the middle.
            let hue = if tile.delta.is_finite() { 210.0 - 180.0 * share } else { 0.0 };
            format!(
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
                 fill=\"hsl({hue:.0} 60% 50%)\"><title>tile {}: δ {}, {} points out of {}, {:.1} s</title></rect>",
                (tile.min[0] - west) * scale,
                (north - tile.max[1]) * scale,
                (tile.max[0] - tile.min[0]) * scale,
                (tile.max[1] - tile.min[1]) * scale,
                tile.id,
                figure(tile.delta),
                thousands(tile.sites),
                thousands(tile.points),
                tile.seconds
            )
        })
        .collect();
    format!(
        "<svg class=\"map\" viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" aria-label=\"map of tiles\">{rects}</svg>\
         <p class=\"soft\">blue: δ {} – orange: δ {}; hover for figures</p>",
        (east - west) * scale,
        (north - south) * scale,
        figure(low),
        figure(high)
    )
}

/// The place from above, and the way to the viewer.
fn before_and_after(report: &Report) -> String {
    if report.excerpt.after.is_empty() {
        return detail(&report.detail);
    }
    let name = Path::new(&report.output).file_name().unwrap_or_default();
    let page = format!("{}{VIEWER_PAGE}", name.to_string_lossy());
    detail(&report.detail)
        + &format!(
            "<p><a class=\"viewer\" href=\"{}\">Walk around a place in three dimensions, before and \
             after</a> <span class=\"soft\">({}, beside this page)</span></p>",
            escape(&in_address(&page)),
            escape(&page)
        )
}

/// A file's name as part of an address.
fn in_address(name: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes()
        .map(|byte| match is_plain(byte) {
            true => char::from(byte).to_string(),
            false => format!("%{byte:02X}"),
        })
        .collect()
}

fn detail(detail: &DetailView) -> String {
    if detail.after.is_empty() {
        return "<p>nothing to see</p>".into();
    }
    let choice = if detail.shown_share < 1.0 {
        format!(" ({:.0} % of the points)", 100.0 * detail.shown_share)
    } else {
        String::new()
    };
    chart::before_and_after(detail)
        + &format!(
            "<p class=\"soft\">{0} × {0} spacings from above: the input{choice}, and the output; \
             coloured by height</p>",
            detail.side
        )
}

fn seams(report: &Report) -> String {
    let seams = &report.seams;
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
        "<p>{} sites were solved by several tiles; {} of them agree to the bit, {} were decided \
             by their owner; the largest disagreement is {}. {:.2} % of all sites are exact: their \
             tile saw everything they depend on.</p>",
        thousands(seams.shared),
        thousands(seams.identical),
        thousands(seams.resolved_by_owner),
        figure(seams.largest_disagreement),
        100.0 * report.exact
    )
}

/// How near the output is to the input, and how well it covers it.
fn distances(report: &Report) -> String {
    let (accuracy, coverage) = (&report.histogram_accuracy, &report.histogram_coverage);
    // Of each its share: there are many more points in than out.
    let shares = |counts: &[u64]| -> Vec<u64> {
        let all: u64 = counts.iter().sum();
        let share = |&count: &u64| (1e6 * count as f64 / all.max(1) as f64) as u64;
        counts.iter().map(share).collect()
    };
    chart::histograms(
        "histograms of distances: input to output and output to input",
        &[("input", &shares(coverage)), ("output", &shares(accuracy))],
        SPANNED,
    ) + "<p class=\"legend\"><span class=\"input\"></span> from the input to the output: coverage \
         <span class=\"output\"></span> from the output to the input: accuracy</p>\
         <p class=\"soft\">shares of all points; the last bar is two spacings and more</p>"
}

fn stages(report: &Report) -> String {
    let mebibytes = |bytes: u64| format!("{} MiB", thousands(bytes.div_ceil(1 << 20)));
    let rows = report.stages.iter().map(|stage| {
        vec![
            stage.stage.clone(),
            format!("{:.2}", stage.seconds),
            stage.peak.map_or("–".into(), mebibytes),
        ]
    });
    let peak = report.memory_peak.map_or("–".into(), mebibytes);
    chart::over_time(&report.over_time, &report.stages, report.memory_budget)
        + &format!(
            "<p class=\"legend\"><span class=\"output\"></span> memory, up to {peak} of {}{} \
             <span class=\"seeds\"></span> temporary files, up to {}</p>",
            mebibytes(report.memory_budget),
            match report.memory_peak {
                Some(peak) if 1.2 * peak as f64 >= report.memory_budget as f64 => " (dashed)",
                _ => "",
            },
            mebibytes(report.temporary_peak)
        )
        + &table(&["stage", "seconds", "peak memory so far"], rows)
}

fn inputs(report: &Report) -> String {
    let rows = report.inputs.iter().map(|input| {
        vec![
            input.path.clone(),
            thousands(input.claimed),
            thousands(input.read),
            thousands(input.filtered),
            thousands(input.rejected),
            thousands(input.outside),
            match &input.left_out {
                Some(reason) => format!("left out: {reason}"),
                None if input.rejected + input.outside > 0 => "look".to_owned(),
                None => "whole".to_owned(),
            },
        ]
    });
    let names = [
        "file",
        "claimed",
        "read",
        "left out as asked",
        "rejected",
        "outside its bounds",
        "verdict",
    ];
    table(&names, rows)
}

fn notes(report: &Report) -> String {
    let items: String = report
        .notes
        .iter()
        .map(|note| format!("<li>{}</li>", escape(note)))
        .collect();
    if items.is_empty() {
        items
    } else {
        format!("<ul>{items}</ul>")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        let cell = table(&["a"], [vec!["<script>&\"".to_owned()]].into_iter());
        assert!(cell.contains("&lt;script&gt;&amp;&quot;") && !cell.contains("<script>"));
    }

    #[test]
    fn a_name_can_be_any_part_of_an_address() {
        assert_eq!(in_address("a b#ü.laz"), "a%20b%23%C3%BC.laz");
    }

    #[test]
    fn a_map_of_nothing_is_nothing() {
        assert_eq!(tile_map(&[]), "");
    }
}
