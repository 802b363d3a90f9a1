//! Do the normals that a file gives point into its model? Then backs are left out where fronts were meant, and from
//! outside one looks at the inside of the far wall.

use glam::Vec3;

use super::sides::{Discs, FEWEST, directions};
use super::surfels::Surfels;

/// Begins the note, which a scene drops where the camera stands inside, as in a room.
pub(crate) const INWARD: &str = "normals point inward";

/// Surfels that are looked at, evenly in the order of the file.
const LOOKED_AT: usize = 1 << 14;
/// Most cells of pictures that their discs may fill, so that a look takes some hundredths of a second. A few discs that
/// are as large as the model each are not judged.
const MOST_CELLS: f64 = 2e6;
/// Least share of backs in the view that shows fewest of them.
///
/// Closed clouds show at most 0.032 of backs (docs/measurements/sides.md), so 0.968 and more inside out. An open scan,
/// a sheet or a room without its ceiling shows its fronts in some view.
const LEAST: f64 = 0.8;

/// What to say of surfels whose normals point inward as the file gives them: backs fill the views from all sides.
/// `None` where they do not, or where their signs mean nothing.
pub(super) fn note(surfels: &Surfels) -> Option<String> {
    let given = !surfels.two_sided && !surfels.signs_estimated && surfels.len() >= FEWEST;
    if !given {
        return None;
    }
    let step = surfels.len().div_ceil(LOOKED_AT);
    let chosen = (0..surfels.len()).step_by(step);
    // Fewer discs cover as much where each is larger.
    let larger = (step as f32).sqrt();
    let position: Vec<Vec3> = chosen.clone().map(|i| surfels.position[i]).collect();
    let normal: Vec<Vec3> = chosen.clone().map(|i| surfels.normal[i]).collect();
    let radius: Vec<f32> = chosen.map(|i| surfels.radius(i) * larger).collect();
    let guided = vec![false; position.len()];
    let discs = Discs { position: &position, normal: &normal, radius: &radius, guided: &guided };
    let small = discs.cells() <= MOST_CELLS;
    (small && directions().all(|to_viewer| discs.backs(to_viewer.as_dvec3()) >= LEAST)).then(|| {
        format!(
            "{INWARD}, as those of a room: from outside the inside of the far wall shows (twoSided=\"true\" shows both \
             sides)"
        )
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A ball of `count` discs, whose normals point outward times `sign`; what lies above `cut` is left out.
    fn ball(count: usize, sign: f32, cut: f64) -> Surfels {
        let mut ball = Surfels::default();
        for i in 0..count {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let (sine, cosine) = (2.399_963 * i as f64).sin_cos();
            let p = DVec3::new(cosine * (1.0 - z * z).sqrt(), sine * (1.0 - z * z).sqrt(), z).as_vec3();
            if z > cut {
                continue;
            }
            let radius = (8.0 / count as f32).sqrt();
            let (u, v) = p.any_orthonormal_pair();
            ball.position.push(p);
            ball.normal.push(p * sign);
            ball.axis_u.push(u * radius);
            ball.axis_v.push(v * radius);
        }
        ball
    }

    #[test]
    fn only_what_is_closed_and_inside_out_is_told() {
        for count in [100, 3000, 40_000] {
            let inside_out = ball(count, -1.0, 2.0);
            assert!(note(&inside_out).is_some(), "{count}");
            // Signs that were estimated, or that mean nothing.
            assert_eq!(note(&Surfels { signs_estimated: true, ..inside_out.clone() }), None);
            assert_eq!(note(&Surfels { two_sided: true, ..inside_out }), None);
            assert_eq!(note(&ball(count, 1.0, 2.0)), None, "{count}");
            // A bowl shows its inside from above.
            assert_eq!(note(&ball(count, -1.0, 0.5)), None, "{count}");
            assert_eq!(note(&ball(count, 1.0, 0.5)), None, "{count}");
        }
        assert_eq!(note(&ball(16, -1.0, 2.0)), None);
        // Discs as large as the whole would take long.
        let mut huge = ball(16_000, -1.0, 2.0);
        huge.axis_u.iter_mut().for_each(|axis| *axis *= 1000.0);
        assert_eq!(note(&huge), None);
    }
}
