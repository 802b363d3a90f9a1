//! A rolling shutter: the strips of a raster that are posed together.
//!
//! Each row (or column) of the image has times of its own. A strip holds so many neighbouring ones that everything
//! moves almost steadily while it is read out. It is a raster of its own, posed at the time of its middle; `project`
//! finds for each splat when the row on which it lands is read out (docs/math.md, section 15).

use std::ops::Range;

use glam::{DMat3, DMat4, DVec2, DVec3};

use crate::math::focal_length;
use crate::model::paths::elapsed;
use crate::scene::pose::{camera_from_world, jumps, object_pose};
use crate::scene::{Object, Scene};
use crate::time::{FrameNumber, Readout};

/// Farthest that anything may be from steady motion while a strip is read out, pixels.
const BEND: f64 = 0.05;
/// Farthest that a camera may turn while a strip is read out, radians: highlights and what is mirrored are those of the
/// middle of a strip.
const TURN: f64 = 0.004;
/// Most poses that are looked at.
const MOST_POSES: usize = 50_000;
/// Most poses of objects of all strips and samples together: half a gigabyte. Where that is too few, strips are longer.
const MOST_POSED: usize = 1 << 19;
/// Times at which the motion of an object is looked at.
const WINDOWS: usize = 24;
/// Most points of an object whose motion is looked at.
const MOST_POINTS: usize = 96;

/// The strips of all rasters of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Strips {
    readout: Readout,
    /// Pixels of the image along the read-out.
    pixels: u32,
    /// Pixels of the image from one pixel of a raster to the next.
    stride: u32,
    /// Raster pixels along the read-out at which strips begin, and where the last one ends.
    edges: Vec<u32>,
    /// Something jumps while the frame is exposed: each row is posed by itself, and nothing moves while it is read out.
    jumps: bool,
}

/// A strip of one raster: the pixels that are posed together, and when they are read out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PosedStrip {
    /// The axis of the image along which times change: 0 for columns, 1 for rows.
    pub axis: usize,
    /// Pixels along that axis that the image takes.
    pub shown: Range<u32>,
    /// These, and the pixels around them that filters reach.
    pub posed: Range<u32>,
    /// Delay of the strip's middle, frames.
    pub delay: f64,
    /// Time from the strip's middle to its later edge in the image (bottom or right), frames; negative where that edge
    /// is read out first.
    pub half: f64,
}

impl Strips {
    /// The strips of frame `number`, whose `samples` lie between `times` (scene times, frames, without delays). `None`
    /// where all pixels are exposed at once.
    pub(super) fn of(scene: &Scene, number: FrameNumber, times: [f64; 2], samples: usize, stride: u32) -> Option<Self> {
        let readout = scene.shutter.readout;
        if !readout.rolls() {
            return None;
        }
        let pixels = [scene.image.width, scene.image.height][readout.direction.axis()];
        let rows = pixels.div_ceil(stride);
        let [first, last] = readout.delays();
        let range = [times[0] + first, times[1] + last];
        // A jump lies between two rows, which are others at each sample.
        let jumps = !jumps(scene, range[0], range[1]).is_empty();
        let most = MOST_POSED / samples.saturating_mul(scene.objects.len()).max(1);
        let most = rows.min(u32::try_from(most).unwrap_or(u32::MAX)).max(1);
        let count = if jumps { most } else { count(scene, number.get(), range, rows).clamp(1, most) };
        let edges = (0..=count).map(|i| (u64::from(i) * u64::from(rows) / u64::from(count)) as u32).collect();
        Some(Self { readout, pixels, stride, edges, jumps })
    }

    /// Pixels of a raster, from its top or left edge on.
    pub(super) fn ranges(&self) -> impl Iterator<Item = Range<u32>> {
        self.edges.windows(2).map(|edges| edges[0]..edges[1])
    }

    /// The strip whose pixels `shown` the image takes, of a raster of `size` pixels with this phase. It is posed with
    /// `apron` pixels more on both sides.
    pub(super) fn strip(&self, shown: Range<u32>, apron: u32, size: [u32; 2], phase: [u32; 2]) -> PosedStrip {
        let axis = self.readout.direction.axis();
        let posed = with_apron(&shown, apron, size[axis]);
        let (pixels, stride) = (f64::from(self.pixels), f64::from(self.stride));
        let timed = if self.jumps { &shown } else { &posed };
        let middle = 0.5 * (f64::from(timed.start) + f64::from(timed.end));
        let place = ((middle - 0.5) * stride + f64::from(phase[axis]) + 0.5) / pixels;
        let half = 0.5 * f64::from(timed.end - timed.start) * stride / pixels;
        let sign = if self.readout.direction.rises() { 1.0 } else { -1.0 };
        let half = if self.jumps { 0.0 } else { half * sign * self.readout.duration };
        PosedStrip { axis, delay: self.readout.delay(place), half, shown, posed }
    }
}

/// The pixels `shown` and `apron` more on both sides, of a raster with `rows` pixels. They begin at an even pixel:
/// neighbours that are looked at together stay together.
fn with_apron(shown: &Range<u32>, apron: u32, rows: u32) -> Range<u32> {
    let start = shown.start.saturating_sub(apron) & !1;
    start..(shown.end + apron).next_multiple_of(2).min(rows).max(start)
}

