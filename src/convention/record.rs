//! The sentence a file carries about its own numbers: one JSON text in an EXR attribute, the same object in glTF `extras`.

use super::LobeFit;
use crate::map::{ALPHA_MIN, Wrap};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

/// What is known of a map besides its texels.
#[derive(Clone, Debug, PartialEq)]
pub struct MapInfo {
    /// The recipe or file it came from.
    pub name: String,
    /// The surface's width over its height for one turn of UV, > 0.
    pub aspect: f32,
    /// The mesh it was made for: a built-in's name, or a file as seen from the map's folder.
    pub mesh: Option<String>,
    /// The colours it was made with.
    pub material: Option<Reflectance>,
}

/// The colours that no map holds, linear RGB, 0 to 1 each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reflectance {
    /// Ward's rho_d.
    pub diffuse: [f32; 3],
    /// Ward's rho_s.
    pub specular: [f32; 3],
    /// What is given back of the ambient light.
    pub ambient: [f32; 3],
}

impl Default for MapInfo {
    fn default() -> Self {
        Self {
            name: "map".to_owned(),
            aspect: 1.0,
            mesh: None,
            material: None,
        }
    }
}

/// Which numbers a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// The map itself: both widths and the double-angle axis.
    Map,
    /// The widths alone, as R and G.
    Alpha,
    /// The direction alone, as R and G.
    Direction,
    /// A glTF material.
    Gltf,
    /// One width, or the axis, of a reduced map: the file's channels say which, and the recipe beside it where they belong.
    Part,
}

/// What the numbers of a file mean. Written in full for people; read back only for what a program needs, and anything that
/// is missing or unknown is left alone, so that a file of a later version still opens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapRecord {
    /// Version of this object; 1.
    pub version: u32,
    /// Which numbers the file holds.
    pub content: Content,
    /// The recipe or file it came from.
    #[serde(default)]
    pub recipe: String,
    /// What lies beyond the edge.
    #[serde(default)]
    pub wrap: Wrap,
    /// The surface's width over its height for one turn of UV.
    #[serde(default = "one")]
    pub aspect: f32,
    /// The mesh it was made for, where that is known.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "if_understood"
    )]
    pub mesh: Option<String>,
    /// The colours it was made with, where they are known.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "if_understood"
    )]
    pub material: Option<Reflectance>,
    /// The lobe the widths belong to.
    #[serde(default)]
    pub lobe: String,
    /// How the widths were exchanged for the target's, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lobe_fit: Option<LobeFit>,
    /// What the width channels mean.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub alpha: String,
    /// What the direction channels mean.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub axis: String,
    /// The smallest width a map holds.
    #[serde(default)]
    pub alpha_floor: f32,
    /// The program that wrote the file.
    #[serde(default)]
    pub generator: String,
}

fn one() -> f32 {
    1.0
}

/// A value of the shape we know, or none: what another version means by the key costs no more than the key.
fn if_understood<'de, D: Deserializer<'de>, T: DeserializeOwned>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    Ok(serde_json::from_value(value).ok())
}

const ALPHA: &str = "Ward slope widths along the x axis (alpha_x) and across it (alpha_y), linear";
const ANGLE: &str = "angle of the x axis, counter-clockwise from +U toward image-up, seen from outside, mod pi; alpha_x \
                     belongs to it; grooves run along the axis with the smaller alpha";

impl MapRecord {
    /// The name of the EXR attribute and of the glTF `extras` object.
    pub const NAME: &str = "anisomap";

    /// The record of a file with this content.
    pub fn new(content: Content, info: &MapInfo, wrap: Wrap) -> Self {
        let alpha = match content {
            Content::Map => format!("alpha.X, alpha.Y: {ALPHA}"),
            Content::Alpha => format!("R = alpha_x, G = alpha_y: {ALPHA}; B = 0"),
            Content::Part => format!("alpha.X, alpha.Y, or alpha for both: {ALPHA}"),
            Content::Direction | Content::Gltf => String::new(),
        };
        let axis = match content {
            Content::Map | Content::Part => {
                format!("axis.X = cos(2 theta), axis.Y = sin(2 theta); theta = {ANGLE}")
            }
            Content::Direction => format!(
                "R = cos(theta), G = sin(theta), signs chosen so that neighbours agree; B = 0; theta = {ANGLE}"
            ),
            Content::Alpha | Content::Gltf => String::new(),
        };
        Self {
            version: 1,
            content,
            recipe: info.name.clone(),
            wrap,
            aspect: info.aspect,
            mesh: info.mesh.clone(),
            material: info.material,
            lobe: "ward1992".to_owned(),
            lobe_fit: None,
            alpha,
            axis,
            alpha_floor: ALPHA_MIN,
            generator: generator(),
        }
    }

    /// As one line of JSON in plain ASCII, whatever the recipe's name is: EXR text is Latin-1 to some readers and UTF-8 to
    /// others.
    pub fn to_json(&self) -> String {
        let json = serde_json::to_string(self).expect("plain text and finite numbers serialise");
        let mut ascii = String::with_capacity(json.len());
        for c in json.chars() {
            if c.is_ascii() {
                ascii.push(c);
            } else {
                // Outside ASCII a JSON document has only the insides of strings.
                let units = c.encode_utf16(&mut [0; 2]).to_vec();
                ascii.extend(units.iter().map(|unit| format!("\\u{unit:04x}")));
            }
        }
        ascii
    }

    /// From JSON; `None` when it is not such an object.
    pub fn from_json(text: &str) -> Option<Self> {
        serde_json::from_str(text).ok()
    }

    /// What it says about the map, with an aspect that can be used.
    pub fn info(&self) -> MapInfo {
        let usable = self.aspect.is_finite() && self.aspect > 0.0;
        MapInfo {
            name: self.recipe.clone(),
            aspect: if usable { self.aspect } else { 1.0 },
            mesh: self.mesh.clone(),
            material: self.material,
        }
    }
}

/// Name and version of this program, for the files it writes.
pub(crate) fn generator() -> String {
    concat!("anisomap ", env!("CARGO_PKG_VERSION")).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_comes_back_and_a_later_version_still_opens() {
        let info = MapInfo {
            name: "pot \"steel\" \u{1f373}\u{e9}".to_owned(),
            aspect: 2.5,
            mesh: Some("pot".to_owned()),
            material: Some(Reflectance {
                diffuse: [0.1, 0.2, 0.3],
                specular: [0.4; 3],
                ambient: [0.0; 3],
            }),
        };
        let record = MapRecord::new(Content::Map, &info, Wrap::RepeatU);
        let back = MapRecord::from_json(&record.to_json()).unwrap();
        assert_eq!(back, record);
        assert!(record.to_json().is_ascii());
        assert_eq!(back.info(), info);
        let later = r#"{"version": 7, "content": "map", "aspect": -1, "mood": "good", "mesh": 3, "material": {"diffuse": "red"}}"#;
        let later = MapRecord::from_json(later).unwrap();
        assert_eq!((later.wrap, later.info().aspect), (Wrap::Repeat, 1.0));
        assert_eq!((&later.mesh, later.material), (&None, None));
        assert_eq!(MapRecord::from_json("[]"), None);
    }
}
