//! The layer `object`: which object has the largest share of each pixel over the exposure.
//!
//! The share of an object is what it adds to the pixel's alpha: the sum over time samples of its part of the weights
//! that pass the depth test, times the sample's weight and coverage. It is rendered as a matte: the whole frame, in
//! which this object is white and all others are black. So it has the visibility of the picture in every mode on every
//! backend, and costs one more rendering of the frame for each object.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::backend::{Achieved, Backend, BackendError, Rendered};
use crate::film::{Aov, Layer};
use crate::frame::Frame;
use crate::model::Material;
use crate::options::{BlurMode, ErrorTarget, Interleave, Look, Quality, RenderOptions, Shading, Times};
use crate::scene::{Light, Scene};
use crate::time::FrameNumber;

/// Fewest time samples of the mattes in mode auto, as far as the target allows.
const LEAST_SAMPLES: u32 = 16;
/// Shares are compared in units of 1 / this. Shares that are equal but for rounding are equal then.
const UNITS: f32 = 65_536.0;

/// Adds the layer to `rendered`, which is the frame without it.
///
/// # Errors
/// The backend cannot render the frame within its limits.
pub fn add_layer(
    backend: &mut dyn Backend,
    scene: &Scene,
    number: FrameNumber,
    options: &RenderOptions,
    mut rendered: Rendered,
) -> Result<Rendered, BackendError> {
    let mode = match options.quality {
        Quality::Mode(mode) => mode,
        Quality::Error(target) => mode_of_mattes(target, rendered.stats.achieved),
    };
    let of_mattes = RenderOptions {
        reconstruct: false,
        look: Look { shading: Shading::Gouraud, aovs: Vec::new(), ..options.look.clone() },
        ..options.clone()
    };
    let pixels = rendered.picture.rgba.len();
    let planes: usize = rendered.picture.layers.iter().map(|layer| layer.planes.len()).sum();
    // The picture, and the two columns below.
    let held = (pixels * ((4 + planes) * size_of::<f32>() + 2 * size_of::<u32>())) as u64;
    let mut largest = vec![0_u32; pixels];
    let mut indices = vec![0.0_f32; pixels];
    let samples = rendered.stats.samples;
    let mut first = 0;
    for (i, parts) in scene.objects.chunk_by(|_, next| next.is_part()).enumerate() {
        let range = first..first + parts.len();
        first = range.end;
        if parts.iter().all(|object| object.shape.elements() == 0) {
            continue;
        }
        let matte = matte(scene, &range);
        let mut frame = Frame::new(&matte, number, mode, &of_mattes);
        frame.picture_bytes = held;
        let shares = backend.render(frame)?;
        for ((largest, index), pixel) in largest.iter_mut().zip(&mut indices).zip(&shares.picture.rgba) {
            let share = units(pixel[0]);
            // The lower index keeps a tie.
            if share > *largest {
                (*largest, *index) = (share, (i + 1) as f32);
            }
        }
        rendered.stats.add(&shares.stats);
        backend.recycle(shares.picture);
    }
    // The samples of the picture alone, without those of the mattes.
    rendered.stats.samples = samples;
    let names = scene.objects.iter().filter(|object| !object.is_part()).map(|object| object.name.clone()).collect();
    rendered.picture.layers.push(Layer { aov: Aov::Object, planes: vec![indices], names });
    Ok(rendered)
}

/// Mode auto has different samples in different blocks. All mattes have those of its first round, or 16 if that is
/// more.
fn mode_of_mattes(target: ErrorTarget, achieved: Option<Achieved>) -> BlurMode {
    let (samples, stride) = achieved.map_or((0, 1), |achieved| (achieved.samples, achieved.interleave));
    let interleave = Interleave::with_stride(stride).unwrap_or_default();
    let samples = samples.max(LEAST_SAMPLES.min(target.samples_max));
    BlurMode::Supersample { samples, pixel_samples: None, interleave, times: Times::Even }
}

/// A share in whole units; a share above 0 has one at least.
fn units(share: f32) -> u32 {
    if share > 0.0 { ((share * UNITS).round() as u32).max(1) } else { 0 }
}

/// The scene before black, with the objects `shown` in white and all others in black, whatever their colours.
///
/// The specular term does not know colours, and with the exponent 0 it is the same from everywhere: ks L (docs/math.md,
/// eq. 7). No model is copied for that.
fn matte(scene: &Scene, shown: &Range<usize>) -> Scene {
    let mut scene = scene.clone();
    scene.image.transparent = true;
    scene.environment = None;
    scene.lights = vec![Light::directional(DVec3::NEG_Z, DVec3::ONE).without_shadows()];
    for (i, object) in scene.objects.iter_mut().enumerate() {
        let specular = if shown.contains(&i) { 1.0 } else { 0.0 };
        object.shadow_catcher = false;
        object.shape.set_material(Material { ambient: 0.0, diffuse: 0.0, specular, shininess: 0.0 });
        if let Some(model) = object.shape.gaussians_mut() {
            model.flat = Some(Vec3::splat(specular));
        }
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_that_differ_by_rounding_are_equal() {
        assert_eq!([0.0, -1e-9, 1e-9, 0.5, 0.5 + 1e-6, 1.0].map(units), [0, 0, 1, 32_768, 32_768, 65_536]);
        assert!(units(0.5 + 1e-4) > units(0.5));
        assert_eq!(units(f32::NAN), 0);
    }

    #[test]
    fn mattes_of_mode_auto_have_the_samples_of_its_first_round() {
        let target = ErrorTarget::default();
        let achieved = |samples, interleave| {
            let none = Achieved {
                error: 0.0,
                path_length: 0.0,
                turn: 0.0,
                samples,
                most_samples: 9 * samples,
                interleave,
                blocks: 1,
                refined: 0,
                capped: 0,
            };
            mode_of_mattes(target, Some(none))
        };
        assert_eq!(achieved(24, 1), BlurMode::supersample(24));
        assert_eq!(achieved(24, 2), BlurMode::interleaved(24, Interleave::Two));
        assert_eq!(achieved(4, 1), BlurMode::supersample(16));
        let few = ErrorTarget { samples_max: 8, ..target };
        assert_eq!(mode_of_mattes(few, None), BlurMode::supersample(8));
    }
}
