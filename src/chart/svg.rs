//! Charts as SVG: plain text, shapes, and a frame with linear or logarithmic axes.
//!
//! Dark ink on white, so that a chart reads the same in print and on screen. Nothing is told by colour alone. The font is
//! whatever sans-serif the reader has; widths are reckoned for DejaVu Sans, the widest of the usual ones, so that text that
//! fits here fits everywhere.

use std::fmt::Write;

/// Text and axes.
pub(super) const INK: &str = "#1a1a1a";
/// What stands behind: secondary text and small ticks.
pub(super) const PALE: &str = "#5c5c5c";
/// Lines of the grid.
pub(super) const GRID: &str = "#dedede";

const FONTS: &str = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif";

/// Which part of a text stands at its x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// A picture in the making; x to the right and y downward, in pixels at 96 a CSS inch.
#[derive(Clone, Debug)]
pub(super) struct Svg {
    width: f64,
    height: f64,
    title: String,
    body: String,
}

impl Svg {
    /// An empty white picture. `title` is what a reader that shows no pictures says of it.
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        Self {
            width,
            height,
            title: title.to_owned(),
            body: String::new(),
        }
    }

    /// A straight line; `dash` is an SVG dash pattern, empty for a whole line.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: &str, width: f64) {
        self.polyline(&[from, to], ink, width, "");
    }

    /// A line through points; `dash` is an SVG dash pattern, empty for a whole line.
    pub(super) fn polyline(&mut self, points: &[(f64, f64)], ink: &str, width: f64, dash: &str) {
        let list: Vec<String> = points
            .iter()
            .map(|(x, y)| format!("{},{}", short(*x), short(*y)))
            .collect();
        let dash = if dash.is_empty() {
            String::new()
        } else {
            format!(r#" stroke-dasharray="{dash}""#)
        };
        self.element(format_args!(
            r#"<polyline points="{}" fill="none" stroke="{ink}" stroke-width="{}" stroke-linejoin="round"{dash}/>"#,
            list.join(" "),
            short(width)
        ));
    }

    /// A filled shape with an outline; "none" leaves either out.
    pub(super) fn polygon(&mut self, points: &[(f64, f64)], fill: &str, ink: &str) {
        let list: Vec<String> = points
            .iter()
            .map(|(x, y)| format!("{},{}", short(*x), short(*y)))
            .collect();
        self.element(format_args!(
            r#"<polygon points="{}" fill="{fill}" stroke="{ink}" stroke-width="1.2"/>"#,
            list.join(" ")
        ));
    }

    /// A disc with an outline.
    pub(super) fn circle(&mut self, (x, y): (f64, f64), radius: f64, fill: &str, ink: &str) {
        self.element(format_args!(
            r#"<circle cx="{}" cy="{}" r="{}" fill="{fill}" stroke="{ink}" stroke-width="1.2"/>"#,
            short(x),
            short(y),
            short(radius)
        ));
    }

    /// One line of text on its baseline.
    pub(super) fn text(
        &mut self,
        (x, y): (f64, f64),
        size: f64,
        anchor: Anchor,
        ink: &str,
        text: &str,
    ) {
        self.styled(
            (x, y),
            &format!(r#"font-size="{}""#, short(size)),
            anchor,
            ink,
            text,
        );
    }

    /// The same from its left end, on a white rim that keeps it legible over lines.
    pub(super) fn over(&mut self, at: (f64, f64), size: f64, ink: &str, text: &str) {
        let rim =
            r#"stroke="white" stroke-width="2.5" stroke-linejoin="round" paint-order="stroke""#;
        let style = format!(r#"font-size="{}" {rim}"#, short(size));
        self.styled(at, &style, Anchor::Start, ink, text);
    }

    /// One line of heavy text on its baseline.
    pub(super) fn bold(
        &mut self,
        (x, y): (f64, f64),
        size: f64,
        anchor: Anchor,
        ink: &str,
        text: &str,
    ) {
        let style = format!(r#"font-size="{}" font-weight="bold""#, short(size));
        self.styled((x, y), &style, anchor, ink, text);
    }

    /// One line of text that is read from below, its baseline at x.
    pub(super) fn upward(&mut self, (x, y): (f64, f64), size: f64, anchor: Anchor, text: &str) {
        let (x, y) = (short(x), short(y));
        let style = format!(
            r#"font-size="{}" transform="rotate(-90 {x} {y})""#,
            short(size)
        );
        self.raw_text((&x, &y), &style, anchor, INK, text);
    }

    fn styled(&mut self, (x, y): (f64, f64), style: &str, anchor: Anchor, ink: &str, text: &str) {
        self.raw_text((&short(x), &short(y)), style, anchor, ink, text);
    }

    fn raw_text(
        &mut self,
        (x, y): (&str, &str),
        style: &str,
        anchor: Anchor,
        ink: &str,
        text: &str,
    ) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escaped(text);
        self.element(format_args!(
            r#"<text x="{x}" y="{y}" {style} text-anchor="{anchor}" fill="{ink}">{text}</text>"#
        ));
    }

    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "{element}");
    }

    /// The file's text.
    pub(super) fn finish(self) -> String {
        let (width, height) = (short(self.width), short(self.height));
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" font-family=\"{FONTS}\">\n\
             <title>{}</title>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n{}</svg>\n",
            escaped(&self.title),
            self.body
        )
    }
}

