//! What is done to layers, each as one step of the history.

use super::{DEFAULT_MESH, Edit, Header, LayerHead, Studio};
use crate::error::{Error, Result};
use crate::import::textures::Textures;
use crate::paint::{Strokes, Tool};
use crate::recipe::{
    Channels, Image, Layer, Mask, MaskSource, Recipe, Source, rename_files, rename_mesh,
};

/// A name that no layer of a recipe has: `base`, or `base 2` and so on.
pub fn free_name(recipe: &Recipe, base: &str) -> String {
    let is_free = |name: &str| recipe.layers.iter().all(|l| l.name() != name);
    if is_free(base) {
        return base.to_owned();
    }
    // `strokes 2` gives `strokes 3`, not `strokes 2 2`.
    let stem = base
        .trim_end_matches(|c: char| c.is_ascii_digit())
        .trim_end();
    let stem = if stem.is_empty() { base } else { stem };
    (2..)
        .map(|n| format!("{stem} {n}"))
        .find(|name| is_free(name))
        .expect("there are fewer layers than numbers")
}

/// What the history calls a step: what was done, and to which layer.
pub(super) fn label(what: &str, layer: &str) -> String {
    let mut letters = what.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    format!("{}{}: {layer}", first.unwrap_or_default(), letters.as_str())
}

/// What changes of a layer's source have in common that are one step.
fn source_key(label: &str, at: usize) -> String {
    format!("{label} {at}")
}

impl Studio {
    /// Puts a layer above the selected one and selects it.
    ///
    /// # Errors
    /// When the recipe has as many layers as it may.
    pub fn add_layer(&mut self, mut layer: Layer) -> Result<()> {
        layer.name = free_name(self.recipe(), layer.name());
        let at = (self.selected() + 1).min(self.recipe().layers.len());
        let label = label("Add layer", layer.name());
        let layer = Box::new(layer);
        self.edit(&label, vec![Edit::InsertLayer { at, layer }], None)?;
        self.select(at);
        Ok(())
    }

    /// The same as the first of changes of the layer's source under `label`: all of them are one step until [`Studio::seal`].
    /// See [`Studio::set_source`].
    ///
    /// # Errors
    /// As [`Studio::add_layer`].
    pub fn add_growing_layer(&mut self, mut layer: Layer, label: &str) -> Result<()> {
        layer.name = free_name(self.recipe(), layer.name());
        let at = (self.selected() + 1).min(self.recipe().layers.len());
        let text = self::label(label, layer.name());
        let layer = Box::new(layer);
        let edits = vec![Edit::InsertLayer { at, layer }];
        self.edit(&text, edits, Some(&source_key(label, at)))?;
        self.select(at);
        Ok(())
    }

    /// Puts the layers of another recipe above the selected one, as one step, and selects the last. They look as they do there
    /// but for what is random; strokes stay on the mesh that they were painted on.
    ///
    /// # Errors
    /// When the recipe has as many layers as it may.
    pub fn add_layers_of(&mut self, label: &str, other: &Recipe) -> Result<()> {
        let first = (self.selected() + 1).min(self.recipe().layers.len());
        let mut names = self.recipe().clone();
        let mut edits = Vec::new();
        for (at, layer) in (first..).zip(&other.layers) {
            let mut layer = layer.clone();
            layer.seed_of = Some(layer.random_name().to_owned());
            layer.name = free_name(&names, layer.name());
            let strokes = layer.all_strokes_mut().filter(|s| s.need_mesh());
            strokes.for_each(|s| {
                s.mesh
                    .get_or_insert_with(|| other.mesh.clone().unwrap_or(DEFAULT_MESH.to_owned()));
            });
            names.layers.push(layer.clone());
            let layer = Box::new(layer);
            edits.push(Edit::InsertLayer { at, layer });
        }
        let last = first + edits.len();
        if edits.is_empty() {
            return Ok(());
        }
        self.edit(label, edits, None)?;
        self.select(last - 1);
        Ok(())
    }

