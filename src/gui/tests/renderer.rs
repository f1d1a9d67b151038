//! Draws the window on the CPU, so that a test can look at it: no display, no driver, the same bytes everywhere.

use eframe::egui::epaint::{ClippedPrimitive, ImageData, Mesh, Primitive, Vertex};
use eframe::egui::{self, Color32, ColorImage, Pos2, Rect, TextureId, TexturesDelta};
use egui_kittest::TestRenderer;
use image::{Rgba, RgbaImage};
use std::collections::HashMap;

/// Triangles with colours and textures, blended in gamma space with premultiplied alpha, as the toolkit expects.
#[derive(Default)]
pub(super) struct CpuRenderer {
    textures: HashMap<TextureId, ColorImage>,
}

impl TestRenderer for CpuRenderer {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        for (id, changes) in delta.set.drain() {
            for change in changes {
                let ImageData::Color(image) = change.image;
                match change.pos {
                    None => drop(self.textures.insert(id, (*image).clone())),
                    Some(at) => {
                        if let Some(whole) = self.textures.get_mut(&id) {
                            patch(whole, &image, at);
                        }
                    }
                }
            }
        }
        for id in delta.free.drain() {
            self.textures.remove(&id);
        }
    }

    fn render(
        &mut self,
        ctx: &egui::Context,
        output: &egui::FullOutput,
    ) -> Result<RgbaImage, String> {
        let scale = output.pixels_per_point;
        let size = ctx.content_rect().size() * scale;
        let mut picture = RgbaImage::from_pixel(size.x as u32, size.y as u32, Rgba([0, 0, 0, 255]));
        for ClippedPrimitive {
            clip_rect,
            primitive,
        } in ctx.tessellate(output.shapes.clone(), scale)
        {
            if let Primitive::Mesh(mesh) = primitive {
                let texture = self
                    .textures
                    .get(&mesh.texture_id)
                    .ok_or("a texture that nobody set")?;
                draw(&mut picture, &mesh, texture, clip_rect * scale, scale);
            }
        }
        Ok(picture)
    }
}

fn patch(whole: &mut ColorImage, part: &ColorImage, at: [usize; 2]) {
    let (width, row) = (whole.size[0], part.size[0]);
    for (y, line) in part.pixels.chunks(row).enumerate() {
        let start = (at[1] + y) * width + at[0];
        whole.pixels[start..start + row].copy_from_slice(line);
    }
}

fn draw(picture: &mut RgbaImage, mesh: &Mesh, texture: &ColorImage, clip: Rect, scale: f32) {
    let whole = Rect::from_min_max(
        Pos2::ZERO,
        egui::pos2(picture.width() as f32, picture.height() as f32),
    );
    let clip = clip.intersect(whole);
    for corners in mesh.indices.chunks_exact(3) {
        let corners = [0, 1, 2].map(|i| mesh.vertices[corners[i] as usize]);
        triangle(picture, corners, texture, clip, scale);
    }
}

fn triangle(picture: &mut RgbaImage, v: [Vertex; 3], texture: &ColorImage, clip: Rect, scale: f32) {
    let p = v.map(|v| (v.pos.to_vec2() * scale).to_pos2());
    let edge = |a: Pos2, b: Pos2, c: Pos2| (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    let area = edge(p[0], p[1], p[2]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let bounds = Rect::from_points(&p).intersect(clip);
    // A sample on an edge belongs to one of the two triangles that share it.
    let owns =
        |a: Pos2, b: Pos2| (a.y == b.y && (b.x - a.x) * area > 0.0) || (b.y - a.y) * area < 0.0;
    for y in bounds.top().floor() as i64..bounds.bottom().ceil() as i64 {
        for x in bounds.left().floor() as i64..bounds.right().ceil() as i64 {
            let at = egui::pos2(x as f32 + 0.5, y as f32 + 0.5);
            if !clip.contains(at) {
                continue;
            }
            let w = [(1, 2), (2, 0), (0, 1)]
                .map(|(i, j)| (edge(p[i], p[j], at) / area, owns(p[i], p[j])));
            if w.iter().any(|(w, owns)| *w < 0.0 || (*w == 0.0 && !owns)) {
                continue;
            }
            let mix =
                |f: fn(&Vertex) -> f32| w[0].0 * f(&v[0]) + w[1].0 * f(&v[1]) + w[2].0 * f(&v[2]);
            let texel = sample(texture, mix(|v| v.uv.x), mix(|v| v.uv.y));
            let colour = [
                mix(|v| v.color.r().into()),
                mix(|v| v.color.g().into()),
                mix(|v| v.color.b().into()),
                mix(|v| v.color.a().into()),
            ];
            blend(picture.get_pixel_mut(x as u32, y as u32), texel, colour);
        }
    }
}

fn sample(texture: &ColorImage, u: f32, v: f32) -> [f32; 4] {
    let [w, h] = texture.size;
    let (x, y) = (u * w as f32 - 0.5, v * h as f32 - 0.5);
    let at = |x: f32, y: f32| -> Color32 {
        let clamp = |t: f32, n: usize| (t.max(0.0) as usize).min(n - 1);
        texture.pixels[clamp(y, h) * w + clamp(x, w)]
    };
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let corners = [
        (at(x.floor(), y.floor()), (1.0 - fx) * (1.0 - fy)),
        (at(x.floor() + 1.0, y.floor()), fx * (1.0 - fy)),
        (at(x.floor(), y.floor() + 1.0), (1.0 - fx) * fy),
        (at(x.floor() + 1.0, y.floor() + 1.0), fx * fy),
    ];
    let mut sum = [0.0; 4];
    for (colour, weight) in corners {
        for (s, c) in sum.iter_mut().zip(colour.to_array()) {
            *s += f32::from(c) * weight;
        }
    }
    sum
}

fn blend(pixel: &mut Rgba<u8>, texel: [f32; 4], colour: [f32; 4]) {
    let source: [f32; 4] = std::array::from_fn(|i| texel[i] * colour[i] / 255.0);
    let keep = 1.0 - source[3] / 255.0;
    for i in 0..3 {
        pixel.0[i] = (source[i] + f32::from(pixel.0[i]) * keep + 0.5).min(255.0) as u8;
    }
}
