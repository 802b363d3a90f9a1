//! Small valid inputs of every reader. A run takes one of them and damages one of its files.

use std::fs;
use std::path::{Path, PathBuf};

/// How an input is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Way {
    /// The first file is a model: the scene of it alone is rendered.
    Model,
    /// The first file is a scene.
    Scene,
    /// The first file is a picture.
    Picture,
    /// The first file is a `transforms.json`, for `splatblur dataset --replay`.
    Replay,
}

/// An input.
#[derive(Clone, Debug)]
pub(crate) struct Seed {
    /// What it is.
    pub(crate) name: String,
    pub(crate) way: Way,
    /// Names and contents, all in one folder.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// Which of them is damaged.
    pub(crate) target: usize,
}

impl Seed {
    fn new(name: impl Into<String>, way: Way, files: Vec<(&str, Vec<u8>)>, target: usize) -> Self {
        let files = files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect();
        Self { name: name.into(), way, files, target }
    }
}

/// Folders of the corpus whose files are models, and the name that each gets.
const MODELS: [(&str, &str); 15] = [
    ("bin", "input.bin"),
    ("glb", "input.glb"),
    ("gltf", "input.glb"),
    ("mesh_obj", "input.obj"),
    ("npy", "input.npy"),
    ("npz", "input.npz"),
    ("nrrd", "input.nrrd"),
    ("obj", "input.obj"),
    ("ply", "input.ply"),
    ("pts", "input.pts"),
    ("sfl", "input.sfl"),
    ("sog", "input.sog"),
    ("splat", "input.splat"),
    ("spz", "input.spz"),
    ("xyz", "input.xyz"),
];

/// Models of the tests. The PLY and the glTF files are meshes, too.
const MORE_MODELS: [&str; 5] =
    ["BoxInterleaved.glb", "BoxTextured.glb", "cubevc.glb", "polygonfaces.obj", "tiny_full.sfl"];

/// A model that scenes name.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property float nx\nproperty float ny\nproperty float nz\nproperty float radius\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nend_header\n\
    0 0 0 0 0 1 0.3 200 100 50\n0.4 0.1 0 0 0 1 0.3 10 20 30\n-0.3 0.2 0.1 0 0 1 0.3 255 255 255\n";

/// A mesh with a texture.
const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
    usemtl a\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl b\nf 1//1 3//1 4//1\n";
const MTL: &str = "newmtl a\nKd 0.8 0.7 0.6\nd 0.9\nmap_Kd -s 2 2 1 -o 0.1 0.2 texture\nnewmtl b\nKd 0.1 0.2 0.3\n";

/// Every attribute that a scene file can have.
const EVERYTHING: &str = include_str!("../data/scenes/everything.xml");

/// Every part that a scene can have, with the least of numbers that take long. The material is that of [`EVERYTHING`].
const SCENE: &str = r#"<scene>
  <image width="24" height="16" background="0.1 0.2 0.3"/>
  <frames first="0" last="3" rate="25"/>
  <shutter open="-0.5" close="0.5" readout="0.3" direction="down"/>
  <camera eye="0.3 0.4 3" at="0 0 0" up="0 1 0" fovy="40" near="0.01">
    <motion type="linear" velocity="0.1 0 -0.3"/></camera>
  <light type="directional" direction="-0.5 -1 -0.8" colour="1 0.9 0.8" intensity="0.9"/>
  <light type="point" position="1 2 3" colour="1 0.3 0" intensity="4"/>
  <light type="ambient" colour="0.1 0.2 0.3" intensity="0.7"/>
  <environment intensity="1.5" rotation="-33.3" background="true">e.png</environment>
  <object name="a" twoSided="true" epsilon="0.0125">
    <pointModel radiusScale="1.25" colourSpace="linear">model.ply</pointModel>
    <transform translate="0.16 -0.1 0" rotate="0.1 -90 33.3" scale="1.7"/>
    <animation interpolation="spline">motion.anim</animation>
    <motion type="rotation" axis="1 2 3" degreesPerFrame="-12.345" centre="0.1 0.2 0.3"/>
    <place translate="0.1 0.2 0.3" rotate="10 20 30" scale="-1 2 0.3"/>
    <material/>
  </object>
  <object><pointModel kernel="0.9" flatten="1.5" lit="true">grid.nrrd</pointModel>
    <transferFunction><stop value="-1e-3" opacity="0"/><stop value="0.1" colour="1 0.3 0.007" opacity="12.5"/>
    </transferFunction></object>
</scene>"#;

const NRRD: &[u8] = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nspacings: 1 2 3\nencoding: raw\n\n01234567";

const TUM: &str = "# timestamp tx ty tz qx qy qz qw\n1300000000.0 0 0 3 0 0 0 1\n1300000000.04 0.1 0 3 0 0.1 0 0.99\n\
    1300000000.08 0.2 0.1 3.1 0 0.2 0 0.97\n";
const NERFSTUDIO: &str = r#"{"fl_x":300,"fl_y":300,"cx":160,"cy":120,"w":320,"h":240,"k1":0.0,"frames":[
    {"file_path":"f_1.png","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]},
    {"file_path":"f_2.png","transform_matrix":[[0.995,0,0.0998,0.3],[0,1,0,0],[-0.0998,0,0.995,3],[0,0,0,1]]}]}"#;