    /// Puts an empty layer of strokes above the selected one.
    ///
    /// # Errors
    /// As [`Studio::add_layer`].
    pub fn add_paint_layer(&mut self) -> Result<()> {
        let mut layer = Layer::new(Source::Strokes(Strokes::default()));
        layer.name = "paint".to_owned();
        self.add_layer(layer)
    }

    /// Puts a copy of a layer above it.
    ///
    /// # Errors
    /// When there is no such layer, or no room for one more.
    pub fn duplicate_layer(&mut self, at: usize) -> Result<()> {
        let mut layer = self.layer(at)?.clone();
        let label = label("Duplicate layer", layer.name());
        // A layer's randomness follows its name: the copy looks as the original does.
        layer.seed_of = Some(layer.random_name().to_owned());
        layer.name = free_name(self.recipe(), layer.name());
        let layer = Box::new(layer);
        let at = at + 1;
        self.edit(&label, vec![Edit::InsertLayer { at, layer }], None)?;
        self.select(at);
        Ok(())
    }

    /// Takes a layer away.
    ///
    /// # Errors
    /// When there is no such layer.
    pub fn remove_layer(&mut self, at: usize) -> Result<()> {
        let label = label("Delete layer", self.layer(at)?.name());
        self.edit(&label, vec![Edit::RemoveLayer { at }], None)
    }

    /// Moves a layer to another place; what was selected stays selected.
    ///
    /// # Errors
    /// When there is no such layer or place.
    pub fn move_layer(&mut self, from: usize, to: usize) -> Result<()> {
        if from == to {
            return Ok(());
        }
        let label = label("Move layer", self.layer(from)?.name());
        self.edit(&label, vec![Edit::MoveLayer { from, to }], None)
    }

    /// Gives a layer another name.
    ///
    /// # Errors
    /// When there is no such layer, or another one has the name.
    pub fn rename_layer(&mut self, at: usize, name: &str) -> Result<()> {
        let layer = self.layer(at)?;
        if layer.name() == name {
            return Ok(());
        }
        let random = layer.random_name();
        let head = LayerHead {
            name: name.to_owned(),
            // It looks the same under any name.
            seed_of: (random != name).then(|| random.to_owned()),
            ..LayerHead::of(layer)
        };
        self.set_head(at, "Rename layer", head)
    }

    /// Changes what a layer has beside its source. Changes that follow each other with one label are one step until
    /// [`Studio::seal`].
    ///
    /// # Errors
    /// When there is no such layer, or a number is not allowed.
    pub fn set_head(&mut self, at: usize, label: &str, head: LayerHead) -> Result<()> {
        let layer = self.layer(at)?;
        if LayerHead::of(layer) == head {
            return Ok(());
        }
        let (label, key) = (self::label(label, layer.name()), format!("{label} {at}"));
        let head = Box::new(head);
        self.edit(&label, vec![Edit::SetHead { at, head }], Some(&key))
    }

    /// Changes a layer's source. Changes that follow each other with one label are one step until [`Studio::seal`].
    ///
    /// # Errors
    /// When there is no such layer, or a number is not allowed.
    pub fn set_source(&mut self, at: usize, label: &str, source: Source) -> Result<()> {
        let layer = self.layer(at)?;
        if layer.source == source {
            return Ok(());
        }
        let (text, key) = (self::label(label, layer.name()), source_key(label, at));
        // Where a layer touches what its source does by itself, it goes on to do so.
        let channels = if layer.channels == layer.source.channels() {
            source.channels()
        } else {
            layer.channels
        };
        let layer = Box::new(Layer {
            // A layer without a name of its own is named after its source.
            name: layer.name().to_owned(),
            channels,
            source,
            ..layer.clone()
        });
        self.edit(&text, vec![Edit::SetLayer { at, layer }], Some(&key))
    }

    /// Changes what the recipe has beside its layers.
    ///
    /// # Errors
    /// When a number or word is not allowed.
    pub fn set_header(&mut self, label: &str, header: Header) -> Result<()> {
        if Header::of(self.recipe()) == header {
            return Ok(());
        }
        let header = Box::new(header);
        self.edit(label, vec![Edit::SetHeader { header }], Some(label))
    }

