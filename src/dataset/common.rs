//! Files that all frames share, beside `transforms.json`.

use super::files::FolderLayout;
use super::points::start_points;
use super::views::views;
use super::{DatasetError, Recipe, colmap};
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

/// The files beside `transforms.json` that these frames share.
///
/// # Errors
/// A file of a sequence cannot be read.
pub fn common_files(scene: &Scene, frames: &[FrameNumber], recipe: &Recipe) -> Result<Vec<CommonFile>, DatasetError> {
    let Some(&first) = frames.first() else { return Ok(Vec::new()) };
    let has_sparse = match recipe.layout {
        FolderLayout::Nerfstudio | FolderLayout::Gopro => false,
        FolderLayout::Colmap => true,
    };
    let mut files = Vec::new();
    if has_sparse {
        let points = start_points(scene, first, recipe.response)?;
        let sparse = colmap::files(scene, &views(scene, frames, recipe), &points);
        let file =
            |(name, text): (&str, String)| CommonFile { path: format!("sparse/0/{name}"), bytes: text.into_bytes() };
        files.extend(sparse.map(file));
    }
    Ok(files)
}
