//! Pseudo-random numbers for tests.

use glam::Vec3;

/// A generator whose numbers repeat on every run.
pub(crate) struct Random(pub u64);

impl Random {
    /// The next number, in [0, 1).
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// A vector with each coordinate in [-1, 1).
    pub(crate) fn vector(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.next(), self.next(), self.next()) - 1.0
    }
}
