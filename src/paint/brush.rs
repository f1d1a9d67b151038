//! A brush: what a stroke does to the texels it reaches, and how far it reaches.

use crate::error::{Error, Result, in_range};
use crate::map::{ALPHA_MAX, ALPHA_MIN};
use serde::{Deserialize, Serialize};

/// The most copies that a radial symmetry makes.
pub const COPIES_MAX: u32 = 64;

/// The closest that dabs stand, as a part of the breadth: a hundredth is past telling from a line.
const SPACING_MIN: f32 = 0.01;

/// Everything about a stroke but its path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Brush {
    /// What it does.
    pub tool: Tool,
    /// Half its breadth in surface units, 0.00001 to 10; default 0.03. The height of one turn of UV is 1; for a stroke on the mesh
    /// a surface unit is as long as it is on the mesh on the whole ([`super::Skin::scale`]), as all lengths of a brush are.
    pub radius: f32,
    /// Where the fall toward the rim begins, as a part of the radius, 0 to 1; default 0.5. At 1 the rim is a texel wide.
    pub hardness: f32,
    /// How much of its work a stroke does in one go, 0 to 1; default 1. Strokes one over the other build up.
    pub flow: f32,
    /// The way from dab to dab as a part of the brush's breadth, 0.01 to 10; default 0, a line without gaps.
    pub spacing: f32,
    /// How far dabs stray from the path, as a part of the radius, 0 to 10; default 0. Means nothing without spacing.
    pub jitter: f32,
    /// What pressure changes. Default: nothing.
    pub pressure: Pressure,
    /// Copies of every stroke. Default: none.
    #[serde(skip_serializing_if = "Symmetry::is_none")]
    pub symmetry: Symmetry,
}

impl Default for Brush {
    fn default() -> Self {
        Self {
            tool: Tool::default(),
            radius: 0.03,
            hardness: 0.5,
            flow: 1.0,
            spacing: 0.0,
            jitter: 0.0,
            pressure: Pressure::default(),
            symmetry: Symmetry::default(),
        }
    }
}

/// What is left of a brush's numbers at pressure 0; between that and pressure 1 they grow evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pressure {
    /// The part of the radius, 0 to 1; default 1: pressure does not change it.
    pub size: f32,
    /// The part of the flow, 0 to 1; default 1.
    pub flow: f32,
}

impl Default for Pressure {
    fn default() -> Self {
        Self {
            size: 1.0,
            flow: 1.0,
        }
    }
}

/// Copies of a stroke that belong to it: all together are one stroke, denser nowhere. Of a stroke in UV they lie where their numbers
/// say; of one on the mesh about the middle of its bounding box: left and right for u, above and below for v, and turned about the
/// upright axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Symmetry {
    /// The stroke alone.
    #[default]
    None,
    /// Left and right of the line u = `at`.
    MirrorU {
        /// Where the line is, -4 to 4.
        at: f32,
    },
    /// Above and below the line v = `at`.
    MirrorV {
        /// Where the line is, -4 to 4.
        at: f32,
    },
    /// Both lines: four strokes.
    MirrorBoth {
        /// Where the lines cross, (u, v), -4 to 4 each.
        at: [f32; 2],
    },
    /// Turned about a centre, round on the surface.
    Radial {
        /// How many strokes in all, 2 to 64.
        count: u32,
        /// The centre, (u, v), -4 to 4 each.
        center: [f32; 2],
    },
}

impl Symmetry {
    fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// How many strokes one becomes, itself included.
    pub(super) fn copies(&self) -> u32 {
        match self {
            Self::None => 1,
            Self::MirrorU { .. } | Self::MirrorV { .. } => 2,
            Self::MirrorBoth { .. } => 4,
            Self::Radial { count, .. } => (*count).max(1),
        }
    }
}

/// What a brush does to a texel, to the extent that the stroke covers it. The words are those of a recipe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tool {
    /// Lays the x axis along the stroke, with these widths.
    Groove(Groove),
    /// Turns the grooves that are there toward the stroke; widths stay.
    Comb,
    /// Evens out widths and directions with their surroundings.
    Smooth(Smooth),
    /// Scales the widths that are there; directions stay.
    Roughen(Roughen),
    /// Sets one width or both; directions stay.
    SetAlpha(SetAlpha),
    /// Turns the x axis to one angle; widths stay.
    SetDirection(SetDirection),
    /// Brings back what lies below the layer.
    Erase,
    /// Sets widths, direction or both on the whole map, wherever the stroke goes.
    Fill(FillWith),
    /// Scatters thin scratches along the stroke.
    Scratch(Scratch),
}

