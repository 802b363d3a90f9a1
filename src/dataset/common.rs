//! Files that all frames share, beside `transforms.json`.

use std::fmt::Write as _;

use super::files::{File, FolderLayout, Role, files};
use super::points::{StartPoint, start_points};
use super::views::views;
use super::{DatasetError, Recipe, colmap, llff};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// The points for a start, by the name that nerfstudio gives them.
pub(super) const PLY: &str = "sparse_pc.ply";

/// A file that all frames share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommonFile {
    /// Its place in the dataset, with `/`.
    pub path: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The files beside `transforms.json` that these frames share. `depth` reads the values of a file of depths,
/// and `seed` is that of the shake.
///
/// # Errors
/// A file of a sequence cannot be read, or `depth` fails.
pub fn common_files<E: From<DatasetError>>(
    scene: &Scene,
    frames: &[FrameNumber],
    recipe: &Recipe,
    seed: u64,
    mut depth: impl FnMut(&File) -> Result<Vec<f32>, E>,
) -> Result<Vec<CommonFile>, E> {
    let Some(&first) = frames.first() else { return Ok(Vec::new()) };
    let is_llff = recipe.layout == FolderLayout::DeblurNerf;
    if recipe.layout == FolderLayout::Gopro {
        return Ok(Vec::new());
    }
    let points = start_points(scene, first, recipe.response).map_err(DatasetError::from)?;
    let text = |path: String, text: String| CommonFile { path, bytes: text.into_bytes() };
    if recipe.layout == FolderLayout::Nerfstudio {
        return Ok(vec![text(PLY.to_owned(), ply(&points))]);
    }
    let views = views(scene, frames, recipe, seed).map_err(DatasetError::from)?;
    let sparse = colmap::files(scene, &views, &points);
    let mut common: Vec<CommonFile> = sparse.map(|(name, of)| text(format!("sparse/0/{name}"), of)).into();
    if is_llff {
        let mut bounds = Vec::new();
        for view in &views {
            let file = files(&scene.name, view.frame, recipe).into_iter().find(|file| file.role == Role::Depth);
            bounds.push(match file {
                Some(file) => llff::bounds(depth(&file)?),
                None => None,
            });
        }
        let bytes = llff::poses_bounds(scene, &views, &bounds);
        common.push(CommonFile { path: llff::POSES_BOUNDS.to_owned(), bytes });
        if let Some(held_out) = &recipe.held_out {
            common.push(text(format!("hold={}", held_out.distance()), String::new()));
        }
    }
    Ok(common)
}

/// The points as nerfstudio writes them.
fn ply(points: &[StartPoint]) -> String {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    text.extend(["x", "y", "z"].map(|name| format!("property float {name}\n")));
    text.extend(["red", "green", "blue"].map(|name| format!("property uchar {name}\n")));
    text.push_str("end_header\n");
    for StartPoint { position, colour: [red, green, blue] } in points {
        let [x, y, z] = position.to_array();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{x} {y} {z} {red} {green} {blue}");
    }
    text
}
