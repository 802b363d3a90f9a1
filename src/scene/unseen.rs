//! Why a frame shows nothing of an object.
//!
//! The question is put to points of the object at instants of the exposure, each in the rows that are exposed then:
//! where are they? A box at the middle of the exposure does not tell. What flies a million units a second is in the
//! picture at that one instant alone, which no sample meets.

use std::fmt;

use glam::{DMat4, DVec2, DVec3};

use super::pose::{camera_from_world, object_pose};
use super::shape::Shape;
use super::values::{Object, Scene};
use crate::model::paths::elapsed;
use crate::time::FrameNumber;

/// Instants of the exposure of a row. They are middles of equal parts, of which none is the middle of the whole.
const INSTANTS: usize = 8;
/// Bands of rows that a rolling shutter exposes one by one.
const BANDS: usize = 16;
/// Most points of an object that are looked at.
const POINTS: usize = 256;
/// Most places of points of all objects that are looked at: about a tenth of a second.
const PLACES: usize = 2_000_000;
/// Least share of the places in the picture, below which samples may have missed them all.
const IN_VIEW: f64 = 0.01;
/// Part of the places that are beside the image at least, one in so many, for it to be the cause.
const OUTSIDE: usize = 10;

/// The likely cause why a frame shows nothing of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// It has no surfels.
    Empty,
    /// Its animation hides it.
    Hidden,
    /// No file of its sequence belongs to the frame.
    NoFile,
    /// The files of its sequence that belong to the frame have no points.
    EmptyFrame,
    /// It is behind the camera.
    Behind,
    /// It is before the camera, but nearer than `near`.
    Nearer,
    /// It is beside, above or below the image.
    Outside,
    /// It is smaller than a pixel, or seen edge-on.
    Small,
    /// It shows its backs, and they are left out.
    FacingAway,
    /// It is as dark or as bright as the background.
    LikeBackground,
}

impl fmt::Display for Unseen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "without surfels",
            Self::Hidden => "hidden by an animation",
            Self::NoFile => "without a file of its sequence",
            Self::EmptyFrame => "without points in this frame's file",
            Self::Behind => "behind the camera",
            Self::Nearer => "nearer than the camera's `near`",
            Self::Outside => "outside the image",
            Self::Small => "too small",
            Self::FacingAway => "facing away (twoSided=\"true\" in the scene shows backs)",
            Self::LikeBackground => "of the background's colour (does light reach it?)",
        })
    }
}

/// The likely cause why frame `frame` shows nothing of `object`, one of `scene`. `drawn`: splats were projected onto
/// the image all the same.
pub fn why_unseen(scene: &Scene, object: &Object, frame: FrameNumber, drawn: bool) -> Unseen {
    let number = frame.get();
    if let Shape::Sequence { files, .. } = &object.shape {
        let [from, to] = scene.shutter.whole_exposure(number);
        if !files.spec().has_files(from, to) {
            return Unseen::NoFile;
        }
        let empty = |parts: &[Object]| parts.iter().all(|part| part.shape.bounds().is_empty());
        return match scene.parts(object, number) {
            Ok(parts) if !empty(&parts) => of_parts(&scene.zoomed(number), &parts, number, drawn),
            // A file that cannot be read has ended the rendering before.
            Ok(_) | Err(_) => Unseen::EmptyFrame,
        };
    }
    if object.shape.bounds().is_empty() {
        return Unseen::Empty;
    }
    of_parts(&scene.zoomed(number), std::slice::from_ref(object), number, drawn)
}

/// How many places of points there are of each kind.
#[derive(Default)]
struct Places {
    hidden: usize,
    behind: usize,
    nearer: usize,
    outside: usize,
    inside: usize,
    /// Places inside that show a front, and those of things larger than a pixel.
    fronts: usize,
    large: usize,
}

fn of_parts(scene: &Scene, parts: &[Object], number: f64, drawn: bool) -> Unseen {
    let mut places = Places::default();
    let readout = &scene.shutter.readout;
    let bands = if readout.rolls() { BANDS } else { 1 };
    let most = PLACES / (bands * INSTANTS * parts.len() * scene.objects.len().max(1));
    for band in 0..bands {
        let row = (band as f64 + 0.5) / bands as f64;
        for instant in 0..INSTANTS {
            let share = (instant as f64 + 0.5) / INSTANTS as f64;
            let time = scene.shutter.frame_time(number, share) + readout.delay(row);
            let rows = readout.rolls().then_some([row - 0.5 / bands as f64, row + 0.5 / bands as f64]);
            for part in parts.iter().filter(|part| part.exists(time)) {
                let instant = Instant::new(scene, part, number, time, rows);
                instant.count(part, most.clamp(1, POINTS), &mut places);
            }
        }
    }
    places.cause(parts.iter().any(|part| part.shape.surface().is_none_or(|surface| surface.two_sided)), drawn)
}

