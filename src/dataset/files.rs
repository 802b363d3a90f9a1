//! The files of a frame, and where they lie.

use super::{By, Recipe};
use crate::options::Quality;
use crate::time::FrameNumber;

/// Where the files of a dataset lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FolderLayout {
    /// `images/` and all else in folders beside it, as nerfstudio expects with `transforms.json`.
    #[default]
    Nerfstudio,
    /// A folder a sequence, with `blur/` and `sharp/`, as the GOPRO dataset (Nah et al. 2017) has them.
    Gopro,
    /// As nerfstudio, with `sparse/0` of COLMAP, as programs expect that fit 3D Gaussians.
    Colmap,
    /// As COLMAP, with what the reader of Deblur-NeRF (Ma et al. 2022) expects: `poses_bounds.npy` and `hold=n`.
    DeblurNerf,
}

impl FolderLayout {
    /// All, with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("nerfstudio", Self::Nerfstudio),
        ("gopro", Self::Gopro),
        ("colmap", Self::Colmap),
        ("deblur-nerf", Self::DeblurNerf),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(_, layout)| *layout == self).map_or("", |(name, _)| name)
    }
}

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The blurred picture.
    Blur,
    /// A sharp picture, by its number.
    Sharp(usize),
    /// The sharp picture of the middle, where it is a file of its own.
    Middle,
    /// The picture of a view that is held out: sharp, with all rows at once. It takes the blurred one's place.
    Held,
    /// The same once more, in a folder of such pictures.
    Test,
    /// Flow from where the shutter opens to where it closes.
    OpenClose,
    /// Flow from the middle to where it closes.
    MiddleClose,
    /// Depth of the middle.
    Depth,
    /// Alpha of the middle.
    Alpha,
    /// Error of the blurred picture.
    Error,
}

/// A file of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// What it holds.
    pub role: Role,
    /// Its place in the dataset, with `/`.
    pub path: String,
}

/// The files of frame `frame` of the scene `name`.
pub fn files(name: &str, frame: FrameNumber, recipe: &Recipe) -> Vec<File> {
    let gopro = recipe.layout == FolderLayout::Gopro;
    let folder = if gopro { format!("{name}/") } else { String::new() };
    let number = match frame.get() {
        // As many digits as that dataset has.
        number if gopro && frame.is_whole() && number >= 0.0 => format!("{number:06}"),
        _ => frame.padded(),
    };
    let extension = recipe.format.extension();
    let file = |role: Role, place: &str, extension: &str| File { role, path: format!("{folder}{place}.{extension}") };
    let picture = |role: Role, place: &str| file(role, place, extension);
    let numbers = |place: &str, role: Role| file(role, place, "exr");
    let digits = recipe.sharp.saturating_sub(1).to_string().len();
    let of_instant = |folder: &str, i: usize| picture(Role::Sharp(i), &format!("{folder}/{number}-{i:0digits$}"));
    let instants = 0..recipe.sharp as usize;
    let mut files = Vec::new();
    if gopro {
        files.push(picture(Role::Blur, &format!("blur/{number}")));
        files.push(picture(Role::Middle, &format!("sharp/{number}")));
        files.extend(instants.filter(|_| recipe.sharp > 1).map(|i| of_instant("instants", i)));
    } else {
        if recipe.holds_out(frame) {
            files.push(picture(Role::Held, &format!("images/{number}")));
            if recipe.layout == FolderLayout::DeblurNerf {
                files.push(picture(Role::Test, &format!("images_test/{number}")));
            }
            files.push(picture(Role::Blur, &format!("images_test_blurred/{number}")));
        } else {
            files.push(picture(Role::Blur, &format!("images/{number}")));
        }
        files.extend(instants.map(|i| of_instant("sharp", i)));
    }
    if recipe.flow {
        files.push(numbers(&format!("flow/{number}-open-close"), Role::OpenClose));
        files.push(numbers(&format!("flow/{number}-middle-close"), Role::MiddleClose));
    }
    files.push(numbers(&format!("depth/{number}"), Role::Depth));
    files.push(numbers(&format!("alpha/{number}"), Role::Alpha));
    if recipe.has_error() {
        files.push(numbers(&format!("error/{number}"), Role::Error));
    }
    files
}

impl Recipe {
    /// Is the view of this frame held out?
    pub fn holds_out(&self, frame: FrameNumber) -> bool {
        self.held_out.as_ref().is_some_and(|held_out| held_out.contains(frame))
    }

    /// Is there an error of the blurred picture? Modes but `auto` know none, and the mean of sharp pictures has none.
    pub fn has_error(&self) -> bool {
        match &self.by {
            _ if self.exact => false,
            By::Splatting(options) => matches!(options.quality, Quality::Error(_)),
            By::Tracing(_) => true,
        }
    }
}
