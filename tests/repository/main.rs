//! The repository itself: the order of modules, widths of lines, lengths of guides, what a package holds.

mod modules;
mod source;
