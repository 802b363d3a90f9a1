//! The viewer as a page, and as an enemy, meets it.
