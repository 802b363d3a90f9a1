//! What a dataset records of the command line, and how it is made again.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context as _, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, CommandFactory as _, FromArgMatches as _};
use serde::Deserialize;
use splatblur::dataset::{By, Origin, Recipe};
use splatblur::files;
use splatblur::study::provenance::{PROGRAM, Settings};

use super::Dataset;
use crate::cli::backend::Wanted;
use crate::cli::{Cli, Command};

/// What does not decide what is made: where it goes, and how the program goes about it.
const RUNNING: [&str; 13] = [
    "scene", "out", "resume", "replay", "json", "backend", "adapter", "memory", "threads", "lenient", "restrict",
    "quiet", "progress",
];

/// What a dataset says that it was made by.
const BACKENDS: [&str; 3] = ["cpu", "gpu", REFERENCE];

/// In place of a backend where all pictures are ray-traced.
const REFERENCE: &str = "reference";

/// The part of a `transforms.json` that this program wrote for itself.
#[derive(Deserialize)]
struct Document {
    splatblur: Origin,
}

/// A run, as it is recorded.
pub(super) struct Recorded {
    /// The scene file, as it was named.
    pub(super) scene: String,
    arguments: Vec<String>,
    /// An earlier run's program, backend and hash of settings.
    earlier: Option<(String, String, String)>,
}

/// The choices on the command line of these `arguments`, the first of which is the program's name.
pub(super) fn given(arguments: &[OsString]) -> anyhow::Result<Vec<String>> {
    let matches = Cli::command().try_get_matches_from(arguments)?;
    Ok(matches.subcommand_matches(NAME).map_or_else(Vec::new, choices))
}

/// Name of the command.
const NAME: &str = "dataset";

/// Options that say what is made, each with its value in one word.
fn choices(matches: &ArgMatches) -> Vec<String> {
    let mut choices = Vec::new();
    for argument in options() {
        let id = argument.get_id().as_str();
        let (Some(long), Some(ValueSource::CommandLine)) = (argument.get_long(), matches.value_source(id)) else {
            continue;
        };
        if matches!(argument.get_action(), ArgAction::SetTrue) {
            choices.push(format!("--{long}"));
        } else {
            let values = matches.get_raw(id).into_iter().flatten();
            choices.extend(values.map(|value| format!("--{long}={}", value.to_string_lossy())));
        }
    }
    choices
}

/// The options of the command that say what is made.
fn options() -> Vec<Arg> {
    let command = Cli::command();
    let all = command.find_subcommand(NAME).into_iter().flat_map(clap::Command::get_arguments);
    all.filter(|argument| !RUNNING.contains(&argument.get_id().as_str())).cloned().collect()
}

/// Reads what a dataset recorded.
pub(super) fn read(path: &Path) -> anyhow::Result<Recorded> {
    let context = || format!("cannot replay {}", path.display());
    let bytes = files::read(path, u64::MAX).with_context(context)?;
    let Document { splatblur: Origin { program, scene, arguments, backend, hash } } =
        serde_json::from_slice(&bytes).with_context(context)?;
    if !BACKENDS.contains(&backend.as_str()) {
        bail!(
            "cannot replay {}: found the backend `{}`, expected `cpu`, `gpu` or `reference`",
            path.display(),
            shown(&backend)
        );
    }
    Ok(Recorded { scene, arguments, earlier: Some((program, backend, hash)) })
}

/// A word of a file for a message.
fn shown(word: &str) -> String {
    word.chars().take(60).flat_map(char::escape_debug).collect()
}

impl Recorded {
    /// A run that is no replay.
    pub(super) fn new(scene: &Path, arguments: Vec<String>) -> Self {
        Self { scene: scene.display().to_string(), arguments, earlier: None }
    }

    /// The options of the run.
    pub(super) fn choices(&self) -> anyhow::Result<Dataset> {
        let known = options();
        let is_known = |argument: &str| {
            let name = argument.split_once('=').map_or(argument, |(name, _)| name);
            name.strip_prefix("--").is_some_and(|name| known.iter().any(|option| option.get_long() == Some(name)))
        };
        if let Some(other) = self.arguments.iter().find(|argument| !is_known(argument.as_str())) {
            bail!("`{other}` is no choice that a dataset records");
        }
        let line = ["splatblur", NAME].into_iter().chain(self.arguments.iter().map(String::as_str)).chain(["--", "-"]);
        let matches = Cli::command().try_get_matches_from(line.map(OsString::from));
        let matches = matches.map_err(|error| {
            let line = crate::cli::one_line(&error.render().to_string());
            anyhow::anyhow!(line.trim_start_matches("error: ").to_owned())
        })?;
        match Cli::from_arg_matches(&matches)?.command {
            Command::Dataset(dataset) => Ok(*dataset),
            _ => bail!("its arguments are those of another command"),
        }
    }

    /// The backend of an earlier run, else `wanted`.
    pub(super) fn backend(&self, wanted: Wanted) -> Wanted {
        match &self.earlier {
            Some((_, backend, _)) if backend == "gpu" => Wanted::Gpu,
            Some((_, backend, _)) if backend == "cpu" => Wanted::Cpu,
            _ => wanted,
        }
    }

    /// The record of a run with these settings; refused where an earlier run had others.
    pub(super) fn origin(&self, settings: &Settings, backend: &str, recipe: &Recipe) -> anyhow::Result<Origin> {
        let hash = settings.hash();
        if let Some((program, _, earlier)) = &self.earlier
            && earlier != hash
        {
            let what = if program == PROGRAM { "the scene or its files have" } else { "the program has" };
            bail!("cannot replay: {what} changed since then ({program}, settings {earlier}; now {PROGRAM}, {hash})");
        }
        let backend = match recipe.by {
            By::Splatting(_) => backend,
            By::Tracing(_) => REFERENCE,
        };
        Ok(Origin {
            program: PROGRAM.to_owned(),
            scene: self.scene.clone(),
            arguments: self.arguments.clone(),
            backend: backend.to_owned(),
            hash: hash.to_owned(),
        })
    }
}