/// How many strips there are, of at most `rows`, of a frame that is exposed within `range` (scene times, frames).
fn count(scene: &Scene, number: f64, range: [f64; 2], rows: u32) -> u32 {
    let readout = scene.shutter.readout;
    let rests = |object: &Object| object.is_fixed() && object.shape.paths().is_empty() && scene.camera.rests();
    let moving: Vec<&Object> = scene.objects.iter().filter(|object| object.blur && !rests(object)).collect();
    if moving.is_empty() && scene.camera.rests() {
        return 1;
    }
    let windows = (MOST_POSES / 5 / moving.len().max(1)).clamp(4, WINDOWS);
    let mut count = 1;
    while count < rows {
        let length = readout.duration / f64::from(count);
        let starts = (0..windows).map(|i| {
            let share = i as f64 / (windows - 1) as f64;
            range[0] + (range[1] - range[0] - length).max(0.0) * share
        });
        let steady = |start: f64| {
            turn(scene, start, length) <= TURN
                && moving.iter().all(|object| bend(scene, object, number, start, length) <= BEND)
        };
        if starts.into_iter().all(steady) {
            return count;
        }
        count *= 2;
    }
    rows
}

/// Angle by which the camera turns from `start` on in `length` frames, radians.
fn turn(scene: &Scene, start: f64, length: f64) -> f64 {
    if scene.camera.rests() {
        return 0.0;
    }
    let [a, b] = [start, start + length].map(|time| DMat3::from_mat4(camera_from_world(scene, time)));
    // The chord between the axes that turn farthest.
    let chords = [(a.x_axis, b.x_axis), (a.y_axis, b.y_axis), (a.z_axis, b.z_axis)];
    chords.into_iter().map(|(a, b)| a.distance(b)).fold(0.0, f64::max)
}

/// Farthest that a point of an object is from steady motion between `start` and `start + length`, pixels: the motion
/// that its poses at the middle and at both ends make (`Poser`). Points outside the image do not count.
fn bend(scene: &Scene, object: &Object, number: f64, start: f64, length: f64) -> f64 {
    let paths = object.shape.paths();
    let at = |share: f64| {
        let time = start + share * length;
        let pose: DMat4 = camera_from_world(scene, time) * object_pose(scene, object, time).world_from_model;
        let travelled = if paths.is_empty() { 0.0 } else { object.travelled(scene.frames.rate, number, time) };
        (pose, elapsed(travelled).map(|factor| factor as f32))
    };
    let poses = [0.0, 0.25, 0.5, 0.75, 1.0].map(at);
    let image = Image::of(scene);
    let (positions, origin) = (object.shape.positions(), object.shape.origin());
    let of_point = |index: usize| {
        let places = poses.map(|(pose, elapsed)| {
            pose.transform_point3(paths.place(positions[index], index, elapsed).as_dvec3() + origin)
        });
        image.bend(places)
    };
    let step = positions.len().div_ceil(MOST_POINTS).max(1);
    (0..positions.len()).step_by(step).map(of_point).fold(0.0, f64::max)
}

/// The image as points of camera space see it.
struct Image {
    /// Width and height, pixels.
    size: DVec2,
    /// Focal length, pixels.
    focal: f64,
    /// From the image's middle to the camera's axis, pixels, y down.
    axis: DVec2,
    /// Nearest visible depth, scene units.
    near: f64,
}

impl Image {
    fn of(scene: &Scene) -> Self {
        let [width, height] = [scene.image.width, scene.image.height].map(f64::from);
        let size = DVec2::new(width, height);
        let focal = focal_length(height, scene.camera.fovy);
        Self { size, focal, axis: scene.camera.shift * size, near: scene.camera.near }
    }

    /// Pixels from the camera's axis, y up, of a point in camera space.
    fn project(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.x, p.y) * (self.focal / -p.z)
    }

    fn holds(&self, p: DVec2) -> bool {
        (p.x + self.axis.x).abs() <= 0.5 * self.size.x && (self.axis.y - p.y).abs() <= 0.5 * self.size.y
    }

    /// Farthest that a point is from steady motion, pixels: at both ends, the quarters and the middle of its path
    /// through camera space. 0 where it is never seen.
    fn bend(&self, places: [DVec3; 5]) -> f64 {
        let is_near = |p: &DVec3| p.is_nan() || -p.z < self.near;
        if places.iter().any(is_near) || !places.iter().any(|&p| self.holds(self.project(p))) {
            return 0.0;
        }
        let [from, early, middle, late, to] = places;
        let centre = middle + (0.5 * (from + to) - middle) * 0.5;
        let half = 0.5 * (to - from);
        let steady = [(-1.0, from), (-0.5, early), (0.0, middle), (0.5, late), (1.0, to)];
        let miss = |(t, p): (f64, DVec3)| self.project(centre + half * t).distance(self.project(p));
        steady.into_iter().map(miss).fold(0.0, f64::max)
    }
}
