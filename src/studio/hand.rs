//! The tool in the artist's hand: which it is, the brush that each tool was last used with, and what is common to all of them.

use super::action::Action;
use crate::map::{ALPHA_MAX, ALPHA_MIN};
use crate::paint::{
    Brush, FillWith, Groove, Keep, Roughen, Scratch, SetAlpha, SetDirection, Smooth, Symmetry, Tool,
};

/// The least and the most radius that a key or a drag gives a brush, surface units.
pub const RADIUS_RANGE: [f32; 2] = [0.0005, 2.0];
/// Radii of the brush that it stays behind the pointer when the stabiliser does all it can.
pub const STRING_RADII: f32 = 6.0;

/// Points of the screen that a brush of radius 1 has for its radius, where sizes are the screen's.
pub const SCREEN_POINTS: f32 = 500.0;

/// A tool of the studio: those that paint, and those that do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ToolKind {
    /// Lays grooves along the stroke.
    Groove,
    /// Turns what is there toward the stroke.
    Comb,
    /// Evens out.
    Smooth,
    /// Widens both alphas.
    Roughen,
    /// Narrows both alphas.
    Polish,
    /// Sets alphas.
    SetAlpha,
    /// Sets the direction.
    SetDirection,
    /// Takes strokes away.
    Erase,
    /// Fills the layer.
    Fill,
    /// Scatters scratches.
    Scratch,
    /// Takes numbers from under the pointer.
    Pick,
    /// Edits guides.
    Guide,
}

impl ToolKind {
    /// Every tool, as the column of tools shows them.
    pub const ALL: [Self; 12] = [
        Self::Groove,
        Self::Comb,
        Self::Smooth,
        Self::Roughen,
        Self::Polish,
        Self::SetAlpha,
        Self::SetDirection,
        Self::Scratch,
        Self::Fill,
        Self::Erase,
        Self::Pick,
        Self::Guide,
    ];

    /// The action that takes it into the hand.
    pub fn action(self) -> Action {
        match self {
            Self::Groove => Action::ToolGroove,
            Self::Comb => Action::ToolComb,
            Self::Smooth => Action::ToolSmooth,
            Self::Roughen => Action::ToolRoughen,
            Self::Polish => Action::ToolPolish,
            Self::SetAlpha => Action::ToolSetAlpha,
            Self::SetDirection => Action::ToolSetDirection,
            Self::Erase => Action::ToolErase,
            Self::Fill => Action::ToolFill,
            Self::Scratch => Action::ToolScratch,
            Self::Pick => Action::ToolPick,
            Self::Guide => Action::ToolGuide,
        }
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        self.action().name()
    }

    /// Whether it makes strokes.
    pub fn paints(self) -> bool {
        !matches!(self, Self::Pick | Self::Guide)
    }

    /// What it does as long as Ctrl is held, for the hint line.
    pub fn inverse_name(self) -> &'static str {
        match self {
            Self::Roughen => "polishes",
            Self::Polish => "roughens",
            Self::Erase => "erases",
            Self::Pick | Self::Guide => "",
            _ => "erases",
        }
    }

    fn default_tool(self) -> Tool {
        match self {
            Self::Groove | Self::Pick | Self::Guide => Tool::Groove(Groove::default()),
            Self::Comb => Tool::Comb,
            Self::Smooth => Tool::Smooth(Smooth::default()),
            Self::Roughen => Tool::Roughen(Roughen::default()),
            Self::Polish => Tool::Roughen(Roughen {
                factor: 1.0 / 1.5,
                keep: Keep::Ratio,
            }),
            Self::SetAlpha => Tool::SetAlpha(SetAlpha {
                alpha_x: Some(0.08),
                alpha_y: Some(0.35),
            }),
            Self::SetDirection => Tool::SetDirection(SetDirection::default()),
            Self::Erase => Tool::Erase,
            Self::Fill => Tool::Fill(FillWith {
                alpha_x: Some(0.08),
                alpha_y: Some(0.35),
                angle: Some(0.0),
            }),
            Self::Scratch => Tool::Scratch(Scratch::default()),
        }
    }
}

/// Which copies of a stroke are painted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mirror {
    /// None.
    #[default]
    Off,
    /// Left and right.
    U,
    /// Above and below.
    V,
    /// Both.
    Both,
}

/// The tool in the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    kind: ToolKind,
    /// The tool that was held before the picker, which it gives back.
    before_pick: Option<ToolKind>,
    /// A brush for each of [`ToolKind::ALL`]: a tool that is taken up again is as it was laid down.
    brushes: Vec<Brush>,
    /// Copies by mirrors.
    pub mirror: Mirror,
    /// Copies around the centre, 2 to 64; 0 for none. Goes over `mirror`.
    pub copies: u32,
    /// What the copies are made around, UV units.
    pub symmetry_center: [f32; 2],
    /// Whether brushes keep their size on the screen, whatever is zoomed to, in place of that on the surface.
    pub on_screen: bool,
    /// How far the brush stays behind the pointer, as a part of [`STRING_RADII`] radii; 0 to 1.
    pub stabiliser: f32,
}

