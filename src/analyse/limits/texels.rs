//! Rows 9 to 16 and 19: what texels are kept as, and what lies between them.

use super::shading::{Turned, mirrored};
use super::stage::Stage;
use super::{Evidence, relative, worst};
use crate::brdf::Model;
use crate::convention::MapInfo;
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_master};
use crate::export::{Export, png};
use crate::filter::Pyramid;
use crate::import::exr::read_master;
use crate::map::{
    ALPHA_MAX, ALPHA_MIN, AnisoMap, DEFAULT_TEXEL, Size, SlopeCovariance, Texel, Wrap,
};
use crate::math::{self, Axis};
use crate::mesh;
use crate::preview::texels_seen;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};
use glam::{DVec2, DVec3, Vec2};
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

/// Row 9. The master EXR in halves, written and read; the naive form keeps the matrix R diag(1/alpha²) Rᵀ in halves, which end
/// where 1/alpha² is over 65504. What halves cost a map, `inspect` tells where it is some percent.
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

/// Row 10. The 8-bit PNG of widths, written and read; the naive form has a linear scale, 20 % off just above 0.01, and under 0.003
/// nothing is left.
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

/// Row 11. The 8-bit PNG of the axis, written and read; the naive form has the angle, which is off by twice as much and cannot be
/// filtered. No 8-bit angle is written.
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

/// The map at texture coordinates: one by one, and in the two ways of the loops that light pictures.
fn fetched(map: &AnisoMap, uvs: &[Vec2]) -> [Vec<Texel>; 3] {
    let pyramid = Pyramid::new(map);
    [
        uvs.iter().map(|uv| map.sample(uv.x, uv.y)).collect(),
        texels_seen(&pyramid, uvs, false),
        texels_seen(&pyramid, uvs, true),
    ]
}

/// The blend of a number of the four texels around a point.
fn blend(map: &AnisoMap, uv: Vec2, of: impl Fn(usize) -> f32) -> f32 {
    let foot = map.footprint(uv.x, uv.y);
    (0..4).map(|k| of(foot.index[k]) * foot.weight[k]).sum()
}

/// The naive blend: of the angles.
fn angle(map: &AnisoMap, uv: Vec2) -> Axis {
    Axis::from_degrees(blend(map, uv, |i| map.texel_at(i).axis.degrees()))
}

/// Row 12. Neighbours of 1 and 179 degrees, in the map and over its seam, for maps that repeat both ways and around a cylinder.
/// The naive form blends the angles and gives 90 degrees.
pub(super) fn wrap() -> Result<Evidence> {
    let mut evidence = Evidence::NONE;
    for wrap in [Wrap::Repeat, Wrap::RepeatU] {
        let map = map_of(2, 1, wrap, |x, _| texel(0.1, 0.4, [1.0, 179.0][x as usize]))?;
        let uvs = [0.5, 0.0, 1.0, -3.0].map(|u| Vec2::new(u, 0.5));
        for uv in uvs {
            let naive = degrees_apart(Axis::U, Some(angle(&map, uv)));
            worst(&mut evidence.naive, naive);
        }
        for seen in fetched(&map, &uvs).into_iter().flatten() {
            worst(&mut evidence.ours, degrees_apart(Axis::U, Some(seen.axis)));
        }
    }
    Ok(evidence)
}

/// Row 13. A checker of 0 and 90 degrees, fetched on a fine grid, texels' middles and the lines between them included. The naive
/// form normalises the blend of double angles without a look, also where it has no length. Ours is round there, of the area of
/// the blended widths, and elsewhere has them and the direction of the nearer texels.
pub(super) fn crossings() -> Result<Evidence> {
    let map = map_of(4, 4, Wrap::Repeat, |x, y| Texel {
        axis: [Axis::U, Axis::V][((x + y) % 2) as usize],
        ..texel(0.1, 0.4, 0.0)
    })?;
    let at = |i: u16| Vec2::new(f32::from(i % 64), f32::from(i / 64)) / 64.0;
    let uvs: Vec<Vec2> = (0..64 * 64).map(at).collect();
    let all = fetched(&map, &uvs);
    let mut evidence = Evidence::NONE;
    for (i, uv) in uvs.iter().enumerate() {
        // All double angles of the checker lie along u's: (1, 0) and (-1, 0).
        let cos2 = blend(&map, *uv, |i| map.cos2()[i]);
        let is_lost = cos2.abs() < math::AXIS_MIN_LENGTH;
        evidence.naive += f64::from(!(cos2 / cos2.abs()).is_finite());
        let want = if is_lost {
            texel(0.2, 0.2, 0.0)
        } else {
            texel(0.1, 0.4, if cos2 > 0.0 { 0.0 } else { 90.0 })
        };
        let differs = |seen: &[Texel]| !alike(seen[i], want, is_lost);
        evidence.ours += all.iter().filter(|seen| differs(seen)).count() as f64;
    }
    Ok(evidence)
}

