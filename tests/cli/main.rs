//! The program as a user meets it: what it writes, what it prints, what it refuses.

#[path = "../support/mod.rs"]
mod support;

mod compare;
mod gpu;
mod hostile_input;
mod input;
mod meshes;
mod messages;
mod reference;
mod render;
mod report;
mod shell;
mod volumes;