const INRIA: &str = r#"[{"id":0,"img_name":"f1","width":320,"height":240,"position":[0,0,3],
    "rotation":[[1,0,0],[0,-1,0],[0,0,-1]],"fx":300.0,"fy":300.0},{"id":1,"img_name":"f2","width":320,"height":240,
    "position":[0.1,0,3],"rotation":[[1,0,0],[0,-1,0],[0,0,-1]],"fx":300.0,"fy":300.0}]"#;
const COLMAP: &str = "# comment\n1 0 1 0 0 0 0 3 7 a name 1.png\n10.5 11.5 -1\n2 0.1 0.99 0 0 0.1 0 3 7 2.png\n\n";
const CAMERAS: &str = "# comment\n7 PINHOLE 320 240 300 300 160 120\n";

/// What `splatblur dataset` records; its hash is that of no run.
const TRANSFORMS: &str = r#"{"camera_model":"OPENCV","frames":[],"splatblur":{"program":"splatblur 0.1.0",
    "scene":"scene.xml","arguments":["--mode=supersample:2","--frames=0","--size=24x16","--sharp=1"],
    "backend":"cpu","hash":"0123456789abcdef"}}"#;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The files of a folder of the corpus, sorted.
fn corpus(folder: &str) -> Vec<(String, Vec<u8>)> {
    let folder = root().join("fuzz/corpus").join(folder);
    let Ok(entries) = fs::read_dir(&folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), read(path))).collect()
}

fn scene_around(camera: &str, object: &str) -> String {
    format!(
        "<scene><image width=\"24\" height=\"16\"/><frames first=\"0\" last=\"2\"/>{camera}<object>\
         <pointModel>model.ply</pointModel>{object}</object></scene>"
    )
}

/// All seeds, by the reader that they are for: each reader gets as many runs.
pub(crate) fn seeds() -> Vec<Vec<Seed>> {
    let models = root().join("tests/data/models");
    let mut groups: Vec<Vec<Seed>> = Vec::new();
    for (folder, name) in MODELS {
        let of_name = |(file, bytes): (String, Vec<u8>)| {
            Seed::new(format!("{folder}/{file}"), Way::Model, vec![(name, bytes)], 0)
        };
        groups.push(corpus(folder).into_iter().map(of_name).collect());
    }
    groups.push(
        MORE_MODELS
            .iter()
            .map(|name| {
                let input = format!("input.{}", extension(name));
                Seed::new(*name, Way::Model, vec![(&input, read(&models.join(name)))], 0)
            })
            .collect(),
    );
    groups.push(capture_in_a_scene());
    groups.push(vec![Seed::new("packed NRRD", Way::Model, vec![("input.nrrd", packed_nrrd())], 0)]);
    let pictures = pictures();
    groups.push(pictures.iter().flat_map(textured).collect());
    groups.push(
        pictures
            .iter()
            .map(|(name, bytes)| Seed::new(name.clone(), Way::Picture, vec![("input.img", bytes.clone())], 0))
            .collect(),
    );
    groups.push(pictures.iter().map(environment).collect());
    groups.push(corpus("anim").into_iter().map(|(name, bytes)| animated(&name, bytes)).collect());
    groups.push(tracks());
    let material = EVERYTHING.lines().find(|line| line.contains("<material")).expect("a material");
    let scene = SCENE.replace("    <material/>", material);
    let mut scenes = vec![Seed::new("scene", Way::Scene, scene_files(scene.into_bytes()), 0)];
    scenes.extend(corpus("scene").into_iter().map(|(name, bytes)| Seed::new(name, Way::Scene, scene_files(bytes), 0)));
    groups.push(scenes);
    let scene = scene_around("<camera eye=\"0 0 3\" at=\"0 0 0\"/>", "").into_bytes();
    let replay = vec![
        ("transforms.json", TRANSFORMS.as_bytes().to_vec()),
        ("scene.xml", scene),
        ("model.ply", PLY.as_bytes().to_vec()),
    ];
    groups.push(vec![Seed::new("transforms.json", Way::Replay, replay, 0)]);
    groups.retain(|group| !group.is_empty());
    groups
}

fn extension(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(_, extension)| extension)
}

/// A scene, and all that ours name.
fn scene_files(scene: Vec<u8>) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("scene.xml", scene),
        ("model.ply", PLY.as_bytes().to_vec()),
        ("motion.anim", read(&root().join("fuzz/corpus/anim/ok-two-keys.anim"))),
        ("e.png", png(16, 8)),
        ("grid.nrrd", NRRD.to_vec()),
    ]
}

fn animated(name: &str, bytes: Vec<u8>) -> Seed {
    let scene = scene_around("", "<animation>motion.anim</animation>").into_bytes();
    let files = vec![("scene.xml", scene), ("model.ply", PLY.as_bytes().to_vec()), ("motion.anim", bytes)];
    Seed::new(format!("anim/{name}"), Way::Scene, files, 2)
}

