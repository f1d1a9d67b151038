//! Meshes and maps that come into a document: read, checked and laid beside the recipe by a thread of its own, because a mesh
//! of millions of triangles takes its time. The recipe names files of its own folder alone.

use super::import::{Seen, look_again, look_at};
use super::messages::count;
use super::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::export::Export;
use anisomap::export::exr::{Precision, write_master};
use anisomap::export::laid::{free_path, lay_beside};
use anisomap::import::Imported;
use anisomap::import::exr::{is_master, read_master, read_rgb_pair};
use anisomap::import::gltf::read_gltf;
use anisomap::import::numbers;
use anisomap::import::textures::Textures;
use anisomap::map::Wrap;
use anisomap::mesh::{self, Body, Projection};
use anisomap::recipe::{Files, Image};
use anisomap::studio::{apart, bytes_free, mesh_warning, picture_warning};
use eframe::egui::Context;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Meshes with more triangles than this are told: whatever is done with them takes a while.
const MANY: usize = 2_000_000;

/// What a file is wanted as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// A layer of the map.
    Map,
    /// What the map is shown on.
    Mesh,
}

/// Textures whose meaning was said, to become a layer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Told {
    /// What the layer is called.
    pub(crate) name: String,
    /// Where the files are; the textures name them from there.
    pub(crate) from: PathBuf,
    pub(crate) textures: Textures,
    /// The layer that had a meaning already, where they are no new one.
    pub(crate) layer: Option<String>,
}

/// What came in.
pub(crate) enum Taken {
    /// A mesh that lies beside the recipe now, by the name that the recipe has for it; read and looked over.
    Mesh { file: String, body: Arc<Body> },
    /// A map whose files lie beside the recipe now.
    Layer { name: String, image: Box<Image> },
    /// Textures: what they mean is to be said first.
    Textures(Box<Seen>),
    /// A file that takes the place of another one, by the names that the recipe has for both.
    Found { old: String, new: String },
    /// A mesh without texture coordinates: they may be made.
    NoUvs,
    /// A mesh that takes much memory, and what there is to say of that.
    Large(String),
}

/// What came in, and what there is to say of it.
type Came = (Taken, Vec<String>);

/// A file on its way.
pub(crate) struct Intake {
    pub(crate) path: PathBuf,
    /// That of the recipe that it comes in for.
    pub(crate) folder: PathBuf,
    pub(crate) part: Part,
    work: Work<Result<Came, Error>>,
}

impl Intake {
    /// Begins to take a file into the folder of a recipe.
    pub(crate) fn begin(
        part: Part,
        path: &Path,
        folder: &Path,
        even_if_large: bool,
        ctx: &Context,
    ) -> Result<Self, Error> {
        let (from, home) = (path.to_owned(), folder.to_owned());
        Self::of(part, (path, folder), ctx, move || {
            let free = if even_if_large { None } else { bytes_free() };
            take(part, &from, &home, free)
        })
    }

    /// Begins to take textures into the folder of a recipe.
    pub(crate) fn begin_textures(told: Told, folder: &Path, ctx: &Context) -> Result<Self, Error> {
        let (path, home) = (told.from.join(&told.name), folder.to_owned());
        Self::of(Part::Map, (&path, folder), ctx, move || {
            take_textures(told, &home)
        })
    }

    /// Begins to take a file into the folder of a recipe, in the place of one that the recipe calls `old`.
    pub(crate) fn begin_found(
        old: String,
        path: &Path,
        folder: &Path,
        ctx: &Context,
    ) -> Result<Self, Error> {
        let (from, home) = (path.to_owned(), folder.to_owned());
        Self::of(Part::Map, (path, folder), ctx, move || {
            take_found(old, &from, &home)
        })
    }

    /// Begins to look at the textures of a layer again, for what they mean to be said anew.
    pub(crate) fn begin_again(
        layer: String,
        textures: Textures,
        (folder, files): (&Path, Files),
        ctx: &Context,
    ) -> Result<Self, Error> {
        let home = folder.to_owned();
        Self::of(Part::Map, (folder, folder), ctx, move || {
            let seen = look_again(layer, textures, &home, &files);
            Ok((Taken::Textures(Box::new(seen)), vec![]))
        })
    }

    fn of(
        part: Part,
        (path, folder): (&Path, &Path),
        ctx: &Context,
        work: impl FnOnce() -> Result<Came, Error> + Send + 'static,
    ) -> Result<Self, Error> {
        let body = move |reins: &Reins, give: &dyn Fn(Result<Came, Error>) -> bool| {
            let taken = apart(work);
            if reins.go_on() {
                give(taken);
            }
        };
        Ok(Self {
            path: path.to_owned(),
            folder: folder.to_owned(),
            part,
            work: Work::begin("intake", ctx, body)?,
        })
    }

