//! Meshes of Wavefront OBJ files, with their materials.
//!
//! The reader is our own: it says in which line a file is wrong, and keeps positions in `f64`. (The crate `tobj` names
//! no lines, and stops the program on a short `Kd`.) Statements that matter: `v x y z [w] [r g b]`, `vt`, `vn`, `f`,
//! `usemtl` and `mtllib`. Vertex colours are sRGB. A format without sides shows both.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::mtl::Library;
use super::polygon::{fan, fans, triangulate};
use super::smooth::smooth;
use super::{Mesh, MeshMaterial, Triangle};
use crate::math::srgb;
use crate::model::cloud::PLAIN;
use crate::model::error::{ParseError, quote};
use crate::model::obj::{numbers, statements};

/// Largest coordinate. Its square is far from the largest number.
const FAR: f64 = 1e30;

/// Most notes about materials that are not there.
const MOST_NOTES: usize = 20;

/// Reads the faces of a file; `None` where it has none. Other files lie beside `path`.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Option<Mesh>, ParseError> {
    if !statements(bytes).any(|(_, words)| words.first() == Some(&b"f".as_slice())) {
        return Ok(None);
    }
    let mut reader = Reader {
        library: Library::new(path, bytes.len()),
        mesh: Mesh { materials: vec![MeshMaterial { two_sided: true, ..MeshMaterial::default() }], ..Mesh::default() },
        position: Vec::new(),
        colour: Vec::new(),
        uv: Vec::new(),
        normal: Vec::new(),
        known: HashMap::new(),
        material: 0,
        columns: [false; 3],
        ignored: 0,
        concave: 0,
        bare: 0,
    };
    for (line, words) in statements(bytes) {
        if let Some((&key, rest)) = words.split_first() {
            reader.statement(key, rest, line)?;
        }
    }
    Ok(Some(reader.finish()))
}

/// Indices of a corner: position, texture coordinates, normal.
type Corner = (usize, Option<usize>, Option<usize>);

struct Reader<'a> {
    library: Library<'a>,
    mesh: Mesh,
    position: Vec<DVec3>,
    colour: Vec<Vec3>,
    uv: Vec<Vec2>,
    normal: Vec<Vec3>,
    /// Vertices of the mesh, by what they are made of.
    known: HashMap<Corner, u32>,
    /// Material of the faces that follow.
    material: u32,
    /// Whether any vertex has a normal, texture coordinates, a colour.
    columns: [bool; 3],
    /// Lines, points and curves.
    ignored: usize,
    concave: usize,
    /// Faces whose material has a texture, but not their corners a place in it.
    bare: usize,
}

