//! glTF 2.0 and GLB: the triangles of the default scene. Only what a mesh needs is read; images, skins, morph targets and
//! animations are not.
//!
//! The document is read into our own few structs instead of through the `gltf` crate, whose checks and readers panic on some
//! damaged files: a panic that is caught has already written its message to the user's terminal. Here every number of the
//! file is checked where it is used.

use super::container::{path_beside, split_glb};
use super::raw::{Fault, MissingNormals, Raw, check_triangle_count};
use super::{MAX_FILE_BYTES, Mesh, Projection, read_limited};
use crate::error::{Error, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Largest JSON part, in bytes. Its structs take up to ten times as much memory as its text.
pub(super) const MAX_JSON_BYTES: usize = 1 << 28;
/// Most JSON objects: each of `{},` becomes a struct of about 200 bytes.
const MAX_JSON_OBJECTS: usize = 1_000_000;
/// Most primitives that nodes place, each counted as often as it is placed: few bytes of JSON could ask for a million millions.
const MAX_PARTS: usize = 1_000_000;

/// What to do about a mesh without texture coordinates.
pub(super) const NO_UVS_HINT: &str = "Unwrap it in a modelling program and export it with its texture coordinates, or have them made from six sides: name it with `#box` after it, as in `statue.glb#box`";
const DAMAGED_HINT: &str = "The file is damaged; export it again";

/// Extensions that a file may require although they are not read: they change materials, textures and lights, not triangles.
/// KHR_mesh_quantization is read: every component type is.
const HARMLESS_EXTENSIONS: [&str; 6] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_mesh_quantization",
    "KHR_xmp",
];

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    asset: Asset,
    scene: Option<usize>,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<MeshEntry>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
    #[serde(default)]
    buffers: Vec<Buffer>,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    mesh: Option<usize>,
    skin: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    matrix: Option<[f32; 16]>,
    translation: Option<[f32; 3]>,
    rotation: Option<[f32; 4]>,
    scale: Option<[f32; 3]>,
}

#[derive(Deserialize)]
struct MeshEntry {
    #[serde(default)]
    name: String,
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
    #[serde(rename = "NORMAL")]
    normal: Option<usize>,
    #[serde(rename = "TANGENT")]
    tangent: Option<usize>,
    #[serde(rename = "TEXCOORD_0")]
    uv: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    uri: Option<String>,
    byte_length: usize,
}

/// Reads the bytes of a .glb or .gltf file, whichever they are; `path` names it in messages, and its folder holds the buffers.
///
/// # Errors
/// [`Error::Read`] and [`Error::File`], as [`super::load`] says.
pub(super) fn parse(path: &Path, bytes: &[u8], projection: Option<Projection>) -> Result<Mesh> {
    let damaged = |problem: String| Error::file(path, problem).with_hint(DAMAGED_HINT);
    let (json, bin) = if bytes.starts_with(b"glTF") {
        split_glb(bytes).map_err(damaged)?
    } else {
        (bytes, None)
    };
    let document = read_document(json).map_err(damaged)?;
    check_extensions(&document).map_err(|name| {
        Error::file(
            path,
            format!("it needs the glTF extension {name}, which is not read"),
        )
        .with_hint("Export it without compression")
    })?;
    let buffers = load_buffers(path, &document, bin)?;
    let source = Source {
        path,
        document: &document,
        buffers,
        without_uvs: projection.is_some(),
    };
    let mut mesh = Mesh::empty("", 1.0);
    let places = placements(&document).map_err(damaged)?;
    source.check_total(&places)?;
    for (index, place) in places {
        source.append_mesh(&mut mesh, index, place)?;
    }
    if mesh.triangles.is_empty() {
        return Err(Error::file(
            path,
            "its default scene has no triangles with an area",
        ));
    }
    match projection {
        Some(projection) => projection.lay(&mut mesh),
        None => mesh.measure_aspect(),
    }
    Ok(mesh)
}

