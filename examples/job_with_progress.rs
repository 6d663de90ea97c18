//! Resamples files that may be larger than memory, with a listener of its own, and can be stopped.
//!
//! `cargo run --release --example job_with_progress -- scan.laz even.laz 0.1`

#![expect(clippy::print_stdout, reason = "an example prints")]

use std::{
    error::Error,
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use lloydar::{
    Job,
    progress::{Progress, Standing, Unit},
};

/// Prints a line whenever another tenth of a stage is done.
#[derive(Default)]
struct Tenths {
    stage: Mutex<String>,
    total: AtomicU64,
    done: AtomicU64,
}

impl Progress for Tenths {
    fn begin(&self, stage: &str, total: u64, done: u64, _: Unit) {
        stage.clone_into(&mut self.stage.lock().expect("no thread panics with it"));
        self.total.store(total.max(1), Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
    }

    fn advance(&self, amount: u64) {
        let before = self.done.fetch_add(amount, Ordering::Relaxed);
        let total = self.total.load(Ordering::Relaxed);
        let tenth = |done: u64| 10 * done / total;
        if tenth(before + amount) > tenth(before) {
            let stage = self.stage.lock().expect("no thread panics with it");
            println!("{stage}: {} %", 10 * tenth(before + amount));
        }
    }

    fn end(&self) {}

    fn note(&self, text: &str) {
        println!("{text}");
    }

    fn standing(&self, _: &Standing) {}
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scan, output, spacing] = arguments.as_slice() else {
        return Err("give a scan, an output and a spacing".into());
    };
    // Any thread may set it: the job then ends within a moment, and goes on when it is run again.
    let cancel = AtomicBool::new(false);
    let job = Job::new([scan], output)
        .spacing(spacing.parse()?)
        .memory(1 << 30);
    match job.run_with_progress(&Tenths::default(), &cancel)? {
        Some(outcome) => println!(
            "{} points, δ {:.4}",
            outcome.points(),
            outcome.uniformity().delta
        ),
        None => println!("{output} is complete already"),
    }
    Ok(())
}
