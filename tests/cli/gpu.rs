//! The program where there is a GPU, and where there is none.

#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::process::{Command, Output, Stdio};

use splatblur::image;

use crate::support::gpu::gpu_or_skip;

fn splatblur(arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_splatblur"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .envs(environment.iter().copied())
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

const SMALL: [&str; 8] = ["render", "scenes/spin.xml", "--size", "64x36", "--samples", "2", "--frames", "1..2"];

/// A computer without any graphics driver.
const NOTHING: [(&str, &str); 2] = [("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];

#[test]
fn without_an_adapter_nothing_panics() {
    let dir = tempfile::tempdir().unwrap();
    let out = ["--out", dir.path().to_str().unwrap()];
    let run = |backend: &[&str]| splatblur(&[&SMALL, &out[..], backend].concat(), &NOTHING);
    let refused = run(&["--backend", "gpu"]);
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("no graphics adapter") && said.contains("mesa-vulkan-drivers"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");

    let automatic = run(&["--backend", "auto"]);
    assert!(automatic.status.success());
    let said = text(&automatic.stderr);
    assert!(said.contains("on the CPU (") && said.contains("no hardware GPU"), "{said}");

    let listed = splatblur(&["info", "--adapters"], &NOTHING);
    assert!(listed.status.success());
    assert!(text(&listed.stdout).starts_with("No graphics adapters."), "{}", text(&listed.stdout));
}

// Not deep: the only test of the program with a GPU.
#[test]
fn the_command_line_renders_on_the_gpu() {
    let Some(gpu) = gpu_or_skip("the_command_line_renders_on_the_gpu") else { return };
    let dir = tempfile::tempdir().unwrap();
    let out = ["--out", dir.path().to_str().unwrap(), "--backend", "gpu"];
    let first = splatblur(&[&SMALL, &out[..]].concat(), &[]);
    let said = text(&first.stderr);
    assert!(first.status.success(), "{said}");
    assert!(said.contains(&format!("on the GPU {}", gpu.adapter())), "{said}");
    let settings = image::read_settings(&dir.path().join("spin.0002.png")).unwrap();
    assert!(settings.contains(r#""backend":"gpu""#), "{settings}");

    // Files of the same backend are skipped, those of the other are not.
    let again = splatblur(&[&SMALL, &out[..], &["--resume", "--json"]].concat(), &[]);
    assert_eq!(text(&again.stdout).matches("\"skipped\": true").count(), 2, "{}", text(&again.stdout));
    let other = splatblur(&[&SMALL, &out[..2], &["--backend", "cpu", "--resume", "--json"]].concat(), &[]);
    assert_eq!(text(&other.stdout).matches("\"skipped\": true").count(), 0, "{}", text(&other.stdout));

    let unknown = splatblur(&[&SMALL, &out[..], &["--adapter", "nonsense"]].concat(), &[]);
    let said = text(&unknown.stderr);
    assert_eq!(unknown.status.code(), Some(2), "{said}");
    assert!(said.contains("`nonsense`") && said.contains(gpu.adapter()), "{said}");
    let named = splatblur(&[&SMALL, &out[..], &["--adapter", &gpu.adapter().to_uppercase()]].concat(), &[]);
    assert!(named.status.success(), "{}", text(&named.stderr));

    let listed = splatblur(&["info", "--adapters", "--json"], &[]);
    assert!(text(&listed.stdout).contains(gpu.adapter()), "{}", text(&listed.stdout));
}