    /// Shows the map on another mesh: a built-in's name, or a file by its path from the recipe. Strokes stay on the mesh that
    /// they were painted on.
    ///
    /// # Errors
    /// When the recipe may not name it.
    pub fn set_mesh(&mut self, mesh: &str) -> Result<()> {
        let recipe = self.recipe();
        if recipe.mesh.as_deref() == Some(mesh) {
            return Ok(());
        }
        let mut edits = Vec::new();
        for (at, layer) in recipe.layers.iter().enumerate() {
            let mut own = layer.clone();
            own.all_strokes_mut()
                .filter(|s| s.need_mesh() && s.mesh.is_none())
                .for_each(|s| s.mesh.clone_from(&recipe.mesh));
            if own != *layer {
                let layer = Box::new(own);
                edits.push(Edit::SetLayer { at, layer });
            }
        }
        let header = Box::new(Header {
            mesh: Some(mesh.to_owned()),
            ..Header::of(recipe)
        });
        edits.push(Edit::SetHeader { header });
        self.edit("Mesh", edits, None)
    }

    /// Puts another file in the place of one wherever the recipe names that, as one step: one that was moved, or lost.
    ///
    /// # Errors
    /// When the recipe may not name it.
    pub fn replace_file(&mut self, old: &str, new: &str) -> Result<()> {
        let rename = |name: &mut String| {
            if name == old {
                new.clone_into(name);
            }
        };
        let mut edits = Vec::new();
        for (at, layer) in self.recipe().layers.iter().enumerate() {
            if layer.files().contains(&old) {
                let mut layer = Box::new(layer.clone());
                rename_files(&mut layer, rename);
                edits.push(Edit::SetLayer { at, layer });
            }
        }
        let mut mesh = self.recipe().mesh.clone();
        rename_mesh(&mut mesh, rename);
        if mesh != self.recipe().mesh {
            let header = Box::new(Header {
                mesh,
                ..Header::of(self.recipe())
            });
            edits.push(Edit::SetHeader { header });
        }
        if edits.is_empty() {
            return Ok(());
        }
        self.edit(&format!("Find file: {new}"), edits, None)
    }

    /// Says anew what the numbers of a layer's textures mean, and which they are, as one step.
    ///
    /// # Errors
    /// When there is no such layer, or it is not of textures.
    pub fn set_textures(&mut self, at: usize, textures: Textures) -> Result<()> {
        let layer = self.layer(at)?;
        if !matches!(&layer.source, Source::Image(image) if image.textures.is_some()) {
            let allowed = "allowed: a layer of textures";
            return Err(Error::invalid(
                "the layer",
                format!("`{}`", layer.name()),
                allowed,
            ));
        }
        self.seal();
        self.set_source(at, "Convention", Source::Image(Image::of(textures)))?;
        self.seal();
        Ok(())
    }

    /// Gives a layer a mask to be painted on in the place of the one that it had, which shows it all or hides it all, and selects
    /// both.
    ///
    /// # Errors
    /// When there is no such layer.
    pub fn add_painted_mask(&mut self, at: usize, shows: bool) -> Result<()> {
        let mask = Mask {
            start: Some(if shows { 1.0 } else { 0.0 }),
            ..Mask::new(MaskSource::Strokes(Strokes::default()))
        };
        let head = LayerHead {
            mask: Some(mask),
            ..LayerHead::of(self.layer(at)?)
        };
        self.set_head(at, "Mask", head)?;
        self.seal();
        self.select(at);
        self.select_mask(true);
        Ok(())
    }

