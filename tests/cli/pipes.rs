//! Nothing waits for the other end of a pipe, whatever names it.
//!
//! The options that name paths are those of clap, as the completions for zsh list them: a new one is tried, too.
//! Attributes of scenes are tried beside their schema (`src/scene_file/tests.rs`).

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Whatever ends by itself has ended by then, on a busy machine too.
const SOON: Duration = Duration::from_secs(20);

const SCENE: &str = r#"<scene><image width="16" height="12"/><frames first="0" last="0"/>
<camera eye="0 0 4" at="0 0 0"/><object><sphere/></object></scene>"#;

fn pipe(dir: &Path, name: &str) {
    assert!(Command::new("mkfifo").arg(dir.join(name)).status().unwrap().success());
}

/// Runs the program with these words. Exit status and stderr; it is killed, and nothing, where it waits.
fn ended(dir: &Path, words: &[String]) -> Option<(i32, String)> {
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    let program = program.current_dir(dir).args(words).stdin(Stdio::null()).stdout(Stdio::null());
    let mut child = program.stderr(Stdio::piped()).spawn().unwrap();
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            let mut said = String::new();
            child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
            return Some((status.code().unwrap_or_else(|| panic!("{words:?}: {status}")), said));
        }
        if begin.elapsed() > SOON {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// An argument that names a path: its command, and its words before the path (an option), or none (by its place).
struct Named {
    command: String,
    option: Option<String>,
    /// Its name for people, as `FILE` or `scene`.
    name: String,
}

/// All of them, by the completions for zsh: `'--out=[...]:DIR:_files'` and `':scene -- ...:_files'`.
fn all_named(dir: &Path) -> Vec<Named> {
    let output =
        Command::new(env!("CARGO_BIN_EXE_splatblur")).current_dir(dir).args(["completions", "zsh"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let (mut command, mut named) = (String::new(), Vec::new());
    for line in text.lines().map(str::trim_start).take_while(|line| !line.starts_with("(( $+functions")) {
        if let Some(name) = line.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')) {
            name.clone_into(&mut command);
        }
        let is_path = line.contains(":_files'");
        let value = line.rsplit(':').nth(1).unwrap_or_default().to_owned();
        // An option whose value is called so, and which clap does not know as a path, would be forgotten here.
        let called = line.starts_with("'-") && ["FILE", "DIR", "PATH"].iter().any(|word| value.starts_with(word));
        assert!(is_path || !called, "{command}: {line}");
        if is_path {
            let line = line.trim_start_matches('\'').trim_start_matches('*');
            let option = line.starts_with("--").then(|| line.split(['=', '[']).next().unwrap().to_owned());
            let place = line.trim_start_matches(':').split(' ').next().unwrap_or_default();
            let name = if option.is_some() { value } else { place.to_owned() };
            named.push(Named { command: command.clone(), option, name });
        }
    }
    named
}

/// A line of each command that is right but for the argument that is replaced: its words by name.
fn line(command: &str) -> Vec<(&'static str, &'static str)> {
    match command {
        "render" | "view" | "reference" | "dataset" | "info" => vec![("scene", "scene.xml")],
        "sheet" => vec![("scene", "scene.xml"), ("--modes", "still"), ("--out", "sheet.png")],
        "report" => vec![("scene", "scene.xml"), ("--modes", "still"), ("--out", "report")],
        "compare" => vec![("a", "a.png"), ("b", "b.png")],
        "wipe" => vec![("a", "a.png"), ("b", "b.png"), ("--out", "wipe.gif")],
        "thesis" => vec![("--out", "thesis")],
        "convert" => vec![("inputs", "three.xyz"), ("output", "other.ply")],
        "sample" => vec![("input", "square.obj"), ("output", "other.ply")],
        "generate" => vec![("model", "ball"), ("output", "other.ply")],
        "man" => vec![("--out", "man")],
        other => panic!("tell a line of `{other}`, which names paths"),
    }
}

#[test]
fn no_option_waits_for_a_pipe() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(dir.join("scene.xml"), SCENE).unwrap();
    std::fs::write(dir.join("three.xyz"), "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    std::fs::write(dir.join("square.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    for name in ["a.png", "b.png"] {
        image::RgbImage::new(4, 4).save(dir.join(name)).unwrap();
    }
    // A name with the ending that an argument must have.
    for name in ["pipe", "pipe.png", "pipe.ply", "pipe.gif"] {
        pipe(dir, name);
    }
    let named = all_named(dir);
    assert!(named.len() > 30, "{}", named.len());
    for Named { command, option, name } in &named {
        let wanted = match (name.as_str(), option.as_deref()) {
            ("output", _) => "pipe.ply",
            (_, Some("--movie")) => "pipe.gif",
            ("FILE.png", _) => "pipe.png",
            _ => "pipe",
        };
        let mut words = vec![command.clone()];
        if command == "thesis" {
            words.insert(0, "study".to_owned());
        }
        let argument = option.as_deref().unwrap_or(name);
        let argument = if argument == "file" { "scene" } else { argument };
        let mut found = false;
        let mut line = line(command);
        // A replayed dataset says itself which scene it is of.
        line.retain(|(known, _)| argument != "--replay" || *known != "scene");
        for (known, value) in line {
            found |= known == argument;
            let value = if known == argument { wanted } else { value };
            words.extend(known.starts_with("--").then(|| known.to_owned()));
            words.push(value.to_owned());
        }
        if !found {
            words.extend([argument.to_owned(), wanted.to_owned()]);
        }
        let (code, said) = ended(dir, &words).unwrap_or_else(|| panic!("{words:?} waits"));
        assert!(
            code == 2 && said.starts_with("error: ") && said.matches('\n').count() == 1,
            "{words:?}: {code} {said}"
        );
        let kind = std::os::unix::fs::FileTypeExt::is_fifo(&dir.join(wanted).symlink_metadata().unwrap().file_type());
        assert!(kind, "{words:?}: the pipe was replaced");
    }
}

/// What files name that the command line names. The pictures of a model are left out where they cannot be read, and
/// the hash of the inputs leaves them out, too.
#[test]
fn no_file_that_a_file_names_waits_for_a_pipe() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    pipe(dir, "pipe");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    std::fs::write(dir.join("library.obj"), format!("mtllib pipe\n{corners}f 1 2 3\n")).unwrap();
    std::fs::write(dir.join("paint.mtl"), "newmtl paint\nmap_Kd pipe\n").unwrap();
    let painted = format!("mtllib paint.mtl\nusemtl paint\n{corners}vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    std::fs::write(dir.join("painted.obj"), painted).unwrap();
    let gltf = |buffer: &str| {
        format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0}}],\
             \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"TEXCOORD_0\":1}},\"material\":0}}]}}],\
             \"materials\":[{{\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":0}}}}}}],\
             \"textures\":[{{\"source\":0}}],\"images\":[{{\"uri\":\"pipe\"}}],\
             \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}},\
             {{\"bufferView\":1,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"}}],\
             \"bufferViews\":[{{\"buffer\":0,\"byteLength\":36}},{{\"buffer\":0,\"byteOffset\":36,\"byteLength\":24}}],\
             \"buffers\":[{{\"uri\":\"{buffer}\",\"byteLength\":60}}]}}"
        )
    };
    let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    std::fs::write(dir.join("data"), numbers.map(f32::to_le_bytes).as_flattened()).unwrap();
    std::fs::write(dir.join("painted.gltf"), gltf("data")).unwrap();
    std::fs::write(dir.join("buffer.gltf"), gltf("pipe")).unwrap();
    let render = |model: &str| {
        let model = format!("<pointModel spacing=\"0.2\">{model}</pointModel>");
        std::fs::write(dir.join("model.xml"), SCENE.replace("<sphere/>", &model)).unwrap();
        let words = "render model.xml --backend cpu --mode still --out out --quiet";
        let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        ended(dir, &words).unwrap_or_else(|| panic!("{model} waits"))
    };
    for model in ["library.obj", "painted.obj", "painted.gltf"] {
        assert_eq!(render(model).0, 0, "{model}: {}", render(model).1);
    }
    let (code, said) = render("buffer.gltf");
    assert!(code == 2 && said.contains("`pipe` which is a pipe, expected a regular file"), "{said}");
    assert_eq!(said.matches('\n').count(), 1, "{said}");
    // Files that are there already where a run writes.
    std::fs::write(dir.join("three.xyz"), "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    let scene = SCENE.replace("<sphere/>", "<pointModel>three.xyz</pointModel>");
    std::fs::write(dir.join("scene.xml"), scene).unwrap();
    std::fs::create_dir_all(dir.join("truth")).unwrap();
    pipe(dir, "truth/transforms.json");
    let words = "dataset scene.xml --out truth --backend cpu --mode supersample:1 --sharp 1 --quiet --resume";
    let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
    let (code, said) = ended(dir, &words).expect("a dataset waits");
    assert!(code == 2 && said.contains("is a pipe"), "{code} {said}");
}

/// The input of the program is a path, too.
#[test]
fn the_standard_input_is_a_file_or_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("three.xyz"), "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    let info = |input: Stdio| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
        let output = program.args(["info", "/dev/stdin", "--json"]).stdin(input).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let file = std::fs::File::open(dir.path().join("three.xyz")).unwrap();
    assert_eq!(info(file.into()).0, Some(0));
    let (_writer, reader) = {
        let mut child = Command::new("sleep").arg("5").stdout(Stdio::piped()).spawn().unwrap();
        let reader = child.stdout.take().unwrap();
        (Killed(child), reader)
    };
    let (code, said) = info(reader.into());
    assert_eq!(code, Some(2));
    assert_eq!(said, "error: cannot read /dev/stdin: it is a pipe, expected a regular file\n");
}

/// A process that ends with the test.
struct Killed(std::process::Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
