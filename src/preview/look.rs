//! What a picture is lit with: a model, and whether it reads the map texel by texel.

use crate::brdf::Model;
use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// A model, with the map or with the map's mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Look {
    /// The reflection model.
    pub model: Model,
    /// One lobe for the whole surface instead of the map.
    ///
    /// It lies on the mesh's own tangent and has the map's mean slope variance along it and across it (the diagonal of
    /// the mean covariance). This is the surface without a map that comes nearest: a constant map brushed along u or v
    /// looks the same with and without it, and a map whose directions take every turn becomes isotropic. Averaging
    /// alpha_x and alpha_y over texels of different directions would instead give an anisotropy that the surface as a
    /// whole does not have.
    pub mean: bool,
}

impl Look {
    /// The words of `--model`, separated by commas: `phong:mean,ward:mean,ward`.
    ///
    /// # Errors
    /// When a word is no model; names the nearest one.
    pub fn list(words: &str) -> Result<Vec<Self>> {
        words.split(',').map(|w| w.trim().parse()).collect()
    }

    /// What stands under its picture: `Phong`, `Ward`, `Ward + map`.
    pub fn caption(&self) -> String {
        let name = match self.model {
            Model::Ward => "Ward",
            Model::WardExact => "Ward, exact",
            Model::WardDuer => "Ward\u{2013}D\u{fc}r",
            Model::WardBounded => "Bounded Ward",
            Model::Beckmann => "Beckmann",
            Model::Ggx => "GGX",
            Model::Phong => "Phong",
            Model::BlinnPhong => "Blinn\u{2013}Phong",
            Model::Lambert => "Lambert",
        };
        if self.mean || self.model == Model::Lambert {
            name.to_owned()
        } else {
            format!("{name} + map")
        }
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.model, if self.mean { ":mean" } else { "" })
    }
}

impl FromStr for Look {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let (model, mean) = match word.split_once(':') {
            None if !word.contains(char::is_whitespace) => (word, false),
            Some((model, "mean")) if !model.is_empty() => (model, true),
            _ => return Err(misspelt(word)),
        };
        Ok(Self {
            model: model.parse()?,
            mean,
        })
    }
}

/// What is said of a word that is neither a model nor a model with `:mean`.
fn misspelt(word: &str) -> Error {
    let model = word
        .split([':', ' '])
        .find_map(|part| part.parse::<Model>().ok());
    let hint = match model {
        Some(model) => format!("Did you mean `{model}:mean`?"),
        None => "For example `ward:mean`".to_owned(),
    };
    let allowed = "allowed: a model, alone or followed by `:mean` for the map's mean";
    Error::invalid("model", format!("`{word}`"), allowed).with_hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_become_looks_and_back() {
        let looks = Look::list("phong:mean, ward:mean,ward").unwrap();
        let captions: Vec<_> = looks.iter().map(Look::caption).collect();
        assert_eq!(captions, ["Phong", "Ward", "Ward + map"]);
        for model in Model::ALL {
            for mean in [false, true] {
                let look = Look { model, mean };
                assert_eq!(look.to_string().parse::<Look>().unwrap(), look);
            }
        }
    }

    #[test]
    fn a_wrong_word_is_told_the_nearest_and_the_allowed_ones() {
        let e = Look::list("ward,phnog:mean").unwrap_err().to_string();
        assert!(e.contains("`phong`") && e.contains("blinn-phong"), "{e}");
        for (word, hint) in [
            ("ggx:man", "Did you mean `ggx:mean`?"),
            ("ggx mean", "Did you mean `ggx:mean`?"),
            (":mean", "For example `ward:mean`"),
        ] {
            let e = word.parse::<Look>().unwrap_err().to_string();
            assert!(e.contains(&format!("`{word}`")) && e.ends_with(hint), "{e}");
        }
        assert!("".parse::<Look>().is_err());
    }
}
