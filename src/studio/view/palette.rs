//! The colours of the views, spaced evenly to the eye: equal steps along a table are equal distances in Oklab (Ottosson 2020).

use crate::math;
use crate::preview::srgb_from_linear;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Colours in a table: fine enough that no step shows.
pub(super) const COLOURS: usize = 1024;

/// Opaque RGBA, sRGB-encoded, of evenly spaced colours.
pub(super) type Table = [[u8; 4]; COLOURS];

/// Lightness, and the green-red and blue-yellow axes.
type Oklab = [f32; 3];

/// From dark violet over blue and green to yellow: ten colours of viridis (van der Walt and Smith 2015, CC0).
const RISING: [u32; 10] = [
    0x44_01_54, 0x48_28_78, 0x3e_49_89, 0x31_68_8e, 0x26_82_8e, 0x1f_9e_89, 0x35_b7_79, 0x6e_ce_58,
    0xb5_de_2b, 0xfd_e7_25,
];

/// Lightness, chroma and hue in degrees from dark blue to the light middle, and on to dark red; halves of equal lightness.
const BELOW: [[f32; 3]; 4] = [
    [0.30, 0.11, 265.0],
    [0.50, 0.13, 255.0],
    [0.74, 0.09, 235.0],
    [0.965, 0.0, 235.0],
];
const ABOVE: [[f32; 3]; 4] = [
    [0.965, 0.0, 65.0],
    [0.74, 0.13, 55.0],
    [0.50, 0.15, 35.0],
    [0.30, 0.11, 22.0],
];

/// From yellow to red.
const HEAT: [[f32; 3]; 4] = [
    [0.94, 0.13, 108.0],
    [0.81, 0.16, 76.0],
    [0.68, 0.20, 42.0],
    [0.55, 0.21, 22.0],
];

/// Lightness and chroma of the wheel: the most chroma that every hue of that lightness has in sRGB.
const WHEEL: [f32; 2] = [0.74, 0.122];
/// The hue of horizontal, in degrees: red; vertical is then a green blue.
const WHEEL_START: f32 = 22.0;

/// For amounts: small is dark.
pub(super) fn rising() -> &'static Table {
    static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| {
        let curve = RISING.map(|c| from_srgb8([16, 8, 0].map(|s| (c >> s) as u8)));
        table(even(&curve, COLOURS))
    });
    &TABLE
}

/// For factors: blue below 1, light at 1, red above.
pub(super) fn diverging() -> &'static Table {
    static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| {
        let mut colours = even(&BELOW.map(polar), COLOURS / 2);
        colours.extend(even(&ABOVE.map(polar), COLOURS / 2));
        table(colours)
    });
    &TABLE
}

/// For what is bad: red is worse.
pub(super) fn heat() -> &'static Table {
    static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| table(even(&HEAT.map(polar), COLOURS)));
    &TABLE
}

/// For directions: a turn of hue, half a turn of direction.
pub(super) fn wheel() -> &'static Table {
    static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| {
        let [lightness, chroma] = WHEEL;
        let hue = |i: usize| WHEEL_START + 360.0 * i as f32 / COLOURS as f32;
        table(
            (0..COLOURS)
                .map(|i| polar([lightness, chroma, hue(i)]))
                .collect(),
        )
    });
    &TABLE
}

fn table(colours: Vec<Oklab>) -> Box<Table> {
    let mut table = Box::new([[0; 4]; COLOURS]);
    for (out, colour) in table.iter_mut().zip(colours) {
        let [r, g, b] = to_linear(colour).map(|c| (srgb_from_linear(c) * 255.0 + 0.5) as u8);
        *out = [r, g, b, 255];
    }
    table
}

/// `count` colours along a smooth curve through some, at equal distances from each other.
fn even(through: &[Oklab], count: usize) -> Vec<Oklab> {
    const FINE: usize = 512;
    let last = through.len() - 1;
    let fine: Vec<Oklab> = (0..=last * FINE)
        .map(|i| {
            let (k, t) = ((i / FINE).min(last - 1), i as f32 / FINE as f32);
            smooth(through, k, t - k as f32)
        })
        .collect();
    let mut lengths = vec![0.0];
    for pair in fine.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + distance(pair[0], pair[1]));
    }
    let whole = lengths[lengths.len() - 1];
    (0..count)
        .map(|i| {
            let at = whole * i as f32 / (count - 1) as f32;
            let k = lengths
                .partition_point(|l| *l < at)
                .clamp(1, fine.len() - 1);
            let t = (at - lengths[k - 1]) / (lengths[k] - lengths[k - 1]).max(f32::MIN_POSITIVE);
            [0, 1, 2].map(|c| fine[k - 1][c] + (fine[k][c] - fine[k - 1][c]) * t)
        })
        .collect()
}

