//! Seconds of the stages of a run, and samples of its memory and disk over time.

use std::{
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::Scope,
    time::{Duration, Instant},
};

use crossbeam::channel::{self, RecvTimeoutError, Sender};
use serde::{Deserialize, Serialize};

use super::{
    forecast::Forecast,
    memory::{peak_resident, resident},
};
use crate::job::{
    directory::bytes_in,
    progress::{Progress, Standing},
};

/// Time and memory of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageCost {
    /// Name of the stage.
    pub(crate) stage: String,
    /// Seconds of the stage in this run.
    pub(crate) seconds: f64,
    /// Largest resident memory of the run until the end of the stage, in bytes.
    pub(crate) peak: Option<u64>,
}

/// Resident memory and temporary files of a run at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResourceSample {
    /// Seconds since the run began.
    pub(crate) seconds: f64,
    /// Resident memory in bytes; `None` where the system does not report it.
    pub(crate) memory: Option<u64>,
    /// Bytes of the files in the job directory.
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

/// Time between two samples of memory and disk.
const SAMPLING_INTERVAL: Duration = Duration::from_millis(250);
/// Number of samples beyond which every other one is dropped.
const SAMPLE_LIMIT: usize = 400;

/// Times the stages of a run, and samples its memory and its temporary files.
pub(crate) struct Clock {
    start: Instant,
    stages: Mutex<Stages>,
    samples: Arc<Mutex<SampleSeries>>,
    /// The sampling thread ends when this is dropped.
    sampling: Mutex<Option<Sender<()>>>,
}

/// The stages that have ended.
struct Stages {
    /// The end of the last stage.
    last: Instant,
    costs: Vec<StageCost>,
}

/// Samples at equal distances in time.
#[derive(Debug)]
struct SampleSeries {
    samples: Vec<ResourceSample>,
    stride: u32,
    ticks: u32,
}

impl SampleSeries {
    fn new() -> Self {
        Self {
            samples: Vec::new(),
            stride: 1,
            ticks: 0,
        }
    }

    fn push(&mut self, sample: ResourceSample) {
        if self.ticks.is_multiple_of(self.stride) {
            self.samples.push(sample);
        }
        self.ticks += 1;
        if self.samples.len() > SAMPLE_LIMIT {
            let mut number = 0;
            self.samples.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.stride *= 2;
        }
    }
}

impl Clock {
    /// Starts the clock. A thread of `scope` samples the memory and the files in `dir` from now
    /// on, and reports to the listener of `forecast` where the run stands in its `budget` of bytes.
    pub(crate) fn start<'scope, 'env: 'scope>(
        scope: &'scope Scope<'scope, 'env>,
        dir: &'env Path,
        budget: u64,
        forecast: &'env Forecast<'env>,
    ) -> Self {
        let start = Instant::now();
        let samples = Arc::new(Mutex::new(SampleSeries::new()));
        let (sampling, ended) = channel::bounded::<()>(0);
        let series = Arc::clone(&samples);
        scope.spawn(move || {
            while ended.recv_timeout(SAMPLING_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                let now = ResourceSample::now(start, dir);
                locked(&series).push(now);
                forecast.standing(&Standing {
                    memory: now.memory,
                    budget,
                    remaining: forecast.remaining(),
                });
            }
        });
        Self {
            start,
            stages: Mutex::new(Stages {
                last: start,
                costs: Vec::new(),
            }),
            samples,
            sampling: Mutex::new(Some(sampling)),
        }
    }

    /// Records that `stage` has ended, and that the next one begins.
    pub(crate) fn end_stage(&self, stage: &str) {
        let mut stages = locked(&self.stages);
        let seconds = stages.last.elapsed().as_secs_f64();
        stages.costs.push(StageCost {
            stage: stage.to_owned(),
            seconds,
            peak: peak_resident(),
        });
        stages.last = Instant::now();
    }

    /// Stops sampling. Returns the costs of the stages, and all samples with a last one of now and
    /// of the files in `dir`.
    pub(crate) fn stop(&self, dir: &Path) -> (Vec<StageCost>, Vec<ResourceSample>) {
        locked(&self.sampling).take();
        let mut samples = locked(&self.samples).samples.clone();
        samples.push(ResourceSample::now(self.start, dir));
        (locked(&self.stages).costs.clone(), samples)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_is_kept_in_bounded_room_from_end_to_end() {
        let mut series = SampleSeries::new();
        for second in 0..10_000 {
            series.push(ResourceSample {
                seconds: f64::from(second),
                memory: None,
                disk: 0,
            });
        }
        let samples = &series.samples;
        assert!((SAMPLE_LIMIT / 2..=SAMPLE_LIMIT).contains(&samples.len()));
        let step = samples[1].seconds - samples[0].seconds;
        assert!(
            samples
                .windows(2)
                .all(|w| w[1].seconds - w[0].seconds == step)
        );
        assert!(samples[0].seconds == 0.0 && samples[samples.len() - 1].seconds > 9_900.0);
    }
}
