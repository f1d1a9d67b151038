//! Rectangles of texels, owned or borrowed, in the map's own planar layout.

use super::{ALPHA_MAX, ALPHA_MIN, DEFAULT_TEXEL, Mended, Texel, settle};
use crate::error::{Error, Result};
use crate::math::Axis;
use std::fmt;

/// The most texels a side may have.
pub const SIDE_MAX: u32 = 32_768;
/// The most texels a map may have: 16384 x 16384, 4 GiB of planes.
pub const TEXELS_MAX: u64 = 1 << 28;

/// A checked size in texels: sides of 1 to 32768, at most 2^28 texels in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    width: u32,
    height: u32,
}

impl Size {
    /// A size.
    ///
    /// # Errors
    /// When a side is 0 or over [`SIDE_MAX`], or the product is over [`TEXELS_MAX`].
    pub fn new(width: u32, height: u32) -> Result<Self> {
        let texels = u64::from(width) * u64::from(height);
        if width == 0 || height == 0 || width > SIDE_MAX || height > SIDE_MAX || texels > TEXELS_MAX
        {
            return Err(Error::invalid(
                "size",
                format!("{width}x{height}"),
                format!("allowed: sides of 1 to {SIDE_MAX} texels, at most 16384x16384 in all"),
            ));
        }
        Ok(Self { width, height })
    }

    /// Width in texels.
    pub fn width(self) -> u32 {
        self.width
    }

    /// Height in texels.
    pub fn height(self) -> u32 {
        self.height
    }

    /// Width times height.
    pub fn texels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The rectangle of the whole map.
    pub fn rect(self) -> Rect {
        Rect {
            x: 0,
            y: 0,
            width: self.width,
            height: self.height,
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl std::str::FromStr for Size {
    type Err = Error;

    /// `1024` or `1000x600`.
    fn from_str(s: &str) -> Result<Self> {
        let bad = || {
            Error::invalid(
                "size",
                format!("`{s}`"),
                "allowed: N or WxH, in texels, as in 1024 or 1000x600",
            )
        };
        let side = |t: &str| -> Result<u32> {
            let n: u64 = t.trim().parse().map_err(|_| bad())?;
            // Numbers past u32 are still numbers: let the range check speak.
            Ok(u32::try_from(n).unwrap_or(u32::MAX))
        };
        match s.split_once(['x', 'X']) {
            Some((w, h)) => Self::new(side(w)?, side(h)?),
            None => side(s).and_then(|n| Self::new(n, n)),
        }
    }
}

/// A rectangle of texels; `y` counts down from the top row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Rect {
    /// Width times height.
    pub fn texels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The size without the place.
    pub(crate) fn size(self) -> Size {
        Size {
            width: self.width,
            height: self.height,
        }
    }

    /// The place in row order of the texel at column `x`, row `y` of the map.
    ///
    /// # Panics
    /// Outside the rectangle.
    pub fn index(self, x: u32, y: u32) -> usize {
        assert!(
            x >= self.x && y >= self.y && x - self.x < self.width && y - self.y < self.height,
            "texel ({x}, {y}) lies outside {self:?}"
        );
        (y - self.y) as usize * self.width as usize + (x - self.x) as usize
    }

    /// What two rectangles have in common; `None` where they do not meet.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let right = (self.x + self.width).min(other.x + other.width);
        let bottom = (self.y + self.height).min(other.y + other.height);
        (right > x && bottom > y).then(|| Self {
            x,
            y,
            width: right - x,
            height: bottom - y,
        })
    }

    /// The rectangle that holds both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        let (x, y) = (self.x.min(other.x), self.y.min(other.y));
        Self {
            x,
            y,
            width: (self.x + self.width).max(other.x + other.width) - x,
            height: (self.y + self.height).max(other.y + other.height) - y,
        }
    }

    /// Tiles of at most `side` x `side` texels that cover the rectangle, row by row.
    pub fn tiles(self, side: u32) -> impl Iterator<Item = Self> {
        let (cols, rows) = (self.width.div_ceil(side), self.height.div_ceil(side));
        (0..rows).flat_map(move |j| {
            (0..cols).map(move |i| Self {
                x: self.x + i * side,
                y: self.y + j * side,
                width: side.min(self.width - i * side),
                height: side.min(self.height - j * side),
            })
        })
    }
}

