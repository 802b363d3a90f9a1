//! The command line: parsing, dispatch, exit status. One file or folder for each subcommand.
//!
//! Exit status: 0 done, 1 a comparison is over its limit, 2 error (one line on stderr), 130 interrupted.
//! What a user asked for goes to stdout, everything else to stderr.
//!
//! The Python package compiles this folder into its module, too (`python/src/lib.rs`).

mod adapters;
mod backend;
mod common;
mod compare;
mod convert;
mod dataset;
mod frames;
mod generate;
mod info;
mod licences;
pub(crate) mod memory;
mod output;
mod progress;
mod reference;
mod render;
mod report;
mod sample;
mod selection;
mod sheet;
mod shell;
mod studio;
mod study;
mod thesis;
mod values;
#[cfg(feature = "viewer")]
mod view;
mod wipe;
pub(crate) mod words;

use std::ffi::OsString;
use std::io;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser, Subcommand};

/// Status of a comparison that is over its limit.
const OVER: u8 = 1;
/// Status of every error.
const FAILED: u8 = 2;
/// Status after Ctrl-C, as a shell reports it.
const INTERRUPTED: u8 = 130;

/// Render moving point-sampled surfaces with motion blur.
#[derive(Debug, Parser)]
#[command(name = "splatblur", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "\
Examples:
  splatblur render scenes/three_objects.xml           all frames, into out/three_objects/
  splatblur view scenes/three_objects.xml             look at it in the browser
  splatblur render scene.xml --frames 12 --size 640x480 --mode still
  splatblur dataset scene.xml --out truth             blurred and sharp pictures, flow, depth, cameras
  splatblur compare a.png b.exr --limit flip=0.02     how far a picture is from another
  splatblur wipe out/still out/blurred --out a.gif    two sequences, a border sweeps over them
  splatblur sheet scene.xml --frame 12 --modes supersample:8,bucket:8x4 --out sheet.png
  splatblur report scene.xml --frames 12 --modes supersample:8,bucket:8x4 --reference 1024 --out report
  splatblur info scene.xml                            what would be rendered
  splatblur help render                               all options, with examples

Exit status: 0 done, 1 a comparison over its limit, 2 error, 130 interrupted.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render::Render>),
    #[cfg(feature = "viewer")]
    View(Box<view::ViewCommand>),
    Reference(Box<reference::Reference>),
    Dataset(Box<dataset::Dataset>),
    Compare(compare::Compare),
    Wipe(wipe::Wipe),
    Sheet(Box<sheet::Sheet>),
    Report(Box<report::Report>),
    Study(thesis::Study),
    Info(info::Info),
    Convert(convert::Convert),
    Sample(sample::Sample),
    Generate(generate::Generate),
    Licences(licences::Licences),
    Completions(shell::Completions),
    Man(shell::Manual),
}

impl Command {
    const fn opens_devices(&self) -> bool {
        match self {
            Self::Render(_) | Self::Dataset(_) | Self::Sheet(_) | Self::Report(_) | Self::Study(_) | Self::Info(_) => {
                true
            }
            #[cfg(feature = "viewer")]
            Self::View(_) => true,
            _ => false,
        }
    }
}

/// Runs the program with `arguments`, the first of which is its name.
pub(super) fn main(arguments: &[OsString]) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    if cli.command.opens_devices() {
        selection::leave_out();
    }
    let done = match &cli.command {
        Command::Render(render) => render.run().map(|()| ExitCode::SUCCESS),
        #[cfg(feature = "viewer")]
        Command::View(view) => view.run(),
        Command::Reference(reference) => reference.run().map(|()| ExitCode::SUCCESS),
        Command::Dataset(dataset) => dataset.run(arguments).map(|()| ExitCode::SUCCESS),
        Command::Compare(compare) => compare.run(),
        Command::Wipe(wipe) => wipe.run().map(|()| ExitCode::SUCCESS),
        Command::Sheet(sheet) => sheet.run().map(|()| ExitCode::SUCCESS),
        Command::Report(report) => report.run(),
        Command::Study(study) => study.run().map(|()| ExitCode::SUCCESS),
        Command::Info(info) => info.run().map(|()| ExitCode::SUCCESS),
        Command::Convert(convert) => convert.run().map(|()| ExitCode::SUCCESS),
        Command::Sample(sample) => sample.run().map(|()| ExitCode::SUCCESS),
        Command::Generate(generate) => generate.run().map(|()| ExitCode::SUCCESS),
        Command::Licences(licences) => licences.run().map(|()| ExitCode::SUCCESS),
        Command::Completions(completions) => completions.run(Cli::command()).map(|()| ExitCode::SUCCESS),
        Command::Man(manual) => manual.run(Cli::command()).map(|()| ExitCode::SUCCESS),
    };
    match done {
        Ok(code) => code,
        // The reader of our output has seen enough, as `head` has.
        Err(error) if output::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            output::say(&words::with_flags(&format!("error: {error:#}")));
            ExitCode::from(FAILED)
        }
    }
}

/// Help and version as clap prints them; a mistake in one line.
fn refuse(error: &clap::Error) -> ExitCode {
    let asked = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
    if asked || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // A closed pipe is no reason to complain.
        let _: io::Result<()> = error.print();
        return if asked { ExitCode::SUCCESS } else { ExitCode::from(FAILED) };
    }
    output::say(&one_line(&error.render().to_string()));
    ExitCode::from(FAILED)
}

/// clap's message without its usage lines, joined into one line.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let kept: Vec<_> = lines.filter(|line| !line.is_empty() && !line.starts_with("For more information")).collect();
    kept.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn mistakes_take_one_line() {
        let error = Cli::try_parse_from(["splatblur", "render", "a.xml", "--sampels", "3"]).unwrap_err();
        let line = one_line(&error.render().to_string());
        assert!(line.starts_with("error: unexpected argument '--sampels' found"), "{line}");
        assert!(line.contains("tip: a similar argument exists: '--samples'"), "{line}");
        assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
    }
}
