//! What the colours of a view mean: a strip or a half wheel of them, with places for numbers. The window writes the numbers, in
//! its own letters.

use super::coverage::{Coverage, veil};
use super::palette::{self, COLOURS, Table};
use super::{AlphaRange, RatioRange, View, direction};
use crate::map::Size;
use glam::Vec2;

/// A legend: a picture, and where numbers belong beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// What is shown, as a heading.
    pub title: &'static str,
    /// What the picture is.
    pub shape: LegendShape,
    /// Its size in pixels.
    pub size: Size,
    /// RGBA, sRGB-encoded, alpha premultiplied, top row first.
    pub rgba: Vec<u8>,
    /// The numbers, in order.
    pub ticks: Vec<Tick>,
}

/// What a legend's picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegendShape {
    /// All colours from left to right, or from the bottom up where the picture is higher than wide.
    Strip,
    /// The upper half of a ring in which every direction has its colour, with lines drawn along some.
    HalfWheel,
}

/// A number beside a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Where it belongs, in pixels from the upper left of the picture: on a strip's lower edge or right edge, on the outer rim of
    /// a wheel.
    pub at: Vec2,
    /// The unit vector away from the picture, y down: the number belongs on that side.
    pub outward: Vec2,
    /// The number; empty for a tick between numbers.
    pub label: String,
}

impl View {
    /// The legend of the view as a picture of `size`; none for views that show no numbers.
    pub fn legend(&self, size: Size) -> Option<Legend> {
        match self {
            Self::Lit(_) | Self::Grain => None,
            Self::AlphaX(range) => Some(alphas("alpha_x", *range, size)),
            Self::AlphaY(range) => Some(alphas("alpha_y", *range, size)),
            Self::Ratio(range) => Some(ratios(*range, size)),
            Self::Direction => Some(directions(size)),
        }
    }
}

impl Coverage {
    /// The legend of [`Coverage::draw`] in that colour with that opacity, as a picture of `size`.
    pub fn legend(title: &'static str, colour: [u8; 3], opacity: f32, size: Size) -> Legend {
        let mut table = [[0; 4]; COLOURS];
        for (i, entry) in table.iter_mut().enumerate() {
            *entry = veil(colour, opacity * i as f32 / (COLOURS - 1) as f32);
        }
        let quarters = (0..=4u8).map(|i| (f32::from(i) / 4.0, format!("{}%", 25 * i)));
        strip(title, &table, size, quarters.collect())
    }
}

fn alphas(title: &'static str, range: AlphaRange, size: Size) -> Legend {
    let AlphaRange { low, high } = range.usable();
    let mut marks = Vec::new();
    for decade in -3..=0 {
        let ten = 10f32.powi(decade);
        for digit in 1..10u8 {
            let alpha = f32::from(digit) * ten;
            if alpha > low * 0.999 && alpha < high * 1.001 {
                // Between two decades there is room for more numbers.
                let labelled = digit == 1 || (high < 101.0 * low && [2, 5].contains(&digit));
                let label = if labelled {
                    format!("{}", rounded(alpha))
                } else {
                    String::new()
                };
                marks.push((range.place(alpha), label));
            }
        }
    }
    for end in [low, high] {
        if !marks
            .iter()
            .any(|m| !m.1.is_empty() && (m.0 - range.place(end)).abs() < 0.03)
        {
            marks.push((range.place(end), format!("{}", rounded(end))));
        }
    }
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    strip(title, palette::rising(), size, marks)
}

/// Three digits are what a scale shows.
fn rounded(x: f32) -> f32 {
    (x * 1000.0).round() / 1000.0
}

