use super::*;
use crate::map::{DEFAULT_TEXEL, Size, Texel, Wrap};
use crate::math::Axis;
use glam::DVec2;

fn size(w: u32, h: u32) -> Size {
    Size::new(w, h).unwrap()
}

fn drawn(view: View, map: &AnisoMap, camera: &Camera2d) -> Vec<u8> {
    let rect = camera.size.rect();
    let mut rgba = vec![0; 4 * rect.texels()];
    view.draw(map, &Averages::new(map), camera, rect, &mut rgba);
    rgba
}

/// The colour of a map of one texel value.
fn colour(view: View, texel: Texel) -> [u8; 4] {
    let map = AnisoMap::constant(size(4, 4), Wrap::Repeat, texel);
    let camera = Camera2d::fit(map.size(), size(4, 4), 1.0);
    let rgba = drawn(view, &map, &camera);
    assert!(rgba.chunks(4).all(|p| p == &rgba[..4]), "one colour");
    rgba[..4].try_into().unwrap()
}

fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
    Texel {
        alpha_x,
        alpha_y,
        axis: Axis::from_degrees(degrees),
    }
}

/// Directions and widths that change from place to place.
fn swirl(w: u32, h: u32, wrap: Wrap) -> AnisoMap {
    let mut map = AnisoMap::constant(size(w, h), wrap, DEFAULT_TEXEL);
    let mut region = map.region_mut();
    for y in 0..h {
        for x in 0..w {
            let (u, v) = (x as f32 / w as f32, y as f32 / h as f32);
            let turn = 40.0 * (std::f32::consts::TAU * u).sin() + 90.0 * v;
            let wide = 0.2 + 0.15 * (std::f32::consts::TAU * (u + 2.0 * v)).cos();
            region.set((y * w + x) as usize, texel(0.04, wide, turn));
        }
    }
    map
}

fn views() -> Vec<View> {
    vec![
        View::Lit(Lighting::default()),
        View::AlphaX(AlphaRange::default()),
        View::AlphaY(AlphaRange::default()),
        View::Ratio(RatioRange::default()),
        View::Direction,
        View::Grain,
    ]
}

fn cameras(map: Size) -> Vec<Camera2d> {
    let canvas = size(97, 61);
    let fit = Camera2d::fit(map, canvas, 1.0);
    let at = |zoom, texel_aspect, repeat| Camera2d {
        centre: DVec2::new(0.07, 0.96),
        zoom,
        texel_aspect,
        size: canvas,
        repeat,
    };
    vec![
        fit,
        at(0.21, 1.0, true),
        at(0.7, 1.7, true),
        at(3.3, 1.0, false),
        at(21.0, 0.5, true),
    ]
}

#[test]
fn the_ends_of_the_scales_have_the_ends_of_the_tables() {
    let range = AlphaRange {
        low: 0.02,
        high: 0.5,
    };
    let rising = palette::rising();
    for (view, other) in [
        (View::AlphaX(range), texel(0.02, 0.5, 0.0)),
        (View::AlphaY(range), texel(0.5, 0.02, 30.0)),
    ] {
        assert_eq!(colour(view, other), rising[0]);
        let turned = texel(other.alpha_y, other.alpha_x, 0.0);
        assert_eq!(colour(view, turned), rising[palette::COLOURS - 1]);
        assert_eq!(colour(view, texel(1e-3, 1e-3, 0.0)), rising[0]);
        // The middle of a log scale is the root of the ends' product.
        assert_eq!(
            colour(view, texel(0.1, 0.1, 0.0)),
            rising[palette::COLOURS / 2]
        );
    }
    let diverging = palette::diverging();
    let ratio = |x, y| colour(View::Ratio(RatioRange { most: 8.0 }), texel(x, y, 50.0));
    assert_eq!(ratio(0.8, 0.1), diverging[palette::COLOURS - 1]);
    assert_eq!(ratio(0.1, 0.8), diverging[0]);
    let even = ratio(0.3, 0.3);
    assert!(even[..3].iter().all(|c| *c > 238), "{even:?}");
}

#[test]
fn a_half_turn_is_the_same_direction_and_a_quarter_turn_the_opposite_hue() {
    for degrees in 0..180u16 {
        let degrees = f32::from(degrees);
        let at = |d| colour(View::Direction, texel(0.4, 0.1, d));
        assert_eq!(at(degrees), at(degrees + 180.0));
        assert_eq!(at(degrees), direction::hue(degrees));
        // The direction of the x axis, whichever width is larger.
        assert_eq!(
            at(degrees),
            colour(View::Direction, texel(0.1, 0.4, degrees))
        );
        assert_ne!(at(degrees), at(degrees + 90.0));
    }
}

