//! What a command works on: a recipe with its overrides, or a map from a file.

use super::args::RecipeArgs;
use super::{Result, console};
use anisomap::Error;
use anisomap::convention::MapInfo;
use anisomap::generate::{MESH, fill, info, open_mesh};
use anisomap::import;
use anisomap::map::{AnisoMap, Mended, Size};
use anisomap::mesh::{self, Mesh};
use anisomap::recipe::{self, Files, Material, RecipeFile};
use std::path::{Path, PathBuf};

/// A recipe with everything the user overrides in it.
pub(super) fn recipe(word: &str, args: &RecipeArgs, size: Option<Size>) -> Result<RecipeFile> {
    let mut file = recipe::open(word)?;
    for key in file.ignored() {
        let path = file.path().display();
        console::complain(&format!(
            "note: {path} is newer than this program, which ignores its key {key}"
        ));
    }
    let mut overrides = args.set.clone();
    if let Some(size) = size {
        let value = format!("[{}, {}]", size.width(), size.height());
        overrides.push(("size".to_owned(), value));
    }
    if let Some(seed) = args.seed {
        overrides.push(("seed".to_owned(), seed.to_string()));
    }
    file.set(&overrides)?;
    Ok(file)
}

/// A note that texels of a file were mended, where any were.
pub(super) fn mended_note(mended: Mended) -> Option<String> {
    (mended.faults() > 0).then(|| {
        format!(
            "note: texels were mended: {} not finite, {} with a width out of range, {} without a direction; inspect tells more",
            mended.non_finite, mended.out_of_range, mended.no_direction
        )
    })
}

/// A map and where it came from.
pub(super) struct Source {
    pub(super) map: AnisoMap,
    pub(super) mended: Mended,
    pub(super) info: MapInfo,
    /// The recipe and its files, where the input is one.
    pub(super) recipe: Option<(RecipeFile, Files)>,
    /// The file and what it may name, where the input is a finished map.
    place: Option<(PathBuf, Files)>,
}

impl Source {
    /// The mesh of the recipe; of a glTF its own; of another map the one it was made for. A map shows itself on any mesh, so
    /// one that is missing or refused is told and replaced.
    pub(super) fn mesh(&self) -> Result<Mesh> {
        if let Some((file, files)) = &self.recipe {
            return open_mesh(None, file, files);
        }
        let Some((path, files)) = &self.place else {
            return mesh::open(MESH);
        };
        let is_exr = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let own = match &self.info.mesh {
            _ if !is_exr => mesh::load(path),
            Some(word) => files.mesh("mesh", word),
            None => mesh::open(MESH),
        };
        own.or_else(|error| {
            console::complain(&format!("note: drawn on a {MESH}: {error}"));
            mesh::open(MESH)
        })
    }

    /// The colours of the recipe, or those that the map was made with; stock ones where neither is known.
    pub(super) fn material(&self) -> Material {
        self.known_material().unwrap_or_default()
    }

    /// The colours of the recipe, or those that the map was made with.
    pub(super) fn known_material(&self) -> Option<Material> {
        let recorded = self.info.material.map(|r| Material {
            diffuse: r.diffuse,
            specular: r.specular,
            ambient: r.ambient,
        });
        let recorded = recorded.filter(|m| m.check().is_ok());
        let own = self.recipe.as_ref().map(|(file, _)| file.recipe().material);
        own.or(recorded)
    }
}

/// A map by its file, or the map of a recipe.
pub(super) fn source(word: &str, args: &RecipeArgs, size: Option<Size>) -> Result<Source> {
    let path = Path::new(word);
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let imported = match extension.as_deref() {
        Some("exr") => import::exr::read_master(path)?,
        Some("glb" | "gltf") => import::gltf::read_gltf(path)?,
        Some(other) if other != "toml" && path.is_file() => {
            return Err(
                Error::file(path, "it is no recipe and no map by its name").with_hint(
                    "Recipes are read from .toml files, maps from .exr, .glb and .gltf files",
                ),
            );
        }
        _ => {
            let file = recipe(word, args, size)?;
            let files = file.files(args.allow_outside);
            let (map, mended) = fill(&file, &files, &console::Bars)?;
            return Ok(Source {
                map,
                mended,
                info: info(file.recipe(), None),
                recipe: Some((file, files)),
                place: None,
            });
        }
    };
    refuse_overrides(args, size)?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let files = Files {
        folder: Some(folder.unwrap_or(Path::new(".")).to_owned()),
        allow_outside: args.allow_outside,
    };
    Ok(Source {
        map: imported.map,
        mended: imported.mended,
        info: imported.info,
        recipe: None,
        place: Some((path.to_owned(), files)),
    })
}

/// An option that has no effect would mislead.
fn refuse_overrides(args: &RecipeArgs, size: Option<Size>) -> Result<()> {
    let given = [
        ("--set", !args.set.is_empty()),
        ("--seed", args.seed.is_some()),
        ("the map's size", size.is_some()),
    ];
    match given.into_iter().find(|(_, is)| *is) {
        Some((name, _)) => Err(Error::invalid(
            name,
            "given with a finished map",
            "allowed: only with a recipe or preset",
        )),
        None => Ok(()),
    }
}
