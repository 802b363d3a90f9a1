//! A resolved scene back to canonical XML that loads to the same scene.
//!
//! Every value is written, whether it was given or is a default, with the fewest digits that give the same number back.
//! What has no place in a scene file is left out: the models and curves themselves, and whether the camera was chosen
//! automatically (it is written as a camera like any other).

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use glam::{DVec3, Vec3};

use super::xml::is_xml;
use crate::anim::{CameraPath, Interpolation, NodeMotion, PathKey, PathTiming, TrackOptions};
use crate::limits::{LIGHT, MOST_INTENSITY};
use crate::math::Trs;
use crate::model::{
    ColourBy, ColourSpace, Kind, LoadOptions, MeshOptions, PointOptions, Spacing, TransferFunction, VelocityUnit,
    VolumeOptions,
};
use crate::options::Detail;
use crate::scene::{AnimationBinding, Camera, Drawing, Light, Motion, Object, PointMotion, Scene, Shape};
use crate::time::{Shutter, Weight};

/// The scene as UTF-8 XML; paths are written relative to the directory `relative_to`, where the file is to stand.
pub fn to_xml(scene: &Scene, relative_to: &Path) -> String {
    let mut out = Xml(String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<scene>\n"));
    let image = &scene.image;
    out.line(
        1,
        "image",
        &[
            ("width", image.width.to_string()),
            ("height", image.height.to_string()),
            ("background", vector(image.background)),
            ("transparent", image.transparent.to_string()),
        ],
    );
    let frames = &scene.frames;
    out.line(
        1,
        "frames",
        &[("first", frames.first.to_string()), ("last", frames.last.to_string()), ("rate", number(frames.rate))],
    );
    out.shutter(&scene.shutter);
    out.camera(1, &scene.camera, relative_to);
    // A file without any light has those of the default.
    let is_lit = scene.environment.as_ref().is_some_and(|environment| environment.light);
    let darkness = (scene.lights.is_empty() && !is_lit).then_some(Light::Ambient { colour: DVec3::ZERO });
    scene.lights.iter().chain(&darkness).for_each(|light| out.light(light));
    if let Some(environment) = &scene.environment {
        let attributes = [
            ("intensity", number(environment.intensity)),
            ("rotation", degrees(environment.rotation)),
            ("background", environment.background.to_string()),
            ("light", environment.light.to_string()),
            ("shadows", environment.shadows.to_string()),
        ];
        out.file(1, "environment", &attributes, &relative(&environment.path, relative_to));
    }
    scene.objects.iter().for_each(|object| out.object(object, relative_to));
    out.0.push_str("</scene>\n");
    out.0
}

/// A camera without animation as one `<camera .../>` element.
pub fn camera_line(camera: &Camera) -> String {
    let mut out = Xml(String::new());
    out.open(0, "camera", &camera_attributes(camera));
    out.0 + "/>"
}

fn camera_attributes(camera: &Camera) -> [(&'static str, String); 5] {
    [
        ("eye", vector(camera.eye)),
        ("at", vector(camera.at)),
        ("up", vector(camera.up)),
        ("fovy", degrees(camera.fovy)),
        ("near", number(camera.near)),
    ]
}

/// How a path is flown; what is as by default is left out, because one key alone takes none of it.
fn path_attributes(path: &CameraPath) -> Vec<(&'static str, String)> {
    let PathTiming { constant_speed, ease_in, ease_out } = path.timing();
    let mut attributes = Vec::new();
    attributes.extend(path.target.as_ref().map(|target| ("atObject", target.object.clone())));
    attributes.extend(constant_speed.then(|| ("speed", "constant".to_owned())));
    let easing = [("easeIn", ease_in), ("easeOut", ease_out)].into_iter().filter(|(_, frames)| *frames > 0.0);
    attributes.extend(easing.map(|(name, frames)| (name, number(frames))));
    attributes
}

/// A camera's keys as a file of their own, for `--camera-path`.
pub fn camera_path(camera: &Camera) -> String {
    let mut out = Xml(String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"));
    out.camera(0, camera, Path::new(""));
    out.0
}

struct Xml(String);

impl Xml {
    /// `<name attribute="value" ...` without its end.
    fn open(&mut self, depth: usize, name: &str, attributes: &[(&str, String)]) {
        self.0.extend(std::iter::repeat_n("  ", depth));
        self.0.push('<');
        self.0.push_str(name);
        for (name, value) in attributes {
            let _ = write!(self.0, " {name}=\"{}\"", escaped(value));
        }
    }

    fn line(&mut self, depth: usize, name: &str, attributes: &[(&str, String)]) {
        self.open(depth, name, attributes);
        self.0.push_str("/>\n");
    }

    fn file(&mut self, depth: usize, name: &str, attributes: &[(&str, String)], path: &str) {
        self.open(depth, name, attributes);
        let _ = writeln!(self.0, ">{}</{name}>", escaped(path));
    }

    fn shutter(&mut self, shutter: &Shutter) {
        let mut attributes = vec![("open", number(shutter.open)), ("close", number(shutter.close))];
        let readout = shutter.readout;
        if readout.rolls() {
            attributes.push(("readout", number(readout.duration)));
            attributes.push(("direction", readout.direction.name().to_owned()));
            attributes.push(("anchor", readout.anchor.name().to_owned()));
        }
        let mut shape = |weight: &str, values: &[(&'static str, f64)]| {
            attributes.push(("weight", weight.to_owned()));
            attributes.extend(values.iter().map(|&(name, x)| (name, number(x))));
        };
        match &shutter.weight {
            Weight::Box => shape("box", &[]),
            Weight::Tent => shape("tent", &[]),
            Weight::Ramp { centre } => shape("ramp", &[("centre", *centre)]),
            Weight::Exponential { rate, centre } => shape("exponential", &[("rate", *rate), ("centre", *centre)]),
            Weight::OneMinusExponential { centre } => shape("one-minus-exponential", &[("centre", *centre)]),
            Weight::Gaussian { centre, width } => shape("gaussian", &[("centre", *centre), ("width", *width)]),
            Weight::Curve(points) => {
                self.open(1, "shutter", &attributes);
                self.0.push_str(">\n    <curve>\n");
                for &(time, weight) in points {
                    self.line(3, "point", &[("time", number(time)), ("weight", number(weight))]);
                }
                self.0.push_str("    </curve>\n  </shutter>\n");
                return;
            }
        }
        self.line(1, "shutter", &attributes);
    }

    fn camera(&mut self, depth: usize, camera: &Camera, base: &Path) {
        let mut attributes = camera_attributes(camera).to_vec();
        let path = camera.animation.as_ref().and_then(|binding| match &binding.node {
            NodeMotion::Path(path) => Some(path),
            NodeMotion::Curves(_) | NodeMotion::Chain(_) | NodeMotion::Track(_) => None,
        });
        if let Some(path) = path {
            attributes.extend(path_attributes(path));
        }
        self.open(depth, "camera", &attributes);
        if camera.rests() {
            self.0.push_str("/>\n");
            return;
        }
        self.0.push_str(">\n");
        if let Some(animation) = &camera.animation {
            self.animation(animation, base);
        }
        camera.motions.iter().for_each(|motion| self.motion(motion));
        self.0.push_str(if depth == 0 { "</camera>\n" } else { "  </camera>\n" });
    }

    fn key(&mut self, key: &PathKey) {
        let PathKey { frame, eye, at, up, fovy } = *key;
        let attributes = [
            ("frame", number(frame)),
            ("eye", vector(eye)),
            ("at", vector(at)),
            ("up", vector(up)),
            ("fovy", degrees(fovy)),
        ];
        self.line(2, "key", &attributes);
    }

    fn light(&mut self, light: &Light) {
        let (kind, place, colour, size) = match *light {
            Light::Directional { direction, colour, angle, .. } => {
                let angle = (angle != Light::ANGLE_DEGREES.to_radians()).then(|| ("angle", degrees(angle)));
                ("directional", Some(("direction", direction)), colour, angle)
            }
            Light::Point { position, colour, radius, .. } => {
                let radius = (radius != 0.0).then(|| ("radius", number(radius)));
                ("point", Some(("position", position)), colour, radius)
            }
            Light::Ambient { colour } => ("ambient", None, colour, None),
        };
        let mut attributes = vec![("type", kind.to_owned())];
        attributes.extend(place.map(|(name, v)| (name, vector(v))));
        // Colours are kept multiplied by the intensity, which may take them out of one attribute's range.
        let largest = colour.max_element();
        let intensity = if largest > LIGHT.1 { largest.log2().ceil().exp2().min(MOST_INTENSITY) } else { 1.0 };
        attributes.extend([("colour", vector(colour / intensity)), ("intensity", number(intensity))]);
        if !light.has_shadows() && !matches!(light, Light::Ambient { .. }) {
            attributes.push(("shadows", "false".to_owned()));
        }
        attributes.extend(size);
        self.line(1, "light", &attributes);
    }

    fn object(&mut self, object: &Object, base: &Path) {
        let mut attributes = vec![("name", object.name.clone()), ("blur", object.blur.to_string())];
        attributes.extend((!object.receive_shadows).then(|| ("receiveShadows", "false".to_owned())));
        attributes.extend(object.shadow_catcher.then(|| ("shadowCatcher", "true".to_owned())));
        attributes.extend((!object.cast_shadows).then(|| ("castShadows", "false".to_owned())));
        let surface = object.shape.surface();
        attributes.extend(surface.map(|surface| ("twoSided", surface.two_sided.to_string())));
        attributes.extend(object.epsilon.map(|e| ("epsilon", number(e))));
        attributes.extend((object.detail != Detail::Auto).then(|| ("detail", object.detail.to_string())));
        let points = match &object.shape {
            Shape::Surfels { points, .. } => *points,
            Shape::Sequence { unit, .. } => PointMotion { unit: *unit, at: None },
            Shape::Gaussians { .. } | Shape::Volume { .. } | Shape::Sphere { .. } => PointMotion::default(),
        };
        attributes.extend(points.unit.map(|unit| {
            let word = match unit {
                VelocityUnit::Second => "second",
                VelocityUnit::Frame => "frame",
            };
            ("velocityUnit", word.to_owned())
        }));
        attributes.extend(points.at.map(|at| ("at", number(at))));
        self.open(1, "object", &attributes);
        self.0.push_str(">\n");
        self.shape(object, base);
        self.placement("transform", &object.transform);
        if let Some(animation) = &object.animation {
            self.animation(animation, base);
        }
        object.motions.iter().for_each(|motion| self.motion(motion));
        self.placement("place", &object.place);
        // That of colours by a column follows from the lights.
        let material = object.shape.material().filter(|_| !object.is_coloured_by());
        let coefficients = material.map(|m| {
            [
                ("ambient", m.ambient.to_string()),
                ("diffuse", m.diffuse.to_string()),
                ("specular", m.specular.to_string()),
                ("shininess", m.shininess.to_string()),
            ]
        });
        // With its opacity and reflection alone it leaves the coefficients of the model's file.
        let (opacity, reflection) = match surface {
            Some(surface) => (object.opacity, surface.reflection),
            // The element of the shape has the opacity.
            None => (1.0, 0.0),
        };
        if coefficients.is_some() || opacity != 1.0 || reflection != 0.0 {
            let mut attributes: Vec<_> = coefficients.into_iter().flatten().collect();
            attributes.extend([("opacity", number(opacity)), ("reflection", number(reflection))]);
            self.line(2, "material", &attributes);
        }
        if let Some(transfer) = &object.source.options.volume.transfer {
            self.transfer(transfer);
        }
        self.0.push_str("  </object>\n");
    }

    fn shape(&mut self, object: &Object, base: &Path) {
        if let Shape::Sphere { sphere, .. } = &object.shape {
            let Vec3 { x, y, z } = sphere.colour;
            let attributes = [("radius", number(sphere.radius)), ("colour", format!("{x} {y} {z}"))];
            return self.line(2, "sphere", &attributes);
        }
        let LoadOptions { kind, radius_scale, colour_space, volume, mesh, node, points } = &object.source.options;
        let mut attributes = vec![("radiusScale", number(*radius_scale))];
        attributes.extend(colour_space.map(|c| {
            let word = match c {
                ColourSpace::Srgb => "srgb",
                ColourSpace::Linear => "linear",
            };
            ("colourSpace", word.to_owned())
        }));
        attributes.extend(kind.map(|kind| {
            let word = match kind {
                Kind::Surfels => "surfels",
                Kind::Spheres => "spheres",
                Kind::Gaussians => "gaussians",
                Kind::Volume => "volume",
            };
            ("kind", word.to_owned())
        }));
        if *mesh != MeshOptions::default() {
            let spacing = match mesh.spacing {
                // A number of surfels has no place in a scene file.
                Spacing::Auto | Spacing::Surfels(_) => None,
                Spacing::Of(spacing) => Some(number(spacing)),
                Spacing::None => Some("none".to_owned()),
            };
            attributes.extend(spacing.map(|spacing| ("spacing", spacing)));
            attributes.push(("reduce", mesh.reduce.to_string()));
        }
        let VolumeOptions { transfer: _, kernel, flatten, lit } = volume;
        if matches!(object.shape, Shape::Volume { .. }) || *volume != VolumeOptions::default() {
            let flatten = if flatten.is_infinite() { "infinite".to_owned() } else { number(*flatten) };
            attributes.extend([("kernel", number(*kernel)), ("flatten", flatten), ("lit", lit.to_string())]);
        }
        attributes.extend(node.clone().map(|node| ("node", node)));
        let PointOptions { every, classes, clean, scanner, radius, colour_by } = points;
        if *every > 1 {
            attributes.push(("every", every.to_string()));
        }
        if !classes.is_empty() {
            let words: Vec<String> = classes.iter().map(u8::to_string).collect();
            attributes.push(("classes", words.join(",")));
        }
        if *clean {
            attributes.push(("clean", "true".to_owned()));
        }
        attributes.extend(scanner.map(|place| ("scannerPosition", vector(place))));
        attributes.extend(radius.map(|radius| ("radius", number(radius))));
        if let Some(ColourBy { column, map, range }) = colour_by {
            let map = if map.is_table() { relative(Path::new(&map.to_string()), base) } else { map.to_string() };
            attributes.extend([("colourBy", column.clone()), ("colourMap", map)]);
            attributes.extend(range.map(|[first, last]| ("range", format!("{first}..{last}"))));
        }
        if let Some(Drawing { opacity, harmonics, crop, antialias, flat: _ }) = object.shape.drawing(object.opacity) {
            attributes.extend([("opacity", number(opacity)), ("shDegree", harmonics.to_string())]);
            if let Some([min, max]) = crop {
                attributes.extend([("cropMin", vector(min)), ("cropMax", vector(max))]);
            }
            attributes.extend(antialias.map(|on| ("antialias", on.to_string())));
        }
        let Shape::Sequence { files, .. } = &object.shape else {
            return self.file(2, "pointModel", &attributes, &relative(&object.source.path, base));
        };
        let spec = files.spec();
        let first = relative(&spec.pattern.path(spec.first), base);
        let pattern = spec.pattern.at(spec.first, Path::new(&first)).unwrap_or_else(|| spec.pattern.clone());
        attributes.extend([("sequence", pattern.to_string()), ("first", spec.first.to_string())]);
        attributes.extend([
            ("last", spec.last.to_string()),
            ("offset", number(spec.offset)),
            ("rate", number(spec.rate)),
        ]);
        attributes.extend(spec.match_within.map(|within| ("match", number(within))));
        self.line(2, "pointModel", &attributes);
    }

    fn transfer(&mut self, transfer: &TransferFunction) {
        self.0.push_str("    <transferFunction>\n");
        for stop in transfer.stops() {
            let Vec3 { x, y, z } = stop.colour;
            let attributes =
                [("value", number(stop.value)), ("colour", format!("{x} {y} {z}")), ("opacity", number(stop.opacity))];
            self.line(3, "stop", &attributes);
        }
        self.0.push_str("    </transferFunction>\n");
    }

    fn placement(&mut self, name: &str, trs: &Trs) {
        let DVec3 { x, y, z } = trs.rotate;
        self.line(
            2,
            name,
            &[
                ("translate", vector(trs.translate)),
                ("rotate", format!("{} {} {}", degrees(x), degrees(y), degrees(z))),
                ("scale", vector(trs.scale)),
            ],
        );
    }

    fn animation(&mut self, binding: &AnimationBinding, base: &Path) {
        let node = match &binding.node {
            NodeMotion::Curves(node) => node,
            NodeMotion::Chain(chain) => {
                let attributes =
                    [("node", chain.label.clone()), ("fps", number(chain.fps)), ("loop", chain.looped.to_string())];
                return self.file(2, "animation", &attributes, &relative(&binding.path, base));
            }
            NodeMotion::Track(track) => {
                let TrackOptions { format, ignore_distortion, linear, start } = track.options;
                let attributes = [
                    ("format", format.word().to_owned()),
                    ("start", number(start)),
                    ("positions", if linear { "linear" } else { "catmull-rom" }.to_owned()),
                    ("distortion", if ignore_distortion { "ignore" } else { "refuse" }.to_owned()),
                ];
                return self.file(2, "track", &attributes, &relative(&binding.path, base));
            }
            NodeMotion::Path(path) => return path.keys().iter().for_each(|key| self.key(key)),
        };
        let interpolation = match binding.interpolation {
            Interpolation::Maya => "maya",
            Interpolation::Linear => "linear",
            Interpolation::Spline => "spline",
        };
        let mut attributes = vec![("interpolation", interpolation.to_owned())];
        // A name that XML cannot hold was not chosen by name.
        let name = &node.name;
        if !name.is_empty() && name.trim() == name && !name.contains(|c: char| c.is_control() || !is_xml(c)) {
            attributes.push(("node", name.clone()));
        }
        self.file(2, "animation", &attributes, &relative(&binding.path, base));
    }

    fn motion(&mut self, motion: &Motion) {
        match *motion {
            Motion::Linear { velocity } => {
                self.line(2, "motion", &[("type", "linear".to_owned()), ("velocity", vector(velocity))]);
            }
            Motion::Rotation { axis, per_frame, centre } => self.line(
                2,
                "motion",
                &[
                    ("type", "rotation".to_owned()),
                    ("axis", vector(axis)),
                    ("degreesPerFrame", degrees(per_frame)),
                    ("centre", vector(centre)),
                ],
            ),
        }
    }
}

/// The fewest digits that parse to the same `f64`; powers of ten where they are shorter.
pub(super) fn number(x: f64) -> String {
    let (plain, power) = (x.to_string(), format!("{x:e}"));
    if plain.len() <= power.len() + 4 { plain } else { power }
}

fn vector(v: DVec3) -> String {
    format!("{} {} {}", number(v.x), number(v.y), number(v.z))
}

/// Degrees that a scene file turns back into exactly `radians`, the shortest of those that are near.
///
/// Only some `f64` are reached by `to_radians`, but everything that came from a scene file is; for others the nearest
/// value is written.
fn degrees(radians: f64) -> String {
    let start = radians.to_degrees();
    let back = |text: &String| text.parse::<f64>().is_ok_and(|d| d.to_radians().to_bits() == radians.to_bits());
    let rounded = (0..=15).map(|digits| format!("{start:.digits$e}"));
    if let Some(text) = rounded.filter(back).map(|text| number(text.parse().unwrap_or(start))).next() {
        return text;
    }
    let neighbours =
        [start, start.next_up(), start.next_down(), start.next_up().next_up(), start.next_down().next_down()];
    neighbours.into_iter().map(number).find(back).unwrap_or_else(|| number(start))
}

/// Text as XML takes it, in attributes and between tags.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out
}

/// `path` as seen from the directory `base`; absolute where there is no way.
fn relative(path: &Path, base: &Path) -> String {
    let inside = if base.as_os_str().is_empty() { Some(path) } else { path.strip_prefix(base).ok() };
    let found = inside.filter(|p| p.is_relative()).map(Path::to_owned).or_else(|| way(path, base));
    let text = found.as_deref().unwrap_or(path).to_string_lossy().into_owned();
    // Blanks at its start would be trimmed.
    if text.starts_with(char::is_whitespace) { format!("./{text}") } else { text }
}

/// The way between real places, up with `..` and down again.
fn way(path: &Path, base: &Path) -> Option<PathBuf> {
    let here = if base.as_os_str().is_empty() { Path::new(".") } else { base };
    let (path, base) = (path.canonicalize().ok()?, here.canonicalize().ok()?);
    let shared = path.components().zip(base.components()).take_while(|(a, b)| a == b).count();
    let up = base.components().skip(shared).map(|_| Component::ParentDir);
    Some(up.chain(path.components().skip(shared)).collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn angles_survive(d in prop_oneof![-1e9..1e9_f64, -360.0..360.0_f64, any::<i16>().prop_map(f64::from)]) {
            let radians = d.to_radians();
            prop_assert_eq!(degrees(radians).parse::<f64>().unwrap().to_radians().to_bits(), radians.to_bits());
        }

        #[test]
        fn numbers_survive(x in any::<f64>().prop_filter("finite", |x| x.is_finite())) {
            prop_assert_eq!(number(x).parse::<f64>().unwrap().to_bits(), x.to_bits());
        }

        #[test]
        fn material_numbers_survive(x in 0.0..1e6_f32) {
            prop_assert_eq!(x.to_string().parse::<f64>().unwrap() as f32, x);
        }
    }

    #[test]
    fn round_angles_stay_round() {
        for text in ["40", "-90", "0.1", "33.3", "1e-9", "720"] {
            let d: f64 = text.parse().unwrap();
            assert_eq!(degrees(d.to_radians()).parse::<f64>().unwrap(), d, "{text}");
        }
    }
}