/// The height of the bands that [`gathered`] works in.
const GATHER: u32 = 256;

/// Fewer and larger rectangles that hold some others, and little more: in bands, those that meet one another sideways in one.
pub(crate) fn gathered(rects: &[Rect]) -> Vec<Rect> {
    let mut parts: Vec<Rect> = Vec::new();
    for rect in rects {
        let bottom = rect.y + rect.height;
        let mut y = rect.y;
        while y < bottom {
            let end = ((y / GATHER + 1) * GATHER).min(bottom);
            let height = end - y;
            parts.push(Rect { y, height, ..*rect });
            y = end;
        }
    }
    parts.sort_unstable_by_key(|r| (r.y / GATHER, r.x));
    let mut found: Vec<Rect> = Vec::new();
    for part in parts {
        match found.last_mut() {
            Some(last) if last.y / GATHER == part.y / GATHER && last.x + last.width >= part.x => {
                *last = last.hull(part);
            }
            _ => found.push(part),
        }
    }
    found
}

/// An owned rectangle of texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    rect: Rect,
    /// alpha_x, row order.
    pub alpha_x: Vec<f32>,
    /// alpha_y, row order.
    pub alpha_y: Vec<f32>,
    /// cos 2θ, row order.
    pub cos2: Vec<f32>,
    /// sin 2θ, row order.
    pub sin2: Vec<f32>,
}

impl Region {
    /// A rectangle of one texel value.
    pub fn constant(rect: Rect, texel: Texel) -> Self {
        let n = rect.texels();
        Self {
            rect,
            alpha_x: vec![texel.alpha_x; n],
            alpha_y: vec![texel.alpha_y; n],
            cos2: vec![texel.axis.cos2; n],
            sin2: vec![texel.axis.sin2; n],
        }
    }

    pub(super) fn from_planes(rect: Rect, planes: [Vec<f32>; 4]) -> Result<Self> {
        if let Some(plane) = planes.iter().find(|p| p.len() != rect.texels()) {
            return Err(Error::invalid(
                "a plane of the map",
                format!("{} numbers long", plane.len()),
                format!("allowed: {} for {}", rect.texels(), rect.size()),
            ));
        }
        let [alpha_x, alpha_y, cos2, sin2] = planes;
        Ok(Self {
            rect,
            alpha_x,
            alpha_y,
            cos2,
            sin2,
        })
    }

    /// Where it lies.
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// The texel of the nth place in row order.
    ///
    /// # Panics
    /// Outside the region.
    pub fn texel(&self, index: usize) -> Texel {
        Texel {
            alpha_x: self.alpha_x[index],
            alpha_y: self.alpha_y[index],
            axis: Axis {
                cos2: self.cos2[index],
                sin2: self.sin2[index],
            },
        }
    }

