//! Rows 9 to 16 and 19: what texels are kept as, and what lies between them.

use super::{Evidence, relative, worst};
use crate::convention::MapInfo;
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_master};
use crate::export::{Export, png};
use crate::filter::{Pyramid, Room};
use crate::import::exr::read_master;
use crate::map::{ALPHA_MAX, AnisoMap, DEFAULT_TEXEL, Size, SlopeCovariance, Texel, Wrap};
use crate::math::{self, Axis};
use glam::{DVec2, Vec2};
use half::f16;
use std::f64::consts::TAU;
use std::path::Path;

fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
    Texel {
        alpha_x,
        alpha_y,
        axis: Axis::from_degrees(degrees),
    }
}

fn map_of(width: u32, height: u32, wrap: Wrap, at: impl Fn(u32, u32) -> Texel) -> Result<AnisoMap> {
    let mut map = AnisoMap::constant(Size::new(width, height)?, wrap, DEFAULT_TEXEL);
    let mut region = map.region_mut();
    for y in 0..height {
        for x in 0..width {
            region.set((y * width + x) as usize, at(x, y));
        }
    }
    Ok(map)
}

/// exp(-k)/(alpha_x alpha_y) at a slope of the surface.
fn lobe(texel: Texel, slope: DVec2) -> f64 {
    let double = DVec2::new(texel.axis.cos2.into(), texel.axis.sin2.into());
    let (s, c) = (0.5 * double.y.atan2(double.x)).sin_cos();
    let (x, y) = (f64::from(texel.alpha_x), f64::from(texel.alpha_y));
    let (p, q) = (
        (c * slope.x + s * slope.y) / x,
        (c * slope.y - s * slope.x) / y,
    );
    (-(p * p + q * q)).exp() / (x * y)
}

/// Slopes up to two widths from the peak of a texel's lobe.
fn slopes(texel: Texel) -> impl Iterator<Item = DVec2> {
    let (c, s) = math::half_angle(texel.axis.cos2, texel.axis.sin2);
    let (c, s) = (f64::from(c), f64::from(s));
    (0..5 * 16).map(move |i| {
        let (sin, cos) = (TAU * f64::from(i % 16) / 16.0).sin_cos();
        let reach = 0.5 * f64::from(i / 16);
        let (p, q) = (
            reach * cos * f64::from(texel.alpha_x),
            reach * sin * f64::from(texel.alpha_y),
        );
        DVec2::new(c * p - s * q, s * p + c * q)
    })
}

/// A folder for the files of one piece of evidence, gone afterwards.
fn with_folder<T>(work: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
    let folder = tempfile::tempdir().map_err(Error::write(std::env::temp_dir()))?;
    work(folder.path())
}

/// Row 9. The master EXR in halves, written and read; the naive form keeps the matrix R diag(1/alpha²) Rᵀ in halves.
pub(super) fn halves() -> Result<Evidence> {
    let widths = [(0.05, 0.16), (0.02, 0.2), (0.01, 0.1), (0.003, 0.01)];
    let map = map_of(256, 4, Wrap::Repeat, |x, y| {
        let (alpha_x, alpha_y) = widths[y as usize];
        texel(alpha_x, alpha_y, 0.7 * x as f32 + 0.3)
    })?;
    let read = with_folder(|folder| {
        let path = folder.join("halves.exr");
        write_master(
            &path,
            &Export::new(&map, &MapInfo::default()),
            Precision::Half,
        )?;
        read_master(&path)
    })?;
    let mut evidence = Evidence::NONE;
    for i in 0..map.size().texels() {
        let (given, kept) = (map.texel_at(i), read.map.texel_at(i));
        for slope in slopes(given) {
            let want = lobe(given, slope);
            worst(
                &mut evidence.naive,
                relative(lobe_of_halves(given, slope), want),
            );
            worst(&mut evidence.ours, relative(lobe(kept, slope) as f32, want));
        }
    }
    Ok(evidence)
}

