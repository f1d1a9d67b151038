//! Textures of other programs: two numbers that tell the widths, one or two that tell the direction, and what is to be known
//! of them to read a texel.
//!
//! The formulas are those of the programs' own sources and specifications: `KHR_materials_anisotropy`, Burley's
//! `disney.brdf` (which Cycles follows), `standard_surface.osl`, `open_pbr_surface.mtlx`, Unreal's and Unity's
//! `ConvertAnisotropyToRoughness`, Cycles' `node_glossy_bsdf.osl`, and Substance Painter's shader library.

use super::{LobeFit, Stretched, gltf};
use crate::map::Texel;
use crate::math::Axis;
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// How two numbers tell the width along an axis and the one across it. The first is a width a, or a roughness whose square it
/// is ([`Curve`]); the second is s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Widths {
    /// Two widths, each for itself: Mitsuba's, pbrt's (of GGX), and this program's own.
    #[default]
    Alpha,
    /// along = mix(a, 1, s²), across = a.
    Gltf,
    /// aspect = √(1 - 0.9 s); along = a / aspect, across = a aspect.
    Disney,
    /// aspect = √(1 - s), s at most 0.98; along = a / aspect, at most 1, across = a aspect.
    StandardSurface,
    /// along = a √(2 / (1 + (1 - s)²)), across = (1 - s) along.
    OpenPbr,
    /// along = a (1 + s), across = a (1 - s), s from -1 to 1.
    KullaConty,
    /// s from -0.99 to 0.99: along = a (1 - s), across = a / (1 - s) where s is over 0, else along = a / (1 + s), across = a (1 + s).
    Glossy,
    /// along = a, across = a / (1 - s).
    Substance,
}

impl Widths {
    /// Every way.
    pub const ALL: [Self; 8] = [
        Self::Alpha,
        Self::Gltf,
        Self::Disney,
        Self::StandardSurface,
        Self::OpenPbr,
        Self::KullaConty,
        Self::Glossy,
        Self::Substance,
    ];

    /// The word for it in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::Gltf => "gltf",
            Self::Disney => "disney",
            Self::StandardSurface => "standard_surface",
            Self::OpenPbr => "open_pbr",
            Self::KullaConty => "kulla_conty",
            Self::Glossy => "glossy",
            Self::Substance => "substance",
        }
    }

    /// Whether its second number goes below 0.
    pub fn is_signed(self) -> bool {
        matches!(self, Self::KullaConty | Self::Glossy)
    }

    /// (along, across) of a width and the second number. Numbers outside its range are taken as its ends.
    fn decode(self, a: f32, s: f32) -> (f32, f32) {
        let part = s.clamp(0.0, 1.0);
        let signed = s.clamp(-1.0, 1.0);
        // What would divide by 0 leaves a width beyond all that a map holds.
        let rest = |s: f32| (1.0 - s).max(1e-6);
        match self {
            Self::Alpha => (a, s),
            Self::Gltf => gltf::decode(a.max(0.0).sqrt(), part),
            Self::Disney => {
                let aspect = (1.0 - 0.9 * part).sqrt();
                (a / aspect, a * aspect)
            }
            Self::StandardSurface => {
                let aspect = (1.0 - part.min(0.98)).sqrt();
                ((a / aspect).min(1.0), a * aspect)
            }
            Self::OpenPbr => {
                let rest = 1.0 - part;
                let along = a * (2.0 / (1.0 + rest * rest)).sqrt();
                (along, rest * along)
            }
            Self::KullaConty => (a * (1.0 + signed), a * (1.0 - signed)),
            Self::Glossy => {
                let s = s.clamp(-0.99, 0.99); // as Cycles does
                if s > 0.0 {
                    (a * (1.0 - s), a / (1.0 - s))
                } else {
                    (a / (1.0 + s), a * (1.0 + s))
                }
            }
            Self::Substance => (a, a / rest(part)),
        }
    }
}

/// What the first number is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Curve {
    /// The width.
    #[default]
    Linear,
    /// A roughness: the width is its square.
    Square,
}

/// How numbers tell the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Two numbers, (cos θ, sin θ), of any length.
    #[default]
    Vector,
    /// Two numbers, (cos 2θ, sin 2θ), of any length.
    Double,
    /// One number: a part of [`Convention::angle_range`].
    Angle,
}

/// Which axis the direction is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Leads {
    /// The one that the formula of the widths calls along; of two widths, that of the first.
    #[default]
    Along,
    /// The one with the larger width: highlights stretch along it.
    Highlight,
    /// The one with the smaller width: grooves run along it.
    Grooves,
}