/// The files beside it that hold its buffers.
pub(super) fn companions(path: &Path, bytes: &[u8]) -> Result<Vec<PathBuf>> {
    let damaged = |problem: String| Error::file(path, problem).with_hint(DAMAGED_HINT);
    let (json, _) = if bytes.starts_with(b"glTF") {
        split_glb(bytes).map_err(damaged)?
    } else {
        (bytes, None)
    };
    let document = read_document(json).map_err(damaged)?;
    let named = document.buffers.iter().filter_map(|b| b.uri.as_deref());
    let mut files: Vec<PathBuf> = named
        .filter(|uri| !uri.starts_with("data:"))
        .filter_map(path_beside)
        .filter(|file| lies_beside(path, &path.parent().unwrap_or(Path::new("")).join(file)))
        .collect();
    files.sort();
    files.dedup();
    Ok(files)
}

/// How many triangles the JSON of a file places, and whether all have texture coordinates; what is wrong is left to [`parse`].
pub(super) fn about(json: &[u8]) -> Result<(usize, bool), String> {
    let document = read_document(json)?;
    let (mut triangles, mut has_uvs) = (0usize, true);
    for (mesh, _) in placements(&document)? {
        let entry = document.meshes.get(mesh);
        for primitive in entry.iter().flat_map(|m| &m.primitives) {
            let mode = primitive.mode.unwrap_or(4);
            if mode < 4 {
                continue;
            }
            let corners = primitive.indices.or(primitive.attributes.position);
            let corners = corners.and_then(|i| document.accessors.get(i));
            let corners = corners.map_or(0, |a| a.count);
            triangles = triangles.saturating_add(triangle_count(mode, corners));
            has_uvs &= primitive.attributes.uv.is_some();
        }
    }
    Ok((triangles, has_uvs))
}

/// How many triangles so many corners are, one by one (mode 4), in a strip or in a fan.
fn triangle_count(mode: u32, corners: usize) -> usize {
    if mode == 4 {
        corners / 3
    } else {
        corners.saturating_sub(2)
    }
}

fn read_document(json: &[u8]) -> Result<Document, String> {
    if json.len() > MAX_JSON_BYTES {
        return Err(format!(
            "its JSON is {} bytes long; allowed: {MAX_JSON_BYTES}. A .glb keeps the data outside of it",
            json.len()
        ));
    }
    if json.iter().filter(|b| **b == b'{').count() > MAX_JSON_OBJECTS {
        return Err(format!(
            "its JSON holds more than {MAX_JSON_OBJECTS} objects"
        ));
    }
    let document: Document =
        serde_json::from_slice(json).map_err(|e| format!("its JSON is no glTF 2.0: {e}"))?;
    if !document.asset.version.starts_with("2.") {
        return Err(format!(
            "it is glTF version {}; version 2 is read",
            document.asset.version
        ));
    }
    Ok(document)
}

/// The error is the first required extension that is not understood.
fn check_extensions(document: &Document) -> Result<(), &str> {
    let unknown = document
        .extensions_required
        .iter()
        .find(|name| !HARMLESS_EXTENSIONS.iter().any(|h| name.starts_with(h)));
    unknown.map_or(Ok(()), |name| Err(name))
}

