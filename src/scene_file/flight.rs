//! The keys of a camera: read from its element, and made a path through the scene.

use glam::DVec3;

use super::attributes::Part;
use super::dom::Source;
use super::error::{SceneError, quoted};
use crate::anim::{CameraPath, Interpolation, NodeMotion, PathFault, PathKey, PathTarget, PathTiming};
use crate::scene::pose::object_pose;
use crate::scene::{AnimationBinding, Camera, GivenCamera, Scene};

/// A `<camera>` with keys, or with an object that it looks at.
#[derive(Debug)]
pub(super) struct Flight {
    keys: Vec<KeySpec>,
    timing: PathTiming,
    /// Name of the object, and where it is named.
    at_object: Option<(String, usize)>,
    /// Where the camera stands in the file, and attributes of it.
    at: usize,
    spots: Vec<(&'static str, usize)>,
}

/// A `<key>`; what it leaves out is that of the camera.
#[derive(Debug)]
struct KeySpec {
    place: usize,
    spots: Vec<(&'static str, usize)>,
    frame: f64,
    eye: Option<DVec3>,
    at: Option<DVec3>,
    up: Option<DVec3>,
    /// Radians.
    fovy: Option<f64>,
}

/// Where attributes stand in the file.
fn spots(part: &Part<'_>, names: &[&'static str]) -> Vec<(&'static str, usize)> {
    names.iter().filter_map(|&name| part.element.attribute(name).map(|given| (name, given.at))).collect()
}

fn spot(spots: &[(&'static str, usize)], name: &str, element: usize) -> usize {
    spots.iter().find(|(known, _)| *known == name).map_or(element, |&(_, at)| at)
}

impl Flight {
    /// The keys of a `<camera>`; `None`: it has none, and looks at no object.
    pub(super) fn read(camera: &Part<'_>) -> Result<Option<Self>, SceneError> {
        let keys = camera.element.children("key").map(|element| {
            let part = Part::new(camera.source, element, "key");
            let key = KeySpec {
                place: element.at,
                spots: spots(&part, &["frame", "eye", "at", "up", "fovy"]),
                frame: part.number("frame")?,
                eye: part.optional_vector("eye")?,
                at: part.optional_vector("at")?,
                up: part.optional_vector("up")?,
                fovy: part.optional_number("fovy")?.map(f64::to_radians),
            };
            for (name, missing) in [("eye", key.eye.is_none()), ("at", key.at.is_none())] {
                if missing && !camera.given(name) && !(name == "at" && camera.given("atObject")) {
                    return Err(SceneError::BadValue {
                        at: camera.source.locate(element.at),
                        what: format!("`{name}`"),
                        found: "missing".to_owned(),
                        expected: format!("`{name}` of this <key>, or of <camera>"),
                    });
                }
            }
            Ok(key)
        });
        let keys = keys.collect::<Result<Vec<_>, _>>()?;
        let at_object = camera.text("atObject")?.zip(camera.element.attribute("atObject").map(|given| given.at));
        for name in ["speed", "easeIn", "easeOut"] {
            if camera.given(name) && keys.len() < 2 {
                let found = if keys.is_empty() { "without <key>" } else { "with one <key>" };
                return Err(camera.bad(name, &found, "two <key> or more, or no such attribute".to_owned()));
            }
        }
        if keys.is_empty() && at_object.is_none() {
            return Ok(None);
        }
        for other in ["animation", "track"] {
            if let Some(element) = camera.element.child(other) {
                return Err(SceneError::BadValue {
                    at: camera.source.locate(element.at),
                    what: format!("<{other}>"),
                    found: format!("beside {}", if keys.is_empty() { "`atObject`" } else { "<key>" }),
                    expected: "one of the two".to_owned(),
                });
            }
        }
        let timing = PathTiming {
            constant_speed: camera.choice("speed")?.as_deref() == Some("constant"),
            ease_in: camera.number("easeIn")?,
            ease_out: camera.number("easeOut")?,
        };
        let spots = spots(camera, &["easeIn", "easeOut", "speed"]);
        Ok(Some(Self { keys, timing, at_object, at: camera.element.at, spots }))
    }

    /// What the camera has in common with its first key, where it does not say it itself.
    pub(super) fn complete(&self, given: &mut GivenCamera, says_fovy: bool) {
        let Some(first) = self.keys.first() else { return };
        given.eye = first.eye.or(given.eye);
        given.at = first.at.or(given.at);
        given.up = first.up.or(given.up);
        if !says_fovy {
            given.fovy = first.fovy.unwrap_or(given.fovy);
        }
    }

    /// First and last key, seconds, at `rate` frames per second. A camera without keys has no say in the frames.
    pub(super) fn range(&self, rate: f64) -> Option<(f64, f64)> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        Some((first.frame / rate, last.frame / rate))
    }

    /// The camera of `scene`, which stands at `base`, in flight. `common`: what the camera itself says for its keys.
    pub(super) fn fly(
        &self,
        source: &Source,
        scene: &Scene,
        base: Camera,
        common: &GivenCamera,
    ) -> Result<Camera, SceneError> {
        let target = self.target(source, scene)?;
        let key = |spec: &KeySpec| PathKey {
            frame: spec.frame,
            eye: spec.eye.or(common.eye).unwrap_or(base.eye),
            at: spec.at.or(common.at).unwrap_or(base.at),
            up: spec.up.or(common.up).unwrap_or(base.up),
            fovy: spec.fovy.unwrap_or(common.fovy),
        };
        let mut keys: Vec<PathKey> = self.keys.iter().map(key).collect();
        if keys.is_empty() {
            keys.push(PathKey { frame: 0.0, eye: base.eye, at: base.at, up: base.up, fovy: base.fovy });
        }
        for (i, key) in keys.iter_mut().enumerate() {
            if let Some(target) = &target {
                key.at = middle(scene, target, key.frame);
            }
            let view = Camera { up: key.up, ..Camera::new(key.eye, key.at) };
            if let Some([found, expected]) = view.bad_view() {
                let spec = self.keys.get(i);
                return Err(SceneError::BadValue {
                    at: source.locate(spec.map_or(self.at, |spec| spec.place)),
                    what: format!("the view from `eye` to `at` of <{}>", if spec.is_some() { "key" } else { "camera" }),
                    found: found.to_owned(),
                    expected: expected.to_owned(),
                });
            }
        }
        let first = keys[0];
        let path = CameraPath::new(scene.frames.rate, keys, self.timing, target).map_err(|why| {
            let PathFault { key, attribute, found, expected } = why;
            let at = match key.and_then(|i| self.keys.get(i)) {
                Some(key) => spot(&key.spots, attribute, key.place),
                None => spot(&self.spots, attribute, self.at),
            };
            SceneError::BadValue { at: source.locate(at), what: format!("`{attribute}`"), found, expected }
        })?;
        let node = NodeMotion::from(path);
        let binding = AnimationBinding { path: std::path::PathBuf::new(), node, interpolation: Interpolation::Spline };
        let PathKey { eye, at, up, .. } = first;
        Ok(Camera { eye, at, up, animation: Some(binding), automatic: false, ..base })
    }

    fn target(&self, source: &Source, scene: &Scene) -> Result<Option<PathTarget>, SceneError> {
        let Some((name, at)) = &self.at_object else { return Ok(None) };
        let fault = |found: String, expected: String| SceneError::BadValue {
            at: source.locate(*at),
            what: "`atObject`".to_owned(),
            found,
            expected,
        };
        let Some(object) = scene.objects.iter().find(|object| object.name == *name) else {
            let names: Vec<String> = scene.objects.iter().take(20).map(|object| quoted(&object.name)).collect();
            return Err(fault(quoted(name), format!("the name of an object: {}", names.join(", "))));
        };
        let bounds = object.shape.core();
        if bounds.is_empty() {
            return Err(fault(format!("{}, which has no points", quoted(name)), "an object with points".to_owned()));
        }
        Ok(Some(PathTarget { object: name.clone(), centre: bounds.centre() }))
    }
}

/// Where the middle of the target is at scene time `time`, frames.
fn middle(scene: &Scene, target: &PathTarget, time: f64) -> DVec3 {
    let object = scene.objects.iter().find(|object| object.name == target.object);
    object.map_or(target.centre, |object| {
        object_pose(scene, object, time).world_from_model.transform_point3(target.centre)
    })
}
