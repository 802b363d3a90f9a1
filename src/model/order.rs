//! Puts surfels in an order in which neighbours in memory are neighbours in space.

use glam::Vec3;
use rayon::prelude::*;

use super::surfels::Surfels;

/// Bits of a Morton code per axis: three times 21 fit into 64.
pub(super) const BITS: u32 = 21;

impl Surfels {
    /// The same surfels along a Morton curve with 21 bits for each axis over their bounding cube. Ties keep their
    /// order.
    ///
    /// Renderers that cut a model into runs get compact runs. The sort needs 16 bytes for each surfel, and then the
    /// space of one column at a time. The result does not depend on the number of threads. Models of more than 2^32
    /// surfels keep their order.
    #[must_use]
    pub fn spatially_ordered(mut self) -> Self {
        if u32::try_from(self.len()).is_err() {
            return self;
        }
        let order = order(&self.position);
        permute(&mut self.position, &order);
        permute(&mut self.axis_u, &order);
        permute(&mut self.axis_v, &order);
        permute(&mut self.normal, &order);
        permute(&mut self.colour, &order);
        permute(&mut self.opacity, &order);
        permute(&mut self.material, &order);
        permute(&mut self.velocity, &order);
        permute(&mut self.acceleration, &order);
        permute(&mut self.id, &order);
        if let Some(factors) = self.normalisation.known() {
            let mut factors = factors.to_vec();
            permute(&mut factors, &order);
            self.normalisation = factors.into();
        }
        self
    }
}

/// Old index of each new surfel.
fn order(position: &[Vec3]) -> Vec<u32> {
    let mut keys: Vec<(u64, u32)> = morton_codes(position);
    keys.par_sort_unstable();
    keys.into_par_iter().map(|(_, i)| i).collect()
}

/// Gathers a column. An empty column (the model has no such property) stays empty.
fn permute<T: Copy + Send + Sync>(column: &mut Vec<T>, order: &[u32]) {
    if column.len() == order.len() {
        *column = order.par_iter().map(|&i| column[i as usize]).collect();
    }
}

/// Morton code of each point in the bounding cube of all points, with the point's index. Positions must be finite.
pub(super) fn morton_codes(position: &[Vec3]) -> Vec<(u64, u32)> {
    let (min, max) = position
        .par_iter()
        .fold(|| (Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
        .reduce(|| (Vec3::INFINITY, Vec3::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let min = min.as_dvec3();
    let size = (max.as_dvec3() - min).max_element();
    let cells = f64::from((1_u32 << BITS) - 1);
    let scale = if size > 0.0 { cells / size } else { 0.0 };
    position
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let cell = (p.as_dvec3() - min) * scale;
            (spread(cell.x as u64) << 2 | spread(cell.y as u64) << 1 | spread(cell.z as u64), i as u32)
        })
        .collect()
}

/// Moves bit i of a 21-bit number to bit 3 i.
fn spread(cell: u64) -> u64 {
    let mut x = cell & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Material;
    use proptest::prelude::*;

    fn model(position: Vec<Vec3>) -> Surfels {
        let tag: Vec<Vec3> = (0..position.len()).map(|i| Vec3::splat(i as f32)).collect();
        Surfels {
            axis_u: tag.clone(),
            axis_v: tag.clone(),
            normal: tag.clone(),
            colour: tag.clone(),
            material: tag.iter().map(|t| Material { ambient: t.x, ..Material::default() }).collect(),
            position,
            ..Surfels::default()
        }
    }

    #[test]
    fn bits_are_spread_by_three() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(u64::MAX), 0x1249_2492_4924_9249);
    }

    #[test]
    fn octants_come_one_after_the_other() {
        // x is the most significant axis, then y, then z.
        let corner = |i: u32| Vec3::new((i >> 2 & 1) as f32, (i >> 1 & 1) as f32, (i & 1) as f32);
        let ordered = model((0..8).rev().map(corner).collect()).spatially_ordered();
        assert_eq!(ordered.position, (0..8).map(corner).collect::<Vec<_>>());
    }

    #[test]
    fn equal_points_keep_their_order() {
        let ordered = model(vec![Vec3::ONE; 5000]).spatially_ordered();
        assert!(ordered.colour.iter().enumerate().all(|(i, c)| c.x == i as f32));
    }

    #[test]
    fn neighbours_in_memory_are_near() {
        // The points are a 32^3 grid in a scrambled order. Along a Morton curve the mean step is below 2 cells
        // (scrambled: about 21).
        let n = 32_usize;
        let grid = (0..n * n * n).map(|i| {
            let i = i * 7919 % (n * n * n);
            Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32)
        });
        let ordered = model(grid.collect()).spatially_ordered();
        let length: f32 = ordered.position.windows(2).map(|w| w[0].distance(w[1])).sum();
        let mean = length / (n * n * n - 1) as f32;
        assert!(mean < 2.0, "mean step {mean}");
    }

    #[test]
    fn an_empty_model_stays_empty() {
        assert!(Surfels::default().spatially_ordered().is_empty());
    }

    proptest! {
        #[test]
        fn columns_move_together(points in prop::collection::vec(prop::array::uniform3(-1e18_f32..1e18), 0..200)) {
            let before: Vec<Vec3> = points.into_iter().map(Vec3::from).collect();
            let after = model(before.clone()).spatially_ordered();
            let mut seen: Vec<usize> = after.colour.iter().map(|c| c.x as usize).collect();
            for (i, &old) in seen.iter().enumerate() {
                prop_assert_eq!(after.position[i], before[old]);
                prop_assert_eq!(after.axis_u[i], after.colour[i]);
                prop_assert_eq!(after.material[i].ambient, after.colour[i].x);
            }
            prop_assert!(after.velocity.is_empty());
            seen.sort_unstable();
            prop_assert!(seen.into_iter().eq(0..before.len()));
        }
    }
}
