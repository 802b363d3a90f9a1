//! The `.anim` file format.
