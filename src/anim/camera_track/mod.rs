//! Poses of a camera as trackers and captures write them.
//!
//! `nerfstudio` (`transforms.json`), `colmap` (`images.txt`, `images.bin`), `tum` and `inria` (`cameras.json`) each
//! make [`Poses`] of a file. All become camera-to-world transforms of a camera that looks along -z with +y up. World
//! axes are left alone.

mod colmap;
mod inria;
mod nerfstudio;
mod text;
mod tum;

use std::cmp::Ordering;
use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3};
use splines::interpolate::Interpolate;

use super::error::AnimError;
use super::load;
use crate::files;

/// The program that wrote a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackFormat {
    /// `transforms.json`.
    Nerfstudio,
    /// `images.txt` or `images.bin`, with the cameras beside it.
    Colmap,
    /// A trajectory of the RGB-D benchmark of TUM.
    Tum,
    /// `cameras.json` of a 3D Gaussian capture (Kerbl et al. 2023).
    Inria,
}

impl TrackFormat {
    /// The words of scene files.
    pub const WORDS: [&'static str; 4] = ["nerfstudio", "colmap", "tum", "3dgs"];

    /// The format that a word stands for.
    pub fn of(word: &str) -> Option<Self> {
        let formats = [Self::Nerfstudio, Self::Colmap, Self::Tum, Self::Inria];
        Self::WORDS.iter().position(|&known| known == word).map(|i| formats[i])
    }

    /// Its word.
    pub fn word(self) -> &'static str {
        Self::WORDS[self as usize]
    }
}

/// What a scene says of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackOptions {
    /// The program that wrote it.
    pub format: TrackFormat,
    /// Lens distortion is left out; otherwise it is refused.
    pub ignore_distortion: bool,
    /// Positions between poses lie on straight lines and not on Catmull-Rom curves.
    pub linear: bool,
    /// Frame of the first pose.
    pub start: f64,
}

/// The lens of a tracked camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Focal length, pixels.
    pub focal: f64,
    /// Where the camera's axis meets the image, pixels from its upper left corner.
    pub principal: [f64; 2],
}

/// One pose of a file.
#[derive(Clone, Debug)]
struct Pose {
    /// What poses are sorted by where they have no time.
    name: String,
    /// Seconds.
    time: Option<f64>,
    position: DVec3,
    /// Camera to world.
    rotation: DQuat,
    lens: Option<Lens>,
}

/// A lens as files have it.
#[derive(Clone, Debug, PartialEq)]
struct Lens {
    size: [f64; 2],
    focal: [f64; 2],
    principal: [f64; 2],
    /// Coefficients of distortion that are not 0, by name.
    distortion: Vec<(&'static str, f64)>,
}

/// The motion of a tracked camera.
#[derive(Clone, Debug)]
pub struct CameraTrack {
    /// What the scene said of it.
    pub options: TrackOptions,
    /// The lens of the first pose, where the file has one.
    pub intrinsics: Option<Intrinsics>,
    /// What a user should know about how it was read.
    pub notes: Vec<String>,
    keys: Vec<Key>,
}

#[derive(Clone, Copy, Debug)]
struct Key {
    seconds: f64,
    position: DVec3,
    rotation: DQuat,
}

/// Largest coordinate, as in scene files.
const FAR: f64 = 1e30;

impl CameraTrack {
    /// Reads a file, for a scene of `rate` frames per second.
    ///
    /// Poses with times (TUM) keep their distances; the first one is at frame `start`. All others are sorted by the
    /// name of their image, digits as numbers, and stand one frame apart.
    ///
    /// # Errors
    /// The file cannot be read or is not valid, or the lens is distorted or its pixels are not square.
    pub fn load(path: &Path, options: TrackOptions, rate: f64) -> Result<Self, AnimError> {
        files::steady(|| Self::load_once(path, options, rate))
    }

    fn load_once(path: &Path, options: TrackOptions, rate: f64) -> Result<Self, AnimError> {
        let bytes = load::bytes(path)?;
        let wrong = |place: String, found: String, expected: &str| AnimError::Track {
            path: path.to_owned(),
            place,
            found,
            expected: expected.to_owned(),
        };
        let poses = match options.format {
            TrackFormat::Nerfstudio => nerfstudio::parse(&bytes),
            TrackFormat::Colmap => colmap::parse(&bytes, path)?,
            TrackFormat::Tum => tum::parse(&bytes),
            TrackFormat::Inria => inria::parse(&bytes),
        };
        let poses = poses.map_err(|Fault { place, found, expected }| wrong(place, found, &expected))?;
        Self::of_poses(poses, options, rate).map_err(|Fault { place, found, expected }| wrong(place, found, &expected))
    }

