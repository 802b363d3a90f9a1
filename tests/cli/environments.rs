//! Environments on the command line: made, described, mirrored, refused.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fs;

use splatblur::image;

use crate::run;

const SCENE: &str = "<scene><image width='32' height='24'/><environment background='true'>studio.exr</environment>\
     <object><pointModel>ball.ply</pointModel><material ambient='0' diffuse='0' specular='0' reflection='1'/></object>\
     </scene>";

#[test]
fn a_studio_is_made_and_mirrored() {
    let dir = tempfile::tempdir().unwrap();
    let (status, said, errors) = run(dir.path(), "generate studio studio.exr");
    assert_eq!((status, said.as_str(), errors.as_str()), (Some(0), "1024 x 512 pixels: studio.exr\n", ""));
    let (status, _, errors) = run(dir.path(), "generate studio studio.ply");
    assert_eq!((status, errors.as_str()), (Some(2), "error: studio.ply must end in .exr\n"));
    assert_eq!(run(dir.path(), "generate ball ball.ply").0, Some(0));
    fs::write(dir.path().join("s.xml"), SCENE).unwrap();

    let (status, said, _) = run(dir.path(), "info s.xml --json");
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!((status, &report["environment"]["width"]), (Some(0), &serde_json::json!(1024)));
    assert_eq!(report["objects"][0]["reflection"], serde_json::json!(1.0));

    let picture = |line: &str| {
        let (status, _, errors) = run(dir.path(), line);
        assert_eq!(status, Some(0), "{errors}");
        image::read(&dir.path().join("out/s.0000.exr")).unwrap()
    };
    let mirror = picture("render s.xml --out out --backend cpu --format exr --mode still:1");
    // The ball shows the sky above and the floor below, and the environment shows around it.
    let at = |x: usize, y: usize| mirror.rgba[y * 32 + x];
    let ([above, below], corner) = ([at(16, 8), at(16, 18)], at(1, 1));
    assert!(above[2] > above[0] && below[2] < below[0], "{above:?} and {below:?}");
    assert!(corner[2] > 0.5 && corner[3] == 1.0, "{corner:?}");
    let matt = SCENE.replace("reflection='1'", "reflection='0'");
    fs::write(dir.path().join("s.xml"), matt).unwrap();
    assert_eq!(
        picture("render s.xml --out out --backend cpu --format exr --mode still:1").rgba[12 * 32 + 16][..3],
        [0.0; 3]
    );
}

#[test]
fn a_wrong_environment_is_one_line() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(run(dir.path(), "generate ball ball.ply").0, Some(0));
    fs::write(dir.path().join("s.xml"), SCENE).unwrap();
    fs::write(dir.path().join("studio.exr"), "no picture").unwrap();
    let (status, _, errors) = run(dir.path(), "render s.xml --out out");
    assert_eq!(status, Some(2));
    assert_eq!(errors.lines().count(), 1, "{errors}");
    assert!(
        errors.contains("s.xml:1:") && errors.contains("neither a PNG, an EXR nor a Radiance HDR file"),
        "{errors}"
    );
    assert!(!dir.path().join("out").exists());
}
