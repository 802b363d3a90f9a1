//! Turns a checked tree into plain values that need no file.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec3;

use super::attributes::Part;
use super::dom::{Element, FileRef, Source};
use super::error::{SceneError, quoted};
use super::flight::Flight;
use crate::anim::{Interpolation, TrackFormat, TrackOptions};
use crate::limits::FAR;
use crate::math::{RotateOrder, Trs};
use crate::model::{
    self, ColourBy, ColourMap, ColourSpace, Kind, Material, MeshOptions, PointOptions, TransferFunction, TransferStop,
    VelocityUnit, VolumeOptions,
};
use crate::options::Detail;
use crate::scene::{
    Capture, GivenCamera, GivenFrames, ImageSettings, Light, Motion, Pattern, PointMotion, SequenceSpec, Sphere,
};
use crate::time::{Anchor, Direction, Readout, Shutter, Weight};

/// A scene before its files are read.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) image: ImageSettings,
    /// True if the scene says how large the image is.
    pub(super) size_given: bool,
    pub(super) frames: GivenFrames,
    pub(super) shutter: Shutter,
    /// `None`: the scene has no `<camera>`.
    pub(super) camera: Option<CameraSpec>,
    pub(super) lights: Vec<Light>,
    pub(super) environment: Option<EnvironmentSpec>,
    pub(super) objects: Vec<ObjectSpec>,
}

#[derive(Debug)]
pub(super) struct EnvironmentSpec {
    pub(super) file: FileRef,
    pub(super) intensity: f64,
    /// Radians.
    pub(super) rotation: f64,
    pub(super) background: bool,
    /// `None`: where there is no other light.
    pub(super) light: Option<bool>,
    pub(super) shadows: bool,
}

#[derive(Debug)]
pub(super) struct CameraSpec {
    /// Place in the file.
    pub(super) at: usize,
    pub(super) given: GivenCamera,
    pub(super) animation: Option<AnimationSpec>,
    pub(super) track: Option<(FileRef, TrackOptions)>,
    /// True if the scene says the field of view.
    pub(super) says_fovy: bool,
    pub(super) motions: Vec<Motion>,
    /// Its keys, or the object that it looks at.
    pub(super) flight: Option<Flight>,
}

impl CameraSpec {
    /// What the camera says, and its first key.
    pub(super) fn completed(&self) -> GivenCamera {
        let mut given = self.given;
        if let Some(flight) = &self.flight {
            flight.complete(&mut given, self.says_fovy);
        }
        given
    }
}

#[derive(Debug)]
pub(super) struct AnimationSpec {
    pub(super) file: FileRef,
    pub(super) interpolation: Interpolation,
    pub(super) node: Option<String>,
    /// Frames a second of a glTF file.
    pub(super) fps: Option<f64>,
    pub(super) looped: Option<bool>,
    /// True if the scene says how values between keys are found.
    pub(super) says_between: bool,
}

/// What an object looks like.
#[derive(Debug)]
pub(super) enum ShapeSpec {
    Model(FileRef),
    /// The pattern, and the first file with it.
    Sequence(SequenceSpec, FileRef),
    Sphere(Sphere),
}

#[derive(Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is a property by itself")]
pub(super) struct ObjectSpec {
    pub(super) name: String,
    pub(super) blur: bool,
    pub(super) receive_shadows: bool,
    pub(super) shadow_catcher: bool,
    pub(super) cast_shadows: bool,
    /// `None`: as the model says.
    pub(super) two_sided: Option<bool>,
    pub(super) points: PointMotion,
    pub(super) epsilon: Option<f64>,
    pub(super) detail: Detail,
    pub(super) shape: ShapeSpec,
    pub(super) options: model::LoadOptions,
    /// A table of colours, in place of the map that `options` has.
    pub(super) colour_table: Option<FileRef>,
    pub(super) transform: Trs,
    pub(super) animation: Option<AnimationSpec>,
    pub(super) motions: Vec<Motion>,
    pub(super) place: Trs,
    pub(super) material: MaterialSpec,
    pub(super) gaussians: GaussiansSpec,
}