    fn of_poses(mut poses: Vec<Pose>, options: TrackOptions, rate: f64) -> Result<Self, Fault> {
        if poses.is_empty() {
            return Err(fault("", "no pose", "at least one"));
        }
        for pose in &poses {
            if !(pose.position.is_finite() && pose.position.abs().max_element() <= FAR) {
                let found = format!("the position {}", pose.position);
                return Err(fault(&pose.name, found, "finite numbers up to 1e30"));
            }
        }
        let timed = poses.iter().all(|pose| pose.time.is_some());
        if timed {
            let time = |pose: &Pose| pose.time.unwrap_or_default();
            if let Some(pair) =
                poses.windows(2).find(|pair| time(&pair[1]).partial_cmp(&time(&pair[0])) != Some(Ordering::Greater))
            {
                let found = format!("the time {}", time(&pair[1]));
                return Err(fault(
                    &pair[1].name,
                    found,
                    format!("more than {}, that of the pose before", time(&pair[0])),
                ));
            }
        } else {
            poses.sort_by(|a, b| natural(&a.name, &b.name));
        }
        let mut notes = Vec::new();
        let lens = poses[0].lens.clone();
        if poses.iter().any(|pose| pose.lens != lens) {
            notes.push("poses have different lenses: that of the first one is taken".to_owned());
        }
        let intrinsics = lens.map(|lens| lens.intrinsics(options, &mut notes)).transpose()?;
        let first = poses[0].time.unwrap_or_default();
        let keys = poses.iter().enumerate().map(|(i, pose)| Key {
            seconds: options.start / rate + pose.time.map_or(i as f64 / rate, |time| time - first),
            position: pose.position,
            rotation: pose.rotation,
        });
        Ok(Self { options, intrinsics, notes, keys: keys.collect() })
    }

    /// Camera to world at a time; before the first and after the last pose the camera rests.
    ///
    /// At a pose it is that of the file. Between poses, rotations turn at constant speed the shorter way (slerp), and
    /// positions lie on a Catmull-Rom curve through the poses, whose slope at a pose is that between its neighbours, or
    /// on straight lines.
    pub fn at(&self, seconds: f64) -> DMat4 {
        let next = self.keys.partition_point(|key| key.seconds <= seconds);
        let (Some(from), Some(to)) = (next.checked_sub(1).map(|i| self.keys[i]), self.keys.get(next).copied()) else {
            let end = if next == 0 { self.keys.first() } else { self.keys.last() };
            return end.map_or(DMat4::IDENTITY, |key| DMat4::from_rotation_translation(key.rotation, key.position));
        };
        let t = (seconds - from.seconds) / (to.seconds - from.seconds);
        let rotation = from.rotation.slerp(to.rotation, t);
        let position = if self.options.linear { from.position.lerp(to.position, t) } else { self.on_curve(next, t) };
        DMat4::from_rotation_translation(rotation, position)
    }

    /// The place at the share `t` between key `next` - 1 and key `next`.
    fn on_curve(&self, next: usize, t: f64) -> DVec3 {
        let (a, b) = (self.keys[next - 1], self.keys[next]);
        // Beyond the ends the curve goes on straight.
        let beyond = |near: Key, far: Key| Key {
            seconds: 2.0 * near.seconds - far.seconds,
            position: near.position * 2.0 - far.position,
            ..near
        };
        let x = next.checked_sub(2).map_or_else(|| beyond(a, b), |i| self.keys[i]);
        let y = self.keys.get(next + 1).copied().unwrap_or_else(|| beyond(b, a));
        DVec3::from_array([0, 1, 2].map(|axis| {
            let [x, a, b, y] = [x, a, b, y].map(|key| (key.seconds, key.position[axis]));
            Interpolate::cubic_hermite(t, x, a, b, y)
        }))
    }

    /// First and last pose, seconds.
    pub fn range(&self) -> (f64, f64) {
        let ends = [self.keys.first(), self.keys.last()];
        let [first, last] = ends.map(|key| key.map_or(0.0, |key| key.seconds));
        (first, last)
    }

