//! Normals of meshes whose file has none: smooth within a surface, broken at its creases.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::Mesh;

/// Cosine of the angle between two triangles above which the edge between them is a crease: 40 degrees.
const CREASE: f64 = 0.766_044_443_118_978;

/// Most triangles around a corner that are compared pair by pair. Where there are more, all keep their own normals.
const MOST_AROUND: usize = 64;

/// A corner of a triangle, at its place.
#[derive(Clone, Copy)]
struct Corner {
    triangle: u32,
    /// 0, 1 or 2.
    number: usize,
    /// Angle of the triangle there, radians.
    angle: f64,
}

/// Gives a mesh without normals those of its triangles. At each corner a triangle has the mean of the triangles around
/// the corner that turn from it by less than a crease does, each weighted by its angle there (Thürmer and Wüthrich
/// 1998). Vertices at one place hang together, whatever else they have. A vertex whose triangles need several normals
/// is split.
pub(super) fn smooth(mesh: &mut Mesh) {
    if !mesh.normal.is_empty() || mesh.triangles.is_empty() {
        return;
    }
    let faces: Vec<DVec3> = mesh.triangles.iter().map(|triangle| face(mesh, triangle.corners)).collect();
    let around = corners(mesh);
    let mut normals = vec![[Vec3::ZERO; 3]; faces.len()];
    for corners in around.values().filter(|corners| corners.len() <= MOST_AROUND) {
        for corner in corners {
            let own = faces[corner.triangle as usize];
            let beside = corners.iter().filter(|other| faces[other.triangle as usize].dot(own) >= CREASE);
            let sum: DVec3 = beside.map(|other| faces[other.triangle as usize] * other.angle).sum();
            normals[corner.triangle as usize][corner.number] = sum.normalize_or_zero().as_vec3();
        }
    }
    write(mesh, &faces, &normals);
}

/// The unit normal of a triangle by its winding; 0 where it has no area.
fn face(mesh: &Mesh, corners: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|corner| mesh.position[corner as usize]);
    // A factor before the cross product keeps large coordinates in range.
    let [u, v] = [b - a, c - a].map(DVec3::normalize_or_zero);
    u.cross(v).normalize_or_zero()
}

/// The corners at each place, in the order of the triangles.
fn corners(mesh: &Mesh) -> HashMap<[u64; 3], Vec<Corner>> {
    let mut around: HashMap<[u64; 3], Vec<Corner>> = HashMap::new();
    for (triangle, index) in mesh.triangles.iter().zip(0..) {
        let places = triangle.corners.map(|corner| mesh.position[corner as usize]);
        for number in 0..3 {
            let [here, next, last] = [0, 1, 2].map(|step| places[(number + step) % 3]);
            let angle = (next - here).angle_between(last - here);
            let corner = Corner { triangle: index, number, angle: if angle.is_finite() { angle } else { 0.0 } };
            // Zero has two signs.
            let place = (here + 0.0).to_array().map(f64::to_bits);
            around.entry(place).or_default().push(corner);
        }
    }
    around
}

/// Writes a normal for each corner, and splits the vertices that need several.
fn write(mesh: &mut Mesh, faces: &[DVec3], normals: &[[Vec3; 3]]) {
    mesh.normal = vec![Vec3::ZERO; mesh.position.len()];
    let mut split: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    for index in 0..mesh.triangles.len() {
        for number in 0..3 {
            let vertex = mesh.triangles[index].corners[number];
            let smooth = normals[index][number];
            let normal = if smooth == Vec3::ZERO { faces[index].as_vec3() } else { smooth };
            let has = mesh.normal[vertex as usize];
            if has == Vec3::ZERO {
                mesh.normal[vertex as usize] = normal;
            } else if has != normal {
                let key = (vertex, normal.to_array().map(f32::to_bits));
                let new = *split.entry(key).or_insert_with(|| copy_of(mesh, vertex, normal));
                mesh.triangles[index].corners[number] = new;
            }
        }
    }
}

/// Adds a vertex like `vertex` with another normal. It stays the same where indices have no room for more.
fn copy_of(mesh: &mut Mesh, vertex: u32, normal: Vec3) -> u32 {
    let Ok(new) = u32::try_from(mesh.position.len()) else { return vertex };
    let from = vertex as usize;
    mesh.position.push(mesh.position[from]);
    mesh.normal.push(normal);
    if let Some(&uv) = mesh.uv.get(from) {
        mesh.uv.push(uv);
    }
    if let Some(&colour) = mesh.colour.get(from) {
        mesh.colour.push(colour);
    }
    new
}

#[cfg(test)]
mod tests {
    use super::super::Triangle;
    use super::*;

    fn mesh(position: Vec<DVec3>, triangles: &[[u32; 3]]) -> Mesh {
        let triangles = triangles.iter().map(|&corners| Triangle { corners, material: 0 }).collect();
        let mut mesh = Mesh { position, triangles, ..Mesh::default() };
        smooth(&mut mesh);
        mesh
    }

    /// Two squares that share an edge, the second turned by `angle` degrees about it. Returns the normals of the four
    /// corners of the first triangle and of the last.
    fn hinge(angle: f64) -> [[Vec3; 3]; 2] {
        let (sin, cos) = angle.to_radians().sin_cos();
        let position = vec![
            DVec3::new(-1.0, 0.0, 0.0),
            DVec3::new(0.0, 0.0, 0.0),
            DVec3::new(0.0, 1.0, 0.0),
            DVec3::new(-1.0, 1.0, 0.0),
            DVec3::new(cos, 0.0, -sin),
            DVec3::new(cos, 1.0, -sin),
        ];
        let mesh = mesh(position, &[[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]);
        let of = |i: usize| mesh.triangles[i].corners.map(|corner| mesh.normal[corner as usize]);
        [of(0), of(2)]
    }

    #[test]
    fn normals_are_smooth_below_a_crease_and_broken_above() {
        let [first, second] = hinge(39.0);
        // Across the edge, halfway; away from it, that of the plane.
        let half = 19.5_f64.to_radians();
        let middle = Vec3::new(half.sin() as f32, 0.0, half.cos() as f32);
        assert!((first[0] - Vec3::Z).length() < 1e-6, "{first:?}");
        assert!((first[1] - middle).length() < 1e-6 && (first[1] - second[0]).length() < 1e-6, "{first:?} {second:?}");
        assert!((first[1] - Vec3::Z).length() > 0.1);
        let [first, second] = hinge(41.0);
        let (sin, cos) = 41.0_f64.to_radians().sin_cos();
        let turned = Vec3::new(sin as f32, 0.0, cos as f32);
        assert!(first.iter().all(|n| (*n - Vec3::Z).length() < 1e-6), "{first:?}");
        assert!(second.iter().all(|n| (*n - turned).length() < 1e-6), "{second:?}");
    }

    /// Many triangles around one point keep their own normals, in little time; triangles without an area do no harm.
    #[test]
    fn fans_and_slivers_end() {
        let n = 100_000;
        let rim = (0..=n).map(|i| {
            let (sin, cos) = (f64::from(i) / f64::from(n) * 6.0).sin_cos();
            DVec3::new(cos, sin, 0.1 * f64::from(i % 2))
        });
        let position: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain(rim).collect();
        let mut triangles: Vec<[u32; 3]> = (1..n).map(|i| [0, i, i + 1]).collect();
        triangles.push([3, 3, 3]);
        let mesh = mesh(position, &triangles);
        assert_eq!(mesh.normal.len(), mesh.position.len());
        assert!(mesh.normal.iter().all(|n| n.is_finite()));
    }
}
