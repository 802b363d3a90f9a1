//! Options of the library in the words of the command line, as the files that it writes have them.

#[path = "../../src/cli/words.rs"]
mod of_program;

/// A message of the library, with flags in place of its options.
pub(crate) fn with_flags(message: &str) -> String {
    of_program::with_flags(message)
}
