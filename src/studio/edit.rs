//! One change of a recipe: applied, it gives the change that takes it back. What the history keeps and the journal writes.

use crate::error::{Error, Result};
use crate::map::{Size, Wrap};
use crate::paint::{Brush, STROKES_MAX, Stroke, Strokes};
use crate::recipe::{
    Adjust, Blend, Channels, Layer, Mask, MaskSource, Material, Recipe, Scene, Target, Way,
    file_of_mesh,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// One change of a recipe. Layers are named by their place, the lowest being 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edit {
    /// A stroke on top of those of a layer of strokes, or of a painted mask.
    AddStroke {
        /// The layer.
        layer: usize,
        /// Whether it is one of the layer's mask.
        #[serde(default, skip_serializing_if = "is_not")]
        mask: bool,
        /// The stroke.
        #[serde(with = "alone")]
        stroke: Arc<Stroke>,
    },
    /// The last stroke of a layer of strokes, or of a painted mask, goes.
    RemoveStroke {
        /// The layer.
        layer: usize,
        /// Whether it is one of the layer's mask.
        #[serde(default, skip_serializing_if = "is_not")]
        mask: bool,
    },
    /// A layer is put in.
    InsertLayer {
        /// Its place afterwards.
        at: usize,
        /// The layer.
        layer: Box<Layer>,
    },
    /// A layer goes.
    RemoveLayer {
        /// Its place.
        at: usize,
    },
    /// A layer is moved.
    MoveLayer {
        /// Its place before.
        from: usize,
        /// Its place afterwards.
        to: usize,
    },
    /// A layer takes another one's place.
    SetLayer {
        /// The place.
        at: usize,
        /// The new layer.
        layer: Box<Layer>,
    },
    /// What a layer has beside its source.
    SetHead {
        /// The layer.
        at: usize,
        /// All of it.
        head: Box<LayerHead>,
    },
    /// What a recipe has beside its layers.
    SetHeader {
        /// All of it.
        header: Box<Header>,
    },
    /// Everything, as when a file was changed by another program.
    SetRecipe {
        /// The new recipe.
        recipe: Box<Recipe>,
    },
}

/// What a layer has beside its source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerHead {
    /// As [`Layer::name`](struct@Layer); empty for the source's own.
    pub name: String,
    /// Whether it takes part.
    pub visible: bool,
    /// 0 to 1.
    pub opacity: f32,
    /// How it goes over what lies below.
    pub blend: Blend,
    /// What it touches.
    pub channels: Channels,
    /// Its own seed.
    pub seed: Option<u64>,
    /// The name that its randomness follows.
    pub seed_of: Option<String>,
    /// Where it shows.
    pub mask: Option<Mask>,
}

impl LayerHead {
    /// That of a layer.
    pub fn of(layer: &Layer) -> Self {
        Self {
            name: layer.name.clone(),
            visible: layer.visible,
            opacity: layer.opacity,
            blend: layer.blend,
            channels: layer.channels,
            seed: layer.seed,
            seed_of: layer.seed_of.clone(),
            mask: layer.mask.clone(),
        }
    }

    /// Changes places with a layer's.
    fn exchange(&mut self, layer: &mut Layer) {
        std::mem::swap(&mut self.name, &mut layer.name);
        std::mem::swap(&mut self.visible, &mut layer.visible);
        std::mem::swap(&mut self.opacity, &mut layer.opacity);
        std::mem::swap(&mut self.blend, &mut layer.blend);
        std::mem::swap(&mut self.channels, &mut layer.channels);
        std::mem::swap(&mut self.seed, &mut layer.seed);
        std::mem::swap(&mut self.seed_of, &mut layer.seed_of);
        std::mem::swap(&mut self.mask, &mut layer.mask);
    }
}

