//! `splatblur completions` and `splatblur man`: what a shell and `man` want to know of the command line. Both are made
//! from the same definition as the help.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use splatblur::files;

use super::common::open_directory;
use super::output::print;

/// Print what a shell needs to complete commands, options and their values.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur completions bash > ~/.local/share/bash-completion/completions/splatblur
  splatblur completions zsh > ~/.zfunc/_splatblur         (~/.zfunc must be in fpath, before compinit)
  splatblur completions fish > ~/.config/fish/completions/splatblur.fish
  splatblur completions powershell >> $PROFILE")]
pub(super) struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    pub(super) fn run(&self, mut command: Command) -> anyhow::Result<()> {
        let mut script = Vec::new();
        let name = command.get_name().to_owned();
        clap_complete::generate(self.shell, &mut command, name, &mut script);
        print(&String::from_utf8_lossy(&script))
    }
}

/// Print the manual page, or write the pages of all commands.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur man | man -l -
  splatblur man --out ~/.local/share/man/man1     then: man splatblur-render")]
pub(super) struct Manual {
    /// Write splatblur.1 and a page for each command into this directory; made if missing.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Manual {
    pub(super) fn run(&self, mut command: Command) -> anyhow::Result<()> {
        // Gives commands their full names, as in `splatblur-render`.
        command.build();
        let Some(directory) = &self.out else {
            let (_, page) = page(command)?;
            return print(&String::from_utf8_lossy(&page));
        };
        open_directory(directory)?;
        let commands: Vec<Command> = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
        for command in std::iter::once(command).chain(commands) {
            let (name, page) = page(command)?;
            let path = directory.join(name);
            files::replace(&path, &page).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

/// Name of the file, and the page.
fn page(command: Command) -> anyhow::Result<(String, Vec<u8>)> {
    let manual = Man::new(command);
    let mut page = Vec::new();
    manual.render(&mut page).context("cannot write the manual page")?;
    Ok((manual.get_filename(), page))
}