/// What `<material>` says.
#[derive(Clone, Copy, Debug)]
pub(super) struct MaterialSpec {
    /// `None`: those of the model's file.
    pub(super) coefficients: Option<Material>,
    /// Factor on the opacities of surfels.
    pub(super) opacity: f64,
    /// Share of the environment that surfels mirror.
    pub(super) reflection: f64,
}

impl MaterialSpec {
    /// What means nothing for captures and volumes, in words.
    pub(super) const OF_SURFELS: &str = "`opacity` and `reflection` of <material>";

    /// Is any of that said?
    pub(super) fn is_of_surfels(&self) -> bool {
        self.opacity != 1.0 || self.reflection != 0.0
    }
}

/// How Gaussians of a capture or kernels of a volume are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GaussiansSpec {
    /// Factor on their opacities.
    pub(super) opacity: f64,
    pub(super) capture: Capture,
    /// The box of those that show, model space.
    pub(super) crop: Option<[DVec3; 2]>,
}

impl Default for GaussiansSpec {
    fn default() -> Self {
        Self { opacity: 1.0, capture: Capture::default(), crop: None }
    }
}

/// Reads a checked tree.
pub(super) fn read(source: &Source, root: &Element) -> Result<Document, SceneError> {
    let absent = Element { at: root.at, ..Element::default() };
    let part = |name: &'static str| Part::new(source, root.child(name).unwrap_or(&absent), name);
    let (image, frames) = (part("image"), part("frames"));
    let given = GivenFrames {
        first: frames.integer("first")?,
        last: frames.integer("last")?,
        rate: frames.optional_number("rate")?,
    };
    if let (Some(first), Some(last)) = (given.first, given.last)
        && first > last
    {
        return Err(frames.bad("last", &last, format!("at least `first`, {first}")));
    }
    let lights = root.children("light").map(|e| light(&Part::new(source, e, "light"))).collect::<Result<_, _>>()?;
    Ok(Document {
        image: ImageSettings {
            width: image.integer("width")?.unwrap_or_default() as u32,
            height: image.integer("height")?.unwrap_or_default() as u32,
            background: image.vector("background")?,
            transparent: image.boolean("transparent")?,
        },
        size_given: image.given("width") || image.given("height"),
        frames: given,
        shutter: shutter(&part("shutter"))?,
        camera: root.child("camera").map(|e| camera(&Part::new(source, e, "camera"))).transpose()?,
        lights,
        environment: root
            .child("environment")
            .map(|e| environment(&Part::new(source, e, "environment")))
            .transpose()?,
        objects: objects(source, root)?,
    })
}

fn environment(part: &Part<'_>) -> Result<EnvironmentSpec, SceneError> {
    Ok(EnvironmentSpec {
        file: part.file(),
        intensity: part.number("intensity")?,
        rotation: part.number("rotation")?.to_radians(),
        background: part.boolean("background")?,
        light: part.optional_boolean("light")?,
        shadows: part.boolean("shadows")?,
    })
}

fn shutter(part: &Part<'_>) -> Result<Shutter, SceneError> {
    let (open, close) = (part.number("open")?, part.number("close")?);
    if open >= close {
        return Err(part.bad("close", &close, format!("more than `open`, {open}")));
    }
    let weight = if let Some(curve) = part.element.child("curve") {
        drawn(part.source, curve)?
    } else {
        match part.choice("weight")?.as_deref() {
            Some("tent") => Weight::Tent,
            Some("ramp") => Weight::Ramp { centre: part.number("centre")? },
            Some("exponential") => Weight::Exponential { rate: part.number("rate")?, centre: part.number("centre")? },
            Some("one-minus-exponential") => Weight::OneMinusExponential { centre: part.number("centre")? },
            Some("gaussian") => Weight::Gaussian { centre: part.number("centre")?, width: part.number("width")? },
            _ => Weight::Box,
        }
    };
    let named = |name: &str| part.choice(name);
    let direction = named("direction")?;
    let anchor = named("anchor")?;
    let readout = Readout {
        duration: part.number("readout")?,
        direction: Direction::ALL.into_iter().find(|d| Some(d.name()) == direction.as_deref()).unwrap_or_default(),
        anchor: Anchor::ALL.into_iter().find(|a| Some(a.name()) == anchor.as_deref()).unwrap_or_default(),
    };
    Ok(Shutter { open, close, weight, readout })
}

