//! `poses_bounds.npy`, as LLFF (Mildenhall et al. 2019) and what came after it read it: of each view 17 numbers.

use super::views::View;
use crate::scene::Scene;

/// Its name.
pub(super) const POSES_BOUNDS: &str = "poses_bounds.npy";

/// Shares of the pixels that lie before the near bound and behind the far one, as LLFF takes them.
const BEYOND: f64 = 0.001;

/// The nearest and the farthest depth that a view shows, but for a thousandth of its pixels on each side; `None` where
/// it shows nothing. `depths`: scene units, infinite where nothing is seen.
pub(super) fn bounds(mut depths: Vec<f32>) -> Option<[f64; 2]> {
    depths.retain(|depth| depth.is_finite() && *depth > 0.0);
    depths.sort_by(f32::total_cmp);
    let last = depths.len().checked_sub(1)?;
    let near = (BEYOND * last as f64).floor() as usize;
    Some([near, last - near].map(|at| f64::from(depths[at])))
}

/// The bytes of the file. `bounds`: of each view. One that shows nothing has those of all others.
///
/// A row is a matrix of three rows and five columns, row by row, and then both bounds. The columns are the camera's
/// axes down, right and back, its place, and height, width and focal length in pixels.
pub(super) fn poses_bounds(scene: &Scene, views: &[View], bounds: &[Option<[f64; 2]>]) -> Vec<u8> {
    let known = || bounds.iter().flatten();
    let near = known().map(|[near, _]| *near).fold(f64::INFINITY, f64::min);
    let far = known().map(|[_, far]| *far).fold(0.0, f64::max);
    let of_others = if far > 0.0 { [near, far] } else { [scene.camera.near, 2.0 * scene.camera.near] };
    let mut values = Vec::new();
    for (view, own) in views.iter().zip(bounds) {
        let world_from_camera = view.camera_from_world.inverse();
        let [right, up, back, eye] = [0, 1, 2, 3].map(|column: usize| world_from_camera.col(column).truncate());
        let size = [f64::from(scene.image.height), f64::from(scene.image.width), view.focal];
        for (row, size) in size.into_iter().enumerate() {
            values.extend([-up[row], right[row], back[row], eye[row], size]);
        }
        values.extend(own.unwrap_or(of_others));
    }
    npy(&values, [views.len(), 17])
}

/// A table of numbers as `NumPy`'s file of version 1.0: a magic word, the length of the header, the header padded to
/// 64 bytes, and the values, row by row.
fn npy(values: &[f64], [rows, columns]: [usize; 2]) -> Vec<u8> {
    const BEFORE: usize = 10;
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // With the end of its line.
    let whole = (BEFORE + header.len() + 1).next_multiple_of(64);
    header.extend(std::iter::repeat_n(' ', whole - BEFORE - header.len() - 1));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    // 70 bytes or so.
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}
