//! What a file gives, and how it becomes a whole mesh: unusable triangles out, missing normals and tangents made.

use super::{MAX_TRIANGLES, Mesh, derivatives, tangents};
use crate::math;
use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Largest coordinate of a position: areas and lengths of it stay far from the end of f32.
const MAX_COORDINATE: f32 = 1e9;
/// Largest texture coordinate; beyond it f32 no longer tells texels of one turn apart.
const MAX_UV: f32 = 1e5;

/// Triangles whose normals stand farther apart meet in a sharp edge, where a file leaves normals out.
pub(super) const SHARP_DEGREES: f32 = 60.0;
/// Where more triangles than this meet, all of them count: looking at each pair of them would take long.
const FAN_MAX: usize = 256;

/// Normals that a file leaves out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum MissingNormals {
    /// One for each triangle, as glTF 2.0 section 3.7.2.1 demands.
    Flat,
    /// At each position the mean of its triangles' normals, weighted by their angles there (Thürmer and Wüthrich 1998): the
    /// same however the faces are cut into triangles. Of each triangle's neighbours those count that stand within
    /// [`SHARP_DEGREES`] of it, so that edges which turn by more are sharp.
    Creased,
}

/// Triangles as a file gives them; indices already checked against the vertices.
pub(super) struct Raw {
    pub(super) positions: Vec<Vec3>,
    /// One a vertex, or empty where a projection is to make them.
    pub(super) uvs: Vec<Vec2>,
    /// Empty, or one a vertex.
    pub(super) normals: Vec<Vec3>,
    /// Empty, or one a vertex.
    pub(super) tangents: Vec<Vec4>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Raw {
    /// A mesh without a name that keeps what [`Mesh::validate`] asks for, except that it may be empty.
    ///
    /// # Errors
    /// What is wrong with the numbers, as a clause.
    pub(super) fn complete(mut self, missing: MissingNormals) -> Result<Mesh, String> {
        self.check()?;
        self.drop_empty_triangles();
        if self.normals.is_empty() && missing == MissingNormals::Flat {
            self.make_flat();
        } else {
            if missing == MissingNormals::Creased {
                self.make_creased();
            }
            self.make_smooth();
        }
        let given = std::mem::take(&mut self.tangents);
        if self.uvs.is_empty() {
            let count = self.positions.len();
            return Ok(Mesh {
                positions: self.positions,
                normals: self.normals,
                tangents: vec![Vec4::W; count],
                uvs: vec![Vec2::ZERO; count],
                triangles: self.triangles,
                ..Mesh::empty("", 1.0)
            });
        }
        let mut mesh = Mesh {
            positions: self.positions,
            normals: self.normals,
            tangents: given,
            uvs: self.uvs,
            triangles: self.triangles,
            ..Mesh::empty("", 1.0)
        };
        if mesh.tangents.is_empty() {
            tangents::generate(&mut mesh)?;
        } else {
            tangents::tidy(&mut mesh);
        }
        Ok(mesh)
    }

    fn check(&self) -> Result<(), String> {
        let far = |x: f32, limit: f32| !x.is_finite() || x.abs() > limit;
        if let Some(i) = self
            .positions
            .iter()
            .position(|p| p.to_array().iter().any(|x| far(*x, MAX_COORDINATE)))
        {
            let p = self.positions[i];
            return Err(format!(
                "vertex {i} lies at {p}; allowed: finite numbers up to {MAX_COORDINATE:e}"
            ));
        }
        if let Some(i) = self
            .uvs
            .iter()
            .position(|uv| uv.to_array().iter().any(|x| far(*x, MAX_UV)))
        {
            let uv = self.uvs[i];
            return Err(format!(
                "vertex {i} has the texture coordinates {uv}; allowed: finite numbers up to {MAX_UV:e}"
            ));
        }
        Ok(())
    }

    /// Leaves out triangles two corners of which are at one place: they cover nothing, and the tangent generator's time grows
    /// with the square of their number.
    fn drop_empty_triangles(&mut self) {
        let positions = &self.positions;
        self.triangles.retain(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            a != b && b != c && c != a
        });
    }