/// Captures as surfels, in scenes that say more.
fn capture_in_a_scene() -> Vec<Seed> {
    let files = [("splat", "ok-two.splat"), ("spz", "ok-v3.spz"), ("sog", "ok-stored.sog"), ("glb", "ok-degree-1.glb")];
    files
        .into_iter()
        .map(|(folder, file)| {
            let bytes = read(&root().join("fuzz/corpus").join(folder).join(file));
            let name = format!("input.{folder}");
            let scene = format!(
                "<scene><image width=\"24\" height=\"16\"/>\
                 <object><pointModel kind=\"surfels\" radiusScale=\"2\">{name}</pointModel>\
                 <motion type=\"linear\" velocity=\"0.3 0 0\"/></object></scene>"
            );
            Seed::new(format!("{file} as surfels"), Way::Scene, vec![("s.xml", scene.into()), (&name, bytes)], 1)
        })
        .collect()
}

fn packed_nrrd() -> Vec<u8> {
    let header = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 3 3 3\nencoding: gzip\n\n";
    let values: Vec<u8> = (0..27).map(|i| i * 9).collect();
    [&header[..], &super::mutate::gzip(&values)].concat()
}

/// Pictures of every format that something reads.
fn pictures() -> Vec<(String, Vec<u8>)> {
    let models = root().join("tests/data/models");
    let mut pictures = vec![("ours.png".to_owned(), png(16, 8))];
    pictures.extend(["cmyk.jpg", "grey.jpg", "six.webp"].map(|name| (name.to_owned(), read(&models.join(name)))));
    pictures.extend(corpus("image").into_iter().filter(|(name, _)| name.starts_with("ok-")));
    pictures
}

/// A mesh with this texture, of which each file is damaged in turn.
fn textured((name, bytes): &(String, Vec<u8>)) -> Vec<Seed> {
    let texture = format!("t.{}", extension(name));
    let library = MTL.replace("texture", &texture);
    let files = vec![("input.obj", OBJ.as_bytes().to_vec()), ("m.mtl", library.into()), (&*texture, bytes.clone())];
    (0..3).map(|target| Seed::new(format!("mesh with {name}"), Way::Model, files.clone(), target)).collect()
}

fn environment((name, bytes): &(String, Vec<u8>)) -> Seed {
    let file = format!("e.{}", extension(name));
    let around = format!("<environment background=\"true\">{file}</environment>");
    let scene = scene_around(&around, "<material reflection=\"0.5\"/>").into_bytes();
    let files = vec![("s.xml", scene), ("model.ply", PLY.as_bytes().to_vec()), (&*file, bytes.clone())];
    Seed::new(format!("environment {name}"), Way::Scene, files, 2)
}

fn tracks() -> Vec<Seed> {
    let texts = [
        ("nerfstudio", "t.json", NERFSTUDIO, None),
        ("3dgs", "t.json", INRIA, None),
        ("tum", "t.txt", TUM, None),
        ("colmap", "images.txt", COLMAP, Some(("cameras.txt", CAMERAS.as_bytes().to_vec()))),
    ];
    let mut seeds = Vec::new();
    for (format, file, text, beside) in texts {
        seeds.extend(track(format, file, text.as_bytes().to_vec(), beside));
    }
    let mut images = 1_u64.to_le_bytes().to_vec();
    images.extend(1_i32.to_le_bytes());
    images.extend([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 3.0].map(f64::to_le_bytes).as_flattened());
    images.extend(7_i32.to_le_bytes());
    images.extend(b"f1.png\0");
    images.extend(1_u64.to_le_bytes());
    images.extend([0; 24]);
    let mut cameras = 1_u64.to_le_bytes().to_vec();
    cameras.extend([7_i32, 1].map(i32::to_le_bytes).as_flattened());
    cameras.extend([320_u64, 240].map(u64::to_le_bytes).as_flattened());
    cameras.extend([300.0, 300.0, 160.0, 120.0].map(f64::to_le_bytes).as_flattened());
    seeds.extend(track("colmap", "images.bin", images, Some(("cameras.bin", cameras))));
    seeds
}

/// A scene with this track, of which each file is damaged in turn.
fn track(format: &str, file: &str, bytes: Vec<u8>, beside: Option<(&str, Vec<u8>)>) -> Vec<Seed> {
    let camera = format!("<camera><track format=\"{format}\">{file}</track></camera>");
    let mut files =
        vec![("s.xml", scene_around(&camera, "").into_bytes()), ("model.ply", PLY.as_bytes().to_vec()), (file, bytes)];
    files.extend(beside);
    (2..files.len()).map(|target| Seed::new(format!("track {format}"), Way::Scene, files.clone(), target)).collect()
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let rgba = (0..width * height).map(|i| [i as f32 / 128.0, 0.25, 0.5, 1.0]).collect();
    let picture = splatblur::Picture { width, height, rgba, layers: Vec::new() };
    let format = splatblur::image::Format::Png { bits: splatblur::image::Bits::Eight, alpha: false };
    splatblur::image::encode(&picture, format, "").unwrap_or_default()
}
