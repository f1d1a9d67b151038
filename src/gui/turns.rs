//! Events that came together, in their turns.
//!
//! A frame sees its events at once: what the pen did is painted before keys are obeyed, with the modifiers that are held at its
//! end. Where a frame takes long, strokes and keys between them come together; keys and buttons then get frames of their own.

use eframe::egui::Event;

/// The events whose turn has not come yet.
#[derive(Default)]
pub(crate) struct Turns {
    rest: Vec<Event>,
}

impl Turns {
    /// Leaves of a frame's events, and of those that still wait, the ones whose turn it is.
    pub(crate) fn take(&mut self, events: &mut Vec<Event>) {
        let mut all = std::mem::take(&mut self.rest);
        all.append(events);
        self.rest = all.split_off(first_turn(&all));
        *events = all;
    }

    /// Whether there is a next turn.
    pub(crate) fn waits(&self) -> bool {
        !self.rest.is_empty()
    }
}

/// How many events there are until keys follow a button, or a button keys.
fn first_turn(events: &[Event]) -> usize {
    let is_key = |event: &Event| match event {
        Event::Key { .. } | Event::ModifiersChanged(_) => Some(true),
        Event::PointerButton { .. } => Some(false),
        _ => None,
    };
    let first = events.iter().find_map(is_key);
    let other = |event: &Event| is_key(event).is_some_and(|key| Some(key) != first);
    events.iter().position(other).unwrap_or(events.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::{Key, Modifiers, PointerButton, Pos2};

    #[test]
    fn keys_and_buttons_take_turns() {
        let moved = || Event::PointerMoved(Pos2::ZERO);
        let key = |key| Event::Key {
            key,
            physical_key: None,
            pressed: true,
            repeat: false,
            modifiers: Modifiers::NONE,
        };
        let button = |pressed| Event::PointerButton {
            pos: Pos2::ZERO,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::SHIFT,
        };
        let turns = [
            vec![
                moved(),
                key(Key::B),
                Event::ModifiersChanged(Modifiers::SHIFT),
            ],
            vec![button(true), moved(), button(false), moved()],
            vec![
                Event::ModifiersChanged(Modifiers::NONE),
                key(Key::Z),
                moved(),
            ],
            vec![button(true), moved(), moved()],
        ];
        let all = turns.concat();
        let (mut events, mut later) = (all[..all.len() - 1].to_vec(), vec![moved()]);
        let mut waiting = Turns::default();
        for (n, turn) in turns.iter().enumerate() {
            waiting.take(&mut events);
            assert_eq!(events, *turn);
            assert_eq!(waiting.waits(), n < 3);
            // What comes meanwhile has the last turn.
            events = std::mem::take(&mut later);
        }
        waiting.take(&mut events);
        assert!(events.is_empty() && !waiting.waits());
    }
}