    /// Gives every triangle vertices and a normal of its own. Tangents of the file are dropped with the shared vertices, as
    /// glTF 2.0 demands.
    fn make_flat(&mut self) {
        let corners: Vec<u32> = self.triangles.as_flattened().to_vec();
        let normals = self.triangles.iter().flat_map(|t| {
            let n = direction(area_vector(t.map(|i| self.positions[i as usize])));
            [n; 3]
        });
        self.normals = normals.collect();
        self.positions = pick(&self.positions, &corners);
        if !self.uvs.is_empty() {
            self.uvs = pick(&self.uvs, &corners);
        }
        self.tangents.clear();
        self.triangles = (0..corners.len() as u32 / 3)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
    }

    /// Makes the normals that are missing, of each triangle's corner its own: a vertex whose corners have several becomes as many.
    /// Tangents, of which there are none yet where normals are missing, are left out.
    fn make_creased(&mut self) {
        self.normals.resize(self.positions.len(), Vec3::ZERO);
        let lacks: Vec<bool> = self.normals.iter().map(|n| !is_usable(n)).collect();
        if !lacks.contains(&true) {
            return;
        }
        self.tangents.clear();
        let fans = Fans::of(&self.positions, &self.triangles);
        let mut made: Vec<Option<Vec3>> = vec![None; self.positions.len()];
        let mut others: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        for n in 0..self.triangles.len() {
            for k in 0..3 {
                let vertex = self.triangles[n][k];
                if !lacks[vertex as usize] {
                    continue;
                }
                let normal = fans.normal(n as u32, vertex);
                let first = made[vertex as usize].get_or_insert(normal);
                if *first == normal {
                    self.normals[vertex as usize] = normal;
                    continue;
                }
                let bits = normal.to_array().map(f32::to_bits);
                let other = *others.entry((vertex, bits)).or_insert_with(|| {
                    self.positions.push(self.positions[vertex as usize]);
                    if let Some(uv) = self.uvs.get(vertex as usize).copied() {
                        self.uvs.push(uv);
                    }
                    self.normals.push(normal);
                    self.normals.len() as u32 - 1
                });
                self.triangles[n][k] = other;
            }
        }
    }

    /// Normalises the file's normals and makes those that are missing or have no direction.
    fn make_smooth(&mut self) {
        if self.normals.is_empty() || !self.normals.iter().all(is_usable) {
            let made = self.smooth_normals();
            self.normals.resize(made.len(), Vec3::ZERO);
            for (normal, made) in self.normals.iter_mut().zip(made) {
                if !is_usable(normal) {
                    *normal = made;
                }
            }
        }
        for normal in &mut self.normals {
            *normal = direction(*normal);
        }
    }

    fn smooth_normals(&self) -> Vec<Vec3> {
        let key = |p: Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let mut sums: HashMap<[u32; 3], Vec3> = HashMap::with_capacity(self.positions.len());
        for triangle in &self.triangles {
            let corners = triangle.map(|i| self.positions[i as usize]);
            let normal = area_vector(corners).normalize_or_zero();
            for k in 0..3 {
                let [at, next, last] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
                let (a, b) = (next - at, last - at);
                let angle = math::atan2(a.cross(b).length(), a.dot(b));
                *sums.entry(key(at)).or_default() += normal * angle;
            }
        }
        self.positions
            .iter()
            .map(|p| sums.get(&key(*p)).copied().unwrap_or_default())
            .collect()
    }
}

fn is_usable(normal: &Vec3) -> bool {
    normal.is_finite() && normal.try_normalize().is_some()
}

/// The triangles that meet at each place.
struct Fans {
    /// For each vertex the number of its place.
    places: Vec<u32>,
    /// Where each place's triangles begin in the list, and where the last ones end.
    starts: Vec<u32>,
    /// Triangles, each with its angle at the place, in their order.
    around: Vec<(u32, f32)>,
    normals: Vec<Vec3>,
    /// The normals of the places at which all triangles count.
    whole: HashMap<u32, Vec3>,
}

