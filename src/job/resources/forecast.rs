//! The remaining time of a run.
//!
//! Before a stage begins its time is the plan's estimate. While it is at work the share that is done
//! and the seconds that this share took give the rest: t·(1 − s)/(s − s₀), where s₀ is the share
//! that an earlier run had done.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use crate::job::progress::{Progress, Standing, Unit};

/// A listener that passes all reports on to another one, and estimates the remaining time.
pub(crate) struct Forecast<'a> {
    listener: &'a dyn Progress,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The stages ahead in their order, with the expected seconds of each; empty before there is a
    /// plan.
    ahead: Vec<(&'static str, f64)>,
    current: Option<CurrentStage>,
}

/// The stage at work.
struct CurrentStage {
    total: u64,
    done: u64,
    /// The share that an earlier run had done.
    before: f64,
    /// The share that is done.
    share: f64,
    /// Whether the share is reported by the stage, rather than counted in units.
    is_reported: bool,
    /// Expected seconds of the whole stage.
    expected: f64,
    start: Instant,
    last: Instant,
}

impl CurrentStage {
    /// Seconds until the stage is done.
    fn remaining(&self) -> f64 {
        let gained = self.share - self.before;
        let rest = 1.0 - self.share;
        if gained > 0.0 {
            let taken = self.last.duration_since(self.start).as_secs_f64();
            (taken / gained * rest - self.last.elapsed().as_secs_f64()).max(0.0)
        } else {
            (self.expected * rest - self.start.elapsed().as_secs_f64()).max(0.0)
        }
    }

    fn reach(&mut self, share: f64) {
        self.share = share;
        self.last = Instant::now();
        if share <= self.before {
            // The time before the first work, in which the first tile is read, says nothing of the
            // speed.
            self.start = self.last;
        }
    }
}

impl<'a> Forecast<'a> {
    /// A forecast that passes reports on to `listener`.
    pub(crate) fn new(listener: &'a dyn Progress) -> Self {
        Self {
            listener,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the stages ahead, with the expected seconds of each.
    pub(crate) fn expect(&self, stages: &[(&'static str, f64)]) {
        self.state().ahead = stages.to_vec();
    }

    /// Reports that this `share` of the stage at work is done, whatever the number of its units.
    pub(crate) fn reach(&self, share: f64) {
        if let Some(stage) = &mut self.state().current {
            stage.is_reported = true;
            stage.reach(share);
        }
    }

    /// Seconds until the run is done; `None` before there is an estimate.
    pub(crate) fn remaining(&self) -> Option<f64> {
        let state = self.state();
        let ahead: f64 = state.ahead.iter().map(|(_, seconds)| seconds).sum();
        let is_known = !state.ahead.is_empty() || state.current.as_ref()?.expected > 0.0;
        is_known.then(|| ahead + state.current.as_ref().map_or(0.0, CurrentStage::remaining))
    }
}

impl Progress for Forecast<'_> {
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit) {
        self.listener.begin(stage, total, done, unit);
        let mut state = self.state();
        let index = state.ahead.iter().position(|(name, _)| *name == stage);
        let expected = match index {
            // The stages before it in the order are over.
            Some(index) => state.ahead.drain(..=index).next_back(),
            None => None,
        };
        let before = done as f64 / total.max(1) as f64;
        let start = Instant::now();
        state.current = Some(CurrentStage {
            total,
            done,
            before,
            share: before,
            is_reported: false,
            expected: expected.map_or(0.0, |(_, seconds)| seconds),
            start,
            last: start,
        });
    }

    fn advance(&self, amount: u64) {
        self.listener.advance(amount);
        if let Some(stage) = &mut self.state().current {
            stage.done += amount;
            if !stage.is_reported {
                stage.reach(stage.done as f64 / stage.total.max(1) as f64);
            }
        }
    }

    fn end(&self) {
        self.listener.end();
        self.state().current = None;
    }

    fn note(&self, text: &str) {
        self.listener.note(text);
    }

    fn standing(&self, standing: &Standing) {
        self.listener.standing(standing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::progress::Quiet;

    #[test]
    fn what_remains_is_the_stage_at_work_and_those_ahead() {
        let forecast = Forecast::new(&Quiet);
        forecast.begin("scatter", 10, 0, Unit::Points);
        assert_eq!(forecast.remaining(), None);
        forecast.end();
        forecast.expect(&[("solve", 100.0), ("stitch", 20.0), ("write", 5.0)]);
        assert_eq!(forecast.remaining(), Some(125.0));
        // A quarter was done by an earlier run: that took no time of this one.
        forecast.begin("solve", 4, 1, Unit::Tiles);
        let rest = forecast.remaining().unwrap();
        assert!((99.0..=100.0).contains(&rest), "{rest}");
        std::thread::sleep(std::time::Duration::from_millis(50));
        forecast.advance(1);
        let rest = forecast.remaining().unwrap() - 25.0;
        assert!(rest > 0.05 && rest < 10.0, "{rest}");
        forecast.end();
        forecast.begin("write", 4, 0, Unit::Tiles);
        assert!(forecast.remaining().unwrap() <= 5.0);
    }
}
