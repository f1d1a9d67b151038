//! How fast patterns fill. One line per case: `case=brushed size=4096 threads=2 ms_min=… ms_median=… mtexel_per_s=…`.
//!
//! Run with `cargo bench --bench pattern`; the machine is not written here but beside the numbers that are kept.

use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Wrap};
use anisomap::pattern::{Patch, Pattern, Surface};
use rayon::prelude::*;
use std::time::Instant;

fn main() {
    let size = Size::new(4096, 4096).expect("a size");
    let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
    for name in Pattern::NAMES {
        let pattern: Pattern = toml::from_str(&format!("[{name}]")).expect("defaults");
        let surface = Surface {
            size,
            aspect: 1.0,
            wrap: Wrap::Repeat,
            seed: 1,
        };
        let mut times: Vec<f64> = (0..5)
            .map(|_| {
                let start = Instant::now();
                let prepared = pattern.prepare(&surface).expect("defaults are allowed");
                map.bands_mut(16).into_par_iter().for_each_init(
                    || (vec![0.0; 16 * 4096], vec![0.0; 16 * 4096]),
                    |(coverage, value), region| {
                        prepared.fill(&mut Patch {
                            region,
                            coverage,
                            value,
                        });
                    },
                );
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!(
            "case={name} size=4096 threads={} ms_min={:.1} ms_median={:.1} mtexel_per_s={:.1}",
            rayon::current_num_threads(),
            times[0],
            times[2],
            size.texels() as f64 / times[2] / 1e3
        );
    }
}
