//! Triangles with normals, tangents and texture coordinates: built-in shapes, one file each, and meshes from files.
//!
//! World is y up, right-handed; front faces wind counter-clockwise seen from outside. v of a texture coordinate runs up, as
//! in OBJ; glTF's is flipped on load and save.

pub(crate) mod container;
pub mod cylinder;
mod disc;
mod gltf;
mod grid;
mod islands;
mod obj;
mod plane;
pub mod pot;
mod projection;
mod raw;
mod sphere;
mod tangents;
pub mod torus;
mod tree;

pub use cylinder::cylinder;
pub use disc::disc;
pub use islands::Islands;
pub use plane::plane;
pub use pot::pot;
pub use projection::Projection;
pub use sphere::sphere;
pub use torus::torus;
pub use tree::{Body, Met};

use crate::error::{Error, Result, nearest_word, open_filled};
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// The built-in shapes, as `--mesh` names them.
pub const BUILTIN_NAMES: [&str; 6] = ["torus", "pot", "sphere", "plane", "cylinder", "disc"];

/// Largest file that is read, in bytes: 2 GiB.
pub const MAX_FILE_BYTES: u64 = 1 << 31;

/// Most triangles of a mesh from a file, instances counted. That many without normals, so that each has three vertices of
/// its own, were read in 7 GB.
pub const MAX_TRIANGLES: usize = 10_000_000;

/// An indexed triangle mesh. All vertex arrays have one length; every index is inside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// What it is called in files and captions.
    pub name: String,
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Unit normals, outward.
    pub normals: Vec<Vec3>,
    /// Unit tangents along +U; w = +1 where the layout is not mirrored, so that B = w (N x T) points to image-up. A zero
    /// vector where the surface has no direction of its own (a pole, a degenerate layout).
    pub tangents: Vec<Vec4>,
    /// Texture coordinates, v up.
    pub uvs: Vec<Vec2>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The surface's width over its height for one turn of UV: what a recipe's `aspect` should be on this mesh.
    pub aspect: f32,
}

/// A mesh that is lent, or shared with others.
#[derive(Clone, Debug)]
pub enum Held<'a> {
    /// Somebody else's.
    Lent(&'a Mesh),
    /// Kept for as long as anybody likes.
    Shared(Arc<Mesh>),
}

impl std::ops::Deref for Held<'_> {
    type Target = Mesh;

    fn deref(&self) -> &Mesh {
        match self {
            Self::Lent(mesh) => mesh,
            Self::Shared(mesh) => mesh,
        }
    }
}

impl<'a> From<&'a Mesh> for Held<'a> {
    fn from(mesh: &'a Mesh) -> Self {
        Self::Lent(mesh)
    }
}

impl From<Mesh> for Held<'_> {
    fn from(mesh: Mesh) -> Self {
        Self::Shared(Arc::new(mesh))
    }
}

impl From<Arc<Mesh>> for Held<'_> {
    fn from(mesh: Arc<Mesh>) -> Self {
        Self::Shared(mesh)
    }
}

/// How far a stored unit vector may be from length 1, and a tangent from the normal's plane.
const UNIT_TOLERANCE: f32 = 1e-3;

impl Mesh {
    /// Checks what every user of a mesh relies on: arrays of one length, indices inside them, finite numbers, unit normals,
    /// tangents of unit length at right angles to them (or zero) with w = +1 or -1, a positive aspect.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the first thing that is wrong.
    pub fn validate(&self) -> Result<()> {
        let wrong = |what: String, value: String, allowed: &str| {
            Err(Error::invalid(
                format!("{what} of mesh {}", self.name),
                value,
                format!("allowed: {allowed}"),
            ))
        };
        let count = self.positions.len();
        let lengths = [self.normals.len(), self.tangents.len(), self.uvs.len()];
        if self.triangles.is_empty() || lengths.iter().any(|l| *l != count) {
            return wrong(
                "array lengths (position, normal, tangent, uv, triangle)".to_owned(),
                format!("{count}, {lengths:?}, {}", self.triangles.len()),
                "the first four equal, and at least one triangle",
            );
        }
        if !(self.aspect.is_finite() && self.aspect > 0.0) {
            return wrong("aspect".to_owned(), self.aspect.to_string(), "above 0");
        }
        for (i, t) in self.triangles.iter().enumerate() {
            if t.iter().any(|v| *v as usize >= count) {
                return wrong(
                    format!("triangle {i}"),
                    format!("{t:?}"),
                    &format!("0 to {}", count.saturating_sub(1)),
                );
            }
        }
        for i in 0..count {
            if let Some((what, value, allowed)) = self.vertex_fault(i) {
                return wrong(format!("{what} {i}"), value, allowed);
            }
        }
        Ok(())
    }

