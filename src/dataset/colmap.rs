//! `sparse/0`: cameras, views and points as COLMAP writes them as text (its documentation, "Output Format"). From the
//! world to the camera, axes right, down and forward; the middle of the first pixel is (0.5, 0.5).

use std::fmt::Write as _;

use glam::{DMat3, DQuat, DVec3};

use super::points::StartPoint;
use super::views::{View, principal_point};
use crate::scene::Scene;

/// A camera for each focal length, numbered from 1, and the views with the number of theirs.
struct Lenses(Vec<f64>);

impl Lenses {
    fn of(views: &[View]) -> Self {
        let mut lenses = Vec::new();
        for view in views {
            if !lenses.contains(&view.focal) {
                lenses.push(view.focal);
            }
        }
        Self(lenses)
    }

    fn number(&self, view: &View) -> usize {
        self.0.iter().position(|focal| *focal == view.focal).map_or(0, |at| at + 1)
    }
}

/// The three files, by the names of COLMAP.
pub(super) fn files(scene: &Scene, views: &[View], points: &[StartPoint]) -> [(&'static str, String); 3] {
    let lenses = Lenses::of(views);
    [
        ("cameras.txt", cameras(scene, &lenses)),
        ("images.txt", images(views, &lenses)),
        ("points3D.txt", points_text(points)),
    ]
}

// Writing to a string cannot fail.

fn cameras(scene: &Scene, lenses: &Lenses) -> String {
    let [cx, cy] = principal_point(scene);
    let (width, height) = (scene.image.width, scene.image.height);
    let mut text = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy\n".to_owned();
    for (number, focal) in (1..).zip(&lenses.0) {
        let _ = writeln!(text, "{number} PINHOLE {width} {height} {focal} {focal} {cx} {cy}");
    }
    text
}

/// Each view has two lines, the second of which, with the points that it shows, is empty.
fn images(views: &[View], lenses: &Lenses) -> String {
    let mut text = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] (none)\n".to_owned();
    for (number, view) in (1..).zip(views) {
        // Half a turn about x: up becomes down, and back becomes forward.
        let turned = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let rotation = DQuat::from_mat3(&(turned * DMat3::from_mat4(view.camera_from_world))).normalize();
        let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
        let [x, y, z] = (turned * view.camera_from_world.w_axis.truncate()).to_array();
        let DQuat { x: qx, y: qy, z: qz, w: qw } = rotation;
        let (camera, name) = (lenses.number(view), &view.name);
        let _ = writeln!(text, "{number} {qw} {qx} {qy} {qz} {x} {y} {z} {camera} {name}\n");
    }
    text
}

fn points_text(points: &[StartPoint]) -> String {
    let mut text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] (none)\n".to_owned();
    for (number, StartPoint { position, colour: [red, green, blue] }) in (1_u64..).zip(points) {
        let [x, y, z] = position.to_array();
        let _ = writeln!(text, "{number} {x} {y} {z} {red} {green} {blue} 0");
    }
    text
}
