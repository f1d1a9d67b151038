//! What all parts of the window share: the studio, the tool in the hand, settings, messages, and the actions that were asked for.

use super::adjusting::Adjusting;
use super::guides::GuideHand;
use super::intake::Part;
use super::messages::{About, Messages};
use super::timings::StageTimes;
use anisomap::Error;
use anisomap::map::Rect;
use anisomap::recipe::{Layer, RecipeFile, Source, Stamp};
use anisomap::studio::action::Action;
use anisomap::studio::hand::Hand;
use anisomap::studio::keymap::Keymap;
use anisomap::studio::settings::{Folders, Settings};
use anisomap::studio::{Header, LayerHead, Studio, Tick};
use eframe::egui::{Context, Id};
use glam::Vec2;
use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Duration;

/// Which pictures are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Panes {
    #[default]
    Both,
    Canvas,
    Viewport,
}

/// What the map underwent since the last frame, for whoever shows it.
#[derive(Default)]
pub(crate) struct News {
    pub(crate) map: Vec<Rect>,
    pub(crate) new_map: bool,
    pub(crate) picture: bool,
}

/// What takes more memory than the machine has to give, and waits for a yes.
pub(crate) struct Large {
    /// What there is to say of it.
    pub(crate) warning: String,
    pub(crate) what: LargeThing,
}

/// What is large.
pub(crate) enum LargeThing {
    /// A recipe, and where it was read from.
    Document(Box<RecipeFile>, Option<PathBuf>),
    /// The document with another size.
    Header(Box<Header>),
    /// A mesh of many triangles, or a map of many texels.
    File(Part, PathBuf),
}

/// What a panel asks for that takes a dialog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Another place of a file that the recipe names.
    Find(String),
    /// What the numbers of a layer's textures mean is to be said anew.
    Convention(usize),
}

/// What all parts of the window share.
pub(crate) struct Desk {
    pub(crate) studio: Studio,
    pub(crate) hand: Hand,
    /// The hand on the guides of the selected layer.
    pub(crate) guides: GuideHand,
    pub(crate) keymap: Keymap,
    pub(crate) settings: Settings,
    /// Where settings are kept; `None` keeps none.
    pub(crate) folders: Option<Folders>,
    pub(crate) messages: Messages,
    /// Whether the desktop may be asked for files.
    pub(crate) native_dialogs: bool,
    pub(crate) panes: Panes,
    pub(crate) panels: bool,
    /// The part of the width that the canvas has, beside the 3D view.
    pub(crate) split: f32,
    /// What the pointer over the canvas shows on the mesh, and over the mesh on the canvas, UV 0 to 1.
    pub(crate) on_map: Option<Vec2>,
    pub(crate) on_mesh: Option<Vec2>,
    /// How far the work in the background is.
    pub(crate) working: Option<f32>,
    pub(crate) news: News,
    /// How long the last drawing of the 3D picture took that changed anything.
    pub(crate) draw_time: Option<Duration>,
    /// What of it which stage took.
    pub(crate) stages: StageTimes,
    /// Whether the 3D picture has to be drawn again, and whether by a hand that still moves.
    pub(crate) redraw: Redraw,
    /// The file that is being read, in words.
    pub(crate) reading: Option<String>,
    /// What waits to be asked about because of its size.
    pub(crate) large: Option<Large>,
    /// What a panel asks for.
    pub(crate) wanted: Option<Wanted>,
    /// Whether it is still to be asked about files outside the recipe's folder.
    pub(crate) ask_outside: bool,
    /// Files that this document wrote, or may write over, as they were then.
    pub(crate) exported: HashMap<PathBuf, Option<Stamp>>,
    /// The control that takes the keyboard first.
    pub(crate) first_control: Option<Id>,
    /// The pictures and lights that arrow keys steer, in the order in which the keyboard goes to them.
    pub(crate) steered: Vec<Id>,
    /// Size or flow that the pointer drags.
    pub(crate) adjusting: Option<Adjusting>,
    /// Whether the pointer did so at the beginning of this frame, so that it is nobody else's.
    pub(crate) pointer_taken: bool,
    asked: Vec<Action>,
    /// The document's revision with the layer that was added for the stroke in flight, and what was selected before.
    added: Option<(u64, usize)>,
    strokes: u32,
    told_of_guides: bool,
}

