//! Fetching between texels.

use super::{AnisoMap, Size, Texel, Wrap, settle};

/// The four texels around a point and their weights: one bilinear fetch, right across the wrap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Places in row order: (left, top), (right, top), (left, bottom), (right, bottom).
    pub index: [usize; 4],
    /// Their weights, sum 1.
    pub weight: [f32; 4],
}

impl Wrap {
    /// The footprint of a bilinear fetch at texture coordinate (u, v), v up, in a grid of `size` with this wrap. Any finite
    /// coordinate is allowed; one that is not finite is taken as 0.
    pub fn footprint(self, size: Size, u: f32, v: f32) -> Footprint {
        let place = |t: f32, n: u32, repeats: bool| {
            let t = if t.is_finite() { t } else { 0.0 };
            // Whole turns go first: far from 0 an f32 has no texels left.
            let t = if repeats {
                t - t.floor()
            } else {
                t.clamp(0.0, 1.0)
            };
            let x = t * n as f32 - 0.5;
            (x.floor() as i64, x - x.floor())
        };
        let (w, h) = (size.width(), size.height());
        let (x, fx) = place(u, w, self.repeats_u());
        // Row 0 is the top.
        let (y, fy) = place(1.0 - v, h, self.repeats_v());
        let columns = [self.column(x, w), self.column(x + 1, w)];
        let rows = [self.row(y, h), self.row(y + 1, h)];
        let at = |i: usize, j: usize| rows[j] as usize * w as usize + columns[i] as usize;
        Footprint {
            index: [at(0, 0), at(1, 0), at(0, 1), at(1, 1)],
            weight: [
                (1.0 - fx) * (1.0 - fy),
                fx * (1.0 - fy),
                (1.0 - fx) * fy,
                fx * fy,
            ],
        }
    }
}

impl AnisoMap {
    /// The footprint of a bilinear fetch at texture coordinate (u, v), v up: see [`Wrap::footprint`].
    pub fn footprint(&self, u: f32, v: f32) -> Footprint {
        self.wrap().footprint(self.size(), u, v)
    }

    /// The map at (u, v), v up, between texels: alphas and double-angle vectors blended bilinearly.
    pub fn sample(&self, u: f32, v: f32) -> Texel {
        let Footprint { index, weight } = self.footprint(u, v);
        let sum = |plane: &[f32]| (0..4).map(|i| plane[index[i]] * weight[i]).sum::<f32>();
        settle(
            sum(self.alpha_x()),
            sum(self.alpha_y()),
            sum(self.cos2()),
            sum(self.sin2()),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use proptest::prelude::*;

    fn ramp(wrap: Wrap) -> AnisoMap {
        // Directions 1° and 179° left and right, alphas growing downward.
        let size = Size::new(2, 2).unwrap();
        let mut map = AnisoMap::constant(size, wrap, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for (i, (alpha, degrees)) in [(0.1, 1.0), (0.1, 179.0), (0.3, 1.0), (0.3, 179.0)]
            .into_iter()
            .enumerate()
        {
            region.set(
                i,
                Texel {
                    alpha_x: alpha,
                    alpha_y: 2.0 * alpha,
                    axis: Axis::from_degrees(degrees),
                },
            );
        }
        map
    }

    #[test]
    fn texel_centres_give_the_texels_and_row_0_is_the_top() {
        let map = ramp(Wrap::Repeat);
        let t = map.sample(0.25, 0.75);
        assert!((t.alpha_x - 0.1).abs() < 1e-6 && (t.axis.degrees() - 1.0).abs() < 1e-3);
        assert!((map.sample(0.75, 0.25).alpha_x - 0.3).abs() < 1e-6);
    }

    #[test]
    fn between_1_and_179_degrees_lies_0_also_across_the_seam() {
        let map = ramp(Wrap::Repeat);
        for u in [0.5, 0.0, 1.0, -3.0, 7.0] {
            assert!(
                map.sample(u, 0.75).axis.angle_to(Axis::U).to_degrees() < 1e-3,
                "u = {u}"
            );
        }
        assert!(
            (map.sample(0.25, 0.0).alpha_x - 0.2).abs() < 1e-6,
            "repeat blends top and bottom"
        );
        assert!(
            (ramp(Wrap::RepeatU).sample(0.25, 0.0).alpha_x - 0.3).abs() < 1e-6,
            "clamp does not"
        );
    }

    proptest! {
        #[test]
        fn a_repeating_map_repeats(u in -2.0f32..2.0, v in -2.0f32..2.0) {
            let map = ramp(Wrap::Repeat);
            let (a, b) = (map.sample(u, v), map.sample(u + 3.0, v - 2.0));
            prop_assert!((a.alpha_x - b.alpha_x).abs() < 1e-5);
            prop_assert!(a.axis.angle_to(b.axis) < 1e-3);
        }

        #[test]
        fn weights_are_a_blend(u in proptest::num::f32::ANY, v in proptest::num::f32::ANY) {
            for wrap in [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp] {
                let f = ramp(wrap).footprint(u, v);
                prop_assert!((f.weight.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                prop_assert!(f.index.iter().all(|&i| i < 4));
            }
        }
    }
}