    /// What is wrong with a vertex: which number, its value, what is allowed.
    fn vertex_fault(&self, i: usize) -> Option<(&'static str, String, &'static str)> {
        let (p, n, t, uv) = (
            self.positions[i],
            self.normals[i],
            self.tangents[i],
            self.uvs[i],
        );
        let unit = |length: f32| (length - 1.0).abs() <= UNIT_TOLERANCE;
        let along = t.truncate();
        if !p.is_finite() {
            Some(("position", p.to_string(), "finite numbers"))
        } else if !uv.is_finite() {
            Some(("uv", uv.to_string(), "finite numbers"))
        } else if !unit(n.length()) {
            Some(("normal", n.to_string(), "unit vectors"))
        } else if along != Vec3::ZERO
            && (!unit(along.length()) || along.dot(n).abs() > UNIT_TOLERANCE)
            || t.w.abs() != 1.0
        {
            Some((
                "tangent",
                t.to_string(),
                "unit vectors at right angles to the normal, or zero, with w = 1 or -1",
            ))
        } else {
            None
        }
    }

    /// The middle of the bounding box and the radius around it that holds every position; zeros for a mesh without any.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        let Some(&first) = self.positions.first() else {
            return (Vec3::ZERO, 0.0);
        };
        let (low, high) = self
            .positions
            .iter()
            .fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
        let centre = 0.5 * (low + high);
        let radius = self
            .positions
            .iter()
            .fold(0.0f32, |r, p| r.max(p.distance(centre)));
        (centre, radius)
    }

    /// The three positions of a triangle.
    fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|i| self.positions[i as usize])
    }

    /// The three texture coordinates of a triangle.
    fn corner_uvs(&self, triangle: [u32; 3]) -> [Vec2; 3] {
        triangle.map(|i| self.uvs[i as usize])
    }
}

/// (dP/du, dP/dv) of a triangle; `None` where its texture coordinates span no area.
fn derivatives(p: [Vec3; 3], uv: [Vec2; 3]) -> Option<(Vec3, Vec3)> {
    let (a, b) = (uv[1] - uv[0], uv[2] - uv[0]);
    let area = a.perp_dot(b);
    // Relative to its sides: below this the area is made of rounding errors.
    if area.abs() <= 1e-6 * a.length() * b.length() || area.abs() < f32::MIN_POSITIVE {
        return None;
    }
    let (e, f) = (p[1] - p[0], p[2] - p[0]);
    Some(((e * b.y - f * a.y) / area, (f * a.x - e * b.x) / area))
}

/// A built-in shape; `None` for a name that is not in [`BUILTIN_NAMES`].
pub fn builtin(name: &str) -> Option<Mesh> {
    match name {
        "torus" => Some(torus()),
        "pot" => Some(pot()),
        "sphere" => Some(sphere()),
        "plane" => Some(plane()),
        "cylinder" => Some(cylinder()),
        "disc" => Some(disc()),
        _ => None,
    }
}

/// A built-in shape by name or a mesh by path; a path is anything with a slash, a backslash or a dot.
///
/// # Errors
/// [`Error::Invalid`] for a name that is no shape, and those of [`load`].
pub fn open(word: &str) -> Result<Mesh> {
    if word.contains(['/', '\\', '.']) {
        return load(Path::new(word));
    }
    builtin(word).ok_or_else(|| {
        let known = format!("allowed: {}, or a path", BUILTIN_NAMES.join(", "));
        let error = Error::invalid("--mesh", format!("`{word}`"), known);
        match nearest_word(word, BUILTIN_NAMES) {
            Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
            None => error.with_hint(format!("A file of that name is `./{word}`")),
        }
    })
}

/// Reads a mesh from a .glb, .gltf or .obj file: all triangles of its default scene, merged. Normals and tangents that the
/// file leaves out are made; `aspect` is measured from its layout. Where a [`Projection`] stands after the path, as in
/// `statue.glb#box`, texture coordinates are made by it.
///
/// # Errors
/// [`Error::Read`] when the file or a buffer beside it is not there, [`Error::File`] when its content cannot be used: it is
/// damaged, names things that it does not hold, has no triangles or no texture coordinates, or is larger than
/// [`MAX_FILE_BYTES`] or [`MAX_TRIANGLES`] allow.
pub fn load(path: &Path) -> Result<Mesh> {
    let (path, projection) = split_path(path);
    load_with(path, projection)
}

/// A path with the projection taken off it.
pub fn split_path(path: &Path) -> (&Path, Option<Projection>) {
    match path.to_str().map(Projection::split) {
        Some((file, projection)) => (Path::new(file), projection),
        None => (path, None),
    }
}

