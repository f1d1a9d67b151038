//! The map as two 8-bit textures: roughness, and direction with strength.
//!
//! Roughness and strength are scaled by their largest values, which go into the material as factors. The strength is solved
//! against the roughness as it was rounded, so that the two errors do not add up; and of the two roughness steps next to a
//! texel's value the one is taken that leaves the smaller error in the worse of both widths.

use super::GltfReport;
use crate::convention::LobeFit;
use crate::convention::gltf::strength;
use crate::export::png::{Pixels, half_and_half, to_u8};
use crate::filter::{Line, Surroundings, comb, is_round};
use crate::map::AnisoMap;
use glam::Vec2;
use rayon::prelude::*;
use std::sync::Mutex;

/// The two pictures and what they lost.
pub(super) struct Textures {
    /// G = r / r_max, R = B = 1.
    pub(super) roughness: Pixels,
    /// R, G = direction, B = s / s_max.
    pub(super) anisotropy: Pixels,
    pub(super) report: GltfReport,
}

/// Where the smaller width is below this share of its largest value in the map, 8 bits of roughness are worse than 2 %.
const FINE_SHARE: f32 = 0.04;

pub(super) fn textures(map: &AnisoMap, fit: LobeFit) -> Textures {
    let largest_b = largest_smaller_width(map);
    let steps = Steps::new(map, fit, largest_b);
    let losses = Mutex::new(Losses::default());
    let width = map.width() as usize;
    // Which step each texel took, for the two pictures.
    let mut strengths = vec![0u8; map.size().texels()];
    let mut roughnesses = vec![0u8; map.size().texels()];
    strengths
        .par_chunks_mut(width)
        .zip(roughnesses.par_chunks_mut(width))
        .enumerate()
        .for_each_init(
            || Fitted::new(map),
            |row, (y, (s, r))| {
                row.fill(map, fit, y);
                let mut own = Losses::default();
                for x in 0..width {
                    (r[x], s[x]) = steps.nearest(row.gltf_t[x], row.gltf_b[x]);
                    let fine = row.ward_b[x] >= FINE_SHARE * largest_b;
                    own.count(&steps, row, x, (r[x], s[x]), fine);
                }
                losses.lock().expect("no holder panics").take_worst(own);
            },
        );
    let row = |plane: &[u8], y: u32| plane[y as usize * width..][..width].to_vec();
    let roughness = Pixels::rgb8(map.size(), |y, pixels| {
        for (pixel, r) in pixels.iter_mut().zip(row(&roughnesses, y)) {
            *pixel = [255, r, 255];
        }
    });
    let combed = comb(map, Line::Stretched);
    let around = Surroundings::new(&combed);
    let anisotropy = Pixels::rgb8(map.size(), |y, pixels| {
        let (mut cos, mut sin) = (vec![0.0; width], vec![0.0; width]);
        combed.row(y, &mut cos, &mut sin);
        let mut worst = 0.0f32;
        for (x, (pixel, s)) in pixels.iter_mut().zip(row(&strengths, y)).enumerate() {
            let i = y as usize * width + x;
            let own = Vec2::new(cos[x], sin[x]);
            let round = is_round(map.alpha_x()[i], map.alpha_y()[i]);
            let filled = around.as_ref().filter(|_| round);
            let d = filled.and_then(|a| a.direction(x as u32, y)).unwrap_or(own);
            let rg = [to_u8(half_and_half(d.x)), to_u8(half_and_half(d.y))];
            if !round {
                worst = worst.max(sine_of_error(own, rg));
            }
            *pixel = [rg[0], rg[1], s];
        }
        let mut losses = losses.lock().expect("no holder panics");
        losses.sine = losses.sine.max(worst);
    });
    let losses = losses.into_inner().expect("no holder panics");
    Textures {
        roughness,
        anisotropy,
        report: GltfReport {
            lobe_fit: fit,
            size: [map.width(), map.height()],
            roughness_factor: steps.r_max,
            strength_factor: steps.s_max,
            clamped: losses.clamped,
            clamp_error: losses.clamp_error,
            alpha_error: losses.fine,
            alpha_error_elsewhere: losses.coarse,
            angle_error: losses.sine.clamp(0.0, 1.0).asin().to_degrees(),
        },
    }
}

/// A row as larger (t) and smaller (b) widths, Ward's and the target's.
struct Fitted {
    ward_t: Vec<f32>,
    ward_b: Vec<f32>,
    gltf_t: Vec<f32>,
    gltf_b: Vec<f32>,
}

impl Fitted {
    fn new(map: &AnisoMap) -> Self {
        let row = || vec![0.0; map.width() as usize];
        Self {
            ward_t: row(),
            ward_b: row(),
            gltf_t: row(),
            gltf_b: row(),
        }
    }

    fn fill(&mut self, map: &AnisoMap, fit: LobeFit, y: usize) {
        let width = self.ward_t.len();
        let (ax, ay) = (&map.alpha_x()[y * width..], &map.alpha_y()[y * width..]);
        for x in 0..width {
            self.ward_t[x] = ax[x].max(ay[x]);
            self.ward_b[x] = ax[x].min(ay[x]);
        }
        // Loops over one slice each, so that they vectorise.
        for (to, from) in [
            (&mut self.gltf_t, &self.ward_t),
            (&mut self.gltf_b, &self.ward_b),
        ] {
            for (to, from) in to.iter_mut().zip(from) {
                *to = fit.apply(*from);
            }
        }
    }
}

