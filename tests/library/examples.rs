//! The programs of `examples/` that users begin with, at small sizes.

use std::sync::{Arc, Mutex};

#[path = "../../examples/capture_in_memory.rs"]
mod capture_in_memory;
#[path = "../../examples/compare_with_reference.rs"]
mod compare_with_reference;
#[path = "../../examples/frame_to_array.rs"]
mod frame_to_array;
#[path = "../../examples/points_in_memory.rs"]
mod points_in_memory;
#[path = "../../examples/poses_from_arrays.rs"]
mod poses_from_arrays;
#[path = "../../examples/stop_and_progress.rs"]
mod stop_and_progress;

#[test]
fn a_frame_becomes_an_array() {
    let (picture, bytes) = frame_to_array::frame(64, 36).unwrap();
    assert_eq!((picture.rgba.len(), bytes.len()), (64 * 36, 4 * 64 * 36));
    assert!(bytes.chunks(4).all(|pixel| pixel[3] == 255), "the scene has a background");
}

/// The upper half is orange. At rest the ball ends 13.5 pixels from its centre, at the end of the exposure 16.3.
#[test]
fn points_in_memory_move() {
    let (picture, notes) = points_in_memory::burst(2000, 64, 48).unwrap();
    let [above, below] = [picture.rgba[12 * 64 + 32], picture.rgba[36 * 64 + 32]];
    assert!(above[0] > 2.0 * above[2] && (below[0] - below[2]).abs() < 1e-3, "{above:?}, {below:?}");
    let beside = picture.rgba[24 * 64 + 32 + 15];
    assert!(beside[0] > 1e-3, "nothing is seen beside the ball: {beside:?}");
    assert!(notes.iter().any(|note| note.starts_with("radii of all 2000 points estimated")), "{notes:?}");
}

#[test]
fn more_samples_come_nearer_to_the_reference() {
    let [few, more] =
        ["supersample:2", "supersample:16"].map(|mode| compare_with_reference::error_of(mode, 64, 64, 36).unwrap());
    assert!(more[0] < few[0] && more[1] > few[1], "{few:?}, {more:?}");
}

#[test]
fn a_capture_is_made_in_memory() {
    let picture = capture_in_memory::blobs(9, 64, 36).unwrap();
    let seen = picture.rgba.iter().filter(|pixel| pixel[0] + pixel[2] > 0.1).count();
    assert!((100..1500).contains(&seen), "{seen} pixels show blobs");
}

/// The camera backs away: each frame shows less of the plate than the one before.
#[test]
fn poses_move_an_object_and_a_camera() {
    let shares = poses_from_arrays::coverage(3, 64, 48).unwrap();
    assert!(shares.len() == 4 && shares[3] > 0.05 && shares.windows(2).all(|pair| pair[1] < pair[0]), "{shares:?}");
}

/// Half of the first round is done when the frame is stopped.
#[test]
fn a_frame_is_stopped_from_another_thread() {
    assert!(stop_and_progress::render(64, 36, |done| done.share >= 0.5).unwrap().is_none());
    let told = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&told);
    let picture = stop_and_progress::render(64, 36, move |done| {
        into.lock().unwrap().push(done);
        false
    });
    assert!(picture.unwrap().is_some_and(|picture| picture.rgba.len() == 64 * 36));
    let told = told.lock().unwrap();
    assert!(told.len() > 8 && told.last().is_some_and(|done| done.share == 1.0), "{told:?}");
}
