//! Where two surfaces touch, a pixel that shows both is no brighter than they are.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use crate::support::{object, round_surfels, scene, sphere};
use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::encode;
use splatblur::model::Material;
use splatblur::options::{BlurMode, Look, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Scene};

const SIZE: [usize; 2] = [160, 120];
const GREY: Vec3 = Vec3::splat(0.7);

/// A grey ball of radius 1 that rests on a grey floor.
fn ball_on_a_floor() -> Scene {
    let mut ball = sphere(30_000);
    ball.colour.iter_mut().for_each(|colour| *colour = GREY);
    let side = 120;
    let step = 6.0 / f64::from(side);
    let at = |i: i32| (f64::from(i % side) + 0.5, f64::from(i / side) + 0.5);
    let place = |(x, z): (f64, f64)| DVec3::new(x * step - 3.0, -1.0, z * step - 3.0);
    let floor = round_surfels((0..side * side).map(|i| (place(at(i)), DVec3::Y, step, GREY)));
    let objects = [ball, floor].map(|model| {
        let mut object = object(model.spatially_ordered());
        object.shape.surface_mut().unwrap().material =
            Some(Material { ambient: 0.2, diffuse: 0.8, specular: 0.1, shininess: 30.0 });
        object
    });
    let mut scene = scene(objects.into(), [SIZE[0] as u32, SIZE[1] as u32], DVec3::new(0.0, 0.2, 6.0), 30.0);
    scene.lights = vec![
        Light::directional(DVec3::new(-0.4, -1.0, -1.0).normalize(), DVec3::ONE).without_shadows(),
        Light::Ambient { colour: DVec3::splat(0.3) },
    ];
    scene
}

/// How much brighter each pixel is than the brightest pixel of the reference within two pixels of it, 255ths of a
/// display value. Low-pass discs move an outline by up to sqrt 2 pixels.
fn brighter(options: &RenderOptions) -> Vec<f32> {
    let scene = ball_on_a_floor();
    let traced = ReferenceOptions {
        samples: 256,
        look: Look { shading: options.look.shading, ..Look::default() },
        ..ReferenceOptions::default()
    };
    let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
    let shown = render_frame(&mut Cpu::default(), &scene, 0, options).unwrap().picture;
    let [shown, truth] = [shown, truth].map(|picture| encode(&picture)[0].clone());
    let (width, height) = (SIZE[0], SIZE[1]);
    let mut out = Vec::new();
    for (y, x) in (2..height - 2).flat_map(|y| (2..width - 2).map(move |x| (y, x))) {
        let near = (y - 2..=y + 2).flat_map(|y| (x - 2..=x + 2).map(move |x| y * width + x));
        let most = near.map(|at| truth[at]).fold(0.0, f32::max);
        out.push(255.0 * (shown[y * width + x] - most));
    }
    out
}

/// The averaged normals of ball and floor point between both, to the light: a rim that neither has.
#[test]
fn no_light_rim_where_a_ball_rests_on_a_floor() {
    let options = RenderOptions { quality: BlurMode::Still { pixel_samples: 16 }.into(), ..RenderOptions::default() };
    let mut rim = brighter(&options);
    rim.sort_by(f32::total_cmp);
    let worst = rim.last().copied().unwrap();
    let beyond = rim.iter().filter(|&&difference| difference > 2.0).count();
    println!("worst {worst:.2}/255, {beyond} pixels beyond 2/255");
    assert!(worst <= 2.0, "{beyond} pixels are brighter by more than 2/255, one by {worst:.1}");
}

/// Noise makes the mean of normals shorter too. That must not make a surface darker.
#[test]
fn noisy_normals_are_as_bright_as_in_the_reference() {
    let mut scene = ball_on_a_floor();
    let mut ball = sphere(8000);
    for (i, normal) in ball.normal.iter_mut().enumerate() {
        let [a, b, c] = [12.9898, 78.233, 37.719].map(|rate| (rate * i as f32).sin());
        *normal = (*normal + 0.4 * Vec3::new(a, b, c)).normalize();
    }
    scene.objects = vec![object(ball.spatially_ordered())];
    let traced = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
    let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
    let options = RenderOptions { quality: BlurMode::Still { pixel_samples: 16 }.into(), ..RenderOptions::default() };
    let shown = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture;
    // The ball's centre is 7.5 pixels below the image's, its radius 37 pixels.
    let inner = |at: &usize| ((at % SIZE[0]) as f32 - 80.0).hypot((at / SIZE[0]) as f32 - 67.5) < 25.0;
    let mean = |picture| {
        let values = encode(picture)[0].clone();
        let inside: Vec<f64> = (0..values.len()).filter(inner).map(|at| f64::from(values[at])).collect();
        255.0 * inside.iter().sum::<f64>() / inside.len() as f64
    };
    let darker = mean(&truth) - mean(&shown);
    println!("darker by {darker:.3}/255");
    assert!(darker.abs() < 1.0, "darker by {darker:.3}/255");
}
