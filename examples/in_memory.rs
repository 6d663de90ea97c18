//! Resamples points in memory, and takes an attribute of the input along.
//!
//! `cargo run --release --no-default-features --example in_memory`

#![expect(clippy::print_stdout, reason = "an example prints")]

use lloydar::{Options, ResampleError, resample};

fn main() -> Result<(), ResampleError> {
    // A wavy sheet of 10 × 10, scanned by a million points, coloured by height.
    let scan: Vec<[f64; 3]> = (0..1_000_000)
        .map(|i| {
            let (x, y) = ((i % 1000) as f64 * 0.01, (i / 1000) as f64 * 0.01);
            [x, y, 0.3 * (x.sin() + (0.7 * y).cos())]
        })
        .collect();
    let color: Vec<u8> = scan
        .iter()
        .map(|point| (128.0 + 200.0 * point[2]) as u8)
        .collect();

    let even = resample(&scan, &Options::with_spacing(0.1).fill(0.0))?;

    let color: Vec<u8> = even.source.iter().map(|&nearest| color[nearest]).collect();
    let closed = (0..even.points.len()).filter(|&index| even.ring(index).is_closed);
    println!("{} points, {} colours", even.points.len(), color.len());
    println!("{} of them have neighbours all around", closed.count());
    println!("cell-area CV {:.3}", even.uniformity.cell_area_cv);
    println!("energy ratio {:.4}", even.uniformity.energy_ratio);
    Ok(())
}
