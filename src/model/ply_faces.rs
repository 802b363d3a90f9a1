//! The faces of a PLY file: polygons and triangle strips, by indices of vertices.

use glam::DVec3;

use super::error::ParseError;
use super::mesh::polygon::{fan, triangulate};
use super::ply_body::{Body, within};
use super::ply_header::{Element, PropertyKind};

/// Reads the faces of an element, and returns their number. `add` gets the indices of each, and refuses an index by
/// giving it back.
pub(super) fn read(
    body: &mut Body<'_>,
    element: &Element,
    add: &mut dyn FnMut(&[i64]) -> Result<(), i64>,
) -> Result<usize, ParseError> {
    let is_indices = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
    let mut indices = Vec::new();
    let mut polygons = 0;
    for row in 0..body.count(element)? {
        for property in &element.properties {
            let at = body.at;
            let located = |e: ParseError| within(e, element, row, &property.name);
            match property.kind {
                PropertyKind::List { count, item } if is_indices(&property.name) => {
                    body.indices(count, item, &mut indices).map_err(located)?;
                    add(&indices).map_err(|index| {
                        let found = format!("vertex index {index}");
                        located(body.fault(at, found, "the index of a vertex of this file, from 0"))
                    })?;
                    polygons += 1;
                }
                kind => body.skip(kind).map_err(located)?,
            }
        }
    }
    Ok(polygons)
}

/// True for an element whose lists are strips.
pub(super) fn are_strips(element: &Element) -> bool {
    element.name == "tristrips"
}

/// Collects triangles.
pub(super) struct Triangles<'a> {
    pub(super) corners: Vec<[u32; 3]>,
    /// Polygons that are cut into fans although they are not convex.
    pub(super) fans: usize,
    vertices: &'a [DVec3],
}

impl<'a> Triangles<'a> {
    pub(super) fn new(vertices: &'a [DVec3]) -> Self {
        Self { corners: Vec::new(), fans: 0, vertices }
    }

    /// Adds a polygon. One of fewer than three corners adds nothing.
    ///
    /// # Errors
    /// The first index that names no vertex.
    pub(super) fn add(&mut self, polygon: &[i64]) -> Result<(), i64> {
        if let &[a, b, c] = polygon {
            return self.push([a, b, c]);
        }
        let corners: Vec<u32> = polygon.iter().map(|&index| self.vertex(index)).collect::<Result<_, _>>()?;
        let positions: Vec<DVec3> = corners.iter().map(|&i| self.vertices[i as usize]).collect();
        let triangles = triangulate(&positions);
        self.fans += usize::from(triangles.is_none());
        let triangles = triangles.unwrap_or_else(|| fan(corners.len()));
        self.corners.extend(triangles.into_iter().map(|triangle| triangle.map(|k| corners[k])));
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
                    self.push(if odd % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
                }
            }
        }
        Ok(())
    }

    fn push(&mut self, [a, b, c]: [i64; 3]) -> Result<(), i64> {
        self.corners.push([self.vertex(a)?, self.vertex(b)?, self.vertex(c)?]);
        Ok(())
    }

    fn vertex(&self, index: i64) -> Result<u32, i64> {
        u32::try_from(index).ok().filter(|&i| (i as usize) < self.vertices.len()).ok_or(index)
    }
}