/// What a recipe has beside its layers: a recipe without any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// See [`Recipe::name`].
    pub name: String,
    /// See [`Recipe::description`].
    pub description: String,
    /// Width and height of the map in texels.
    pub size: [u32; 2],
    /// See [`Recipe::aspect`].
    pub aspect: Option<f32>,
    /// See [`Recipe::wrap`].
    pub wrap: Wrap,
    /// See [`Recipe::seed`].
    pub seed: u64,
    /// See [`Recipe::mesh`].
    pub mesh: Option<String>,
    /// See [`Recipe::targets`].
    pub targets: Vec<Target>,
    /// See [`Recipe::material`].
    pub material: Material,
    /// See [`Recipe::adjust`].
    pub adjust: Adjust,
    /// See [`Recipe::scene`].
    pub scene: Scene,
}

impl Header {
    /// That of a recipe.
    pub fn of(recipe: &Recipe) -> Self {
        Self {
            name: recipe.name.clone(),
            description: recipe.description.clone(),
            size: [recipe.size.width(), recipe.size.height()],
            aspect: recipe.aspect,
            wrap: recipe.wrap,
            seed: recipe.seed,
            mesh: recipe.mesh.clone(),
            targets: recipe.targets.clone(),
            material: recipe.material,
            adjust: recipe.adjust,
            scene: recipe.scene.clone(),
        }
    }

    fn put_into(self, recipe: &mut Recipe) -> Result<()> {
        recipe.size = Size::new(self.size[0], self.size[1])?;
        recipe.name = self.name;
        recipe.description = self.description;
        recipe.aspect = self.aspect;
        recipe.wrap = self.wrap;
        recipe.seed = self.seed;
        recipe.mesh = self.mesh;
        recipe.targets = self.targets;
        recipe.material = self.material;
        recipe.adjust = self.adjust;
        recipe.scene = self.scene;
        Ok(())
    }

    /// Whether a map made with one is that made with the other.
    fn makes_the_same_map(&self, other: &Self) -> bool {
        self.size == other.size
            && self.aspect == other.aspect
            && self.wrap == other.wrap
            && self.seed == other.seed
            && self.adjust == other.adjust
    }

    /// Whether mesh, colours and lights are the same.
    fn makes_the_same_scene(&self, other: &Self) -> bool {
        self.mesh == other.mesh && self.material == other.material && self.scene == other.scene
    }
}

/// What has to be worked out anew after an edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Touched {
    /// Names and the like.
    Nothing,
    /// Mesh, colours, lights: the map stands.
    Scene,
    /// The strokes of one layer, or of its mask where that is said, which keep a canvas of their own.
    Strokes(usize, bool),
    /// The map.
    Map,
    /// The map, and mesh, colours or lights as well.
    All,
}

impl Edit {
    /// Applies it to a recipe and gives what takes it back.
    ///
    /// # Errors
    /// [`Error::Invalid`] when there is no such layer, or the recipe would not check afterwards. It is then as before.
    pub fn apply(self, recipe: &mut Recipe) -> Result<(Self, Touched)> {
        let of_strokes = matches!(self, Self::AddStroke { .. } | Self::RemoveStroke { .. });
        let (back, touched) = self.put(recipe)?;
        // A stroke was checked when it was made, and one more breaks no other.
        if !of_strokes && let Err(error) = recipe.check() {
            back.put(recipe).expect("what was there checks");
            return Err(error);
        }
        Ok((back, touched))
    }

