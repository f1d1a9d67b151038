//! The coverage of a layer is what it changes in the map.

use super::*;
use crate::convention::MapInfo;
use crate::export::Export;
use crate::export::exr::{Precision, write_master};
use crate::map::Texel;
use crate::paint::{FillWith, SetAlpha};

/// Widths of the ground, and alpha_x of every layer over it.
const GROUND: f32 = 0.1;
const OVER: f32 = 0.4;

/// A ground, and over it a layer that lays one alpha_x and nothing else, faintly and through a soft mask.
fn over_ground(layer: &str, wrap: &str) -> String {
    format!(
        "version = 1\nsize = [150, 90]\nwrap = '{wrap}'\nseed = 3\n\
         [[layers]]\nname = 'ground'\n[layers.constant]\nalpha_x = {GROUND}\nalpha_y = {GROUND}\n\
         [[layers]]\nname = 'over'\nopacity = 0.7\nchannels = ['alpha_x']\n\
         [layers.mask]\npolygon = [[0.2, 0.1], [0.9, 0.2], [0.8, 0.9], [0.1, 0.8]]\nfeather = 0.1\ninvert = true\n{layer}"
    )
}

const PAINTED: &str = "[layers.strokes]\npacked = []\nbrushes = []\n";

fn coverage(studio: &Studio) -> Vec<f32> {
    let order = studio.coverage().expect("the layer is shown");
    order.carry_out(&Progress::none()).unwrap()
}

/// How much of the layer the map shows, by what became of the ground.
fn shown(studio: &Studio) -> Vec<f32> {
    let alphas = studio.map().alpha_x().iter();
    alphas.map(|a| (a - GROUND) / (OVER - GROUND)).collect()
}

#[track_caller]
fn assert_covers_what_it_changes(studio: &Studio, kind: &str, least: f32) -> Vec<f32> {
    let (told, seen) = (coverage(studio), shown(studio));
    assert_eq!(told.len(), seen.len());
    for (i, (told, seen)) in told.iter().zip(&seen).enumerate() {
        assert!(
            (told - seen).abs() < 2e-3,
            "{kind}, texel {i}: {told}, {seen}"
        );
    }
    let most = told.iter().copied().fold(0.0, f32::max);
    assert!((least..=0.7001).contains(&most), "{kind}: {most}");
    assert!(told.contains(&0.0), "{kind}: the mask hides some of it");
    told
}

#[test]
fn of_every_kind_it_is_what_the_layer_changes_through_its_mask() {
    let alphas = format!("alpha_along = {OVER}\nalpha_across = {OVER}");
    let kinds = [
        (
            "pattern",
            format!("[layers.constant]\nalpha_x = {OVER}\nalpha_y = {OVER}\n"),
        ),
        (
            "scratches",
            format!(
                "[layers.scratches]\ncount = 60\nwidth = 0.02\ndepth = 0.8\nspread = 0.0\n{alphas}\n"
            ),
        ),
        (
            "guides",
            format!(
                "[layers.guides]\ngrid = 64\nonly_near = true\n{alphas}\n[[layers.guides.guide]]\nshape.ellipse.radii = [0.2, 0.15]\ncenter = [0.05, 0.2]\nfalloff = 0.2\n"
            ),
        ),
    ];
    for (kind, layer) in kinds {
        for wrap in ["repeat", "clamp"] {
            let mut studio = studio_of(&over_ground(&layer, wrap));
            studio.select(1);
            let told = assert_covers_what_it_changes(&studio, kind, 0.5);
            let part = told.iter().filter(|c| (0.01..0.69).contains(*c)).count();
            assert!(part > 100, "{kind}: {part} texels in part");
        }
    }
}

#[test]
fn an_image_covers_all_that_its_mask_shows() {
    let folder = tempfile::tempdir().unwrap();
    let size = Size::new(4, 4).unwrap();
    let texel = Texel {
        alpha_x: OVER,
        ..DEFAULT_TEXEL
    };
    let map = AnisoMap::constant(size, Wrap::Repeat, texel);
    let info = MapInfo::default();
    let export = Export::new(&map, &info);
    write_master(&folder.path().join("lake.exr"), &export, Precision::Float).unwrap();
    let path = folder.path().join("a.toml");
    let text = over_ground("[layers.image]\nfile = 'lake.exr'\n", "repeat");
    std::fs::write(&path, text).unwrap();
    let file = RecipeFile::read(&path).unwrap();
    let mut studio = Studio::new(file, Some(path.clone()), Options::default()).unwrap();
    studio.settle();
    studio.select(1);
    assert_covers_what_it_changes(&studio, "image", 0.69);
    // Without its file it shows nothing.
    std::fs::remove_file(folder.path().join("lake.exr")).unwrap();
    let file = RecipeFile::read(&path).unwrap();
    let mut studio = Studio::new(file, Some(path), Options::default()).unwrap();
    studio.settle();
    studio.select(1);
    assert!(studio.coverage().is_none() && !studio.is_seen(1));
}

