//! Wavefront OBJ: polygons with texture coordinates, v up as ours. Objects and groups are merged; materials, lines, points
//! and curves are left alone.
//!
//! A reader of our own because the `tobj` crate multiplies a face's numbers before it checks them: a wild one panics in a
//! checked build and reads another vertex's coordinates in a release build. This one also names the line.

use super::gltf::NO_UVS_HINT;
use super::raw::{Fault, MissingNormals, Raw, check_triangle_count};
use super::{Mesh, Projection};
use crate::error::{Error, Result};
use glam::{Mat4, Vec2, Vec3};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// Reads the bytes of an OBJ file; `path` only names it in messages.
///
/// # Errors
/// [`Error::File`], as [`super::load`] says.
pub(super) fn parse(path: &Path, bytes: &[u8], projection: Option<Projection>) -> Result<Mesh> {
    let mut reader = Reader {
        without_uvs: projection.is_some(),
        ..Reader::default()
    };
    for (number, line) in logical_lines(bytes) {
        reader.line(&line).map_err(|fault| {
            Error::file(path, format!("line {number}: {}", fault.problem))
                .with_hint(fault.hint.unwrap_or("Export the mesh again"))
        })?;
    }
    let whole = |problem: String| Error::file(path, problem);
    let mut mesh = Mesh::empty("", 1.0);
    reader
        .into_raw()
        .complete(MissingNormals::Creased)
        .map_err(whole)
        .and_then(|part| {
            let appended = mesh.append(&part, Mat4::IDENTITY);
            appended.map_err(|fault| whole(fault.problem))
        })?;
    if mesh.triangles.is_empty() {
        return Err(whole("it has no faces with an area".to_owned()));
    }
    match projection {
        Some(projection) => projection.lay(&mut mesh),
        None => mesh.measure_aspect(),
    }
    Ok(mesh)
}

/// A face of more bytes than this is not joined from further lines when it is only counted.
const LINE_MAX: usize = 1 << 20;

/// How many triangles the lines of an OBJ file make, and whether all have texture coordinates.
pub(super) fn about(
    lines: impl Iterator<Item = std::io::Result<Vec<u8>>>,
) -> std::io::Result<(usize, bool)> {
    let (mut triangles, mut has_uvs) = (0usize, true);
    let mut begun = Vec::new();
    for line in lines {
        begun.extend(line?);
        let whole = begun.trim_ascii_end().len();
        if begun[..whole].ends_with(b"\\") && whole < LINE_MAX {
            begun.truncate(whole - 1); // it goes on in the next
            begun.push(b' ');
            continue;
        }
        let line = std::mem::take(&mut begun);
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty());
        if words.next() != Some(b"f".as_slice()) {
            continue;
        }
        let mut corners = 0usize;
        for word in words.take_while(|w| w[0] != b'#') {
            corners += 1;
            let uv = word.split(|b| *b == b'/').nth(1);
            has_uvs &= uv.is_some_and(|uv| !uv.is_empty());
        }
        triangles = triangles.saturating_add(corners.saturating_sub(2));
    }
    Ok((triangles, has_uvs))
}

/// Lines with the number of their first, joined where one ends in a backslash. Bytes that are no UTF-8 are replaced: they
/// occur in names and comments.
fn logical_lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = bytes.split(|b| *b == b'\n').enumerate();
    std::iter::from_fn(move || {
        let (index, first) = lines.next()?;
        let mut text = String::from_utf8_lossy(first);
        while text.trim_end().ends_with('\\') {
            let Some((_, next)) = lines.next() else { break };
            let begun = text.trim_end().len() - 1;
            let joined = text.to_mut();
            joined.truncate(begun);
            joined.push(' ');
            joined.push_str(&String::from_utf8_lossy(next));
        }
        Some((index + 1, text))
    })
}

/// What the lines so far have given.
#[derive(Default)]
struct Reader {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Vertices in the order of their first use: numbers of position, texture coordinates and normal.
    vertices: Vec<Corner>,
    numbers: HashMap<Corner, u32>,
    /// Whether texture coordinates are left out.
    without_uvs: bool,
    triangles: Vec<[u32; 3]>,
}