/// Whether a texel is the one that is wanted; of a round one the direction is nothing to go by, but must be one.
fn alike(seen: Texel, want: Texel, is_round: bool) -> bool {
    let near = |a: f32, b: f32| (a / b - 1.0).abs() < 1e-5;
    let unit = (seen.axis.double_angle().length() - 1.0).abs() < 1e-5;
    let direction = is_round || seen.axis.angle_to(want.axis) < 1e-4;
    near(seen.alpha_x, want.alpha_x) && near(seen.alpha_y, want.alpha_y) && unit && direction
}

/// Row 14. Halfway between grooves 30 degrees apart; the naive form blends the covariance, which is right for a footprint and swells
/// the narrow width between texels: ax'/ax = sqrt(1 + (ratio² - 1) sin²(half the angle)).
pub(super) fn magnified() -> Result<Evidence> {
    let map = map_of(2, 1, Wrap::Clamp, |x, _| {
        texel(0.08, 0.4, [20.0, 50.0][x as usize])
    })?;
    let (a, b) = (map.texel_at(0), map.texel_at(1));
    let mean = (SlopeCovariance::from(a) + SlopeCovariance::from(b)) * 0.5;
    let naive = mean.to_texel(false, a.axis);
    let error = |seen: Texel| {
        let x = relative(seen.alpha_x, a.alpha_x.into());
        x.max(relative(seen.alpha_y, a.alpha_y.into()))
    };
    let mut evidence = Evidence {
        naive: error(naive),
        ours: 0.0,
    };
    for seen in fetched(&map, &[Vec2::splat(0.5)]).into_iter().flatten() {
        worst(&mut evidence.ours, error(seen));
    }
    Ok(evidence)
}

/// Grooves that fan out along u, up to 30 degrees to both sides of it.
pub(super) fn fan() -> Result<AnisoMap> {
    map_of(64, 64, Wrap::Repeat, |x, _| {
        texel(0.06, 0.3, 60.0 * (x as f32 + 0.5) / 64.0 - 30.0)
    })
}

/// Widths and double angles averaged over a map.
pub(super) fn averaged(map: &AnisoMap) -> Texel {
    let texels = map.size().texels();
    let mean = |plane: &[f32]| plane.iter().sum::<f32>() / texels as f32;
    crate::map::settle(
        mean(map.alpha_x()),
        mean(map.alpha_y()),
        mean(map.cos2()),
        mean(map.sin2()),
    )
}

/// Row 15. A map seen whole in one pixel: the light that the preview draws there against the mean light of all its texels in f64, which
/// no single lobe has. The naive form averages widths and double angles and lights the mean. That the one lobe of a footprint, as
/// levels of a map and smaller maps hold it, has the mean covariance is asked of it in the tests.
pub(super) fn minified() -> Result<Evidence> {
    let map = fan()?;
    let plane = mesh::plane();
    let texels = map.size().texels();
    let lobes: Vec<Turned> = (0..texels).map(|i| Turned::new(map.texel_at(i))).collect();
    let one = Turned::new(averaged(&map));
    let mut evidence = Evidence::NONE;
    for slope in [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.12, 0.0),
        (0.0, 0.3),
        (0.1, -0.2),
    ] {
        let Some(l) = mirrored(DVec3::Z, slope.into()) else {
            continue;
        };
        let of = |lobe: &Turned| lobe.truth(Model::WardExact, l, DVec3::Z);
        let want = lobes.iter().map(of).sum::<f64>() / texels as f64;
        let stage = Stage {
            mesh: &plane,
            map: &map,
            model: Model::WardExact,
            extent: 2.0,
            toward: l.as_vec3(),
        };
        let ours = stage.draw(1)?.pixel(0, 0)[0];
        worst(&mut evidence.naive, relative(of(&one) as f32, want));
        worst(&mut evidence.ours, relative(ours, want));
    }
    Ok(evidence)
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
    let place = |i: u16| Vec2::new(f32::from(i % 256), f32::from(i / 256)) / 4.0;
    let far = |p: &Vec2| (2.0..30.0).contains(&at(p.x, p.y).length());
    let places: Vec<Vec2> = (0..256 * 255).map(place).filter(far).collect();
    let uv = |p: &Vec2| Vec2::new(p.x, side as f32 - p.y) / side as f32;
    let uvs: Vec<Vec2> = places.iter().map(uv).collect();
    let mut evidence = Evidence::NONE;
    let error = |place: Vec2, seen| degrees_apart(ring(at(place.x, place.y)), Some(seen));
    for (place, uv) in places.iter().zip(&uvs) {
        worst(&mut evidence.naive, error(*place, angle(&map, *uv)));
    }
    for seen in fetched(&map, &uvs) {
        for (place, seen) in places.iter().zip(seen) {
            worst(&mut evidence.ours, error(*place, seen.axis));
        }
    }
    Ok(evidence)
}

