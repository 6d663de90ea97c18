//! How fast accelerations get there: δ against iterations, and against seconds.

use std::path::Path;

use lloydar::internals::{Acceleration, SeedRule};

use crate::{
    clouds::Cloud,
    methods::{Method, curve, spacing},
};

const COLORS: [&str; 4] = ["#888888", "#0072b2", "#d55e00", "#009e73"];

/// Prints, for Poisson and hexagonal seeds, in how many iterations each
/// acceleration reaches what plain Lloyd reaches in all; draws the curves.
pub(crate) fn compare(cloud: &Cloud, name: &str, pictures: &Path) {
    for rule in [SeedRule::Poisson, SeedRule::Hexagonal] {
        let spacing = spacing(cloud, Method::Ours);
        let all: Vec<(Acceleration, Vec<f64>, f64)> = [
            Acceleration::None,
            Acceleration::Relaxation,
            Acceleration::Anderson,
            Acceleration::AndersonGlobal,
        ]
        .into_iter()
        .map(|acceleration| {
            let (delta, seconds) = curve(cloud, spacing, rule, acceleration);
            (acceleration, delta, seconds)
        })
        .collect();
        let (_, plain, plain_seconds) = &all[0];
        let goal = plain.last().copied().unwrap_or(f64::NAN);
        for (acceleration, delta, seconds) in &all {
            let iterations = (delta.len() - 1) as f64;
            let reached = delta.iter().position(|&d| d <= goal);
            println!(
                "| {} | {rule:?} | {acceleration:?} | {:.4} | {:.4} | {} | {:.2} |",
                cloud.name,
                delta[0],
                delta[delta.len() - 1],
                reached.map_or("never".into(), |k| k.to_string()),
                reached.map_or(f64::NAN, |k| k as f64 / iterations * seconds
                    / plain_seconds),
            );
        }
        let file = format!("{}-{rule:?}.svg", name.replace(' ', "-")).to_lowercase();
        let title = format!("{}, {rule:?} seeds", cloud.name);
        let written = std::fs::write(pictures.join(&file), drawing(&title, &all));
        written.unwrap_or_else(|error| panic!("{file}: {error}"));
    }
}

/// Two charts side by side: against iterations, and against seconds.
fn drawing(title: &str, all: &[(Acceleration, Vec<f64>, f64)]) -> String {
    let values = || all.iter().flat_map(|(_, delta, _)| delta.iter().copied());
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(0.0, f64::max),
    );
    let slowest = all.iter().map(|(.., seconds)| *seconds).fold(0.0, f64::max);
    let y = |delta: f64| 40.0 + (high - delta) / (high - low).max(1e-9) * 180.0;
    let mut body = format!("<text x=\"50\" y=\"20\">δ: {title}</text>");
    for (chart, left) in [50.0, 390.0].into_iter().enumerate() {
        let label = ["iterations", "seconds"][chart];
        body += &format!(
            "<path d=\"M{left} 30V230H{}\" stroke=\"#888\" fill=\"none\"/>\
             <text x=\"{}\" y=\"248\">{label}</text>",
            left + 270.0,
            left + 110.0
        );
        for (row, (acceleration, delta, seconds)) in all.iter().enumerate() {
            let last = (delta.len() - 1) as f64;
            let width = [270.0, 270.0 * seconds / slowest][chart];
            let points: Vec<String> = delta
                .iter()
                .enumerate()
                .map(|(k, &d)| format!("{:.1},{:.1}", left + k as f64 / last * width, y(d)))
                .collect();
            let color = COLORS[row];
            body += &format!(
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"/>",
                points.join(" ")
            );
            if chart == 0 {
                let at = 52.0 + 14.0 * row as f64;
                body +=
                    &format!("<text x=\"190\" y=\"{at}\" fill=\"{color}\">{acceleration:?}</text>");
            }
        }
    }
    for delta in [low, high] {
        body += &format!(
            "<text x=\"4\" y=\"{:.0}\">{delta:.3}</text>",
            y(delta) + 4.0
        );
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 680 256\" font-family=\"sans-serif\" \
         font-size=\"11\"><rect width=\"680\" height=\"256\" fill=\"white\"/>{body}</svg>\n"
    )
}
