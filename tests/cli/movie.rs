//! Movies: `render --movie`, read back by other decoders, and what is left where it ends early.
//!
//! Tests of MP4 and MOV are left out, and say so, where there is no ffmpeg; with `REQUIRE_FFMPEG` that is a failure.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use image::AnimationDecoder as _;
use splatblur::image as pictures;

/// A folder with a scene of 24 frames: a plate of many colours that moves, 31 x 17 pixels.
struct PlateFolder {
    dir: tempfile::TempDir,
}

const SIZE: (usize, usize) = (31, 17);

impl PlateFolder {
    fn new() -> Self {
        Self::with("<frames first=\"1\" last=\"24\"/>", "background=\"0.1 0.2 0.3\"")
    }

    /// Its plate fills the picture.
    fn with(frames: &str, image: &str) -> Self {
        Self::of_plate(0.5, frames, image)
    }

    fn of_plate(spacing: f64, frames: &str, image: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut plate = String::new();
        for (x, y) in (0..40).flat_map(|x| (0..40).map(move |y| (x, y))) {
            let (red, green) = (6 * x, 6 * y);
            writeln!(plate, "{} {} 0 {red} {green} 128", spacing * f64::from(x - 20), spacing * f64::from(y - 20))
                .unwrap();
        }
        std::fs::write(dir.path().join("plate.xyz"), plate).unwrap();
        let scene = format!(
            "<scene><image width=\"{}\" height=\"{}\" {image}/>{frames}<camera eye=\"0 0 6\" at=\"0 0 0\"/>\
             <light type=\"ambient\" intensity=\"1\"/><object name=\"plate\"><pointModel>plate.xyz</pointModel>\
             <material ambient=\"1\"/><motion type=\"linear\" velocity=\"0.1 0 0\"/></object></scene>",
            SIZE.0, SIZE.1
        );
        std::fs::write(dir.path().join("plate.xml"), scene).unwrap();
        Self { dir }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// `render plate.xml` on one thread, with few samples, with the words of a line.
    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
        command.current_dir(self.dir.path()).stdin(Stdio::null());
        command.args("render plate.xml --backend cpu --threads 1 --mode supersample:2 --two-sided".split(' '));
        command.args(line.split_whitespace());
        command
    }

    fn render(&self, line: &str) -> Output {
        let output = self.command(line).output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        output
    }

    /// Codes of the pictures, R G B.
    fn codes(&self) -> Vec<Vec<u8>> {
        let picture = |frame| pictures::read(&self.path(&format!("out/plate/plate.{frame:04}.png"))).unwrap();
        (1..=24).map(|frame| pictures::srgb_codes(&picture(frame), false).unwrap()).collect()
    }

    /// Names in a folder, hidden ones too.
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// The one line of a refusal.
fn refusal(output: &Output) -> String {
    let line = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{line}");
    assert_eq!(line.matches('\n').count(), 1, "{line:?}");
    line
}

/// Greatest distance of codes, and the mean.
fn distance(a: &[u8], b: &[u8]) -> (u8, f64) {
    assert_eq!(a.len(), b.len());
    let apart: Vec<u8> = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = apart.iter().map(|&d| f64::from(d)).sum::<f64>() / apart.len() as f64;
    (apart.into_iter().max().unwrap(), mean)
}

/// A reader of YUV4MPEG2 from its description: header, and frames as R G B.
fn read_y4m(bytes: &[u8]) -> (String, Vec<Vec<u8>>) {
    let end = bytes.iter().position(|&byte| byte == b'\n').unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let pixels = SIZE.0 * SIZE.1;
    let mut rest = &bytes[end + 1..];
    let mut frames = Vec::new();
    while !rest.is_empty() {
        let body = rest.strip_prefix(b"FRAME\n").expect("FRAME");
        let (frame, after) = body.split_at(3 * pixels);
        let at =
            |plane: usize, i: usize, offset: f64, span: f64| (f64::from(frame[plane * pixels + i]) - offset) / span;
        let rgb = |i| {
            // BT.709-6, the inverse of items 3.2 and 3.3.
            let (y, cb, cr) = (at(0, i, 16.0, 219.0), at(1, i, 128.0, 224.0), at(2, i, 128.0, 224.0));
            let (r, b) = (y + 1.5748 * cr, y + 1.8556 * cb);
            [r, (y - 0.2126 * r - 0.0722 * b) / 0.7152, b].map(|v| (255.0 * v).round().clamp(0.0, 255.0) as u8)
        };
        frames.push((0..pixels).flat_map(rgb).collect());
        rest = after;
    }
    (header, frames)
}

#[test]
fn y4m_has_count_rate_and_pixels() {
    let place = PlateFolder::with("<frames first=\"1\" last=\"24\" rate=\"29.97\"/>", "background=\"0.1 0.2 0.3\"");
    let output = place.render("--movie films/a.y4m");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.ends_with("movie: films/a.y4m, 30000/1001 frames a second\n"), "{said}");
    assert_eq!(place.names("films"), ["a.y4m"]);
    let (header, frames) = read_y4m(&std::fs::read(place.path("films/a.y4m")).unwrap());
    assert_eq!(header, "YUV4MPEG2 W31 H17 F30000:1001 Ip A1:1 C444 XCOLORRANGE=LIMITED");
    let codes = place.codes();
    assert_eq!(frames.len(), 24);
    assert!(codes.iter().any(|frame| frame != &codes[0]));
    for (frame, codes) in frames.iter().zip(&codes) {
        // A code of Y' or of Cb and Cr is rounded by half a step: 1.16 and up to 2.11 codes of a colour, each half.
        assert!(distance(frame, codes).0 <= 2, "{:?}", distance(frame, codes));
    }
}