/// Indices of a position, texture coordinates and, where the face has one, a normal.
type Corner = (usize, usize, Option<usize>);

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), Fault> {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self
                .positions
                .push(Vec3::from(coordinates::<3>("v", words)?)),
            Some("vn") => self
                .normals
                .push(Vec3::from(coordinates::<3>("vn", words)?)),
            // A one-dimensional texture has no second number.
            Some("vt") => self.uvs.push(match words.clone().count() {
                1 => Vec2::new(coordinates::<1>("vt", words)?[0], 0.0),
                _ => Vec2::from(coordinates::<2>("vt", words)?),
            }),
            Some("f") => self.face(words)?,
            _ => {}
        }
        Ok(())
    }

    /// A polygon, cut into triangles that meet in its first corner.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), Fault> {
        let mut corners = Vec::new();
        for word in words {
            corners.push(self.corner(word)?);
        }
        if corners.len() < 3 {
            return Err(format!("a face of {} corners; allowed: 3 or more", corners.len()).into());
        }
        for pair in corners[1..].windows(2) {
            self.triangles.push([corners[0], pair[0], pair[1]]);
        }
        check_triangle_count(self.triangles.len())
    }

    /// The vertex that `position/uv/normal` means.
    fn corner(&mut self, word: &str) -> Result<u32, Fault> {
        let mut parts = word.split('/');
        let mut part = |count: usize, what: &str| {
            let text = parts.next().filter(|t| !t.is_empty());
            text.map(|t| index(t, count, what)).transpose()
        };
        let position = part(self.positions.len(), "position (`v`)")?;
        let uv = part(self.uvs.len(), "texture coordinates (`vt`)")?;
        let normal = part(self.normals.len(), "normal (`vn`)")?;
        let position = position.ok_or_else(|| format!("`{word}` names no position"))?;
        let uv = if self.without_uvs { Some(0) } else { uv };
        let uv = uv.ok_or_else(|| Fault {
            problem: "the face has no texture coordinates (`vt`), so no map can be placed on it"
                .to_owned(),
            hint: Some(NO_UVS_HINT),
        })?;
        let corner = (position, uv, normal);
        Ok(*self.numbers.entry(corner).or_insert_with(|| {
            self.vertices.push(corner);
            self.vertices.len() as u32 - 1
        }))
    }

    fn into_raw(self) -> Raw {
        let normal = |n: Option<usize>| n.map_or(Vec3::ZERO, |n| self.normals[n]);
        Raw {
            positions: self.vertices.iter().map(|v| self.positions[v.0]).collect(),
            uvs: match self.without_uvs {
                true => Vec::new(),
                false => self.vertices.iter().map(|v| self.uvs[v.1]).collect(),
            },
            normals: self.vertices.iter().map(|v| normal(v.2)).collect(),
            tangents: Vec::new(),
            triangles: self.triangles,
        }
    }
}

/// The first N numbers of a line; further ones (a weight, a colour) are not read.
fn coordinates<'a, const N: usize>(
    what: &str,
    mut words: impl Iterator<Item = &'a str>,
) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        let word = words
            .next()
            .ok_or_else(|| format!("`{what}` needs {N} numbers"))?;
        let value: Option<f32> = word.parse().ok();
        *number = value
            .filter(|x| x.is_finite())
            .ok_or_else(|| format!("`{what}`: `{word}` is no finite number"))?;
    }
    Ok(numbers)
}

/// An index into `count` things so far, counted from 1, or backward from -1.
fn index(text: &str, count: usize, what: &str) -> Result<usize, String> {
    let number: i64 = text
        .parse()
        .map_err(|_| format!("`{text}` is no whole number"))?;
    let at = if number < 0 {
        i64::try_from(count)
            .ok()
            .and_then(|c| c.checked_add(number))
    } else {
        number.checked_sub(1)
    };
    at.and_then(|at| usize::try_from(at).ok())
        .filter(|at| *at < count)
        .ok_or_else(|| format!("the face names {what} {number}, but there are {count} so far"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_triangles_are_told_to_be_fewer() {
        let mut reader = Reader {
            triangles: vec![[0; 3]; crate::mesh::MAX_TRIANGLES],
            ..Reader::default()
        };
        for line in ["v 0 0 0", "vt 0 0"] {
            assert!(reader.line(line).is_ok());
        }
        let fault = reader.line("f 1/1 1/1 1/1").err().unwrap();
        assert!(fault.hint.is_some_and(|h| h.contains("Decimate")));
    }
}
