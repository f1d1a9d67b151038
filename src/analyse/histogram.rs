//! Quantiles of millions of numbers in one pass: counts in buckets of equal relative width.

/// Counts of positive numbers. A bucket is a run of neighbouring f32: their bits are in the order of their values, and the
/// leading ones are a logarithm for nothing.
#[derive(Clone)]
pub(super) struct Histogram {
    low: u32,
    shift: u32,
    counts: Vec<u64>,
}

impl Histogram {
    /// For numbers from `low` to `high`, both positive; what lies outside goes to the first and the last bucket. An octave
    /// has 2^`bits` buckets.
    pub(super) fn new(low: f32, high: f32, bits: u32) -> Self {
        let shift = f32::MANTISSA_DIGITS - 1 - bits;
        let buckets = ((high.to_bits() - low.to_bits()) >> shift) as usize + 1;
        Self {
            low: low.to_bits(),
            shift,
            counts: vec![0; buckets],
        }
    }

    /// Counts a number; one that is not above `low` counts as `low`.
    #[inline(always)]
    pub(super) fn add(&mut self, x: f32) {
        let bits = if x > 0.0 { x.to_bits() } else { 0 };
        let bucket = (bits.saturating_sub(self.low) >> self.shift) as usize;
        let last = self.counts.len() - 1;
        self.counts[bucket.min(last)] += 1;
    }

    /// Adds the counts of another histogram of the same range.
    pub(super) fn merge(&mut self, other: &Self) {
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts) {
            *mine += theirs;
        }
    }

    /// The number that a share `q` (0 to 1) of all is not above, to half a bucket; the numbers are known to lie in
    /// `min..=max`. 0 when nothing was counted.
    pub(super) fn quantile(&self, q: f64, min: f32, max: f32) -> f32 {
        let total: u64 = self.counts.iter().sum();
        if total == 0 {
            return 0.0;
        }
        let wanted = ((q * total as f64).ceil() as u64).clamp(1, total);
        let mut seen = 0;
        let bucket = self.counts.iter().position(|&n| {
            seen += n;
            seen >= wanted
        });
        match bucket {
            Some(0) => min,
            Some(i) => {
                let start = self.low + ((i as u32) << self.shift);
                f32::from_bits(start + (1 << self.shift) / 2).clamp(min, max)
            }
            None => max,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_half_a_bucket() {
        let mut h = Histogram::new(1e-3, 1.5, 12);
        let numbers: Vec<f32> = (0..10_000).map(|i| 1e-3 + 1.4e-4 * i as f32).collect();
        for &x in &numbers {
            h.add(x);
        }
        for q in [0.01, 0.05, 0.5, 0.95, 0.99] {
            let want = numbers[(q * 1e4) as usize - 1];
            let got = h.quantile(q, numbers[0], numbers[9999]);
            assert!((got / want - 1.0).abs() < 1.3e-4, "{q}: {got} {want}");
        }
        assert_eq!(h.quantile(0.0, 1e-3, 1.4), 1e-3);
    }

    #[test]
    fn numbers_outside_stay_at_the_ends() {
        let mut h = Histogram::new(1e-9, 1e3, 11);
        for x in [0.0, 0.0, 0.0, 1e30] {
            h.add(x);
        }
        assert_eq!(h.quantile(0.5, 0.0, 1e30), 0.0);
        assert!(h.quantile(1.0, 0.0, 1e30) > 9e2);
        assert_eq!(Histogram::new(1.0, 2.0, 4).quantile(0.5, 1.0, 2.0), 0.0);
    }
}
