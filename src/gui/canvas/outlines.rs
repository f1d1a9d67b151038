//! The outlines of the mesh's charts over the map: found in the background, drawn once for each camera.

use crate::gui::desk::Desk;
use crate::gui::pane::put;
use crate::gui::viewport::MESHES;
use crate::gui::work::{Now, Work};
use anisomap::map::Wrap;
use anisomap::mesh::Body;
use anisomap::studio::view::{Camera2d, Outlines};
use eframe::egui::{Color32, ColorImage, Painter, Rect, TextureHandle, Ui, pos2};
use std::sync::Arc;

/// What is shown of a layout.
#[derive(Default)]
pub(crate) struct Layout {
    /// Whether it is shown; unless somebody said so, that of a mesh from a file is.
    shown: Option<bool>,
    /// The mesh that the lines are of.
    body: Option<Arc<Body>>,
    lines: Option<Outlines>,
    finding: Option<Work<Outlines>>,
    texture: Option<TextureHandle>,
    drawn: Option<(Camera2d, Wrap)>,
}

impl Layout {
    /// Whether it is shown.
    pub(crate) fn is_shown(&self, desk: &Desk) -> bool {
        let built_in = MESHES.contains(&desk.studio.mesh().name.as_str());
        self.shown.unwrap_or(!built_in)
    }

    pub(super) fn toggle(&mut self, desk: &Desk) {
        self.shown = Some(!self.is_shown(desk));
    }

    /// Draws it over the map.
    pub(super) fn show(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        rect: Rect,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        if !self.is_shown(desk) {
            return;
        }
        let body = desk.studio.body();
        if !self.body.as_ref().is_some_and(|b| Arc::ptr_eq(b, body)) {
            self.find(ui, desk);
        }
        if let Some(found) = self.finding.as_ref().map(Work::now) {
            match found {
                Now::Going => {}
                Now::Came(lines) => {
                    (self.lines, self.finding, self.drawn) = (Some(lines), None, None);
                }
                Now::Over => self.finding = None,
            }
        }
        let Some(lines) = &self.lines else { return };
        let (map, wrap) = (desk.studio.map().size(), desk.studio.map().wrap());
        if self.drawn != Some((camera, wrap)) {
            let mut pixels = vec![0; 4 * camera.size.texels()];
            lines.draw(map, wrap, &camera, &mut pixels);
            let part = camera.size.rect();
            let sides = [part.width as usize, part.height as usize];
            let image = ColorImage::from_rgba_premultiplied(sides, &pixels);
            put(ui, &mut self.texture, "outlines", camera.size, part, image);
            self.drawn = Some((camera, wrap));
        }
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture.id(), rect, uv, Color32::WHITE);
        }
    }

    fn find(&mut self, ui: &Ui, desk: &mut Desk) {
        let body = Arc::clone(desk.studio.body());
        self.body = Some(Arc::clone(&body));
        (self.lines, self.drawn) = (None, None);
        let begun = Work::begin("outlines", ui.ctx(), move |_, give| {
            give(Outlines::new(body.mesh()));
        });
        self.finding = desk.told(begun);
    }
}
