//! Whether a scene can be rendered: every number within the bounds that scene files have ([`crate::limits`]).
//!
//! This costs next to nothing beside a frame: what an array holds was looked at when its [`Shape`](super::Shape) was
//! made.

use super::model::GaussianModel;
use super::shape::{Capture, PointMotion, Shape, Sphere, Surface};
use super::values::{Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene};
use crate::environment::Environment;
use crate::limits::{self, Invalid, Range};
use crate::math::Trs;
use crate::model::{Material, Optics};

impl Scene {
    /// Checks all numbers. A renderer does it by itself.
    ///
    /// # Errors
    /// The first that is out of its bounds, or does not go with another.
    pub fn check(&self) -> Result<(), Invalid> {
        self.image.check().map_err(|e| e.within("image"))?;
        self.frames.check().map_err(|e| e.within("frames"))?;
        self.shutter.check().map_err(|e| e.within("shutter"))?;
        self.camera.check().map_err(|e| e.within("camera"))?;
        for (i, light) in self.lights.iter().enumerate() {
            light.check().map_err(|e| e.within(format_args!("lights[{i}]")))?;
        }
        if let Some(environment) = &self.environment {
            check_environment(environment).map_err(|e| e.within("environment"))?;
        }
        if self.objects.is_empty() {
            return Err(Invalid::new("objects", "empty", "at least one object"));
        }
        for (i, object) in self.objects.iter().enumerate() {
            object.check().map_err(|e| e.within(format_args!("objects[{i}]")))?;
        }
        Ok(())
    }
}

impl ImageSettings {
    fn check(&self) -> Result<(), Invalid> {
        limits::check_count("width", self.width, &limits::SIDE)?;
        limits::check_count("height", self.height, &limits::SIDE)?;
        limits::LIGHT.check_all("background", self.background)
    }
}

impl FrameRange {
    fn check(&self) -> Result<(), Invalid> {
        if self.first > self.last {
            return Err(Invalid::new("last", self.last, format!("at least `first`, {}", self.first)));
        }
        let frames = -limits::MOST_FRAME..=limits::MOST_FRAME;
        for (field, number) in [("first", self.first), ("last", self.last)] {
            if !frames.contains(&number) {
                let expected = format!("a whole number from {} to {}", frames.start(), frames.end());
                return Err(Invalid::new(field, number, expected));
            }
        }
        limits::RATE.check("rate", self.rate)
    }
}

impl Camera {
    fn check(&self) -> Result<(), Invalid> {
        limits::FOVY.check_angle("fovy", self.fovy)?;
        limits::LENGTH.check("near", self.near)?;
        limits::SHIFT.check_all("shift", self.shift.extend(0.0))?;
        check_motions(&self.motions)?;
        // An animation takes the place of the rest.
        if self.animation.is_some() {
            return Ok(());
        }
        limits::COORDINATE.check_all("eye", self.eye)?;
        limits::COORDINATE.check_all("at", self.at)?;
        limits::check_direction("up", self.up)?;
        match self.bad_view() {
            None => Ok(()),
            Some([found, expected]) => Err(Invalid::new("at", format_args!("{found} from `eye`"), expected)),
        }
    }

    /// Why a camera cannot look from its eye to what it looks at: what is found, and what would be right.
    pub(crate) fn bad_view(&self) -> Option<[&'static str; 2]> {
        let view = self.at - self.eye;
        if !(1e-12..=1e100).contains(&view.length()) {
            return Some(["0 long", "two different points"]);
        }
        let along = view.normalize().cross(self.up.normalize()).length() < 1e-9;
        along.then_some(["along `up`", "another direction than `up`"])
    }
}

fn check_motions(motions: &[Motion]) -> Result<(), Invalid> {
    for (i, motion) in motions.iter().enumerate() {
        let checked = match *motion {
            Motion::Linear { velocity } => limits::COORDINATE.check_all("velocity", velocity),
            Motion::Rotation { axis, per_frame, centre } => limits::check_unit("axis", axis)
                .and_then(|()| limits::DEGREES.check_angle("per_frame", per_frame))
                .and_then(|()| limits::COORDINATE.check_all("centre", centre)),
        };
        checked.map_err(|e| e.within(format_args!("motions[{i}]")))?;
    }
    Ok(())
}

impl Light {
    fn check(&self) -> Result<(), Invalid> {
        let colour = match *self {
            Self::Directional { direction, colour, angle, .. } => {
                limits::check_unit("direction", direction)?;
                limits::ANGLE.check_angle("angle", angle)?;
                colour
            }
            Self::Point { position, colour, radius, .. } => {
                limits::COORDINATE.check_all("position", position)?;
                limits::RADIUS_OF_LIGHT.check("radius", radius)?;
                colour
            }
            Self::Ambient { colour } => colour,
        };
        limits::RADIANCE.check_all("colour", colour)
    }
}

