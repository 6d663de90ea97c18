//! Which sites decide δ: a top view of a cloud, with the sites in red that make
//! up half of δ².

use std::{fmt::Write as _, path::Path};

use lloydar::internals::{Site, TileRegion, solve};

use crate::{
    clouds::Cloud,
    methods::{self, Method},
};

/// Most sites drawn of each kind.
const MOST: usize = 4000;
/// Longer side of the picture, in pixels.
const SIZE: f64 = 1000.0;

/// Draws `cloud` to `path`, and says how few sites make up half of δ².
pub(crate) fn draw(cloud: &Cloud, path: &Path) {
    let options = Method::Ours.solver_options(cloud, methods::spacing(cloud, Method::Ours));
    let solution = solve(
        &methods::scan(cloud, &options),
        &TileRegion::everything(),
        &options,
    );
    let known = |site: &&Site| site.nearest.is_finite();
    let mut sites: Vec<&Site> = solution.sites.iter().filter(known).collect();
    let count = sites.len() as f64;
    let mean = sites.iter().map(|site| site.nearest).sum::<f64>() / count;
    let off = |site: &Site| (site.nearest - mean).powi(2);
    sites.sort_by(|a, b| off(b).total_cmp(&off(a)));
    let total: f64 = sites.iter().map(|site| off(site)).sum();
    let mut sum = 0.0;
    let half = sites.iter().take_while(|site| {
        sum += off(site);
        sum <= 0.5 * total
    });
    let half = half.count() + 1;
    let (worst, rest) = sites.split_at(half);
    println!(
        "{}: {:.2} % of the sites make up half of δ²; {:.0} % of those are farther from their neighbours than the mean",
        cloud.name,
        100.0 * half as f64 / count,
        100.0 * worst.iter().filter(|s| s.nearest > mean).count() as f64 / half as f64,
    );

    let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        let all = sites.iter().map(|site| site.position[axis]);
        all.fold(start, pick)
    };
    let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY));
    let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
    let scale = SIZE / (high[0] - low[0]).max(high[1] - low[1]);
    let [width, height] = [0, 1].map(|axis| (high[axis] - low[axis]) * scale);
    let mut picture = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-5 -5 {:.0} {:.0}\">\
         <rect x=\"-5\" y=\"-5\" width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        width + 10.0,
        height + 10.0
    );
    for (sites, color, radius) in [(rest, "#b0b8c0", 0.8), (worst, "#c02020", 1.6)] {
        let _ = writeln!(picture, "<g fill=\"{color}\">");
        for site in sites.iter().step_by(sites.len().div_ceil(MOST).max(1)) {
            let x = (site.position.x - low[0]) * scale;
            let y = height - (site.position.y - low[1]) * scale;
            let _ = writeln!(
                picture,
                "<circle cx=\"{x:.0}\" cy=\"{y:.0}\" r=\"{radius}\"/>"
            );
        }
        picture.push_str("</g>\n");
    }
    picture.push_str("</svg>\n");
    std::fs::write(path, picture).expect("the picture can be written");
}
