use super::shading::power_f64;
use super::*;
use glam::{DVec2, DVec3};
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
