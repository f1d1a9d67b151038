//! What the machine has to give, so that a map that is too much for it is told before it is made.

use super::properties::{bytes_needed, bytes_text};
use anisomap::map::Size;

/// Where nobody knows how much is free, a map beyond this is told, bytes.
const MUCH: u64 = 4 << 30;

/// What is to be said before a map of this size is made; `None` where there is room for it.
pub(crate) fn too_large(size: Size) -> Option<String> {
    told([size.width(), size.height()], free_memory())
}

fn told([width, height]: [u32; 2], free: Option<u64>) -> Option<String> {
    let needed = bytes_needed([width, height]);
    let map = format!(
        "A map of {width} x {height} texels takes about {}",
        bytes_text(needed)
    );
    match free {
        // Some is needed by everything else.
        Some(free) if needed > free / 4 * 3 => Some(format!(
            "{map}, and this machine has {} free. It may become slow, or the system may end the studio.",
            bytes_text(free)
        )),
        None if needed > MUCH => Some(format!("{map}.")),
        _ => None,
    }
}

/// Memory that a program may still take, bytes; `None` where the system does not say.
fn free_memory() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find(|l| l.starts_with("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_told_where_it_takes_more_than_there_is() {
        assert_eq!(told([1024, 1024], Some(4 << 30)), None);
        let text = told([16384, 16384], Some(4 << 30)).unwrap();
        assert!(
            text.contains("16384 x 16384") && text.contains("4.0 GiB free"),
            "{text}"
        );
        assert_eq!(told([16384, 16384], Some(1 << 40)), None);
        assert!(told([16384, 16384], None).is_some());
        assert_eq!(told([2048, 2048], None), None);
    }
}