/// Text as XML takes it: no markup, and no control characters, which it has no way to hold.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// A coordinate to a hundredth of a pixel; one that is not finite is 0, since no reader can place it.
fn short(x: f64) -> String {
    if !x.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// How wide a line of text is at most, in the unit of `size`: advances of DejaVu Sans.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let advance = |c: char| match c {
        'i' | 'l' | 'j' => 0.28,
        ' ' | '.' | ',' | ':' | ';' | '/' | '|' | '\'' => 0.34,
        'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '-' => 0.42,
        'm' | 'M' | '%' | 'W' => 0.99,
        'w' | '+' | '=' | '<' | '>' | '\u{2212}' | '\u{d7}' => 0.84,
        c if c.is_ascii_uppercase() => 0.76,
        c if c.is_ascii() => 0.64,
        _ => 0.84,
    };
    text.chars().map(advance).sum::<f64>() * size
}

/// How values are laid along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    /// Even steps.
    Linear,
    /// Even factors.
    Log,
}

/// One axis: what it says, and which values lie at its ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    title: String,
    scale: Scale,
    low: f64,
    high: f64,
}

impl Axis {
    /// From `low` to `high` in even steps. `low` < `high`, both finite.
    pub(super) fn linear(title: &str, low: f64, high: f64) -> Self {
        Self {
            title: title.to_owned(),
            scale: Scale::Linear,
            low,
            high,
        }
    }

    /// In even factors, with room for every value: from the 1, 2 or 5 below the least to the one above the largest. Values that
    /// are not positive and finite count for nothing; they lie at the near end.
    pub(super) fn log(title: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let usable = |v: &f64| *v > 0.0 && v.is_finite();
        let (low, high) = values
            .into_iter()
            .filter(usable)
            .fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 1.0) };
        // Marks at the ends, and what is written beside them, stay off the frame.
        let spare = (high / low).powf(0.08).clamp(1.08, 2.0);
        let (low, high) = (step_below(low / spare), step_above(high * spare));
        Self {
            title: title.to_owned(),
            scale: Scale::Log,
            low,
            high,
        }
    }

    /// Where a value lies, 0 at the low end and 1 at the high end; one beyond them, or no number, at the nearer.
    pub(super) fn position(&self, value: f64) -> f64 {
        let t = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        if t > 0.0 { t.min(1.0) } else { 0.0 }
    }

    /// Values that get a line and a number.
    fn ticks(&self) -> Vec<f64> {
        match self.scale {
            Scale::Linear => {
                let step = even_step(self.high - self.low);
                let first = (self.low / step - 1e-9).ceil() as i64;
                let last = (self.high / step + 1e-9).floor() as i64;
                (first..=last).map(|i| i as f64 * step).collect()
            }
            Scale::Log => {
                let decades = (self.high / self.low).log10();
                let factors: &[f64] = if decades > 3.2 {
                    &[1.0]
                } else {
                    &[1.0, 2.0, 5.0]
                };
                self.in_decades(factors)
            }
        }
    }

    /// Values that get a small mark.
    fn small_ticks(&self) -> Vec<f64> {
        match self.scale {
            Scale::Linear => Vec::new(),
            Scale::Log => self.in_decades(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        }
    }

    fn in_decades(&self, factors: &[f64]) -> Vec<f64> {
        let (first, last) = (
            self.low.log10().floor() as i32,
            self.high.log10().ceil() as i32,
        );
        let all = (first..=last).flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(d)));
        all.filter(|v| *v >= self.low * 0.999 && *v <= self.high * 1.001)
            .collect()
    }
}

/// The 1, 2 or 5 times a power of ten at most `v`.
fn step_below(v: f64) -> f64 {
    let decade = 10f64.powf(v.log10().floor());
    let factors = [5.0, 2.0, 1.0].map(|f| f * decade);
    factors
        .into_iter()
        .find(|s| *s <= v * 1.0001)
        .unwrap_or(decade)
}

fn step_above(v: f64) -> f64 {
    let decade = 10f64.powf(v.log10().floor());
    let factors = [1.0, 2.0, 5.0].map(|f| f * decade);
    let found = factors.into_iter().find(|s| *s >= v * 0.9999);
    found.unwrap_or(10.0 * decade)
}

/// A 1, 2 or 5 of which about five make `range`.
fn even_step(range: f64) -> f64 {
    step_above(range / 7.0)
}

/// A number as an axis shows it: plain where that is short, else a power of ten.
pub(super) fn number(v: f64) -> String {
    let a = v.abs();
    if a == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&a) {
        let digits = (2 - a.log10().floor() as i32).clamp(0, 5) as usize;
        let text = format!("{v:.digits$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        let text = format!("{v:.1e}");
        text.replace(".0e", "e")
    }
}

