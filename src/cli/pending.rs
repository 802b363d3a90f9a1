//! What other modules of the library will provide; each function here becomes a call of theirs.

use std::path::Path;

use splatblur::anim::{Animation, NodeAnimation};
use splatblur::model::Surfels;
use splatblur::scene::Scene;

/// The scene as canonical XML. To become `splatblur::scene::write::to_xml`.
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

/// Names of a node's animated attributes.
pub(super) fn attributes(_node: &NodeAnimation) -> Vec<String> {
    Vec::new()
}

/// The evaluated channels at frames `first`, `first + step`, ... `last`.
pub(super) fn csv(_animation: &Animation, _first: f64, _last: f64, _step: f64) -> anyhow::Result<String> {
    anyhow::bail!("--csv is not available yet")
}

/// Writes a model as `.bin` or `.ply`.
pub(super) fn write_model(_path: &Path, _surfels: &Surfels, _binary: bool) -> anyhow::Result<()> {
    anyhow::bail!("writing models is not available yet")
}
