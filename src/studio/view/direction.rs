//! The direction of the x axis as hue: a turn of the wheel is half a turn of direction, since directions have no sign.

use super::levels::Averaged;
use super::palette::{self, COLOURS};
use crate::math;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use std::f32::consts::TAU;

/// What a texel without a direction looks like: dark, between all hues.
const NONE: [f32; 3] = [38.0, 38.0, 42.0];
/// How much of its colour a texel keeps that has a direction and next to no anisotropy.
const LEAST: f32 = 0.22;
/// The anisotropy (a² - b²) / (a² + b²) of the first texel in full colour: widths that differ by a half.
const FULL: f32 = 0.4;
/// Pixels at once.
const CHUNK: usize = 256;

/// What part of its colour a texel of anisotropy (a² - b²) / (a² + b²) has.
#[inline(always)]
pub(super) fn strength(anisotropy: f32) -> f32 {
    // The least weight of the averages is no anisotropy at all.
    let seen = math::smoothstep(0.004, FULL, anisotropy);
    let any = if anisotropy > 1e-6 { LEAST } else { 0.0 };
    any + (1.0 - any) * seen
}

#[simd]
fn places<S: Simd>(_: S, seen: &[Averaged], hues: &mut [u32], strengths: &mut [f32]) {
    let n = seen.len().min(CHUNK);
    let (hues, strengths) = (&mut hues[..n], &mut strengths[..n]);
    for i in 0..n {
        let [xx, yy, c, s] = seen[i];
        let sign = if xx > yy { 1.0 } else { -1.0 };
        let turn = math::atan2(sign * s, sign * c) * (COLOURS as f32 / TAU);
        hues[i] = math::whole(math::round_fast(turn)) as u32;
        let sum = 0.25 * (xx + yy);
        let anisotropy = (c * c + s * s).sqrt() / if sum > 1e-12 { sum } else { 1e-12 };
        strengths[i] = strength(anisotropy);
    }
}

pub(super) fn directions(seen: &[Averaged], rgba: &mut [u8]) {
    let table = palette::wheel();
    let (mut hues, mut strengths) = ([0; CHUNK], [0.0; CHUNK]);
    for (seen, rgba) in seen.chunks(CHUNK).zip(rgba.chunks_mut(4 * CHUNK)) {
        dispatch!(math::level(), simd => places(simd, seen, &mut hues, &mut strengths));
        for (i, out) in rgba.chunks_exact_mut(4).enumerate() {
            out.copy_from_slice(&toned(table[hues[i] as usize % COLOURS], strengths[i]));
        }
    }
}

/// A hue of the wheel at a strength of 0 to 1.
pub(super) fn toned(hue: [u8; 4], strength: f32) -> [u8; 4] {
    let [r, g, b] =
        [0, 1, 2].map(|c| (NONE[c] + (f32::from(hue[c]) - NONE[c]) * strength + 0.5) as u8);
    [r, g, b, 255]
}

/// The colour of an anisotropic texel whose x axis stands at `degrees`.
pub(super) fn hue(degrees: f32) -> [u8; 4] {
    let turn = (degrees / 180.0).rem_euclid(1.0) * COLOURS as f32;
    palette::wheel()[turn.round() as usize % COLOURS]
}
