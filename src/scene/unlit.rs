//! Objects that are coloured by a column of numbers: lights do not change their colours.

use glam::DVec3;

use super::{Light, Object, Scene};
use crate::model::Material;

/// Ambient light of a scene that has none, or less: too little to be seen on other objects, and a power of two, so that
/// a material can undo it without rounding.
const FAINT: f64 = 1.0 / (1 << 19) as f64;
/// Largest relative difference of the channels of a grey.
const GREY: f64 = 1e-6;

impl Object {
    /// Is it coloured by a column of numbers?
    pub fn is_coloured_by(&self) -> bool {
        self.source.options.points.colour_by.is_some()
    }
}

impl Scene {
    /// Makes objects that are coloured by a column of numbers show their colours, whatever the lights are. Their
    /// material undoes the ambient light, which is the same everywhere; it is added where there is none.
    ///
    /// # Errors
    /// The ambient light is not grey; here is its colour.
    pub(crate) fn unlight_coloured_by(&mut self) -> Result<(), DVec3> {
        if !self.objects.iter().any(Object::is_coloured_by) {
            return Ok(());
        }
        let ambient = self.lights.iter().map(|light| match light {
            Light::Ambient { colour } => *colour,
            Light::Directional { .. } | Light::Point { .. } => DVec3::ZERO,
        });
        let mut ambient: DVec3 = ambient.sum();
        if ambient.max_element() < FAINT {
            ambient += FAINT;
            self.lights.push(Light::Ambient { colour: DVec3::splat(FAINT) });
        }
        if ambient.max_element() - ambient.min_element() > GREY * ambient.max_element() {
            return Err(ambient);
        }
        let material =
            Material { ambient: (1.0 / ambient.x) as f32, diffuse: 0.0, specular: 0.0, ..Material::default() };
        for object in self.objects.iter_mut().filter(|object| object.is_coloured_by()) {
            object.shape.set_material(material);
            if let Some(surface) = object.shape.surface_mut() {
                surface.reflection = 0.0;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ColourBy;
    use crate::shading::{ShadingLight, shade};

    fn shown(lights: Vec<Light>) -> Result<glam::Vec3, DVec3> {
        let mut object = Object::new(crate::model::Surfels::default());
        object.source.options.points.colour_by = Some(ColourBy::default());
        let mut scene = Scene::new([object]);
        scene.lights = lights;
        scene.unlight_coloured_by()?;
        let material = scene.objects[0].shape.material().unwrap();
        let lights: Vec<ShadingLight> = scene
            .lights
            .iter()
            .map(|light| match *light {
                Light::Ambient { colour } => ShadingLight::Ambient { colour: colour.as_vec3() },
                Light::Directional { direction, colour, .. } => ShadingLight::Directional {
                    towards: -direction.as_vec3(),
                    colour: colour.as_vec3(),
                    shadows: false,
                },
                Light::Point { .. } => panic!("{light:?}"),
            })
            .collect();
        Ok(shade(&lights, &material, glam::Vec3::new(0.25, 0.5, 1.0), glam::Vec3::Y, -glam::Vec3::Z))
    }

    #[test]
    fn colours_are_those_of_the_map_whatever_the_light_is() {
        let colour = glam::Vec3::new(0.25, 0.5, 1.0);
        let sun = || Light::directional(DVec3::NEG_Y, DVec3::splat(3.0));
        let grey = |level: f64| Light::Ambient { colour: DVec3::splat(level) };
        for lights in [vec![], vec![sun()], vec![grey(1e-9)], vec![grey(0.25), sun()], vec![grey(0.3), grey(0.1)]] {
            let got = shown(lights.clone()).unwrap();
            // Measured: 6e-8 with .3 + .1, else 0.
            assert!((got - colour).abs().max_element() < 2e-7, "{lights:?}: {got}");
        }
        let blue = DVec3::new(0.1, 0.1, 0.2);
        assert_eq!(shown(vec![Light::Ambient { colour: blue }]), Err(blue));
    }
}
