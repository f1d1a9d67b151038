//! How far two pictures are apart, as numbers and in false colour with a legend.

use super::caption::{Align, write_text};
use super::picture::{Picture, linear_from_srgb, luminance};
use crate::error::{Error, Result};
use crate::map::{Rect, Size};
use crate::math;
use glam::Vec3;

/// What is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Linear luminance of the second picture less that of the first; 1 is display white, highlights count beyond it.
    #[default]
    Signed,
    /// The same without its sign.
    Absolute,
    /// Colour difference CIE 1976 (D65) of what a display shows; about 1 can just be seen.
    DeltaE,
}

impl Measure {
    /// The false colour, linear RGB, of a value over the scale: -1 to 1 where it is signed, else 0 to 1; clipped.
    pub fn colour(self, t: f32) -> [f32; 3] {
        match self {
            Self::Signed => ramp(&DIVERGING, 0.5 + 0.5 * t),
            Self::Absolute | Self::DeltaE => ramp(&RISING, t),
        }
    }

    fn label(self, [first, second]: &[String; 2]) -> String {
        match self {
            Self::Signed => format!("{second} \u{2212} {first}, luminance"),
            Self::Absolute => format!("|{second} \u{2212} {first}|, luminance"),
            Self::DeltaE => format!("\u{394}E 1976, {first} and {second}"),
        }
    }
}

/// A comparison, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    measure: Measure,
    size: Size,
    values: Vec<f32>,
    /// What the legend calls the two pictures.
    names: [String; 2],
}

impl Difference {
    /// Compares two pictures of one size.
    ///
    /// # Errors
    /// When their sizes differ.
    pub fn new(first: &Picture, second: &Picture, measure: Measure) -> Result<Self> {
        if first.size() != second.size() {
            return Err(Error::invalid(
                "size of the second picture",
                second.size(),
                format!("allowed: that of the first, {}", first.size()),
            ));
        }
        let values = first
            .pixels()
            .iter()
            .zip(second.pixels())
            .map(|(&a, &b)| match measure {
                Measure::Signed => luminance(b) - luminance(a),
                Measure::Absolute => (luminance(b) - luminance(a)).abs(),
                Measure::DeltaE => lab(a).distance(lab(b)),
            })
            .collect();
        Ok(Self {
            measure,
            size: first.size(),
            values,
            names: ["first", "second"].map(str::to_owned),
        })
    }

    /// The names of the two pictures for the legend, which else are "first" and "second".
    #[must_use]
    pub fn named(mut self, names: [String; 2]) -> Self {
        self.names = names;
        self
    }