    /// A writable view.
    pub fn view_mut(&mut self) -> RegionMut<'_> {
        RegionMut {
            rect: self.rect,
            alpha_x: &mut self.alpha_x,
            alpha_y: &mut self.alpha_y,
            cos2: &mut self.cos2,
            sin2: &mut self.sin2,
        }
    }

    /// Copies the texels that both have.
    pub fn copy_from(&mut self, source: &Self) {
        self.view_mut().copy_from(source);
    }

    /// A copy of a rectangle of it.
    ///
    /// # Panics
    /// When `rect` reaches outside.
    pub fn crop(&self, rect: Rect) -> Self {
        let planes = [&self.alpha_x, &self.alpha_y, &self.cos2, &self.sin2];
        crop(self.rect, planes.map(|p| &**p), rect)
    }

    /// Makes every texel finite, in range and of a unit axis; see [`Mended`].
    pub(super) fn sanitise(&mut self) -> Mended {
        let mut mended = Mended::default();
        for i in 0..self.rect.texels() {
            let (mut ax, mut ay) = (self.alpha_x[i], self.alpha_y[i]);
            let (mut c, mut s) = (self.cos2[i], self.sin2[i]);
            let (alphas_ok, axis_ok) = ((ax + ay).is_finite(), (c + s).is_finite());
            mended.non_finite += u64::from(!alphas_ok || !axis_ok);
            if !alphas_ok {
                ax = if ax.is_finite() {
                    ax
                } else {
                    DEFAULT_TEXEL.alpha_x
                };
                ay = if ay.is_finite() {
                    ay
                } else {
                    DEFAULT_TEXEL.alpha_y
                };
            }
            if !axis_ok {
                (c, s) = (1.0, 0.0);
            }
            let (cx, cy) = (
                ax.clamp(ALPHA_MIN, ALPHA_MAX),
                ay.clamp(ALPHA_MIN, ALPHA_MAX),
            );
            mended.out_of_range += u64::from(cx != ax || cy != ay);
            let length = (c * c + s * s).sqrt();
            if length < crate::math::AXIS_MIN_LENGTH {
                mended.no_direction += 1;
            } else if (length - 1.0).abs() > 0.02 {
                mended.not_unit += 1;
            }
            // Unit axes are left to the bit as they came: reading a map back changes nothing.
            let texel = if (length - 1.0).abs() < 1e-6 {
                Texel {
                    alpha_x: cx,
                    alpha_y: cy,
                    axis: Axis { cos2: c, sin2: s },
                }
            } else {
                settle(cx, cy, c, s)
            };
            self.alpha_x[i] = texel.alpha_x;
            self.alpha_y[i] = texel.alpha_y;
            self.cos2[i] = texel.axis.cos2;
            self.sin2[i] = texel.axis.sin2;
        }
        mended
    }
}

/// A borrowed, writable rectangle of texels, its planes contiguous in row order.
#[derive(Debug)]
pub struct RegionMut<'a> {
    /// Where it lies.
    pub rect: Rect,
    /// alpha_x, row order.
    pub alpha_x: &'a mut [f32],
    /// alpha_y, row order.
    pub alpha_y: &'a mut [f32],
    /// cos 2θ, row order.
    pub cos2: &'a mut [f32],
    /// sin 2θ, row order.
    pub sin2: &'a mut [f32],
}

fn crop(from: Rect, planes: [&[f32]; 4], rect: Rect) -> Region {
    let [alpha_x, alpha_y, cos2, sin2] = planes.map(|plane| crop_plane((from, plane), rect));
    Region {
        rect,
        alpha_x,
        alpha_y,
        cos2,
        sin2,
    }
}

/// A rectangle of numbers that are in the row order of a larger one.
///
/// # Panics
/// When `rect` reaches outside.
pub(crate) fn crop_plane((from, source): (Rect, &[f32]), rect: Rect) -> Vec<f32> {
    assert!(
        from.intersection(rect) == Some(rect),
        "{rect:?} reaches outside {from:?}"
    );
    let n = rect.width as usize;
    let mut part = Vec::with_capacity(rect.texels());
    for y in rect.y..rect.y + rect.height {
        let start = from.index(rect.x, y);
        part.extend_from_slice(&source[start..start + n]);
    }
    part
}