/// Every buffer's bytes, cut to the length that the document states.
fn load_buffers<'a>(
    path: &Path,
    document: &Document,
    bin: Option<&'a [u8]>,
) -> Result<Vec<Cow<'a, [u8]>>> {
    let mut left = MAX_FILE_BYTES;
    let mut buffers = Vec::with_capacity(document.buffers.len());
    for (i, buffer) in document.buffers.iter().enumerate() {
        let fault = |problem: String| {
            Error::file(path, format!("buffer {i}: {problem}")).with_hint(DAMAGED_HINT)
        };
        let mut bytes = match (&buffer.uri, bin) {
            (None, Some(bin)) if i == 0 => Cow::Borrowed(bin),
            (None, _) => Cow::Borrowed(&[][..]),
            (Some(uri), _) => Cow::Owned(load_uri(path, uri, left, fault)?),
        };
        if bytes.len() < buffer.byte_length {
            return Err(fault(format!(
                "{} bytes long instead of {}",
                bytes.len(),
                buffer.byte_length
            )));
        }
        match &mut bytes {
            Cow::Borrowed(bytes) => *bytes = &bytes[..buffer.byte_length],
            Cow::Owned(bytes) => {
                bytes.truncate(buffer.byte_length);
                left -= left.min(bytes.len() as u64);
            }
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

fn load_uri(
    path: &Path,
    uri: &str,
    limit: u64,
    fault: impl Fn(String) -> Error,
) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data
            .split_once(";base64,")
            .ok_or_else(|| fault("its data URI is not base64".to_owned()))?;
        return BASE64
            .decode(text)
            .map_err(|e| fault(format!("its data URI is not base64: {e}")));
    }
    let beside = path_beside(uri).ok_or_else(|| {
        Error::file(
            path,
            format!("a buffer is named `{uri}`, which is not in the file's own folder"),
        )
        .with_hint("Buffers are read from beside the file only; move it there, or export a .glb")
    })?;
    let file = path.parent().unwrap_or(Path::new("")).join(beside);
    if !lies_beside(path, &file) {
        let problem = format!("its buffer `{uri}` is a link that leads out of its folder");
        return Err(Error::file(path, problem).with_hint("Put the buffer itself there"));
    }
    read_limited(&file, limit)
}

/// Whether a file that is there really lies in the folder of a glTF file, or below it: a link may lead elsewhere. Where the
/// glTF file is a link itself, both count.
fn lies_beside(path: &Path, file: &Path) -> bool {
    let folder = |path: &Path| {
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
        parent.unwrap_or(Path::new(".")).canonicalize().ok()
    };
    let Ok(real) = file.canonicalize() else {
        return true; // it is not there, which reading it tells
    };
    let target = path.canonicalize().ok().and_then(|p| folder(&p));
    [folder(path), target]
        .into_iter()
        .flatten()
        .any(|home| real.starts_with(home))
}

/// (mesh, transform to the world) of every node of the default scene, parents before children. Without any scene every node
/// that is nobody's child counts.
fn placements(document: &Document) -> Result<Vec<(usize, Mat4)>, String> {
    let mut open: Vec<(usize, Mat4)> = root_nodes(document)?
        .into_iter()
        .rev()
        .map(|n| (n, Mat4::IDENTITY))
        .collect();
    let mut seen = vec![false; document.nodes.len()];
    let mut found = Vec::new();
    while let Some((index, parent)) = open.pop() {
        let node = document
            .nodes
            .get(index)
            .ok_or_else(|| format!("it names node {index}, but has {}", document.nodes.len()))?;
        if std::mem::replace(&mut seen[index], true) {
            return Err(format!("node {index} has more than one parent"));
        }
        let place = parent * local_transform(node);
        if let Some(mesh) = node.mesh {
            // The spec: a skinned mesh ignores its node's transform. It is shown as it was bound.
            let place = if node.skin.is_some() {
                Mat4::IDENTITY
            } else {
                place
            };
            found.push((mesh, place));
        }
        open.extend(node.children.iter().rev().map(|c| (*c, place)));
    }
    let parts =
        |(mesh, _): &(usize, Mat4)| document.meshes.get(*mesh).map_or(0, |m| m.primitives.len());
    let parts = found.iter().map(parts).fold(0, usize::saturating_add);
    if parts > MAX_PARTS {
        return Err(format!(
            "its scene places {parts} parts of meshes; allowed: {MAX_PARTS}"
        ));
    }
    Ok(found)
}

