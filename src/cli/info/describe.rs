//! What `info` reports, as JSON values, and those as text: one source for both.
//!
//! Text is `key: value` with two spaces of indent a level; short lists of numbers stay on one line.

#[cfg(feature = "formats")]
use std::path::PathBuf;

use glam::{DVec2, DVec3};
use serde_json::{Map, Value, json};
use splatblur::anim::{Animation, NodeAnimation, NodeMotion};
use splatblur::environment::Environment;
use splatblur::film::Picture;
use splatblur::gltf::{AnimationEntry, NodeEntry, Nodes};
use splatblur::math::{Bounds, Trs};
use splatblur::model::mesh::{Mesh, Texture};
use splatblur::model::{Gaussians, LoadedModel, LoadedShape, Material, Optics, Surfels, VelocityUnit, VolumeFacts};
#[cfg(feature = "formats")]
use splatblur::model::{Scan, ScanFacts};
use splatblur::scene::{AnimationBinding, Camera, GaussianModel, Light, Motion, Object, Shape};
use splatblur::scene_file;

fn object(pairs: Vec<(&str, Value)>) -> Value {
    Value::Object(pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect::<Map<_, _>>())
}

fn vector(v: DVec3) -> Value {
    json!(v.to_array().map(tidy))
}

/// Twelve digits: enough for every value that a file can hold as f32, without the noise of unit conversions.
fn tidy(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// An f32 with the digits that an f32 has.
fn single(value: f32) -> Value {
    json!(value.to_string().parse::<f64>().unwrap_or(f64::from(value)))
}

/// A scene with all that it names.
pub(super) fn scene(loaded: &scene_file::LoadedScene) -> Value {
    let s = &loaded.scene;
    let mut pairs = vec![
        ("kind", json!("scene")),
        ("name", json!(s.name)),
        ("width", json!(s.image.width)),
        ("height", json!(s.image.height)),
        ("background", if s.image.transparent { json!("transparent") } else { vector(s.image.background) }),
        ("frames", json!({ "first": s.frames.first, "last": s.frames.last, "rate": s.frames.rate })),
        (
            "shutter",
            json!({
                "open": s.shutter.open, "close": s.shutter.close, "weight": s.shutter.weight.to_string(),
                "readout": s.shutter.readout.duration, "direction": s.shutter.readout.direction.name(),
                "anchor": s.shutter.readout.anchor.name(),
            }),
        ),
        ("camera", camera(&s.camera)),
        ("lights", Value::Array(s.lights.iter().map(light).collect())),
        ("objects", Value::Array(s.objects.iter().map(scene_object).collect())),
        ("notes", json!(loaded.notes)),
    ];
    pairs.extend(s.environment.as_ref().map(|environment| ("environment", surroundings(environment))));
    object(pairs)
}

fn surroundings(e: &Environment) -> Value {
    object(vec![
        ("path", json!(e.path.to_string_lossy())),
        ("width", json!(e.map().width())),
        ("height", json!(e.map().height())),
        ("intensity", json!(e.intensity)),
        ("rotation_degrees", json!(tidy(e.rotation.to_degrees()))),
        ("background", json!(e.background)),
        ("light", json!(e.light)),
        ("shadows", json!(e.shadows)),
    ])
}

fn camera(c: &Camera) -> Value {
    let mut pairs = vec![("fovy_degrees", json!(tidy(c.fovy.to_degrees()))), ("near", json!(c.near))];
    if let Some(animation) = &c.animation {
        pairs.push(("animation", binding(animation)));
    } else {
        pairs.extend([("eye", vector(c.eye)), ("at", vector(c.at)), ("up", vector(c.up))]);
    }
    if c.shift != DVec2::ZERO {
        pairs.push(("principal_shift", json!([tidy(c.shift.x), tidy(c.shift.y)])));
    }
    if !c.motions.is_empty() {
        pairs.push(("motions", Value::Array(c.motions.iter().map(motion).collect())));
    }
    pairs.push(("automatic", json!(c.automatic)));
    object(pairs)
}

fn light(l: &Light) -> Value {
    match *l {
        Light::Directional { direction, colour, angle, shadows } => json!({
            "type": "directional", "direction": vector(direction), "colour": vector(colour),
            "angle_degrees": tidy(angle.to_degrees()), "shadows": shadows,
        }),
        Light::Point { position, colour, radius, shadows } => json!({
            "type": "point", "position": vector(position), "colour": vector(colour),
            "radius": tidy(radius), "shadows": shadows,
        }),
        Light::Ambient { colour } => json!({ "type": "ambient", "colour": vector(colour) }),
    }
}

fn scene_object(o: &Object) -> Value {
    let mut pairs = vec![
        ("name", json!(o.name)),
        ("path", json!(o.source.path.to_string_lossy())),
        ("radius_scale", json!(o.source.options.radius_scale)),
        ("blur", json!(o.blur)),
        ("receive_shadows", json!(o.receive_shadows)),
        ("shadow_catcher", json!(o.shadow_catcher)),
        ("cast_shadows", json!(o.cast_shadows)),
        ("epsilon", o.epsilon.map_or_else(|| json!("tolerance"), |e| json!(e))),
        ("detail", json!(o.detail.word())),
        ("transform", trs(&o.transform)),
        ("place", trs(&o.place)),
    ];
    if let Some(surface) = o.shape.surface() {
        pairs.push(("two_sided", json!(surface.two_sided)));
    }
    match &o.shape {
        Shape::Surfels { model: surfels, points, .. } => {
            if !surfels.paths().is_empty() {
                pairs.push(("points_at", points.at.map_or_else(|| json!("each frame"), |at| json!(at))));
            }
            pairs.push(("model", model(surfels.surfels())));
            pairs.push(("tolerance", single(o.shape.tolerance())));
        }
        Shape::Gaussians { model, .. } => pairs.push(("model", capture(model.gaussians()))),
        Shape::Volume { model, .. } => pairs.push(("model", volume(model.gaussians(), None))),
        Shape::Sequence { files, .. } => {
            let spec = files.spec();
            let frames = [spec.first, spec.last].map(|number| tidy(spec.frame_of(number)));
            pairs.push(("files", json!({ "first": spec.first, "last": spec.last, "frames": frames })));
        }
        Shape::Sphere { .. } => pairs.push(("model", model(&Surfels::default()))),
    }
    if let Some(space) = o.source.options.colour_space {
        pairs.push(("colour_space", json!(format!("{space:?}").to_lowercase())));
    }
    if let Some(animation) = &o.animation {
        pairs.push(("animation", binding(animation)));
    }
    if let Some(node) = &o.source.options.node {
        pairs.push(("node", json!(node)));
    }
    if !o.motions.is_empty() {
        pairs.push(("motions", Value::Array(o.motions.iter().map(motion).collect())));
    }
    if o.opacity != 1.0 {
        pairs.push(("opacity", json!(o.opacity)));
    }
    if let Some(surface) = o.shape.surface().filter(|surface| surface.reflection != 0.0) {
        pairs.push(("reflection", json!(surface.reflection)));
    }
    if let Some(m) = o.shape.material() {
        pairs.push(("material", material(&m)));
    }
    object(pairs)
}

fn material(m: &Material) -> Value {
    json!({
        "ambient": single(m.ambient), "diffuse": single(m.diffuse),
        "specular": single(m.specular), "shininess": single(m.shininess),
    })
}

fn motion(m: &Motion) -> Value {
    match *m {
        Motion::Linear { velocity } => json!({ "type": "linear", "velocity": vector(velocity) }),
        Motion::Rotation { axis, per_frame, centre } => json!({
            "type": "rotation", "axis": vector(axis), "degrees_per_frame": tidy(per_frame.to_degrees()),
            "centre": vector(centre),
        }),
    }
}

fn binding(b: &AnimationBinding) -> Value {
    let (first, last) = b.node.range();
    let mut pairs = vec![
        ("path", json!(b.path.to_string_lossy())),
        ("first_second", json!(tidy(first))),
        ("last_second", json!(tidy(last))),
    ];
    match &b.node {
        NodeMotion::Curves(node) => pairs.extend([
            ("node", json!(node.name)),
            ("interpolation", json!(format!("{:?}", b.interpolation).to_lowercase())),
        ]),
        NodeMotion::Chain(chain) => {
            pairs.extend([
                ("node", json!(chain.label)),
                ("fps", json!(tidy(chain.fps))),
                ("loop", json!(chain.looped)),
            ]);
        }
        NodeMotion::Path(path) => {
            let timing = path.timing();
            pairs.extend([
                ("keys", json!(path.keys().len())),
                ("speed", json!(if timing.constant_speed { "constant" } else { "keys" })),
                ("ease_in_frames", json!(timing.ease_in)),
                ("ease_out_frames", json!(timing.ease_out)),
                ("at_object", json!(path.target.as_ref().map(|target| &target.object))),
            ]);
        }
        NodeMotion::Track(track) => {
            pairs.extend([("format", json!(track.options.format.word())), ("poses", json!(track.poses()))]);
        }
    }
    object(pairs)
}

fn trs(t: &Trs) -> Value {
    if *t == Trs::default() {
        return json!("none");
    }
    let m = t.matrix();
    json!({ "matrix_rows": (0..3).map(|r| m.row(r).to_array().map(tidy)).collect::<Vec<_>>() })
}

/// A model file.
pub(super) fn model_file(loaded: &LoadedModel) -> Value {
    let inside = match &loaded.shape {
        LoadedShape::Surfels(surfels, _) => model(surfels),
        LoadedShape::Capture(gaussians) => capture(gaussians),
        LoadedShape::Volume(gaussians, facts) => volume(gaussians, Some(facts)),
    };
    let mut pairs = vec![("kind", json!("model")), ("model", inside)];
    if let Some(mesh) = loaded.mesh() {
        let spacing = tidy(mesh.spacing());
        pairs.push(("mesh", json!({ "triangles": mesh.triangles(), "spacing": spacing })));
    }
    pairs.push(("notes", json!(loaded.notes)));
    object(pairs)
}

/// Files of laser scanners, by their names and headers.
#[cfg(feature = "formats")]
pub(super) fn scans(names: &[PathBuf], files: &[ScanFacts]) -> Value {
    let place = vector;
    let of = |file: &ScanFacts| {
        let mut pairs = vec![("format", json!(file.format)), ("points", json!(file.points))];
        if let Some(Bounds { min, max }) = file.bounds {
            pairs.push(("bounds", json!({ "min": place(min), "max": place(max) })));
        }
        pairs.push(("columns", json!(file.columns)));
        pairs.extend(file.system.as_ref().map(|system| ("system", json!(system))));
        pairs.push(("writer", json!(file.writer)));
        if !file.scans.is_empty() {
            let scan =
                |scan: &Scan| json!({ "name": scan.name, "points": scan.points, "scanner": scan.station.map(place) });
            pairs.push(("scans", Value::Array(file.scans.iter().map(scan).collect())));
        }
        object(pairs)
    };
    let mut pairs = vec![("kind", json!("scan"))];
    match files {
        [one] => pairs.push(("scan", of(one))),
        several => {
            pairs.push(("points", json!(several.iter().map(|file| file.points).sum::<u64>())));
            let named = names.iter().zip(several).map(|(name, file)| {
                let mut facts = of(file);
                facts["path"] = json!(name.to_string_lossy());
                facts
            });
            pairs.push(("files", Value::Array(named.collect())));
        }
    }
    object(pairs)
}

/// A glTF file with triangles.
pub(super) fn mesh(m: &Mesh, nodes: &Nodes) -> Value {
    let used = m.triangles.iter().flat_map(|triangle| triangle.corners);
    let Bounds { min, max } = used.map(|corner| m.position[corner as usize]).collect();
    let named = |name: &String| if name.is_empty() { Value::Null } else { json!(name) };
    let size = |t: &Texture| json!({ "width": t.size[0], "height": t.size[1] });
    let entry = |(index, node): (usize, &NodeEntry)| {
        object(vec![
            ("name", named(&node.name)),
            ("index", json!(index)),
            (
                "mesh",
                node.mesh.map_or(Value::Null, |mesh| match node.mesh_name.as_str() {
                    "" => json!(format!("#{mesh}")),
                    name => json!(name),
                }),
            ),
            ("parent", json!(node.parent)),
            ("triangles", json!(node.triangles)),
            ("animated", json!(node.animated)),
        ])
    };
    let clip = |clip: &AnimationEntry| {
        let (seconds, channels) = (tidy(clip.seconds), clip.channels);
        json!({ "name": named(&clip.name), "seconds": seconds, "channels": channels })
    };
    let inside = object(vec![
        ("triangles", json!(m.triangles.len())),
        ("vertices", json!(m.position.len())),
        ("materials", json!(m.materials.iter().map(|material| &material.name).collect::<Vec<_>>())),
        ("textures", Value::Array(m.textures.iter().map(size).collect())),
        ("bounds", json!({ "min": vector(min), "max": vector(max) })),
    ]);
    object(vec![
        ("kind", json!("model")),
        ("model", inside),
        ("nodes", Value::Array(nodes.nodes.iter().enumerate().map(entry).collect())),
        ("animations", Value::Array(nodes.animations.iter().map(clip).collect())),
        ("notes", json!(m.notes)),
    ])
}

/// Kernels of a volume, and what they were made of where that is known.
fn volume(g: &Gaussians, facts: Option<&VolumeFacts>) -> Value {
    let model = GaussianModel::from(g.clone());
    let Bounds { min, max } = model.bounds();
    let mut pairs = vec![("kernels", json!(g.len()))];
    if let Some(facts) = facts {
        let [least, greatest] = facts.range.map(single);
        pairs.push(("samples", json!(facts.samples)));
        match facts.sizes {
            Some(sizes) => pairs.extend([("size", json!(sizes)), ("spacing", json!(facts.spacings.map(tidy)))]),
            None => pairs.push(("median_radius", json!(tidy(facts.spacings[0])))),
        }
        pairs.extend([("type", json!(facts.storage)), ("values", json!({ "min": least, "max": greatest }))]);
    }
    pairs.push(("lit", json!(!g.normal.is_empty())));
    if let Optics::Extinction { layer } = g.optics {
        pairs.push(("layer", single(layer)));
    }
    pairs.push(("bounds", json!({ "min": vector(min), "max": vector(max) })));
    object(pairs)
}

fn capture(g: &Gaussians) -> Value {
    if g.optics != Optics::Alpha {
        return volume(g, None);
    }
    let model = GaussianModel::from(g.clone());
    let turned = g.turned.map(|turn| format!("; those of the file were turned by {turn}"));
    let box_of = |Bounds { min, max }: Bounds| json!({ "min": vector(min), "max": vector(max) });
    object(vec![
        ("gaussians", json!(g.len())),
        ("harmonics", json!(format!("degrees 0 to {}", g.degree))),
        ("colours", json!(if g.linear { "linear light" } else { "sRGB-encoded" })),
        ("axes", json!(format!("x right, y down, z forward{}", turned.as_deref().unwrap_or_default()))),
        ("antialiased", json!(g.antialiased)),
        ("bounds", box_of(model.bounds())),
        ("core", box_of(model.core())),
        ("radius", json!({ "median": single(model.median_radius()) })),
    ])
}

fn model(s: &Surfels) -> Value {
    let Bounds { min, max } = s.bounds();
    let radii: Vec<f32> = (0..s.len()).map(|i| s.radius(i)).collect();
    let elliptical = (0..s.len()).any(|i| {
        let (u, v) = (s.axis_u[i].length(), s.axis_v[i].length());
        (u - v).abs() > 1e-4 * u.max(v)
    });
    let mut properties = vec!["position", "normal", "colour", if elliptical { "two radii" } else { "radius" }];
    if s.spheres {
        // Their normals, and their sides, mean nothing.
        properties.remove(1);
    }
    properties.extend((!s.opacity.is_empty()).then_some("opacity"));
    properties.extend((!s.material.is_empty()).then_some("material"));
    properties.extend((!s.velocity.is_empty()).then_some("velocity"));
    properties.extend((!s.acceleration.is_empty()).then_some("acceleration"));
    properties.extend(s.levels.is_some().then_some("levels of detail"));
    let sides = match (s.two_sided, s.signs_estimated) {
        (false, false) => "fronts show",
        (false, true) => "fronts show (normals estimated, closed)",
        (true, true) => "both show (normals estimated, open or unclear)",
        (true, false) => "both show",
    };
    let what = if s.spheres { "spheres" } else { "surfels" };
    let mut pairs = vec![(what, json!(s.len())), ("properties", json!(properties))];
    pairs.extend((!s.spheres).then(|| ("sides", json!(sides))));
    if !s.paths().is_empty() {
        let unit = match s.velocity_unit {
            VelocityUnit::Second => "second",
            VelocityUnit::Frame => "frame",
        };
        let fastest = s.velocity.iter().map(|v| v.length()).fold(0.0, f32::max);
        pairs.push(("velocity", json!({ "unit": unit, "max": single(fastest) })));
    }
    if !s.is_empty() {
        let least = radii.iter().copied().fold(f32::INFINITY, f32::min);
        let greatest = radii.iter().copied().fold(0.0, f32::max);
        pairs.push(("bounds", json!({ "min": vector(min), "max": vector(max) })));
        pairs.push((
            "radius",
            json!({ "min": single(least), "median": single(s.median_radius()), "max": single(greatest) }),
        ));
    }
    object(pairs)
}

/// An animation file.
pub(super) fn animation(a: &Animation) -> Value {
    let (first, last) = frame_range(a);
    object(vec![
        ("kind", json!("animation")),
        ("rate", json!(a.rate)),
        ("first_frame", json!(tidy(first))),
        ("last_frame", json!(tidy(last))),
        ("nodes", Value::Array(a.nodes.iter().map(|n| node(n, a.rate)).collect())),
        ("notes", json!(a.notes)),
    ])
}

fn node(n: &NodeAnimation, rate: f64) -> Value {
    let (first, last) = n.range();
    object(vec![
        ("name", json!(n.name)),
        ("attributes", json!(n.attributes().collect::<Vec<_>>())),
        ("first_frame", json!(tidy(first * rate))),
        ("last_frame", json!(tidy(last * rate))),
    ])
}

/// First and last frame of all nodes, in file time units; 0..0 without nodes.
pub(super) fn frame_range(a: &Animation) -> (f64, f64) {
    let ranges = a.nodes.iter().map(|n| n.range());
    ranges
        .reduce(|x, y| (x.0.min(y.0), x.1.max(y.1)))
        .map_or((0.0, 0.0), |(first, last)| (first * a.rate, last * a.rate))
}

/// An image file and the settings that it carries.
pub(super) fn image(picture: &Picture, settings: Option<String>) -> Value {
    let layers: Vec<_> = picture.layers.iter().map(|layer| layer.aov.name()).collect();
    // Ours are JSON; what another program wrote under our name is shown as it is.
    let settings = settings.map(|text| serde_json::from_str(&text).unwrap_or(Value::String(text)));
    object(vec![
        ("kind", json!("image")),
        ("width", json!(picture.width)),
        ("height", json!(picture.height)),
        ("layers", json!(layers)),
        ("settings", settings.unwrap_or(Value::Null)),
    ])
}

/// A report for a person.
pub(super) fn text(report: &Value) -> String {
    let mut lines = Vec::new();
    members(report, 0, &mut lines);
    lines.join("\n") + "\n"
}

/// Keys that come first in text, in this order; all others follow by name.
const ORDER: [&str; 35] = [
    "kind",
    "name",
    "index",
    "mesh",
    "parent",
    "type",
    "surfels",
    "gaussians",
    "kernels",
    "size",
    "spacing",
    "width",
    "height",
    "background",
    "frames",
    "shutter",
    "camera",
    "lights",
    "environment",
    "objects",
    "path",
    "node",
    "nodes",
    "first",
    "last",
    "first_frame",
    "last_frame",
    "eye",
    "at",
    "up",
    "min",
    "median",
    "max",
    "open",
    "properties",
];

/// The members of an object in the order of the text.
fn ordered(map: &Map<String, Value>) -> Vec<(&String, &Value)> {
    let mut list: Vec<_> = map.iter().collect();
    let rank = |key: &str| ORDER.iter().position(|known| *known == key).unwrap_or(ORDER.len());
    // Stable: the map is sorted by name.
    list.sort_by_key(|(key, _)| rank(key));
    list
}

fn members(value: &Value, level: usize, lines: &mut Vec<String>) {
    let Value::Object(map) = value else { return };
    for (key, member) in ordered(map) {
        entry(&key.replace('_', " "), member, level, lines);
    }
}

fn entry(key: &str, value: &Value, level: usize, lines: &mut Vec<String>) {
    let indent = "  ".repeat(level);
    match value {
        Value::Object(map) if map.values().all(is_short) && map.len() <= if key == "node" { 6 } else { 4 } => {
            let parts: Vec<_> =
                ordered(map).into_iter().map(|(k, v)| format!("{} {}", k.replace('_', " "), short(v))).collect();
            lines.push(format!("{indent}{key}: {}", parts.join(", ")));
        }
        Value::Object(_) => {
            lines.push(format!("{indent}{key}:"));
            members(value, level + 1, lines);
        }
        Value::Array(list) if !list.iter().all(is_scalar) => {
            for item in list {
                entry(key.strip_suffix('s').unwrap_or(key), item, level, lines);
            }
        }
        Value::Array(list) if key == "notes" => {
            lines.extend(list.iter().map(|note| format!("{indent}note: {}", short(note))));
        }
        _ => lines.push(format!("{indent}{key}: {}", short(value))),
    }
}

fn is_scalar(value: &Value) -> bool {
    !matches!(value, Value::Object(_) | Value::Array(_))
}

fn is_short(value: &Value) -> bool {
    is_scalar(value) || value.as_array().is_some_and(|list| list.len() <= 4 && list.iter().all(is_scalar))
}

fn short(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::Bool(yes) => (if *yes { "yes" } else { "no" }).to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(list) if list.is_empty() => "none".to_owned(),
        Value::Array(list) => {
            let words = list.iter().any(Value::is_string);
            list.iter().map(short).collect::<Vec<_>>().join(if words { ", " } else { " " })
        }
        // 5, not 5.0.
        Value::Number(number) => {
            number.as_f64().filter(|_| number.is_f64()).map_or(number.to_string(), |v| v.to_string())
        }
        Value::Object(_) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn square() -> Surfels {
        Surfels {
            origin: DVec3::new(10.0, 0.0, 0.0),
            position: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            axis_u: vec![Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0],
            axis_v: vec![Vec3::Y, Vec3::Y * 2.0, Vec3::Y * 3.0],
            normal: vec![Vec3::Z; 3],
            colour: vec![Vec3::ONE; 3],
            ..Surfels::default()
        }
    }

    #[test]
    fn a_model_is_counted_and_measured() {
        let of = |surfels, notes| LoadedModel { shape: LoadedShape::Surfels(surfels, None), notes, colour_range: None };
        let report = model_file(&of(square(), vec!["normals estimated".to_owned()]));
        assert_eq!(report["model"]["surfels"], 3);
        assert_eq!(report["model"]["radius"], json!({ "min": 1.0, "median": 2.0, "max": 3.0 }));
        assert_eq!(report["model"]["bounds"], json!({ "min": [10.0, 0.0, 0.0], "max": [11.0, 1.0, 0.0] }));
        let text = text(&report);
        assert!(text.starts_with("kind: model\n"), "{text}");
        assert!(text.contains("  surfels: 3\n"), "{text}");
        assert!(text.contains("  properties: position, normal, colour, radius\n"), "{text}");
        assert!(text.contains("  sides: fronts show\n"), "{text}");
        assert!(text.contains("  bounds: min 10 0 0, max 11 1 0\n"), "{text}");
        assert!(text.ends_with("note: normals estimated\n"), "{text}");
        assert_eq!(model_file(&of(Surfels::default(), Vec::new()))["model"]["surfels"], 0);
    }

    #[test]
    fn degrees_are_tidy() {
        assert_eq!(tidy(7.7_f64.to_radians().to_degrees()), 7.7);
        assert_eq!(single(0.1), json!(0.1));
        assert_eq!(tidy(0.0), 0.0);
        assert_eq!(tidy(-1.25), -1.25);
    }
}