impl Default for Hand {
    fn default() -> Self {
        let brush = |kind: ToolKind| Brush {
            tool: kind.default_tool(),
            radius: if kind == ToolKind::Scratch {
                0.06
            } else {
                0.03
            },
            ..Brush::default()
        };
        Self {
            kind: ToolKind::Groove,
            before_pick: None,
            brushes: ToolKind::ALL.map(brush).to_vec(),
            mirror: Mirror::Off,
            copies: 0,
            symmetry_center: [0.5; 2],
            on_screen: false,
            stabiliser: 0.0,
        }
    }
}

impl Hand {
    /// The tool that is held.
    pub fn kind(&self) -> ToolKind {
        self.kind
    }

    /// Takes another tool.
    pub fn take(&mut self, kind: ToolKind) {
        if kind != ToolKind::Pick {
            self.before_pick = None;
        } else if self.kind != ToolKind::Pick {
            self.before_pick = Some(self.kind);
        }
        self.kind = kind;
    }

    /// Takes the tool again that was held before the picker, once that has picked.
    pub fn end_pick(&mut self) {
        if let Some(kind) = self.before_pick.take() {
            self.kind = kind;
        }
    }

    fn place(kind: ToolKind) -> usize {
        ToolKind::ALL
            .iter()
            .position(|k| *k == kind)
            .expect("every tool is in the list")
    }

    /// The brush of the tool that is held, without symmetry.
    pub fn brush(&self) -> &Brush {
        &self.brushes[Self::place(self.kind)]
    }

    /// The brush of the tool that is held, to be changed.
    pub fn brush_mut(&mut self) -> &mut Brush {
        &mut self.brushes[Self::place(self.kind)]
    }

    /// The radius of a stroke that begins now, surface units, where a point of the screen is `point` surface units broad.
    pub fn radius_at(&self, point: f32) -> f32 {
        let radius = self.brush().radius;
        if !self.on_screen {
            return radius;
        }
        (radius * SCREEN_POINTS * point).clamp(RADIUS_RANGE[0], RADIUS_RANGE[1])
    }

    /// The breadth of the brush as it is measured now.
    pub fn size_text(&self) -> String {
        let breadth = 2.0 * self.brush().radius;
        if self.on_screen {
            format!("{:.0} pt", breadth * SCREEN_POINTS)
        } else {
            format!("{breadth:.4}")
        }
    }

    /// The brush that a stroke is made with now, where a point of the screen is `point` surface units broad; `inverse` while Ctrl
    /// is held: what a tool does is undone by hand.
    pub fn stroke_brush(&self, inverse: bool, point: f32) -> Brush {
        let mut brush = self.brush().clone();
        brush.radius = self.radius_at(point);
        if inverse {
            brush.tool = inverse_of(&brush.tool);
        }
        brush.symmetry = self.symmetry();
        brush
    }

    /// The copies that are painted.
    pub fn symmetry(&self) -> Symmetry {
        let [u, v] = self.symmetry_center;
        match self.mirror {
            _ if self.copies >= 2 => Symmetry::Radial {
                count: self.copies.min(crate::paint::COPIES_MAX),
                center: [u, v],
            },
            Mirror::Off => Symmetry::None,
            Mirror::U => Symmetry::MirrorU { at: u },
            Mirror::V => Symmetry::MirrorV { at: v },
            Mirror::Both => Symmetry::MirrorBoth { at: [u, v] },
        }
    }

    /// The string that the pointer pulls the brush by, surface units, where a point of the screen is `point` of them broad.
    pub fn string_length(&self, point: f32) -> f32 {
        self.stabiliser.clamp(0.0, 1.0) * STRING_RADII * self.radius_at(point)
    }

    /// Makes the brush larger (or smaller) by so many steps of a tenth.
    pub fn resize(&mut self, steps: f32) {
        let radius = self.brush().radius * 1.1f32.powf(steps);
        self.set_radius(radius);
    }

    /// Sets the radius, surface units.
    pub fn set_radius(&mut self, radius: f32) {
        if radius.is_finite() {
            self.brush_mut().radius = radius.clamp(RADIUS_RANGE[0], RADIUS_RANGE[1]);
        }
    }

    /// Changes the hardness by so many tenths.
    pub fn harden(&mut self, steps: f32) {
        let brush = self.brush_mut();
        brush.hardness = rounded(brush.hardness + 0.1 * steps);
    }

    /// Changes the flow by so many tenths.
    pub fn change_flow(&mut self, steps: f32) {
        let brush = self.brush_mut();
        brush.flow = rounded(brush.flow + 0.1 * steps);
    }

