//! The language of scene files: one table of every element and attribute, and the structural check against it.
//!
//! The same table writes the `it takes: ...` of errors, supplies the defaults and is held against docs/scene-format.md.
//! A long file, because a table that is split is no longer one table.

use crate::anim::TrackFormat;
use crate::limits::{
    self, ANGLE, COORDINATE, DEGREES, DIRECTION, INTENSITY, LIGHT, RADIUS_OF_LIGHT, Range, SCALE, UNIT,
};

/// An element.
#[derive(Debug)]
pub(super) struct ElementSchema {
    pub(super) name: &'static str,
    /// What its text is; elements without are empty or hold elements.
    pub(super) text: Option<&'static str>,
    /// The attribute that decides which others apply, if any.
    pub(super) selector: Option<&'static str>,
    pub(super) attributes: &'static [AttributeSchema],
    pub(super) children: &'static [Child],
}

/// An element inside another.
#[derive(Debug)]
pub(super) struct Child {
    pub(super) name: &'static str,
    pub(super) occurs: Occurs,
}

/// How often a child may be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Occurs {
    /// With the others of this kind, exactly one.
    OneShape,
    AtMostOne,
    AtLeastOne,
    Any,
}

impl Occurs {
    pub(super) const fn describe(self) -> &'static str {
        match self {
            Self::OneShape => "exactly one shape (pointModel or sphere)",
            Self::AtMostOne => "at most one",
            Self::AtLeastOne => "at least one",
            Self::Any => "any number",
        }
    }
}

/// An attribute. One name may have several rows, each for other values of the selector.
#[derive(Clone, Copy, Debug)]
pub(super) struct AttributeSchema {
    pub(super) name: &'static str,
    pub(super) kind: ValueKind,
    pub(super) default: Absent,
    /// Values of the selector that it applies to; empty: all.
    pub(super) only: &'static [&'static str],
    /// Meaning and unit.
    pub(super) meaning: &'static str,
}

/// What a value may be.
#[derive(Clone, Copy, Debug)]
pub(super) enum ValueKind {
    /// Text, not empty, without control characters.
    Text,
    Boolean,
    Choice(&'static [&'static str]),
    Integer(i64, i64),
    Number(Range),
    /// Three numbers.
    Vector(Range),
    /// Three numbers, not all 0.
    Direction,
    /// One number for all axes, or three; none 0.
    Scale,
    /// A number, or the word for more than any.
    Divisor(Range),
    /// A number, or the word for no sampling.
    Spacing(Range),
}

/// What an absent attribute means.
#[derive(Clone, Copy, Debug)]
pub(super) enum Absent {
    Required,
    Value(&'static str),
    /// Worked out from the rest of the scene, as said here.
    Auto(#[cfg_attr(not(test), expect(dead_code, reason = "for docs/scene-format.md alone"))] &'static str),
}

/// Frames that easing takes.
const EASE: Range = Range(0.0, limits::FRAME.1);
const MOST_NUMBER: i64 = 1_000_000_000;
const FRAME: ValueKind = ValueKind::Integer(-limits::MOST_FRAME, limits::MOST_FRAME);
const PIXELS: ValueKind = ValueKind::Integer(*limits::SIDE.start() as i64, *limits::SIDE.end() as i64);

impl std::fmt::Display for ValueKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text => f.write_str("text without control characters"),
            Self::Boolean => f.write_str("true or false"),
            Self::Choice(words) => f.write_str(&words.join(", ")),
            Self::Integer(lo, hi) => write!(f, "a whole number from {lo} to {hi}"),
            Self::Number(range) => write!(f, "a number {range}"),
            Self::Vector(range) => write!(f, "three numbers {range}"),
            Self::Direction => write!(f, "three numbers, length {DIRECTION}"),
            Self::Divisor(range) => write!(f, "a number {range}, or infinite"),
            Self::Spacing(range) => write!(f, "a number {range}, or none"),
            Self::Scale => {
                let Range(least, most) = SCALE;
                write!(f, "one number or three, each from {least:e} to {most:e} or the negative of that")
            }
        }
    }
}