fn lobe_of_halves(texel: Texel, slope: DVec2) -> f32 {
    let (c, s) = math::half_angle(texel.axis.cos2, texel.axis.sin2);
    let (x, y) = (texel.alpha_x.powi(-2), texel.alpha_y.powi(-2));
    let rounded = |m: f32| f64::from(f16::from_f32(m).to_f32());
    let m00 = rounded(c * c * x + s * s * y);
    let m01 = rounded(c * s * (x - y));
    let m11 = rounded(s * s * x + c * c * y);
    let k = m00 * slope.x * slope.x + 2.0 * m01 * slope.x * slope.y + m11 * slope.y * slope.y;
    ((m00 * m11 - m01 * m01).sqrt() * (-k).exp()) as f32
}

/// The pixels of one of the 8-bit pictures that a map is written as, as shares of 255.
fn eight_bit(map: &AnisoMap, name: &str) -> Result<Vec<[f32; 2]>> {
    with_folder(|folder| {
        png::write_set(
            &folder.join("m"),
            &Export::new(map, &MapInfo::default()),
            png::Depth::Eight,
        )?;
        let path = folder.join(format!("m_{name}_8bit.png"));
        let picture = image::open(&path).map_err(|e| Error::file(&path, e.to_string()))?;
        let rgb = picture.to_rgb8();
        Ok(rgb
            .pixels()
            .map(|p| [p.0[0], p.0[1]].map(|b| f32::from(b) / 255.0))
            .collect())
    })
}

/// Row 10. The 8-bit PNG of widths, written and read; the naive form has a linear scale.
pub(super) fn eight_bit_widths() -> Result<Evidence> {
    let alpha = |x: u32| 0.01 * 150f32.powf(x as f32 / 2047.0);
    let map = map_of(2048, 1, Wrap::Repeat, |x, _| {
        texel(alpha(x).min(ALPHA_MAX), 0.2, 0.0)
    })?;
    let mut evidence = Evidence::NONE;
    for (i, v) in eight_bit(&map, "alpha_x")?.into_iter().enumerate() {
        let given = map.texel_at(i).alpha_x;
        let linear = ALPHA_MAX * (255.0 * given / ALPHA_MAX).round() / 255.0;
        worst(&mut evidence.naive, relative(linear, given.into()));
        worst(
            &mut evidence.ours,
            relative(ALPHA_MAX * v[0] * v[0], given.into()),
        );
    }
    Ok(evidence)
}

/// Row 11. The 8-bit PNG of the axis, written and read; the naive form has the angle.
pub(super) fn eight_bit_directions() -> Result<Evidence> {
    let map = map_of(997, 1, Wrap::Repeat, |x, _| {
        texel(0.1, 0.3, 180.0 * x as f32 / 997.0)
    })?;
    let mut evidence = Evidence::NONE;
    for (i, v) in eight_bit(&map, "axis")?.into_iter().enumerate() {
        let given = map.texel_at(i).axis;
        let level = (given.radians() / std::f32::consts::PI * 255.0).round();
        let angle = Axis::from_radians(level / 255.0 * std::f32::consts::PI);
        worst(&mut evidence.naive, degrees_apart(given, Some(angle)));
        let vector = Vec2::new(2.0 * v[0] - 1.0, 2.0 * v[1] - 1.0);
        worst(
            &mut evidence.ours,
            degrees_apart(given, Axis::from_double_angle(vector)),
        );
    }
    Ok(evidence)
}

fn degrees_apart(a: Axis, b: Option<Axis>) -> f64 {
    b.map_or(f64::INFINITY, |b| f64::from(a.angle_to(b).to_degrees()))
}

