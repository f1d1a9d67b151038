//! Meshes and maps that come into a document: read, checked and laid beside the recipe by a thread of its own, because a mesh
//! of millions of triangles takes its time. The recipe names files of its own folder alone.

use super::messages::count;
use super::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::export::exr::{Precision, write_master};
use anisomap::export::{Export, write_atomic};
use anisomap::import::Imported;
use anisomap::import::exr::{read_master, read_rgb_pair};
use anisomap::import::gltf::read_gltf;
use anisomap::mesh;
use anisomap::studio::apart;
use eframe::egui::Context;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Meshes with more triangles than this are told: the first stroke on them takes a while.
const MANY: usize = 2_000_000;

/// What a file is wanted as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// A layer of the map.
    Map,
    /// What the map is shown on.
    Mesh,
}

/// A file that lies beside the recipe now.
#[derive(Debug)]
pub(crate) struct Taken {
    pub(crate) part: Part,
    /// What the recipe calls it.
    pub(crate) file: String,
    /// What there is to say of it.
    pub(crate) news: Option<String>,
}

/// A file on its way.
pub(crate) struct Intake {
    pub(crate) path: PathBuf,
    work: Work<Result<Taken, Error>>,
}

impl Intake {
    /// Begins to take a file into the folder of a recipe.
    pub(crate) fn begin(
        part: Part,
        path: &Path,
        folder: &Path,
        ctx: &Context,
    ) -> Result<Self, Error> {
        let (from, folder) = (path.to_owned(), folder.to_owned());
        let body = move |reins: &Reins, give: &dyn Fn(Result<Taken, Error>) -> bool| {
            let taken = apart(|| take(part, &from, &folder));
            if reins.go_on() {
                give(taken);
            }
        };
        Ok(Self {
            path: path.to_owned(),
            work: Work::begin("intake", ctx, body)?,
        })
    }

    /// The file once it is there, or why it is not; `None` while it is on its way.
    pub(crate) fn now(&self) -> Option<Result<Taken, Error>> {
        match self.work.now() {
            Now::Going => None,
            Now::Came(taken) => Some(taken),
            Now::Over => Some(Err(Error::file(&self.path, "reading it ended too early"))),
        }
    }
}

/// What a file may be taken for by its name.
pub(crate) fn part_of(path: &Path) -> Option<Part> {
    match ending(path).as_str() {
        "exr" => Some(Part::Map),
        "glb" | "gltf" | "obj" => Some(Part::Mesh),
        _ => None,
    }
}

/// Why a file that is no recipe, map or mesh by its name is not taken.
pub(crate) fn unknown(path: &Path) -> Error {
    let error = Error::file(path, "it is no recipe, map or mesh by its name");
    match ending(path).as_str() {
        "png" | "jpg" | "jpeg" | "tga" | "tif" | "tiff" | "bmp" | "webp" => error.with_hint(
            "A picture does not say what its numbers mean. Maps are read from a master EXR, from the pair _alpha.exr and \
             _direction.exr, and from glTF with KHR_materials_anisotropy",
        ),
        _ => error.with_hint(
            "Recipes end in .toml, maps in .exr, .glb or .gltf, meshes in .glb, .gltf or .obj",
        ),
    }
}

fn ending(path: &Path) -> String {
    path.extension()
        .map_or(String::new(), |e| e.to_string_lossy().to_lowercase())
}

fn take(part: Part, path: &Path, folder: &Path) -> Result<Taken, Error> {
    let about = std::fs::metadata(path).map_err(Error::read(path))?;
    if about.is_file() && about.len() == 0 {
        return Err(Error::file(path, "the file is empty").with_hint("Copy or export it once more"));
    }
    let (file, news) = match part {
        Part::Mesh => take_mesh(path, folder)?,
        Part::Map => take_map(path, folder)?,
    };
    Ok(Taken { part, file, news })
}

fn take_mesh(path: &Path, folder: &Path) -> Result<(String, Option<String>), Error> {
    let triangles = mesh::load(path)?.triangles.len();
    let news = (triangles > MANY).then(|| {
        format!(
            "{} has {}: drawing it takes longer, and the first stroke on it a while",
            path.display(),
            count(triangles, "triangle")
        )
    });
    Ok((lay_beside(path, folder)?, news))
}