impl Fans {
    fn of(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
        let mut place = |p: &Vec3| {
            let next = numbers.len() as u32;
            let key = p.to_array().map(|x| (x + 0.0).to_bits());
            *numbers.entry(key).or_insert(next)
        };
        let places: Vec<u32> = positions.iter().map(&mut place).collect();
        let mut starts = vec![0u32; numbers.len() + 1];
        for i in triangles.as_flattened() {
            starts[places[*i as usize] as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut around = vec![(0, 0.0); triangles.len() * 3];
        let mut normals = Vec::with_capacity(triangles.len());
        for (n, triangle) in (0..).zip(triangles) {
            let corners = triangle.map(|i| positions[i as usize]);
            normals.push(area_vector(corners).normalize_or_zero());
            for k in 0..3 {
                let [at, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
                let (b, c) = (b - at, c - at);
                let angle = math::atan2(b.cross(c).length(), b.dot(c));
                let to = &mut next[places[triangle[k] as usize] as usize];
                around[*to as usize] = (n, angle);
                *to += 1;
            }
        }
        let mut fans = Self {
            places,
            starts,
            around,
            normals,
            whole: HashMap::new(),
        };
        for place in 0..fans.starts.len() as u32 - 1 {
            if fans.around(place).len() > FAN_MAX {
                fans.whole.insert(place, fans.mean(place, |_| true));
            }
        }
        fans
    }

    /// The triangles of a place.
    fn around(&self, place: u32) -> &[(u32, f32)] {
        let place = place as usize;
        &self.around[self.starts[place] as usize..self.starts[place + 1] as usize]
    }

    /// The mean of the normals that count at a place.
    fn mean(&self, place: u32, counts: impl Fn(Vec3) -> bool) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (triangle, angle) in self.around(place) {
            let normal = self.normals[*triangle as usize];
            if counts(normal) {
                sum += normal * *angle;
            }
        }
        direction(sum)
    }

    /// The normal of a triangle's corner at a vertex: the same bits for all triangles that count the same others.
    fn normal(&self, triangle: u32, vertex: u32) -> Vec3 {
        let place = self.places[vertex as usize];
        if let Some(normal) = self.whole.get(&place) {
            return *normal;
        }
        let own = self.normals[triangle as usize];
        let least = if own == Vec3::ZERO {
            -2.0
        } else {
            SHARP_DEGREES.to_radians().cos()
        };
        self.mean(place, |normal| own.dot(normal) >= least)
    }
}

/// Normal of a triangle, as long as twice its area.
fn area_vector([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}

/// Unit length; up where there is no direction, which happens only where no surface is to be seen.
fn direction(v: Vec3) -> Vec3 {
    v.try_normalize().unwrap_or(Vec3::Y)
}

fn pick<T: Copy>(from: &[T], indices: &[u32]) -> Vec<T> {
    indices.iter().map(|i| from[*i as usize]).collect()
}

impl Mesh {
    /// Adds a part, placed by `place`. A mirroring placement turns the triangles and the tangents' w around; one that
    /// flattens the part adds nothing.
    ///
    /// # Errors
    /// What is wrong, as a clause: too many triangles, a place too far away.
    pub(super) fn append(&mut self, part: &Mesh, place: Mat4) -> Result<(), Fault> {
        let linear = Mat3::from_mat4(place);
        let determinant = linear.determinant();
        if !place.is_finite() {
            return Err("its node's transform is not finite".to_owned().into());
        }
        if determinant.abs() < f32::MIN_POSITIVE {
            return Ok(());
        }
        check_triangle_count(self.triangles.len() + part.triangles.len())?;
        let turn = determinant.signum();
        // The inverse transpose up to a factor: the cofactors, turned outward again by the determinant's sign.
        let normal_matrix = Mat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        ) * turn;
        let first = self.positions.len() as u32;
        for i in 0..part.positions.len() {
            let position = place.transform_point3(part.positions[i]);
            if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
                return Err(format!("its node's transform takes a vertex to {position}").into());
            }
            let normal = direction(normal_matrix * part.normals[i]);
            let given = part.tangents[i];
            let along = (linear * given.truncate()).extend(given.w * turn);
            self.positions.push(position);
            self.normals.push(normal);
            self.tangents.push(tangents::fitted(normal, along));
            self.uvs.push(part.uvs[i]);
        }
        self.triangles.extend(part.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| i + first);
            if turn < 0.0 { [a, c, b] } else { [a, b, c] }
        }));
        Ok(())
    }

    /// Sets `aspect` to the area-weighted geometric mean of |dP/du| / |dP/dv|: exact for a layout of one scale, and twice as
    /// wide weighs as much as twice as high. 1 for a layout without area.
    pub(super) fn measure_aspect(&mut self) {
        let (mut sum, mut weight) = (0.0f64, 0.0f64);
        for triangle in &self.triangles {
            let corners = self.corners(*triangle);
            let Some((du, dv)) = derivatives(corners, self.corner_uvs(*triangle)) else {
                continue;
            };
            let ratio = f64::from(du.length()) / f64::from(dv.length());
            let area = f64::from(area_vector(corners).length());
            if ratio.is_finite() && ratio > 0.0 {
                sum += area * ratio.ln();
                weight += area;
            }
        }
        self.aspect = if weight > 0.0 {
            (sum / weight).exp().clamp(1e-4, 1e4) as f32
        } else {
            1.0
        };
    }
}