impl<'a> RegionMut<'a> {
    /// The same rectangle, borrowed for a shorter time.
    pub fn reborrow(&mut self) -> RegionMut<'_> {
        RegionMut {
            rect: self.rect,
            alpha_x: self.alpha_x,
            alpha_y: self.alpha_y,
            cos2: self.cos2,
            sin2: self.sin2,
        }
    }

    /// A copy of a rectangle of it.
    ///
    /// # Panics
    /// When `rect` reaches outside.
    pub fn crop(&self, rect: Rect) -> Region {
        let planes = [&self.alpha_x, &self.alpha_y, &self.cos2, &self.sin2];
        crop(self.rect, planes.map(|p| &**p), rect)
    }

    /// Copies the texels that a region has as well.
    pub fn copy_from(&mut self, source: &Region) {
        self.copy_part(source, self.rect);
    }

    /// The same in a rectangle alone.
    pub fn copy_part(&mut self, source: &Region, part: Rect) {
        let common = self.rect.intersection(source.rect);
        let Some(common) = common.and_then(|c| c.intersection(part)) else {
            return;
        };
        let n = common.width as usize;
        for y in common.y..common.y + common.height {
            let (to, from) = (self.rect.index(common.x, y), source.rect.index(common.x, y));
            self.alpha_x[to..to + n].copy_from_slice(&source.alpha_x[from..from + n]);
            self.alpha_y[to..to + n].copy_from_slice(&source.alpha_y[from..from + n]);
            self.cos2[to..to + n].copy_from_slice(&source.cos2[from..from + n]);
            self.sin2[to..to + n].copy_from_slice(&source.sin2[from..from + n]);
        }
    }

    /// Cuts the view into bands of `rows` rows, top first; the last may be lower.
    pub fn into_bands(self, rows: u32) -> Vec<Self> {
        let rect = self.rect;
        let n = rows as usize * rect.width as usize;
        self.alpha_x
            .chunks_mut(n)
            .zip(self.alpha_y.chunks_mut(n))
            .zip(self.cos2.chunks_mut(n).zip(self.sin2.chunks_mut(n)))
            .zip((rect.y..rect.y + rect.height).step_by(rows as usize))
            .map(|(((alpha_x, alpha_y), (cos2, sin2)), y)| RegionMut {
                rect: Rect {
                    y,
                    height: rows.min(rect.y + rect.height - y),
                    ..rect
                },
                alpha_x,
                alpha_y,
                cos2,
                sin2,
            })
            .collect()
    }

    /// The texel of the nth place in row order.
    ///
    /// # Panics
    /// Outside the region.
    pub fn texel(&self, index: usize) -> Texel {
        Texel {
            alpha_x: self.alpha_x[index],
            alpha_y: self.alpha_y[index],
            axis: Axis {
                cos2: self.cos2[index],
                sin2: self.sin2[index],
            },
        }
    }

    /// Writes the nth texel in row order.
    ///
    /// # Panics
    /// Outside the region.
    pub fn set(&mut self, index: usize, texel: Texel) {
        self.alpha_x[index] = texel.alpha_x;
        self.alpha_y[index] = texel.alpha_y;
        self.cos2[index] = texel.axis.cos2;
        self.sin2[index] = texel.axis.sin2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_on_the_way_in() {
        assert_eq!(
            "1000x600".parse::<Size>().unwrap(),
            Size::new(1000, 600).unwrap()
        );
        assert_eq!("1".parse::<Size>().unwrap().texels(), 1);
        for bad in [
            "0",
            "1000000000",
            "16384x32768",
            "-4",
            "axb",
            "",
            "10x",
            "99999999999999999999",
        ] {
            let e = bad.parse::<Size>().unwrap_err().to_string();
            assert!(e.contains("allowed"), "{bad}: {e}");
        }
    }

    #[test]
    fn tiles_cover_the_rectangle_once() {
        let rect = Rect {
            x: 3,
            y: 5,
            width: 130,
            height: 65,
        };
        let tiles: Vec<_> = rect.tiles(64).collect();
        assert_eq!(tiles.len(), 6);
        assert_eq!(
            tiles.iter().map(|t| t.texels()).sum::<usize>(),
            rect.texels()
        );
        for (i, a) in tiles.iter().enumerate() {
            assert!(tiles[i + 1..].iter().all(|b| a.intersection(*b).is_none()));
        }
    }

    #[test]
    fn bands_lie_one_under_the_other() {
        let mut region = Region::constant(
            Rect {
                x: 2,
                y: 10,
                width: 4,
                height: 7,
            },
            DEFAULT_TEXEL,
        );
        let bands = region.view_mut().into_bands(3);
        let rows: Vec<_> = bands
            .iter()
            .map(|b| (b.rect.y, b.rect.height, b.alpha_x.len()))
            .collect();
        assert_eq!(rows, [(10, 3, 12), (13, 3, 12), (16, 1, 4)]);
    }
}