fn ratios(range: RatioRange, size: Size) -> Legend {
    let most = range.usable().most;
    let mut marks = vec![(0.5, "1".to_owned())];
    for n in [2u16, 3, 4, 5, 6, 7, 8, 9, 10, 20, 50, 100, 200, 500, 1000] {
        let ratio = f32::from(n);
        if ratio > most * 1.001 {
            break;
        }
        let labelled = match n {
            2 | 5 => most < 101.0,
            _ => [10, 100, 1000].contains(&n),
        };
        let label = |text: String| if labelled { text } else { String::new() };
        marks.push((range.place(ratio), label(format!("{n}"))));
        marks.push((range.place(1.0 / ratio), label(format!("1/{n}"))));
    }
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    strip("alpha_x / alpha_y", palette::diverging(), size, marks)
}

fn strip(title: &'static str, table: &Table, size: Size, marks: Vec<(f32, String)>) -> Legend {
    let (w, h) = (size.width(), size.height());
    let upright = h > w;
    let long = if upright { h } else { w };
    let mut rgba = Vec::with_capacity(4 * size.texels());
    for y in 0..h {
        for x in 0..w {
            let along = if upright { h - 1 - y } else { x };
            let place = (along as f32 + 0.5) / long as f32 * COLOURS as f32;
            rgba.extend(table[(place as usize).min(COLOURS - 1)]);
        }
    }
    let ticks = marks.into_iter().map(|(t, label)| {
        let (at, outward) = if upright {
            (Vec2::new(w as f32, (1.0 - t) * h as f32), Vec2::X)
        } else {
            (Vec2::new(t * w as f32, h as f32), Vec2::Y)
        };
        Tick { at, outward, label }
    });
    Legend {
        title,
        shape: LegendShape::Strip,
        size,
        rgba,
        ticks: ticks.collect(),
    }
}

/// Inner radius of the wheel, and of the ends of its lines, over the outer.
const HOLE: f32 = 0.42;
const LINE: [f32; 2] = [0.52, 0.9];
/// Degrees between lines, and between numbers.
const LINES: f32 = 22.5;
const NUMBERS: [u8; 5] = [0, 45, 90, 135, 180];

fn directions(size: Size) -> Legend {
    let (w, h) = (size.width() as f32, size.height() as f32);
    // Half a pixel of room for the smoothed edge.
    let radius = (0.5 * w).min(h) - 1.0;
    let centre = Vec2::new(0.5 * w, 0.5 * (h + radius));
    let mut rgba = Vec::with_capacity(4 * size.texels());
    for y in 0..size.height() {
        for x in 0..size.width() {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - centre;
            rgba.extend(wheel_pixel(Vec2::new(p.x, -p.y), radius));
        }
    }
    let ticks = NUMBERS.map(|degrees| {
        let (sin, cos) = f32::from(degrees).to_radians().sin_cos();
        let outward = Vec2::new(cos, -sin);
        Tick {
            at: centre + outward * radius,
            outward,
            label: format!("{degrees}\u{b0}"),
        }
    });
    Legend {
        title: "Direction of x",
        shape: LegendShape::HalfWheel,
        size,
        rgba,
        ticks: ticks.to_vec(),
    }
}

