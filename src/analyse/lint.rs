//! What is wrong with a map, or will be in somebody's file format, and what to do about it.

use super::field::{self, JUMP_DEGREES, Pole, Poles, Seam};
use super::{ISOTROPIC_RATIO, Place, by_stretches, sorted};
use crate::convention::LobeFit;
use crate::map::{ALPHA_MAX, ALPHA_MIN, AnisoMap, Mended, Texel};
use crate::progress::Progress;
use serde::Serialize;
use std::fmt;

/// 8 bits hold an alpha to half a step, 1/510: worse than 5 % of it under this.
const LINEAR_8_BIT: f32 = 0.039;
/// The same with sqrt(alpha) in the file, as glTF stores roughness: 2 sqrt(alpha)/510 of alpha.
const SQRT_8_BIT: f32 = 0.0062;
/// Halves keep an alpha to 0.05 %, but the direction to 0.01 or 0.02 degrees, which changes a lobe of this ratio by 3 to 7 %
/// two widths off its peak.
const HALF_RATIO: f32 = 50.0;
/// And 1/alpha², which a reader may form, leaves the range of a half under this.
const HALF_ALPHA: f32 = 0.004;
/// A seam is seen when it jumps by this much more than any place inside the map, in degrees.
const SEAM_DEGREES: f32 = 5.0;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Good to know.
    Note,
    /// It will be seen, or lost in some file.
    Warning,
    /// The map was broken; `inspect` ends with exit code 1.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// One thing found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Its name, for scripts; names are never changed.
    pub code: &'static str,
    /// How many texels (or poles).
    pub count: u64,
    /// The first of them, row by row from the top; none where the place is not known.
    pub first: Option<Place>,
    /// What it is, as a sentence.
    pub message: String,
    /// What to do, as a sentence.
    pub advice: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}): {}", self.severity, self.code, self.message)?;
        if let Some(Place { x, y }) = self.first {
            write!(f, ", first at column {x}, row {y}")?;
        }
        write!(f, ". {}.", self.advice)
    }
}

/// Everything found in a map, the worst first. `mended` is what reading it had to change; a map made here has none.
pub fn lint(map: &AnisoMap, mended: Mended) -> Vec<Finding> {
    let mut findings = mended_findings(mended);
    findings.extend(width_findings(map));
    let field = field::walk(map, &Progress::none()).expect("nobody cancels");
    findings.extend(seam_finding("seam-u", "left and right", field.seam_u));
    findings.extend(seam_finding("seam-v", "top and bottom", field.seam_v));
    findings.extend(pole_findings(&field.poles));
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity)); // stable: within a severity the order above
    findings
}