fn drawn(source: &Source, curve: &Element) -> Result<Weight, SceneError> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for element in curve.children("point") {
        let part = Part::new(source, element, "point");
        let (time, weight) = (part.number("time")?, part.number("weight")?);
        if let Some(&(before, _)) = points.last()
            && time <= before
        {
            return Err(part.bad("time", &time, format!("more than that of the point before, {before}")));
        }
        points.push((time, weight));
    }
    let weight = Weight::Curve(points);
    if weight.has_area() {
        return Ok(weight);
    }
    Err(SceneError::BadValue {
        at: source.locate(curve.at),
        what: "the area under <curve>".to_owned(),
        found: "0".to_owned(),
        expected: Weight::AREA.to_owned(),
    })
}

/// Reads a checked `<camera>`.
pub(super) fn camera(part: &Part<'_>) -> Result<CameraSpec, SceneError> {
    Ok(CameraSpec {
        at: part.element.at,
        given: GivenCamera {
            eye: part.optional_vector("eye")?,
            at: part.optional_vector("at")?,
            up: part.optional_vector("up")?,
            fovy: part.number("fovy")?.to_radians(),
            near: part.given("near").then(|| part.number("near")).transpose()?,
        },
        animation: animation(part)?,
        track: track(part)?,
        says_fovy: part.given("fovy"),
        motions: motions(part)?,
        flight: Flight::read(part)?,
    })
}

fn track(camera: &Part<'_>) -> Result<Option<(FileRef, TrackOptions)>, SceneError> {
    let Some(element) = camera.element.child("track") else { return Ok(None) };
    let part = Part::new(camera.source, element, "track");
    if camera.element.child("animation").is_some() {
        return Err(SceneError::BadValue {
            at: camera.source.locate(element.at),
            what: "<track>".to_owned(),
            found: "beside <animation>".to_owned(),
            expected: "one of the two".to_owned(),
        });
    }
    let word = part.choice("format")?.unwrap_or_default();
    let options = TrackOptions {
        format: TrackFormat::of(&word).unwrap_or(TrackFormat::Nerfstudio),
        ignore_distortion: part.choice("distortion")?.as_deref() == Some("ignore"),
        linear: part.choice("positions")?.as_deref() == Some("linear"),
        start: part.number("start")?,
    };
    Ok(Some((part.file(), options)))
}

fn light(part: &Part<'_>) -> Result<Light, SceneError> {
    let kind = part.choice("type")?;
    let colour = part.vector("colour")? * part.number("intensity")?;
    Ok(match kind.as_deref() {
        Some("point") => Light::Point {
            position: part.vector("position")?,
            colour,
            radius: part.number("radius")?,
            shadows: part.boolean("shadows")?,
        },
        Some("ambient") => Light::Ambient { colour },
        _ => Light::Directional {
            direction: unit(part.vector("direction")?),
            colour,
            angle: part.number("angle")?.to_radians(),
            shadows: part.boolean("shadows")?,
        },
    })
}

fn objects(source: &Source, root: &Element) -> Result<Vec<ObjectSpec>, SceneError> {
    let mut taken = std::collections::HashSet::new();
    for element in root.children("object") {
        let part = Part::new(source, element, "object");
        if let Some(name) = part.text("name")?
            && !taken.insert(name.clone())
        {
            return Err(part.bad("name", &quoted(&name), "a name that no other object has".to_owned()));
        }
    }
    let named = |(i, element): (usize, &Element)| {
        let part = Part::new(source, element, "object");
        let name = part.text("name")?.unwrap_or_else(|| {
            let name = format!("object{}", i + 1);
            // Another object may have been given just this name.
            if taken.contains(&name) { free_name(&name, &taken) } else { name }
        });
        object(&part, name)
    };
    root.children("object").enumerate().map(named).collect()
}