    /// The file once it is there, or why it is not; `None` while it is on its way.
    pub(crate) fn now(&self) -> Option<Result<Came, Error>> {
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
        "exr" | "png" | "tif" | "tiff" => Some(Part::Map),
        "glb" | "gltf" | "obj" => Some(Part::Mesh),
        _ => None,
    }
}

/// Why a file that is no recipe, map or mesh by its name is not taken.
pub(crate) fn unknown(path: &Path) -> Error {
    let error = Error::file(path, "it is no recipe, map or mesh by its name");
    match ending(path).as_str() {
        "jpg" | "jpeg" | "tga" | "bmp" | "webp" | "psd" | "dds" => error.with_hint(
            "Textures are read from PNG, TIFF and OpenEXR files; save it as one of them",
        ),
        _ => error.with_hint(
            "Recipes end in .toml, maps in .exr, .png, .tif, .glb or .gltf, meshes in .glb, .gltf or .obj",
        ),
    }
}

fn ending(path: &Path) -> String {
    path.extension()
        .map_or(String::new(), |e| e.to_string_lossy().to_lowercase())
}

fn take(part: Part, path: &Path, folder: &Path, free: Option<u64>) -> Result<Came, Error> {
    match part {
        Part::Mesh => take_mesh(path, folder, free),
        Part::Map => take_map(path, folder, free),
    }
}

/// A file in the place of one that is missing: of the same kind, laid beside the recipe as it is.
fn take_found(old: String, path: &Path, folder: &Path) -> Result<Came, Error> {
    let kind = |path: &Path| match ending(path).as_str() {
        "glb" | "gltf" | "obj" => Part::Mesh,
        _ => Part::Map,
    };
    if kind(path) != kind(Path::new(&old)) {
        let problem = format!("it cannot take the place of {old}");
        return Err(Error::file(path, problem).with_hint("Choose a file of the same kind"));
    }
    let needed = match kind(path) {
        Part::Mesh => {
            mesh::about(path)?;
            mesh::companions(path)?
        }
        Part::Map => {
            numbers::about(path)?;
            vec![]
        }
    };
    let laid = lay_beside(path, &needed, folder)?;
    let new = laid.name;
    Ok((Taken::Found { old, new }, Vec::from_iter(laid.news)))
}

/// A mesh, laid beside the recipe as it is; asks first where it has no texture coordinates, or leaves less than half of the
/// memory that is `free`.
fn take_mesh(path: &Path, folder: &Path, free: Option<u64>) -> Result<Came, Error> {
    let (file, projection) = mesh::split_path(path);
    let about = mesh::about(file)?;
    if !about.has_uvs && projection.is_none() {
        return Ok((Taken::NoUvs, vec![]));
    }
    let what = format!(
        "{} has {}",
        file.display(),
        count(about.triangles, "triangle")
    );
    if let Some(warning) = mesh_warning(about.triangles, free) {
        return Ok((Taken::Large(format!("{what}. {warning}")), vec![]));
    }
    let body = Arc::new(Body::new(Arc::new(mesh::load(path)?))?);
    let needed = mesh::companions(file)?;
    let laid = lay_beside(file, &needed, folder)?;
    let name = Projection::join(&laid.name, projection);
    if !needed.is_empty() {
        // Read from where it lies now: a mesh that cannot be shown is no step of the history.
        mesh::load(&folder.join(&name))?;
    }
    let mut news = Vec::from_iter(laid.news);
    if about.triangles > MANY {
        news.push(format!(
            "{what}: drawing it takes longer, and the first stroke on it a while"
        ));
    }
    Ok((Taken::Mesh { file: name, body }, news))
}

