//! Lines of text files.

use super::{Fault, fault};

/// The lines that say something: their numbers from 1, and their words.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let text = bytes.split(|&b| b == b'\n').map(|line| std::str::from_utf8(line).unwrap_or("\u{fffd}"));
    (1..).zip(text).map(|(number, line)| (number, line.split_whitespace().collect()))
}

/// Is it a comment?
pub(super) fn is_comment(words: &[&str]) -> bool {
    words.first().is_some_and(|word| word.starts_with('#'))
}

/// `N` finite numbers from word `first` on.
pub(super) fn numbers<const N: usize>(line: usize, words: &[&str], first: usize) -> Result<[f64; N], Fault> {
    let mut out = [0.0; N];
    for (i, number) in out.iter_mut().enumerate() {
        let place = format!("line {line}");
        let Some(word) = words.get(first + i) else {
            return Err(fault(&place, format!("{} words", words.len()), format!("at least {}", first + N)));
        };
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        *number = value.ok_or_else(|| fault(&place, format!("`{}`", shortened(word)), "a finite number"))?;
    }
    Ok(out)
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}
