//! The paper's two figures, as numbers: a pot whose highlight runs its full height, and a torus that only the map makes metal.

use anisomap::map::Size;
use anisomap::mesh::{self, pot};
use anisomap::preview::{Look, Picture, Scene, Subject, render};
use anisomap::progress::Progress;
use anisomap::raster::{Cull, Fragments, GBuffer, Geometry, View};
use anisomap::recipe::{Recipe, preset};

fn size(width: u32, height: u32) -> Size {
    Size::new(width, height).expect("a size")
}

fn recipe(name: &str) -> Recipe {
    preset(name)
        .expect("a preset")
        .recipe()
        .expect("it parses")
        .recipe()
        .clone()
}

fn draw(recipe: &Recipe, mesh: &mesh::Mesh, looks: &str, size: Size) -> Vec<Picture> {
    let prepared = recipe
        .prepare(recipe.size, &Default::default(), &Progress::none())
        .expect("a preset names no files");
    let map = prepared.map(&Progress::none()).expect("nobody cancels");
    let subject = Subject {
        mesh,
        map: &map,
        material: &recipe.material,
    };
    let looks = Look::list(looks).expect("known models");
    render(
        subject,
        &Scene::for_mesh(mesh),
        &looks,
        size,
        &Progress::none(),
    )
    .expect("nobody cancels")
}

/// Luminance as the picture shows it: nothing is brighter than white.
fn shown(c: [f32; 3]) -> f32 {
    let [r, g, b] = c.map(|x| x.clamp(0.0, 1.0));
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The largest piece of `inside` whose pixels touch, as (left, top, right, bottom), last ones included.
fn largest_piece(inside: &[bool], width: usize) -> (usize, usize, usize, usize) {
    let mut seen = vec![false; inside.len()];
    let (mut best, mut most) = ((0, 0, 0, 0), 0);
    for start in 0..inside.len() {
        if !inside[start] || seen[start] {
            continue;
        }
        seen[start] = true;
        let (mut stack, mut count) = (vec![start], 0);
        let (x, y) = (start % width, start / width);
        let mut bounds = (x, y, x, y);
        while let Some(i) = stack.pop() {
            count += 1;
            let (x, y) = (i % width, i / width);
            bounds = (
                bounds.0.min(x),
                bounds.1.min(y),
                bounds.2.max(x),
                bounds.3.max(y),
            );
            for (dx, dy) in [
                (-1i64, 0i64),
                (1, 0),
                (0, -1),
                (0, 1),
                (-1, -1),
                (1, -1),
                (-1, 1),
                (1, 1),
            ] {
                let (nx, ny) = (x as i64 + dx, y as i64 + dy);
                if nx < 0 || ny < 0 || nx >= width as i64 || ny >= (inside.len() / width) as i64 {
                    continue;
                }
                let next = ny as usize * width + nx as usize;
                if inside[next] && !seen[next] {
                    seen[next] = true;
                    stack.push(next);
                }
            }
        }
        if count > most {
            (best, most) = (bounds, count);
        }
    }
    best
}

#[test]
fn the_pots_highlight_runs_its_full_height() {
    let mesh = pot();
    let size = size(960, 720);
    let picture = draw(&recipe("pot"), &mesh, "ward", size).remove(0);
    // The pixels that show the wall.
    let view = View::new(&Scene::for_mesh(&mesh).camera, size).expect("a camera");
    let geometry = Geometry::new(&mesh).expect("a mesh that fits together");
    let buffer = GBuffer::draw(&geometry, &view, size.rect(), Cull::None, &Progress::none())
        .expect("nobody cancels");
    let width = size.width() as usize;
    let mut wall = vec![false; size.texels()];
    let mut fragments = Fragments::new();
    for tile in buffer.tiles() {
        tile.resolve(&geometry, buffer.corners(), false, &mut fragments);
        for i in (0..fragments.len()).filter(|i| pot::BODY.contains(fragments.uv(*i))) {
            let (x, y) = fragments.place(i);
            wall[y as usize * width + x as usize] = true;
        }
    }
    let light: Vec<f32> = picture
        .pixels()
        .iter()
        .zip(&wall)
        .map(|(c, w)| if *w { shown(*c) } else { 0.0 })
        .collect();
    let peak = light.iter().copied().fold(0.0, f32::max);
    let bright: Vec<bool> = light.iter().map(|l| *l >= 0.5 * peak).collect();
    let (left, top, right, bottom) = largest_piece(&bright, width);
    let (long, wide) = ((bottom - top + 1) as f32, (right - left + 1) as f32);
    // The wall's pictured height where the highlight stands.
    let column = (left + right) / 2;
    let rows = (0..size.height() as usize)
        .filter(|y| wall[y * width + column])
        .count() as f32;
    assert!(
        long >= 0.9 * rows,
        "the highlight covers {long} of {rows} rows"
    );
    assert!(
        long >= 5.0 * wide,
        "the highlight is {long} long and {wide} wide"
    );
}

/// Mean change of luminance from pixel to pixel along the rows that cross a torus, relative to its mean luminance: structure.
fn structure(picture: &Picture) -> f32 {
    let (mut change, mut sum) = (0.0, 0.0);
    for y in 1..picture.height() {
        for (a, b) in picture.row(y - 1).iter().zip(picture.row(y)) {
            change += (shown(*a) - shown(*b)).abs();
            sum += shown(*b);
        }
    }
    change / sum
}

#[test]
fn only_the_map_gives_the_torus_streaks() {
    let pictures = draw(
        &recipe("brushed_aluminium"),
        &mesh::torus(),
        "phong:mean,ward:mean,ward",
        size(600, 552),
    );
    let [phong, ward, with_map] = [0, 1, 2].map(|i| structure(&pictures[i]));
    assert!(
        with_map > 1.8 * ward && with_map > 1.8 * phong,
        "{phong} {ward} {with_map}"
    );
    assert!(
        (ward - phong).abs() > 0.05 * phong,
        "Ward stretches what Phong does not: {phong} {ward}"
    );
}
