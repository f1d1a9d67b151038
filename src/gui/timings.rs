//! How long the stages of the 3D picture took, over its corner while that is asked for.

use super::desk::Desk;
use anisomap::preview::{Stage, Timings};
use eframe::egui::{Align2, Color32, CornerRadius, FontId, Painter, Rect, vec2};

/// The stages of the last drawing that somebody waited for.
#[derive(Default)]
pub(crate) struct StageTimes {
    /// Whether they are shown.
    pub(crate) shown: bool,
    /// Milliseconds by stage since the start, and those of the last drawing.
    sums: [f64; Stage::ALL.len()],
    last: [f64; Stage::ALL.len()],
}

impl StageTimes {
    /// Takes over a drawing that has just ended.
    pub(crate) fn take(&mut self, timings: &Timings) {
        let sums = Stage::ALL.map(|stage| timings.milliseconds(stage));
        self.last = std::array::from_fn(|i| sums[i] - self.sums[i]);
        self.sums = sums;
    }

    /// Passes over a drawing that drew nothing: what it took is not the next one's.
    pub(crate) fn pass_over(&mut self, timings: &Timings) {
        self.sums = Stage::ALL.map(|stage| timings.milliseconds(stage));
    }
}

/// Shows them at the right of the picture, below what stands at its top.
pub(crate) fn show(painter: &Painter, desk: &Desk, picture: Rect) {
    if !desk.stages.shown {
        return;
    }
    let line = |name: &str, time: f64| format!("{name:<8}{time:>8.2} ms");
    let drawing = desk.draw_time.map_or(0.0, |time| 1e3 * time.as_secs_f64());
    let stages = Stage::ALL.iter().zip(desk.stages.last);
    let lines: Vec<String> = stages
        .map(|(stage, time)| line(stage.name(), time))
        .chain([line("drawing", drawing)])
        .collect();
    let ink = Color32::from_rgb(0xe8, 0xe9, 0xea);
    let galley = painter.layout_no_wrap(lines.join("\n"), FontId::monospace(11.5), ink);
    let corner = picture.right_top() + vec2(-10.0, 44.0);
    let ground = Align2::RIGHT_TOP.anchor_size(corner, galley.size() + vec2(16.0, 12.0));
    let dark = Color32::from_rgba_unmultiplied(12, 13, 15, 200);
    painter.rect_filled(ground, CornerRadius::same(5), dark);
    painter.galley(ground.min + vec2(8.0, 6.0), galley, ink);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_last_drawing_is_told_and_not_the_sum() {
        let timings = Timings::on();
        let mut stages = StageTimes::default();
        let work = |wait: u64| {
            let wait = Duration::from_millis(wait);
            timings.time(Stage::Shade, || std::thread::sleep(wait));
        };
        work(60);
        stages.take(&timings);
        let first = stages.last[Stage::Shade as usize];
        assert!(first >= 60.0, "{first}");
        work(1);
        stages.take(&timings);
        let second = stages.last[Stage::Shade as usize];
        assert!(second >= 1.0 && second < first, "{second}");
        assert_eq!(stages.last[Stage::Raster as usize], 0.0);
        work(60);
        stages.pass_over(&timings);
        assert_eq!(stages.last[Stage::Shade as usize], second);
        work(1);
        stages.take(&timings);
        let third = stages.last[Stage::Shade as usize];
        assert!(third >= 1.0 && third < first, "{third}");
    }
}
