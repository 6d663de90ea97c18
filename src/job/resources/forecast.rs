//! How long a run will still take.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use crate::job::{Progress, Standing, Unit};

/// Listens to a job on behalf of another listener, and knows what remains.
pub(crate) struct Forecast<'a> {
    listener: &'a dyn Progress,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The stages to come in their order, and the seconds that each is expected to take:
    /// unknown before there is a plan.
    ahead: Vec<(&'static str, f64)>,
    now: Option<Current>,
}

/// The stage at work.
struct Current {
    total: u64,
    done: u64,
    /// Share that an earlier run had done, and that is done.
    before: f64,
    share: f64,
    /// Whether the share is told, rather than counted.
    is_told: bool,
    expected: f64,
    start: Instant,
    last: Instant,
}

impl Current {
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
            // What went before, the first tile being read, says nothing of the speed.
            self.start = self.last;
        }
    }
}

impl<'a> Forecast<'a> {
    pub(crate) fn new(listener: &'a dyn Progress) -> Self {
        Self {
            listener,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The stages to come, with the seconds that each is expected to take.
    pub(crate) fn expect(&self, stages: &[(&'static str, f64)]) {
        self.state().ahead = stages.to_vec();
    }

    /// Of the stage at work this share is done, however many of its units.
    pub(crate) fn reach(&self, share: f64) {
        if let Some(now) = &mut self.state().now {
            now.is_told = true;
            now.reach(share);
        }
    }

    /// Seconds until the run is done; nothing before that can be told.
    pub(crate) fn remaining(&self) -> Option<f64> {
        let state = self.state();
        let ahead: f64 = state.ahead.iter().map(|(_, seconds)| seconds).sum();
        let is_known = !state.ahead.is_empty() || state.now.as_ref()?.expected > 0.0;
        is_known.then(|| ahead + state.now.as_ref().map_or(0.0, Current::remaining))
    }
}

impl Progress for Forecast<'_> {
    fn begin(&self, stage: &str, total: u64, done: u64, unit: Unit) {
        self.listener.begin(stage, total, done, unit);
        let mut state = self.state();
        let place = state.ahead.iter().position(|(name, _)| *name == stage);
        let expected = match place {
            // What comes before it in the order is over.
            Some(place) => state.ahead.drain(..=place).next_back(),
            None => None,
        };
        let before = done as f64 / total.max(1) as f64;
        let start = Instant::now();
        state.now = Some(Current {
            total,
            done,
            before,
            share: before,
            is_told: false,
            expected: expected.map_or(0.0, |(_, seconds)| seconds),
            start,
            last: start,
        });
    }

    fn advance(&self, amount: u64) {
        self.listener.advance(amount);
        if let Some(now) = &mut self.state().now {
            now.done += amount;
            if !now.is_told {
                now.reach(now.done as f64 / now.total.max(1) as f64);
            }
        }
    }

    fn end(&self) {
        self.listener.end();
        self.state().now = None;
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
    use crate::job::Quiet;

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
