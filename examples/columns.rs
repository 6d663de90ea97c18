//! Resamples columns of coordinates, as laspy and numpy have them, to a count, in a thread pool of the
//! caller's, with progress.
//!
//! `cargo run --release --no-default-features --example columns`

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints"
)]

use std::{error::Error, ops::ControlFlow};

use lloydar::{Options, resample_with_progress};

/// A scan by columns: integers on a scale and an offset, and an attribute.
struct Columns {
    x: Vec<i32>,
    y: Vec<i32>,
    z: Vec<i32>,
    classification: Vec<u8>,
    scale: f64,
    offset: [f64; 3],
}

/// A kerb of 30 m × 6 m: a road, and a pavement 12 cm above it.
fn kerb() -> Columns {
    let (columns, rows) = (1500, 300);
    let on_pavement = |index: i32| index / columns >= rows / 2;
    let indices = 0..columns * rows;
    Columns {
        x: indices.clone().map(|index| index % columns * 20).collect(),
        y: indices.clone().map(|index| index / columns * 20).collect(),
        z: indices
            .clone()
            .map(|index| if on_pavement(index) { 120 } else { 0 })
            .collect(),
        classification: indices
            .map(|index| if on_pavement(index) { 6 } else { 2 })
            .collect(),
        scale: 0.001,
        offset: [500_000.0, 5_000_000.0, 300.0],
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let scan = kerb();
    // Columns in any order are zipped to x, y, z.
    let world = |axis: usize, stored: &i32| scan.offset[axis] + scan.scale * f64::from(*stored);
    let points = scan
        .x
        .iter()
        .zip(&scan.y)
        .zip(&scan.z)
        .map(|((x, y), z)| [world(0, x), world(1, y), world(2, z)]);

    let options = Options::with_count(5000).scale(scan.scale);
    let progress = |share: f64| {
        eprintln!("{:3.0} %", 100.0 * share);
        ControlFlow::Continue(())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let even = pool.install(|| resample_with_progress(points, &options, &progress))?;

    let classes = even
        .source
        .iter()
        .map(|&nearest| scan.classification[nearest]);
    let on_pavement = classes.filter(|&class| class == 6).count();
    println!("{} points {:.3} apart", even.points.len(), even.spacing);
    println!("{on_pavement} of them on the pavement");
    Ok(())
}