impl Default for Tool {
    fn default() -> Self {
        Self::Groove(Groove::default())
    }
}

/// See [`Tool::Groove`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Groove {
    /// Slope width along the stroke, 0.001 to 1.5; becomes alpha_x. Default 0.08.
    pub along: f32,
    /// Slope width across the stroke; becomes alpha_y. Default 0.35.
    pub across: f32,
}

impl Default for Groove {
    fn default() -> Self {
        Self {
            along: 0.08,
            across: 0.35,
        }
    }
}

/// See [`Tool::Smooth`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Smooth {
    /// How far around itself a texel looks, surface units, 0.0001 to 0.1; default 0.01.
    pub reach: f32,
}

impl Default for Smooth {
    fn default() -> Self {
        Self { reach: 0.01 }
    }
}

/// See [`Tool::Roughen`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Roughen {
    /// Above 1 roughens (or stretches the lobe), below 1 polishes (or makes it rounder); 0.01 to 100, default 1.5.
    pub factor: f32,
    /// What stays the same.
    pub keep: Keep,
}

impl Default for Roughen {
    fn default() -> Self {
        Self {
            factor: 1.5,
            keep: Keep::Ratio,
        }
    }
}

/// What a change of the widths leaves as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// Their ratio: both grow or shrink.
    #[default]
    Ratio,
    /// Their product: the larger grows as the smaller shrinks.
    Area,
}

/// See [`Tool::SetAlpha`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SetAlpha {
    /// The width along the x axis, 0.001 to 1.5. Default: stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_x: Option<f32>,
    /// The width across it. Default: stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_y: Option<f32>,
}

/// See [`Tool::SetDirection`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SetDirection {
    /// The angle of the x axis, degrees counter-clockwise from +U, -360 to 360.
    pub angle: f32,
}

/// See [`Tool::Fill`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FillWith {
    /// The width along the x axis, 0.001 to 1.5. Default: stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_x: Option<f32>,
    /// The width across it. Default: stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_y: Option<f32>,
    /// The angle of the x axis, degrees counter-clockwise from +U, -360 to 360. Default: stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle: Option<f32>,
}

/// See [`Tool::Scratch`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scratch {
    /// How many scratches on a way as long as the brush is broad, 0.01 to 1000; default 12.
    pub density: f32,
    /// Mean length in the unit of the radius, 0.0001 to 10; default 0.04. Each has half to one and a half of it.
    pub length: f32,
    /// Breadth in the unit of the radius, 0.00001 to 1; default 0.0015. Thinner than a texel is fainter, not broader.
    pub width: f32,
    /// How far they lean from the stroke at most, degrees to either side, 0 to 90; default 8.
    pub spread: f32,
    /// Slope width along a scratch, 0.001 to 1.5; becomes alpha_x. Default 0.05.
    pub along: f32,
    /// Slope width across a scratch; becomes alpha_y. Default 0.35.
    pub across: f32,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            density: 12.0,
            length: 0.04,
            width: 0.0015,
            spread: 8.0,
            along: 0.05,
            across: 0.35,
        }
    }
}

