//! What a texture may mean, by its name and its channels and by the files beside it. A guess is shown before it is used.

use super::numbers::{self, ENDINGS};
use super::textures::{Channel, Textures};
use crate::convention::textures::{Convention, Encoding};
use crate::error::{Error, Result};
use std::path::Path;

/// What a file of a set holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// Both widths in one file.
    Widths,
    /// A width of the x axis or of +U.
    First,
    /// A width across it.
    Second,
    Roughness,
    Smoothness,
    /// Roughness in G.
    Packed,
    Anisotropy,
    Level,
    Angle,
    Vector,
    Double,
}

/// Ends of names, without marks between words and in small letters, and what they say. The first that fits is taken.
const WORDS: [(&str, Role); 52] = [
    ("metallicroughness", Role::Packed),
    ("roughnessmetallic", Role::Packed),
    ("occlusionroughnessmetallic", Role::Packed),
    ("orm", Role::Packed),
    ("arm", Role::Packed),
    ("alphax16bit", Role::First),
    ("alphax8bit", Role::First),
    ("alphay16bit", Role::Second),
    ("alphay8bit", Role::Second),
    ("axis16bit", Role::Double),
    ("axis8bit", Role::Double),
    ("angle16bit", Role::Angle),
    ("direction16bit", Role::Vector),
    ("direction8bit", Role::Vector),
    ("alphax", Role::First),
    ("alphau", Role::First),
    ("uroughness", Role::First),
    ("alphay", Role::Second),
    ("alphav", Role::Second),
    ("vroughness", Role::Second),
    ("anisotropylevel", Role::Level),
    ("anisotropicrotation", Role::Angle),
    ("anisotropyrotation", Role::Angle),
    ("anisotropyangle", Role::Angle),
    ("anisotropydirection", Role::Vector),
    ("anisorotation", Role::Angle),
    ("anisoangle", Role::Angle),
    ("specularrotation", Role::Angle),
    ("specularanisotropy", Role::Anisotropy),
    ("anisotropic", Role::Anisotropy),
    ("anisotropy", Role::Anisotropy),
    ("anisostrength", Role::Anisotropy),
    ("aniso", Role::Anisotropy),
    ("roughness", Role::Roughness),
    ("rough", Role::Roughness),
    ("smoothness", Role::Smoothness),
    ("glossiness", Role::Smoothness),
    ("gloss", Role::Smoothness),
    ("rotation", Role::Angle),
    ("angle", Role::Angle),
    ("tangentmap", Role::Vector),
    ("tangents", Role::Vector),
    ("tangent", Role::Vector),
    ("flowmap", Role::Vector),
    ("flow", Role::Vector),
    ("combmap", Role::Vector),
    ("comb", Role::Vector),
    ("direction", Role::Vector),
    ("dir", Role::Vector),
    ("axis", Role::Double),
    ("alpha", Role::Widths),
    ("widths", Role::Widths),
];

/// The files of a folder that are looked at for others of the same set.
const FILES_MAX: usize = 10_000;

/// A set of textures.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// The channels; files are named without their folder, which is that of the file asked about.
    pub textures: Textures,
    /// The name of the convention.
    pub convention: &'static str,
    /// What the set is called.
    pub name: String,
}

/// One file of a set.
struct Member {
    file: String,
    role: Role,
    channels: Vec<String>,
}

impl Member {
    /// The channel with the number `at`; the last one where it has not so many.
    fn channel(&self, at: usize) -> Channel {
        let last = self.channels.len().saturating_sub(1);
        let name = self.channels.get(at.min(last)).map_or("r", String::as_str);
        Channel::new(&*self.file, name)
    }

    fn is_grey(&self) -> bool {
        self.channels.len() < 3
    }
}

