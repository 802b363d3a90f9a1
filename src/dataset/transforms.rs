//! `transforms.json`: cameras, files and settings of all frames, as nerfstudio reads it. Camera to world, axes of
//! OpenGL, which are ours; keys that nerfstudio does not know are ours too (docs/dataset.md).

use glam::{DMat3, DMat4};
use serde::{Deserialize, Serialize};

use super::common::PLY;
use super::files::{FolderLayout, Role, files};
use super::views::{focal_of, picture, principal_point};
use super::{DatasetError, MIDDLE, Recipe, shaken};
use crate::scene::Scene;
use crate::scene::pose::camera_from_world;
use crate::time::{FrameNumber, Shutter};

/// Its name.
pub const TRANSFORMS: &str = "transforms.json";

/// What made a dataset: enough to make it again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// Name and version of the program.
    pub program: String,
    /// The scene file, as it was named.
    pub scene: String,
    /// Options of the command line that decide what is made.
    pub arguments: Vec<String>,
    /// What made the pictures: `cpu`, `gpu` or `reference`.
    pub backend: String,
    /// Hash of the scene, of the files that it names, and of all options of its pictures.
    pub hash: String,
}

/// A matrix by rows.
type Rows = [[f64; 4]; 4];

#[derive(Serialize)]
struct Head<'a> {
    camera_model: &'static str,
    /// `None`: frames have their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_y: Option<f64>,
    cx: f64,
    cy: f64,
    w: u32,
    h: u32,
    /// Frames per second.
    frame_rate: f64,
    shutter: Exposure,
    /// Seconds from where the shutter opens to where it closes.
    exposure: f64,
    response: String,
    noise: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    shake: Option<String>,
    seed: u64,
    /// Points for a start.
    #[serde(skip_serializing_if = "Option::is_none")]
    ply_file_path: Option<&'static str>,
    #[serde(flatten)]
    split: Option<Split>,
    splatblur: &'a Origin,
}

/// Pictures to train on, and those that are held out. nerfstudio asks for the latter under two names.
#[derive(Serialize)]
struct Split {
    #[serde(rename = "train_filenames")]
    train: Vec<String>,
    #[serde(rename = "val_filenames")]
    val: Vec<String>,
    #[serde(rename = "test_filenames")]
    test: Vec<String>,
}

impl Split {
    /// None where no view is held out: a reader then splits them as it likes.
    fn of(scene: &Scene, frames: &[FrameNumber], recipe: &Recipe) -> Option<Self> {
        recipe.held_out.as_ref()?;
        let (test, train): (Vec<FrameNumber>, _) = frames.iter().partition(|frame| recipe.holds_out(**frame));
        let names = |frames: Vec<FrameNumber>| frames.into_iter().map(|frame| picture(scene, frame, recipe)).collect();
        let test: Vec<String> = names(test);
        Some(Self { train: names(train), val: test.clone(), test })
    }
}

/// The shutter. All of it that decides when a pixel is exposed is said here, and nowhere else.
#[derive(Serialize)]
struct Exposure {
    /// Frames around the frame's number.
    open: f64,
    close: f64,
    weight: String,
    /// Frames that the read-out of all rows takes; 0: all are exposed together.
    readout: f64,
    direction: &'static str,
    anchor: &'static str,
}

impl Exposure {
    fn of(shutter: &Shutter) -> Self {
        Self {
            open: shutter.open,
            close: shutter.close,
            weight: shutter.weight.to_string(),
            readout: shutter.readout.duration,
            direction: shutter.readout.direction.name(),
            anchor: shutter.readout.anchor.name(),
        }
    }
}