/// What the numbers of a set of textures mean. The default is two Ward widths and a vector from -1 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Convention {
    /// How two numbers tell the widths.
    pub widths: Widths,
    /// What the first number is, and with `alpha` the second too.
    pub curve: Curve,
    /// The first number is 1 minus what is stored: smoothness, glossiness.
    pub inverted: bool,
    /// The width of a stored 1; 0.001 to 100.
    pub scale: f32,
    /// A factor of the second number, but with `alpha`; 0 to 1.
    pub strength: f32,
    /// A stored 0 of the second number is -1, the middle 0.
    pub second_from_middle: bool,
    /// The lobe that the widths belong to: `identity` for Ward's and Beckmann's, `ward_to_ggx` for GGX, of which the Ward
    /// width is taken whose best fit it is.
    pub lobe_fit: LobeFit,
    /// How numbers tell the direction.
    pub encoding: Encoding,
    /// A stored 0 of a direction's vector is -1, the middle 0.
    pub direction_from_middle: bool,
    /// The degrees of a stored 1 of an angle; 1 to 720.
    pub angle_range: f32,
    /// Angles grow clockwise, vectors have their second part toward image-down.
    pub clockwise: bool,
    /// Degrees that are added counter-clockwise; -360 to 360.
    pub rotation: f32,
    /// Which axis the direction is of.
    pub leads: Leads,
}

impl Default for Convention {
    fn default() -> Self {
        Self::PLAIN
    }
}

/// A convention that has a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    /// What it is called.
    pub name: &'static str,
    /// What its files hold, in a sentence.
    pub about: &'static str,
    /// What the numbers mean.
    pub convention: Convention,
}

impl Convention {
    const PLAIN: Self = Self {
        widths: Widths::Alpha,
        curve: Curve::Linear,
        inverted: false,
        scale: 1.0,
        strength: 1.0,
        second_from_middle: false,
        lobe_fit: LobeFit::Identity,
        encoding: Encoding::Vector,
        direction_from_middle: false,
        angle_range: 360.0,
        clockwise: false,
        rotation: 0.0,
        leads: Leads::Along,
    };
    /// What most renderers share: roughness, an anisotropy, and GGX.
    const ROUGHNESS: Self = Self {
        curve: Curve::Square,
        lobe_fit: LobeFit::WardToGgx,
        encoding: Encoding::Angle,
        ..Self::PLAIN
    };