/// A master EXR as it is; what says by itself what its numbers mean is kept as a master EXR, lossless; of anything else that
/// has to be said.
fn take_map(path: &Path, folder: &Path, free: Option<u64>) -> Result<Came, Error> {
    if matches!(ending(path).as_str(), "exr" | "png" | "tif" | "tiff") {
        let about = numbers::about(path)?;
        if let Some(warning) = picture_warning(about.size, about.channels.len(), free) {
            let what = format!("{} is {}", path.display(), about.size);
            return Ok((Taken::Large(format!("{what}. {warning}")), vec![]));
        }
    }
    let (read, convention) = match (ending(path).as_str(), other_of_pair(path)) {
        ("glb" | "gltf", _) => (read_gltf(path)?, "KHR_materials_anisotropy"),
        ("exr", Some((alpha, direction))) => (
            read_rgb_pair(&alpha, &direction)?,
            "widths and directions in two RGB files",
        ),
        ("exr", None) if is_master(path)? => {
            read_master(path)?;
            let laid = lay_beside(path, &[], folder)?;
            let name = stem(Path::new(&laid.name));
            let image = Box::new(Image::master(laid.name));
            return Ok((
                Taken::Layer { name, image },
                laid.news.into_iter().collect(),
            ));
        }
        ("exr" | "png" | "tif" | "tiff", None) | ("png" | "tif" | "tiff", Some(_)) => {
            return Ok((Taken::Textures(Box::new(look_at(path)?)), vec![]));
        }
        _ => return Err(unknown(path)),
    };
    let Imported { map, info, .. } = read;
    let own = stem(path);
    let own = own
        .trim_end_matches("_alpha")
        .trim_end_matches("_direction");
    let to = free_path(folder, &format!("{own}.exr"));
    write_master(&to, &Export::new(&map, &info), Precision::Float)?;
    let file = name_of(&to);
    let news = format!(
        "{} was read as {convention}, and is kept as {file}",
        path.display()
    );
    let name = own.to_owned();
    let image = Box::new(Image::master(file));
    Ok((Taken::Layer { name, image }, vec![news]))
}

