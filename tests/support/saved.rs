//! Models of every format in two versions, and a program that saves them in place, again and again.

#![allow(dead_code, reason = "each group of tests uses some of it")]

use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use splatblur::model::{LoadOptions, LoadedShape, Surfels, load};

/// Saves of each file, in each manner.
pub(crate) fn saves(default: usize) -> usize {
    std::env::var("SPLATBLUR_SAVES").map_or(default, |text| text.parse().expect("SPLATBLUR_SAVES is a number"))
}

/// The two versions of a model: the files that belong to it, the one that a scene names first. Sizes differ.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) versions: [Vec<(String, Vec<u8>)>; 2],
}

impl Case {
    fn new(ending: &str, versions: [Vec<u8>; 2]) -> Self {
        let name = format!("m.{ending}");
        Self { versions: versions.map(|bytes| vec![(name.clone(), bytes)]), name }
    }

    /// Puts a version into a folder.
    pub(crate) fn put(&self, version: usize, dir: &Path) {
        for (name, bytes) in &self.versions[version] {
            std::fs::write(dir.join(name), bytes).unwrap();
        }
    }
}

fn shipped(path: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// A ball of points: x, y, z, each from -1 to 1, and bytes of a colour.
fn ball(points: usize) -> Vec<([f32; 3], [u8; 3])> {
    let golden = std::f32::consts::PI * (5.0_f32.sqrt() - 1.0);
    let point = |i: usize| {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / points as f32;
        let (r, a) = ((1.0 - y * y).sqrt(), golden * i as f32);
        ([r * a.cos(), y, r * a.sin()], [(i % 256) as u8, 120, (i / 7 % 256) as u8])
    };
    (0..points).map(point).collect()
}

/// One case for each format of models. `dir` is a folder to work in.
pub(crate) fn cases(dir: &Path) -> Vec<Case> {
    let sizes = [900, 1400];
    let lines = |line: &dyn Fn([f32; 3], [u8; 3]) -> String| {
        sizes.map(|size| ball(size).into_iter().map(|(p, c)| line(p, c)).collect::<String>())
    };
    let xyz = lines(&|[x, y, z], [r, g, b]| format!("{x} {y} {z} {r} {g} {b}\n"));
    let pts = lines(&|[x, y, z], [r, g, b]| format!("{x} {y} {z} 1 {r} {g} {b}\n"));
    let obj = lines(&|[x, y, z], _| format!("v {x} {y} {z}\n"));
    let ply = [0, 1].map(|version| {
        let header = "ply\nformat binary_little_endian 1.0\nelement vertex";
        let columns = "property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
                       property uchar green\nproperty uchar blue\nend_header\n";
        let mut bytes = format!("{header} {}\n{columns}", sizes[version]).into_bytes();
        for (p, c) in ball(sizes[version]) {
            bytes.extend(p.map(f32::to_le_bytes).as_flattened());
            bytes.extend(c);
        }
        bytes
    });
    let bin = [0, 1].map(|version| {
        let [from, to] = ["of.ply", "to.bin"].map(|name| dir.join(name));
        std::fs::write(&from, &ply[version]).unwrap();
        splatblur::model::write_bin(&to, &surfels(&from).unwrap()).unwrap();
        std::fs::read(to).unwrap()
    });
    let splat = sizes.map(|size| {
        let record = |(p, [r, g, b]): ([f32; 3], [u8; 3])| {
            let floats = [p, [0.05, 0.04, 0.03]].concat().into_iter().flat_map(f32::to_le_bytes);
            floats.chain([r, g, b, 255, 255, 128, 128, 128]).collect::<Vec<u8>>()
        };
        ball(size).into_iter().flat_map(record).collect::<Vec<u8>>()
    });
    let nrrd = [12, 16].map(|size: i32| {
        let header = "NRRD0004\ntype: float\ndimension: 3\nencoding: raw\nendian: little\n";
        let mut bytes = format!("{header}sizes: {size} {size} {size}\n\n").into_bytes();
        let half = (size / 2) as f32;
        for i in 0..size * size * size {
            let d = [i % size, i / size % size, i / size / size].map(|k| (k as f32 - half) / half);
            bytes.extend((1.0 - d.iter().map(|x| x * x).sum::<f32>()).max(0.0).to_le_bytes());
        }
        bytes
    });
    // The text scales what the data hold: the text of one version with the data of the other is a third model.
    let gltf = [1_u8, 2].map(|scale| {
        let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].concat();
        let data: Vec<u8> = corners.iter().flat_map(|x| (x * f32::from(3 - scale)).to_le_bytes()).collect();
        let text = format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\
             \"nodes\":[{{\"mesh\":0,\"scale\":[{scale},1,1]}}],\
             \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\
             \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\
             \"min\":[0,0,0],\"max\":[2,2,0]}}],\
             \"bufferViews\":[{{\"buffer\":0,\"byteLength\":36}}],\
             \"buffers\":[{{\"uri\":\"m.data\",\"byteLength\":36}}]}}"
        );
        vec![("m.gltf".to_owned(), text.into_bytes()), ("m.data".to_owned(), data)]
    });
    let corpus = |names: [&str; 2]| names.map(|name| shipped(&format!("fuzz/corpus/{name}")));
    vec![
        Case::new("ply", ply),
        Case::new("bin", bin),
        Case::new("xyz", xyz.map(String::into_bytes)),
        Case::new("pts", [0, 1].map(|v| format!("{}\n{}", sizes[v], pts[v]).into_bytes())),
        Case::new("obj", obj.map(String::into_bytes)),
        Case::new("splat", splat),
        Case::new("spz", corpus(["spz/ok-v3.spz", "spz/ok-v4-records.spz"])),
        Case::new("sog", corpus(["sog/ok-deflated.sog", "sog/ok-harmonics.sog"])),
        Case::new("sfl", other_sfl(dir)),
        Case::new("glb", ["BoxInterleaved", "cubevc"].map(|name| shipped(&format!("tests/data/models/{name}.glb")))),
        Case { name: "m.gltf".to_owned(), versions: gltf },
        Case::new("nrrd", nrrd),
    ]
}

