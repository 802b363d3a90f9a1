//! Every shader is part of a program.

use std::fs;
use std::path::Path;

use crate::text::walk;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A file that no program names is dead, and yet it looks as if it did something.
#[test]
fn programs_have_every_shader() {
    let programs = fs::read_to_string(root().join("src/backend/gpu/texts.rs")).unwrap();
    let shaders = root().join("shaders");
    let mut files = Vec::new();
    walk(&shaders, &mut files);
    assert!(files.len() > 30, "{}", files.len());
    for file in files {
        let name = file.strip_prefix(&shaders).unwrap().to_string_lossy().replace('\\', "/");
        assert!(programs.contains(&format!("\"{name}\"")), "shaders/{name} is in no program");
    }
}