/// Row 12. Neighbours of 1 and 179 degrees, in the map and over its seam; the naive form blends the angles.
pub(super) fn wrap() -> Result<Evidence> {
    let map = map_of(2, 1, Wrap::Repeat, |x, _| {
        texel(0.1, 0.4, [1.0, 179.0][x as usize])
    })?;
    let mut evidence = Evidence::NONE;
    for u in [0.5, 0.0, 1.0, -3.0] {
        let foot = map.footprint(u, 0.5);
        let blend = foot.index.iter().zip(foot.weight);
        let angle = blend
            .map(|(&i, w)| map.texel_at(i).axis.degrees() * w)
            .sum();
        worst(
            &mut evidence.naive,
            degrees_apart(Axis::U, Some(Axis::from_degrees(angle))),
        );
        worst(
            &mut evidence.ours,
            degrees_apart(Axis::U, Some(map.sample(u, 0.5).axis)),
        );
    }
    Ok(evidence)
}

/// Row 13. A checker of 0 and 90 degrees, fetched on a fine grid; the naive form normalises without a look.
pub(super) fn crossings() -> Result<Evidence> {
    let map = map_of(4, 4, Wrap::Repeat, |x, y| Texel {
        axis: [Axis::U, Axis::V][((x + y) % 2) as usize],
        ..texel(0.1, 0.4, 0.0)
    })?;
    let (pyramid, mut room) = (Pyramid::new(&map), Room::new());
    let mut evidence = Evidence::NONE;
    for i in 0..64 * 64u16 {
        let uv = Vec2::new(f32::from(i % 64), f32::from(i / 64)) / 64.0;
        let mut raw = [[0.0f32]; 4];
        pyramid.fetch_plain(
            &mut room,
            &[uv.x],
            &[uv.y],
            raw.each_mut().map(|c| &mut c[..]),
        );
        let [_, _, [cos2], [sin2]] = raw;
        let length = (cos2 * cos2 + sin2 * sin2).sqrt();
        let (cos2, sin2) = (cos2 / length, sin2 / length);
        evidence.naive += f64::from(!(cos2 + sin2).is_finite());
        evidence.ours += f64::from(!usable(map.sample(uv.x, uv.y)));
    }
    Ok(evidence)
}

/// Whether a texel is what a map promises.
fn usable(t: Texel) -> bool {
    let unit = (t.axis.double_angle().length() - 1.0).abs() < 1e-4;
    let width = |a: f32| (crate::map::ALPHA_MIN..=ALPHA_MAX).contains(&a);
    unit && width(t.alpha_x) && width(t.alpha_y)
}

/// Row 14. Halfway between grooves 30 degrees apart; the naive form blends the covariance.
pub(super) fn magnified() -> Result<Evidence> {
    let map = map_of(2, 1, Wrap::Clamp, |x, _| {
        texel(0.08, 0.4, [20.0, 50.0][x as usize])
    })?;
    let (a, b) = (map.texel_at(0), map.texel_at(1));
    let mean = (SlopeCovariance::from(a) + SlopeCovariance::from(b)) * 0.5;
    let naive = mean.to_texel(false, a.axis).alpha_x;
    Ok(Evidence {
        naive: relative(naive, a.alpha_x.into()),
        ours: relative(map.sample(0.5, 0.5).alpha_x, a.alpha_x.into()),
    })
}

/// Row 15. A map seen whole in one pixel, its grooves within 30 degrees of u: the variance of slope along u of the lobe that
/// the pixel shows. The naive form averages widths and double angles.
pub(super) fn minified() -> Result<Evidence> {
    let map = map_of(64, 64, Wrap::Repeat, |x, y| {
        texel(
            0.06,
            0.3,
            60.0 * ((x * 7 + y * 13) % 64) as f32 / 63.0 - 30.0,
        )
    })?;
    let texels = map.size().texels();
    let all = || (0..texels).map(|i| map.texel_at(i));
    let want = all().map(variance_along_u).sum::<f64>() / texels as f64;
    let double = all().map(|t| t.axis.double_angle()).sum::<Vec2>();
    let naive = Axis::from_double_angle(double / texels as f32).map_or(f64::INFINITY, |axis| {
        variance_along_u(Texel {
            axis,
            ..map.texel_at(0)
        })
    });
    let seen = Pyramid::new(&map).sample(Vec2::splat(0.5), Vec2::X, Vec2::Y);
    Ok(Evidence {
        naive: relative(naive as f32, want),
        ours: relative(variance_along_u(seen) as f32, want),
    })
}

