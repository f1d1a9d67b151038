//! Pictures held against stored ones. With `ANISOMAP_UPDATE_GOLDEN` set they are stored instead; look at each before it goes in. A failure
//! leaves what was drawn and the difference in cargo's folder for test files.

use anisomap::preview::{Difference, Measure, Picture, linear_from_srgb};
use std::path::Path;

/// Steps of 255 that a channel may differ by, once and on the mean: the last bits of square roots and glyph outlines are the
/// platform's.
const LARGEST: u8 = 3;
const MEAN: f64 = 0.02;

fn save(picture: &Picture, path: &Path) {
    image::save_buffer(
        path,
        &picture.to_srgb8(),
        picture.width(),
        picture.height(),
        image::ColorType::Rgb8,
    )
    .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// Holds a picture against the stored one of that name, `folder/name`, or stores it.
pub(crate) fn compare(name: &str, picture: &Picture) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden")
        .join(format!("{name}.png"));
    if std::env::var_os("ANISOMAP_UPDATE_GOLDEN").is_some() {
        save(picture, &path);
        return;
    }
    let golden = image::open(&path)
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        .into_rgb8();
    assert_eq!(
        golden.dimensions(),
        (picture.width(), picture.height()),
        "{name}"
    );
    let drawn = picture.to_srgb8();
    let steps = || {
        drawn
            .iter()
            .zip(golden.as_raw())
            .map(|(a, b)| a.abs_diff(*b))
    };
    let largest = steps().max().unwrap_or(0);
    let mean = steps().map(f64::from).sum::<f64>() / drawn.len() as f64;
    if largest <= LARGEST && mean <= MEAN {
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let name = name.replace('/', "_");
    save(picture, &folder.join(format!("{name}.png")));
    let mut stored = Picture::new(picture.size(), [0.0; 3]);
    for (pixel, bytes) in stored.pixels_mut().iter_mut().zip(golden.pixels()) {
        *pixel = bytes.0.map(|b| linear_from_srgb(f32::from(b) / 255.0));
    }
    let difference = Difference::new(&stored, picture, Measure::DeltaE).expect("one size");
    save(
        &difference.picture().expect("a small picture"),
        &folder.join(format!("{name}_difference.png")),
    );
    panic!(
        "{name} differs by {largest} steps (mean {mean:.3}); what was drawn and the difference lie in {}",
        folder.display()
    );
}
