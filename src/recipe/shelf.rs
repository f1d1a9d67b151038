//! What layers share, and what outlives a change of the recipe: meshes, maps as they lie on them, pictures as they were read.
//!
//! Files are known by their names and their stamps: one that another program wrote anew is read anew.

use super::{Files, Image, Layer, Recipe, Source, Stamp};
use crate::error::Result;
use crate::filter::reduce;
use crate::map::{AnisoMap, Mended, Size, Wrap};
use crate::mesh::Body;
use crate::paint::Skin;
use crate::pattern::Surface;
use std::sync::Arc;

/// Sizes of map that a mesh is kept prepared for: that of the map and that of its draft.
const SKINS_A_BODY: usize = 2;

/// Shared by all layers. Cloning copies references only.
#[derive(Clone, Default)]
pub(super) struct Shelf {
    shapes: Vec<Shape>,
    /// Those used last at the end.
    skins: Vec<Arc<Skin>>,
    pictures: Vec<Picture>,
}

/// A mesh by the word of a recipe for it, as its file was.
#[derive(Clone)]
struct Shape {
    word: String,
    stamp: Option<Stamp>,
    body: Arc<Body>,
}

/// A finished map as its files were.
#[derive(Clone)]
struct Picture {
    image: Image,
    wrap: Wrap,
    stamps: Vec<Option<Stamp>>,
    /// The size that it was reduced to where it was larger; `None` for one as it was read.
    reduced: Option<Size>,
    read: Arc<Read>,
}

/// A finished map, read.
pub(super) struct Read {
    pub(super) map: AnisoMap,
    /// What reading the files had to change.
    pub(super) mended: Mended,
}

impl Shelf {
    /// The mesh of a word, if it is there as its file was with that stamp.
    pub(super) fn known(&self, word: &str, stamp: Option<Stamp>) -> Option<&Arc<Body>> {
        let shape = self.shapes.iter().find(|s| s.word == word);
        shape.filter(|s| s.stamp == stamp).map(|s| &s.body)
    }

    /// The mesh of a word, whatever became of its file.
    pub(super) fn any(&self, word: &str) -> Option<&Arc<Body>> {
        let shape = self.shapes.iter().find(|s| s.word == word);
        shape.map(|s| &s.body)
    }

    /// Keeps a mesh that was read already.
    pub(super) fn keep(&mut self, word: &str, stamp: Option<Stamp>, body: &Arc<Body>) {
        self.shapes.retain(|s| s.word != word);
        self.shapes.push(Shape {
            word: word.to_owned(),
            stamp,
            body: Arc::clone(body),
        });
    }

    fn body(&mut self, key: &str, word: &str, files: &Files) -> Result<Arc<Body>> {
        let stamp = files.stamp_of_mesh(word);
        if let Some(body) = self.known(word, stamp) {
            return Ok(Arc::clone(body));
        }
        let body = Arc::new(Body::new(Arc::new(files.mesh(key, word)?))?);
        self.keep(word, stamp, &body);
        Ok(body)
    }

    /// A mesh as a map of a surface lies on it.
    pub(super) fn skin(
        &mut self,
        key: &str,
        word: &str,
        surface: &Surface,
        files: &Files,
    ) -> Result<Arc<Skin>> {
        let body = self.body(key, word, files)?;
        let found = self.skins.iter().position(|s| s.is_of(&body, surface));
        let skin = match found {
            Some(at) => self.skins.remove(at),
            None => Arc::new(Skin::new(body, surface)),
        };
        self.skins.push(Arc::clone(&skin));
        Ok(skin)
    }

