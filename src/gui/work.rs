//! Work that the window does not wait for: a thread of its own, its progress, its end.

use anisomap::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// How far the work is, and whether it is still wanted; shared with the thread that does it.
#[derive(Clone, Default)]
pub(crate) struct Reins {
    stop: Arc<AtomicBool>,
    thousandths: Arc<AtomicU32>,
}

impl Reins {
    /// Tells how far the work is, 0 to 1.
    pub(crate) fn report(&self, part: f64) {
        self.thousandths
            .store((part.clamp(0.0, 1.0) * 1000.0) as u32, Ordering::Relaxed);
    }

    /// Whether the work is still wanted.
    pub(crate) fn go_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }
}

/// Work in the background. Dropped, it is asked to stop.
pub(crate) struct Work<T> {
    reins: Reins,
    results: Receiver<T>,
}

/// What there is of a [`Work`] by now.
pub(crate) enum Now<T> {
    /// Nothing new.
    Going,
    /// A result; more may come.
    Came(T),
    /// Nothing more will come.
    Over,
}

impl<T: Send + 'static> Work<T> {
    /// Begins work that gives any number of results through the closure it is handed; that gives `false` when nobody waits.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub(crate) fn begin(
        name: &str,
        ctx: &eframe::egui::Context,
        work: impl FnOnce(&Reins, &dyn Fn(T) -> bool) + Send + 'static,
    ) -> Result<Self, Error> {
        let reins = Reins::default();
        let (send, results) = channel();
        let (held, ctx) = (reins.clone(), ctx.clone());
        let body = move || {
            let give = |result| {
                let there = send.send(result).is_ok();
                ctx.request_repaint();
                there
            };
            work(&held, &give);
            drop(send);
            ctx.request_repaint();
        };
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(body);
        thread.map_err(Error::machine("no thread can be started"))?;
        Ok(Self { reins, results })
    }

    /// What there is by now; does not wait.
    pub(crate) fn now(&self) -> Now<T> {
        match self.results.try_recv() {
            Ok(result) => Now::Came(result),
            Err(TryRecvError::Empty) => Now::Going,
            Err(TryRecvError::Disconnected) => Now::Over,
        }
    }

    /// How far it is, 0 to 1.
    pub(crate) fn part(&self) -> f32 {
        self.reins.thousandths.load(Ordering::Relaxed) as f32 / 1000.0
    }
}

impl<T> Work<T> {
    /// Asks it to stop.
    pub(crate) fn cancel(&self) {
        self.reins.stop.store(true, Ordering::Relaxed);
    }
}

impl<T> Drop for Work<T> {
    fn drop(&mut self) {
        self.cancel();
    }
}