#[test]
fn isotropic_texels_are_dark_and_keep_a_trace_of_their_direction() {
    let brightness = |x, y, d| {
        let c = colour(View::Direction, texel(x, y, d));
        c[..3].iter().map(|c| u32::from(*c)).sum::<u32>()
    };
    assert!(brightness(0.2, 0.2, 40.0) < brightness(0.2, 0.24, 40.0));
    assert!(brightness(0.2, 0.24, 40.0) < brightness(0.2, 0.4, 40.0));
    let at = |d| colour(View::Direction, texel(0.2, 0.2, d));
    assert_ne!(at(0.0), at(90.0));
}

#[test]
fn any_rectangle_is_that_part_of_the_whole() {
    for (w, h, wrap) in [
        (64, 48, Wrap::Repeat),
        (301, 207, Wrap::RepeatU),
        (3, 5, Wrap::Clamp),
    ] {
        let map = swirl(w, h, wrap);
        let averages = Averages::new(&map);
        for camera in cameras(map.size()) {
            for view in views() {
                let all = drawn(view, &map, &camera);
                for rect in [
                    (0, 0, 1, 1),
                    (13, 7, 40, 33),
                    (96, 0, 1, 61),
                    (5, 60, 91, 1),
                ] {
                    let (x, y, width, height) = rect;
                    let rect = Rect {
                        x,
                        y,
                        width,
                        height,
                    };
                    let mut part = vec![0; 4 * rect.texels()];
                    view.draw(&map, &averages, &camera, rect, &mut part);
                    for (row, line) in part.chunks(4 * width as usize).enumerate() {
                        let start = 4 * camera.size.rect().index(x, y + row as u32);
                        assert!(line == &all[start..start + line.len()], "{view:?} {rect:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_dab_changes_only_the_pixels_it_is_said_to_change() {
    let mut map = swirl(200, 150, Wrap::Repeat);
    for camera in cameras(map.size()) {
        for view in views() {
            let before = drawn(view, &map, &camera);
            let mut averages = Averages::new(&map);
            let dab = Rect {
                x: 3,
                y: 130,
                width: 9,
                height: 14,
            };
            let kept = map.region(dab);
            let mut region = kept.clone();
            for i in 0..dab.texels() {
                region.view_mut().set(i, texel(0.5, 0.02, 77.0));
            }
            map.write_region(&region);
            averages.update(&map, dab);
            let after = drawn(view, &map, &camera);
            let mut mended = before;
            for rect in camera.pixels_of(map.size(), map.wrap(), dab, view.reach()) {
                let mut part = vec![0; 4 * rect.texels()];
                view.draw(&map, &averages, &camera, rect, &mut part);
                let line = 4 * rect.width as usize;
                for (row, from) in part.chunks(line).enumerate() {
                    let start = 4 * camera.size.rect().index(rect.x, rect.y + row as u32);
                    mended[start..start + line].copy_from_slice(from);
                }
            }
            assert!(mended == after, "{view:?} {camera:?}");
            map.write_region(&kept);
        }
    }
}

#[test]
fn light_follows_the_handle() {
    // Grooves along u spread light up and down.
    let grooves = texel(0.05, 0.5, 0.0);
    let lit = |x: f32, y: f32, texel| {
        let lighting = Lighting {
            toward: glam::Vec3::new(x, y, 0.8),
            ..Lighting::default()
        };
        u32::from(colour(View::Lit(lighting), texel)[1])
    };
    assert!(lit(0.0, 0.6, grooves) > 60 + lit(0.6, 0.0, grooves));
    assert_eq!(
        lit(0.0, 0.6, grooves),
        lit(0.6, 0.0, texel(0.05, 0.5, 90.0))
    );
    assert_eq!(
        lit(0.3, 0.4, grooves),
        lit(0.3, 0.4, texel(0.5, 0.05, 90.0))
    );
}

#[test]
fn light_is_that_of_the_reflection_model() {
    let lighting = Lighting::default();
    let t = texel(0.07, 0.3, 25.0);
    let (c, s) = (25f32.to_radians().cos(), 25f32.to_radians().sin());
    let l = lighting.toward.normalize();
    let turned = glam::Vec3::new(c * l.x + s * l.y, c * l.y - s * l.x, l.z);
    let f = crate::brdf::shade(
        lighting.model,
        turned,
        glam::Vec3::Z,
        glam::Vec2::new(0.07, 0.3),
    );
    let diffuse = 0.15 * l.z * std::f32::consts::FRAC_1_PI;
    let want = lighting.irradiance * (diffuse + 0.19 * f) + 0.15;
    let want = crate::preview::srgb_from_linear(want) * 255.0;
    let got = f32::from(colour(View::Lit(lighting), t)[0]);
    assert!((got - want).abs() <= 1.0, "{got} {want}");
}

#[test]
fn seen_from_afar_crossed_grooves_look_isotropic() {
    let mut map = AnisoMap::constant(size(64, 64), Wrap::Repeat, texel(0.05, 0.4, 0.0));
    for i in 0..64 * 64 {
        if (i + i / 64) % 2 == 0 {
            map.region_mut().set(i, texel(0.05, 0.4, 90.0));
        }
    }
    let camera = Camera2d::fit(map.size(), size(16, 16), 1.0);
    let lit = drawn(View::Lit(Lighting::default()), &map, &camera);
    let round = ((0.05f32.powi(2) + 0.4f32.powi(2)) / 2.0).sqrt();
    let want = colour(View::Lit(Lighting::default()), texel(round, round, 0.0));
    assert!(
        lit.chunks(4).all(|p| p[0].abs_diff(want[0]) <= 1),
        "{:?} {want:?}",
        &lit[..4]
    );
}

/// The direction of least change in a part of a grey picture, in degrees from `local` at each pixel: from the mean of the
/// gradient's outer product.
fn grain_degrees(
    rgba: &[u8],
    width: usize,
    rect: Rect,
    local: impl Fn(usize, usize) -> f32,
) -> f32 {
    // Blurred, since differences of pixels tell the slope of thin lines wrongly.
    const HILL: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
    let at = |x: usize, y: usize| {
        let taps = (0..25).map(|k| (k % 5, k / 5));
        taps.map(|(i, j)| {
            HILL[i] * HILL[j] * f32::from(rgba[4 * ((y + j - 2) * width + x + i - 2)])
        })
        .sum::<f32>()
    };
    let (mut c, mut s) = (0.0, 0.0);
    for y in rect.y as usize..(rect.y + rect.height) as usize {
        for x in rect.x as usize..(rect.x + rect.width) as usize {
            let gx = at(x + 1, y) - at(x - 1, y);
            let gy = at(x, y - 1) - at(x, y + 1);
            let (sin, cos) = (2.0 * local(x, y)).to_radians().sin_cos();
            let (a, b) = (gx * gx - gy * gy, 2.0 * gx * gy);
            c += a * cos + b * sin;
            s += b * cos - a * sin;
        }
    }
    // The gradient stands across the grain.
    (0.5 * (-s).atan2(-c)).to_degrees().rem_euclid(180.0)
}

fn apart(a: f32, b: f32) -> f32 {
    let d = (a - b).rem_euclid(180.0);
    d.min(180.0 - d)
}

#[test]
fn grain_lies_along_the_grooves() {
    let canvas = size(220, 220);
    let inner = Rect {
        x: 20,
        y: 20,
        width: 180,
        height: 180,
    };
    for degrees in (0..180u16).step_by(11) {
        let degrees = f32::from(degrees);
        for (t, want) in [
            (texel(0.05, 0.4, degrees), degrees),
            (texel(0.4, 0.05, degrees), degrees + 90.0),
        ] {
            let map = AnisoMap::constant(size(256, 256), Wrap::Repeat, t);
            let rgba = drawn(View::Grain, &map, &Camera2d::fit(map.size(), canvas, 1.0));
            let got = grain_degrees(&rgba, 220, inner, |_, _| 0.0);
            assert!(apart(got, want) < 3.0, "{want}: {got}");
        }
    }
}

#[test]
fn grain_goes_round_a_circle_at_any_zoom() {
    for n in [40, 200, 1000] {
        let mut map = AnisoMap::constant(size(n, n), Wrap::Clamp, DEFAULT_TEXEL);
        for i in 0..map.size().texels() {
            let (x, y) = (i as u32 % n, i as u32 / n);
            let middle = 0.5 * n as f32 - 0.5;
            let azimuth = (middle - y as f32).atan2(x as f32 - middle).to_degrees();
            map.region_mut().set(i, texel(0.05, 0.4, azimuth + 90.0));
        }
        let rgba = drawn(
            View::Grain,
            &map,
            &Camera2d::fit(map.size(), size(400, 400), 1.0),
        );
        let tangent = |x: usize, y: usize| {
            let (x, y) = (x as f32 - 199.5, 199.5 - y as f32);
            y.atan2(x).to_degrees() + 90.0
        };
        for (x, y) in [
            (20, 20),
            (240, 20),
            (20, 240),
            (240, 240),
            (20, 130),
            (130, 20),
        ] {
            let window = Rect {
                x,
                y,
                width: 140,
                height: 140,
            };
            let off = apart(grain_degrees(&rgba, 400, window, tangent), 0.0);
            assert!(off < 4.0, "{n} {window:?}: {off}");
        }
    }
}

#[test]
fn grain_has_the_same_contrast_at_every_zoom_and_less_without_direction() {
    let contrast = |t: Texel, zoom: f64| {
        let map = AnisoMap::constant(size(512, 512), Wrap::Repeat, t);
        let camera = Camera2d {
            zoom,
            repeat: true,
            ..Camera2d::fit(map.size(), size(300, 300), 1.0)
        };
        let rgba = drawn(View::Grain, &map, &camera);
        let greys = || rgba.chunks(4).map(|p| f32::from(p[0]));
        let mean = greys().sum::<f32>() / 9e4;
        (greys().map(|g| (g - mean) * (g - mean)).sum::<f32>() / 9e4).sqrt()
    };
    for zoom in [0.1, 0.5, 0.8, 1.0, 1.3, 5.0, 33.0] {
        let got = contrast(texel(0.05, 0.4, 20.0), zoom);
        assert!((36.0..58.0).contains(&got), "{zoom}: {got}");
    }
    assert!(contrast(texel(0.2, 0.2, 20.0), 1.0) < 20.0);
}

/// How long the views of a large map take; asked for by name, in a release build on a quiet machine.
#[test]
#[ignore = "measures"]
fn views_are_timed() {
    let map = swirl(4096, 4096, Wrap::Repeat);
    let best = |mut work: Box<dyn FnMut() + '_>| {
        let times = (0..15).map(|_| {
            let start = std::time::Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        });
        times.fold(f64::INFINITY, f64::min)
    };
    let mut averages = Averages::new(&map);
    println!(
        "averages {:.1} ms",
        best(Box::new(|| drop(Averages::new(&map))))
    );
    let dab = Rect {
        x: 1999,
        y: 1777,
        width: 128,
        height: 128,
    };
    println!(
        "dab {:.2} ms",
        best(Box::new(|| averages.update(&map, dab)))
    );
    let mut camera = Camera2d::fit(map.size(), size(900, 900), 1.0);
    for zoom in [camera.zoom, 0.6, 1.0, 4.0, 16.0] {
        camera.zoom = zoom;
        for view in views() {
            let mut rgba = vec![0; 900 * 900 * 4];
            let rect = camera.size.rect();
            let time = best(Box::new(|| {
                view.draw(&map, &averages, &camera, rect, &mut rgba);
            }));
            let name = format!("{view:?}");
            println!("zoom {zoom:.2} {:10.10} {time:.2} ms", name);
        }
    }
}

/// Writes the views of some presets as pictures into the folder that `ANISOMAP_VIEWS` names, to be looked at.
#[test]
fn views_of_presets_can_be_written_to_be_looked_at() {
    let Some(folder) = std::env::var_os("ANISOMAP_VIEWS") else {
        return;
    };
    for name in [
        "pot",
        "vinyl_record",
        "brushed_aluminium",
        "scratched_steel",
        "twill",
        "turned_disc",
    ] {
        let recipe = crate::recipe::open(name).unwrap();
        let (files, none) = (recipe.files(false), crate::progress::Progress::none());
        let prepared = recipe.recipe().prepare(size(512, 512), &files, &none);
        let map = prepared.unwrap().map(&none).unwrap();
        let texel_aspect = f64::from(recipe.recipe().aspect_at(map.size()));
        let averages = Averages::new(&map);
        let range = AlphaRange::of(&averages);
        let lighting = Lighting {
            material: recipe.recipe().material,
            ..Lighting::default()
        };
        let all = [
            View::Lit(lighting),
            View::AlphaX(range),
            View::AlphaY(range),
            View::Ratio(RatioRange::default()),
            View::Direction,
            View::Grain,
        ];
        let side = 420;
        let mut sheet = Sheet::new(side * 3, (side + 130) * 2);
        for (i, view) in all.into_iter().enumerate() {
            let mut camera = Camera2d::fit(map.size(), size(side, side), texel_aspect);
            if i == 5 {
                camera.zoom *= 1.3;
            }
            let place = [i as u32 % 3 * side, i as u32 / 3 * (side + 130)];
            sheet.paste(&drawn(view, &map, &camera), side, place);
            if i == 3 {
                for needle in needles(&map, &averages, &camera, 24.0) {
                    sheet.line(needle.ends, place, [20, 20, 20, 255]);
                }
            }
            if i == 4 {
                let mesh = crate::mesh::builtin(if name == "pot" { "pot" } else { "disc" });
                let found = LintMarks::find(&map, mesh.as_ref(), &none).unwrap();
                let mut veil = vec![0; 4 * (side * side) as usize];
                found.draw_texels(&camera, true, camera.size.rect(), &mut veil);
                sheet.paste(&veil, side, place);
                for seam in found.seams(&camera) {
                    sheet.line(seam.ends, place, seam.colour);
                }
                for pole in found.poles(&camera) {
                    sheet.line([pole.at - 6.0, pole.at + 6.0], place, [255; 4]);
                }
                println!(
                    "{name}: {} poles {:?}, {} seams",
                    found.marks().poles.len(),
                    found.marks().rough,
                    found.marks().seams.len()
                );
            }
            if let Some(legend) = view.legend(size(360, if i == 4 { 86 } else { 14 })) {
                sheet.legend(&legend, [place[0] + 30, place[1] + side + 20]);
            }
        }
        let path = std::path::Path::new(&folder).join(format!("{name}.png"));
        sheet.0.save(path).unwrap();
    }
}

struct Sheet(image::RgbaImage);

impl Sheet {
    fn new(width: u32, height: u32) -> Self {
        Self(image::RgbaImage::from_pixel(
            width,
            height,
            image::Rgba([30, 31, 34, 255]),
        ))
    }

    fn put(&mut self, x: i64, y: i64, [r, g, b, a]: [u8; 4]) {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else {
            return;
        };
        if let Some(pixel) = self.0.get_pixel_mut_checked(x, y) {
            for (p, c) in pixel.0.iter_mut().zip([r, g, b]) {
                *p = c.saturating_add((u16::from(*p) * u16::from(255 - a) / 255) as u8);
            }
        }
    }

    fn paste(&mut self, rgba: &[u8], width: u32, [x, y]: [u32; 2]) {
        for (i, p) in (0u32..).zip(rgba.chunks(4)) {
            let (i, j) = (i % width, i / width);
            self.put((x + i).into(), (y + j).into(), [p[0], p[1], p[2], p[3]]);
        }
    }

    fn line(&mut self, [a, b]: [glam::Vec2; 2], [x, y]: [u32; 2], colour: [u8; 4]) {
        let steps = (a.distance(b) * 2.0).ceil().max(1.0) as u32;
        for k in 0..=steps {
            let p = a.lerp(b, k as f32 / steps as f32);
            let at = (p.x as i64 + i64::from(x), p.y as i64 + i64::from(y));
            self.put(at.0, at.1, colour);
            self.put(at.0 + 1, at.1, colour);
        }
    }

    fn legend(&mut self, legend: &Legend, [x, y]: [u32; 2]) {
        self.paste(&legend.rgba, legend.size.width(), [x, y]);
        let mut text = crate::preview::Picture::new(size(90, 14), [0.0; 3]);
        for tick in &legend.ticks {
            let text_at = tick.at + tick.outward * glam::Vec2::new(22.0, 12.0);
            let (tx, ty) = (text_at.x as u32 + x, text_at.y as u32 + y);
            self.line([tick.at, tick.at + 4.0 * tick.outward], [x, y], [220; 4]);
            text.pixels_mut().fill([0.0; 3]);
            let area = size(90, 14).rect();
            let align = crate::preview::Align::Centre;
            crate::preview::write_text(&mut text, area, &tick.label, 13.0, align, [1.0; 3]);
            for (k, c) in (0u32..).zip(text.to_srgb8().chunks(3)) {
                let at = (i64::from(tx + k % 90) - 45, i64::from(ty + k / 90) - 7);
                self.put(at.0, at.1, [c[0] / 2, c[0] / 2, c[0] / 2, 0]);
            }
        }
    }
}
