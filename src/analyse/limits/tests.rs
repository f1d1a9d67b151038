use super::shading::power_f64;
use super::*;
use crate::filter::Pyramid;
use crate::map::Texel;
use glam::{DVec2, DVec3, Vec2};
use std::path::Path;

#[test]
fn every_row_shows_the_usual_form_failing_and_ours_holding() {
    for limit in &LIMITS {
        let evidence = limit.evidence().unwrap();
        let what = format!("{} ({}): {evidence:?}", limit.number, limit.name);
        assert!(limit.breaks(evidence), "the usual form holds: {what}");
        assert!(limit.holds(evidence), "ours breaks: {what}");
    }
}

/// A form that is safe because it is dark must not pass: rows 2 to 7 compare light where there is some, for every model.
#[test]
fn no_light_at_all_fails_the_rows_that_count_bad_light() {
    for (row, points) in [
        (2, shading::horizon_points()),
        (3, shading::bent_points()),
        (4, shading::opposite_points()),
        (5, shading::grazing_points()),
        (6, shading::extreme_points()),
        (7, shading::tail_points()),
    ] {
        for model in SPECULAR {
            let wrong = shading::wrong_light(&[model], &points, |_, _| [0.0]);
            assert!(wrong >= 5, "row {row}, {model}: {wrong}");
        }
    }
}

/// What row 15 says of the one lobe that stands for many; the mean of widths and double angles has a third of the variance.
#[test]
fn the_mean_lobe_of_a_footprint_has_the_mean_variance() {
    let along_u = |t: Texel| {
        let (x, y) = (f64::from(t.alpha_x).powi(2), f64::from(t.alpha_y).powi(2));
        0.25 * (x + y + (x - y) * f64::from(t.axis.cos2))
    };
    let map = texels::fan().unwrap();
    let texels = map.size().texels();
    let all = (0..texels).map(|i| along_u(map.texel_at(i)));
    let want = all.sum::<f64>() / texels as f64;
    let seen = Pyramid::new(&map).sample(Vec2::splat(0.5), Vec2::X, Vec2::Y);
    assert!((along_u(seen) / want - 1.0).abs() < 1e-5);
    assert!(along_u(texels::averaged(&map)) / want < 0.5);
}

#[test]
fn the_rows_are_numbered_named_once_and_point_at_files() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (i, limit) in LIMITS.iter().enumerate() {
        assert_eq!(usize::from(limit.number), i + 1);
        assert!(LIMITS.iter().filter(|l| l.name == limit.name).count() == 1);
        assert!(limit.bound <= limit.broken, "{}", limit.name);
        for file in limit.place.split(", ") {
            assert!(src.join(file).is_file(), "{}: {file}", limit.name);
        }
    }
}

/// The limit form that row 20 measures the usual one against is the right one.
#[test]
fn the_power_of_the_half_vector_meets_the_reference() {
    let table = include_str!("../../../tests/reference/ward_reference.csv");
    let mut compared = 0;
    for line in table.lines().filter(|l| l.starts_with("ashikhmin")) {
        let n: Vec<f64> = line
            .split(',')
            .skip(1)
            .map_while(|f| f.parse().ok())
            .collect();
        let (l, v) = (
            DVec3::new(n[0], n[1], n[2]).normalize(),
            DVec3::new(n[3], n[4], n[5]).normalize(),
        );
        let exponents = 2.0 / DVec2::new(n[6] * n[6], n[7] * n[7]) - 2.0;
        let want = n[9] / n[8];
        if want < 1e-300 {
            continue;
        }
        let h = l + v;
        let norm =
            ((exponents.x + 1.0) * (exponents.y + 1.0)).sqrt() / (8.0 * std::f64::consts::PI);
        // l.h is half of |H|, which has its digits also where l and v are opposite.
        let got = norm * power_f64(h, exponents) / (0.5 * h.length() * l.z.max(v.z));
        assert!((got / want - 1.0).abs() < 1e-9, "{line}: {got}");
        compared += 1;
    }
    assert!(compared > 250, "{compared}");
}

#[test]
fn numbers_are_shown_with_their_units() {
    assert_eq!(Measure::Error.show(0.25), "25 %");
    assert_eq!(Measure::Error.show(0.0123), "1.2 %");
    assert_eq!(Measure::Error.show(1e-5), "1e-5");
    assert_eq!(Measure::Error.show(f64::INFINITY), "not finite");
    assert_eq!(Measure::Degrees.show(0.146), "0.15 degrees");
    assert_eq!(Measure::Count.show(0.0), "0 bad");
    assert_eq!(Measure::Samples.show(32.0), "32 wrong");
    assert!(table().lines().count() == LIMITS.len() + 2);
}