fn mended_findings(mended: Mended) -> Vec<Finding> {
    let finding = |severity, code, count: u64, message: String, advice: &str| {
        (count > 0).then(|| Finding {
            severity,
            code,
            count,
            first: None,
            message: format!("{} {message}", texels(count)),
            advice: advice.to_owned(),
        })
    };
    let advice =
        "Mend the program or the file the map came from: the preview shows the replacement";
    [
        finding(
            Severity::Error,
            "not-finite",
            mended.non_finite,
            "held a NaN or an infinity and were set to the default".to_owned(),
            advice,
        ),
        finding(
            Severity::Error,
            "out-of-range",
            mended.out_of_range,
            format!("had an alpha outside {ALPHA_MIN} to {ALPHA_MAX} and were clamped to it"),
            advice,
        ),
        finding(
            Severity::Error,
            "no-direction",
            mended.no_direction,
            "had an axis vector of no length and were made isotropic".to_owned(),
            "Give isotropic texels the direction of a neighbour, so that filtering has one to blend",
        ),
        finding(
            Severity::Note,
            "not-unit",
            mended.not_unit,
            "had an axis vector more than 2 % off unit length and were normalised".to_owned(),
            "Nothing need be done: filtering shortens blended axes",
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}

pub(super) fn texels(count: u64) -> String {
    match count {
        1 => "1 texel".to_owned(),
        n => format!("{n} texels"),
    }
}

/// How many texels and which first.
#[derive(Clone, Copy, Default)]
struct Tally {
    count: u64,
    first: Option<usize>,
}

impl Tally {
    #[inline(always)]
    fn add(&mut self, hit: bool, index: usize) {
        if hit {
            self.count += 1;
            self.first = self.first.or(Some(index));
        }
    }

    fn merge(self, later: Self) -> Self {
        Self {
            count: self.count + later.count,
            first: self.first.or(later.first),
        }
    }
}

/// A property of single texels, from the larger and the smaller width.
struct WidthRule {
    code: &'static str,
    severity: Severity,
    holds: fn(f32, f32) -> bool,
    message: &'static str,
    advice: &'static str,
}

const WIDTH_RULES: [WidthRule; 4] = [
    WidthRule {
        code: "gltf-range",
        severity: Severity::Warning,
        holds: |large, _| large > 1.0 && LobeFit::default().apply(large) > 1.0,
        message: "have an alpha over 1.435, whose GGX width is over 1, the largest that glTF has",
        advice: "Lower the alphas, or accept that the glTF export clamps them",
    },
    WidthRule {
        code: "8-bit-linear",
        severity: Severity::Note,
        holds: |_, small| small < LINEAR_8_BIT,
        message: "have an alpha that 8 bits with a linear scale hold worse than 5 %",
        advice: "Export 16-bit PNG or EXR, or 8 bits of sqrt(alpha)",
    },
    WidthRule {
        code: "8-bit-sqrt",
        severity: Severity::Note,
        holds: |_, small| small < SQRT_8_BIT,
        message: "have an alpha that 8 bits of sqrt(alpha), as in glTF, hold worse than 5 %",
        advice: "Export 16-bit PNG or EXR, or raise the smallest alphas",
    },
    WidthRule {
        code: "half",
        severity: Severity::Note,
        holds: |large, small| small < HALF_ALPHA || large > HALF_RATIO * small,
        message: "have a lobe so thin that rounding to half floats changes it by some percent",
        advice: "Export the EXR as float",
    },
];

/// Whether the widths of a texel alone are warned of.
pub(super) fn warned(texel: Texel) -> bool {
    let (large, small) = sorted(texel);
    let mut warnings = WIDTH_RULES
        .iter()
        .filter(|rule| rule.severity >= Severity::Warning);
    warnings.any(|rule| (rule.holds)(large, small))
}

/// Whether the widths of a texel alone are noted as hard to keep in some file.
pub(super) fn noted(texel: Texel) -> bool {
    let (large, small) = sorted(texel);
    let mut notes = WIDTH_RULES
        .iter()
        .filter(|rule| rule.severity == Severity::Note && rule.code != "8-bit-linear");
    notes.any(|rule| (rule.holds)(large, small))
}

fn width_findings(map: &AnisoMap) -> Vec<Finding> {
    let parts = by_stretches(map.size().texels(), |stretch| {
        let mut tallies = [Tally::default(); WIDTH_RULES.len()];
        let mut ratio = 1.0f32;
        for i in stretch {
            let (large, small) = sorted(map.texel_at(i));
            ratio = ratio.max(large / small);
            for (tally, rule) in tallies.iter_mut().zip(&WIDTH_RULES) {
                tally.add((rule.holds)(large, small), i);
            }
        }
        (tallies, ratio)
    });
    let mut tallies = [Tally::default(); WIDTH_RULES.len()];
    let mut ratio = 1.0f32;
    for (part, part_ratio) in parts {
        for (sum, tally) in tallies.iter_mut().zip(part) {
            *sum = sum.merge(tally);
        }
        ratio = ratio.max(part_ratio);
    }
    let mut findings: Vec<Finding> = WIDTH_RULES
        .iter()
        .zip(tallies)
        .filter(|(_, tally)| tally.count > 0)
        .map(|(rule, tally)| Finding {
            severity: rule.severity,
            code: rule.code,
            count: tally.count,
            first: tally.first.map(|i| Place::of(i, map.width())),
            message: format!("{} {}", texels(tally.count), rule.message),
            advice: rule.advice.to_owned(),
        })
        .collect();
    if ratio <= ISOTROPIC_RATIO {
        findings.push(Finding {
            severity: Severity::Warning,
            code: "isotropic",
            count: map.size().texels() as u64,
            first: None,
            message: format!(
                "no texel is anisotropic enough to be seen: the largest ratio of alphas is {ratio:.4}, the smallest visible \
                 {ISOTROPIC_RATIO}"
            ),
            advice: "Raise one alpha against the other, or use a plain roughness map".to_owned(),
        });
    }
    findings
}

/// Whether opposite edges differ by more than places inside the map do.
pub(super) fn is_seen(seam: &Seam) -> bool {
    seam.jumps > 0 && seam.mean_degrees > seam.inside_degrees + SEAM_DEGREES
}

fn seam_finding(code: &'static str, edges: &str, seam: Option<Seam>) -> Option<Finding> {
    let seam = seam.filter(is_seen)?;
    Some(Finding {
        severity: Severity::Warning,
        code,
        count: seam.jumps,
        first: seam.first,
        message: format!(
            "the direction jumps by {:.1} degrees on average where the {edges} edges meet, inside the map by {:.1} at most; \
             {} by {JUMP_DEGREES} or more",
            seam.mean_degrees,
            seam.inside_degrees,
            texels(seam.jumps)
        ),
        advice:
            "Make the pattern repeat, or set wrap to \"clamp\" if the surface has an edge there"
                .to_owned(),
    })
}

fn pole_findings(poles: &Poles) -> Vec<Finding> {
    let poles = match poles {
        Poles::Rough(count, first) => {
            return vec![Finding {
                severity: Severity::Note,
                code: "rough-field",
                count: *count,
                first: Some(*first),
                message: format!(
                    "the direction changes from texel to texel in too many places ({count}) to speak of single poles"
                ),
                advice: "Nothing need be done for scratches and weaves; magnified, such a map shows its texels".to_owned(),
            }];
        }
        Poles::Each(poles) => poles,
    };
    let (at_edges, poles): (Vec<Pole>, Vec<Pole>) = poles.iter().partition(|p| p.is_at_edge);
    let mut indices: Vec<i32> = poles.iter().map(|p| p.halves).collect();
    indices.sort_unstable_by_key(|&i| (i.abs(), -i));
    indices.dedup();
    indices
        .into_iter()
        .filter_map(|index| {
            let mut alike = poles.iter().filter(|p| p.halves == index);
            let first = alike.next()?.place;
            Some(pole_finding(index, 1 + alike.count() as u64, first))
        })
        .chain(edge_finding(&at_edges))
        .collect()
}

/// Corners of edges between directions: how the surface is, in weaves and where finishes meet, and no mistake in the map.
fn edge_finding(at_edges: &[Pole]) -> Option<Finding> {
    let first = at_edges.first()?.place;
    let count = at_edges.len() as u64;
    let corners = if count == 1 { "corner" } else { "corners" };
    Some(Finding {
        severity: Severity::Note,
        code: "direction-edge",
        count,
        first: Some(first),
        message: format!("edges between directions have {count} {corners} around which the direction turns"),
        advice: "Nothing need be done where threads, sheets or finishes meet; magnified, the edge shows its texels".to_owned(),
    })
}

/// The index of a pole with its sign, from twice the index: `+1`, `-1/2`.
pub(super) fn index_name(halves: i32) -> String {
    let sign = if halves < 0 { '-' } else { '+' };
    let size = halves.unsigned_abs();
    if size.is_multiple_of(2) {
        format!("{sign}{}", size / 2)
    } else {
        format!("{sign}{size}/2")
    }
}

/// `index` is twice the index of the line field.
fn pole_finding(index: i32, count: u64, first: Place) -> Finding {
    let number = index_name(index);
    let odd = index % 2 != 0;
    let places = if count == 1 { "place" } else { "places" };
    Finding {
        severity: if odd { Severity::Warning } else { Severity::Note },
        code: match index {
            1 => "pole-plus-half",
            -1 => "pole-minus-half",
            2 => "pole-plus-one",
            -2 => "pole-minus-one",
            _ => "pole-other",
        },
        count,
        first: Some(first),
        message: format!("the direction turns around a point, with index {number}, in {count} {places}"),
        advice: if odd {
            "Make the texels around it isotropic, or expect a seam of opposite signs to run to it in files that hold a vector"
        } else {
            "Make a few texels around it isotropic if the highlight pinches there"
        }
        .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;

    fn constant(alpha_x: f32, alpha_y: f32) -> AnisoMap {
        let axis = Axis::from_degrees(20.0);
        let texel = Texel {
            alpha_x,
            alpha_y,
            axis,
        };
        AnisoMap::constant(Size::new(64, 48).unwrap(), Wrap::Repeat, texel)
    }

    fn codes(map: &AnisoMap) -> Vec<&'static str> {
        lint(map, Mended::default())
            .iter()
            .map(|f| f.code)
            .collect()
    }

    #[test]
    fn an_ordinary_map_is_clean() {
        assert_eq!(lint(&constant(0.1, 0.4), Mended::default()), []);
    }

    #[test]
    fn what_was_mended_is_an_error_but_for_lengths() {
        let mended = Mended {
            non_finite: 1,
            out_of_range: 2,
            no_direction: 3,
            not_unit: 4,
        };
        let findings = lint(&constant(0.1, 0.4), mended);
        let got: Vec<_> = findings
            .iter()
            .map(|f| (f.severity, f.code, f.count))
            .collect();
        assert_eq!(
            got,
            [
                (Severity::Error, "not-finite", 1),
                (Severity::Error, "out-of-range", 2),
                (Severity::Error, "no-direction", 3),
                (Severity::Note, "not-unit", 4),
            ]
        );
        assert!(
            findings[0]
                .to_string()
                .starts_with("error (not-finite): 1 texel held a NaN")
        );
    }

    #[test]
    fn widths_that_files_hold_badly_are_named_with_their_place() {
        let mut map = constant(0.1, 0.4);
        let texel = Texel {
            alpha_x: 0.003,
            ..map.texel(0, 0)
        };
        map.region_mut().set(64 * 5 + 7, texel);
        assert_eq!(codes(&map), ["8-bit-linear", "8-bit-sqrt", "half"]);
        let first = lint(&map, Mended::default())[0].first;
        assert_eq!(first, Some(Place { x: 7, y: 5 }));
        assert_eq!(codes(&constant(0.02, 0.4)), ["8-bit-linear"]);
        assert_eq!(codes(&constant(0.4, 1.43)), [""; 0]);
        assert_eq!(codes(&constant(0.4, 1.44)), ["gltf-range"]);
        assert_eq!(
            codes(&constant(0.02, 1.45)),
            ["gltf-range", "8-bit-linear", "half"]
        );
    }

    #[test]
    fn the_gltf_limit_is_where_it_is_said_to_be() {
        assert_eq!(format!("{:.3}", LobeFit::default().invert(1.0)), "1.435");
    }

    /// The limits are where half a step of 8 bits is 5 % of alpha.
    #[test]
    fn the_8_bit_limits_are_where_they_are_said_to_be() {
        assert!((1.0 / 510.0 / LINEAR_8_BIT - 0.05).abs() < 0.001);
        assert!((2.0 * SQRT_8_BIT.sqrt() / 510.0 / SQRT_8_BIT - 0.05).abs() < 0.001);
    }

    #[test]
    fn an_isotropic_map_is_told() {
        assert_eq!(codes(&constant(0.2, 0.2)), ["isotropic"]);
        assert_eq!(codes(&constant(0.2, 0.204)), [""; 0]);
    }

    #[test]
    fn seams_and_poles_are_found() {
        let mut map = constant(0.1, 0.4);
        for y in 0..48u32 {
            for x in 0..64u32 {
                let axis = Axis::from_degrees(x as f32);
                let texel = Texel {
                    axis,
                    ..map.texel(x, y)
                };
                map.region_mut().set((y * 64 + x) as usize, texel);
            }
        }
        let findings = lint(&map, Mended::default());
        assert_eq!(findings.len(), 1);
        assert_eq!((findings[0].code, findings[0].count), ("seam-u", 48));
        assert!(
            findings[0].message.contains("63.0 degrees"),
            "{}",
            findings[0]
        );

        let size = Size::new(32, 32).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Clamp, map.texel(0, 0));
        for i in 0..size.texels() {
            let Place { x, y } = Place::of(i, 32);
            let azimuth = (15.3 - y as f32).atan2(x as f32 - 16.2);
            let texel = Texel {
                axis: Axis::from_radians(0.5 * azimuth),
                ..map.texel_at(i)
            };
            map.region_mut().set(i, texel);
        }
        let findings = lint(&map, Mended::default());
        assert_eq!(findings.len(), 1, "{findings:?}");
        assert_eq!(
            (findings[0].code, findings[0].severity),
            ("pole-plus-half", Severity::Warning)
        );
    }
}
