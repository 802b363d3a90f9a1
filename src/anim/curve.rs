//! Curve evaluation.