    /// Exchanges the widths along and across, where the tool has both.
    pub fn swap_alphas(&mut self) {
        match &mut self.brush_mut().tool {
            Tool::Groove(g) => std::mem::swap(&mut g.along, &mut g.across),
            Tool::Scratch(s) => std::mem::swap(&mut s.along, &mut s.across),
            Tool::SetAlpha(s) => std::mem::swap(&mut s.alpha_x, &mut s.alpha_y),
            Tool::Fill(f) => std::mem::swap(&mut f.alpha_x, &mut f.alpha_y),
            Tool::Roughen(r) => r.factor = 1.0 / r.factor,
            Tool::Comb | Tool::Smooth(_) | Tool::SetDirection(_) | Tool::Erase => {}
        }
    }

    /// Gives every tool that lays widths or a direction those of a texel; `degrees` counter-clockwise from +U.
    pub fn pick(&mut self, alpha_x: f32, alpha_y: f32, degrees: f32) {
        let x = alpha_x.clamp(ALPHA_MIN, ALPHA_MAX);
        let y = alpha_y.clamp(ALPHA_MIN, ALPHA_MAX);
        for brush in &mut self.brushes {
            match &mut brush.tool {
                Tool::Groove(g) => (g.along, g.across) = (x, y),
                Tool::Scratch(s) => (s.along, s.across) = (x, y),
                Tool::SetAlpha(s) => (s.alpha_x, s.alpha_y) = (Some(x), Some(y)),
                Tool::Fill(f) => {
                    (f.alpha_x, f.alpha_y, f.angle) = (Some(x), Some(y), Some(degrees));
                }
                Tool::SetDirection(s) => s.angle = degrees,
                Tool::Comb | Tool::Smooth(_) | Tool::Roughen(_) | Tool::Erase => {}
            }
        }
    }
}

fn inverse_of(tool: &Tool) -> Tool {
    match tool {
        Tool::Roughen(r) => Tool::Roughen(Roughen {
            factor: 1.0 / r.factor,
            keep: r.keep,
        }),
        _ => Tool::Erase,
    }
}

/// A part of one in hundredths.
fn rounded(value: f32) -> f32 {
    ((value * 100.0).round() / 100.0).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tool_has_a_brush_that_is_allowed_and_keeps_it() {
        let mut hand = Hand::default();
        for kind in ToolKind::ALL {
            hand.take(kind);
            hand.stroke_brush(false, 0.001).check().unwrap();
            hand.stroke_brush(true, 0.001).check().unwrap();
            hand.resize(1000.0);
            hand.brush().check().unwrap();
            hand.resize(-1000.0);
            hand.brush().check().unwrap();
        }
        hand.take(ToolKind::Comb);
        hand.set_radius(0.2);
        hand.take(ToolKind::Groove);
        assert_ne!(hand.brush().radius, 0.2);
        hand.take(ToolKind::Comb);
        assert_eq!(hand.brush().radius, 0.2);
    }

    #[test]
    fn a_size_on_the_screen_is_the_same_at_every_zoom() {
        let mut hand = Hand::default();
        hand.set_radius(0.05);
        assert_eq!([0.001, 0.004].map(|p| hand.radius_at(p)), [0.05; 2]);
        hand.on_screen = true;
        // 25 points, each so many units broad.
        for (point, radius) in [(0.001, 0.025), (0.004, 0.1), (1e-9, 0.0005), (1e9, 2.0)] {
            let brush = hand.stroke_brush(false, point);
            assert!(
                (brush.radius / radius - 1.0).abs() < 1e-5,
                "{}",
                brush.radius
            );
            brush.check().unwrap();
        }
        assert_eq!(hand.size_text(), "50 pt");
        hand.stabiliser = 0.5;
        assert!((hand.string_length(0.004) - 0.3).abs() < 1e-6);
    }

    #[test]
    fn ctrl_undoes_what_the_tool_does() {
        let mut hand = Hand::default();
        assert_eq!(hand.stroke_brush(true, 0.001).tool, Tool::Erase);
        hand.take(ToolKind::Roughen);
        let Tool::Roughen(r) = hand.stroke_brush(true, 0.001).tool else {
            panic!()
        };
        assert!((r.factor * 1.5 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn picking_and_swapping_reach_the_tools() {
        let mut hand = Hand::default();
        hand.pick(0.2, 3.0, 45.0);
        hand.swap_alphas();
        let Tool::Groove(g) = hand.brush().tool else {
            panic!()
        };
        assert_eq!((g.along, g.across), (ALPHA_MAX, 0.2));
        hand.take(ToolKind::Fill);
        let Tool::Fill(f) = hand.brush().tool else {
            panic!()
        };
        assert_eq!((f.alpha_x, f.angle), (Some(0.2), Some(45.0)));
    }

    #[test]
    fn symmetry_follows_the_switches() {
        let mut hand = Hand {
            mirror: Mirror::Both,
            ..Hand::default()
        };
        assert_eq!(hand.symmetry(), Symmetry::MirrorBoth { at: [0.5; 2] });
        hand.copies = 6;
        assert!(matches!(hand.symmetry(), Symmetry::Radial { count: 6, .. }));
        hand.stroke_brush(false, 0.001).check().unwrap();
        hand.harden(3.0);
        hand.change_flow(-20.0);
        assert_eq!((hand.brush().hardness, hand.brush().flow), (0.8, 0.0));
    }
}