    fn put(self, recipe: &mut Recipe) -> Result<(Self, Touched)> {
        let layers = recipe.layers.len();
        let within = |at: usize, end: usize| {
            if at < end {
                return Ok(at);
            }
            let allowed = format!("allowed: one of the {end} there are, counted from 0");
            Err(Error::invalid("the layer", at, allowed))
        };
        Ok(match self {
            Self::AddStroke {
                layer,
                mask,
                stroke,
            } => {
                let strokes = strokes_of(recipe, within(layer, layers)?, mask)?;
                if strokes.strokes.len() == STROKES_MAX {
                    let allowed = format!("allowed: at most {STROKES_MAX} in a layer");
                    return Err(
                        Error::invalid("the number of strokes", STROKES_MAX + 1, allowed)
                            .with_hint("Paint on a new layer"),
                    );
                }
                strokes.strokes.push(stroke);
                (
                    Self::RemoveStroke { layer, mask },
                    Touched::Strokes(layer, mask),
                )
            }
            Self::RemoveStroke { layer, mask } => {
                let strokes = strokes_of(recipe, within(layer, layers)?, mask)?;
                let stroke = strokes.strokes.pop();
                let stroke = stroke.ok_or_else(|| {
                    Error::invalid(
                        "the number of strokes",
                        0,
                        "allowed: at least one to take away",
                    )
                })?;
                let touched = Touched::Strokes(layer, mask);
                (
                    Self::AddStroke {
                        layer,
                        mask,
                        stroke,
                    },
                    touched,
                )
            }
            Self::InsertLayer { at, layer } => {
                recipe.layers.insert(within(at, layers + 1)?, *layer);
                (Self::RemoveLayer { at }, Touched::Map)
            }
            Self::RemoveLayer { at } => {
                let layer = Box::new(recipe.layers.remove(within(at, layers)?));
                (Self::InsertLayer { at, layer }, Touched::Map)
            }
            Self::MoveLayer { from, to } => {
                within(to, layers)?;
                let layer = recipe.layers.remove(within(from, layers)?);
                recipe.layers.insert(to, layer);
                (Self::MoveLayer { from: to, to: from }, Touched::Map)
            }
            Self::SetLayer { at, mut layer } => {
                std::mem::swap(&mut *layer, &mut recipe.layers[within(at, layers)?]);
                (Self::SetLayer { at, layer }, Touched::Map)
            }
            Self::SetHead { at, mut head } => {
                let layer = &mut recipe.layers[within(at, layers)?];
                let random = layer.random_name().to_owned();
                head.exchange(layer);
                let renamed = LayerHead {
                    name: layer.name.clone(),
                    seed_of: layer.seed_of.clone(),
                    ..(*head).clone()
                };
                let touched = if renamed == LayerHead::of(layer) && layer.random_name() == random {
                    Touched::Nothing
                } else {
                    Touched::Map
                };
                (Self::SetHead { at, head }, touched)
            }
            Self::SetHeader { header } => {
                let before = Header::of(recipe);
                let touched = if header.makes_the_same_map(&before) {
                    Touched::Scene
                } else if header.makes_the_same_scene(&before) {
                    Touched::Map
                } else {
                    Touched::All
                };
                header.put_into(recipe)?;
                let header = Box::new(before);
                (Self::SetHeader { header }, touched)
            }
            Self::SetRecipe { recipe: mut other } => {
                std::mem::swap(&mut *other, recipe);
                (Self::SetRecipe { recipe: other }, Touched::All)
            }
        })
    }

    /// The place afterwards of the layer that was at `place`; `None` when it goes.
    pub fn place_after(&self, place: usize) -> Option<usize> {
        match *self {
            Self::InsertLayer { at, .. } if place >= at => Some(place + 1),
            Self::RemoveLayer { at } if place == at => None,
            Self::RemoveLayer { at } if place > at => Some(place - 1),
            Self::MoveLayer { from, to } => Some(match place {
                p if p == from => to,
                p if from < p && p <= to => p - 1,
                p if to <= p && p < from => p + 1,
                p => p,
            }),
            Self::SetRecipe { .. } => None,
            _ => Some(place),
        }
    }

    /// Lets a stroke share the brush of the one before it, which it was written beside, where both are equal.
    pub(super) fn share_brush(&mut self, last: &mut Option<Arc<Brush>>) {
        if let Self::AddStroke { stroke, .. } = self {
            if let (Some(last), Some(stroke)) = (&*last, Arc::get_mut(stroke)) {
                stroke.share_brush(last);
            }
            *last = Some(stroke.brush().clone());
        }
    }

