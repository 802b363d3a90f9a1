//! What other modules of the library will provide; each function here becomes a call of theirs.

use std::path::Path;

use splatblur::anim::{Animation, NodeAnimation};
use splatblur::model::Surfels;
use splatblur::scene::Scene;

/// The scene as canonical XML. To become `splatblur::scene::to_xml(scene, relative_to)`.
pub(super) fn canonical_xml(scene: &Scene, _relative_to: &Path) -> String {
    use std::fmt::Write as _;
    let mut text = format!("{:?}\n{:?}\n{:?}\n{:?}\n", scene.image, scene.frames, scene.shutter, scene.lights);
    let c = &scene.camera;
    let _ = writeln!(text, "{:?} {:?} {:?} {} {}", c.eye, c.at, c.up, c.fovy, c.near);
    for o in &scene.objects {
        let _ = writeln!(text, "{} {} {:?} {:?}", o.name, o.radius_scale, o.colour_space, o.transform);
        let _ = writeln!(text, "{:?} {:?} {:?} {:?} {}", o.motions, o.place, o.material, o.epsilon, o.blur);
        if let Some(a) = &o.animation {
            let _ = writeln!(text, "{} {:?}", a.node.name, a.interpolation);
        }
    }
    text
}

/// Names of a node's animated attributes. To become `node.attributes().map(str::to_owned).collect()`.
pub(super) fn attributes(_node: &NodeAnimation) -> Vec<String> {
    Vec::new()
}

/// The evaluated channels at frames `first`, `first + step`, ... `last`.
/// To become `animation.csv(frames, Interpolation::Maya)`.
pub(super) fn csv(_animation: &Animation, first: f64, last: f64, step: f64) -> anyhow::Result<String> {
    // A millionth of a step forgives decimal steps that do not add up exactly.
    let rows = ((last - first) / step + 1e-6).floor() as u64;
    let _frames = (0..=rows).map(|i| first + i as f64 * step);
    anyhow::bail!("--csv is not available yet")
}

/// Writes a model: `splatblur::model::write_bin(path, surfels)?` where `binary`, else `write_ply`.
pub(super) fn write_model(_path: &Path, _surfels: &Surfels, _binary: bool) -> anyhow::Result<()> {
    anyhow::bail!("writing models is not available yet")
}