/// The names of the other pictures in a picture's folder, in order.
pub fn pictures_beside(path: &Path) -> Vec<String> {
    let own = path.file_name();
    let Ok(entries) = std::fs::read_dir(folder_of(path)) else {
        return vec![];
    };
    let mut names: Vec<String> = entries
        .take(FILES_MAX)
        .filter_map(|entry| Some(entry.ok()?.file_name()))
        .filter(|name| Some(name.as_os_str()) != own)
        .filter_map(|name| name.into_string().ok())
        .filter(|name| is_picture(name))
        .collect();
    names.sort();
    names
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn is_picture(name: &str) -> bool {
    let ending = name
        .rsplit_once('.')
        .map(|(_, ending)| ending.to_lowercase());
    ending.is_some_and(|e| ENDINGS.contains(&&*e))
}

/// What a picture and those beside it may mean.
///
/// # Errors
/// As [`numbers::about`], and [`Error::File`] where the name is no Unicode.
pub fn guess(path: &Path) -> Result<Guess> {
    let file = path.file_name().and_then(|n| n.to_str());
    let file = file.ok_or_else(|| {
        Error::file(path, "a recipe cannot name it: its name is no Unicode")
            .with_hint("Rename the file")
    })?;
    let channels = channels_in_order(numbers::about(path)?.channels);
    let (base, role) = role_of(file);
    let role = role.unwrap_or(if channels.len() < 3 {
        Role::Roughness
    } else {
        Role::Vector
    });
    let own = Member {
        file: file.to_owned(),
        role,
        channels,
    };
    let mut set = vec![own];
    set.extend(siblings(path, &base));
    Ok(read_set(&set, base))
}

/// R, G, B, A before any others, so that the first is the one that is meant.
fn channels_in_order(mut names: Vec<String>) -> Vec<String> {
    let place = |name: &String| "rgba".find(&name.to_lowercase()).unwrap_or(4);
    names.sort_by_key(place);
    names
}

/// The name without what says the role, and the role.
fn role_of(file: &str) -> (String, Option<Role>) {
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    // Letters and digits in small, each with the place in the name where it begins.
    let plain: Vec<(usize, char)> = stem
        .char_indices()
        .filter(|(_, c)| c.is_alphanumeric())
        .map(|(i, c)| (i, c.to_ascii_lowercase()))
        .collect();
    let text: String = plain.iter().map(|(_, c)| *c).collect();
    for (word, role) in WORDS {
        let Some(rest) = text.strip_suffix(word) else {
            continue;
        };
        let at = plain[rest.chars().count()].0;
        let marks = |c: char| !c.is_alphanumeric();
        let begins = stem[at..].starts_with(char::is_uppercase);
        // `platform` does not end in the word `orm`.
        if at == 0 || stem[..at].ends_with(marks) || begins {
            let base = stem[..at].trim_end_matches(marks);
            return (base.to_owned(), Some(role));
        }
    }
    (stem.to_owned(), None)
}

/// The other files of a set.
fn siblings(path: &Path, base: &str) -> Vec<Member> {
    let of_set = |file: String| -> Option<Member> {
        let (its_base, role) = role_of(&file);
        let role = role.filter(|_| its_base == base)?;
        let about = numbers::about(&folder_of(path).join(&file)).ok()?;
        Some(Member {
            file,
            role,
            channels: channels_in_order(about.channels),
        })
    };
    pictures_beside(path)
        .into_iter()
        .filter_map(of_set)
        .collect()
}

fn read_set(set: &[Member], base: String) -> Guess {
    let depth = |m: &&Member| bits_of(&m.file) == bits_of(&set[0].file);
    let find = |role: Role| {
        let mut all = set.iter().filter(|m| m.role == role);
        all.clone().find(depth).or_else(|| all.next())
    };
    let (packed, aniso) = (find(Role::Packed), find(Role::Anisotropy));
    let roughness = find(Role::Roughness).or(find(Role::Smoothness)).or(packed);
    let first = find(Role::First).or(find(Role::Widths));
    let vector = find(Role::Vector);
    let own = bits_of(&set[0].file);
    let in_gltf = aniso.filter(|m| !m.is_grey() && find(Role::Angle).is_none());
    let convention = match (first, own) {
        (Some(_), Some(8)) => "anisomap PNG, 8 bit",
        (Some(_), Some(_)) => "anisomap PNG, 16 bit",
        (Some(_), None) => "Widths and angle",
        _ if in_gltf.is_some() => "glTF",
        _ if find(Role::Level).is_some() => "Substance Painter",
        _ if find(Role::Smoothness).is_some() => "Unity HDRP",
        _ if roughness.is_some() && vector.is_some() => "Unreal",
        _ if roughness.is_none() && vector.is_some() => "Flow map",
        _ => "Blender Principled",
    };
    let mut textures = Textures {
        convention: Convention::named(convention).expect("a name of the list"),
        ..Textures::default()
    };
    let c = &mut textures.convention;
    let direction = match (in_gltf, first) {
        (Some(m), _) => Some(m),
        (None, Some(_)) => find(Role::Double).or(vector).or(find(Role::Angle)),
        (None, None) => find(Role::Angle).or(vector).or(find(Role::Double)),
    };
    if let Some(member) = direction {
        c.encoding = match member.role {
            Role::Double => Encoding::Double,
            Role::Angle => Encoding::Angle,
            _ => Encoding::Vector,
        };
        // Floats have a sign of their own.
        let whole = !member.file.to_lowercase().ends_with(".exr");
        c.direction_from_middle = whole && c.encoding != Encoding::Angle;
        if first.is_some() && member.role == Role::Angle && own.is_some() {
            c.angle_range = HALF_TURN_16_BIT;
        }
        textures.direction = Some(member.channel(0));
        let two = c.encoding != Encoding::Angle;
        textures.direction_v = two.then(|| member.channel(1));
    }
    if let Some(member) = first {
        textures.first = Some(member.channel(0));
        textures.second = match find(Role::Second) {
            Some(second) => Some(second.channel(0)),
            None => (member.role == Role::Widths).then(|| member.channel(1)),
        };
    } else if let Some(member) = roughness {
        let packed = member.role == Role::Packed || in_gltf.is_some();
        let green = packed && !member.is_grey();
        textures.first = Some(member.channel(usize::from(green)));
        textures.second = match (in_gltf, aniso.or(find(Role::Level))) {
            (Some(m), _) => Some(m.channel(2)),
            (None, Some(m)) => Some(m.channel(0)),
            (None, None) => None,
        };
    } else if textures.direction.is_none() {
        // An anisotropy alone is shown as the first number: somebody has to say more.
        textures.first = Some(set[0].channel(0));
    }
    Guess {
        textures,
        convention,
        name: if base.is_empty() {
            "map".to_owned()
        } else {
            base
        },
    }
}

/// The degrees of a white texel of `NAME_angle_16bit.png`, whose 65,536 steps go around.
const HALF_TURN_16_BIT: f32 = 180.0 * 65535.0 / 65536.0;

/// The depth that this program's own names state.
fn bits_of(file: &str) -> Option<u8> {
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    match () {
        () if stem.ends_with("_8bit") => Some(8),
        () if stem.ends_with("_16bit") => Some(16),
        () => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, RgbImage};

    fn folder(grey: &[&str], rgb: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in grey {
            GrayImage::new(2, 2).save(folder.path().join(name)).unwrap();
        }
        for name in rgb {
            RgbImage::new(2, 2).save(folder.path().join(name)).unwrap();
        }
        folder
    }

    fn named(guess: &Guess) -> Vec<(&'static str, String)> {
        let told = |(key, c): (&'static str, &Channel)| (key, format!("{}:{}", c.file, c.channel));
        guess.textures.channels().map(told).collect()
    }

    #[test]
    fn sets_are_found_by_their_names() {
        for (grey, rgb, convention, wanted) in [
            (
                &[
                    "steel_Roughness.png",
                    "steel_Anisotropic.png",
                    "steel_Rotation.png",
                    "other_Roughness.png",
                ][..],
                &["steel_BaseColor.png"][..],
                "Blender Principled",
                &[
                    "first steel_Roughness.png:r",
                    "second steel_Anisotropic.png:r",
                    "direction steel_Rotation.png:r",
                ][..],
            ),
            (
                &[],
                &["a_metallicRoughness.png", "a_anisotropy.png"],
                "glTF",
                &[
                    "first a_metallicRoughness.png:g",
                    "second a_anisotropy.png:b",
                    "direction a_anisotropy.png:r",
                    "direction_v a_anisotropy.png:g",
                ],
            ),
            (
                &[
                    "lid_roughness.png",
                    "lid_anisotropyLevel.png",
                    "lid_anisotropyAngle.png",
                ],
                &[],
                "Substance Painter",
                &[
                    "first lid_roughness.png:r",
                    "second lid_anisotropyLevel.png:r",
                    "direction lid_anisotropyAngle.png:r",
                ],
            ),
            (
                &[
                    "w_alpha_x_8bit.png",
                    "w_alpha_y_8bit.png",
                    "w_alpha_x_16bit.png",
                    "w_angle_16bit.png",
                ],
                &["w_axis_8bit.png", "w_axis_16bit.png"],
                "anisomap PNG, 8 bit",
                &[
                    "first w_alpha_x_8bit.png:r",
                    "second w_alpha_y_8bit.png:r",
                    "direction w_axis_8bit.png:r",
                    "direction_v w_axis_8bit.png:g",
                ],
            ),
            (
                &[],
                &["hair_flow.png"],
                "Flow map",
                &["direction hair_flow.png:r", "direction_v hair_flow.png:g"],
            ),
            (
                &["platform.png"],
                &[],
                "Blender Principled",
                &["first platform.png:r"],
            ),
        ] {
            let folder = folder(grey, rgb);
            let asked = grey.first().or(rgb.first()).unwrap();
            let guess = guess(&folder.path().join(asked)).unwrap();
            assert_eq!(guess.convention, convention, "{asked}");
            let told: Vec<String> = named(&guess)
                .iter()
                .map(|(k, v)| format!("{k} {v}"))
                .collect();
            assert_eq!(told, wanted);
            guess.textures.check().unwrap();
        }
    }

    #[test]
    fn whatever_a_file_is_called_the_guess_can_be_used() {
        for (word, _) in WORDS {
            for is_grey in [true, false] {
                let name = format!("x_{word}.png");
                let names = [name.as_str()];
                let folder = if is_grey {
                    folder(&names, &[])
                } else {
                    folder(&[], &names)
                };
                let guess = guess(&folder.path().join(&name)).unwrap();
                guess.textures.check().unwrap();
                let read = guess.textures.read(crate::map::Wrap::Clamp, |_, file| {
                    Ok(folder.path().join(file))
                });
                // A grey file has no second part of a vector.
                assert!(read.is_ok() || is_grey, "{name}: {:?}", read.err());
                assert_eq!(guess.name, "x");
            }
        }
    }
}
