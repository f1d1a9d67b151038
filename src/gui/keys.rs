//! Key events to actions.

use anisomap::studio::action::Action;
use anisomap::studio::keymap::{Chord, Keymap};
use eframe::egui::{Context, Event, Key, Modifiers};

/// The actions of the keys that were pressed in this frame.
pub(crate) fn pressed(ctx: &Context, keymap: &Keymap) -> Vec<Action> {
    let typing = ctx.text_edit_focused();
    let focused = ctx.memory(|m| m.focused().is_some());
    ctx.input(|input| {
        input
            .events
            .iter()
            .filter_map(|event| match event {
                Event::Key {
                    key,
                    physical_key,
                    pressed: true,
                    repeat,
                    modifiers,
                } => {
                    let action = reached(keymap, *key, *physical_key, *modifiers)?;
                    let taken = (typing && belongs_to_text(*key, *modifiers))
                        || (focused && moves_focus(*key));
                    (!taken && (!repeat || may_repeat(action))).then_some(action)
                }
                _ => None,
            })
            .collect()
    })
}

/// By the sign on the key; where that is bound to nothing, by the key's place: Shift+[ is { on one layout and not on another.
fn reached(
    keymap: &Keymap,
    key: Key,
    physical: Option<Key>,
    modifiers: Modifiers,
) -> Option<Action> {
    let by = |key: Key| {
        keymap.action(&Chord {
            ctrl: modifiers.command || modifiers.ctrl,
            alt: modifiers.alt,
            shift: modifiers.shift,
            key: key.name().to_owned(),
        })
    };
    by(key).or_else(|| physical.and_then(by))
}

/// What a text field takes for itself.
fn belongs_to_text(key: Key, modifiers: Modifiers) -> bool {
    let command = modifiers.command || modifiers.ctrl;
    let in_text = matches!(
        key,
        Key::A | Key::C | Key::V | Key::X | Key::Z | Key::Y | Key::H | Key::E | Key::P | Key::N
    );
    key != Key::Escape && (!command || in_text) && !matches!(key, Key::F1 | Key::F10 | Key::F11)
}

/// What goes from control to control while one has the focus.
fn moves_focus(key: Key) -> bool {
    matches!(
        key,
        Key::Tab
            | Key::Enter
            | Key::Space
            | Key::ArrowLeft
            | Key::ArrowRight
            | Key::ArrowUp
            | Key::ArrowDown
    )
}

/// Whether holding the key does it again and again.
fn may_repeat(action: Action) -> bool {
    matches!(
        action,
        Action::Undo
            | Action::Redo
            | Action::SizeDown
            | Action::SizeUp
            | Action::HardnessDown
            | Action::HardnessUp
            | Action::FlowDown
            | Action::FlowUp
            | Action::ZoomIn
            | Action::ZoomOut
            | Action::ExposureDown
            | Action::ExposureUp
    )
}
