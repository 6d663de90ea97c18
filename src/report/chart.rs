//! Charts as SVG, in the colours of the page.

use super::{numbers::figure, wording::stage_title};
use crate::{
    job::{ResourceSample, StageCost},
    views::DetailView,
};

/// The width of a chart, in units of the drawing, as all lengths here.
const WIDTH: f64 = 640.0;
/// The height of a chart.
const HEIGHT: f64 = 220.0;
/// The width of the margin for the numbers on the left.
const LEFT: f64 = 52.0;
/// The height of the margin for the numbers below.
const BOTTOM: f64 = 30.0;

/// Returns a chart with a horizontal axis.
fn frame(title: &str, body: &str, x_label: &str) -> String {
    format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\
         <line class=\"axis\" x1=\"{LEFT}\" y1=\"{y}\" x2=\"{WIDTH}\" y2=\"{y}\"/>{body}\
         <text x=\"{x}\" y=\"{t}\" text-anchor=\"middle\">{x_label}</text></svg>",
        y = HEIGHT - BOTTOM,
        x = LEFT + 0.5 * (WIDTH - LEFT),
        t = HEIGHT - 4.0,
    )
}

/// Returns histograms over the same bins, each with the class of its bars, the last in front.
pub(super) fn histograms(title: &str, all: &[(&str, &[u64])], spanned: f64) -> String {
    let counts = all.iter().flat_map(|(_, counts)| counts.iter().copied());
    let most = counts.max().unwrap_or(0).max(1) as f64;
    let bins = all
        .iter()
        .map(|(_, counts)| counts.len())
        .max()
        .unwrap_or(0);
    let step = (WIDTH - LEFT) / bins.max(1) as f64;
    let bars = |counts: &[u64], class: &str| -> String {
        (0..)
            .zip(counts)
            .filter(|&(_, &count)| count > 0)
            .map(|(bin, &count): (u32, &u64)| {
                let height = count as f64 / most * (HEIGHT - BOTTOM - 8.0);
                format!(
                    "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\"/>",
                    LEFT + f64::from(bin) * step,
                    HEIGHT - BOTTOM - height,
                    step - 0.6,
                )
            })
            .collect()
    };
    let ticks: String = (0..=4)
        .map(|k| {
            let share = f64::from(k) / 4.0;
            format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                LEFT + share * (WIDTH - LEFT - 12.0),
                HEIGHT - BOTTOM + 13.0,
                share * spanned
            )
        })
        .collect();
    let body: String = all
        .iter()
        .map(|(class, counts)| bars(counts, class))
        .collect();
    frame(title, &(body + &ticks), "")
}

/// Returns a line through `values`, one for each iteration.
pub(super) fn line(title: &str, values: &[f64]) -> String {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(0.0, f64::max),
    );
    if !low.is_finite() {
        return frame(title, "", "");
    }
    let span = (high - low).max(1e-9);
    let y = |v: f64| 12.0 + (high - v) / span * (HEIGHT - BOTTOM - 24.0);
    let step = (WIDTH - LEFT - 12.0) / (values.len().max(2) - 1) as f64;
    let points: Vec<String> = (0u32..)
        .zip(values)
        .filter(|(_, v)| v.is_finite())
        .map(|(k, &v)| format!("{:.1},{:.1}", LEFT + f64::from(k) * step, y(v)))
        .collect();
    let body = format!(
        "<polyline class=\"line\" points=\"{}\"/>\
         <text x=\"{l}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\
         <text x=\"{l}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
        points.join(" "),
        y(high) + 4.0,
        figure(high),
        y(low) + 4.0,
        figure(low),
        l = LEFT - 6.0,
    );
    frame(title, &body, "iteration")
}

/// Returns memory and temporary files over time, each up to its own peak, with the stages below
/// them, and the memory budget if it is near the peak.
pub(super) fn over_time(samples: &[ResourceSample], stages: &[StageCost], budget: u64) -> String {
    let whole: f64 = stages.iter().map(|stage| stage.seconds).sum();
    let whole = samples.last().map_or(whole, |last| last.seconds.max(whole));
    let memory = |sample: &ResourceSample| sample.memory.unwrap_or(0);
    let most = |of: &dyn Fn(&ResourceSample) -> u64| {
        samples.iter().map(of).max().unwrap_or(0).max(1) as f64
    };
    let (top, floor) = (14.0, HEIGHT - BOTTOM);
    let x = |seconds: f64| LEFT + seconds / whole * (WIDTH - LEFT);
    // A fifth is left above the peak, for a budget that was nearly reached.
    let y = |share: f64| floor - share / 1.2 * (floor - top);
    let curve = |of: &dyn Fn(&ResourceSample) -> u64, class: &str| {
        let most = most(of);
        let points: Vec<String> = samples
            .iter()
            .map(|h| format!("{:.1},{:.1}", x(h.seconds), y(of(h) as f64 / most)))
            .collect();
        let points = points.join(" ");
        format!("<polyline class=\"line {class}\" points=\"{points}\"/>")
    };
    let share = budget as f64 / most(&memory);
    let limit = match share <= 1.2 {
        true => format!(
            "<line class=\"limit\" x1=\"{LEFT}\" x2=\"{WIDTH}\" y1=\"{0:.1}\" y2=\"{0:.1}\"/>",
            y(share)
        ),
        false => String::new(),
    };
    let mut from = 0.0;
    let bands: String = stages
        .iter()
        .map(|stage| {
            let start = from;
            from += stage.seconds;
            // A name that does not fit stands in the table only.
            let name = match stage.seconds / whole * (WIDTH - LEFT) > 44.0 {
                true => format!(
                    "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                    x(start) + 3.0,
                    floor + 14.0,
                    stage_title(&stage.stage)
                ),
                false => String::new(),
            };
            format!(
                "<line class=\"axis\" x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{top}\" y2=\"{1:.1}\"/>{name}",
                x(from),
                floor + 18.0
            )
        })
        .collect();
    let curves = curve(&memory, "memory") + &curve(&|sample| sample.disk, "disk");
    frame(
        "memory and temporary files over time",
        &(bands + &curves + &limit),
        "",
    )
}

/// Returns a square from above, before and after, side by side.
pub(super) fn before_and_after(detail: &DetailView) -> String {
    let panel = 0.5 * (WIDTH - 16.0);
    let scale = panel / detail.side;
    let highest = |points: &[[f64; 3]]| points.iter().map(|p| p[2]).fold(0.0, f64::max);
    let height = highest(&detail.before).max(highest(&detail.after)).max(1.0);
    let dots = |points: &[[f64; 3]], west: f64, radius: f64| -> String {
        points
            .iter()
            .map(|[x, y, z]| {
                // From blue over green to yellow, dark to light.
                let share = z / height;
                format!(
                    "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"hsl({:.0} 60% {:.0}%)\"/>",
                    west + x * scale,
                    panel - y * scale,
                    240.0 - 190.0 * share,
                    45.0 + 20.0 * share,
                )
            })
            .collect()
    };
    format!(
        "<svg viewBox=\"0 0 {WIDTH} {panel}\" role=\"img\" \
         aria-label=\"a square before and after\">{}{}</svg>",
        dots(&detail.before, 0.0, 1.0),
        dots(&detail.after, panel + 16.0, 0.14 * scale),
    )
}
