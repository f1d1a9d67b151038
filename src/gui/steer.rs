//! What arrow keys steer: the pictures, and the balls in their corners that move the lights. Each is a control that the keyboard
//! and screen readers reach.

use super::desk::Desk;
use super::icons::Icon;
use super::theme::Palette;
use super::widgets::overlay_text;
use eframe::egui::accesskit::Action as Request;
use eframe::egui::{
    Align2, Color32, CornerRadius, Event, EventFilter, Key, Painter, Pos2, Rect, Response, Role,
    Stroke, StrokeKind, Ui, WidgetInfo, vec2,
};
use glam::{Vec2, Vec3};

/// Radius of a ball by which lights are moved, points.
pub(crate) const BALL: f32 = 24.0;
/// With Shift a step is so much of a whole one.
const FINE: f32 = 0.1;
/// Degrees that a step turns a camera or a light by.
pub(crate) const STEP_DEGREES: f32 = 5.0;

/// An arrow key that was pressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// To the right and up, 1 for a whole step.
    pub(crate) by: Vec2,
    pub(crate) ctrl: bool,
    pub(crate) alt: bool,
}

/// What such a control is called, how it stands, and what it does by which keys, in words.
pub(crate) struct Steered<'a> {
    pub(crate) role: Role,
    pub(crate) name: &'a str,
    pub(crate) state: String,
    pub(crate) tip: &'a str,
}

impl Steered<'_> {
    /// Makes a control of what takes the focus: gives the arrow keys that were pressed while it has it.
    pub(crate) fn steps(self, ui: &Ui, response: &Response, desk: &mut Desk) -> Vec<Step> {
        let Self {
            role,
            name,
            state,
            tip,
        } = self;
        response.widget_info(|| WidgetInfo {
            current_text_value: Some(state.clone()),
            ..WidgetInfo::labeled(role, true, name)
        });
        ui.ctx().accesskit_node_builder(response.id, |node| {
            node.set_description(tip);
            if role == Role::Slider {
                node.add_action(Request::Increment);
                node.add_action(Request::Decrement);
            }
        });
        desk.steered.push(response.id);
        if !response.has_focus() {
            return Vec::new();
        }
        // The arrows are its own: they must not take the focus elsewhere.
        let filter = EventFilter {
            horizontal_arrows: true,
            vertical_arrows: true,
            ..Default::default()
        };
        ui.memory_mut(|m| m.set_focus_lock_filter(response.id, filter));
        let mut steps: Vec<Step> =
            ui.input(|i| i.events.iter().filter_map(step).collect::<Vec<_>>());
        for (request, x) in [(Request::Increment, 1.0), (Request::Decrement, -1.0)] {
            let count = ui.input(|i| i.num_accesskit_action_requests(response.id, request));
            let one = Step {
                by: Vec2::new(x, 0.0),
                ctrl: false,
                alt: false,
            };
            steps.extend(std::iter::repeat_n(one, count));
        }
        steps
    }
}

fn step(event: &Event) -> Option<Step> {
    let Event::Key {
        key,
        pressed: true,
        modifiers,
        ..
    } = event
    else {
        return None;
    };
    let way = match key {
        Key::ArrowLeft => Vec2::NEG_X,
        Key::ArrowRight => Vec2::X,
        Key::ArrowUp => Vec2::Y,
        Key::ArrowDown => Vec2::NEG_Y,
        _ => return None,
    };
    Some(Step {
        by: way * if modifiers.shift { FINE } else { 1.0 },
        ctrl: modifiers.command || modifiers.ctrl,
        alt: modifiers.alt,
    })
}

/// Shows that a picture has the focus.
pub(crate) fn focus_frame(ui: &Ui, painter: &Painter, picture: Rect) {
    let line = Stroke::new(2.0, Palette::of(ui).accent);
    painter.rect_stroke(picture, CornerRadius::ZERO, line, StrokeKind::Inside);
}

/// Says what the keys do while a picture or the ball in it has the focus.
pub(crate) fn focus_text(painter: &Painter, picture: Rect, keys: &str) {
    let below = picture.center_bottom() - vec2(0.0, 44.0);
    overlay_text(painter, below, Align2::CENTER_BOTTOM, keys);
}

/// Where the middle of the ball in the corner of a picture is.
pub(crate) fn ball_centre(picture: Rect) -> Pos2 {
    picture.right_top() + vec2(-BALL - 14.0, BALL + 14.0)
}

/// The room of that ball.
pub(crate) fn ball_rect(picture: Rect) -> Rect {
    Rect::from_center_size(ball_centre(picture), vec2(2.0, 2.0) * (BALL + 5.0))
}

/// Whether a place lies on it.
pub(crate) fn on_ball(picture: Rect, at: Pos2) -> bool {
    at.distance(ball_centre(picture)) < BALL + 5.0
}

/// A ball in the corner of a picture, lit from the unit vectors `toward` (right, up, to the viewer): the first is the one that is
/// told, with a sun.
pub(crate) fn paint_ball(ui: &Ui, painter: &Painter, picture: Rect, toward: &[Vec3], hot: bool) {
    let centre = ball_centre(picture);
    let accent = Palette::of(ui).accent;
    let ground = Color32::from_black_alpha(if hot { 200 } else { 130 });
    painter.circle_filled(centre, BALL + 5.0, ground);
    let ring = if hot {
        accent
    } else {
        Color32::from_white_alpha(90)
    };
    painter.circle_stroke(centre, BALL, Stroke::new(1.0, ring));
    let place = |v: &Vec3| centre + vec2(v.x, -v.y) * BALL;
    for light in toward.iter().skip(1) {
        // Those from behind are fainter.
        let alpha = if light.z < 0.0 { 70 } else { 150 };
        painter.circle_filled(place(light), 2.5, Color32::from_white_alpha(alpha));
    }
    let Some(first) = toward.first() else { return };
    let sun = place(first);
    let line = Stroke::new(1.0, Color32::from_white_alpha(60));
    painter.line_segment([centre, sun], line);
    let colour = if hot {
        accent
    } else {
        Color32::from_rgb(0xf3, 0xea, 0xd8)
    };
    let colour = colour.gamma_multiply(if first.z < 0.0 { 0.6 } else { 1.0 });
    Icon::Sun.paint(
        painter,
        Rect::from_center_size(sun, vec2(17.0, 17.0)),
        colour,
    );
}

/// Where light comes from, in words: `toward` as right, up and to the viewer.
pub(crate) fn light_text(toward: Vec3) -> String {
    let v = toward.normalize_or(Vec3::Z);
    let around = v.y.atan2(v.x).to_degrees().rem_euclid(360.0);
    let height = v.z.clamp(-1.0, 1.0).asin().to_degrees();
    format!("from {around:.0}\u{b0} around, {height:.0}\u{b0} toward the viewer")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_light_comes_from_is_told_in_degrees() {
        for (toward, text) in [
            (Vec3::X, "from 0\u{b0} around, 0\u{b0} toward the viewer"),
            (
                Vec3::new(0.0, 2.0, 2.0),
                "from 90\u{b0} around, 45\u{b0} toward the viewer",
            ),
            (
                Vec3::new(0.0, -1.0, -1.0),
                "from 270\u{b0} around, -45\u{b0} toward the viewer",
            ),
        ] {
            assert_eq!(light_text(toward), text);
        }
    }
}