/// The colour of a place in the ring, y up.
fn wheel_pixel(p: Vec2, radius: f32) -> [u8; 4] {
    let r = p.length();
    let edge = |distance: f32| (distance + 0.5).clamp(0.0, 1.0);
    let cover = edge(radius - r) * edge(r - HOLE * radius) * edge(p.y + 0.5);
    let degrees = p.y.atan2(p.x).to_degrees();
    let hue = direction::hue(degrees);
    let nearest = ((degrees / LINES).round() * LINES).to_radians();
    let along = Vec2::new(nearest.cos(), nearest.sin());
    let t = p.dot(along).clamp(LINE[0] * radius, LINE[1] * radius);
    let thick = (0.02 * radius).clamp(0.5, 2.0);
    let ink = 0.75 * edge(thick - (p - along * t).length());
    let [r, g, b] = [0, 1, 2].map(|c| f32::from(hue[c]) * (1.0 - ink) + 24.0 * ink);
    [r, g, b, 255.0].map(|c| (c * cover + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(w: u32, h: u32) -> Size {
        Size::new(w, h).unwrap()
    }

    #[test]
    fn ticks_stand_where_their_colour_is() {
        let range = AlphaRange::default();
        let legend = View::AlphaX(range).legend(size(400, 12)).unwrap();
        let labels: Vec<_> = legend
            .ticks
            .iter()
            .filter(|t| !t.label.is_empty())
            .collect();
        let texts: Vec<_> = labels.iter().map(|t| &t.label[..]).collect();
        assert_eq!(texts, ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1"]);
        assert!((labels[3].at.x - 200.0).abs() < 1e-3);
        assert_eq!(legend.rgba[..4], palette::rising()[1]);
        assert_eq!(legend.rgba.len(), 4 * 400 * 12);
        let upright = View::AlphaX(range).legend(size(12, 400)).unwrap();
        assert!(
            (upright.ticks[0].at.y - 400.0).abs() < 1e-3,
            "small alphas are at the bottom"
        );
    }

    #[test]
    fn the_ends_of_any_range_have_numbers() {
        for (low, high) in [(0.03, 0.6), (0.001, 1.5), (0.05, 0.1), (0.09, 0.11)] {
            let legend = View::AlphaY(AlphaRange { low, high })
                .legend(size(300, 10))
                .unwrap();
            let labels: Vec<_> = legend
                .ticks
                .iter()
                .filter(|t| !t.label.is_empty())
                .collect();
            let (first, last) = (labels[0], labels[labels.len() - 1]);
            assert!(first.at.x < 9.0 && last.at.x > 291.0, "{labels:?}");
            assert!(legend.ticks.windows(2).all(|t| t[0].at.x <= t[1].at.x));
        }
        let legend = View::Ratio(RatioRange { most: 10.0 })
            .legend(size(300, 10))
            .unwrap();
        assert_eq!(legend.ticks[0].label, "1/10");
        assert!(
            legend
                .ticks
                .iter()
                .any(|t| t.label == "1" && t.at.x == 150.0)
        );
    }

    #[test]
    fn the_strip_of_a_coverage_goes_from_nothing_to_its_colour() {
        let legend = Coverage::legend("Coverage", [200, 100, 0], 0.5, size(256, 10));
        let at = |x: usize| &legend.rgba[4 * x..4 * x + 4];
        assert_eq!(at(0), [0; 4]);
        let full = veil([200, 100, 0], 0.5);
        let apart = at(255).iter().zip(full).map(|(a, b)| a.abs_diff(b));
        assert!(apart.max() <= Some(1), "{:?} {full:?}", at(255));
        let half = legend.ticks.iter().find(|t| t.label == "50%").unwrap();
        assert_eq!(half.at, Vec2::new(128.0, 10.0));
        assert!(at(128)[3].abs_diff(64) <= 1, "{:?}", at(128));
        assert_eq!(legend.ticks[4].label, "100%");
    }

    #[test]
    fn the_wheel_has_each_direction_at_its_angle() {
        let legend = View::Direction.legend(size(200, 110)).unwrap();
        let at = |degrees: f32, r: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let centre = legend.ticks[0].at - Vec2::new(99.0, 0.0);
            let p = centre + Vec2::new(cos, -sin) * r;
            let i = 4 * (p.y as usize * 200 + p.x as usize);
            [0, 1, 2, 3].map(|c| legend.rgba[i + c])
        };
        for degrees in [10.0, 55.0, 100.0, 170.0] {
            let (got, want) = (at(degrees, 70.0), direction::hue(degrees));
            let apart = (0..4).map(|c| got[c].abs_diff(want[c])).max();
            assert!(apart < Some(6), "{degrees}: {got:?} {want:?}");
        }
        assert_eq!(at(90.0, 20.0), [0; 4], "the hole is clear");
        assert!(
            at(45.0, 70.0)[..3].iter().all(|c| *c < 120),
            "a line stands at 45 degrees"
        );
        assert_eq!(View::Grain.legend(size(100, 100)), None);
    }
}