/// Writes a map file as another program might: any numbers whatever.
fn write_raw(path: &Path, size: Size, planes: &[Vec<f32>; 4]) -> Result<()> {
    let names = ["alpha.X", "alpha.Y", "axis.X", "axis.Y"];
    let channels = names.iter().zip(planes);
    let channels =
        channels.map(|(name, plane)| AnyChannel::new(*name, FlatSamples::F32(plane.clone())));
    let layer = Layer::new(
        (size.width() as usize, size.height() as usize),
        LayerAttributes::default(),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    );
    let image = Image::from_layer(layer);
    let written = image.write().to_file(path);
    written.map_err(|e| Error::file(path, e.to_string()))
}

/// Row 19. Three useless texels of 32 x 32 in an OpenEXR file, which is read, fetched all over and at every size of footprint. The
/// naive form keeps them: every fetch beside them is lost, and the mean of the map. Ours are counted and mended, and nothing but
/// sound numbers of the others' kind comes out.
pub(super) fn unreadable_texels() -> Result<Evidence> {
    let size = Size::new(32, 32)?;
    let mut planes = [0.1, 0.3, 1.0, 0.0].map(|x| vec![x; size.texels()]);
    planes[0][100] = f32::NAN;
    planes[1][555] = f32::INFINITY;
    planes[0][700] = -0.2;
    let read = with_folder(|folder| {
        let path = folder.join("raw.exr");
        write_raw(&path, size, &planes)?;
        read_master(&path)
    })?;
    let pyramid = Pyramid::new(&read.map);
    let at = |i: u16| (Vec2::new(f32::from(i % 64), f32::from(i / 64)) + 0.5) / 64.0;
    let uvs: Vec<Vec2> = (0..64 * 64).map(at).collect();
    let whole = planes.iter().flatten().sum::<f32>();
    let counted = (read.mended.non_finite, read.mended.out_of_range) == (2, 1);
    let mut evidence = Evidence {
        naive: f64::from(!whole.is_finite()),
        ours: f64::from(!counted),
    };
    for uv in &uvs {
        let widths = [0, 1].map(|c| blend(&read.map, *uv, |i| planes[c][i]));
        evidence.naive += f64::from(widths.iter().any(|w| !w.is_finite() || *w <= 0.0));
        for footprint in [0.01, 0.1, 1.0] {
            let seen = pyramid.sample(*uv, Vec2::X * footprint, Vec2::Y * footprint);
            evidence.ours += f64::from(!mended(seen));
        }
    }
    for seen in fetched(&read.map, &uvs).into_iter().flatten() {
        evidence.ours += f64::from(!mended(seen));
    }
    Ok(evidence)
}

/// Whether a texel lies between those of row 19 and what the useless ones become: the default, and the least width.
fn mended(t: Texel) -> bool {
    let between = |low: f32, high: f32, x: f32| (0.999 * low..=1.001 * high).contains(&x);
    let x = between(ALPHA_MIN, DEFAULT_TEXEL.alpha_x, t.alpha_x);
    let y = between(DEFAULT_TEXEL.alpha_y, 0.3, t.alpha_y);
    x && y && t.axis.angle_to(Axis::U) < 1e-4
}