#[test]
fn of_strokes_and_fills_it_is_what_they_leave_as_they_are_painted() {
    let mut studio = studio_of(&over_ground(PAINTED, "repeat"));
    studio.select(1);
    let alpha = |hardness: f32| {
        Arc::new(Brush {
            tool: Tool::SetAlpha(SetAlpha {
                alpha_x: Some(OVER),
                alpha_y: None,
            }),
            radius: 0.12,
            hardness,
            ..Brush::default()
        })
    };
    assert!(
        coverage(&studio).iter().all(|c| *c == 0.0),
        "nothing is painted"
    );
    stroke(
        &mut studio,
        alpha(0.2),
        &[[0.05, 0.5], [0.5, 0.4], [1.2, 0.6]],
    );
    stroke(&mut studio, alpha(0.9), &[[0.5, 0.0], [0.45, 0.95]]);
    stroke(
        &mut studio,
        brush(Tool::Erase, 0.05),
        &[[0.0, 0.6], [0.9, 0.3]],
    );
    let told = assert_covers_what_it_changes(&studio, "strokes", 0.3);
    // In any rectangle, and with the stroke in flight.
    let rect = Rect {
        x: 31,
        y: 7,
        width: 110,
        height: 80,
    };
    let of_rect = |all: &[f32]| -> Vec<f32> {
        let rows = (rect.y..rect.y + rect.height).map(|y| (y * 150 + rect.x) as usize);
        rows.flat_map(|from| all[from..from + rect.width as usize].to_vec())
            .collect()
    };
    assert_eq!(studio.coverage_in(rect).unwrap(), of_rect(&told));
    studio.begin_stroke(alpha(0.5), 1).unwrap();
    for x in [0.3, 0.6, 0.8] {
        studio.stroke_to(Point::new(Vec2::new(x, 0.2), 1.0).unwrap());
    }
    let live = studio.coverage_in(rect).unwrap();
    let more = of_rect(&shown(&studio));
    assert!(live.iter().zip(&more).all(|(a, b)| (a - b).abs() < 2e-3));
    assert_ne!(live, of_rect(&told));
    studio.cancel_stroke();
    let fill = Arc::new(Brush {
        tool: Tool::Fill(FillWith {
            alpha_x: Some(OVER),
            ..FillWith::default()
        }),
        flow: 0.5,
        ..Brush::default()
    });
    stroke(&mut studio, fill, &[[0.5, 0.5]]);
    let filled = assert_covers_what_it_changes(&studio, "fill", 0.5);
    assert!(filled.iter().zip(&told).all(|(a, b)| a + 1e-6 >= *b));
}

#[test]
fn a_layer_that_is_not_shown_covers_nothing() {
    let mut studio = painted();
    some_strokes(&mut studio);
    studio.select(0);
    assert!(
        coverage(&studio).iter().all(|c| *c == 1.0),
        "the ground is all there"
    );
    studio.set_solo(Some(2));
    assert!(studio.coverage().is_none());
    studio.set_solo(Some(0));
    studio.settle();
    assert!(coverage(&studio).iter().all(|c| *c == 1.0));
    studio.set_solo(None);
    let mut head = LayerHead::of(&studio.recipe().layers[0]);
    head.visible = false;
    studio.set_head(0, "Hide layer", head).unwrap();
    assert!(studio.coverage().is_none() && !studio.is_seen(0) && !studio.is_seen(9));
}

#[test]
fn of_a_painted_mask_it_is_what_was_painted() {
    let text = RECIPE.replace(
        "mask.polygon = [[0, 0], [0.6, 0], [0.6, 1], [0, 1]]",
        "mask.invert = true\nmask.start = 0.0\nmask.strokes.packed = []\nmask.strokes.brushes = []",
    );
    let mut studio = studio_of(&text);
    studio.select(2);
    let half = |studio: &Studio| {
        let all = coverage(studio);
        let at = |c: f32| all.iter().filter(|a| (**a - c).abs() < 1e-6).count();
        (at(0.0), at(1.0), at(0.5))
    };
    let texels = 320 * 200;
    assert_eq!(
        half(&studio),
        (0, 0, texels),
        "at half opacity, through a mask that hides nothing"
    );
    studio.select_mask(true);
    assert_eq!(half(&studio), (texels, 0, 0), "the mask as it was painted");
    stroke(
        &mut studio,
        brush(Tool::Groove(Groove::default()), 0.1),
        &[[0.2, 0.5], [0.8, 0.5]],
    );
    let (empty, full, _) = half(&studio);
    assert!(empty > 1000 && full > 1000);
    studio.select_mask(false);
    let (hidden, _, seen) = half(&studio);
    assert_eq!(
        (hidden, seen),
        (full, empty),
        "what was painted hides the layer"
    );
}

#[test]
fn it_is_the_same_for_any_number_of_threads() {
    let polygon = "polygon = [[0.2, 0.1], [0.9, 0.2], [0.8, 0.9], [0.1, 0.8]]\nfeather = 0.1\n";
    let pattern = "low = 0.4\nhigh = 0.6\n[layers.mask.brushed]\nangle = 135.0\n";
    let painted = "start = 0.3\n[layers.mask.strokes]\npacked = []\nbrushes = []\n";
    for mask in ["", polygon, pattern, painted] {
        let text = over_ground(PAINTED, "repeat");
        let (before, _) = text.split_once("[layers.mask]").unwrap();
        let mask = match mask {
            "" => String::new(),
            mask => format!("[layers.mask]\ninvert = true\n{mask}"),
        };
        let mut studio = studio_of(&format!("{before}{mask}{PAINTED}"));
        studio.select(1);
        some_strokes(&mut studio);
        let stack = studio.canvas.stack();
        let rect = Rect {
            x: 13,
            y: 5,
            width: 101,
            height: 83,
        };
        let covered: Vec<f32> = (0..rect.texels()).map(|i| (i % 17) as f32 / 16.0).collect();
        // A texel at a time, by the definition.
        let weight = stack.mask(1, rect);
        let weight = |i: usize| weight.as_ref().map_or(1.0, |all| all[i]);
        let want: Vec<f32> = (0..rect.texels())
            .map(|i| weight(i) * (covered[i] * 0.7))
            .collect();
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            let found = pool.install(|| stack.covered(1, rect, covered.clone()));
            assert!(found == want, "{threads} threads, {mask}");
        }
        let all = studio.map().size().rect();
        assert_eq!(
            studio.coverage_in(all).unwrap(),
            coverage(&studio),
            "{mask}"
        );
    }
}
