//! How even the points of several methods are, on clouds of many kinds: the
//! tables of `docs/RESULTS.md`. `scripts/quality` runs it.
//!
//!     cargo bench --bench quality -- [--scans DIR] [--only NAME] [--ours] [--curves DIR]
//!         [--blame FILE.svg]
//!
//! `--ours` leaves out all methods but lloydar's and Poisson thinning; `--curves`
//! compares accelerations instead, and draws δ against iterations; `--blame`
//! draws the sites that decide δ.

#![allow(clippy::print_stdout, reason = "prints its tables")]

mod blame;
mod clouds;
mod curves;
mod methods;

use std::path::PathBuf;

use clouds::{Cloud, Surface};
use methods::{Method, Outcome};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let place = arguments.iter().position(|a| a == name)?;
        arguments.get(place + 1).cloned()
    };
    let only = value("--only").unwrap_or_default();
    let methods: &[Method] = if arguments.iter().any(|a| a == "--ours") {
        &[Method::Ours, Method::Poisson]
    } else {
        &Method::ALL
    };
    let folder = value("--scans").map(PathBuf::from);
    let clouds = || {
        let wanted = |(name, _): &(String, Maker)| name.contains(&only);
        let all = named(folder.as_deref()).into_iter().filter(wanted);
        all.filter_map(|(name, make)| Some((name, make()?)))
    };
    if let Some(pictures) = value("--curves") {
        clouds().for_each(|(name, cloud)| curves::compare(&cloud, &name, pictures.as_ref()));
        return;
    }
    if let Some(picture) = value("--blame") {
        clouds().for_each(|(_, cloud)| blame::draw(&cloud, picture.as_ref()));
        return;
    }
    println!(
        "| cloud | method | n | δ | δ trimmed | σ/d̄ | 1 − ε | energy | area CV | packing | six | min | p1 | \
         p99 | accuracy mean | p99 | at edges | energy on planes | coverage p99 | astray | held | open | s |"
    );
    println!("|{}", " --- |".repeat(23));
    for (_, cloud) in clouds() {
        // The same length for all methods.
        let unit = methods::spacing(&cloud, Method::Ours);
        for &method in methods.iter().filter(|method| method.can(&cloud)) {
            print_row(&cloud, method, unit);
        }
    }
}

type Maker = Box<dyn Fn() -> Option<Cloud>>;

fn named(folder: Option<&std::path::Path>) -> Vec<(String, Maker)> {
    let mut all: Vec<(String, Maker)> = Vec::new();
    let mut push = |name: &str, make: Maker| all.push((name.into(), make));
    for surface in Surface::ALL {
        push(
            &format!("even {surface:?}"),
            Box::new(move || Some(clouds::even(surface, 300_000, 10_000))),
        );
    }
    for surface in Surface::ALL {
        push(
            &format!("white {surface:?}"),
            Box::new(move || Some(clouds::even(surface, 30_000, 10_000))),
        );
    }
    push("uneven", Box::new(|| Some(clouds::uneven())));
    push("sheet", Box::new(|| Some(clouds::sheet())));
    push(
        "street",
        Box::new(|| Some(clouds::street(5_000_000, 100_000))),
    );
    push("station", Box::new(|| Some(clouds::station())));
    push("upsampled", Box::new(|| Some(clouds::upsampled())));
    push("noisy", Box::new(|| Some(clouds::noisy())));
    if let Some(folder) = folder {
        let igea = folder.join("objects/igea.ply");
        push("white igea", Box::new(move || clouds::white_noise(&igea)));
        for path in clouds::scans(folder) {
            for ratio in [20, 100] {
                let (name, path) = (format!("scan {} {ratio}", path.display()), path.clone());
                push(&name, Box::new(move || clouds::scan(&path, ratio)));
            }
        }
    }
    all
}

/// Prints what `method` makes of `cloud`; distances to truth and scan in multiples of `unit` (CRS units).
fn print_row(cloud: &Cloud, method: Method, unit: f64) {
    let spacing = methods::spacing(cloud, method);
    let Outcome {
        seconds,
        figures: f,
        accuracy,
        coverage,
        at_edges,
        on_planes,
        astray,
        held,
        open,
    } = methods::run(cloud, method, spacing);
    println!(
        "| {} | {} | {} | {:.4} | {:.4} | {:.4} | {:.4} | {:.4} | {:.4} | {:.4} | {:.3} | {:.3} | {:.3} | {:.3} | \
         {:.3} h | {:.3} h | {:.4} h | {on_planes:.4} | {:.2} h | {astray} | {held:.2} | {open:.2} | {seconds:.1} |",
        cloud.name,
        method.name(),
        f.count,
        f.delta,
        f.delta_trimmed,
        f.sigma_over_mean,
        1.0 - f.epsilon,
        f.energy_ratio,
        f.cell_area_cv,
        f.packing,
        f.six_neighbors,
        f.min,
        f.p1,
        f.p99,
        accuracy.mean / unit,
        accuracy.p99 / unit,
        at_edges.mean / unit,
        coverage.p99 / unit,
    );
}