/// `name` with the first suffix that makes it free.
fn free_name(name: &str, taken: &std::collections::HashSet<String>) -> String {
    let mut candidate = format!("{name}_");
    while taken.contains(&candidate) {
        candidate.push('_');
    }
    candidate
}

fn object(part: &Part<'_>, name: String) -> Result<ObjectSpec, SceneError> {
    let absent = Element { at: part.element.at, ..Element::default() };
    let inside = |name: &'static str| Part::new(part.source, part.element.child(name).unwrap_or(&absent), name);
    let model = inside("pointModel");
    let colour_space = model.choice("colourSpace")?.map(|word| match word.as_str() {
        "linear" => ColourSpace::Linear,
        _ => ColourSpace::Srgb,
    });
    let kind = model.choice("kind")?.map(|word| match word.as_str() {
        "surfels" => Kind::Surfels,
        "spheres" => Kind::Spheres,
        "volume" => Kind::Volume,
        _ => Kind::Gaussians,
    });
    let volume = VolumeOptions {
        transfer: part.element.child("transferFunction").map(|e| transfer(part.source, e)).transpose()?.map(Arc::new),
        kernel: model.number("kernel")?,
        flatten: model.divisor("flatten")?,
        lit: model.boolean("lit")?,
    };
    let mesh = MeshOptions { spacing: model.spacing("spacing")?, reduce: model.boolean("reduce")? };
    Ok(ObjectSpec {
        name,
        blur: part.boolean("blur")?,
        receive_shadows: part.boolean("receiveShadows")?,
        shadow_catcher: part.boolean("shadowCatcher")?,
        cast_shadows: part.boolean("castShadows")?,
        two_sided: part.optional_boolean("twoSided")?,
        points: PointMotion {
            unit: part.choice("velocityUnit")?.map(|word| match word.as_str() {
                "frame" => VelocityUnit::Frame,
                _ => VelocityUnit::Second,
            }),
            at: part.optional_number("at")?,
        },
        epsilon: part.optional_number("epsilon")?,
        detail: part.choice("detail")?.and_then(|word| word.parse().ok()).unwrap_or_default(),
        shape: match part.element.child("sphere") {
            Some(element) => ShapeSpec::Sphere(sphere(&Part::new(part.source, element, "sphere"))?),
            None => shape(&model)?,
        },
        options: model::LoadOptions {
            kind,
            radius_scale: model.number("radiusScale")?,
            colour_space,
            volume,
            mesh,
            node: model.text("node")?,
            points: points(&model)?,
        },
        colour_table: colour_table(&model)?,
        gaussians: gaussians(&model)?,
        transform: placement(&inside("transform"))?,
        animation: animation(part)?,
        motions: motions(part)?,
        place: placement(&inside("place"))?,
        material: material(&inside("material"), part.element.child("material").is_some())?,
    })
}

/// The choices among the points of a cloud.
fn points(model: &Part<'_>) -> Result<PointOptions, SceneError> {
    let every = model.integer("every")?.and_then(|every| u32::try_from(every).ok()).unwrap_or(1);
    let classes = match model.text("classes")? {
        None => Vec::new(),
        Some(text) => classes(&text)
            .ok_or_else(|| model.bad("classes", &quoted(&text), "whole numbers from 0 to 255, as 2,6".to_owned()))?,
    };
    Ok(PointOptions {
        every,
        classes,
        clean: model.boolean("clean")?,
        scanner: model.optional_vector("scannerPosition")?,
        radius: model.optional_number("radius")?,
        colour_by: colour_by(model)?,
    })
}