    /// A finished map that is to be laid over maps of at most `most` texels a side, read where it is not there as its files are.
    pub(super) fn picture(
        &mut self,
        key: &str,
        image: &Image,
        (wrap, most): (Wrap, Size),
        files: &Files,
    ) -> Result<Arc<Read>> {
        let stamps: Vec<_> = image.files().map(|name| files.stamp(name)).collect();
        let found = self.pictures.iter().find(|p| {
            // One that was reduced for a larger map would be reduced twice.
            let serves = p.reduced.is_none_or(|size| size == most);
            serves && p.wrap == wrap && p.stamps == stamps && p.image == *image
        });
        if let Some(picture) = found {
            return Ok(Arc::clone(&picture.read));
        }
        let (map, mended) = image.read(key, wrap, files)?;
        let kept = within(map.size(), most)?;
        let reduced = (kept != map.size()).then_some(most);
        let map = match reduced {
            Some(_) => reduce(&map, kept)?,
            None => map,
        };
        let read = Arc::new(Read { map, mended });
        self.pictures.retain(|p| p.image != *image);
        self.pictures.push(Picture {
            image: image.clone(),
            wrap,
            stamps,
            reduced,
            read: Arc::clone(&read),
        });
        Ok(read)
    }

    /// Lets go of what a recipe has no use for.
    pub(super) fn tidy(&mut self, recipe: &Recipe) {
        let strokes = recipe.layers.iter().flat_map(Layer::all_strokes);
        let words: Vec<&String> = strokes.filter_map(|s| s.mesh.as_ref()).collect();
        self.shapes
            .retain(|s| recipe.mesh.as_ref() == Some(&s.word) || words.contains(&&s.word));
        let mut kept: Vec<Arc<Skin>> = Vec::new();
        for skin in self.skins.drain(..).rev() {
            let body = skin.body();
            let is_used = self.shapes.iter().any(|s| Arc::ptr_eq(&s.body, body));
            let others = kept.iter().filter(|s| Arc::ptr_eq(s.body(), body)).count();
            if is_used && others < SKINS_A_BODY {
                kept.push(skin);
            }
        }
        kept.reverse();
        self.skins = kept;
        let is_image =
            |l: &Layer, image: &Image| matches!(&l.source, Source::Image(i) if i == image);
        self.pictures
            .retain(|p| recipe.layers.iter().any(|l| is_image(l, &p.image)));
    }
}

/// A size that is nowhere larger than another.
pub(super) fn within(size: Size, most: Size) -> Result<Size> {
    Size::new(
        size.width().min(most.width()),
        size.height().min(most.height()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_read_once_for_every_size_that_it_serves() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.png");
        let number = |x: u32, y: u32| ((x * 71 + y * y * 37) % 101) as u8 + 20;
        image::GrayImage::from_fn(16, 16, |x, y| image::Luma([number(x, y)]))
            .save(&path)
            .unwrap();
        let files = Files {
            folder: Some(folder.path().to_owned()),
            allow_outside: false,
        };
        let textures = "first.file = 'r.png'".parse::<toml::Table>().unwrap();
        let image = Image::of(textures.try_into().unwrap());
        let mut shelf = Shelf::default();
        let size = |n: u32| Size::new(n, n).unwrap();
        let mut read = |n: u32| {
            let size = (Wrap::Clamp, size(n));
            shelf.picture("image", &image, size, &files).unwrap()
        };
        let first = read(8);
        assert_eq!(first.map.size(), size(8));
        assert!(Arc::ptr_eq(&first, &read(8)), "what is there serves");
        // Reduced twice it would be another map than the one that files are made of.
        let alone = (Wrap::Clamp, size(4));
        let alone = Shelf::default().picture("image", &image, alone, &files);
        assert!(read(4).map == alone.unwrap().map);
        let whole = read(32);
        assert_eq!(whole.map.size(), size(16));
        assert!(Arc::ptr_eq(&whole, &read(8)) && Arc::ptr_eq(&whole, &read(64)));
        image::GrayImage::from_pixel(16, 16, image::Luma([200]))
            .save(&path)
            .unwrap();
        std::fs::File::options()
            .write(true)
            .open(&path)
            .and_then(|f| f.set_modified(std::time::SystemTime::UNIX_EPOCH))
            .unwrap();
        let anew = read(64);
        assert!(anew.map != whole.map);
    }
}
