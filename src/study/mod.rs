//! Modes held against a reference: what `sheet` and `report` show.
//!
//! A [`Trial`] is a scene in front of the backends. A [`LineUp`] renders one frame in several modes, for [`sheet`]. An
//! [`Experiment`] renders frames in several modes on several backends, keeps the pictures in a [`Store`], compares them
//! with the ray-traced reference, and makes the [`report::Study`] that [`report`] shows. [`Thesis`] makes the pictures
//! and numbers of Wolf (2008) again. Nothing here prints, exits or
//! knows the command line: backends come from a function ([`Open`]), and progress goes to one ([`Tell`]).

mod contestant;
mod error;
mod experiment;
mod lineup;
mod pictures;
pub mod provenance;
pub mod report;
pub mod sheet;
mod store;
mod thesis;
mod trial;

pub use self::contestant::{
    BackendKind, Choices, Contestant, ContestantError, Entry, Method, backends, entries, reference_samples,
};
pub use self::error::StudyError;
pub use self::experiment::{Experiment, StudyProgress, Tell};
pub use self::lineup::{LineUp, Part, Shots};
pub use self::store::Store;
pub use self::thesis::Thesis;
pub use self::trial::{Open, Opened, Share, Shot, Trial};

#[cfg(test)]
mod tests;
