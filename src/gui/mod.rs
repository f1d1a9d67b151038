//! The studio's window: turns events into calls of the library's `studio` module, and shows what is there.

mod about;
mod adjusting;
mod app;
mod canvas;
mod desk;
mod dialogs;
mod export;
mod files;
mod guides;
mod help;
mod icons;
mod import;
mod intake;
mod keys;
mod layers;
mod messages;
mod overlay;
mod pane;
mod presets;
mod properties;
mod status;
mod steer;
#[cfg(test)]
mod tests;
mod theme;
mod timings;
mod tools;
mod turns;
mod viewport;
mod watch;
mod widgets;
mod work;

pub(crate) use app::run;