/// The cubic of Catmull and Rom (1974) between points `k` and `k + 1`.
fn smooth(through: &[Oklab], k: usize, t: f32) -> Oklab {
    let last = through.len() - 1;
    [0, 1, 2].map(|c| {
        let p = |i: usize| through[i.min(last)][c];
        let before = if k > 0 { p(k - 1) } else { 2.0 * p(0) - p(1) };
        let after = if k + 2 <= last {
            p(k + 2)
        } else {
            2.0 * p(last) - p(last - 1)
        };
        let (a, b) = (p(k), p(k + 1));
        let cubic = 3.0 * (a - b) + after - before;
        let square = 2.0 * before - 5.0 * a + 4.0 * b - after;
        a + 0.5 * t * (b - before + t * (square + t * cubic))
    })
}

fn distance(a: Oklab, b: Oklab) -> f32 {
    (0..3)
        .map(|c| (a[c] - b[c]) * (a[c] - b[c]))
        .sum::<f32>()
        .sqrt()
}

fn polar([lightness, chroma, hue]: [f32; 3]) -> Oklab {
    let (sin, cos) = math::sin_cos((hue / 360.0).fract() * TAU);
    [lightness, chroma * cos, chroma * sin]
}

fn to_linear([l, a, b]: Oklab) -> [f32; 3] {
    let [l, m, s] = [
        l + 0.396_337_78 * a + 0.215_803_76 * b,
        l - 0.105_561_346 * a - 0.063_854_17 * b,
        l - 0.089_484_18 * a - 1.291_485_5 * b,
    ]
    .map(|x| x * x * x);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
}

fn from_srgb8(code: [u8; 3]) -> Oklab {
    let [r, g, b] = code.map(|c| crate::preview::linear_from_srgb(f32::from(c) / 255.0));
    let [l, m, s] = [
        0.412_221_46 * r + 0.536_332_55 * g + 0.051_445_995 * b,
        0.211_903_5 * r + 0.680_699_5 * g + 0.107_396_96 * b,
        0.088_302_46 * r + 0.281_718_85 * g + 0.629_978_7 * b,
    ]
    .map(f32::cbrt);
    [
        0.210_454_26 * l + 0.793_617_8 * m - 0.004_072_047 * s,
        1.977_998_5 * l - 2.428_592_2 * m + 0.450_593_7 * s,
        0.025_904_037 * l + 0.782_771_77 * m - 0.808_675_77 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(table: &Table, from: usize, to: usize, stride: usize) -> Vec<f32> {
        let at = |i: usize| from_srgb8([table[i][0], table[i][1], table[i][2]]);
        (from..to - stride)
            .step_by(stride)
            .map(|i| distance(at(i), at(i + stride)))
            .collect()
    }

    fn spread(steps: &[f32]) -> f32 {
        let (low, high) = steps
            .iter()
            .fold((f32::MAX, 0.0f32), |(l, h), s| (l.min(*s), h.max(*s)));
        high / low
    }

    #[test]
    fn oklab_goes_there_and_back() {
        for code in [[0, 0, 0], [255, 255, 255], [12, 200, 99], [255, 0, 0]] {
            let back = to_linear(from_srgb8(code)).map(|c| (srgb_from_linear(c) * 255.0).round());
            assert_eq!(back.map(|c| c as u8), code);
        }
        let white = from_srgb8([255; 3]);
        assert!((white[0] - 1.0).abs() < 1e-3 && white[1].abs() < 1e-3 && white[2].abs() < 1e-3);
    }

    #[test]
    fn equal_steps_look_equal() {
        // Of steps this long 8-bit codes and the bend of the curve are about a tenth.
        let half = COLOURS / 2;
        for (table, from, to) in [
            (rising(), 0, COLOURS),
            (diverging(), 0, half),
            (diverging(), half, COLOURS),
            (wheel(), 0, COLOURS),
            (heat(), 0, COLOURS),
        ] {
            let spread = spread(&steps(table, from, to, 64));
            assert!(spread < 1.15, "{spread}");
        }
    }

    #[test]
    fn amounts_grow_lighter_and_the_wheel_is_all_of_one_lightness() {
        let light = |c: [u8; 4]| from_srgb8([c[0], c[1], c[2]])[0];
        assert!(
            rising()
                .windows(2)
                .all(|w| light(w[1]) > light(w[0]) - 3e-3)
        );
        assert!(wheel().iter().all(|&c| (light(c) - WHEEL[0]).abs() < 4e-3));
        // No hue of the wheel is clipped.
        for i in 0..360u16 {
            let colour = polar([WHEEL[0], WHEEL[1], f32::from(i)]);
            let linear = to_linear(colour);
            assert!(
                linear.iter().all(|c| (-1e-3..=1.001).contains(c)),
                "{i}: {linear:?}"
            );
        }
        let middle = diverging()[COLOURS / 2];
        assert!(light(middle) > 0.95);
    }
}