const fn row(name: &'static str, kind: ValueKind, default: Absent, meaning: &'static str) -> AttributeSchema {
    AttributeSchema { name, kind, default, only: &[], meaning }
}

const fn only(only: &'static [&'static str], row: AttributeSchema) -> AttributeSchema {
    AttributeSchema { only, ..row }
}

const fn child(name: &'static str, occurs: Occurs) -> Child {
    Child { name, occurs }
}

const PLACEMENT: &[AttributeSchema] = &[
    row("translate", ValueKind::Vector(COORDINATE), Absent::Value("0 0 0"), "translation, scene units; applied last"),
    row("rotate", ValueKind::Vector(DEGREES), Absent::Value("0 0 0"), "rotation about x, then y, then z, degrees"),
    row("scale", ValueKind::Scale, Absent::Value("1"), "scale along the axes; applied first"),
];

use Absent::{Auto, Required, Value};
use Occurs::{Any, AtLeastOne, AtMostOne, OneShape};

/// Every element; the root first.
pub(super) static ELEMENTS: &[ElementSchema] = &[
    ElementSchema {
        name: "scene",
        text: None,
        selector: None,
        attributes: &[],
        children: &[
            child("image", AtMostOne),
            child("frames", AtMostOne),
            child("shutter", AtMostOne),
            child("camera", AtMostOne),
            child("light", Any),
            child("environment", AtMostOne),
            child("object", AtLeastOne),
        ],
    },
    ElementSchema {
        name: "image",
        text: None,
        selector: None,
        attributes: &[
            row("width", PIXELS, Value("1024"), "width, pixels"),
            row("height", PIXELS, Value("768"), "height, pixels"),
            row("background", ValueKind::Vector(LIGHT), Value("0 0 0"), "background, linear red green blue"),
            row("transparent", ValueKind::Boolean, Value("false"), "leave the background out and keep alpha"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "frames",
        text: None,
        selector: None,
        attributes: &[
            row("first", FRAME, Auto("the first key of the animations, see below"), "first frame"),
            row("last", FRAME, Auto("the last key of the animations, see below"), "last frame, included"),
            row(
                "rate",
                ValueKind::Number(limits::RATE),
                Auto("that of the first animation file, else 24"),
                "frames per second",
            ),
        ],
        children: &[],
    },
    ElementSchema {
        name: "shutter",
        text: None,
        selector: Some("weight"),
        attributes: &[
            row("open", ValueKind::Number(limits::SHUTTER), Value("-0.25"), "opening, frames after the frame number"),
            row("close", ValueKind::Number(limits::SHUTTER), Value("0.25"), "closing, likewise; after `open`"),
            row(
                "weight",
                ValueKind::Choice(&["box", "tent", "ramp", "exponential", "one-minus-exponential", "gaussian"]),
                Value("box"),
                "time weight; not with a <curve>",
            ),
            only(
                &["ramp", "exponential"],
                row("centre", ValueKind::Number(UNIT), Value("1"), "time of the peak, 0 at `open`, 1 at `close`"),
            ),
            only(
                &["gaussian"],
                row("centre", ValueKind::Number(UNIT), Value("0.5"), "time of the peak, 0 at `open`, 1 at `close`"),
            ),
            only(
                &["one-minus-exponential"],
                row("centre", ValueKind::Number(UNIT), Value("1"), "time at which it is 0, 0 at `open`, 1 at `close`"),
            ),
            only(&["exponential"], row("rate", ValueKind::Number(limits::STEEPNESS), Value("3"), "decay per shutter")),
            only(
                &["gaussian"],
                row("width", ValueKind::Number(limits::STEEPNESS), Value("0.2"), "standard deviation, shutters"),
            ),
            row(
                "readout",
                ValueKind::Number(limits::READOUT),
                Value("0"),
                "rolling shutter: frames from the exposure of the first edge of the image to that of the last one",
            ),
            row(
                "direction",
                ValueKind::Choice(&["down", "up", "right", "left"]),
                Value("down"),
                "where the read-out goes; down: the top row is exposed first",
            ),
            row(
                "anchor",
                ValueKind::Choice(&["middle", "first"]),
                Value("middle"),
                "what is exposed from `open` to `close`: the middle of the image, or the first edge",
            ),
        ],
        children: &[child("curve", AtMostOne)],
    },
    ElementSchema {
        name: "curve",
        text: None,
        selector: None,
        attributes: &[],
        children: &[child("point", AtLeastOne)],
    },
    ElementSchema {
        name: "point",
        text: None,
        selector: None,
        attributes: &[
            row("time", ValueKind::Number(UNIT), Required, "0 at `open`, 1 at `close`; after the point before"),
            row("weight", ValueKind::Number(LIGHT), Required, "weight there, linear in between; not all 0"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "camera",
        text: None,
        selector: None,
        attributes: &[
            row(
                "eye",
                ValueKind::Vector(COORDINATE),
                Auto("in front (+z) of `at`, of meshes alone above right; all objects in view"),
                "eye point",
            ),
            row("at", ValueKind::Vector(COORDINATE), Auto("middle of the box round all motion"), "point looked at"),
            row(
                "up",
                ValueKind::Direction,
                Auto("0 1 0; 0 -1 0 where all objects are captures as they are"),
                "up direction, not along the view",
            ),
            row(
                "atObject",
                ValueKind::Text,
                Auto("none"),
                "name of an object: the camera looks at its middle, not at `at`",
            ),
            row("fovy", ValueKind::Number(limits::FOVY), Value("40"), "vertical field of view, degrees"),
            row("near", ValueKind::Number(limits::LENGTH), Value("0.01"), "nearest visible depth, scene units"),
            row(
                "speed",
                ValueKind::Choice(&["keys", "constant"]),
                Value("keys"),
                "keys: each is reached at its frame; constant: the eye has one speed from the first to the last",
            ),
            row("easeIn", ValueKind::Number(EASE), Value("0"), "frames over which the speed rises from 0"),
            row("easeOut", ValueKind::Number(EASE), Value("0"), "frames over which the speed falls to 0"),
        ],
        children: &[child("animation", AtMostOne), child("track", AtMostOne), child("key", Any), child("motion", Any)],
    },
    ElementSchema {
        name: "key",
        text: None,
        selector: None,
        attributes: &[
            row("frame", ValueKind::Number(limits::FRAME), Required, "frame; after that of the key before"),
            row("eye", ValueKind::Vector(COORDINATE), Auto("that of `<camera>`"), "eye point"),
            row("at", ValueKind::Vector(COORDINATE), Auto("that of `<camera>`"), "point looked at"),
            row("up", ValueKind::Direction, Auto("that of `<camera>`"), "up direction, not along the view"),
            row("fovy", ValueKind::Number(limits::FOVY), Auto("that of `<camera>`"), "vertical field of view, degrees"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "track",
        text: Some("the path of a file of camera poses"),
        selector: None,
        attributes: &[
            row("format", ValueKind::Choice(&TrackFormat::WORDS), Required, "program that wrote it"),
            row("start", ValueKind::Number(limits::FRAME), Value("0"), "frame of the first pose"),
            row("positions", ValueKind::Choice(&["catmull-rom", "linear"]), Value("catmull-rom"), "between poses"),
            row(
                "distortion",
                ValueKind::Choice(&["refuse", "ignore"]),
                Value("refuse"),
                "what to do with a lens that has it",
            ),
        ],
        children: &[],
    },
    ElementSchema {
        name: "light",
        text: None,
        selector: Some("type"),
        attributes: &[
            row("type", ValueKind::Choice(&["directional", "point", "ambient"]), Required, "kind of light"),
            only(
                &["directional"],
                row("direction", ValueKind::Direction, Value("-0.5 -1 -0.8"), "direction in which the light travels"),
            ),
            only(&["point"], row("position", ValueKind::Vector(COORDINATE), Required, "position, scene units")),
            row("colour", ValueKind::Vector(LIGHT), Value("1 1 1"), "linear red green blue"),
            row("intensity", ValueKind::Number(INTENSITY), Value("1"), "factor on `colour`"),
            only(
                &["directional", "point"],
                row("shadows", ValueKind::Boolean, Value("true"), "true: there are shadows in it"),
            ),
            only(
                &["directional"],
                row("angle", ValueKind::Number(ANGLE), Value("0.5"), "diameter as it is seen, degrees, for shadows"),
            ),
            only(
                &["point"],
                row("radius", ValueKind::Number(RADIUS_OF_LIGHT), Value("0"), "of a ball of light, for shadows"),
            ),
        ],
        children: &[],
    },
    ElementSchema {
        name: "environment",
        text: Some("the path of an EXR, Radiance HDR or PNG picture of all directions"),
        selector: None,
        attributes: &[
            row("intensity", ValueKind::Number(INTENSITY), Value("1"), "factor on its radiance"),
            row("rotation", ValueKind::Number(DEGREES), Value("0"), "rotation about +y, degrees"),
            row("background", ValueKind::Boolean, Value("false"), "true: it shows where nothing else does"),
            row("light", ValueKind::Boolean, Auto("true where there is no `<light>`"), "true: it lights the scene"),
            row("shadows", ValueKind::Boolean, Value("true"), "true: there are shadows in its light"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "object",
        text: None,
        selector: None,
        attributes: &[
            row("name", ValueKind::Text, Auto("object1, object2, ... in document order"), "unique name"),
            row("blur", ValueKind::Boolean, Value("true"), "false: posed, with the camera, at the frame number"),
            row("castShadows", ValueKind::Boolean, Value("true"), "false: it keeps no light from anything"),
            row(
                "receiveShadows",
                ValueKind::Boolean,
                Value("true"),
                "false: no shadows fall on its surfels or Gaussians",
            ),
            row("shadowCatcher", ValueKind::Boolean, Value("false"), "true: nothing of it shows but shadows on it"),
            row(
                "twoSided",
                ValueKind::Boolean,
                Auto("by what is known of the sides, see above"),
                "true: back faces show, with their normals turned to the viewer",
            ),
            row(
                "epsilon",
                ValueKind::Number(limits::EPSILON),
                Auto("median radius times the object's scale; less where discs are loose (math.md, eq. 5)"),
                "depth tolerance of visibility, scene units",
            ),
            row(
                "detail",
                ValueKind::Choice(&["draft", "good", "final", "full"]),
                Auto("as the picture asks"),
                "how fine its surfels or kernels are (detail.md); with `--detail full` all show",
            ),
            row(
                "velocityUnit",
                ValueKind::Choice(&["second", "frame"]),
                Auto("by the file"),
                "unit of time of the velocities and accelerations of points",
            ),
            row(
                "at",
                ValueKind::Number(limits::FRAME),
                Auto("each frame's own number"),
                "frame at which points with velocities are where the file has them",
            ),
        ],
        children: &[
            child("pointModel", OneShape),
            child("sphere", OneShape),
            child("transform", AtMostOne),
            child("animation", AtMostOne),
            child("motion", Any),
            child("place", AtMostOne),
            child("material", AtMostOne),
            child("transferFunction", AtMostOne),
        ],
    },
    ElementSchema {
        name: "pointModel",
        text: Some("the path of a model file; none with `sequence`"),
        selector: None,
        attributes: &[
            row("radiusScale", ValueKind::Number(limits::RADIUS_SCALE), Value("1"), "factor on all radii"),
            row(
                "colourSpace",
                ValueKind::Choice(&["srgb", "linear"]),
                Auto("srgb for integer colours and captures, linear for floats"),
                "colour space of the file's colours",
            ),
            row(
                "kind",
                ValueKind::Choice(&["surfels", "spheres", "gaussians", "volume"]),
                Auto("gaussians for captures, volume for volumes, else surfels"),
                "what is drawn: opaque discs, spheres, a capture's transparent Gaussians, or a volume's kernels",
            ),
            row(
                "spacing",
                ValueKind::Spacing(Range(1e-18, 1e18)),
                Auto("by the size of a pixel, see above"),
                "distance of the rays that sample a mesh, model units; none: its vertices are points",
            ),
            row(
                "sequence",
                ValueKind::Text,
                Auto("none"),
                "names of point files, as cache.%04d.ply, in place of the text",
            ),
            row(
                "first",
                ValueKind::Integer(-MOST_NUMBER, MOST_NUMBER),
                Auto("needed by a sequence"),
                "number of its first file",
            ),
            row(
                "last",
                ValueKind::Integer(-MOST_NUMBER, MOST_NUMBER),
                Auto("needed by a sequence"),
                "number of its last file",
            ),
            row(
                "offset",
                ValueKind::Number(Range(-1e9, 1e9)),
                Auto("0"),
                "frame at which file 0 of a sequence is shown",
            ),
            row("rate", ValueKind::Number(Range(1e-6, 1e6)), Auto("1"), "files of a sequence per frame"),
            row(
                "match",
                ValueKind::Number(limits::LENGTH),
                Auto("points without `id` are matched by row"),
                "distance within which nearest points of two files without `id` are the same, model units",
            ),
            row(
                "reduce",
                ValueKind::Boolean,
                Value("true"),
                "false: a mesh is sampled along three axes and not along one",
            ),
            row(
                "kernel",
                ValueKind::Number(Range(0.01, 100.0)),
                Value("0.6"),
                "standard deviation of a volume's kernels, spacings or radii",
            ),
            row(
                "flatten",
                ValueKind::Divisor(Range(1.0, 1e9)),
                Value("1"),
                "divisor of a volume's standard deviation along the gradient",
            ),
            row(
                "node",
                ValueKind::Text,
                Auto("the whole scene of the file"),
                "node of a glTF file whose mesh is drawn, in the node's own space",
            ),
            row("every", ValueKind::Integer(1, MOST_NUMBER), Value("1"), "every n-th point of a cloud is taken"),
            row("classes", ValueKind::Text, Auto("all"), "classes of LAS that are taken, as 2,6"),
            row("clean", ValueKind::Boolean, Value("false"), "true: stray points of a cloud are left out"),
            row(
                "radius",
                ValueKind::Number(limits::LENGTH),
                Auto("that of each point, else estimated"),
                "radius of all points of a cloud, model units",
            ),
            row(
                "scannerPosition",
                ValueKind::Vector(COORDINATE),
                Auto("that of E57, else none"),
                "where the scanner of a cloud stood, in the file's coordinates: estimated normals face it",
            ),
            row(
                "colourBy",
                ValueKind::Text,
                Auto("none"),
                "column of numbers that colours points: a name in the file, x, y, z or speed",
            ),
            row(
                "colourMap",
                ValueKind::Text,
                Value("viridis"),
                "viridis, turbo, plasma, grey, coolwarm, a list as #000000,#ff0000, or the path of a table",
            ),
            row(
                "range",
                ValueKind::Text,
                Auto("the least and the greatest value of all files"),
                "values of the first and of the last colour, as -1..2.5",
            ),
            row("lit", ValueKind::Boolean, Value("false"), "true: lights shade a volume, with gradients as normals"),
            row("opacity", ValueKind::Number(UNIT), Value("1"), "factor on the opacities of a capture or a volume"),
            row(
                "shDegree",
                ValueKind::Integer(0, 3),
                Value("3"),
                "highest degree of a capture's harmonics that is used",
            ),
            row(
                "cropMin",
                ValueKind::Vector(COORDINATE),
                Auto("none"),
                "least x, y, z of the centres of a capture or a volume that are drawn",
            ),
            row("cropMax", ValueKind::Vector(COORDINATE), Auto("none"), "greatest x, y, z, likewise"),
            row(
                "antialias",
                ValueKind::Boolean,
                Auto("by the file"),
                "true: Gaussians of a capture that the filter widens lose opacity",
            ),
        ],
        children: &[],
    },
    ElementSchema {
        name: "sphere",
        text: None,
        selector: None,
        attributes: &[
            row("radius", ValueKind::Number(limits::LENGTH), Value("1"), "radius, scene units"),
            row("colour", ValueKind::Vector(LIGHT), Value("1 1 1"), "linear red green blue"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "animation",
        text: Some("the path of an animation file"),
        selector: None,
        attributes: &[
            row("interpolation", ValueKind::Choice(&["maya", "linear", "spline"]), Value("maya"), "between the keys"),
            row("node", ValueKind::Text, Auto("the first that the file moves"), "node of the file, by name"),
            row(
                "fps",
                ValueKind::Number(limits::RATE),
                Auto("24"),
                "frames per second of a glTF file, which has seconds",
            ),
            row("loop", ValueKind::Boolean, Value("false"), "true: a glTF file's animation repeats for ever"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "motion",
        text: None,
        selector: Some("type"),
        attributes: &[
            row("type", ValueKind::Choice(&["linear", "rotation"]), Required, "kind of motion"),
            only(&["linear"], row("velocity", ValueKind::Vector(COORDINATE), Required, "scene units per frame")),
            only(&["rotation"], row("axis", ValueKind::Direction, Required, "axis, right-handed")),
            only(&["rotation"], row("degreesPerFrame", ValueKind::Number(DEGREES), Required, "degrees per frame")),
            only(&["rotation"], row("centre", ValueKind::Vector(COORDINATE), Value("0 0 0"), "a point on the axis")),
        ],
        children: &[],
    },
    ElementSchema { name: "transform", text: None, selector: None, attributes: PLACEMENT, children: &[] },
    ElementSchema { name: "place", text: None, selector: None, attributes: PLACEMENT, children: &[] },
    ElementSchema {
        name: "material",
        text: None,
        selector: None,
        attributes: &[
            row("ambient", ValueKind::Number(LIGHT), Value("1"), "ambient coefficient"),
            row("diffuse", ValueKind::Number(LIGHT), Value("1"), "diffuse coefficient"),
            row("specular", ValueKind::Number(LIGHT), Value("0.1"), "specular coefficient"),
            row("shininess", ValueKind::Number(LIGHT), Value("30"), "specular exponent"),
            row("opacity", ValueKind::Number(UNIT), Value("1"), "factor on the opacities of surfels"),
            row("reflection", ValueKind::Number(UNIT), Value("0"), "share of the environment that surfels mirror"),
        ],
        children: &[],
    },
    ElementSchema {
        name: "transferFunction",
        text: None,
        selector: None,
        attributes: &[],
        children: &[child("stop", AtLeastOne)],
    },
    ElementSchema {
        name: "stop",
        text: None,
        selector: None,
        attributes: &[
            row(
                "value",
                ValueKind::Number(COORDINATE),
                Required,
                "value of the volume; more than that of the stop before",
            ),
            row("colour", ValueKind::Vector(LIGHT), Value("1 1 1"), "colour there, linear red green blue"),
            row(
                "opacity",
                ValueKind::Number(Range(0.0, crate::model::MOST_EXTINCTION)),
                Required,
                "extinction there, per scene unit",
            ),
        ],
        children: &[],
    },
];

/// The root element's schema.
pub(super) fn root() -> &'static ElementSchema {
    &ELEMENTS[0]
}

/// The schema of an element by name.
pub(super) fn element(name: &str) -> Option<&'static ElementSchema> {
    ELEMENTS.iter().find(|e| e.name == name)
}

/// The attribute that may stand in place of an element's text.
pub(super) fn instead_of_text(schema: &ElementSchema) -> Option<&'static str> {
    (schema.name == "pointModel").then_some("sequence")
}

impl ElementSchema {
    /// The row of an attribute for a value of the selector.
    pub(super) fn row(&self, name: &str, selected: &str) -> Option<&'static AttributeSchema> {
        self.attributes.iter().find(|a| a.name == name && a.applies(selected))
    }

    /// All attributes, for messages.
    pub(super) fn takes(&self) -> String {
        list(self.attributes.iter().map(|a| a.name))
    }

    /// All elements that may stand inside, for messages.
    pub(super) fn holds(&self) -> String {
        let names: Vec<String> = self.children.iter().map(|c| format!("<{}>", c.name)).collect();
        list(names.iter().map(String::as_str))
    }
}

impl AttributeSchema {
    /// True if it goes with a value of the selector.
    pub(super) fn applies(&self, selected: &str) -> bool {
        self.only.is_empty() || self.only.contains(&selected)
    }
}

/// Names for messages, each once.
pub(super) fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut names: Vec<&str> = names.collect();
    names.dedup();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests;
