//! What a pen over the 3D picture points at.

use crate::error::Result;
use crate::map::Size;
use crate::mesh::Body;
use crate::raster::{Camera, View};
use glam::{Vec2, Vec3};

/// Where a line of sight meets a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The place.
    pub position: Vec3,
    /// The surface's unit normal there, on the side that is seen.
    pub normal: Vec3,
    /// Texture coordinates, v up.
    pub uv: Vec2,
    /// How long a pixel is there, in the mesh's units.
    pub pixel: f32,
}

/// The nearest place of a mesh that is seen at `place`, in pixels from the upper left corner of a picture of `size`; from
/// whichever side. `None` past the mesh.
///
/// # Errors
/// When the camera's numbers are not allowed.
pub fn pick(body: &Body, camera: &Camera, size: Size, place: Vec2) -> Result<Option<Hit>> {
    let view = View::new(camera, size)?;
    let within = |x: f32, most: u32| f64::from(x).clamp(0.0, f64::from(most));
    let (x, y) = (
        within(place.x, size.width()),
        within(place.y, size.height()),
    );
    let ray = view.ray_at(x, y);
    let Some(met) = body.first_met(ray.0, ray.1) else {
        return Ok(None);
    };
    let mesh = body.mesh();
    let [i, j, k] = mesh.triangles[met.triangle as usize].map(|i| i as usize);
    let [a, b, c] = met.weights;
    let normal = mesh.normals[i] * a + mesh.normals[j] * b + mesh.normals[k] * c;
    let normal = normal.normalize_or(-ray.1);
    let position = ray.0 + ray.1 * met.distance;
    let beside = view.ray_at(x + 1.0, y);
    let pixel = position.distance(beside.0 + beside.1 * met.distance);
    Ok(Some(Hit {
        position,
        normal: if normal.dot(ray.1) > 0.0 {
            -normal
        } else {
            normal
        },
        uv: mesh.uvs[i] * a + mesh.uvs[j] * b + mesh.uvs[k] * c,
        pixel,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh;
    use crate::preview::Scene;

    #[test]
    fn the_nearest_side_is_met_where_the_eye_sees_it() {
        let grown = |mesh| Body::new(std::sync::Arc::new(mesh)).unwrap();
        let sphere = grown(mesh::sphere());
        let plane = grown(mesh::plane());
        let camera = Scene::for_mesh(sphere.mesh()).camera;
        let size = Size::new(200, 100).unwrap();
        let hit = pick(&sphere, &camera, size, Vec2::new(100.0, 50.0));
        let hit = hit.unwrap().unwrap();
        let toward = (camera.eye - hit.position).normalize();
        assert!(hit.normal.dot(toward) > 0.99, "{hit:?}");
        assert!(hit.position.distance(camera.eye) < camera.target.distance(camera.eye));
        // A hundred pixels hold the sphere, whose radius is 1.1 times less than half of them.
        assert!((0.5..2.0).contains(&(hit.pixel * 45.0)), "{}", hit.pixel);
        // A slow pen draws a straight line: places lie finer than pixels.
        let places: Vec<Vec3> = (0..20)
            .map(|i| Vec2::new(100.0 - 0.3 * i as f32, 50.0 - 1.1 * i as f32))
            .filter_map(|place| pick(&plane, &camera, size, place).unwrap())
            .map(|hit| hit.position)
            .collect();
        assert!(places.len() > 5);
        let line = (places[places.len() - 1] - places[0]).normalize();
        for pair in places.windows(2) {
            let off = (pair[1] - pair[0]).angle_between(line).to_degrees();
            assert!(off < 0.1, "{off} degrees");
        }
        let past = pick(&sphere, &camera, size, Vec2::new(1.0, 1.0)).unwrap();
        assert_eq!(past, None);
        let outside = pick(&sphere, &camera, size, Vec2::new(-50.0, 1e9)).unwrap();
        assert_eq!(outside, None);
    }
}