fn largest_smaller_width(map: &AnisoMap) -> f32 {
    map.alpha_x()
        .par_iter()
        .with_min_len(1 << 14)
        .zip(map.alpha_y())
        .map(|(x, y)| x.min(*y))
        .reduce(|| 0.0, f32::max)
}

/// |sin| of the angle between a unit vector and what a reader makes of its two bytes.
fn sine_of_error(d: Vec2, rg: [u8; 2]) -> f32 {
    let read = Vec2::new(f32::from(rg[0]), f32::from(rg[1])) / 127.5 - Vec2::ONE;
    d.perp_dot(read).abs() / read.length()
}

/// What each step of the two 8-bit channels stands for.
struct Steps {
    r_max: f32,
    s_max: f32,
    /// The target's alpha_b of each roughness step.
    alpha_b: [f32; 256],
    /// The square of each strength step.
    s_squared: [f32; 256],
    /// The Ward alpha_b a reader gets for each roughness step.
    ward_b: Vec<f32>,
    /// The Ward alpha_t a reader gets, at `r * 256 + s`.
    ward_t: Vec<f32>,
}

impl Steps {
    fn new(map: &AnisoMap, fit: LobeFit, largest_b: f32) -> Self {
        let r_max = fit.apply(largest_b).min(1.0).sqrt();
        let alpha_b: [f32; 256] = std::array::from_fn(|r| {
            let r = r as f32 * (1.0 / 255.0) * r_max;
            r * r
        });
        let s_max = (0..map.height() as usize)
            .into_par_iter()
            .map_init(
                || Fitted::new(map),
                |row, y| {
                    row.fill(map, fit, y);
                    let widths = row.gltf_t.iter().zip(&row.gltf_b);
                    let strengths = widths.map(|(t, b)| {
                        let r = step(b.min(1.0).sqrt(), r_max).max(1);
                        strength(*t, alpha_b[usize::from(r)])
                    });
                    strengths.fold(0.0, f32::max)
                },
            )
            .reduce(|| 0.0, f32::max);
        let s_squared: [f32; 256] = std::array::from_fn(|s| {
            let s = s as f32 * (1.0 / 255.0) * s_max;
            s * s
        });
        let ward_b = alpha_b
            .map(|b| fit.invert(b.max(f32::MIN_POSITIVE)))
            .to_vec();
        let ward_t = (0..1 << 16)
            .into_par_iter()
            .map(|i| {
                let (b, s) = (alpha_b[i >> 8], s_squared[i & 255]);
                fit.invert((b + (1.0 - b) * s).max(f32::MIN_POSITIVE))
            })
            .collect();
        Self {
            r_max,
            s_max,
            alpha_b,
            s_squared,
            ward_b,
            ward_t,
        }
    }

    /// The steps of roughness and strength for a texel of the target's widths.
    fn nearest(&self, alpha_t: f32, alpha_b: f32) -> (u8, u8) {
        let (alpha_t, alpha_b) = (alpha_t.min(1.0), alpha_b.min(1.0));
        let r = alpha_b.sqrt();
        let first = step(r, self.r_max).max(1);
        let above = r * 255.0 > f32::from(first) * self.r_max;
        let second = if above {
            first.saturating_add(1)
        } else {
            first - 1
        }
        .max(1);
        let candidate = |r: u8| {
            let b = self.alpha_b[usize::from(r)];
            let s = step(strength(alpha_t, b), self.s_max);
            let t = b + (1.0 - b) * self.s_squared[usize::from(s)];
            let worse = (b - alpha_b).abs() * alpha_t;
            (worse.max((t - alpha_t).abs() * alpha_b), (r, s))
        };
        let (p, q) = (candidate(first), candidate(second));
        if q.0 < p.0 { q.1 } else { p.1 }
    }
}

/// The nearest of 256 steps of `value` in 0 ..= `largest`; 0 where the largest is 0.
fn step(value: f32, largest: f32) -> u8 {
    if largest > 0.0 {
        to_u8((value / largest).min(1.0))
    } else {
        0
    }
}

/// The worst of a row.
#[derive(Clone, Copy, Default)]
struct Losses {
    clamped: u64,
    clamp_error: f32,
    fine: f32,
    coarse: f32,
    sine: f32,
}

impl Losses {
    fn count(&mut self, steps: &Steps, row: &Fitted, x: usize, (r, s): (u8, u8), fine: bool) {
        let off = |read: f32, is: f32| (read / is - 1.0).abs();
        let (r, s) = (usize::from(r), usize::from(s));
        let error_t = off(steps.ward_t[r << 8 | s], row.ward_t[x]);
        let error = off(steps.ward_b[r], row.ward_b[x]).max(error_t);
        let worst = if row.gltf_t[x] > 1.0 {
            self.clamped += 1;
            &mut self.clamp_error
        } else if fine {
            &mut self.fine
        } else {
            &mut self.coarse
        };
        *worst = worst.max(error);
    }

    fn take_worst(&mut self, other: Self) {
        self.clamped += other.clamped;
        self.clamp_error = self.clamp_error.max(other.clamp_error);
        self.fine = self.fine.max(other.fine);
        self.coarse = self.coarse.max(other.coarse);
        self.sine = self.sine.max(other.sine);
    }
}