/// A master EXR as it is; anything else is kept as a master EXR, lossless, and said by which convention it was read.
fn take_map(path: &Path, folder: &Path) -> Result<(String, Option<String>), Error> {
    let (read, convention) = match (ending(path).as_str(), other_of_pair(path)) {
        ("glb" | "gltf", _) => (read_gltf(path)?, "KHR_materials_anisotropy"),
        ("exr", Some((alpha, direction))) => (
            read_rgb_pair(&alpha, &direction)?,
            "widths and directions in two RGB files",
        ),
        ("exr", None) => {
            read_master(path)?;
            return Ok((lay_beside(path, folder)?, None));
        }
        _ => return Err(unknown(path)),
    };
    let Imported { map, info, .. } = read;
    let stem = path
        .file_stem()
        .map_or("map".into(), |s| s.to_string_lossy().into_owned());
    let name = format!(
        "{}.exr",
        stem.trim_end_matches("_alpha")
            .trim_end_matches("_direction")
    );
    let to = folder.join(&name);
    refuse_to_replace(&to)?;
    write_master(&to, &Export::new(&map, &info), Precision::Float)?;
    let news = format!(
        "{} was read as {convention}, and is kept as {name}",
        path.display()
    );
    Ok((name, Some(news)))
}

/// Both files of a pair, where a file is one of them by its name and the other is there.
fn other_of_pair(path: &Path) -> Option<(PathBuf, PathBuf)> {
    let stem = path.file_stem()?.to_str()?;
    let base = stem
        .strip_suffix("_alpha")
        .or_else(|| stem.strip_suffix("_direction"))?;
    let both =
        ["_alpha.exr", "_direction.exr"].map(|end| path.with_file_name(format!("{base}{end}")));
    both.iter().all(|p| p.is_file()).then(|| both.into())
}

fn refuse_to_replace(path: &Path) -> Result<(), Error> {
    if path.exists() {
        let problem = "a file of this name lies beside the recipe already";
        return Err(Error::file(path, problem).with_hint("Rename one of them"));
    }
    Ok(())
}

/// What a recipe in `folder` calls a file; one from elsewhere is copied there.
fn lay_beside(path: &Path, folder: &Path) -> Result<String, Error> {
    let name = path
        .file_name()
        .ok_or_else(|| Error::file(path, "it is no file"))?;
    let real = path.canonicalize().map_err(Error::read(path))?;
    let home = folder.canonicalize().map_err(Error::read(folder))?;
    if let Ok(inside) = real.strip_prefix(&home) {
        return Ok(inside.to_string_lossy().replace('\\', "/"));
    }
    let beside = folder.join(name);
    refuse_to_replace(&beside)?;
    let bytes = std::fs::read(&real).map_err(Error::read(&real))?;
    write_atomic(&beside, |out| out.write_all(&bytes))?;
    Ok(name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use anisomap::convention::MapInfo;
    use anisomap::export::exr::write_rgb_pair;
    use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Wrap};

    fn folders() -> (tempfile::TempDir, PathBuf, PathBuf) {
        let all = tempfile::tempdir().unwrap();
        let (from, to) = (all.path().join("from"), all.path().join("to"));
        std::fs::create_dir(&from).unwrap();
        std::fs::create_dir(&to).unwrap();
        (all, from, to)
    }

    #[test]
    fn what_cannot_be_taken_is_said_and_leaves_nothing() {
        let (_all, from, to) = folders();
        for (name, bytes, part, wanted) in [
            ("empty.glb", &b""[..], Part::Mesh, "the file is empty"),
            ("empty.exr", b"", Part::Map, "the file is empty"),
            ("no.exr", b"not an EXR file at all", Part::Map, "no.exr"),
            (
                "picture.png",
                b"\x89PNG",
                Part::Map,
                "does not say what its numbers mean",
            ),
            (
                "flat.obj",
                b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
                Part::Mesh,
                "texture coordinates",
            ),
        ] {
            let path = from.join(name);
            std::fs::write(&path, bytes).unwrap();
            let error = take(part, &path, &to).unwrap_err().to_string();
            assert!(error.contains(wanted), "{name}: {error}");
        }
        let missing = take(Part::Mesh, &from.join("missing.glb"), &to).unwrap_err();
        assert!(missing.to_string().contains("missing.glb"), "{missing}");
        assert_eq!(std::fs::read_dir(&to).unwrap().count(), 0);
    }

    #[test]
    fn a_pair_is_kept_as_one_master_to_the_bit() {
        let (_all, from, to) = folders();
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let info = MapInfo {
            name: "satin".to_owned(),
            aspect: 1.0,
            mesh: None,
            material: None,
        };
        let export = Export::new(&map, &info);
        write_rgb_pair(&from.join("satin"), &export, Precision::Float).unwrap();
        for one in ["satin_alpha.exr", "satin_direction.exr"] {
            let taken = take(Part::Map, &from.join(one), &to).unwrap();
            assert_eq!(taken.file, "satin.exr");
            assert!(taken.news.unwrap().contains("two RGB files"));
            let back = read_master(&to.join("satin.exr")).unwrap().map;
            assert_eq!(back.size(), map.size());
            assert!((back.alpha_x()[0] - map.alpha_x()[0]).abs() < 1e-6);
            let again = take(Part::Map, &from.join(one), &to).unwrap_err();
            assert!(again.to_string().contains("already"), "{again}");
            std::fs::remove_file(to.join("satin.exr")).unwrap();
        }
    }
}
