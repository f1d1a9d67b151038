//! Where the time of a picture goes.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// The stages of a picture, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Map to mip levels and texels side by side; once for all pictures of a map.
    Prepare,
    /// Vertices projected.
    Vertex,
    /// Triangles set up and sorted into tiles.
    Bin,
    /// Which triangle each sample sees.
    Raster,
    /// Attributes of what is seen.
    Resolve,
    /// Frames of normal and tangent, and the view in them.
    Frame,
    /// Texels between texels, and their lobes.
    Fetch,
    /// The model, light by light.
    Shade,
    /// Fragments gathered into pixels.
    Gather,
    /// Linear light to eight bits.
    Tone,
}

impl Stage {
    /// Every stage.
    pub const ALL: [Self; 10] = [
        Self::Prepare,
        Self::Vertex,
        Self::Bin,
        Self::Raster,
        Self::Resolve,
        Self::Frame,
        Self::Fetch,
        Self::Shade,
        Self::Gather,
        Self::Tone,
    ];

    /// Its name in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Prepare => "prepare",
            Self::Vertex => "vertex",
            Self::Bin => "bin",
            Self::Raster => "raster",
            Self::Resolve => "resolve",
            Self::Frame => "frame",
            Self::Fetch => "fetch",
            Self::Shade => "shade",
            Self::Gather => "gather",
            Self::Tone => "tone",
        }
    }
}

/// Time spent in each [`Stage`], added up over the threads that worked: with two cores a stage may show twice the time that
/// passed. `Prepare`, `Vertex`, `Bin` and `Tone` are
/// spread over the cores inside and show the time that passed.
#[derive(Debug)]
pub struct Timings {
    /// Nanoseconds by stage; `None` when nobody wants to know.
    stages: Option<[AtomicU64; Stage::ALL.len()]>,
}

impl Timings {
    /// Takes times.
    pub fn on() -> Self {
        Self {
            stages: Some(std::array::from_fn(|_| AtomicU64::new(0))),
        }
    }

    /// Takes none, and costs nothing.
    pub fn off() -> Self {
        Self { stages: None }
    }

    /// Milliseconds spent in a stage so far.
    pub fn milliseconds(&self, stage: Stage) -> f64 {
        let stages = self.stages.as_ref();
        stages.map_or(0.0, |s| {
            s[stage as usize].load(Ordering::Relaxed) as f64 * 1e-6
        })
    }

    /// Runs `work` as part of a stage.
    #[inline(always)]
    pub fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let Some(stages) = &self.stages else {
            return work();
        };
        let start = Instant::now();
        let result = work();
        let spent = start.elapsed().as_nanos() as u64;
        stages[stage as usize].fetch_add(spent, Ordering::Relaxed);
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_add_up_where_they_are_wanted() {
        let wait = || std::thread::sleep(std::time::Duration::from_millis(2));
        for (timings, taken) in [(Timings::on(), true), (Timings::off(), false)] {
            timings.time(Stage::Fetch, wait);
            timings.time(Stage::Fetch, wait);
            assert_eq!(timings.milliseconds(Stage::Fetch) >= 4.0, taken);
            assert_eq!(timings.milliseconds(Stage::Shade), 0.0);
        }
    }
}