    /// Those that have a name, the likeliest first.
    pub const NAMED: [Named; 13] = [
        Named {
            name: "glTF",
            about: "Roughness in G of one texture; direction in R, G and strength in B of another (KHR_materials_anisotropy).",
            convention: Self {
                widths: Widths::Gltf,
                encoding: Encoding::Vector,
                direction_from_middle: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Blender Principled",
            about: "Roughness, anisotropic 0 to 1, rotation 0 to 1 for a turn counter-clockwise; Disney's formula.",
            convention: Self {
                widths: Widths::Disney,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Blender Glossy",
            about: "Roughness, anisotropy -1 to 1 (over 0 it stretches across the tangent), rotation counter-clockwise.",
            convention: Self {
                widths: Widths::Glossy,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Substance Painter",
            about: "Roughness, anisotropy level, angle 0 to 1 for a turn clockwise.",
            convention: Self {
                widths: Widths::Substance,
                clockwise: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Standard Surface (Arnold)",
            about: "Roughness, anisotropy 0 to 1, rotation 0 to 1 for a turn clockwise.",
            convention: Self {
                widths: Widths::StandardSurface,
                clockwise: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "OpenPBR",
            about: "Roughness, anisotropy 0 to 1, a tangent vector with 0.5 for 0.",
            convention: Self {
                widths: Widths::OpenPbr,
                encoding: Encoding::Vector,
                direction_from_middle: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Unreal",
            about: "Roughness, anisotropy, a tangent vector with green toward image-down.",
            convention: Self {
                widths: Widths::KullaConty,
                encoding: Encoding::Vector,
                direction_from_middle: true,
                clockwise: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Unity HDRP",
            about: "Smoothness, anisotropy, a tangent vector with green toward image-up.",
            convention: Self {
                widths: Widths::KullaConty,
                inverted: true,
                encoding: Encoding::Vector,
                direction_from_middle: true,
                ..Self::ROUGHNESS
            },
        },
        Named {
            name: "Widths and angle",
            about: "alpha_u and alpha_v of Ward or Beckmann (Mitsuba), an angle 0 to 1 for a turn.",
            convention: Self {
                encoding: Encoding::Angle,
                ..Self::PLAIN
            },
        },
        Named {
            name: "GGX widths and angle",
            about: "alpha_x and alpha_y of GGX (pbrt without remapping, Mitsuba's ggx), an angle 0 to 1 for a turn.",
            convention: Self {
                encoding: Encoding::Angle,
                lobe_fit: LobeFit::WardToGgx,
                ..Self::PLAIN
            },
        },
        Named {
            name: "Flow map",
            about: "The direction of the grooves as a vector with 0.5 for 0.",
            convention: Self {
                direction_from_middle: true,
                leads: Leads::Grooves,
                ..Self::PLAIN
            },
        },
        Named {
            name: "anisomap PNG, 16 bit",
            about: "NAME_alpha_x_16bit.png, NAME_alpha_y_16bit.png and NAME_axis_16bit.png as this program writes them.",
            convention: Self {
                scale: 1.5,
                encoding: Encoding::Double,
                direction_from_middle: true,
                ..Self::PLAIN
            },
        },
        Named {
            name: "anisomap PNG, 8 bit",
            about: "NAME_alpha_x_8bit.png, NAME_alpha_y_8bit.png and NAME_axis_8bit.png as this program writes them.",
            convention: Self {
                scale: 1.5,
                curve: Curve::Square,
                encoding: Encoding::Double,
                direction_from_middle: true,
                ..Self::PLAIN
            },
        },
    ];

    /// One of [`Convention::NAMED`] by its name.
    pub fn named(name: &str) -> Option<Self> {
        let mut all = Self::NAMED.iter();
        all.find(|n| n.name == name).map(|n| n.convention)
    }

    /// The texel that stored numbers tell, 0 to 1 each where they were integers: two for the widths and two for the
    /// direction, of which an angle has the first alone. Widths may lie outside what a map holds, or be no numbers.
    pub fn texel(&self, first: f32, second: f32, direction: Vec2) -> Texel {
        let a = self.width(if self.inverted { 1.0 - first } else { first });
        let s = match self.widths {
            Widths::Alpha => self.width(second),
            _ if self.second_from_middle => self.strength * (2.0 * second - 1.0),
            _ => self.strength * second,
        };
        let (along, across) = self.widths.decode(a, s);
        let ward = |alpha: f32| self.lobe_fit.invert(alpha.max(1e-7));
        let (along, across) = (ward(along), ward(across));
        let led = self.axis(direction);
        let leads_along = match self.leads {
            Leads::Along => true,
            Leads::Highlight => along >= across,
            Leads::Grooves => along <= across,
        };
        let texel = Texel {
            alpha_x: along,
            alpha_y: across,
            axis: if leads_along {
                led
            } else {
                led.perpendicular()
            },
        };
        match self.widths {
            Widths::Alpha => texel,
            // Which axis is called x is a matter of naming: as a brush lays it, along the grooves.
            _ => Stretched::from(texel).to_texel(false),
        }
    }

    fn width(&self, stored: f32) -> f32 {
        match self.curve {
            Curve::Linear => self.scale * stored,
            Curve::Square => self.scale * stored * stored,
        }
    }

    /// An axis of length 0 where the numbers tell none, to be mended by whoever makes a map of it.
    fn axis(&self, stored: Vec2) -> Axis {
        let none = Axis {
            cos2: 0.0,
            sin2: 0.0,
        };
        let middle = if self.direction_from_middle {
            2.0 * stored - Vec2::ONE
        } else {
            stored
        };
        let told = match self.encoding {
            Encoding::Vector => Axis::from_vector(middle).unwrap_or(none),
            Encoding::Double => Axis::from_double_angle(middle).unwrap_or(none),
            Encoding::Angle => Axis::from_degrees(stored.x * self.angle_range),
        };
        let seen = Axis {
            sin2: if self.clockwise {
                -told.sin2
            } else {
                told.sin2
            },
            ..told
        };
        if self.rotation == 0.0 {
            seen
        } else {
            seen.turned(Axis::from_degrees(self.rotation))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn named(name: &str) -> Convention {
        Convention::named(name).unwrap()
    }

    /// Without the exchange of lobes, so that formulas can be read off.
    fn bare(name: &str) -> Convention {
        Convention {
            lobe_fit: LobeFit::Identity,
            ..named(name)
        }
    }

    fn assert_texel(texel: Texel, widths: (f32, f32), degrees: f32) {
        assert!((texel.alpha_x / widths.0 - 1.0).abs() < 1e-5, "{texel:?}");
        assert!((texel.alpha_y / widths.1 - 1.0).abs() < 1e-5, "{texel:?}");
        let apart = texel.axis.angle_to(Axis::from_degrees(degrees));
        assert!(apart.to_degrees() < 1e-3, "{texel:?} {degrees}");
    }

    #[test]
    fn each_program_is_read_by_its_own_formula() {
        // The expected grooves run across the highlight, which each program stretches by its own rule.
        let up = Vec2::new(0.5, 1.0);
        let eighth = Vec2::new(0.125, 0.0);
        assert_texel(bare("glTF").texel(0.5, 0.6, up), (0.25, 0.52), 0.0);
        let aspect = (1.0f32 - 0.45).sqrt();
        let disney = bare("Blender Principled").texel(0.5, 0.5, eighth);
        assert_texel(disney, (0.25 * aspect, 0.25 / aspect), 45.0 + 90.0);
        // Over 0 the glossy node stretches across its tangent, below 0 along it.
        let glossy = bare("Blender Glossy");
        assert_texel(glossy.texel(0.5, 0.5, eighth), (0.125, 0.5), 45.0);
        assert_texel(glossy.texel(0.5, -0.5, eighth), (0.125, 0.5), 135.0);
        let painter = bare("Substance Painter").texel(0.5, 0.5, eighth);
        assert_texel(painter, (0.25, 0.5), -45.0);
        let half = 0.5f32.sqrt();
        let arnold = bare("Standard Surface (Arnold)").texel(0.5, 0.5, eighth);
        assert_texel(arnold, (0.25 * half, 0.25 / half), -45.0 + 90.0);
        let along = 0.25 * (2.0f32 / 1.25).sqrt();
        assert_texel(
            bare("OpenPBR").texel(0.5, 0.5, up),
            (0.5 * along, along),
            0.0,
        );
        let tilted = Vec2::new(1.0, 1.0);
        assert_texel(bare("Unreal").texel(0.5, 0.5, tilted), (0.125, 0.375), 45.0);
        assert_texel(
            bare("Unity HDRP").texel(0.5, 0.5, tilted),
            (0.125, 0.375),
            135.0,
        );
        let plain = named("Widths and angle").texel(0.3, 0.1, eighth);
        assert_texel(plain, (0.3, 0.1), 45.0);
    }

    #[test]
    fn grooves_and_highlights_are_told_apart() {
        let flow = |leads, (x, y)| {
            Convention {
                leads,
                ..named("Flow map")
            }
            .texel(x, y, Vec2::ONE)
        };
        assert_texel(flow(Leads::Grooves, (0.1, 0.4)), (0.1, 0.4), 45.0);
        assert_texel(flow(Leads::Grooves, (0.4, 0.1)), (0.4, 0.1), 135.0);
        assert_texel(flow(Leads::Highlight, (0.1, 0.4)), (0.1, 0.4), 135.0);
    }

    #[test]
    fn a_wild_number_is_no_panic_and_no_infinite_width() {
        let wild = [f32::NAN, f32::INFINITY, -1e30, 0.0, 1.0, 1e30];
        for named in Convention::NAMED {
            for (a, s) in wild.into_iter().flat_map(|a| wild.map(|s| (a, s))) {
                named.convention.texel(a, s, Vec2::new(s, a));
            }
        }
        let steep = named("Substance Painter").texel(0.5, 1.0, Vec2::ZERO);
        assert!(steep.alpha_y.is_finite());
    }

    proptest! {
        #[test]
        fn opposite_vectors_and_half_turns_are_one_axis(t in 0.0f32..1.0, a in 0.1f32..1.0, s in 0.0f32..1.0) {
            for named in Convention::NAMED {
                let c = named.convention;
                let (one, other) = match c.encoding {
                    Encoding::Angle => (Vec2::new(t, 0.0), Vec2::new(t + 0.5, 0.0)),
                    Encoding::Vector => {
                        let v = 0.5 * Vec2::from_angle(6.0 * t);
                        (Vec2::splat(0.5) + v, Vec2::splat(0.5) - v)
                    }
                    Encoding::Double => continue,
                };
                let (p, q) = (c.texel(a, s, one), c.texel(a, s, other));
                prop_assert!(p.axis.angle_to(q.axis).to_degrees() < 0.01, "{}", named.name);
                prop_assert_eq!((p.alpha_x, p.alpha_y), (q.alpha_x, q.alpha_y));
            }
        }
    }
}
