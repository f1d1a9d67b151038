//! How far apart the colours of two pictures are: CIEDE2000 (CIE 142-2001), pixel by pixel.
//!
//! The formula is that of the `palette` crate, held here against pairs of Sharma, Wu and Dalal, "The CIEDE2000 Color-Difference
//! Formula: Implementation Notes, Supplementary Test Data, and Mathematical Observations", Color Research and Application
//! 30(1), 2005.

use super::flip::{displayed, mean, quantile, same_size};
use crate::error::Result;
use crate::preview::Picture;
use palette::color_difference::Ciede2000;
use palette::white_point::D65;
use palette::{FromColor, Lab, LinSrgb};
use rayon::prelude::*;

/// ΔE00 between what a display shows of two pictures, pixel by pixel: about 1 can just be seen where both lie side by side,
/// black to white is 100.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourDifference {
    values: Vec<f32>,
}

impl ColourDifference {
    /// Compares two pictures of one size; light is clipped to \[0, 1\], NaN is black.
    ///
    /// # Errors
    /// When their sizes differ.
    pub fn new(first: &Picture, second: &Picture) -> Result<Self> {
        same_size(first, second)?;
        let pairs = first.pixels().par_iter().zip(second.pixels());
        let values = pairs
            .with_min_len(1 << 10)
            .map(|(&a, &b)| {
                // Background is the same in most pairs, and the formula is long.
                if a == b {
                    0.0
                } else {
                    lab(a).difference(lab(b))
                }
            })
            .collect();
        Ok(Self { values })
    }

    /// The differences in row order, top row first.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The mean difference.
    pub fn mean(&self) -> f64 {
        mean(&self.values)
    }

    /// The difference that the share `q` of all pixels does not exceed: 0.999 is the 99.9th percentile. `q` is taken as 0 to 1.
    pub fn quantile(&self, q: f64) -> f32 {
        quantile(&self.values, q)
    }

    /// The largest difference.
    pub fn largest(&self) -> f32 {
        self.values.iter().copied().fold(0.0, f32::max)
    }
}

/// CIE L*a*b* (D65) of what a display shows of linear light.
fn lab(light: [f32; 3]) -> Lab<D65, f32> {
    let [r, g, b] = light.map(displayed);
    Lab::from_color(LinSrgb::new(r, g, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Size;

    #[test]
    fn the_formula_meets_the_published_pairs() {
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
            ([50.0, -0.001, 2.49], [50.0, 0.0009, -2.49], 4.8045),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
            (
                [60.2574, -34.0099, 36.2677],
                [60.4626, -34.1751, 39.4387],
                1.2644,
            ),
            (
                [63.0109, -31.0961, -5.8663],
                [62.8187, -29.7946, -4.0864],
                1.2630,
            ),
            (
                [6.7747, -0.2908, -2.4247],
                [5.8714, -0.0985, -2.2286],
                0.6377,
            ),
            (
                [2.0776, 0.0795, -1.1350],
                [0.9033, -0.0636, -0.5514],
                0.9082,
            ),
        ];
        for (a, b, want) in pairs {
            let lab = |[l, a, b]: [f32; 3]| Lab::<D65, f32>::new(l, a, b);
            let (there, back) = (lab(a).difference(lab(b)), lab(b).difference(lab(a)));
            assert!((there - want).abs() < 2e-4, "{there} in place of {want}");
            assert!((there - back).abs() < 1e-5, "order");
        }
    }

    #[test]
    fn pictures_are_compared_as_displayed() {
        let flat = |c: [f32; 3]| Picture::new(Size::new(3, 2).unwrap(), c);
        let d = ColourDifference::new(&flat([0.0; 3]), &flat([1.0; 3])).unwrap();
        assert!((d.mean() - 100.0).abs() < 1e-2 && d.values().len() == 6);
        let d = ColourDifference::new(&flat([f32::NAN, -4.0, 9.0]), &flat([0.0, 0.0, 1.0]));
        assert_eq!(d.unwrap().largest(), 0.0);
        let mut one = flat([0.5; 3]);
        one.pixels_mut()[4] = [0.5, 0.5, 0.6];
        let d = ColourDifference::new(&flat([0.5; 3]), &one).unwrap();
        assert_eq!(d.quantile(0.8), 0.0);
        assert!(d.largest() > 1.0 && d.quantile(1.0) == d.largest());
        let other = Picture::new(Size::new(2, 3).unwrap(), [0.0; 3]);
        assert!(ColourDifference::new(&one, &other).is_err());
    }
}
