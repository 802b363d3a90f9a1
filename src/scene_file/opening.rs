//! Scene files for users of the library: the choices that reading depends on come before it.

use std::path::{Path, PathBuf};

use super::{LoadedScene, SceneError, SceneLoadOptions, load};
use crate::limits;
use crate::scene::Scene;

/// A scene file that is about to be read. [`Scene::open`] makes one, [`Opening::load`] reads it.
#[derive(Clone, Debug)]
#[must_use = "nothing is read before `load`"]
pub struct Opening {
    path: PathBuf,
    size: Option<(u32, u32)>,
    lenient: bool,
}

impl Scene {
    /// Begins to read a scene file. The builder takes what reading depends on, such as the size of the image.
    ///
    /// ```
    /// use splatblur::Scene;
    ///
    /// let scene = Scene::open("scenes/swarm.xml").size(160, 90).load()?;
    /// assert_eq!((scene.image.width, scene.image.height), (160, 90));
    /// # Ok::<(), splatblur::SceneError>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Opening {
        Opening { path: path.as_ref().to_owned(), size: None, lenient: false }
    }
}

impl Opening {
    /// Takes an image of this width and height, pixels, 1 to 65,535, in place of the scene's. It is `--size` of the
    /// program: a camera that the file leaves out sees all in an image of this shape, and meshes without a spacing get
    /// as many surfels as this image needs.
    pub fn size(self, width: u32, height: u32) -> Self {
        Self { size: Some((width, height)), ..self }
    }

    /// Makes notes of unknown elements and attributes, where they are errors by default.
    pub fn lenient(self) -> Self {
        Self { lenient: true, ..self }
    }

    /// Reads the scene with the models and animations that it names, and fills in every default.
    ///
    /// # Errors
    /// The scene, or a file that it names, cannot be read or is not valid, or the size is out of its bounds.
    pub fn load(self) -> Result<Scene, SceneError> {
        Ok(self.load_with_notes()?.scene)
    }

    /// As [`Self::load`], with what a user should know about the reading: what was estimated, found or skipped.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_notes(self) -> Result<LoadedScene, SceneError> {
        if let Some((width, height)) = self.size {
            limits::check_count("size.width", width, &limits::SIDE)?;
            limits::check_count("size.height", height, &limits::SIDE)?;
        }
        load(&self.path, &SceneLoadOptions { lenient: self.lenient, size: self.size, ..SceneLoadOptions::default() })
    }
}