/// The room that values are drawn in, its two axes at the left and below.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    /// Its left upper corner.
    pub(super) corner: (f64, f64),
    /// Width and height.
    pub(super) size: (f64, f64),
    /// From left to right.
    pub(super) x: Axis,
    /// From below upward.
    pub(super) y: Axis,
}

/// Height of the text of axes.
const AXIS_TEXT: f64 = 12.0;

impl Frame {
    /// Where the values lie in the picture.
    pub(super) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (
            self.corner.0 + self.size.0 * self.x.position(x),
            self.corner.1 + self.size.1 * (1.0 - self.y.position(y)),
        )
    }

    /// The grid, the axes with their numbers, and what they say. Takes about 60 pixels to the left of the frame and 45 below.
    pub(super) fn draw(&self, svg: &mut Svg) {
        let ((left, top), (width, height)) = (self.corner, self.size);
        let (right, bottom) = (left + width, top + height);
        for v in self.x.ticks() {
            let x = left + width * self.x.position(v);
            svg.line((x, top), (x, bottom), GRID, 1.0);
            svg.text(
                (x, bottom + 17.0),
                AXIS_TEXT,
                Anchor::Middle,
                INK,
                &number(v),
            );
        }
        for v in self.x.small_ticks() {
            let x = left + width * self.x.position(v);
            svg.line((x, bottom), (x, bottom + 4.0), PALE, 1.0);
        }
        for v in self.y.ticks() {
            let y = bottom - height * self.y.position(v);
            svg.line((left, y), (right, y), GRID, 1.0);
            svg.text(
                (left - 7.0, y + 4.0),
                AXIS_TEXT,
                Anchor::End,
                INK,
                &number(v),
            );
        }
        for v in self.y.small_ticks() {
            let y = bottom - height * self.y.position(v);
            svg.line((left - 4.0, y), (left, y), PALE, 1.0);
        }
        svg.polyline(
            &[(left, top), (left, bottom), (right, bottom)],
            INK,
            1.3,
            "",
        );
        let middle = (left + 0.5 * width, bottom + 38.0);
        svg.text(middle, AXIS_TEXT + 1.0, Anchor::Middle, INK, &self.x.title);
        let beside = (left - 52.0, top + 0.5 * height);
        svg.upward(beside, AXIS_TEXT + 1.0, Anchor::Middle, &self.y.title);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_file() {
        let mut svg = Svg::new(10.0, 10.0, "a < b & \"c\"");
        svg.text((f64::NAN, 1.0), 9.0, Anchor::Start, INK, "<script>\u{1}&");
        let text = svg.finish();
        assert!(text.contains("a &lt; b &amp; &quot;c&quot;"));
        assert!(text.contains("&lt;script&gt; &amp;") && !text.contains("NaN"));
    }

    #[test]
    fn axes_hold_their_values_and_end_at_round_ones() {
        let axis = Axis::log("x", [0.35, 60.0, 0.0, f64::NAN, -3.0]);
        assert_eq!((axis.low, axis.high), (0.2, 100.0));
        assert!((axis.position(0.2)).abs() < 1e-12 && axis.position(1e9) == 1.0);
        assert!((axis.position((0.2f64 * 100.0).sqrt()) - 0.5).abs() < 1e-12);
        assert_eq!(axis.position(0.0), 0.0);
        assert_eq!(axis.position(f64::NAN), 0.0);
        let ticks: Vec<String> = axis.ticks().into_iter().map(number).collect();
        assert_eq!(
            ticks,
            ["0.2", "0.5", "1", "2", "5", "10", "20", "50", "100"]
        );
        let axis = Axis::linear("y", 0.0, 90.0);
        assert_eq!(axis.ticks(), [0.0, 20.0, 40.0, 60.0, 80.0]);
        let nothing = Axis::log("z", []);
        assert!(nothing.low < nothing.high);
        let wide = Axis::log("w", [1e-9, 1.0]);
        assert!(wide.ticks().len() < 12);
    }

    #[test]
    fn numbers_are_short() {
        for (v, want) in [
            (0.0, "0"),
            (0.02, "0.02"),
            (100.0, "100"),
            (1e-6, "1e-6"),
            (2.5e-7, "2.5e-7"),
            (1.25, "1.25"),
            (-3.0, "-3"),
        ] {
            assert_eq!(number(v), want);
        }
        assert_eq!(short(-0.001), "0");
        assert_eq!(short(1.239), "1.24");
    }

    #[test]
    fn a_frame_turns_values_to_places() {
        let frame = Frame {
            corner: (60.0, 10.0),
            size: (100.0, 50.0),
            x: Axis::linear("x", 0.0, 2.0),
            y: Axis::linear("y", 0.0, 1.0),
        };
        assert_eq!(frame.at(1.0, 0.0), (110.0, 60.0));
        assert_eq!(frame.at(2.0, 1.0), (160.0, 10.0));
        let mut svg = Svg::new(200.0, 120.0, "t");
        frame.draw(&mut svg);
        let text = svg.finish();
        assert_eq!(
            text.matches("<text").count(),
            text.matches("</text>").count()
        );
        assert!(text.starts_with("<?xml") && text.ends_with("</svg>\n"));
    }
}
