//! Pictures of input and output on the page.

use std::path::Path;

use base64::Engine;

use super::{
    chart,
    contents::{Report, WorstRow},
    html::{escape, in_address},
    numbers::figure,
    viewer::VIEWER_PAGE,
};
use crate::views::DetailView;

/// Returns the picture of the output, a PNG; nothing if there is none.
pub(super) fn overview(png: &[u8]) -> String {
    match png.is_empty() {
        true => String::new(),
        false => format!(
            "<img class=\"overview\" alt=\"the output, drawn obliquely from above\" \
             src=\"data:image/png;base64,{}\">",
            base64::engine::general_purpose::STANDARD.encode(png)
        ),
    }
}

/// Returns a square before and after, from above, with a link to the viewer.
pub(super) fn before_and_after(report: &Report) -> String {
    let square = square(&report.views.detail);
    if report.views.viewer_sample.after.is_empty() {
        return square;
    }
    let name = Path::new(&report.run.output).file_name();
    let page = format!(
        "{}{VIEWER_PAGE}",
        name.unwrap_or_default().to_string_lossy()
    );
    format!(
        "{square}<p><a class=\"viewer\" href=\"{}\">3-D viewer: a larger square, input and output \
         side by side</a> <span class=\"soft\">({}, beside this page)</span></p>",
        escape(&in_address(&page)),
        escape(&page)
    )
}

fn square(detail: &DetailView) -> String {
    if detail.after.is_empty() {
        return "<p>The output has no points.</p>".into();
    }
    let sampled = match detail.shown_share < 1.0 {
        true => format!(" ({:.0} % of the points)", 100.0 * detail.shown_share),
        false => String::new(),
    };
    chart::before_and_after(detail)
        + &format!(
            "<p class=\"soft\">{0} × {0} spacings from above: left the input{sampled}, right the \
             output; coloured by height</p>",
            detail.side
        )
}

/// Returns the least even squares, each with a picture; nothing if there are none.
pub(super) fn worst(squares: &[WorstRow]) -> String {
    let cards = squares.iter().map(|worst| {
        let [x, y, z] = worst.position;
        format!(
            "<figure>{}<figcaption>δ {} around {x:.2}, {y:.2}, {z:.2}</figcaption></figure>",
            chart::before_and_after(&worst.detail),
            figure(worst.delta),
        )
    });
    let cards: String = cards.collect();
    match cards.is_empty() {
        true => cards,
        false => format!(
            "<p class=\"soft\">The squares of the map with the largest δ, from above, before and \
             after. Each picture is centred on the point whose nearest distance differs most from \
             the spacing.</p><div class=\"places\">{cards}</div>"
        ),
    }
}