impl Places {
    fn cause(&self, two_sided: bool, drawn: bool) -> Unseen {
        let Self { hidden, behind, nearer, outside, inside, fronts, large } = *self;
        let all = hidden + behind + nearer + outside + inside;
        let missed = inside == 0 || !drawn && (inside as f64) < IN_VIEW * all as f64;
        if missed {
            // A camera can turn to a thing of which a part is before it.
            if outside * OUTSIDE >= all {
                return Unseen::Outside;
            }
            let causes = [(hidden, Unseen::Hidden), (behind, Unseen::Behind), (nearer, Unseen::Nearer)];
            return causes.into_iter().max_by_key(|(count, _)| *count).map_or(Unseen::Outside, |(_, cause)| cause);
        }
        if drawn {
            Unseen::LikeBackground
        } else if two_sided || large * 2 < inside || fronts * 2 > inside {
            Unseen::Small
        } else {
            Unseen::FacingAway
        }
    }
}

/// A part of an object at one time, seen by the camera.
struct Instant<'a> {
    scene: &'a Scene,
    /// `None` where an animation hides it.
    camera_from_model: Option<DMat4>,
    /// Eye, model space.
    eye: DVec3,
    /// Cut-off radius, and size of the whole; camera space.
    radius: f64,
    extent: f64,
    /// Time that points travelled, in the unit of their velocities.
    travelled: f64,
    /// Part of the image that is exposed: from and to, 0..=1 along the read-out; `None`: all.
    rows: Option<[f64; 2]>,
}

impl<'a> Instant<'a> {
    fn new(scene: &'a Scene, part: &Object, number: f64, time: f64, rows: Option<[f64; 2]>) -> Self {
        // Without blur, object and camera are posed at the frame's number.
        let at = if part.blur { time } else { number };
        let pose = object_pose(scene, part, at);
        let camera_from_model = camera_from_world(scene, at) * pose.world_from_model;
        let scale = libm::cbrt(pose.world_from_model.determinant().abs());
        Self {
            scene,
            camera_from_model: pose.visible.then_some(camera_from_model),
            eye: camera_from_model.inverse().transform_point3(DVec3::ZERO),
            radius: f64::from(part.shape.median_radius()) * scale,
            extent: part.shape.bounds().size().length() * scale,
            travelled: part.travelled(scene.frames.rate, number, time),
            rows,
        }
    }

    /// Counts where points of a part are, evenly among all: `most` of them, or the corners of a box where there are no
    /// points.
    fn count(&self, part: &Object, most: usize, places: &mut Places) {
        let bounds = part.shape.bounds();
        let every = part.shape.elements().div_ceil(most).max(1);
        match &part.shape {
            Shape::Gaussians { model, .. } | Shape::Volume { model, .. } => {
                let cropped = |p: &DVec3| p.cmpge(bounds.min).all() && p.cmple(bounds.max).all();
                let shown = model.gaussians().position.iter().step_by(every).map(|p| p.as_dvec3()).filter(cropped);
                shown.for_each(|p| self.place(p, None, places));
            }
            Shape::Surfels { model, .. } if !model.surfels().is_empty() => {
                let (surfels, paths, elapsed) = (model.surfels(), model.paths(), elapsed(self.travelled));
                for i in (0..surfels.len()).step_by(every) {
                    let place = surfels.origin + paths.exact_place(surfels.position[i], i, elapsed);
                    self.place(place, Some(surfels.normal[i].as_dvec3()), places);
                }
            }
            Shape::Surfels { .. } | Shape::Sequence { .. } | Shape::Sphere { .. } => {
                bounds.corners().into_iter().for_each(|p| self.place(p, None, places));
            }
        }
    }

    /// Counts one point.
    fn place(&self, point: DVec3, normal: Option<DVec3>, places: &mut Places) {
        let Some(camera_from_model) = &self.camera_from_model else {
            places.hidden += 1;
            return;
        };
        // Right, up and depth before the camera.
        let p = camera_from_model.transform_point3(point) * DVec3::new(1.0, 1.0, -1.0);
        let camera = &self.scene.camera;
        if p.z <= 0.0 {
            places.behind += 1;
        } else if p.z < camera.near {
            places.nearer += 1;
        } else if self.is_in_image(p) {
            places.inside += 1;
            places.fronts += usize::from(normal.is_none_or(|normal| (self.eye - point).dot(normal) > 0.0));
            let up = (0.5 * camera.fovy).tan();
            let pixels = (self.extent + 2.0 * self.radius) / (p.z * up) * 0.5 * f64::from(self.scene.image.height);
            places.large += usize::from(pixels >= 1.0);
        } else {
            places.outside += 1;
        }
    }

    /// Is a disc about `p` (right, up, depth) in the part of the image that is exposed? Not where `p` is no number.
    fn is_in_image(&self, p: DVec3) -> bool {
        let Scene { image, camera, shutter, .. } = self.scene;
        let up = (0.5 * camera.fovy).tan();
        let half = DVec2::new(up * f64::from(image.width) / f64::from(image.height), up) * p.z;
        // From the left and the lower edge: 0..=1.
        let place = (p.truncate() / half + camera.shift * DVec2::new(2.0, -2.0) + 1.0) * 0.5;
        let reach = self.radius / (2.0 * half);
        let within =
            |axis: usize, [from, to]: [f64; 2], place: f64| place + reach[axis] >= from && place - reach[axis] <= to;
        let is_in = within(0, [0.0, 1.0], place.x) && within(1, [0.0, 1.0], place.y);
        let axis = shutter.readout.direction.axis();
        let along = if axis == 0 { place.x } else { 1.0 - place.y };
        is_in && self.rows.is_none_or(|rows| within(axis, rows, along))
    }
}
