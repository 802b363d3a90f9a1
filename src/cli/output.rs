//! The two streams. Neither panics where its reader has gone.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// One line for the person at the terminal, on stderr.
pub(super) fn say(line: &str) {
    // Nobody listens to a closed stderr.
    let _ = writeln!(io::stderr().lock(), "{}", visible(line));
}

/// Shows line ends and control characters, which names of files may hold, as escapes.
fn visible(line: &str) -> String {
    line.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() }).collect()
}

/// What was asked for, on stdout.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = io::stdout().lock();
    let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
    written.map_err(|source| Stdout(source).into())
}

/// The folder of the file that stdout goes to; empty, the working directory, where it is no file or the system does not
/// tell.
pub(super) fn folder() -> PathBuf {
    let file = std::fs::read_link("/proc/self/fd/1").ok().filter(|path| path.is_file());
    file.and_then(|file| file.parent().map(Path::to_owned)).unwrap_or_default()
}

/// One JSON document on stdout.
pub(super) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// True where the reader of stdout has gone, which is no error.
pub(super) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<Stdout>().is_some_and(|e| e.0.kind() == io::ErrorKind::BrokenPipe)
}

#[derive(Debug, thiserror::Error)]
#[error("cannot write to standard output")]
struct Stdout(#[source] io::Error);

#[cfg(test)]
mod tests {
    #[test]
    fn a_line_stays_a_line() {
        assert_eq!(super::visible("no \u{e9}\\\n\u{1b}[2J"), "no \u{e9}\\\\n\\u{1b}[2J");
    }
}