#[test]
fn gif_has_count_rate_and_pixels() {
    let place = PlateFolder::new();
    // Larger: of few pixels the palette learns little.
    place.render("--movie a.gif --size 93x51");
    let file = std::io::BufReader::new(std::fs::File::open(place.path("a.gif")).unwrap());
    let decoder = image::codecs::gif::GifDecoder::new(file).unwrap();
    let frames = decoder.into_frames().collect_frames().unwrap();
    let codes = place.codes();
    assert_eq!(frames.len(), 24);
    let times: Vec<u32> = frames.iter().map(|frame| frame.delay().numer_denom_ms().0).collect();
    // A second, in steps of 40 or 50 ms.
    assert_eq!((times.iter().sum::<u32>(), times.iter().min(), times.iter().max()), (1000, Some(&40), Some(&50)));
    for (frame, codes) in frames.iter().zip(&codes) {
        let rgb: Vec<u8> = frame.buffer().pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        assert!(frame.buffer().pixels().all(|pixel| pixel[3] == 255));
        let colours: std::collections::BTreeSet<&[u8]> = codes.chunks(3).collect();
        let (most, mean) = distance(&rgb, codes);
        if colours.len() <= 256 {
            assert_eq!(most, 0);
        } else {
            // 256 colours for 3,900: at most 8 codes, 1.15 in the mean.
            assert!(most <= 12 && mean < 1.5, "{} colours, {most}, {mean}", colours.len());
        }
    }
}

/// A movie of pictures that are there already is the movie of pictures that are rendered, and so is one without.
#[test]
fn a_movie_is_the_same_with_pictures_of_an_earlier_run_and_without() {
    let place = PlateFolder::new();
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    place.render("--movie a.y4m");
    place.render("--movie b.y4m --no-frames --out none");
    assert!(!place.path("none").exists());
    for missing in [2, 13, 24] {
        std::fs::remove_file(place.path(&format!("out/plate/plate.{missing:04}.png"))).unwrap();
    }
    let said = String::from_utf8(place.render("--movie c.y4m --resume").stdout).unwrap();
    assert!(said.contains("24 images (21 were there already)"), "{said}");
    assert!(bytes("a.y4m") == bytes("b.y4m") && bytes("a.y4m") == bytes("c.y4m"));
    // Float pictures have more bits than the movie.
    place.render("--format exr --frames 1..4");
    place.render("--format exr --frames 1..4 --resume --movie d.y4m");
    let (_, frames) = read_y4m(&bytes("d.y4m"));
    assert_eq!(frames, read_y4m(&bytes("a.y4m")).1[..4]);
    let report = place.render("--frames 1..2 --no-frames --movie e.gif --json").stdout;
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!((&report["movie"], &report["ffmpeg"]), (&"e.gif".into(), &serde_json::Value::Null));
    assert_eq!(report["frames"][1]["path"], serde_json::Value::Null);
}

