//! Golden strokes: what each brush makes of one ground, small. `ANISOMAP_UPDATE_GOLDEN=1 cargo test --test strokes` rewrites them; look
//! at each before it goes in.
//!
//! Three pictures side by side: alpha_x and alpha_y on their log scales, and the direction as a hue. The ground is brushed and has a
//! groove across it; the brush goes over both in an S, pressed harder and harder.

#[path = "golden/compare.rs"]
mod golden;

use anisomap::map::Size;
use anisomap::mesh::Body;
use anisomap::paint::{
    Brush, FillWith, Groove, Keep, Point, Pressure, Roughen, Scratch, SetAlpha, SetDirection,
    Smooth, Symmetry, Tool,
};
use anisomap::preview::{Picture, linear_from_srgb};
use anisomap::recipe::RecipeFile;
use anisomap::studio::view::{AlphaRange, Averages, Camera2d, View};
use anisomap::studio::{Options, Studio};
use glam::Vec2;
use std::sync::Arc;

const SIDE: u32 = 128;
const GROUND: &str = "version = 1\nname = 'ground'\nsize = 128\nseed = 3\n\
    [[layers]]\nname = 'steel'\n[layers.brushed]\nangle = 110\n\
    [[layers]]\nname = 'paint'\n[layers.strokes]\npacked = []\nbrushes = []\n";

fn size(width: u32) -> Size {
    Size::new(width, SIDE).expect("a size")
}

fn studio() -> Studio {
    let file = RecipeFile::parse(GROUND, "ground.toml", None).expect("a recipe");
    let mut studio = Studio::new(file, None, Options::default()).expect("a studio");
    studio.settle();
    studio.select(1);
    let groove = Brush {
        tool: Tool::Groove(Groove::default()),
        radius: 0.1,
        hardness: 0.8,
        ..Brush::default()
    };
    studio.begin_stroke(Arc::new(groove), 1).expect("a layer");
    for i in 0..=10 {
        let at = Vec2::new(0.05 + 0.09 * i as f32, 0.8 - 0.06 * i as f32);
        studio.stroke_to(Point::new(at, 1.0).expect("finite"));
    }
    assert!(studio.end_stroke().expect("room"));
    studio
}

/// The map in three views.
fn picture(studio: &Studio) -> Picture {
    let map = studio.map();
    let averages = Averages::new(map);
    let range = AlphaRange::default();
    let views = [View::AlphaX(range), View::AlphaY(range), View::Direction];
    let camera = Camera2d::fit(map.size(), size(SIDE), 1.0);
    let mut picture = Picture::new(size(3 * SIDE), [0.0; 3]);
    for (n, view) in views.iter().enumerate() {
        let mut rgba = vec![0; 4 * size(SIDE).texels()];
        view.draw(map, &averages, &camera, size(SIDE).rect(), &mut rgba);
        for (i, bytes) in rgba.chunks_exact(4).enumerate() {
            let (x, y) = (i % SIDE as usize + n * SIDE as usize, i / SIDE as usize);
            let pixel = &mut picture.pixels_mut()[y * 3 * SIDE as usize + x];
            for (to, byte) in pixel.iter_mut().zip(bytes) {
                *to = linear_from_srgb(f32::from(*byte) / 255.0);
            }
        }
    }
    picture
}

fn hold(name: &str, brush: Brush) {
    let mut studio = studio();
    studio.begin_stroke(Arc::new(brush), 7).expect("a layer");
    for i in 0..=24 {
        let t = i as f32 / 24.0;
        let at = Vec2::new(0.5 + 0.32 * (6.0 * t).sin(), 0.12 + 0.76 * t);
        studio.stroke_to(Point::new(at, 0.2 + 0.8 * t).expect("finite"));
    }
    assert!(studio.end_stroke().expect("room"));
    studio.settle();
    assert!(studio.take_trouble().is_empty());
    golden::compare(&format!("strokes/{name}"), &picture(&studio));
}

fn brush(tool: Tool) -> Brush {
    Brush {
        tool,
        radius: 0.09,
        pressure: Pressure {
            size: 0.4,
            flow: 0.6,
        },
        ..Brush::default()
    }
}

#[test]
fn groove() {
    let fine = Groove {
        along: 0.03,
        across: 0.6,
    };
    hold("groove", brush(Tool::Groove(fine)));
}

#[test]
fn groove_of_dabs_with_copies() {
    let dabs = Brush {
        radius: 0.05,
        spacing: 0.6,
        jitter: 0.5,
        symmetry: Symmetry::MirrorU { at: 0.5 },
        ..brush(Tool::Groove(Groove::default()))
    };
    hold("dabs", dabs);
}

#[test]
fn comb() {
    hold("comb", brush(Tool::Comb));
}

#[test]
fn smooth() {
    hold("smooth", brush(Tool::Smooth(Smooth { reach: 0.05 })));
}

#[test]
fn roughen_and_polish() {
    hold("roughen", brush(Tool::Roughen(Roughen::default())));
    let polish = Roughen {
        factor: 0.5,
        keep: Keep::Area,
    };
    hold("polish", brush(Tool::Roughen(polish)));
}

#[test]
fn set_alpha_and_direction() {
    let alpha = SetAlpha {
        alpha_x: Some(0.5),
        alpha_y: None,
    };
    hold("set_alpha", brush(Tool::SetAlpha(alpha)));
    let direction = SetDirection { angle: 100.0 };
    hold("set_direction", brush(Tool::SetDirection(direction)));
}

#[test]
fn erase() {
    hold("erase", brush(Tool::Erase));
}

#[test]
fn fill() {
    let with = FillWith {
        alpha_x: None,
        alpha_y: Some(0.6),
        angle: Some(-40.0),
    };
    let half = Brush {
        flow: 0.5,
        ..brush(Tool::Fill(with))
    };
    hold("fill", half);
}

#[test]
fn scratch() {
    let scratch = Scratch {
        density: 8.0,
        length: 0.2,
        width: 0.008,
        ..Scratch::default()
    };
    hold("scratch", brush(Tool::Scratch(scratch)));
}

#[test]
fn groove_on_a_mesh_with_its_mirror_image() {
    let mut studio = studio();
    let sphere = anisomap::mesh::sphere();
    let body = Body::new(Arc::new(sphere)).expect("a mesh");
    studio.set_mesh("sphere").expect("a built-in");
    studio.settle();
    studio.add_paint_layer().expect("room");
    let groove = Brush {
        radius: 0.06,
        symmetry: Symmetry::MirrorU { at: 0.5 },
        ..brush(Tool::Groove(Groove::default()))
    };
    studio
        .begin_mesh_stroke(Arc::new(groove), 7)
        .expect("a layer");
    for i in 0..=30 {
        // Over the front, from the left below to the right above.
        let toward = glam::Vec3::new(-0.5 + 0.02 * i as f32, -0.6 + 0.04 * i as f32, -1.0);
        let from = -4.0 * toward;
        let met = body.first_met(from, toward).expect("through the middle");
        let at = from + toward * met.distance;
        studio.mesh_stroke_to(at, at.normalize(), 1.0);
    }
    assert!(studio.end_stroke().expect("room"));
    studio.settle();
    golden::compare("strokes/mesh", &picture(&studio));
}
