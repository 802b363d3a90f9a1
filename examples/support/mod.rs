//! What the generators of tables share: scenes, references, a plot, and the words of their command lines.
#![allow(dead_code, unreachable_pub, unused_imports, reason = "each example uses its own part")]
#![allow(clippy::expect_used, clippy::print_stderr, reason = "a generator may stop and say why")]

pub mod blocks;
pub mod four_meshes;
pub mod plot;
pub mod random_scenes;
pub mod scenes;

#[path = "../../tests/support/mod.rs"]
mod in_code;

pub use in_code::*;

/// What a command line asks for: names of tables (none: all of them), and `key=value` pairs.
pub struct Arguments {
    tables: Vec<String>,
    values: Vec<(String, String)>,
}

impl Arguments {
    /// Ends the program with status 2 at a word that is not known.
    pub fn read(tables: &[&str], keys: &[&str]) -> Self {
        let mut read = Self { tables: Vec::new(), values: Vec::new() };
        for word in std::env::args().skip(1) {
            match word.split_once('=') {
                Some((key, value)) if keys.contains(&key) => read.values.push((key.to_owned(), value.to_owned())),
                None if tables.contains(&word.as_str()) => read.tables.push(word),
                _ => {
                    eprintln!("unknown: {word}; tables: {}; keys: {}", tables.join(", "), keys.join(", "));
                    std::process::exit(2);
                }
            }
        }
        read
    }

    /// Is this table wanted?
    pub fn table(&self, name: &str) -> bool {
        self.tables.is_empty() || self.tables.iter().any(|table| table == name)
    }

    /// The value of a key, if it was given.
    pub fn value(&self, key: &str) -> Option<&str> {
        self.values.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    /// Is this scene wanted? `scene=NAME` leaves out all others.
    pub fn scene(&self, name: &str) -> bool {
        self.value("scene").is_none_or(|wanted| wanted == name)
    }
}
