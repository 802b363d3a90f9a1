//! Vertex normals of polygon meshes, for PLY and OBJ files whose vertices are taken as points.

use glam::{DVec3, Vec3};

/// Sums of polygon area vectors at the vertices.
///
/// The area vector of a polygon p0..pk is 1/2 sum (pi - p0) x (pi+1 - p0). Its length is the area, its direction the
/// normal of counter-clockwise order. The sum at a vertex, normalised, is the area-weighted normal.
pub(super) struct AreaNormals<'a> {
    positions: &'a [DVec3],
    sums: Vec<DVec3>,
}

impl<'a> AreaNormals<'a> {
    /// Starts without polygons.
    pub(super) fn new(positions: &'a [DVec3]) -> Self {
        Self { positions, sums: vec![DVec3::ZERO; positions.len()] }
    }

    /// Adds a polygon by its vertex indices. A polygon with fewer than three vertices, or with one that is not finite,
    /// adds nothing.
    ///
    /// # Errors
    /// The first index that names no vertex.
    pub(super) fn add(&mut self, polygon: &[i64]) -> Result<(), i64> {
        let mut area = DVec3::ZERO;
        let mut first_two: [Option<DVec3>; 2] = [None, None];
        for &index in polygon {
            let p = *usize::try_from(index).ok().and_then(|i| self.positions.get(i)).ok_or(index)?;
            match first_two {
                [Some(first), Some(previous)] => {
                    area += (previous - first).cross(p - first);
                    first_two[1] = Some(p);
                }
                [Some(_), None] => first_two[1] = Some(p),
                [None, _] => first_two[0] = Some(p),
            }
        }
        if area.is_finite() {
            for &index in polygon {
                if let Some(sum) = usize::try_from(index).ok().and_then(|i| self.sums.get_mut(i)) {
                    *sum += area;
                }
            }
        }
        Ok(())
    }

    /// Adds triangle strips. An index of -1 starts a new strip. Every other triangle of a strip is turned over.
    ///
    /// # Errors
    /// The first index that names no vertex.
    pub(super) fn add_strips(&mut self, strips: &[i64]) -> Result<(), i64> {
        for strip in strips.split(|&i| i == -1) {
            for (odd, corner) in strip.windows(3).enumerate() {
                if let &[a, b, c] = corner {
                    let turned = if odd % 2 == 0 { [a, b, c] } else { [b, a, c] };
                    self.add(&turned)?;
                }
            }
        }
        Ok(())
    }

    /// Unit normals. They are zero at vertices whose polygons have no area.
    pub(super) fn finish(self) -> Vec<Vec3> {
        self.sums.into_iter().map(|n| n.try_normalize().unwrap_or(DVec3::ZERO).as_vec3()).collect()
    }
}

/// Vertices below which a mesh is warned about: as points they show a blob, not the surface.
const FEW: usize = 1000;

/// What to say about a mesh whose vertices are too few to stand for its surface.
pub(super) fn too_few(vertices: usize, faces: usize) -> Option<String> {
    (vertices < FEW)
        .then(|| format!("{vertices} vertices for {faces} faces: faces are not drawn, so sample points on the mesh"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_faces_weigh_more() {
        // Two right triangles that share vertex 0: area 2 facing +z, area 1/2 facing +x.
        let p = [DVec3::ZERO, DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Y, DVec3::Z];
        let mut normals = AreaNormals::new(&p);
        normals.add(&[0, 1, 2]).unwrap();
        normals.add(&[0, 3, 4]).unwrap();
        assert_eq!(normals.add(&[0, 1, 5]), Err(5));
        assert_eq!(normals.add(&[0, 1, -2]), Err(-2));
        let n = normals.finish();
        assert!((n[0] - Vec3::new(1.0, 0.0, 4.0).normalize()).length() < 1e-6, "{}", n[0]);
        assert_eq!(n[1], Vec3::Z);
        assert_eq!(n[4], Vec3::X);
    }

    #[test]
    fn strips_alternate_and_restart() {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE - DVec3::Z, DVec3::Z];
        let mut normals = AreaNormals::new(&p);
        normals.add_strips(&[0, 1, 2, 3, -1, 0, 4]).unwrap();
        let n = normals.finish();
        assert_eq!(n[..4], [Vec3::Z; 4]);
        assert_eq!(n[4], Vec3::ZERO);
    }
}