/// The column that colours points. The map of a table is read later.
fn colour_by(model: &Part<'_>) -> Result<Option<ColourBy>, SceneError> {
    let Some(column) = model.text("colourBy")? else {
        let idle = ["colourMap", "range"].into_iter().find(|name| model.given(name));
        return match idle {
            Some(name) => Err(model.bad(name, &"without `colourBy`", "`colourBy`, or neither".to_owned())),
            None => Ok(None),
        };
    };
    let map = model.text("colourMap")?.and_then(|text| ColourMap::parse(&text)).unwrap_or_default();
    let range = match model.text("range")? {
        None => None,
        Some(text) => Some(
            ColourBy::parse_range(&text)
                .ok_or_else(|| model.bad("range", &quoted(&text), "two numbers that differ, as -1..2.5".to_owned()))?,
        ),
    };
    Ok(Some(ColourBy { column, map, range }))
}

/// The file of a table of colours, if the map is one.
fn colour_table(model: &Part<'_>) -> Result<Option<FileRef>, SceneError> {
    let at = model.element.attribute("colourMap").map_or(model.element.at, |attribute| attribute.at);
    let text = model.text("colourMap")?.filter(|text| ColourMap::parse(text).is_none());
    Ok(text.map(|text| FileRef { text, at }))
}

/// Numbers of classes, rising, each once.
fn classes(text: &str) -> Option<Vec<u8>> {
    let numbers: Option<BTreeSet<u8>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    numbers.map(|numbers| numbers.into_iter().collect())
}

/// A model file, or a sequence of them.
fn shape(model: &Part<'_>) -> Result<ShapeSpec, SceneError> {
    /// Most files of a sequence: looking for each takes time.
    const MOST_FILES: i64 = 100_000;
    let Some(text) = model.text("sequence")? else {
        let idle = ["first", "last", "offset", "rate", "match"].into_iter().find(|name| model.given(name));
        return match idle {
            Some(name) => Err(model.bad(name, &"without `sequence`", "`sequence` and no text, or neither".to_owned())),
            None => Ok(ShapeSpec::Model(model.file())),
        };
    };
    let expected = "one number such as %d or %04d in the names of files";
    let pattern = Pattern::parse(&text.replace('\\', "/"))
        .ok_or_else(|| model.bad("sequence", &format!("\"{text}\""), expected.to_owned()))?;
    if let Some(kind) = model.choice("kind")?.filter(|kind| kind != "surfels" && kind != "spheres") {
        return Err(model.bad("kind", &quoted(&kind), "surfels or spheres: a sequence shows nothing else".to_owned()));
    }
    let needed = |name: &'static str| {
        let number = model.integer(name)?;
        number.ok_or_else(|| model.bad("sequence", &format!("without `{name}`"), "`first` and `last`".to_owned()))
    };
    let (first, last) = (needed("first")?, needed("last")?);
    if !(first..first + MOST_FILES).contains(&last) {
        return Err(model.bad("last", &last, format!("from `first`, {first}, to {}", first + MOST_FILES - 1)));
    }
    let file = FileRef { text: pattern.path(first).to_string_lossy().into_owned(), ..model.file() };
    let (offset, rate) = (model.number("offset")?, model.optional_number("rate")?.unwrap_or(1.0));
    let match_within = model.optional_number("match")?;
    Ok(ShapeSpec::Sequence(SequenceSpec { pattern, first, last, offset, rate, match_within }, file))
}

fn transfer(source: &Source, element: &Element) -> Result<TransferFunction, SceneError> {
    let mut stops: Vec<TransferStop> = Vec::new();
    for element in element.children("stop") {
        let part = Part::new(source, element, "stop");
        let value = part.number("value")?;
        if let Some(before) = stops.last().map(|stop| stop.value).filter(|before| value <= *before) {
            return Err(part.bad("value", &value, format!("more than that of the stop before, {before}")));
        }
        stops.push(TransferStop { value, colour: part.vector("colour")?.as_vec3(), opacity: part.number("opacity")? });
    }
    TransferFunction::new(stops).map_err(|why| SceneError::BadValue {
        at: source.locate(element.at),
        what: "<transferFunction>".to_owned(),
        found: why.to_string(),
        expected: "stops with rising values".to_owned(),
    })
}