#[test]
fn mistakes_are_told_in_one_line_before_rendering() {
    let place = PlateFolder::new();
    for (line, why) in [
        ("--out a.mp4", "and a.mp4 names a movie: use `splatblur render --movie a.mp4`"),
        ("--out a.MOV", "names a movie"),
        ("--out films/a.y4m", "names a movie"),
        ("--out a.gif", "names a movie"),
        ("--movie a.avi", "expected a file .mp4 or .mov (they need ffmpeg), .y4m or .gif"),
        ("--no-frames", "--movie <FILE>"),
        ("--movie a.gif --no-frames --format exr --aov depth", "cannot be used with"),
        ("--movie a.gif --frames 3,1", "--movie needs --frames in ascending order"),
        ("--shutter 180", "`180` lacks a unit"),
        ("--shutter 0deg", "does not open"),
    ] {
        let said = refusal(&place.command(line).arg("--quiet").output().unwrap());
        assert!(said.contains(why), "{line}: {said}");
    }
    let said = refusal(&place.command("--movie a.mp4").env("PATH", place.path("none")).output().unwrap());
    assert!(said.contains("needs the program ffmpeg, which is not installed; .y4m and .gif need none"), "{said}");
    std::fs::create_dir(place.path("b.gif")).unwrap();
    let said = refusal(&place.command("--movie b.gif --no-frames --quiet").output().unwrap());
    assert!(said.contains("cannot write b.gif: it is a directory, expected a regular file or none"), "{said}");
    assert_eq!(place.names("."), ["b.gif", "plate.xml", "plate.xyz"]);
    let fast = PlateFolder::with("<frames first=\"1\" last=\"24\" rate=\"60\"/>", "");
    let said = refusal(&fast.command("--movie a.gif --no-frames --quiet").output().unwrap());
    assert!(said.contains("GIF has 0.01 to 50 frames a second, not 60"), "{said}");
    let mut model = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    model.current_dir(fast.dir.path()).args(["render", "plate.xyz", "--shutter", "1/48s"]);
    let said = refusal(&model.output().unwrap());
    assert!(said.contains("--shutter in seconds needs the frame rate of a scene"), "{said}");
}

/// Angles and times are shutters in frames.
#[test]
fn shutters_are_angles_and_times() {
    let place = PlateFolder::with("<frames first=\"1\" last=\"1\" rate=\"25\"/>", "");
    let shutter = |words: &str| {
        let report = place.render(&format!("--json {words}")).stdout;
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let ends = report["settings"]["shutter"].as_array().unwrap().clone();
        (ends[0].as_f64().unwrap(), ends[1].as_f64().unwrap())
    };
    assert_eq!(shutter("--shutter 180deg"), shutter("--shutter -0.25,0.25"));
    assert_eq!(shutter("--shutter 1/50s"), (-0.25, 0.25));
    assert_eq!(shutter("--shutter 0.08s"), (-1.0, 1.0));
}

/// Alpha is in MOV alone.
#[test]
fn transparent_scenes_lie_over_black() {
    let place = PlateFolder::of_plate(0.1, "<frames first=\"1\" last=\"24\"/>", "background=\"0 0 0\"");
    place.render("--movie opaque.y4m --no-frames");
    let output = place.render("--movie clear.y4m --no-frames --transparent");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("note: clear.y4m has no alpha: what is transparent is black; .mov has"), "{said}");
    let [opaque, clear] = ["opaque.y4m", "clear.y4m"].map(|name| std::fs::read(place.path(name)).unwrap());
    assert!(opaque == clear);
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < Duration::from_mins(1), "{what} did not happen");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// An ffmpeg that writes its process number, and what it reads into its output. With `STAYS` it does not end when there
/// are no more frames.
fn slow_ffmpeg(place: &PlateFolder) -> PathBuf {
    let tools = place.path("tools");
    let script = "#!/bin/sh\ncase \"$*\" in *-encoders*) echo ' V libx264 prores_ks'; exit 0;; esac\n\
                  echo $$ > \"$PID_FILE\"\n[ -z \"$STAYS\" ] && exec cat > /dev/fd/1\ncat > /dev/fd/1\nsleep 90\n";
    write_tool(&tools, script);
    tools
}