/// As [`load`], of a file by its very name.
///
/// # Errors
/// As [`load`].
pub fn load_with(path: &Path, projection: Option<Projection>) -> Result<Mesh> {
    let parse = match format(path)? {
        Format::Gltf => gltf::parse,
        Format::Obj => obj::parse,
    };
    let bytes = read_limited(path, MAX_FILE_BYTES)?;
    let mut mesh = parse(path, &bytes, projection)?;
    mesh.name = path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    Ok(mesh)
}

/// The files that a mesh file cannot be read without, seen from its folder: the buffers of a glTF file.
///
/// # Errors
/// As [`load`], as far as it concerns the file itself.
pub fn companions(path: &Path) -> Result<Vec<PathBuf>> {
    let (path, _) = split_path(path);
    match format(path)? {
        Format::Gltf => gltf::companions(path, &read_limited(path, MAX_FILE_BYTES)?),
        Format::Obj => Ok(vec![]),
    }
}

/// When a `.gltf` was last written, its length, and its buffers.
type Told = (SystemTime, u64, Vec<PathBuf>);

/// What was read of the `.gltf` files that were asked about last.
static TOLD: Mutex<BTreeMap<PathBuf, Told>> = Mutex::new(BTreeMap::new());

/// Where the buffers of a `.gltf` lie, whether they are there or not; none of other files. The file is read again only where it
/// has changed, so that it may be asked as often as one likes; while it is not there or damaged, what it said last holds, or else
/// the name that exporters give: its own with `.bin` for an end.
pub fn buffers_of(path: &Path) -> Vec<PathBuf> {
    if !path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("gltf"))
    {
        return Vec::new();
    }
    let lock = || TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    let about = std::fs::metadata(path).ok();
    let now = about.and_then(|about| Some((about.modified().ok()?, about.len())));
    let before = lock().get(path).cloned();
    if let Some((time, length, buffers)) = &before
        && now.is_none_or(|now| now == (*time, *length))
    {
        return buffers.clone();
    }
    let usual = || match before {
        Some((.., buffers)) => buffers,
        None => vec![path.with_extension("bin")],
    };
    let Some((time, length)) = now else {
        return usual();
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = match companions(path) {
        Ok(named) => named.iter().map(|name| folder.join(name)).collect(),
        Err(_) => usual(), // reading it as a mesh tells
    };
    let mut told = lock();
    if told.len() >= TOLD_MAX {
        told.clear();
    }
    told.insert(path.to_owned(), (time, length, buffers.clone()));
    buffers
}

/// How many files are remembered.
const TOLD_MAX: usize = 64;

/// A kind of file.
enum Format {
    Gltf,
    Obj,
}

fn format(path: &Path) -> Result<Format> {
    let extension = path.extension();
    let extension = extension.map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("glb" | "gltf") => Ok(Format::Gltf),
        Some("obj") => Ok(Format::Obj),
        _ => Err(Error::file(path, "not a mesh file by its name")
            .with_hint("Meshes are read from .glb, .gltf and .obj files")),
    }
}

/// What can be told of a mesh file without reading all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct About {
    /// How many triangles it says it has, instances counted.
    pub triangles: usize,
    /// Whether all of them have texture coordinates.
    pub has_uvs: bool,
}

/// What a file says of itself; whether it is right [`load`] finds out.
///
/// # Errors
/// [`Error::Read`] when the file is not there, [`Error::File`] when it is no mesh by its name or by its beginning.
pub fn about(path: &Path) -> Result<About> {
    let (path, _) = split_path(path);
    let format = format(path)?;
    let (file, _) = open_filled(path)?;
    let mut file = BufReader::new(file.take(MAX_FILE_BYTES));
    let (triangles, has_uvs) = match format {
        Format::Obj => obj::about(file.split(b'\n')).map_err(Error::read(path))?,
        Format::Gltf => {
            let json = gltf_json(&mut file).map_err(Error::read(path))?;
            gltf::about(&json).map_err(|problem| Error::file(path, problem))?
        }
    };
    Ok(About { triangles, has_uvs })
}

/// The JSON of a .glb or .gltf file.
fn gltf_json(file: &mut impl BufRead) -> std::io::Result<Vec<u8>> {
    let mut limit = gltf::MAX_JSON_BYTES as u64 + 1;
    if file.fill_buf()?.starts_with(b"glTF") {
        let mut head = [0; 20];
        file.read_exact(&mut head)?;
        let length = u32::from_le_bytes([head[12], head[13], head[14], head[15]]);
        limit = limit.min(u64::from(length));
    }
    let mut json = Vec::new();
    file.take(limit).read_to_end(&mut json)?;
    Ok(json)
}

/// A regular file of at most `limit` bytes.
fn read_limited(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let (file, _) = open_filled(path)?;
    let mut bytes = Vec::new();
    file.take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::read(path))?;
    if bytes.len() as u64 > limit {
        return Err(Error::file(
            path,
            format!("is larger than the {limit} bytes that are read"),
        ));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests;