/// What is wrong with a mesh, as a clause, and what to do about it where that is not for the format to say.
pub(super) struct Fault {
    pub(super) problem: String,
    pub(super) hint: Option<&'static str>,
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Self {
            problem,
            hint: None,
        }
    }
}

/// # Errors
/// Names the limit.
pub(super) fn check_triangle_count(count: usize) -> Result<(), Fault> {
    if count > MAX_TRIANGLES {
        return Err(Fault {
            problem: format!("it has more than {MAX_TRIANGLES} triangles, the most that are read"),
            hint: Some("Decimate the mesh in a modelling program"),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cone of so many sides, whose triangles meet in the first vertex; steep enough that opposite sides are a sharp edge.
    fn cone(sides: u32) -> Raw {
        let rim = |n: u32| {
            let (sin, cos) = math::sin_cos(std::f32::consts::TAU * n as f32 / sides as f32);
            Vec3::new(cos, sin, -1.0)
        };
        Raw {
            positions: std::iter::once(Vec3::ZERO)
                .chain((0..sides).map(rim))
                .collect(),
            uvs: Vec::new(),
            normals: Vec::new(),
            tangents: Vec::new(),
            triangles: (0..sides)
                .map(|n| [0, 1 + n, 1 + (n + 1) % sides])
                .collect(),
        }
    }

    #[test]
    fn where_very_many_triangles_meet_their_normal_is_made_once() {
        let sides = 300_000;
        let cone_of_many = cone(sides);
        let fans = Fans::of(&cone_of_many.positions, &cone_of_many.triangles);
        assert_eq!(fans.whole.len(), 1, "that of the tip");
        let all = fans.mean(0, |_| true);
        assert!((0..sides).all(|n| fans.normal(n, 0) == all));
        let mesh = cone_of_many.complete(MissingNormals::Creased).unwrap();
        assert_eq!(mesh.positions.len(), sides as usize + 1);
        assert!(mesh.normals[0].z > 0.99, "{}", mesh.normals[0]);
        // Of few sides, those beyond a sharp edge do not count.
        let few = cone(16);
        assert!(Fans::of(&few.positions, &few.triangles).whole.is_empty());
        let mesh = few.complete(MissingNormals::Creased).unwrap();
        assert_eq!(mesh.positions.len(), 32, "a tip for each side");
    }
}
