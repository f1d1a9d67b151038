//! Ten million random inputs, strange ones among them, through every model: no NaN, no infinity, no negative light.

use anisomap::brdf::kernel::{Batch, prepare, shade as shade_batch};
use anisomap::brdf::{Model, shade, shade_f64};
use anisomap::math::levels;
use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Inputs of one task.
const CHUNK: usize = 1 << 13;
const INPUTS: usize = 10_000_000;
/// Inputs of the f64 forms.
const WIDE_INPUTS: usize = 1_000_000;

/// What rounding, division and roots make trouble of.
const SPECIAL: [f32; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    1e-45,
    -1e-45,
    1e-40,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    f32::MAX,
    f32::MIN,
    f32::EPSILON,
    0.999_999_94,
    -0.999_999_94,
    1.000_000_1,
    1e-4,
    1e-3,
    1e-20,
    1e20,
    1e-10,
    1e10,
];

/// Well mixed bits that depend on the number of the draw alone (SplitMix64, Steele et al. 2014).
fn bits(draw: u64) -> u64 {
    let z = draw.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Any 32 bits, a special number, a plain one, or a tiny or huge one of either sign.
fn number(bits: u64) -> f32 {
    let (kind, value) = ((bits >> 60) as u32, bits as u32);
    let unit = (value >> 8) as f32 / 16_777_216.0;
    match kind {
        0..=3 => f32::from_bits(value),
        4..=7 => SPECIAL[value as usize % SPECIAL.len()],
        8..=13 => 2.0 * unit - 1.0,
        _ => f32::from_bits((value & 0x8000_0000) | ((value >> 9) & 0x3fff_ffff)),
    }
}

/// Light, view, widths and double angle of an input: every other one with unit directions above the surface and widths of a
/// map, except for one number, so that what is strange does not hide behind what is stranger.
fn input(i: usize) -> [f32; 10] {
    let mut n = [0; 10].map(|_: i32| 0.0);
    for (k, x) in n.iter_mut().enumerate() {
        *x = number(bits(10 * i as u64 + k as u64));
    }
    if i.is_multiple_of(2) {
        let unit = |k: u64| (bits(!(10 * i as u64 + k)) >> 40) as f32 / 16_777_216.0;
        let strange = (bits(!(i as u64)) % 40) as usize;
        let kept = n.get(strange).copied();
        let up = |a: f32, b: f32| {
            let (z, turn) = (a * a, std::f32::consts::TAU * b);
            let r = (1.0 - z * z).max(0.0).sqrt();
            [r * turn.cos(), r * turn.sin(), z]
        };
        n[..3].copy_from_slice(&up(unit(0), unit(1)));
        n[3..6].copy_from_slice(&up(unit(2), unit(3)));
        let width = |x: f32| 1e-3 * 1500f32.powf(x);
        (n[6], n[7]) = (width(unit(4)), width(unit(5)));
        (n[9], n[8]) = (std::f32::consts::TAU * unit(6)).sin_cos();
        if let Some(kept) = kept {
            n[strange] = kept;
        }
    }
    n
}

fn light(x: f64) -> bool {
    (0.0..f64::INFINITY).contains(&x)
}

/// Inputs in arrays of their own, texels prepared as the preview prepares them.
struct Lanes {
    arrays: [Vec<f32>; 10],
}

impl Lanes {
    fn new(inputs: &[[f32; 10]]) -> Self {
        let mut arrays = [const { Vec::new() }; 10];
        for n in inputs {
            let lobe = prepare(n[6], n[7], n[8], n[9]);
            for (k, array) in arrays.iter_mut().enumerate() {
                array.push(if k < 6 { n[k] } else { lobe[k - 6] });
            }
        }
        Self { arrays }
    }

    /// The same without preparing: the loops take whatever stands in the arrays.
    fn raw(inputs: &[[f32; 10]]) -> Self {
        let mut arrays = [const { Vec::new() }; 10];
        for n in inputs {
            for (array, x) in arrays.iter_mut().zip(n) {
                array.push(*x);
            }
        }
        Self { arrays }
    }

    fn batch(&self) -> Batch<'_> {
        let a = |k: usize| &self.arrays[k][..];
        Batch {
            light: [0, 1, 2].map(a),
            view: [3, 4, 5].map(a),
            lobe: [6, 7, 8, 9].map(a),
        }
    }
}

#[test]
fn no_input_whatever_gives_a_bad_value() {
    (0..INPUTS.div_ceil(CHUNK))
        .into_par_iter()
        .for_each(|chunk| {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(INPUTS);
            let inputs: Vec<_> = range.map(input).collect();
            let (prepared, raw) = (Lanes::new(&inputs), Lanes::raw(&inputs));
            let mut out = vec![f32::NAN; inputs.len()];
            for model in Model::ALL {
                for n in &inputs {
                    let (l, v) = (Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]));
                    let f = shade(model, l, v, Vec2::new(n[6], n[7]));
                    assert!(light(f.into()), "{model} {n:?}: {f}");
                }
                for (name, level) in levels() {
                    for lanes in [&prepared, &raw] {
                        shade_batch(level, model, &lanes.batch(), &mut out);
                        for (f, n) in out.iter().zip(&inputs) {
                            assert!(light(f64::from(*f)), "{model} at {name} {n:?}: {f}");
                        }
                    }
                }
            }
        });
}

#[test]
fn no_input_whatever_gives_a_bad_value_in_f64() {
    (0..WIDE_INPUTS).into_par_iter().for_each(|i| {
        // Some of them past f32.
        let scale = [1.0, 1e-300, 1e300, 1.0][i % 4];
        let n = input(i).map(|x| {
            if i.is_multiple_of(3) {
                f64::from(x) * scale
            } else {
                x.into()
            }
        });
        for model in Model::ALL {
            let (l, v) = (DVec3::new(n[0], n[1], n[2]), DVec3::new(n[3], n[4], n[5]));
            let f = shade_f64(model, l, v, DVec2::new(n[6], n[7]));
            assert!(light(f), "{model} {n:?}: {f}");
        }
    });
}

/// The sweep is worth something: it meets light, darkness, and every kind of strange number in every place.
#[test]
fn the_inputs_are_as_strange_as_they_should_be() {
    let (mut lit, mut kinds) = (0, [[0; 5]; 10]);
    for i in 0..100_000 {
        let n = input(i);
        let (l, v) = (Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]));
        lit += usize::from(shade(Model::Ggx, l, v, Vec2::new(n[6], n[7])) > 1e-6);
        for (kinds, x) in kinds.iter_mut().zip(n) {
            kinds[0] += usize::from(x.is_nan());
            kinds[1] += usize::from(x.is_infinite());
            kinds[2] += usize::from(x.is_subnormal());
            kinds[3] += usize::from(x == 0.0 && x.is_sign_negative());
            kinds[4] += usize::from(x < 0.0);
        }
    }
    assert!(lit > 30_000, "{lit}");
    assert!(kinds.iter().flatten().all(|n| *n > 300), "{kinds:?}");
}
