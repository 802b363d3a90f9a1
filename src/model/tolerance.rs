//! How far behind the nearest surfel the others of the same surface lie.
//!
//! Neighbours on a surface overlap and are blended, so that all within about a radius of the nearest one show
//! (docs/math.md, eq. 5). Loose discs, such as drops or strands, make no surface: what lies behind the nearest one
//! belongs to another thing, and would shine through.

use super::Surfels;

/// Most surfels that are looked at.
const MEASURED: usize = 2048;
/// How many of the next surfels in memory are looked at, beside each: they are its neighbours in space.
const BESIDE: usize = 24;
/// Fewest overlapping neighbours that say anything.
const FEWEST: usize = 64;
/// Cosine of the angle between normals from which two discs that overlap do not lie on one surface.
const CROSSING: f32 = 0.5;
/// Share of such neighbours up to which the surfels are a surface, and from which they are loose. Shipped surfaces have
/// at most .004, a swarm .26 and drops .48 (docs/measurements/scenes.md, which these were chosen on).
const SHARES: [f64; 2] = [0.05, 0.15];
/// Tolerance of loose discs, median radii: pictures like those with none at all, within the noise of the reference.
const LOOSE: f64 = 0.05;

impl Surfels {
    /// Depth tolerance of the visibility rule where nobody chose one, model space: the median radius of a surface, and
    /// a part of it where overlapping neighbours cross, so that the surfels are no surface. Spheres hide what is
    /// behind them: theirs is 0.
    pub fn tolerance(&self) -> f32 {
        if self.spheres {
            return 0.0;
        }
        let [from, to] = SHARES;
        let loose = ((self.crossing() - from) / (to - from)).clamp(0.0, 1.0);
        (f64::from(self.median_radius()) * libm::pow(LOOSE, loose)) as f32
    }

    /// Share of the overlapping neighbours that do not lie on one surface; 0 where too few overlap.
    fn crossing(&self) -> f64 {
        let normal = |i: usize| self.axis_u[i].cross(self.axis_v[i]).try_normalize();
        let (mut overlapping, mut crossing) = (0_usize, 0_usize);
        for i in (0..self.len()).step_by(self.len().div_ceil(MEASURED).max(1)) {
            let (Some(of_i), radius) = (normal(i), self.radius(i)) else { continue };
            for j in i + 1..(i + 1 + BESIDE).min(self.len()) {
                let Some(of_j) = normal(j) else { continue };
                if self.position[i].distance(self.position[j]) < radius.min(self.radius(j)) {
                    overlapping += 1;
                    crossing += usize::from(of_i.dot(of_j).abs() < CROSSING);
                }
            }
        }
        if overlapping < FEWEST { 0.0 } else { crossing as f64 / overlapping as f64 }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Discs of radius 1 at half that distance along a curve, with normals `normal`.
    fn discs(normal: impl Fn(usize) -> Vec3) -> Surfels {
        let axes = |i: usize| normal(i).any_orthonormal_pair();
        Surfels {
            position: (0..200).map(|i| Vec3::X * (0.5 * i as f32)).collect(),
            axis_u: (0..200).map(|i| axes(i).0).collect(),
            axis_v: (0..200).map(|i| axes(i).1).collect(),
            normal: (0..200).map(&normal).collect(),
            ..Surfels::default()
        }
    }

    #[test]
    fn discs_that_cross_show_little_of_what_is_behind_them() {
        let turned = |i: usize, angle: f32| Vec3::new(0.0, (i as f32 * angle).cos(), (i as f32 * angle).sin());
        // A surface, a curved one, a thin sheet with two sides.
        assert_eq!(discs(|_| Vec3::Z).tolerance(), 1.0);
        assert_eq!(discs(|i| turned(i, 0.2)).tolerance(), 1.0);
        assert_eq!(discs(|i| if i % 2 == 0 { Vec3::Z } else { Vec3::NEG_Z }).tolerance(), 1.0);
        // Neighbours at right angles.
        assert_eq!(discs(|i| turned(i, std::f32::consts::FRAC_PI_2)).tolerance(), 0.05);
        // One of twenty discs stands across: a tenth of the neighbours, so between both.
        let few = discs(|i| if i % 20 == 0 { Vec3::Y } else { Vec3::Z }).tolerance();
        assert!(0.1 < few && few < 0.5, "{few}");
    }

    #[test]
    fn few_neighbours_say_nothing() {
        let apart = Surfels { position: (0..200).map(|i| Vec3::X * (2.0 * i as f32)).collect(), ..discs(|_| Vec3::Z) };
        assert_eq!(apart.tolerance(), 1.0);
        assert_eq!(Surfels::default().tolerance(), 0.0);
    }
}
