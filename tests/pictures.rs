//! Pictures of the scenes that ship: no holes, smooth silhouettes, no strobing, the right thing in front.
#![allow(clippy::expect_used, reason = "tests may stop")]

mod support;

use std::collections::VecDeque;
use std::path::Path;

use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::plan::{BlurMode, PixelFilter, Prefilter, RenderOptions};
use splatblur::render::render_frame;
use splatblur::scene::{self, Scene};

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.xml"));
    scene::load(&path, &scene::LoadOptions::default()).expect("a shipped scene").scene
}

fn render(scene: &Scene, frame: i64, options: &RenderOptions) -> Picture {
    render_frame(&mut Cpu::default(), scene, frame, options).expect("the frame fits").picture
}

fn supersample(samples: u32) -> RenderOptions {
    RenderOptions { mode: BlurMode::Supersample { samples }, ..RenderOptions::default() }
}

/// Offsets within a disc of radius 2 px: the structuring element of the closing.
fn disc() -> Vec<(i32, i32)> {
    (-2..=2).flat_map(|y| (-2..=2).map(move |x| (x, y))).filter(|(x, y)| x * x + y * y <= 5).collect()
}

/// A black-and-white picture; outside of it counts as background.
#[derive(Clone)]
struct Mask {
    size: [i32; 2],
    set: Vec<bool>,
}

impl Mask {
    fn of(picture: &Picture) -> Self {
        let size = [picture.width as i32, picture.height as i32];
        Self { size, set: picture.rgba.iter().map(|p| p[3] >= 0.5).collect() }
    }

    fn at(&self, x: i32, y: i32) -> bool {
        (0..self.size[0]).contains(&x) && (0..self.size[1]).contains(&y) && self.set[(y * self.size[0] + x) as usize]
    }

    fn map(&self, f: impl Fn(i32, i32) -> bool) -> Self {
        let [w, h] = self.size;
        let set = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Self { size: self.size, set }
    }

    /// Closing: dilation, then erosion (outside the picture nothing is eroded).
    fn closed(&self) -> Self {
        let disc = disc();
        let inside = |x: i32, y: i32| (0..self.size[0]).contains(&x) && (0..self.size[1]).contains(&y);
        let grown = self.map(|x, y| disc.iter().any(|(dx, dy)| self.at(x + dx, y + dy)));
        grown.map(|x, y| disc.iter().all(|(dx, dy)| !inside(x + dx, y + dy) || grown.at(x + dx, y + dy)))
    }

    /// Pixels of the background regions (4-connected) that closing removes whole: holes, as opposed to notches in a silhouette.
    fn holes(&self) -> usize {
        let closed = self.closed();
        let [w, h] = self.size;
        let mut seen = self.set.clone();
        let mut holes = 0;
        for start in 0..seen.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut queue = VecDeque::from([start]);
            let (mut region, mut filled) = (0, true);
            while let Some(i) = queue.pop_front() {
                region += 1;
                let (x, y) = (i as i32 % w, i as i32 / w);
                filled &= closed.at(x, y) && x > 0 && y > 0 && x < w - 1 && y < h - 1;
                for (nx, ny) in [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)] {
                    let n = (ny * w + nx) as usize;
                    if (0..w).contains(&nx) && (0..h).contains(&ny) && !seen[n] {
                        seen[n] = true;
                        queue.push_back(n);
                    }
                }
            }
            if filled {
                holes += region;
            }
        }
        holes
    }
}

#[test]
fn closing_finds_holes_and_only_holes() {
    let solid = Mask { size: [20, 20], set: vec![true; 400] };
    assert_eq!(solid.holes(), 0);
    let mut pierced = solid.clone();
    for i in [5 * 20 + 5, 5 * 20 + 6, 12 * 20 + 9] {
        pierced.set[i] = false;
    }
    assert_eq!(pierced.holes(), 3);
    let notch = solid.map(|x, y| !(x == 10 && y < 8));
    assert_eq!(notch.holes(), 0);
    let window = solid.map(|x, y| !((5..15).contains(&x) && (5..15).contains(&y)));
    assert_eq!(window.holes(), 0);
}

/// Every scene, several frames, frozen: closing removes no background inside the objects.
#[test]
fn shipped_models_have_no_holes() {
    let cases: [(&str, &[i64]); 8] = [
        ("three_objects", &[5, 14, 20, 25, 37, 45]),
        ("diagonal", &[2, 13, 24]),
        ("spin", &[1, 5, 9, 16, 24]),
        ("toward_camera_and_sideways", &[2, 13, 24, 36]),
        ("checkerboard", &[0, 12]),
        ("blinker", &[0, 3]),
        ("crossing", &[4, 12, 20]),
        ("static", &[0]),
    ];
    let mut failures = Vec::new();
    for (name, frames) in cases {
        let mut scene = shipped(name);
        scene.image.transparent = true;
        for &frame in frames {
            for prefilter in [Prefilter::None, Prefilter::Approx] {
                let options = RenderOptions {
                    mode: BlurMode::Still { pixel_samples: 1 },
                    filter: PixelFilter::Point,
                    prefilter,
                    ..RenderOptions::default()
                };
                let holes = Mask::of(&render(&scene, frame, &options)).holes();
                if holes > 0 {
                    failures.push(format!("{name} frame {frame}, prefilter {prefilter:?}: {holes} px"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "holes:\n{}", failures.join("\n"));
}
