//! `splatblur licences`: the licences of the program and of the crates in it.

use clap::Args;

use super::output::print;

/// Crates with versions and licences, a line each, and the texts behind them. `tests/licences` writes the file.
const CRATES: &str = include_str!("licences.txt");

/// Stands before each text.
const RULE: &str = "\n====";

/// Print the licences of the program and of the crates in it.
#[derive(Debug, Args)]
#[command(visible_alias = "licenses")]
#[command(after_long_help = "\
Examples:
  splatblur licences                     crates, versions, licences
  splatblur licences --texts | less      with the texts of the licences")]
pub(super) struct Licences {
    /// Print the texts of the licences, too.
    #[arg(long)]
    texts: bool,
}

impl Licences {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let (crates, texts) = CRATES.split_at(CRATES.find(RULE).unwrap_or(CRATES.len()));
        let version = env!("CARGO_PKG_VERSION");
        let head = format!(
            "splatblur {version}: MIT or Apache-2.0, at your choice.\n\n\
             In it, with all features, on any system:\n\n{crates}"
        );
        if !self.texts {
            return print(&head);
        }
        let (mit, apache) = (include_str!("../../LICENSE-MIT"), include_str!("../../LICENSE-APACHE"));
        print(&format!("{head}{RULE}\nMIT: splatblur\n\n{mit}{RULE}\nApache-2.0: splatblur\n\n{apache}{texts}"))
    }
}
