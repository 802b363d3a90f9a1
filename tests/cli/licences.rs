//! `splatblur licences`.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

use super::run;

#[test]
fn licences_are_listed_and_their_texts_shown() {
    let directory = tempfile::tempdir().unwrap();
    let (status, list, error) = run(directory.path(), "licences");
    assert_eq!((status, error.as_str()), (Some(0), ""));
    let row = list.lines().find(|line| line.starts_with("clap ")).expect("a row of clap");
    assert!(row.ends_with("  MIT OR Apache-2.0"), "{row}");
    assert!(list.lines().count() > 100 && !list.contains("===="), "{list}");

    let (_, texts, _) = run(directory.path(), "licences --texts");
    assert!(texts.starts_with(&list));
    for part in ["\n====\nMIT: splatblur\n", "\n====\nApache-2.0: splatblur\n", "SIL OPEN FONT LICENSE", "clap_builder"]
    {
        assert!(texts.contains(part), "{part}");
    }
    // The other spelling.
    assert_eq!(run(directory.path(), "licenses").1, list);
}