fn check_environment(environment: &Environment) -> Result<(), Invalid> {
    limits::INTENSITY.check("intensity", environment.intensity)?;
    limits::DEGREES.check_angle("rotation", environment.rotation)
}

impl Object {
    fn check(&self) -> Result<(), Invalid> {
        self.shape.check().map_err(|e| e.within("shape"))?;
        check_placement(&self.transform).map_err(|e| e.within("transform"))?;
        check_placement(&self.place).map_err(|e| e.within("place"))?;
        // The reference traces an ideal sphere as the ellipsoid that it becomes.
        if !matches!(self.shape, Shape::Sphere { .. }) {
            self.check_equal_scale()?;
        }
        check_motions(&self.motions)?;
        limits::UNIT.check("opacity", self.opacity)?;
        if let Some(epsilon) = self.epsilon {
            limits::EPSILON.check("epsilon", epsilon)?;
        }
        Ok(())
    }
}

impl Object {
    /// Checks whether spheres stay spheres.
    ///
    /// # Errors
    /// The object has some, and scales them unequally.
    pub(crate) fn check_equal_scale(&self) -> Result<(), Invalid> {
        if !self.shape.surfels_or_none().spheres {
            return Ok(());
        }
        for (field, scale) in [("transform", self.transform.scale), ("place", self.place.scale)] {
            let size = scale.abs();
            if size.max_element() > size.min_element() * (1.0 + 1e-9) {
                let expected = "three equal numbers, as the object has spheres";
                return Err(Invalid::new("scale", scale, expected).within(field));
            }
        }
        Ok(())
    }
}

impl Shape {
    fn check(&self) -> Result<(), Invalid> {
        if let Some(flaw) = self.flaw() {
            return Err(flaw.clone().within("model"));
        }
        if let Some(surface) = self.surface() {
            surface.check().map_err(|e| e.within("surface"))?;
        }
        match self {
            Self::Surfels { points: PointMotion { at: Some(at), .. }, .. } => limits::FRAME.check("points.at", *at),
            Self::Gaussians { model, .. } if model.gaussians().optics != Optics::Alpha => {
                Err(optics("a volume", "a capture"))
            }
            Self::Volume { model, .. } if model.gaussians().optics == Optics::Alpha => {
                Err(optics("a capture", "a volume"))
            }
            Self::Gaussians { model, capture } => {
                let most = Capture::MOST_HARMONICS.into();
                limits::check_count("capture.harmonics", capture.harmonics.into(), &(0..=most))?;
                model.check().map_err(|e| e.within("model"))
            }
            Self::Volume { model, material } => {
                material.map_or(Ok(()), check_material).map_err(|e| e.within("material"))?;
                model.check().map_err(|e| e.within("model"))
            }
            Self::Sphere { sphere: Sphere { radius, colour }, .. } => {
                limits::LENGTH.check("sphere.radius", *radius)?;
                limits::LIGHT.check_all("sphere.colour", colour.as_dvec3())
            }
            Self::Surfels { .. } | Self::Sequence { .. } => Ok(()),
        }
    }
}

impl Surface {
    fn check(&self) -> Result<(), Invalid> {
        self.material.map_or(Ok(()), check_material).map_err(|e| e.within("material"))?;
        limits::UNIT.check("reflection", self.reflection)
    }
}

fn check_placement(placement: &Trs) -> Result<(), Invalid> {
    limits::COORDINATE.check_all("translate", placement.translate)?;
    for angle in placement.rotate.to_array() {
        limits::DEGREES.check_angle("rotate", angle)?;
    }
    if limits::is_scale(placement.scale) {
        return Ok(());
    }
    let Range(least, most) = limits::SCALE;
    let expected = format!("three numbers, each from {least:e} to {most:e} or the negative of that");
    Err(Invalid::new("scale", placement.scale, expected))
}

fn check_material(material: Material) -> Result<(), Invalid> {
    let Material { ambient, diffuse, specular, shininess } = material;
    for (field, value) in [("ambient", ambient), ("diffuse", diffuse), ("specular", specular), ("shininess", shininess)]
    {
        limits::LIGHT.check(field, f64::from(value))?;
    }
    Ok(())
}

/// Gaussians in a shape of the other kind.
fn optics(found: &str, expected: &str) -> Invalid {
    Invalid::new("model.optics", format_args!("those of {found}"), format!("those of {expected}"))
}

impl GaussianModel {
    fn check(&self) -> Result<(), Invalid> {
        if let Some([min, max]) = self.crop {
            limits::COORDINATE.check_all("crop[0]", min)?;
            limits::COORDINATE.check_all("crop[1]", max)?;
            if !min.cmple(max).all() {
                return Err(Invalid::new("crop[1]", max, format!("at least `crop[0]`, {min}")));
            }
        }
        let flat = self.flat.unwrap_or_default().as_dvec3();
        limits::LIGHT.check_all("flat", flat)
    }
}
