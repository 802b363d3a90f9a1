//! Four meshes side by side that spin, each textured: a scene on which a splatter poses far more surfels than it shows.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use splatblur::scene::Scene;

use super::in_code::Random;
use super::in_code::triangles::{blob, cube_sphere};

/// The scene, 480 x 270; its file and the blob's are written to `target/tables/four_meshes`.
pub fn four_meshes() -> Scene {
    Scene::open(written()).size(480, 270).load().expect("the scene of four meshes")
}

/// The scene's file.
pub fn written() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("target/tables/four_meshes");
    std::fs::create_dir_all(&folder).expect("a folder for the scene");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("room for the scene");
    write("blob.obj", &blob_of(7));
    write("blob.mtl", "newmtl a\nmap_Kd blob.png\n");
    texture(7).save(folder.join("blob.png")).expect("room for a texture");
    let root = root.to_string_lossy().into_owned();
    let meshes = [
        (format!("{root}/scenes/models/CesiumMilkTruck.glb"), 0.42, [0.0, 0.0, 0.0], "0 1 0.2", 45),
        (format!("{root}/scenes/models/fuze.obj"), 9.0, [-90.0, 0.0, 0.0], "0.3 1 0.2", 55),
        (format!("{root}/tests/data/models/BoxTextured.glb"), 1.1, [20.0, 0.0, 0.0], "1 1 0", 60),
        ("blob.obj".to_owned(), 0.65, [0.0, 0.0, 0.0], "0.2 1 0.5", 70),
    ];
    let mut text = String::from(
        "<scene>\n<image width=\"480\" height=\"270\" background=\"0.45 0.5 0.55\"/>\n\
         <frames first=\"0\" last=\"8\"/>\n\
         <shutter open=\"-0.25\" close=\"0.25\"/>\n<camera eye=\"0 0.5 7\" at=\"0 0 0\" fovy=\"32\"/>\n\
         <light type=\"directional\" direction=\"-0.5 -1 -0.7\" intensity=\"0.8\"/>\n\
         <light type=\"ambient\" intensity=\"0.3\"/>\n",
    );
    for (i, (model, scale, [x, y, z], axis, turn)) in meshes.into_iter().enumerate() {
        let place = 1.75 * (i as f64 - 1.5);
        // Meshes stand beside their origin.
        let middle = ["0 -0.55 0", "0 -1.0 0", "0 0 0", "0 0 0"][i];
        writeln!(
            text,
            "<object name=\"mesh{i}\"><pointModel>{model}</pointModel>\
             <transform scale=\"{scale}\" rotate=\"{x} {y} {z}\" translate=\"{middle}\"/>\
             <motion type=\"rotation\" axis=\"{axis}\" degreesPerFrame=\"{turn}\"/>\
             <place translate=\"{place} 0 0\"/></object>"
        )
        .expect("text");
    }
    text += "</scene>\n";
    write("four_meshes.xml", &text);
    folder.join("four_meshes.xml")
}

fn blob_of(seed: u64) -> String {
    let mut random = Random(seed);
    let reach = blob(&mut random);
    let mut text = String::from("mtllib blob.mtl\nusemtl a\n");
    let mut faces = String::new();
    for (i, triangle) in cube_sphere(40, reach).into_iter().enumerate() {
        for (p, uv) in triangle {
            writeln!(text, "v {} {} {}\nvt {} {}", p.x, p.y, p.z, uv.x, uv.y).expect("text");
        }
        let [a, b, c] = [3 * i + 1, 3 * i + 2, 3 * i + 3];
        writeln!(faces, "f {a}/{a} {b}/{b} {c}/{c}").expect("text");
    }
    text + &faces
}

/// Patches of random colours, with a little noise.
fn texture(seed: u64) -> RgbImage {
    let mut dice = Pcg64::seed_from_u64(seed);
    let patches: Vec<[f64; 3]> = (0..64).map(|_| std::array::from_fn(|_| dice.random::<f64>())).collect();
    RgbImage::from_fn(256, 256, |x, y| {
        let patch = patches[(x / 32 + 8 * (y / 32)) as usize];
        Rgb(patch.map(|value| (30.0 + 190.0 * value + 20.0 * dice.random::<f64>()) as u8))
    })
}
