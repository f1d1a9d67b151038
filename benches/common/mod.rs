//! What several benches share.

use std::time::Instant;

/// How long work takes, and what it gives.
pub(crate) fn milliseconds<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let done = work();
    (start.elapsed().as_secs_f64() * 1e3, done)
}

/// Whether a case was asked for: words on the command line are beginnings of names, and none stands for all.
pub(crate) fn is_wanted(name: &str) -> bool {
    let mut words = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .peekable();
    words.peek().is_none() || words.any(|w| name.starts_with(&w))
}
