//! How long work tells its caller how far it is, and how the caller stops it.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Asked after every step, and within long ones, with (done, total); `false` cancels the work, for good.
pub type ProgressFn<'a> = dyn Fn(u64, u64) -> bool + Sync + 'a;

/// A counter of finished steps that many threads may advance. The library knows no terminal and no window:
/// whoever starts the work passes a closure.
pub struct Progress<'a> {
    report: Option<&'a ProgressFn<'a>>,
    done: AtomicU64,
    total: AtomicU64,
    is_cancelled: AtomicBool,
}

impl<'a> Progress<'a> {
    /// Nobody listens and nobody cancels.
    pub const fn none() -> Self {
        Self {
            report: None,
            done: AtomicU64::new(0),
            total: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
        }
    }

    /// Calls `report` after each step, from any thread.
    pub const fn new(report: &'a ProgressFn<'a>) -> Self {
        Self {
            report: Some(report),
            done: AtomicU64::new(0),
            total: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
        }
    }

    /// Announces `steps` more steps.
    pub fn expect(&self, steps: u64) {
        self.total.fetch_add(steps, Ordering::Relaxed);
    }

    /// Marks one step done.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when the caller wants to stop.
    pub fn step(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.ask(done)
    }

    /// Asks whether to go on, without advancing.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when the caller wants to stop.
    pub fn check(&self) -> Result<()> {
        self.ask(self.done.load(Ordering::Relaxed))
    }

    fn ask(&self, done: u64) -> Result<()> {
        let Some(report) = self.report else {
            return Ok(());
        };
        let goes_on = !self.is_cancelled.load(Ordering::Relaxed)
            && report(done, self.total.load(Ordering::Relaxed).max(done));
        if goes_on {
            return Ok(());
        }
        self.is_cancelled.store(true, Ordering::Relaxed);
        Err(Error::Cancelled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listener_that_says_no_cancels() {
        let stop_at_two = |done: u64, _: u64| done < 2;
        let progress = Progress::new(&stop_at_two);
        progress.expect(3);
        assert!(progress.step().is_ok());
        assert!(matches!(progress.step(), Err(Error::Cancelled)));
        assert!(Progress::none().step().is_ok());
    }

    #[test]
    fn what_was_cancelled_stays_so() {
        let only_once = |done: u64, _: u64| done != 1;
        let progress = Progress::new(&only_once);
        assert!(progress.check().is_ok());
        assert!(progress.step().is_err());
        assert!(progress.step().is_err() && progress.check().is_err());
    }
}