    /// Number of poses.
    pub fn poses(&self) -> usize {
        self.keys.len()
    }
}

impl Lens {
    fn intrinsics(&self, options: TrackOptions, notes: &mut Vec<String>) -> Result<Intrinsics, Fault> {
        /// Sizes of images, as pictures have them.
        const MOST_SIZE: f64 = 65_535.0;
        let [width, height] = self.size;
        let [fx, fy] = self.focal;
        let sound = |x: f64, most: f64| x > 0.0 && x <= most;
        if !(sound(width, MOST_SIZE) && sound(height, MOST_SIZE) && width.fract() == 0.0 && height.fract() == 0.0) {
            let expected = format!("whole numbers up to {MOST_SIZE}");
            return Err(fault("", format!("an image of {width} x {height} pixels"), expected));
        }
        if !(sound(fx, 1e9) && sound(fy, 1e9)) {
            return Err(fault("", format!("the focal lengths {fx} and {fy}"), "pixels, above 0"));
        }
        if !self.principal.iter().all(|x| x.abs() <= 1e9) {
            let [x, y] = self.principal;
            return Err(fault("", format!("the principal point {x} {y}"), "pixels"));
        }
        let mut ignored: Vec<String> = self.distortion.iter().map(|(name, k)| format!("{name} {k}")).collect();
        if (fx / fy - 1.0).abs() > 1e-3 {
            ignored.push(format!("fl_x {fx} beside fl_y {fy}"));
        }
        if !ignored.is_empty() && !options.ignore_distortion {
            let found = format!("a lens with distortion ({})", ignored.join(", "));
            return Err(fault("", found, "none, or `distortion=\"ignore\"` and undistorted pictures"));
        }
        if !ignored.is_empty() {
            notes.push(format!("distortion ignored: {}", ignored.join(", ")));
        }
        Ok(Intrinsics { size: [width as u32, height as u32], focal: fy, principal: self.principal })
    }
}

/// A fault of a file, and where it is.
#[derive(Debug)]
struct Fault {
    /// Empty, or the place with a colon and a blank behind it.
    place: String,
    found: String,
    expected: String,
}

fn fault(place: &str, found: impl Into<String>, expected: impl Into<String>) -> Fault {
    let place = if place.is_empty() { String::new() } else { format!("{place}: ") };
    Fault { place, found: found.into(), expected: expected.into() }
}

/// The rotation of a matrix, by rows; `None` where it is none.
fn rotation(rows: [[f64; 3]; 3]) -> Option<DQuat> {
    let m = DMat3::from_cols_array_2d(&rows).transpose();
    let identity = (m * m.transpose() - DMat3::IDENTITY).to_cols_array();
    let is_rotation = identity.iter().all(|x| x.abs() < 1e-3) && m.determinant() > 0.0;
    is_rotation.then(|| DQuat::from_mat3(&m).normalize())
}

/// A quaternion of any length above 0.
fn quaternion(x: f64, y: f64, z: f64, w: f64) -> Option<DQuat> {
    let q = DQuat::from_xyzw(x, y, z, w);
    let length = q.length();
    (length.is_finite() && length > 1e-9).then(|| q * (1.0 / length))
}

/// From axes of `OpenCV` (x right, y down, z forward) to ours (y up, looking along -z).
fn of_open_cv(rotation: DQuat) -> DQuat {
    rotation * DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0)
}

/// Order of names in which runs of digits count as numbers.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        let digits = |s: &[u8]| s.iter().take_while(|c| c.is_ascii_digit()).count();
        let (n, m) = (digits(a), digits(b));
        if n > 0 && m > 0 {
            let number = |s: &[u8], n: usize| {
                let zeros = s[..n].iter().take_while(|&&c| c == b'0').count();
                s[zeros..n].to_vec()
            };
            let (x, y) = (number(a, n), number(b, m));
            let order = x.len().cmp(&y.len()).then_with(|| x.cmp(&y)).then_with(|| n.cmp(&m));
            if order != Ordering::Equal {
                return order;
            }
            (a, b) = (&a[n..], &b[m..]);
            continue;
        }
        match (a.split_first(), b.split_first()) {
            (Some((x, rest)), Some((y, others))) if x == y => (a, b) = (rest, others),
            (x, y) => return x.map(|x| x.0).cmp(&y.map(|y| y.0)),
        }
    }
}