/// Textures by what was said of them: read once, so that what is wrong is told before anything is copied.
fn take_textures(told: Told, folder: &Path) -> Result<Came, Error> {
    let Told {
        name,
        from,
        mut textures,
        ..
    } = told;
    let (_, mended) = textures.read(Wrap::Clamp, |_, file| Ok(from.join(file)))?;
    let mut news = vec![];
    if mended.faults() > 0 {
        news.push(format!(
            "{name}: {} held what no map can hold, and took the nearest that can",
            count(mended.faults() as usize, "texel")
        ));
    }
    let mut laid: HashMap<String, String> = HashMap::new();
    for channel in textures.channels_mut() {
        if !laid.contains_key(&channel.file) {
            let one = lay_beside(&from.join(&channel.file), &[], folder)?;
            news.extend(one.news);
            laid.insert(channel.file.clone(), one.name);
        }
        channel.file.clone_from(&laid[&channel.file]);
    }
    let image = Box::new(Image::of(textures));
    Ok((Taken::Layer { name, image }, news))
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

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or("map".into(), |s| s.to_string_lossy().into_owned())
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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

    fn refusal(part: Part, path: &Path, folder: &Path) -> String {
        match take(part, path, folder, None) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{} was taken", path.display()),
        }
    }

    /// The file and the news of a map that was taken.
    fn layer_of(came: Result<Came, Error>) -> (String, String) {
        match came.unwrap() {
            (Taken::Layer { image, .. }, news) => (image.file.unwrap(), news.join("\n")),
            _ => panic!("no layer"),
        }
    }

    fn mesh_of(came: Result<Came, Error>) -> String {
        match came.unwrap() {
            (Taken::Mesh { file, .. }, _) => file,
            _ => panic!("no mesh"),
        }
    }

    #[test]
    fn a_mesh_comes_with_its_buffers_and_writes_over_nothing() {
        let (_all, from, to) = folders();
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let info = MapInfo::default();
        let plane = mesh::builtin("plane").unwrap();
        let material = anisomap::recipe::Material::default();
        let export = Export::new(&map, &info);
        let stem = from.join("lid");
        anisomap::export::gltf::write_gltf(&stem, &export, &plane, &material, Default::default())
            .unwrap();
        let taken = mesh_of(take(Part::Mesh, &from.join("lid.gltf"), &to, None));
        assert_eq!(taken, "lid/lid.gltf");
        mesh::load(&to.join(&taken)).unwrap();
        // The same again is the same; another of that name gets a name of its own.
        assert_eq!(
            mesh_of(take(Part::Mesh, &from.join("lid.gltf"), &to, None)),
            taken
        );
        std::fs::write(to.join("lid/lid.bin"), b"other").unwrap();
        assert_eq!(
            mesh_of(take(Part::Mesh, &from.join("lid.gltf"), &to, None)),
            "lid_2/lid.gltf"
        );
        assert_eq!(std::fs::read(to.join("lid/lid.bin")).unwrap(), b"other");
        // Without its buffer it is refused, and nothing is left of it.
        std::fs::remove_file(from.join("lid.bin")).unwrap();
        let refused = refusal(Part::Mesh, &from.join("lid.gltf"), &to);
        assert!(refused.contains("lid.bin"), "{refused}");
        assert!(!to.join("lid_3").exists());
    }

    #[test]
    fn textures_come_beside_the_recipe_once_they_are_told() {
        let (_all, from, to) = folders();
        image::GrayImage::from_pixel(4, 4, image::Luma([128]))
            .save(from.join("a_roughness.png"))
            .unwrap();
        image::GrayImage::from_pixel(4, 4, image::Luma([64]))
            .save(from.join("a_rotation.png"))
            .unwrap();
        std::fs::write(to.join("a_rotation.png"), b"of another").unwrap();
        let path = from.join("a_roughness.png");
        let Ok((Taken::Textures(seen), _)) = take(Part::Map, &path, &to, None) else {
            panic!("nothing to be said");
        };
        assert_eq!(
            std::fs::read_dir(&to).unwrap().count(),
            1,
            "nothing is copied yet"
        );
        let told = Told {
            name: "a".to_owned(),
            from: from.clone(),
            textures: seen.guess.textures.clone(),
            layer: None,
        };
        let (Taken::Layer { name, image }, news) = take_textures(told, &to).unwrap() else {
            panic!("no layer");
        };
        assert_eq!(name, "a");
        let files: Vec<&String> = image.files().collect();
        assert_eq!(files, ["a_roughness.png", "a_rotation_2.png"]);
        assert!(news[0].contains("a_rotation_2.png"), "{news:?}");
        assert_eq!(
            std::fs::read(to.join("a_rotation.png")).unwrap(),
            b"of another"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_link_beside_the_recipe_is_what_it_is() {
        let (_all, from, to) = folders();
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
        std::fs::write(to.join("real.obj"), text).unwrap();
        std::os::unix::fs::symlink("real.obj", to.join("link.obj")).unwrap();
        assert_eq!(
            mesh_of(take(Part::Mesh, &to.join("link.obj"), &to, None)),
            "link.obj"
        );
        // One that leads out is copied under another name.
        std::fs::write(from.join("out.obj"), text).unwrap();
        std::os::unix::fs::symlink(from.join("out.obj"), to.join("out.obj")).unwrap();
        let taken = mesh_of(take(Part::Mesh, &to.join("out.obj"), &to, None));
        assert_eq!(taken, "out_2.obj");
        assert!(!to.join(&taken).is_symlink());
    }

    #[test]
    fn what_cannot_be_taken_is_said_and_leaves_nothing() {
        let (_all, from, to) = folders();
        for (name, bytes, part, wanted) in [
            ("empty.glb", &b""[..], Part::Mesh, "the file is empty"),
            ("empty.exr", b"", Part::Map, "the file is empty"),
            ("no.exr", b"not an EXR file at all", Part::Map, "no.exr"),
            ("picture.png", b"\x89PNG", Part::Map, "no usable PNG"),
            ("photo.jpg", b"jpeg", Part::Map, "save it as one of them"),
            (
                "bent.obj",
                b"v 0 0 0\nvt 0 0\nf 1/1 2/1 3/1\n",
                Part::Mesh,
                "position",
            ),
        ] {
            let path = from.join(name);
            std::fs::write(&path, bytes).unwrap();
            let error = refusal(part, &path, &to);
            assert!(error.contains(wanted), "{name}: {error}");
        }
        let missing = refusal(Part::Mesh, &from.join("missing.glb"), &to);
        assert!(missing.contains("missing.glb"), "{missing}");
        assert_eq!(std::fs::read_dir(&to).unwrap().count(), 0);
    }

    #[test]
    fn a_mesh_without_texture_coordinates_is_asked_about_and_taken_with_a_projection() {
        let (_all, from, to) = folders();
        let path = from.join("flat.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let asked = take(Part::Mesh, &path, &to, None);
        assert!(matches!(asked, Ok((Taken::NoUvs, _))));
        assert_eq!(std::fs::read_dir(&to).unwrap().count(), 0);
        let taken = mesh_of(take(Part::Mesh, &from.join("flat.obj#box"), &to, None));
        assert_eq!(taken, "flat.obj#box");
        assert!(to.join("flat.obj").is_file());
        assert_eq!(mesh::load(&to.join(&taken)).unwrap().triangles.len(), 1);
        let told = take(Part::Mesh, &to.join("flat.obj#box"), &to, Some(1));
        assert!(matches!(told, Ok((Taken::Large(_), _))));
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
            let (file, news) = layer_of(take(Part::Map, &from.join(one), &to, None));
            assert_eq!(file, "satin.exr");
            assert!(news.contains("two RGB files"));
            let back = read_master(&to.join("satin.exr")).unwrap().map;
            assert_eq!(back.size(), map.size());
            assert!((back.alpha_x()[0] - map.alpha_x()[0]).abs() < 1e-6);
            let (again, _) = layer_of(take(Part::Map, &from.join(one), &to, None));
            assert_eq!(again, "satin_2.exr", "what is there is not written over");
            std::fs::remove_file(to.join("satin.exr")).unwrap();
            std::fs::remove_file(to.join("satin_2.exr")).unwrap();
        }
    }
}
