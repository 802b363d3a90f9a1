//! Files that all frames share, beside `transforms.json`.

use super::files::{File, FolderLayout, Role, files};
use super::points::start_points;
use super::views::views;
use super::{DatasetError, Recipe, colmap, llff};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// A file that all frames share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommonFile {
    /// Its place in the dataset, with `/`.
    pub path: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The files beside `transforms.json` that these frames share. `depth` reads the values of a file of depths.
///
/// # Errors
/// A file of a sequence cannot be read, or `depth` fails.
pub fn common_files<E: From<DatasetError>>(
    scene: &Scene,
    frames: &[FrameNumber],
    recipe: &Recipe,
    mut depth: impl FnMut(&File) -> Result<Vec<f32>, E>,
) -> Result<Vec<CommonFile>, E> {
    let Some(&first) = frames.first() else { return Ok(Vec::new()) };
    let is_llff = recipe.layout == FolderLayout::DeblurNerf;
    let has_sparse = is_llff || recipe.layout == FolderLayout::Colmap;
    if !has_sparse {
        return Ok(Vec::new());
    }
    let points = start_points(scene, first, recipe.response).map_err(DatasetError::from)?;
    let views = views(scene, frames, recipe);
    let text = |path: String, text: String| CommonFile { path, bytes: text.into_bytes() };
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
