//! Low-discrepancy sequences: pure functions of (index, dimension, seed).
