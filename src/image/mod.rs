//! Pictures to files. Files appear whole or not at all: written under a temporary name, then renamed.