    /// The values in row order.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The largest without its sign.
    pub fn largest(&self) -> f32 {
        self.values.iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    /// The mean without signs.
    pub fn mean(&self) -> f64 {
        let sum: f64 = self.values.iter().map(|v| f64::from(v.abs())).sum();
        sum / self.values.len() as f64
    }

    /// Where the colours end: 1, 2 or 5 times a power of ten that holds 99.5 % of the values; of colour differences at least 2,
    /// so that what nobody can see does not glow.
    pub fn scale(&self) -> f32 {
        let mut sorted: Vec<f32> = self.values.iter().map(|v| v.abs()).collect();
        sorted.sort_by(f32::total_cmp);
        let scale = round_up(sorted[(sorted.len() - 1) * 199 / 200]);
        match self.measure {
            Measure::DeltaE => scale.max(2.0),
            Measure::Signed | Measure::Absolute => scale,
        }
    }

    /// In false colour over a legend, in a picture of the compared size and the legend's height more. Signed: blue where the
    /// second is darker, white where they agree, red where it is brighter; else black over violet and orange to yellow.
    ///
    /// # Errors
    /// When the picture with its legend would be larger than a picture may be.
    pub fn picture(&self) -> Result<Picture> {
        let legend = (self.size.width() / 14).clamp(24, 64);
        let size = Size::new(self.size.width(), self.size.height() + legend)?;
        let scale = self.scale();
        let mut picture = Picture::new(size, PAPER);
        for (pixel, &v) in picture.pixels_mut().iter_mut().zip(&self.values) {
            *pixel = self.colour(v / scale);
        }
        self.draw_legend(&mut picture, legend, scale);
        Ok(picture)
    }

    /// False colour of a value over the scale, -1 to 1.
    fn colour(&self, t: f32) -> [f32; 3] {
        self.measure.colour(t)
    }

    /// A bar of all colours with numbers under it, and beside it what they are.
    fn draw_legend(&self, picture: &mut Picture, height: u32, scale: f32) {
        let (width, top) = (self.size.width(), self.size.height());
        let margin = width / 40;
        let bar = Rect {
            x: margin,
            y: top + height / 6,
            // In a small picture the bar needs all the room for its numbers.
            width: if width < 200 {
                width - 2 * margin
            } else {
                width / 2 - margin
            },
            height: height / 4,
        };
        let low = if self.measure == Measure::Signed {
            -1.0
        } else {
            0.0
        };
        let along = |t: f32| low + (1.0 - low) * t;
        for y in bar.y..bar.y + bar.height {
            for x in 0..bar.width {
                let t = (x as f32 + 0.5) / bar.width as f32;
                picture.row_mut(y)[(bar.x + x) as usize] = self.colour(along(t));
            }
        }
        let text = height as f32 * 0.32;
        let third = bar.width / 3;
        let numbers = Rect {
            y: bar.y + bar.height,
            height: height - height / 6 - bar.height,
            ..bar
        };
        for (i, align) in [Align::Left, Align::Centre, Align::Right]
            .into_iter()
            .enumerate()
        {
            let area = Rect {
                x: bar.x + third * i as u32,
                width: third,
                ..numbers
            };
            let area = if align == Align::Right {
                Rect {
                    width: bar.width - 2 * third,
                    ..area
                }
            } else {
                area
            };
            let value = scale * along(0.5 * i as f32);
            let is_clipped = |beyond: &dyn Fn(f32) -> bool| self.values.iter().any(|v| beyond(*v));
            let sign = match i {
                0 if is_clipped(&|v| v < value) => "\u{2264} ",
                2 if is_clipped(&|v| v > value) => "\u{2265} ",
                _ => "",
            };
            let number = format!("{sign}{}", short(value));
            write_text(picture, area, &number, text, align, INK);
        }
        let beside = Rect {
            x: bar.x + bar.width + 2 * margin,
            y: top,
            width: width.saturating_sub(bar.x + bar.width + 3 * margin).max(1),
            height: height / 2,
        };
        write_text(
            picture,
            beside,
            &self.measure.label(&self.names),
            text,
            Align::Left,
            INK,
        );
        let below = Rect {
            y: top + height / 2,
            ..beside
        };
        let numbers = format!(
            "largest {}, mean {}",
            short(self.largest()),
            short(self.mean() as f32)
        );
        write_text(picture, below, &numbers, text, Align::Left, INK);
    }
}

const PAPER: [f32; 3] = [0.02; 3];
const INK: [f32; 3] = [0.75; 3];
/// sRGB bytes at even steps.
const DIVERGING: [[u8; 3]; 5] = [
    [5, 48, 130],
    [96, 160, 215],
    [245, 245, 242],
    [232, 130, 96],
    [125, 5, 30],
];
const RISING: [[u8; 3]; 5] = [
    [2, 2, 8],
    [78, 20, 122],
    [184, 56, 110],
    [250, 140, 60],
    [252, 250, 185],
];

/// A colour ramp at `t` in 0 to 1 (clipped), blended as encoded, because the steps were chosen by eye.
fn ramp(steps: &[[u8; 3]; 5], t: f32) -> [f32; 3] {
    let t = t.clamp(0.0, 1.0) * 4.0;
    let i = (t as usize).min(3);
    let f = t - i as f32;
    [0, 1, 2].map(|c| {
        let (a, b) = (f32::from(steps[i][c]), f32::from(steps[i + 1][c]));
        linear_from_srgb((a + (b - a) * f) / 255.0)
    })
}

/// CIE L*a*b* (D65) of what a display shows of linear R, G, B.
fn lab(rgb: [f32; 3]) -> Vec3 {
    let [r, g, b] = rgb.map(|c| c.clamp(0.0, 1.0));
    // IEC 61966-2-1, each row over the white point.
    let x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505;
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089;
    let f = |t: f32| {
        if t > 0.008_856 {
            math::pow(t, 1.0 / 3.0)
        } else {
            7.787 * t + 16.0 / 116.0
        }
    };
    let (x, y, z) = (f(x), f(y), f(z));
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// The next 1, 2 or 5 times a power of ten; at least 1e-6.
fn round_up(v: f32) -> f32 {
    for power in -6..9 {
        for factor in [1.0, 2.0, 5.0] {
            let step = (factor * 10f64.powi(power)) as f32;
            if v <= step * 1.000_01 {
                return step;
            }
        }
    }
    1e9
}

/// Three digits, without trailing zeros.
fn short(v: f32) -> String {
    let a = v.abs();
    let text = if a == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e4).contains(&a) {
        let digits = if a >= 100.0 {
            0
        } else if a >= 10.0 {
            1
        } else if a >= 1.0 {
            2
        } else if a >= 0.1 {
            3
        } else {
            4
        };
        let text = format!("{v:.digits$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{v:.1e}")
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(v: f32) -> Picture {
        Picture::new(Size::new(160, 40).unwrap(), [v; 3])
    }

    #[test]
    fn numbers_are_what_they_say() {
        let d = Difference::new(&grey(0.5), &grey(0.25), Measure::Signed).unwrap();
        assert!((d.values()[0] + 0.25).abs() < 1e-6 && (d.mean() - 0.25).abs() < 1e-6);
        assert_eq!(d.scale(), 0.5);
        let d = Difference::new(&grey(0.0), &grey(3.0), Measure::DeltaE).unwrap();
        assert!(
            (d.largest() - 100.0).abs() < 0.01,
            "black to white, clipped"
        );
        let d = Difference::new(&grey(0.5), &grey(0.501), Measure::DeltaE).unwrap();
        assert!(d.largest() < 1.0 && d.scale() == 2.0, "it cannot be seen");
        let other = Picture::new(Size::new(2, 2).unwrap(), [0.0; 3]);
        assert!(Difference::new(&grey(0.0), &other, Measure::Signed).is_err());
    }

    #[test]
    fn agreement_is_white_and_brighter_is_red() {
        let mut b = grey(0.5);
        b.row_mut(0)[3..60].fill([0.9; 3]);
        let picture = Difference::new(&grey(0.5), &b, Measure::Signed)
            .unwrap()
            .picture()
            .unwrap();
        assert!(picture.height() > 40);
        assert!(picture.pixel(100, 20).iter().all(|c| *c > 0.85));
        let [r, _, b] = picture.pixel(10, 0);
        assert!(r > 2.0 * b);
    }

    #[test]
    fn scales_and_labels_are_round() {
        for (v, want) in [
            (0.0, 1e-6),
            (0.3, 0.5),
            (0.5, 0.5),
            (0.51, 1.0),
            (7.0, 10.0),
        ] {
            assert!((round_up(v) / want - 1.0).abs() < 1e-3, "{v}");
        }
        for (v, want) in [
            (0.5, "0.5"),
            (-20.0, "\u{2212}20"),
            (100.0, "100"),
            (0.0, "0"),
            (2e-6, "2.0e\u{2212}6"),
            (0.0123, "0.0123"),
        ] {
            assert_eq!(short(v), want);
        }
    }

    #[test]
    fn tiny_pictures_have_a_legend_too() {
        let one = Picture::new(Size::new(1, 1).unwrap(), [0.1; 3]);
        let d = Difference::new(&one, &one, Measure::Absolute).unwrap();
        assert_eq!(d.largest(), 0.0);
        assert!(d.picture().is_ok());
    }
}
