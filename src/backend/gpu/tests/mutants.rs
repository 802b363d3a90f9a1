//! A comparison is worth something only if it rejects a broken program.

use super::cases;
use super::gpu_or_skip;
use super::parity;
use crate::backend::gpu::programs::{Pipelines, Program};

/// Text of a program, what replaces it, and a case that must notice.
const MUTANTS: [(&str, &str, &str); 21] = [
    ("vec2<f32>(x, y) - view.offset", "vec2<f32>(x, y) + view.offset", "supersample"),
    ("uy * v.z - u.z * vy", "uy * v.z + u.z * vy", "supersample"),
    ("area * depth * segment.handedness", "area * depth", "plain"),
    ("low_pass = select(0.0, view.low_pass", "low_pass = select(0.0, 0.0 * view.low_pass", "supersample"),
    ("area * segment.handedness < 0.0", "area * segment.handedness > 0.0", "supersample"),
    ("view.axis - view.offset", "view.axis", "hard"),
    ("sorted_keys[middle] < id.x", "sorted_keys[middle] <= id.x", "supersample"),
    ("(sorted_keys[first + i] >> SHIFT)", "(sorted_keys[first + i] >> 1u)", "hard"),
    ("at.y += 1u", "at.y += 0u", "hard"),
    ("depth + epsilon, covers", "depth, covers", "supersample"),
    ("max(vec4<f32>(segments[", "min(vec4<f32>(segments[", "supersample"),
    ("column + 3u >= bounds.x", "column >= bounds.x", "supersample"),
    ("(depth <= limit)", "(depth <= limit + 1.0)", "supersample"),
    ("0.0005294794", "0.0005394794", "supersample"),
    ("weight = unshared * share", "weight = unshared", "bucket"),
    ("normal = -normal", "normal = normal", "supersample"),
    ("(rate.x - p.x * over * rate.z)", "(rate.x - p.x * over)", "supersample"),
    ("2.0 * nl * nv - lv", "2.0 * nl * nv + lv", "supersample"),
    ("threshold < NONE", "threshold <= NONE", "supersample"),
    ("* min((*sum).reach, vec4<f32>(1.0))", "* (*sum).reach", "bucket"),
    ("view.last_weight * min(reach, 1.0)", "view.last_weight", "bucket"),
];

#[test]
fn broken_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_programs_are_noticed") else { return };
    let cases = cases::all();
    for (from, to, name) in MUTANTS {
        assert!(Program::ALL.iter().any(|program| program.wgsl().contains(from)), "no program holds `{from}`");
        let case = cases.iter().find(|case| case.name == name).unwrap();
        gpu.machine.pipelines = Pipelines::broken(from, to);
        match parity::check(&mut gpu, case) {
            Ok(()) => panic!("`{from}` became `{to}`, and nothing was noticed"),
            Err(what) => eprintln!("`{to}`: {}", what.chars().take(150).collect::<String>()),
        }
    }
}