impl Reader<'_> {
    fn statement(&mut self, key: &[u8], rest: &[&[u8]], line: u64) -> Result<(), ParseError> {
        match key {
            b"v" => return self.vertex_line(rest, line),
            b"vt" => {
                let (u, v) = match *numbers(rest, line)?.as_slice() {
                    [u, v, ..] => (u, v),
                    [u] => (u, 0.0),
                    ref other => return Err(bad(line, other, "`vt u [v [w]]`")),
                };
                // The image's lower left corner is (0, 0) here, and its upper left corner in a mesh.
                let at = Vec2::new(u as f32, 1.0 - v as f32);
                if !at.is_finite() {
                    let found = format!("the texture coordinates {u} {v}");
                    return Err(ParseError::line(line, found, "numbers from -3e38 to 3e38"));
                }
                self.uv.push(at);
            }
            b"vn" => match *numbers(rest, line)?.as_slice() {
                [x, y, z] => {
                    self.normal.push(DVec3::new(x, y, z).try_normalize().unwrap_or(DVec3::ZERO).as_vec3());
                }
                ref other => return Err(bad(line, other, "`vn x y z`")),
            },
            b"f" => return self.face(rest, line),
            b"mtllib" => self
                .library
                .add(&text(rest), &mut self.mesh)
                .map_err(|found| ParseError::line(line, found, "a material library that can be read"))?,
            b"usemtl" => {
                let name = text(rest);
                self.material = match self.library.index(&name, &mut self.mesh) {
                    Ok(Some(index)) => index,
                    Ok(None) => {
                        if self.mesh.notes.len() < MOST_NOTES {
                            let shown = quote(name.as_bytes());
                            let note = format!("line {line}: no material {shown}; drawn grey");
                            self.mesh.notes.push(note);
                        }
                        0
                    }
                    Err(found) => return Err(ParseError::line(line, found, "a texture that can be decoded")),
                };
            }
            b"l" | b"p" | b"curv" | b"curv2" | b"surf" => self.ignored += 1,
            _ => {}
        }
        Ok(())
    }

    fn vertex_line(&mut self, rest: &[&[u8]], line: u64) -> Result<(), ParseError> {
        let values = numbers(rest, line)?;
        let colour = match values.as_slice() {
            [_, _, _] | [_, _, _, _] => None,
            [_, _, _, r, g, b] | [_, _, _, _, r, g, b] => Some([*r as f32, *g as f32, *b as f32]),
            other => return Err(bad(line, other, "`v x y z [w] [r g b]`")),
        };
        if let [x, y, z, ..] = *values.as_slice() {
            let position = DVec3::new(x, y, z);
            if !(position.is_finite() && position.abs().max_element() <= FAR) {
                return Err(ParseError::line(line, format!("the position {x} {y} {z}"), "numbers from -1e30 to 1e30"));
            }
            self.position.push(position);
        }
        self.columns[2] |= colour.is_some();
        let linear = |c: f32| if c.is_finite() { srgb::to_linear(c.clamp(0.0, 1.0)) } else { 1.0 };
        self.colour.push(colour.map_or(Vec3::ONE, |c| Vec3::from_array(c.map(linear))));
        Ok(())
    }

    fn face(&mut self, corners: &[&[u8]], line: u64) -> Result<(), ParseError> {
        if corners.len() < 3 {
            return Err(ParseError::line(line, format!("a face of {} corners", corners.len()), "3 or more"));
        }
        let corners: Vec<Corner> = corners.iter().map(|word| self.corner(word, line)).collect::<Result<_, _>>()?;
        let material = self.mesh.materials.get(self.material as usize);
        let textured = material.is_some_and(|material| material.texture.is_some());
        self.bare += usize::from(textured && corners.iter().any(|(_, uv, _)| uv.is_none()));
        let positions: Vec<DVec3> = corners.iter().map(|corner| self.position[corner.0]).collect();
        let triangles = triangulate(&positions);
        self.concave += usize::from(triangles.is_none());
        for triangle in triangles.unwrap_or_else(|| fan(corners.len())) {
            let mut indices = [0; 3];
            for (index, at) in indices.iter_mut().zip(triangle) {
                *index = self.vertex(corners[at], line)?;
            }
            self.mesh.triangles.push(Triangle { corners: indices, material: self.material });
        }
        Ok(())
    }

    /// The indices of `v`, `v/vt`, `v//vn` or `v/vt/vn`: from 1, or from the end where negative.
    fn corner(&self, word: &[u8], line: u64) -> Result<Corner, ParseError> {
        let mut parts = word.split(|&b| b == b'/');
        let mut index = |count: usize, what: &str| -> Result<Option<usize>, ParseError> {
            let Some(part) = parts.next().filter(|part| !part.is_empty()) else { return Ok(None) };
            let number = std::str::from_utf8(part).ok().and_then(|text| text.parse::<i64>().ok());
            let most = count as i64;
            match number {
                Some(i) if (1..=most).contains(&i) => Ok(Some(i as usize - 1)),
                Some(i) if (-most..0).contains(&i) => Ok(Some((most + i) as usize)),
                _ => {
                    let expected = format!("{what} from 1 to {most}, or from -{most} to -1");
                    Err(ParseError::line(line, format!("face corner {}", quote(word)), expected))
                }
            }
        };
        let position = index(self.position.len(), "a vertex index")?;
        let uv = index(self.uv.len(), "an index of texture coordinates")?;
        let normal = index(self.normal.len(), "an index of a normal")?;
        match position {
            Some(position) => Ok((position, uv, normal)),
            None => Err(ParseError::line(line, format!("face corner {}", quote(word)), "a vertex index")),
        }
    }

    /// The vertex of a corner, which is new if no corner before was the same.
    fn vertex(&mut self, corner: Corner, line: u64) -> Result<u32, ParseError> {
        if let Some(&index) = self.known.get(&corner) {
            return Ok(index);
        }
        let (position, uv, normal) = corner;
        let index = u32::try_from(self.mesh.position.len())
            .map_err(|_| ParseError::line(line, "more than 4294967295 vertices", "at most as many"))?;
        self.mesh.position.push(self.position[position]);
        self.mesh.colour.push(self.colour[position].extend(1.0));
        self.mesh.uv.push(uv.map_or(Vec2::ZERO, |uv| self.uv[uv]));
        self.mesh.normal.push(normal.map_or(Vec3::ZERO, |normal| self.normal[normal]));
        self.columns[0] |= normal.is_some();
        self.columns[1] |= uv.is_some();
        self.known.insert(corner, index);
        Ok(index)
    }

    fn finish(self) -> Mesh {
        let Self { mut mesh, library, columns, ignored, concave, bare, .. } = self;
        mesh.keep(columns);
        if !columns[2] {
            // The material of faces that name none.
            mesh.materials[0].colour = Vec3::splat(PLAIN).extend(1.0);
        }
        smooth(&mut mesh);
        library.finish(&mut mesh);
        if ignored > 0 {
            mesh.notes.push(format!("ignored: lines, points and curves ({ignored})"));
        }
        if bare > 0 {
            mesh.notes.push(format!("{bare} faces with a texture have corners without coordinates in it (vt)"));
        }
        if concave > 0 {
            mesh.notes.push(fans(concave));
        }
        mesh
    }
}

fn bad(line: u64, values: &[f64], expected: &str) -> ParseError {
    ParseError::line(line, format!("{} numbers", values.len()), expected)
}

/// The rest of a statement as text: names may have blanks.
fn text(words: &[&[u8]]) -> String {
    String::from_utf8_lossy(&words.join(&b' ')).into_owned()
}