fn variance_along_u(t: Texel) -> f64 {
    let (x, y) = (f64::from(t.alpha_x).powi(2), f64::from(t.alpha_y).powi(2));
    0.25 * (x + y + (x - y) * f64::from(t.axis.cos2))
}

/// Row 16. A turned disc around its centre, fetched between texels two texels and more away from it; the naive form blends the
/// angles and meets their jump on a whole ray.
pub(super) fn radial_centre() -> Result<Evidence> {
    let side = 64u32;
    let ring = |p: Vec2| Axis::from_vector(p.perp()).unwrap_or(Axis::U);
    let at = |x: f32, y: f32| Vec2::new(x - 32.0, 32.0 - y);
    let map = map_of(side, side, Wrap::Clamp, |x, y| Texel {
        axis: ring(at(x as f32 + 0.5, y as f32 + 0.5)),
        ..texel(0.05, 0.3, 0.0)
    })?;
    let mut evidence = Evidence::NONE;
    for i in 0..256 * 255u16 {
        let (x, y) = (f32::from(i % 256) / 4.0, f32::from(i / 256) / 4.0);
        let p = at(x, y);
        if !(2.0..30.0).contains(&p.length()) {
            continue;
        }
        let (u, v) = (x / side as f32, 1.0 - y / side as f32);
        let foot = map.footprint(u, v);
        let blend = foot.index.iter().zip(foot.weight);
        let angle = blend
            .map(|(&i, w)| map.texel_at(i).axis.degrees() * w)
            .sum();
        worst(
            &mut evidence.naive,
            degrees_apart(ring(p), Some(Axis::from_degrees(angle))),
        );
        worst(
            &mut evidence.ours,
            degrees_apart(ring(p), Some(map.sample(u, v).axis)),
        );
    }
    Ok(evidence)
}

/// Row 19. Three useless texels of 32 x 32, fetched all over the map and at every size of footprint; the naive form keeps them.
pub(super) fn unreadable_texels() -> Result<Evidence> {
    let size = Size::new(32, 32)?;
    let mut planes = [0.1, 0.3, 1.0, 0.0].map(|x| vec![x; size.texels()]);
    planes[0][100] = f32::NAN;
    planes[1][555] = f32::INFINITY;
    planes[0][700] = -0.2;
    let raw = planes.clone();
    let (map, _) = AnisoMap::from_planes(size, Wrap::Repeat, planes)?;
    let pyramid = Pyramid::new(&map);
    let whole = raw.iter().flatten().sum::<f32>();
    let mut evidence = Evidence {
        naive: f64::from(!whole.is_finite()),
        ours: 0.0,
    };
    for i in 0..64 * 64u16 {
        let uv = Vec2::new(f32::from(i % 64) + 0.5, f32::from(i / 64) + 0.5) / 64.0;
        let foot = map.footprint(uv.x, uv.y);
        let blend =
            |plane: &[f32]| -> f32 { (0..4).map(|k| plane[foot.index[k]] * foot.weight[k]).sum() };
        let widths = [blend(&raw[0]), blend(&raw[1])];
        evidence.naive += f64::from(widths.iter().any(|w| !w.is_finite() || *w <= 0.0));
        for footprint in [0.01, 0.1, 1.0] {
            let seen = pyramid.sample(uv, Vec2::X * footprint, Vec2::Y * footprint);
            evidence.ours += f64::from(!usable(seen));
        }
    }
    Ok(evidence)
}
