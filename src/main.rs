//! The `splatblur` command line.

fn main() {}