    /// Renames the files that it names, after the recipe went to another folder.
    pub(super) fn follow(&mut self, way: &Way) {
        match self {
            Self::InsertLayer { layer, .. } | Self::SetLayer { layer, .. } => way.of_layer(layer),
            Self::SetHead { head, .. } => head.mask.iter_mut().for_each(|mask| way.of_mask(mask)),
            Self::SetHeader { header } => way.of_mesh(&mut header.mesh),
            Self::SetRecipe { recipe } => way.of_recipe(recipe),
            // These name no files.
            Self::AddStroke { .. }
            | Self::RemoveStroke { .. }
            | Self::RemoveLayer { .. }
            | Self::MoveLayer { .. } => {}
        }
    }

    /// The files that it names.
    pub(super) fn files(&self) -> Vec<&str> {
        match self {
            Self::InsertLayer { layer, .. } | Self::SetLayer { layer, .. } => layer.files(),
            Self::SetHeader { header } => {
                header.mesh.iter().filter_map(|m| file_of_mesh(m)).collect()
            }
            Self::SetRecipe { recipe } => recipe.files().collect(),
            _ => vec![],
        }
    }

    /// Gives the recipe its new name wherever it has the old one.
    pub(super) fn rename(&mut self, old: &str, new: &str) {
        let name = match self {
            Self::SetHeader { header } => &mut header.name,
            Self::SetRecipe { recipe } => &mut recipe.name,
            _ => return,
        };
        if name == old {
            new.clone_into(name);
        }
    }

    /// About how many bytes it holds.
    pub fn bytes(&self) -> usize {
        let of_strokes =
            |strokes: &Strokes| strokes.strokes.iter().map(|s| bytes_of(s)).sum::<usize>();
        let of_layer = |layer: &Layer| {
            let all = [layer.strokes(false), layer.strokes(true)];
            1024 + all.into_iter().flatten().map(of_strokes).sum::<usize>()
        };
        match self {
            Self::AddStroke { stroke, .. } => bytes_of(stroke),
            Self::InsertLayer { layer, .. } | Self::SetLayer { layer, .. } => of_layer(layer),
            Self::SetHead { head, .. } => match head.mask.as_ref().map(|m| &m.source) {
                Some(MaskSource::Strokes(strokes)) => 512 + of_strokes(strokes),
                _ => 512,
            },
            Self::SetRecipe { recipe } => recipe.layers.iter().map(of_layer).sum::<usize>() + 1024,
            _ => 512,
        }
    }
}

/// About how many bytes a stroke takes.
fn bytes_of(stroke: &Stroke) -> usize {
    64 + 24 * stroke.points().len()
}

/// A stroke by itself, written as a recipe writes many.
mod alone {
    use super::{Arc, Stroke, Strokes};
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

    pub(super) fn serialize<S: Serializer>(stroke: &Arc<Stroke>, to: S) -> Result<S::Ok, S::Error> {
        let strokes = vec![stroke.clone()];
        let alone = Strokes {
            strokes,
            mesh: None,
        };
        alone.serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Stroke>, D::Error> {
        let mut strokes = Strokes::deserialize(from)?.strokes;
        match (strokes.pop(), strokes.is_empty()) {
            (Some(stroke), true) => Ok(stroke),
            _ => Err(D::Error::custom("not one stroke")),
        }
    }
}

/// The strokes of a layer, or of its mask.
fn strokes_of(recipe: &mut Recipe, at: usize, mask: bool) -> Result<&mut Strokes> {
    let layer = &mut recipe.layers[at];
    let of_mask = layer.mask.as_ref().map_or("no mask", |m| m.source.name());
    let (what, allowed) = match mask {
        false => (layer.source.name(), "allowed: a layer of `strokes`"),
        true => (of_mask, "allowed: a layer with a mask of `strokes`"),
    };
    let error = Error::invalid("the layer to paint on", format!("one of `{what}`"), allowed);
    layer.strokes_mut(mask).ok_or(error)
}

/// Whether it is not; for what is not written.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_not(it: &bool) -> bool {
    !it
}
