//! `convert` of many files: those of a sequence, and several into a folder.
#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fs;
use std::path::Path;

use super::run;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for number in [1, 2, 10] {
        let text = format!("x,y,z,radius\n{number},0,0,1\n0,{number},0,1\n0,0,{number},1\n");
        fs::write(dir.path().join(format!("f.{number:03}.csv")), text).unwrap();
    }
    // Neither is one of them.
    fs::write(dir.path().join("f.7.csv"), "x,y,z\n").unwrap();
    fs::write(dir.path().join("f.0x1.csv"), "x,y,z\n").unwrap();
    dir
}

fn refused(dir: &Path, line: &str) -> String {
    let (status, _, errors) = run(dir, line);
    assert_eq!((status, errors.lines().count()), (Some(2), 1), "{line}: {errors}");
    errors
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn files_of_a_sequence_keep_their_numbers() {
    let dir = folder();
    let line = "convert f.%03d.csv o/g.%d.bin --kind spheres";
    let (status, said, errors) = run(dir.path(), line);
    assert_eq!((status, said.lines().count()), (Some(0), 3), "{errors}");
    assert!(said.starts_with("3 spheres: o/g.1.bin\n"), "{said}");
    assert_eq!(names(&dir.path().join("o")), ["g.1.bin", "g.10.bin", "g.2.bin"]);
    assert!(refused(dir.path(), line).contains("o/g.1.bin exists already (--force replaces it)"));
    assert_eq!(run(dir.path(), &format!("{line} --force --quiet")).0, Some(0));
    let other = refused(dir.path(), "convert g.%d.csv o/h.%d.bin");
    assert!(other.contains("there is no file g.%d.csv"), "{other}");
    assert!(refused(dir.path(), "convert f.001.csv o/h.%d.bin").contains("f.001.csv has none"));
    assert!(refused(dir.path(), "convert f.%03d.csv o/h.%d.obj").contains("must end in .bin or .ply"));
}

#[test]
fn several_files_go_into_a_folder() {
    let dir = folder();
    let (status, said, errors) = run(dir.path(), "convert f.001.csv f.002.csv p/");
    assert_eq!((status, said.lines().count()), (Some(0), 2), "{errors}");
    assert!(errors.contains("note: f.002.csv: line 1 names the columns"), "{errors}");
    assert_eq!(names(&dir.path().join("p")), ["f.001.bin", "f.002.bin"]);
    // Nothing is written where one cannot be.
    assert!(refused(dir.path(), "convert f.010.csv f.002.csv p").contains("f.002.bin exists already"));
    assert!(refused(dir.path(), "convert f.010.csv p/../f.010.csv q").contains("would both be q/f.010.bin"));
    assert!(refused(dir.path(), "convert f.001.csv f.002.csv f.010.csv").contains("f.010.csv is a file"));
    assert_eq!(names(&dir.path().join("p")).len(), 2);
    assert!(!dir.path().join("q").exists());
}