/// What the 3D picture needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Redraw {
    #[default]
    Nothing,
    /// A part or all of it, sharp.
    Sharp,
    /// All of it, in a hurry.
    Moving,
}

impl Desk {
    pub(crate) fn new(
        studio: Studio,
        settings: Settings,
        keymap: Keymap,
        folders: Option<Folders>,
    ) -> Self {
        Self {
            studio,
            hand: Hand::default(),
            guides: GuideHand::default(),
            keymap,
            settings,
            folders,
            messages: Messages::default(),
            native_dialogs: true,
            panes: Panes::default(),
            panels: true,
            split: 0.5,
            on_map: None,
            on_mesh: None,
            working: None,
            news: News::default(),
            draw_time: None,
            stages: StageTimes::default(),
            redraw: Redraw::Sharp,
            reading: None,
            large: None,
            wanted: None,
            ask_outside: false,
            exported: HashMap::new(),
            first_control: None,
            steered: Vec::new(),
            asked: Vec::new(),
            adjusting: None,
            pointer_taken: false,
            added: None,
            strokes: 0,
            told_of_guides: false,
        }
    }

    /// Asks for an action: it is done at the end of the frame.
    pub(crate) fn ask(&mut self, action: Action) {
        self.asked.push(action);
    }

    /// The actions that were asked for.
    pub(crate) fn take_asked(&mut self) -> Vec<Action> {
        std::mem::take(&mut self.asked)
    }

    /// Takes over what the background has finished.
    pub(crate) fn tick(&mut self, ctx: &Context) {
        self.steered.clear();
        let Tick {
            map,
            new_map,
            picture,
            working,
        } = self.studio.tick();
        self.working = working;
        if new_map || !map.is_empty() {
            self.redraw = self.redraw.or(Redraw::Sharp);
            ctx.request_repaint();
        }
        self.news = News {
            map,
            new_map,
            picture,
        };
        for error in self.studio.take_trouble() {
            let text = error.to_string();
            let about = match self.studio.is_still_told(&text) {
                true => About::LeftOut,
                false => About::Anything,
            };
            self.messages.error_about(about, text);
        }
        if new_map {
            let studio = &self.studio;
            let still = |text: &str| studio.is_still_told(text);
            self.messages.retain_about(About::LeftOut, still);
        }
        if self.studio.is_behind() {
            // What is left of a large change is drawn in the next frames.
            self.redraw = self.redraw.or(Redraw::Sharp);
            ctx.request_repaint();
        } else if self.working.is_some() || self.studio.is_making_ready() {
            ctx.request_repaint_after(Duration::from_millis(40));
        } else if self.studio.viewport().is_refining() {
            ctx.request_repaint_after(Duration::from_millis(120));
        }
    }