    /// Makes one layer of a layer and the one below it, where that looks just as both do: of two layers of strokes that show as they
    /// are, or of any layer and one of strokes that has none.
    ///
    /// # Errors
    /// When the result would look different, with what stands against it.
    pub fn merge_down(&mut self, at: usize) -> Result<()> {
        let upper = self.layer(at)?;
        let Some(below) = at.checked_sub(1) else {
            return Err(not_to_merge(
                upper,
                "the lowest",
                "a layer with one below it",
            ));
        };
        let lower = self.layer(below)?;
        let label = format!("Merge layer: {} into {}", upper.name(), lower.name());
        let edits = if has_nothing(upper) {
            vec![Edit::RemoveLayer { at }]
        } else if has_nothing(lower) {
            vec![Edit::RemoveLayer { at: below }]
        } else {
            let layer = Box::new(self.merged(lower, upper)?);
            vec![
                Edit::RemoveLayer { at },
                Edit::SetLayer { at: below, layer },
            ]
        };
        self.edit(&label, edits, None)?;
        self.select(below);
        Ok(())
    }

    /// Two layers of strokes as one.
    fn merged(&self, lower: &Layer, upper: &Layer) -> Result<Layer> {
        let (mut both, above) = (plain_strokes(lower)?.clone(), plain_strokes(upper)?.clone());
        if above.strokes.iter().any(|s| s.brush().tool == Tool::Erase) {
            let allowed =
                "a layer whose strokes do not erase: what they bring back lies in the layer below";
            return Err(not_to_merge(upper, "a layer that erases", allowed));
        }
        if above.need_mesh() {
            let own = |strokes: &Strokes| strokes.mesh.clone().or(self.recipe().mesh.clone());
            let (mine, other) = (own(&above), own(&both));
            if both.need_mesh() && mine != other {
                let name = |mesh: Option<String>| mesh.unwrap_or(DEFAULT_MESH.to_owned());
                let (mine, other) = (name(mine), name(other));
                let what = format!("on {mine}");
                let allowed = format!("a layer whose strokes lie on {other}, as those below do");
                return Err(not_to_merge(upper, &what, &allowed));
            }
            both.mesh = above.mesh;
        }
        both.strokes.extend(above.strokes);
        Ok(Layer {
            source: Source::Strokes(both),
            ..lower.clone()
        })
    }

    fn layer(&self, at: usize) -> Result<&Layer> {
        self.recipe().layers.get(at).ok_or_else(|| {
            let n = self.recipe().layers.len();
            Error::invalid(
                "the layer",
                at,
                format!("allowed: one of the {n} there are, counted from 0"),
            )
        })
    }
}

/// Whether a layer of strokes has none, so that it looks like nothing whatever its mask and opacity.
fn has_nothing(layer: &Layer) -> bool {
    matches!(&layer.source, Source::Strokes(strokes) if strokes.strokes.is_empty())
}

/// The strokes of a layer that shows them as they are; otherwise what stands against that.
fn plain_strokes(layer: &Layer) -> Result<&Strokes> {
    let refused = |value: String, allowed: &str| Err(not_to_merge(layer, &value, allowed));
    match &layer.source {
        Source::Strokes(_) if !layer.visible => {
            refused("hidden".to_owned(), "a layer that is shown")
        }
        Source::Strokes(_) if layer.opacity < 1.0 => {
            let opacity = format!("at {:.0} % opacity", 100.0 * layer.opacity);
            refused(opacity, "a layer at 100 %")
        }
        Source::Strokes(_) if layer.mask.is_some() => {
            refused("masked".to_owned(), "a layer without a mask")
        }
        Source::Strokes(_) if layer.channels != Channels::ALL => {
            let allowed = "a layer that touches both widths and the direction";
            refused("not on all channels".to_owned(), allowed)
        }
        Source::Strokes(strokes) => Ok(strokes),
        other => refused(format!("a layer of {}", other.name()), "a layer of strokes"),
    }
}

/// Why a layer cannot be merged.
fn not_to_merge(layer: &Layer, is: &str, allowed: &str) -> Error {
    let what = format!("the layer `{}`, to be merged,", layer.name());
    Error::invalid(what, is, format!("allowed: {allowed}"))
        .with_hint("Anything else would not look the same afterwards")
}