fn root_nodes(document: &Document) -> Result<Vec<usize>, String> {
    if document.scenes.is_empty() {
        let mut is_child = vec![false; document.nodes.len()];
        for child in document.nodes.iter().flat_map(|n| &n.children) {
            if let Some(flag) = is_child.get_mut(*child) {
                *flag = true;
            }
        }
        return Ok((0..document.nodes.len())
            .filter(|i| !is_child[*i])
            .collect());
    }
    let index = document.scene.unwrap_or(0);
    let scene = document
        .scenes
        .get(index)
        .ok_or_else(|| format!("it names scene {index}, but has {}", document.scenes.len()))?;
    Ok(scene.nodes.clone())
}

fn local_transform(node: &Node) -> Mat4 {
    if let Some(matrix) = node.matrix {
        return Mat4::from_cols_array(&matrix);
    }
    // A rotation of length 0 is none; glam's constructor wants unit length.
    let rotation = Vec4::from(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let rotation = rotation.try_normalize().unwrap_or(Vec4::W);
    Mat4::from_scale_rotation_translation(
        node.scale.unwrap_or([1.0; 3]).into(),
        Quat::from_vec4(rotation),
        node.translation.unwrap_or_default().into(),
    )
}

/// An accessor whose every element was checked to lie inside its buffer.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
    component: ComponentType,
    normalized: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl ComponentType {
    fn from_code(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

impl Elements<'_> {
    /// The `at`-th element as numbers; normalised integers as glTF 2.0, section 3.6.2.2, turns them into numbers.
    fn numbers<const N: usize>(&self, at: usize) -> [f32; N] {
        let size = self.component.size();
        let scaled = |x: f32, most: f32| {
            if self.normalized {
                (x / most).max(-1.0)
            } else {
                x
            }
        };
        std::array::from_fn(|i| {
            let b = &self.bytes[at * self.stride + i * size..][..size];
            match self.component {
                ComponentType::I8 => scaled(f32::from(b[0] as i8), 127.0),
                ComponentType::U8 => scaled(f32::from(b[0]), 255.0),
                ComponentType::I16 => scaled(f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
                ComponentType::U16 => scaled(f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
                ComponentType::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
                ComponentType::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            }
        })
    }

    fn index(&self, at: usize) -> u32 {
        let b = &self.bytes[at * self.stride..][..self.component.size()];
        b.iter().rev().fold(0, |sum, b| sum << 8 | u32::from(*b))
    }

    fn is_index_type(&self) -> bool {
        matches!(
            self.component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        )
    }
}

/// A document with its data.
struct Source<'a> {
    path: &'a Path,
    document: &'a Document,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Whether texture coordinates, and the tangents that follow from them, are left out.
    without_uvs: bool,
}

impl Source<'_> {
    /// Refuses a scene of too many triangles before any of them is read: a small mesh may stand in many places.
    fn check_total(&self, places: &[(usize, Mat4)]) -> Result<()> {
        let meshes = self.document.meshes.iter();
        let counts: Vec<usize> = meshes.map(|mesh| self.triangles_of(mesh)).collect();
        let placed = places.iter().filter_map(|(mesh, _)| counts.get(*mesh));
        let total = placed.fold(0usize, |sum, count| sum.saturating_add(*count));
        check_triangle_count(total).map_err(|f| {
            let hint = f.hint.unwrap_or(DAMAGED_HINT);
            Error::file(self.path, f.problem).with_hint(hint)
        })
    }

    /// How many triangles a mesh has; of a damaged part none, which reading it tells.
    fn triangles_of(&self, mesh: &MeshEntry) -> usize {
        let count = |primitive: &Primitive| {
            let (what, index) = match primitive.indices {
                Some(index) => (("indices", 1), index),
                None => (("POSITION", 3), primitive.attributes.position?),
            };
            let mode = primitive.mode.unwrap_or(4);
            let corners = self.elements(what.0, index, what.1).ok()?.count;
            (4..=6)
                .contains(&mode)
                .then(|| triangle_count(mode, corners))
        };
        let counts = mesh.primitives.iter().filter_map(count);
        counts.fold(0, usize::saturating_add)
    }

    fn append_mesh(&self, mesh: &mut Mesh, index: usize, place: Mat4) -> Result<()> {
        let entry = self.document.meshes.get(index).ok_or_else(|| {
            let held = self.document.meshes.len();
            Error::file(
                self.path,
                format!("a node names mesh {index}, but the file has {held}"),
            )
            .with_hint(DAMAGED_HINT)
        })?;
        for (i, primitive) in entry.primitives.iter().enumerate() {
            let fault = |problem: String| {
                let name = &entry.name;
                Error::file(
                    self.path,
                    format!("mesh {index} `{name}`, primitive {i}: {problem}"),
                )
            };
            // 0 to 3 are points and lines: they cover nothing.
            let mode = primitive.mode.unwrap_or(4);
            if mode > 6 {
                return Err(fault(format!("mode {mode}; allowed: 0 to 6")).with_hint(DAMAGED_HINT));
            }
            if mode < 4 {
                continue;
            }
            if primitive.attributes.uv.is_none() && !self.without_uvs {
                let problem =
                    "it has no texture coordinates (TEXCOORD_0), so no map can be placed on it";
                return Err(fault(problem.to_owned()).with_hint(NO_UVS_HINT));
            }
            self.part(primitive, mode, mesh.triangles.len())
                .and_then(|part| mesh.append(&part, place))
                .map_err(|f| fault(f.problem).with_hint(f.hint.unwrap_or(DAMAGED_HINT)))?;
        }
        Ok(())
    }

    /// A primitive as a mesh of its own, holding only the vertices that its triangles use.
    fn part(&self, primitive: &Primitive, mode: u32, already: usize) -> Result<Mesh, Fault> {
        let attributes = &primitive.attributes;
        let positions = self.elements("POSITION", required(attributes.position, "POSITION")?, 3)?;
        let own = |accessor: Option<usize>| accessor.filter(|_| !self.without_uvs);
        let uvs = self.optional("TEXCOORD_0", own(attributes.uv), 2)?;
        let normals = self.optional("NORMAL", attributes.normal, 3)?;
        let tangents = self.optional("TANGENT", own(attributes.tangent), 4)?;
        let count = positions.count;
        for (name, other) in [
            ("TEXCOORD_0", uvs.as_ref()),
            ("NORMAL", normals.as_ref()),
            ("TANGENT", tangents.as_ref()),
        ] {
            if let Some(other) = other.filter(|o| o.count != count) {
                return Err(
                    format!("{} elements of {name} for {count} positions", other.count).into(),
                );
            }
        }
        let mut triangles = self.triangles(primitive, mode, count, already)?;
        let used = compact(&mut triangles);
        let raw = Raw {
            positions: gather(&used, |i| Vec3::from(positions.numbers::<3>(i))),
            // glTF's v runs down, ours up.
            uvs: uvs
                .map(|uvs| {
                    gather(&used, |i| {
                        let [u, v] = uvs.numbers::<2>(i);
                        Vec2::new(u, 1.0 - v)
                    })
                })
                .unwrap_or_default(),
            normals: normals
                .map(|n| gather(&used, |i| Vec3::from(n.numbers::<3>(i))))
                .unwrap_or_default(),
            tangents: tangents
                .map(|t| gather(&used, |i| Vec4::from(t.numbers::<4>(i))))
                .unwrap_or_default(),
            triangles,
        };
        Ok(raw.complete(MissingNormals::Flat)?)
    }

    fn triangles(
        &self,
        primitive: &Primitive,
        mode: u32,
        vertices: usize,
        already: usize,
    ) -> Result<Vec<[u32; 3]>, Fault> {
        let indices = self.optional("indices", primitive.indices, 1)?;
        if indices.as_ref().is_some_and(|i| !i.is_index_type()) {
            return Err("its indices are not unsigned whole numbers"
                .to_owned()
                .into());
        }
        let corners = indices.as_ref().map_or(vertices, |i| i.count);
        let count = triangle_count(mode, corners);
        if mode == 4 && corners % 3 != 0 {
            return Err(format!("{corners} corners, which is no multiple of 3").into());
        }
        check_triangle_count(already.saturating_add(count))?;
        let corner = |at: usize| -> Result<u32, String> {
            let vertex = indices.as_ref().map_or(at as u32, |i| i.index(at));
            if (vertex as usize) < vertices {
                Ok(vertex)
            } else {
                Err(format!(
                    "corner {at} names vertex {vertex}, but there are {vertices}"
                ))
            }
        };
        (0..count)
            .map(|t| {
                let [a, b, c] = match mode {
                    4 => [3 * t, 3 * t + 1, 3 * t + 2],
                    5 => [t, t + 1 + t % 2, t + 2 - t % 2],
                    _ => [t + 1, t + 2, 0],
                };
                Ok([corner(a)?, corner(b)?, corner(c)?])
            })
            .collect()
    }

    fn optional(
        &self,
        what: &str,
        index: Option<usize>,
        width: usize,
    ) -> Result<Option<Elements<'_>>, String> {
        index.map(|i| self.elements(what, i, width)).transpose()
    }

    /// The accessor's elements, checked to be of `width` components and to lie inside their buffer.
    fn elements(&self, what: &str, index: usize, width: usize) -> Result<Elements<'_>, String> {
        let document = self.document;
        let accessor = document.accessors.get(index).ok_or_else(|| {
            let held = document.accessors.len();
            format!("{what} names accessor {index}, but the file has {held}")
        })?;
        let fault = |problem: String| format!("{what}, accessor {index}: {problem}");
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        if accessor.kind != kind {
            return Err(fault(format!("type {}; allowed: {kind}", accessor.kind)));
        }
        let component = ComponentType::from_code(accessor.component_type)
            .ok_or_else(|| fault(format!("component type {}", accessor.component_type)))?;
        let (None, Some(view)) = (&accessor.sparse, accessor.buffer_view) else {
            return Err(fault("sparse data, which is not read".to_owned()));
        };
        let view = document.buffer_views.get(view).ok_or_else(|| {
            fault(format!(
                "it names buffer view {view}, but the file has {}",
                document.buffer_views.len()
            ))
        })?;
        let size = component.size() * width;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(fault(format!(
                "a stride of {stride} bytes for elements of {size}"
            )));
        }
        let bytes = self
            .view_bytes(view, accessor, stride, size)
            .ok_or_else(|| {
                fault(format!(
                    "{} elements reach beyond their buffer",
                    accessor.count
                ))
            })?;
        Ok(Elements {
            bytes,
            stride,
            count: accessor.count,
            component,
            normalized: accessor.normalized,
        })
    }

    /// The bytes from the accessor's first element to the end of its last.
    fn view_bytes(
        &self,
        view: &BufferView,
        accessor: &Accessor,
        stride: usize,
        size: usize,
    ) -> Option<&[u8]> {
        let buffer = self.buffers.get(view.buffer)?;
        let view_end = view.byte_offset.checked_add(view.byte_length)?;
        let bytes = buffer.get(view.byte_offset..view_end)?;
        let length = match accessor.count.checked_sub(1) {
            Some(steps) => steps.checked_mul(stride)?.checked_add(size)?,
            None => 0,
        };
        bytes.get(accessor.byte_offset..accessor.byte_offset.checked_add(length)?)
    }
}

fn required(index: Option<usize>, name: &str) -> Result<usize, String> {
    index.ok_or_else(|| format!("it has no {name}"))
}

/// Renumbers the vertices in the order of their first use and returns the old numbers.
fn compact(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let mut used = Vec::new();
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    for vertex in triangles.as_flattened_mut() {
        *vertex = *numbers.entry(*vertex).or_insert_with(|| {
            used.push(*vertex);
            used.len() as u32 - 1
        });
    }
    used
}

fn gather<T>(used: &[u32], element: impl Fn(usize) -> T) -> Vec<T> {
    used.iter().map(|i| element(*i as usize)).collect()
}

#[cfg(test)]
mod tests;