    /// Tells an error, where there is one; gives the rest.
    pub(crate) fn told<T>(&mut self, result: Result<T, Error>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(Error::Cancelled) => None,
            Err(error) => {
                self.messages.error(error);
                None
            }
        }
    }

    /// Changes what a layer has beside its source, as a step of its own.
    pub(crate) fn edit_head(
        &mut self,
        at: usize,
        label: &str,
        change: impl FnOnce(&mut LayerHead),
    ) {
        let Some(layer) = self.studio.recipe().layers.get(at) else {
            return;
        };
        let mut head = LayerHead::of(layer);
        change(&mut head);
        let done = self.studio.set_head(at, label, head);
        self.studio.seal();
        self.redraw = self.redraw.or(Redraw::Sharp);
        self.told(done);
    }

    /// Shows the selected layer alone, or all again.
    pub(crate) fn toggle_solo(&mut self) {
        let solo = match self.studio.solo() {
            Some(_) => None,
            None => Some(self.studio.selected()),
        };
        self.studio.set_solo(solo);
    }

    /// Sees to it that the selected layer takes strokes: where it does not, there is a paint layer above it from now on.
    pub(crate) fn ready_layer(&mut self) -> bool {
        if self.studio.is_mask_selected() {
            return true;
        }
        let layers = &self.studio.recipe().layers;
        let takes = |l: &Layer| l.source.name() == "strokes";
        if layers.get(self.studio.selected()).is_some_and(takes) {
            return true;
        }
        let before = self.studio.selected();
        let added = self.studio.add_paint_layer();
        let is_added = self.told(added).is_some();
        self.added = is_added.then(|| (self.studio.document().revision(), before));
        is_added
    }

    /// Takes the stroke in flight away, and the layer that was added for it.
    pub(crate) fn cancel_stroke(&mut self) {
        self.studio.cancel_stroke();
        self.drop_added();
    }

    /// Takes a layer away that was added for a stroke which painted nothing.
    fn drop_added(&mut self) {
        let now = self.studio.document().revision();
        if let Some((_, before)) = self.added.take().filter(|(then, _)| *then == now) {
            let back = self.studio.take_back();
            self.told(back);
            self.studio.select(before);
        }
    }

    /// A number for the chance in the next stroke.
    pub(crate) fn stroke_seed(&mut self) -> u32 {
        self.strokes = self.strokes.wrapping_add(0x9e37_79b9);
        self.strokes
    }

    /// Ends the stroke in flight; tells why where nothing was painted.
    pub(crate) fn end_stroke(&mut self) {
        let ended = self.studio.end_stroke();
        let painted = self.told(ended);
        if painted == Some(true) {
            self.added = None;
            if !self.settings.hint_closed {
                self.close_hint();
                self.messages.news("Turn the light to see how the grooves take it: drag the ball in the map's corner, or over the mesh with Shift and the right button");
            }
            self.tell_of_guides();
            self.tell_of_mask();
        }
        if painted != Some(true) {
            self.drop_added();
        }
        if painted == Some(false) && self.hand.brush().tool.follows_stroke() {
            let name = self.hand.kind().name();
            self.messages.news(format!(
                "{name} follows the stroke: drag to give it a direction"
            ));
        }
    }

    /// Says that a stroke lies where nobody sees it.
    fn tell_of_mask(&mut self) {
        if !self.studio.mask_hides_last_stroke() {
            return;
        }
        let layer = &self.studio.recipe().layers[self.studio.selected()];
        let view = self.keymap.keys_text(Action::View8);
        self.messages.news(format!(
            "The mask of {} hides this stroke: {view} shows where the layer is seen",
            layer.name()
        ));
    }

    /// Says once that guides above what was painted lead its direction.
    fn tell_of_guides(&mut self) {
        let above = self
            .studio
            .recipe()
            .layers
            .iter()
            .skip(self.studio.selected() + 1);
        let lead = |l: &&Layer| match &l.source {
            Source::Guides(guides) => {
                // Through a mask it may show here or not.
                l.visible
                    && l.mask.is_none()
                    && l.opacity > 0.5
                    && l.channels.direction
                    && !guides.only_near
                    && !guides.guide.is_empty()
            }
            _ => false,
        };
        let name = above.filter(lead).map(|l| l.name().to_owned()).next();
        if let Some(name) = name.filter(|_| !std::mem::replace(&mut self.told_of_guides, true)) {
            self.messages.news(format!(
                "The layer {name} lies above and leads the direction: paint on a layer over it, or let it act only near its guides"
            ));
        }
    }

    /// Whoever has painted needs no hint that one can.
    pub(crate) fn close_hint(&mut self) {
        if !self.settings.hint_closed {
            self.settings.hint_closed = true;
            self.save_settings();
        }
    }

    /// Writes the settings; what goes wrong is told.
    pub(crate) fn save_settings(&mut self) {
        if let Some(folders) = &self.folders {
            let saved = self.settings.save(&folders.settings());
            self.told(saved);
        }
    }

    /// The tooltip of an action.
    pub(crate) fn tip(&self, action: Action) -> String {
        self.keymap.tooltip(action)
    }
}

impl Redraw {
    /// The greater need of two.
    pub(crate) fn or(self, other: Self) -> Self {
        match (self, other) {
            (Self::Moving, _) | (_, Self::Moving) => Self::Moving,
            (Self::Sharp, _) | (_, Self::Sharp) => Self::Sharp,
            _ => Self::Nothing,
        }
    }
}