impl Tool {
    /// The word for it in a recipe.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Groove(_) => "groove",
            Self::Comb => "comb",
            Self::Smooth(_) => "smooth",
            Self::Roughen(_) => "roughen",
            Self::SetAlpha(_) => "set_alpha",
            Self::SetDirection(_) => "set_direction",
            Self::Erase => "erase",
            Self::Fill(_) => "fill",
            Self::Scratch(_) => "scratch",
        }
    }

    /// Whether it does nothing before the stroke has a direction: a click alone paints nothing.
    pub fn follows_stroke(&self) -> bool {
        matches!(self, Self::Groove(_) | Self::Comb | Self::Scratch(_))
    }

    /// How far it looks around a texel, surface units; 0 for a tool that needs the texel alone.
    pub fn reach(&self) -> f32 {
        match self {
            Self::Smooth(smooth) => smooth.reach,
            _ => 0.0,
        }
    }

    /// Whether it works on the whole map.
    pub fn is_everywhere(&self) -> bool {
        matches!(self, Self::Fill(_))
    }

    fn check(&self) -> Result<()> {
        let key = |name: &str| format!("tool.{}.{name}", self.name());
        let alpha = |name: &str, value: f32| in_range(key(name), value, ALPHA_MIN..=ALPHA_MAX);
        let alphas = |x: Option<f32>, y: Option<f32>| {
            alpha("alpha_x", x.unwrap_or(1.0))?;
            alpha("alpha_y", y.unwrap_or(1.0))
        };
        let angle = |value: f32| in_range(key("angle"), value, -360.0..=360.0);
        match self {
            Self::Groove(g) => {
                alpha("along", g.along)?;
                alpha("across", g.across)
            }
            Self::Comb | Self::Erase => Ok(()),
            Self::Smooth(s) => in_range(key("reach"), s.reach, 1e-4..=0.1),
            Self::Roughen(r) => in_range(key("factor"), r.factor, 0.01..=100.0),
            Self::SetAlpha(s) => alphas(s.alpha_x, s.alpha_y),
            Self::SetDirection(s) => angle(s.angle),
            Self::Fill(f) => {
                alphas(f.alpha_x, f.alpha_y)?;
                angle(f.angle.unwrap_or(0.0))
            }
            Self::Scratch(s) => {
                in_range(key("density"), s.density, 0.01..=1000.0)?;
                in_range(key("length"), s.length, 1e-4..=10.0)?;
                in_range(key("width"), s.width, 1e-5..=1.0)?;
                in_range(key("spread"), s.spread, 0.0..=90.0)?;
                alpha("along", s.along)?;
                alpha("across", s.across)
            }
        }
    }
}

impl Brush {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the brush's table.
    pub fn check(&self) -> Result<()> {
        self.tool.check()?;
        in_range("radius", self.radius, 1e-5..=10.0)?;
        in_range("hardness", self.hardness, 0.0..=1.0)?;
        in_range("flow", self.flow, 0.0..=1.0)?;
        if self.spacing != 0.0 {
            in_range("spacing", self.spacing, SPACING_MIN..=10.0)
                .map_err(|e| e.with_hint("0 is a line without gaps"))?;
        }
        in_range("jitter", self.jitter, 0.0..=10.0)?;
        in_range("pressure.size", self.pressure.size, 0.0..=1.0)?;
        in_range("pressure.flow", self.pressure.flow, 0.0..=1.0)?;
        self.symmetry.check()
    }

    /// The same brush with every length times `factor`: one in surface units, made one in a mesh's.
    pub(super) fn scaled(&self, factor: f32) -> Self {
        let mut brush = self.clone();
        brush.radius *= factor;
        if let Tool::Scratch(scratch) = &mut brush.tool {
            scratch.length *= factor;
            scratch.width *= factor;
        }
        brush
    }

    /// The radius at a pressure.
    pub(super) fn radius_at(&self, pressure: f32) -> f32 {
        self.radius * (self.pressure.size + (1.0 - self.pressure.size) * pressure)
    }

    /// The flow at a pressure.
    pub(super) fn flow_at(&self, pressure: f32) -> f32 {
        self.flow * (self.pressure.flow + (1.0 - self.pressure.flow) * pressure)
    }
}

impl Symmetry {
    fn check(&self) -> Result<()> {
        let place = |key: &str, value: f32| {
            in_range(format!("symmetry.{}.{key}", self.name()), value, -4.0..=4.0)
        };
        match self {
            Self::None => Ok(()),
            Self::MirrorU { at } | Self::MirrorV { at } => place("at", *at),
            Self::MirrorBoth { at } => at.iter().try_for_each(|at| place("at", *at)),
            Self::Radial { count, center } => {
                center.iter().try_for_each(|c| place("center", *c))?;
                if (2..=COPIES_MAX).contains(count) {
                    return Ok(());
                }
                Err(Error::invalid(
                    "symmetry.radial.count",
                    count,
                    format!("allowed: 2 to {COPIES_MAX}"),
                ))
            }
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::MirrorU { .. } => "mirror_u",
            Self::MirrorV { .. } => "mirror_v",
            Self::MirrorBoth { .. } => "mirror_both",
            Self::Radial { .. } => "radial",
        }
    }
}
