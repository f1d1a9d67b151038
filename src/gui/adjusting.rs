//! Size and flow changed by moving the pointer, over the map or the mesh: begun by a key, ended by a click.

use super::desk::Desk;
use eframe::egui::{Context, Key, Pos2};

/// What the pointer changes, where it began, and what there was before.
#[derive(Clone, Copy)]
pub(crate) enum Adjusting {
    Size {
        from: Pos2,
        radius: f32,
        hardness: f32,
    },
    Flow {
        from: Pos2,
        flow: f32,
    },
}

impl Adjusting {
    /// Where the brush is shown meanwhile.
    pub(crate) fn from(self) -> Pos2 {
        match self {
            Self::Size { from, .. } | Self::Flow { from, .. } => from,
        }
    }
}

impl Desk {
    /// Begins to change size or flow by moving the pointer; `middle` is where it begins while no pointer is over the window.
    pub(crate) fn begin_adjusting(&mut self, ctx: &Context, middle: Pos2, flow: bool) {
        let from = ctx.input(|i| i.pointer.hover_pos()).unwrap_or(middle);
        let brush = self.hand.brush();
        self.adjusting = Some(if flow {
            Adjusting::Flow {
                from,
                flow: brush.flow,
            }
        } else {
            Adjusting::Size {
                from,
                radius: brush.radius,
                hardness: brush.hardness,
            }
        });
    }

    /// Follows the pointer while size or flow is dragged, before any pane sees it: the click that ends it paints nothing.
    pub(crate) fn adjust(&mut self, ctx: &Context) {
        self.pointer_taken = self.adjusting.is_some();
        let Some(adjusting) = self.adjusting else {
            return;
        };
        let (pointer, ends, refused) = ctx.input(|i| {
            (
                i.pointer.hover_pos(),
                i.pointer.primary_pressed() || i.key_pressed(Key::Enter),
                i.pointer.secondary_pressed(),
            )
        });
        if refused {
            self.call_off_adjusting();
            return;
        }
        if let Some(pointer) = pointer {
            let way = pointer - adjusting.from();
            match adjusting {
                Adjusting::Size {
                    radius, hardness, ..
                } => {
                    self.hand.set_radius(radius * 1.012f32.powf(way.x));
                    self.hand.brush_mut().hardness = (hardness - way.y / 250.0).clamp(0.0, 1.0);
                }
                Adjusting::Flow { flow, .. } => {
                    self.hand.brush_mut().flow = (flow + way.x / 250.0).clamp(0.0, 1.0);
                }
            }
        }
        if ends {
            self.adjusting = None;
        }
    }

    /// Leaves size and flow as they were; `true` when they were being dragged.
    pub(crate) fn call_off_adjusting(&mut self) -> bool {
        match self.adjusting.take() {
            Some(Adjusting::Size {
                radius, hardness, ..
            }) => {
                self.hand.set_radius(radius);
                self.hand.brush_mut().hardness = hardness;
            }
            Some(Adjusting::Flow { flow, .. }) => self.hand.brush_mut().flow = flow,
            None => return false,
        }
        true
    }

    /// What is being dragged, in words.
    pub(crate) fn adjusting_text(&self) -> Option<String> {
        let brush = self.hand.brush();
        Some(match self.adjusting? {
            Adjusting::Flow { .. } => format!("flow {:.0}%", brush.flow * 100.0),
            Adjusting::Size { .. } => format!(
                "size {}  hardness {:.0}%",
                self.hand.size_text(),
                brush.hardness * 100.0
            ),
        })
    }
}
