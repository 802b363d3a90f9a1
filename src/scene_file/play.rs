//! A scene that plays a glTF file: one object for each node with a mesh, moved as the file moves it.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::write::{camera_line, escaped, number};
use crate::anim::{AnimError, AnimationFile, GltfAnimation, open};
use crate::files::{self, Changed};
use crate::gltf::Nodes;
use crate::math::Bounds;
use crate::model::mesh::{self, Mesh};
use crate::model::{ModelError, ModelFormat};
use crate::scene::Camera;

/// Most nodes whose motion decides where the camera stands. Others count at rest.
const MOST_SWEPT: usize = 64;

/// Most times at which they are looked at.
const MOST_TIMES: usize = 200;

/// Where the camera stands: to the right, above and in front of what it sees.
const FROM: DVec3 = DVec3::new(0.55, 0.35, 1.0);

/// A scene that plays a file.
#[derive(Clone, Debug)]
pub struct Play {
    /// The scene file; it names the glTF file as one beside itself.
    pub xml: String,
    /// The glTF file and all files that it names, with their paths beside the scene.
    pub files: Vec<(PathBuf, PathBuf)>,
    /// Number of objects.
    pub objects: usize,
    /// Notes on parts that are not drawn.
    pub notes: Vec<String>,
}

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub enum NoPlay {
    /// As a model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// As an animation.
    #[error(transparent)]
    Animation(#[from] AnimError),
    /// The file, or one that it names, changes while it is read.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// It is no glTF file, or has no triangles.
    #[error("{} is no glTF file with triangles", .0.display())]
    NoTriangles(PathBuf),
}

/// A scene that plays the glTF file `path` as it plays by itself, 24 frames a second, and again and again.
///
/// # Errors
/// The file cannot be read, is no valid glTF file, or has no triangles.
pub fn play(path: &Path) -> Result<Play, NoPlay> {
    files::steady(|| play_once(path))
}

fn play_once(path: &Path) -> Result<Play, NoPlay> {
    let AnimationFile::Gltf(animation) = open(path)? else { return Err(NoPlay::NoTriangles(path.to_owned())) };
    let bytes =
        files::read(path, u64::MAX).map_err(|why| ModelError::Read { path: path.to_owned(), source: why.into() })?;
    let invalid = |why| ModelError::Invalid { path: path.to_owned(), why };
    let read = |node: Option<&str>| mesh::read(&bytes, ModelFormat::Glb, path, node).map_err(invalid);
    let whole = read(None)?.ok_or_else(|| NoPlay::NoTriangles(path.to_owned()))?;
    let nodes = &animation.nodes;
    let is_drawn = |index: &usize| {
        let node = &nodes.nodes[*index];
        node.in_scene && node.mesh.is_some() && node.triangles > 0
    };
    let drawn: Vec<usize> = (0..nodes.nodes.len()).filter(is_drawn).collect();
    let frames = libm::rint(animation.seconds() * GltfAnimation::FPS).clamp(0.0, 1e9);
    let mut seen = bounds(&whole);
    for &index in drawn.iter().filter(|&&index| nodes.nodes[index].animated).take(MOST_SWEPT) {
        let label = nodes.label(index);
        let Some(shape) = read(Some(&label))? else { continue };
        let corners: Vec<DVec3> = bounds(&shape).corners().into_iter().collect();
        let chain = animation.bind(Some(&label), GltfAnimation::FPS, true)?;
        let steps = (frames as usize).clamp(1, MOST_TIMES);
        for step in 0..=steps {
            let m = chain.at(animation.seconds() * step as f64 / steps as f64);
            corners
                .iter()
                .map(|corner| m.transform_point3(*corner))
                .filter(|p| p.is_finite())
                .for_each(|p| seen.add(p));
        }
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(Play {
        xml: xml(nodes, &drawn, &name, frames, &camera(seen)),
        files: named(&bytes, path).map_err(invalid)?,
        objects: drawn.len(),
        notes: whole.notes.into_iter().filter(|note| !note.contains(mesh::NOT_PLAYED)).collect(),
    })
}

fn bounds(mesh: &Mesh) -> Bounds {
    let used = mesh.triangles.iter().flat_map(|triangle| triangle.corners);
    used.map(|corner| mesh.position[corner as usize]).collect()
}

/// The files to copy, each with its path beside the scene.
fn named(bytes: &[u8], path: &Path) -> Result<Vec<(PathBuf, PathBuf)>, crate::model::ParseError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut files = vec![(path.to_owned(), path.file_name().map(PathBuf::from).unwrap_or_default())];
    for found in mesh::files(bytes, path)? {
        let inside = found.strip_prefix(folder).unwrap_or(&found).to_owned();
        if files.iter().all(|(known, _)| *known != found) {
            files.push((found, inside));
        }
    }
    Ok(files)
}

/// A camera that sees a box whole.
fn camera(seen: Bounds) -> Camera {
    let centre = seen.centre();
    let radius = (0.5 * seen.size().length()).max(1e-6);
    let half = 0.5 * Camera::FOVY_DEGREES.to_radians();
    let distance = 1.05 * radius / libm::sin(half);
    let mut camera = Camera::new(short(centre + FROM.normalize() * distance, radius), short(centre, radius));
    camera.near = Camera::NEAR.min(digits(distance * 1e-3));
    camera
}

/// A point with four digits of `size`, so that the camera's numbers are short.
fn short(point: DVec3, size: f64) -> DVec3 {
    let decimals = (3 - libm::floor(libm::log10(size)) as i32).clamp(0, 300) as usize;
    DVec3::from_array(point.to_array().map(|x| format!("{x:.decimals$}").parse().unwrap_or(x) + 0.0))
}

fn digits(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

fn xml(nodes: &Nodes, drawn: &[usize], file: &str, frames: f64, camera: &Camera) -> String {
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<scene>\n");
    let fps = number(GltfAnimation::FPS);
    // The last frame is the one before the first of the next round. Writing to a string cannot fail.
    let last = (frames - 1.0).max(0.0);
    let _ = writeln!(out, "  <frames first=\"0\" last=\"{last}\" rate=\"{fps}\"/>");
    let _ = writeln!(out, "  {}", camera_line(camera));
    out.push_str("  <light type=\"directional\" direction=\"-0.5 -1 -0.8\" intensity=\"0.9\"/>\n");
    out.push_str("  <light type=\"ambient\" intensity=\"0.3\"/>\n");
    let mut taken = HashSet::new();
    let mut shapes: HashMap<usize, String> = HashMap::new();
    let file = escaped(file);
    for &index in drawn {
        let node = &nodes.nodes[index];
        let label = nodes.label(index);
        // Nodes with one mesh share one model.
        let shape = node.mesh.map(|mesh| shapes.entry(mesh).or_insert_with(|| shape_label(nodes, index)).clone());
        let name = free_name(nodes, index, &mut taken);
        let _ = writeln!(out, "  <object name=\"{}\">", escaped(&name));
        let _ = writeln!(
            out,
            "    <pointModel node=\"{}\">{file}</pointModel>",
            escaped(shape.as_deref().unwrap_or(&label))
        );
        let _ =
            writeln!(out, "    <animation node=\"{}\" fps=\"{fps}\" loop=\"true\">{file}</animation>", escaped(&label));
        out.push_str("  </object>\n");
    }
    out.push_str("</scene>\n");
    out
}

/// A text that finds the mesh of a node: the name of the mesh where it means no other, else the node.
fn shape_label(nodes: &Nodes, index: usize) -> String {
    let node = &nodes.nodes[index];
    let name = &node.mesh_name;
    let found = nodes.matching(name);
    let only = found.iter().all(|&other| nodes.nodes[other].mesh == node.mesh);
    if !found.is_empty() && only && plain(name) == *name { name.clone() } else { nodes.label(index) }
}

/// A name that no object before has.
fn free_name(nodes: &Nodes, index: usize, taken: &mut HashSet<String>) -> String {
    let node = &nodes.nodes[index];
    let words = [&node.name, &node.mesh_name].map(|name| plain(name));
    let base = words.into_iter().find(|name| !name.is_empty()).unwrap_or_else(|| "node".to_owned());
    let mut name = base.clone();
    let mut suffix = index;
    while !taken.insert(name.clone()) {
        name = format!("{base} {suffix}");
        suffix += 1;
    }
    name
}

/// A name without what a scene file cannot hold.
fn plain(name: &str) -> String {
    let kept = |c: char| if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { ' ' } else { c };
    name.chars().map(kept).collect::<String>().trim().to_owned()
}