fn gaussians(part: &Part<'_>) -> Result<GaussiansSpec, SceneError> {
    let (min, max) = (part.optional_vector("cropMin")?, part.optional_vector("cropMax")?);
    if let (Some(min), Some(max)) = (min, max)
        && !min.cmple(max).all()
    {
        return Err(part.bad("cropMax", &max, format!("at least `cropMin`, {min}")));
    }
    let crop = [min.unwrap_or(DVec3::splat(-FAR)), max.unwrap_or(DVec3::splat(FAR))];
    Ok(GaussiansSpec {
        opacity: part.number("opacity")?,
        capture: Capture {
            harmonics: part.integer("shDegree")?.unwrap_or(Capture::MOST_HARMONICS.into()) as u8,
            antialias: part.optional_boolean("antialias")?,
        },
        crop: (min.is_some() || max.is_some()).then_some(crop),
    })
}

fn sphere(part: &Part<'_>) -> Result<Sphere, SceneError> {
    Ok(Sphere { radius: part.number("radius")?, colour: part.vector("colour")?.as_vec3() })
}

fn animation(parent: &Part<'_>) -> Result<Option<AnimationSpec>, SceneError> {
    let Some(element) = parent.element.child("animation") else { return Ok(None) };
    let part = Part::new(parent.source, element, "animation");
    let interpolation = match part.choice("interpolation")?.as_deref() {
        Some("linear") => Interpolation::Linear,
        Some("spline") => Interpolation::Spline,
        _ => Interpolation::Maya,
    };
    Ok(Some(AnimationSpec {
        file: part.file(),
        interpolation,
        node: part.text("node")?,
        fps: part.optional_number("fps")?,
        looped: part.given("loop").then(|| part.boolean("loop")).transpose()?,
        says_between: part.given("interpolation"),
    }))
}

fn motions(parent: &Part<'_>) -> Result<Vec<Motion>, SceneError> {
    parent.element.children("motion").map(|e| motion(&Part::new(parent.source, e, "motion"))).collect()
}

fn motion(part: &Part<'_>) -> Result<Motion, SceneError> {
    Ok(match part.choice("type")?.as_deref() {
        Some("linear") => Motion::Linear { velocity: part.vector("velocity")? },
        _ => Motion::Rotation {
            axis: unit(part.vector("axis")?),
            per_frame: part.number("degreesPerFrame")?.to_radians(),
            centre: part.vector("centre")?,
        },
    })
}

fn placement(part: &Part<'_>) -> Result<Trs, SceneError> {
    let degrees = part.vector("rotate")?;
    let rotate = DVec3::new(degrees.x.to_radians(), degrees.y.to_radians(), degrees.z.to_radians());
    let (translate, scale) = (part.vector("translate")?, part.vector("scale")?);
    Ok(Trs { translate, rotate, scale, order: RotateOrder::Xyz })
}

/// A `<material>`. One that says nothing but an opacity or a reflection leaves the coefficients of the model's file.
fn material(part: &Part<'_>, is_there: bool) -> Result<MaterialSpec, SceneError> {
    let number = |name| part.number(name).map(|x| x as f32);
    let coefficients = Material {
        ambient: number("ambient")?,
        diffuse: number("diffuse")?,
        specular: number("specular")?,
        shininess: number("shininess")?,
    };
    let given = |names: &[&str]| names.iter().any(|name| part.given(name));
    let replaces = given(&["ambient", "diffuse", "specular", "shininess"]) || !given(&["opacity", "reflection"]);
    Ok(MaterialSpec {
        coefficients: (is_there && replaces).then_some(coefficients),
        opacity: part.number("opacity")?,
        reflection: part.number("reflection")?,
    })
}

/// `v` at length 1. A vector whose length is 1 up to rounding stays as it is, so that a written scene loads back.
pub(super) fn unit(v: DVec3) -> DVec3 {
    if (v.length_squared() - 1.0).abs() < 1e-14 {
        return v;
    }
    v / v.length()
}