fn write_tool(tools: &Path, script: &str) {
    std::fs::create_dir_all(tools).unwrap();
    std::fs::write(tools.join("ffmpeg"), script).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::set_permissions(tools.join("ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
    }
}

fn with_tools(tools: &Path) -> std::ffi::OsString {
    let paths = std::env::var_os("PATH").unwrap();
    std::env::join_paths(std::iter::once(tools.to_owned()).chain(std::env::split_paths(&paths))).unwrap()
}

/// Ended half-way, by a person or by the system, nothing half is left, and no ffmpeg.
#[test]
fn nothing_half_is_left() {
    for name in ["-INT", "-TERM", "-KILL"] {
        for movie in ["a.y4m", "a.gif", "a.mp4"] {
            let place = PlateFolder::with("<frames first=\"1\" last=\"9999\"/>", "background=\"0.1 0.2 0.3\"");
            let (tools, pid) = (slow_ffmpeg(&place), place.path("pid"));
            std::fs::create_dir(place.path("films")).unwrap();
            std::fs::write(place.path("films").join(movie), "old").unwrap();
            let mut child = place
                .command(&format!("--movie films/{movie} --quiet"))
                .env("PATH", with_tools(&tools))
                .env("PID_FILE", &pid)
                // Who is killed cannot end another, which then ends for want of frames.
                .env("STAYS", if name == "-KILL" { "" } else { "1" })
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            wait_until("the fifth picture", || place.path("out/plate/plate.0005.png").exists());
            signal(&child, name);
            let status = child.wait().unwrap();
            assert_eq!(status.code(), (name != "-KILL").then_some(130), "{name} {movie}");
            if movie == "a.mp4" {
                let process = Path::new("/proc").join(std::fs::read_to_string(&pid).unwrap().trim());
                wait_until("the end of ffmpeg", || {
                    let stat = std::fs::read_to_string(process.join("stat")).unwrap_or_default();
                    // Who has ended may wait to be heard.
                    stat.is_empty() || stat.rsplit(") ").next().unwrap_or_default().starts_with('Z')
                });
            }
            assert_eq!(place.names("films"), [movie], "{name}");
            assert_eq!(std::fs::read(place.path("films").join(movie)).unwrap(), b"old", "{name} {movie}");
        }
    }
}

/// What ffmpeg complains about last is told, and the program does not wait for what has ended.
#[test]
fn a_failing_ffmpeg_is_told() {
    let place = PlateFolder::new();
    let tools = place.path("tools");
    let list = "#!/bin/sh\ncase \"$*\" in *-encoders*) echo ' V libx264'; exit 0;; esac\n";
    for end in ["head -c 100 > /dev/null", "cat > /dev/null"] {
        let complaint = "echo 'a first line' >&2\necho 'the disk is full' >&2\nexit 1\n";
        write_tool(&tools, &format!("{list}{end}\n{complaint}"));
        let output = place.command("--movie a.mp4 --quiet").env("PATH", with_tools(&tools)).output().unwrap();
        assert_eq!(refusal(&output), "error: ffmpeg failed: the disk is full\n");
        assert!(!place.path("a.mp4").exists());
    }
    // One that was built without the encoder.
    let output = place.command("--movie a.mov --quiet").env("PATH", with_tools(&tools)).output().unwrap();
    assert!(refusal(&output).contains("the encoder prores_ks, which the installed ffmpeg lacks"));
}

/// Is ffmpeg there? Where it is not, the test says so and is left out.
fn has_ffmpeg(test: &str) -> bool {
    let found = ["ffmpeg", "ffprobe"].iter().all(|name| Command::new(name).arg("-version").output().is_ok());
    if !found {
        assert!(std::env::var_os("REQUIRE_FFMPEG").is_none(), "REQUIRE_FFMPEG is set, but {test} found no ffmpeg");
        // Past the capture of the test harness: a skip is never silent.
        let _ = writeln!(std::io::stderr(), "SKIPPED {test}: there is no ffmpeg");
    }
    found
}

/// What ffprobe says of the stream.
fn probe(path: &Path) -> serde_json::Value {
    let words = ["-v", "error", "-count_frames", "-show_streams", "-of", "json"];
    let output = Command::new("ffprobe").args(words).arg(path).output().unwrap();
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    all["streams"][0].clone()
}

/// All frames by ffmpeg's decoder, in its layout of pixels, cut to the size of the scene.
fn decoded(path: &Path, layout: &str, crop: &str) -> Vec<u8> {
    let filter = format!("scale=flags=accurate_rnd+full_chroma_int+full_chroma_inp,format={layout},crop={crop}:0:0");
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(path)
        .args(["-vf", &filter, "-f", "rawvideo", "-pix_fmt", layout, "-"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

#[test]
fn mp4_is_what_players_expect() {
    if !has_ffmpeg("mp4_is_what_players_expect") {
        return;
    }
    let place = PlateFolder::new();
    place.render("--movie a.mp4");
    let stream = probe(&place.path("a.mp4"));
    for (key, value) in [
        ("codec_name", "h264"),
        ("pix_fmt", "yuv420p"),
        ("color_range", "tv"),
        ("color_space", "bt709"),
        ("color_transfer", "bt709"),
        ("color_primaries", "bt709"),
        ("r_frame_rate", "24/1"),
        ("nb_read_frames", "24"),
    ] {
        assert_eq!(stream[key], value, "{key} of {stream}");
    }
    // Odd sizes are padded.
    assert_eq!((&stream["width"], &stream["height"]), (&32.into(), &18.into()));
    let bytes = decoded(&place.path("a.mp4"), "rgb24", "31:17");
    let frames: Vec<&[u8]> = bytes.chunks(3 * SIZE.0 * SIZE.1).collect();
    assert_eq!(frames.len(), 24);
    for (frame, codes) in frames.iter().zip(place.codes()) {
        // Colours are shared by four pixels: at most 10 codes, 1.3 in the mean; 2.3 by the matrix of BT.601.
        let (most, mean) = distance(frame, &codes);
        assert!(most <= 14 && mean < 1.8, "{most}, {mean}");
    }
}

#[test]
fn mov_keeps_alpha() {
    if !has_ffmpeg("mov_keeps_alpha") {
        return;
    }
    let place = PlateFolder::of_plate(0.1, "<frames first=\"1\" last=\"24\"/>", "transparent=\"true\"");
    place.render("--movie a.mov");
    let stream = probe(&place.path("a.mov"));
    for (key, value) in [
        ("codec_name", "prores"),
        ("profile", "4444"),
        ("color_range", "tv"),
        ("color_space", "bt709"),
        ("color_transfer", "bt709"),
        ("color_primaries", "bt709"),
        ("nb_read_frames", "24"),
    ] {
        assert_eq!(stream[key], value, "{key} of {stream}");
    }
    assert!(stream["pix_fmt"].as_str().unwrap().starts_with("yuva444p"), "{stream}");
    let bytes = decoded(&place.path("a.mov"), "rgba", "31:17");
    let frames: Vec<&[u8]> = bytes.chunks(4 * SIZE.0 * SIZE.1).collect();
    assert_eq!(frames.len(), 24);
    for (number, frame) in (1..).zip(frames) {
        let picture = pictures::read(&place.path(&format!("out/plate/plate.{number:04}.png"))).unwrap();
        let codes = pictures::srgb_codes(&picture, true).unwrap();
        let alpha = |codes: &[u8]| codes.iter().skip(3).step_by(4).copied().collect::<Vec<u8>>();
        assert!(alpha(&codes).iter().any(|a| (1..255).contains(a)));
        // Alpha is kept as it is.
        assert!(distance(&alpha(frame), &alpha(&codes)).0 <= 1);
        // Straight: where a pixel is half covered, the colour is that of the plate, and not half of it.
        let both: Vec<(u8, u8)> = (frame.chunks(4).zip(codes.chunks(4)))
            .filter(|(_, own)| own[3] > 64)
            .flat_map(|(other, own)| (0..3).map(|c| (other[c], own[c])).collect::<Vec<_>>())
            .collect();
        let (a, b): (Vec<u8>, Vec<u8>) = both.into_iter().unzip();
        let (_, mean) = distance(&a, &b);
        assert!(mean < 1.0, "{mean}");
    }
}

/// ffmpeg reads our own formats, too.
#[test]
fn ffmpeg_reads_y4m_and_gif() {
    if !has_ffmpeg("ffmpeg_reads_y4m_and_gif") {
        return;
    }
    let place = PlateFolder::new();
    place.render("--movie a.y4m --size 93x51");
    place.render("--resume --movie a.gif --size 93x51");
    let codes = place.codes();
    for (name, key, value, most) in [("a.y4m", "r_frame_rate", "24/1", 0.6), ("a.gif", "duration", "1.000000", 1.5)] {
        let stream = probe(&place.path(name));
        assert_eq!((&stream["nb_read_frames"], &stream[key]), (&"24".into(), &value.into()), "{stream}");
        if name == "a.y4m" {
            assert_eq!((&stream["pix_fmt"], &stream["color_range"]), (&"yuv444p".into(), &"tv".into()));
        }
        let filter = "scale=in_color_matrix=bt709:flags=accurate_rnd+full_chroma_int,format=rgb24";
        let output = Command::new("ffmpeg")
            .args(["-v", "error", "-i"])
            .arg(place.path(name))
            .args(["-vf", filter, "-fps_mode", "passthrough", "-f", "rawvideo", "-"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let frames: Vec<&[u8]> = output.stdout.chunks(codes[0].len()).collect();
        assert_eq!(frames.len(), 24, "{name}");
        for (frame, codes) in frames.iter().zip(&codes) {
            // 0.41 and 1.15 in the mean.
            let (_, mean) = distance(frame, codes);
            assert!(mean < most, "{name}: {mean}");
        }
    }
}