#[derive(Serialize)]
struct Entry {
    /// The blurred picture, or the sharp one of a view that is held out.
    file_path: String,
    /// The blurred picture of a view that is held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    blurred: Option<String>,
    /// Number of the frame.
    frame: FrameNumber,
    /// Focal length of the frame; `None`: all have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_y: Option<f64>,
    /// The camera in the middle of the shutter.
    transform_matrix: Rows,
    open: Instant,
    middle: Instant,
    close: Instant,
    sharp: Vec<Sharp>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flow_open_close: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flow_middle_close: Option<String>,
    depth: Option<String>,
    /// The same by the name of nerfstudio.
    depth_file_path: Option<String>,
    alpha: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

/// The camera at an instant.
#[derive(Serialize)]
struct Instant {
    /// Scene time, frames.
    time: f64,
    transform_matrix: Rows,
}

#[derive(Serialize)]
struct Sharp {
    file_path: String,
    /// Share of the exposure that it stands for.
    weight: f64,
    #[serde(flatten)]
    instant: Instant,
}

/// The text of the file for these frames. `seed`: of all that is random. Frames stand one on a line.
///
/// # Errors
/// JSON cannot be made, or poses of a camera that shakes are out of their bounds.
pub fn transforms(
    scene: &Scene,
    frames: &[FrameNumber],
    recipe: &Recipe,
    seed: u64,
    origin: &Origin,
) -> Result<String, DatasetError> {
    let [width, height] = [scene.image.width, scene.image.height];
    let focal = one_focal(scene, frames);
    let [cx, cy] = principal_point(scene);
    let shutter = &scene.shutter;
    let head = Head {
        camera_model: "PINHOLE",
        fl_x: focal,
        fl_y: focal,
        cx,
        cy,
        w: width,
        h: height,
        frame_rate: scene.frames.rate,
        shutter: Exposure::of(shutter),
        exposure: (shutter.close - shutter.open) / scene.frames.rate,
        response: recipe.response.to_string(),
        noise: recipe.noise.to_string(),
        shake: recipe.shake.map(|shake| shake.to_string()),
        seed,
        ply_file_path: (recipe.layout == FolderLayout::Nerfstudio).then_some(PLY),
        split: Split::of(scene, frames, recipe),
        splatblur: origin,
    };
    let entry = |&frame: &FrameNumber| {
        let own = focal.is_none().then(|| focal_of(scene, frame));
        let seen = &*shaken(scene, frame, recipe, seed)?;
        Ok(serde_json::to_string(&Entry { fl_x: own, fl_y: own, ..entry(seen, frame, recipe) })?)
    };
    let entries = frames.iter().map(entry);
    let entries = entries.collect::<Result<Vec<_>, DatasetError>>()?.join(",\n    ");
    let head = serde_json::to_string_pretty(&head)?;
    let open = head.trim_end().trim_end_matches('}').trim_end();
    Ok(format!("{open},\n  \"frames\": [\n    {entries}\n  ]\n}}\n"))
}

/// The focal length that all frames have. Where it stands in the head, nerfstudio reads none of the frames.
fn one_focal(scene: &Scene, frames: &[FrameNumber]) -> Option<f64> {
    let first = frames.first().map_or(0.0, |&frame| focal_of(scene, frame));
    frames.iter().all(|&frame| focal_of(scene, frame) == first).then_some(first)
}

fn entry(scene: &Scene, frame: FrameNumber, recipe: &Recipe) -> Entry {
    let mut list = files(&scene.name, frame, recipe);
    let mut path = |role: Role| {
        let at = list.iter().position(|file| file.role == role)?;
        Some(list.swap_remove(at).path)
    };
    let instant = |share: f64| {
        let time = scene.shutter.frame_time(frame.get(), share);
        Instant { time, transform_matrix: world_from_camera(&camera_from_world(scene, time)) }
    };
    let weights = recipe.weights(&scene.shutter.weight);
    let sharp = recipe.instants().into_iter().zip(weights).enumerate().filter_map(|(i, (share, weight))| {
        let own = path(Role::Sharp(i));
        // The only sharp picture may be that of the middle.
        let file_path = own.or_else(|| path(Role::Middle).filter(|_| share == MIDDLE))?;
        Some(Sharp { file_path, weight, instant: instant(share) })
    });
    let sharp = sharp.collect();
    let depth = path(Role::Depth);
    Entry {
        file_path: picture(scene, frame, recipe),
        blurred: path(Role::Blur).filter(|_| recipe.holds_out(frame)),
        frame,
        fl_x: None,
        fl_y: None,
        transform_matrix: instant(MIDDLE).transform_matrix,
        open: instant(0.0),
        middle: instant(MIDDLE),
        close: instant(1.0),
        sharp,
        flow_open_close: path(Role::OpenClose),
        flow_middle_close: path(Role::MiddleClose),
        depth_file_path: depth.clone(),
        depth,
        alpha: path(Role::Alpha),
        error: path(Role::Error),
    }
}

/// The inverse of a rotation and a translation, by rows.
fn world_from_camera(camera_from_world: &DMat4) -> Rows {
    let turn = DMat3::from_mat4(*camera_from_world).transpose();
    let eye = -(turn * camera_from_world.w_axis.truncate());
    let row = |axis: usize| turn.row(axis).extend(eye[axis]).to_array();
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}
