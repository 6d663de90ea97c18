//! What a run takes: seconds, memory and disk, by stage and over time.

use std::{
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::Scope,
    time::{Duration, Instant},
};

use crossbeam::channel::{self, RecvTimeoutError, Sender};
use serde::{Deserialize, Serialize};

use crate::job::{
    Progress, Standing,
    directory::bytes_in,
    forecast::Forecast,
    memory::{peak_resident, resident},
};

/// Time and memory of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageCost {
    /// The stage.
    pub(crate) stage: String,
    /// Seconds that it took in this run.
    pub(crate) seconds: f64,
    /// Most memory held until its end, in bytes.
    pub(crate) peak: Option<u64>,
}

/// What was held at a moment of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResourceSample {
    /// Seconds since the run began.
    pub(crate) seconds: f64,
    /// Memory, in bytes; nothing where the system does not tell.
    pub(crate) memory: Option<u64>,
    /// Files in the job directory, in bytes.
    pub(crate) disk: u64,
}

impl ResourceSample {
    fn now(start: Instant, dir: &Path) -> Self {
        Self {
            seconds: start.elapsed().as_secs_f64(),
            memory: resident(),
            disk: bytes_in(dir, |_| true),
        }
    }
}

/// How often is looked.
const TICK: Duration = Duration::from_millis(250);
/// Moments that are kept: when there are more, every other one goes.
const MOST_HELD: usize = 400;

/// Times the stages of a run, and looks now and then at what it holds.
pub(crate) struct Clock {
    start: Instant,
    last: Instant,
    stages: Vec<StageCost>,
    held: Arc<Mutex<Series>>,
    /// Dropped, it ends the watch.
    watch: Option<Sender<()>>,
}

/// Moments at equal distances in time.
#[derive(Debug)]
struct Series {
    held: Vec<ResourceSample>,
    stride: u32,
    ticks: u32,
}

impl Series {
    fn new() -> Self {
        Self {
            held: Vec::new(),
            stride: 1,
            ticks: 0,
        }
    }

    fn push(&mut self, held: ResourceSample) {
        if self.ticks.is_multiple_of(self.stride) {
            self.held.push(held);
        }
        self.ticks += 1;
        if self.held.len() > MOST_HELD {
            let mut place = 0;
            self.held.retain(|_| {
                place += 1;
                place % 2 == 1
            });
            self.stride *= 2;
        }
    }
}

impl Clock {
    pub(crate) fn new() -> Self {
        let start = Instant::now();
        Self {
            start,
            last: start,
            stages: Vec::new(),
            held: Arc::new(Mutex::new(Series::new())),
            watch: None,
        }
    }

    /// DisplayAttributes from now on, in a thread of its own, at the memory and at the files in `dir`,
    /// and tells the listener of `forecast` where the run stands.
    pub(crate) fn watch<'scope, 'env: 'scope>(
        &mut self,
        scope: &'scope Scope<'scope, 'env>,
        dir: &'env Path,
        budget: u64,
        forecast: &'env Forecast<'env>,
    ) {
        let (watch, ended) = channel::bounded::<()>(0);
        let (start, held) = (self.start, Arc::clone(&self.held));
        scope.spawn(move || {
            while ended.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                let now = ResourceSample::now(start, dir);
                lock(&held).push(now);
                forecast.standing(&Standing {
                    memory: now.memory,
                    budget,
                    remaining: forecast.remaining(),
                });
            }
        });
        self.watch = Some(watch);
    }

    /// A stage has come to its end.
    pub(crate) fn stop(&mut self, stage: &str) {
        self.stages.push(StageCost {
            stage: stage.to_owned(),
            seconds: self.last.elapsed().as_secs_f64(),
            peak: peak_resident(),
        });
        self.last = Instant::now();
    }

    /// The stages, and what was held over time, now that all is done in `dir`.
    pub(crate) fn costs(self, dir: &Path) -> (Vec<StageCost>, Vec<ResourceSample>) {
        let mut held = lock(&self.held).held.clone();
        held.push(ResourceSample::now(self.start, dir));
        (self.stages, held)
    }
}

fn lock(held: &Mutex<Series>) -> MutexGuard<'_, Series> {
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_is_kept_in_bounded_room_from_end_to_end() {
        let mut series = Series::new();
        for second in 0..10_000 {
            series.push(ResourceSample {
                seconds: f64::from(second),
                memory: None,
                disk: 0,
            });
        }
        let held = &series.held;
        assert!((MOST_HELD / 2..=MOST_HELD).contains(&held.len()));
        let step = held[1].seconds - held[0].seconds;
        assert!(held.windows(2).all(|w| w[1].seconds - w[0].seconds == step));
        assert!(held[0].seconds == 0.0 && held[held.len() - 1].seconds > 9_900.0);
    }
}