/// The surfels of a file that holds some.
fn surfels(path: &Path) -> Option<Surfels> {
    let loaded = load(path, &LoadOptions::default(), &|_, _| {}).ok()?;
    if let LoadedShape::Surfels(surfels, _) = loaded.shape { Some(surfels) } else { None }
}

/// The one file that ships, and the same with a bit changed that moves a point.
fn other_sfl(dir: &Path) -> [Vec<u8>; 2] {
    let a = shipped("tests/data/models/tiny_full.sfl");
    let path = dir.join("a.sfl");
    let positions = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        surfels(&path).map(|surfels| surfels.position)
    };
    let before = positions(&a);
    let changed = |at: usize| {
        let mut b = a.clone();
        b[at] ^= 16;
        positions(&b).is_some_and(|after| Some(after) != before).then_some(b)
    };
    let b = (a.len() / 2..a.len()).find_map(changed).expect("a byte of a position");
    [a, b]
}

/// Saves the versions in turn, `saves` times, until it is dropped.
pub(crate) struct Saver {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// `truncating`: each file is emptied first, else it is written over and then cut. Every `calm`th pause is long
    /// enough for the viewer to read, which waits for files to come to rest.
    pub(crate) fn start(dir: &Path, case: &Case, truncating: bool, saves: usize, calm: usize) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (dir, versions, stopped) = (dir.to_owned(), case.versions.clone(), Arc::clone(&stop));
        let work = move || {
            // Any pauses that differ will do.
            let mut state = 1_u32;
            for count in 1..=saves {
                // The version that was there is 0.
                for (name, bytes) in &versions[count % 2] {
                    save(&dir.join(name), bytes, truncating);
                }
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let pause = if count % calm == 0 { 600 } else { u64::from(state >> 24) / 3 };
                thread::sleep(Duration::from_millis(pause));
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
            }
        };
        Self { stop, thread: Some(thread::spawn(work)) }
    }

    pub(crate) fn is_done(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Saver {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let done = self.thread.take().map(JoinHandle::join);
        assert!(thread::panicking() || done.is_none_or(|done| done.is_ok()), "a save failed");
    }
}

/// Saves a file in place: the name keeps its inode. One call writes it all: a program that rests for longer than
/// 20 ms in the middle of a save cannot be told from one that is done.
fn save(path: &Path, bytes: &[u8], truncating: bool) {
    if truncating {
        File::create(path).unwrap().write_all(bytes).unwrap();
    } else {
        let mut file = OpenOptions::new().write(true).open(path).unwrap();
        file.write_all(bytes).unwrap();
        file.set_len(bytes.len() as u64).unwrap();
    }
}

/// The program. Another one, to see what it does, is named in `SPLATBLUR_PROGRAM`.
pub(crate) fn program() -> Command {
    let own = PathBuf::from(env!("CARGO_BIN_EXE_splatblur"));
    Command::new(std::env::var_os("SPLATBLUR_PROGRAM").map_or(own, PathBuf::from))
}

/// A small scene of this model alone, with one frame. The models of all cases are in its image.
pub(crate) fn scene_of(model: &str) -> String {
    let camera = if model == "m.sfl" { "eye=\"20 30 36\" at=\"14 22 26\"" } else { "eye=\"1 2 14\" at=\"0 0 0\"" };
    format!(
        "<scene><image width=\"16\" height=\"12\"/><frames first=\"1\" last=\"1\"/>\
         <camera {camera}/><object><pointModel>{model}</pointModel></object></scene>"
    )
}
