//! Stray points of a scan: what the scanner measured in the air, by dust, by edges that it hit half, by mirrors.
//!
//! Two kinds are told. A *lone* point is much farther from its neighbours than these are from theirs. Where strays fill
//! the air as a thin fog, their neighbours are strays, too; but fog is thinner than most of the cloud, and lies on no
//! surface. Thin parts of a surface, as a far wall has them, lie on a surface, and stay.

use glam::Vec3;
use rayon::prelude::*;

use super::neighbours::Neighbours;
use super::spacing::Spacing;
use super::variance::{NEAREST, flatness};

/// How many times the median spacing of the cloud a fog has, at the least.
const THIN: f64 = 2.0;
/// Share of the least variance of a neighbourhood in all of it, above which it is no surface. A plane has 0, an edge of
/// two planes .08, a ball 1/3, of which 17 points show .15 to .25.
const NO_SURFACE: f64 = 0.12;
/// How many times the median spacing of the cloud a neighbourhood has that must be flatter, with the square of it:
/// there the noise of a surface is small beside the spacing, and a fog of few points may look flat by chance.
const THINNER: f64 = 6.0;
/// How many times the median spacing of its neighbours a lone point has, at the least.
const LONE: f64 = 4.0;

/// Which distinct points are a fog, and the median spacing of all.
pub(super) struct Fog {
    pub(super) is_fog: Vec<bool>,
    /// Mean distance to the nearest neighbours, the median of all points, model units.
    pub(super) median: f64,
}

/// Finds the fog of a cloud; `None` without as many neighbours as tell a surface.
pub(super) fn fog(position: &[Vec3], neighbours: &Neighbours, spacing: &[Spacing]) -> Option<Fog> {
    if neighbours.count() < NEAREST || position.is_empty() {
        return None;
    }
    let mut means: Vec<f64> = spacing.iter().map(|spacing| spacing.mean).collect();
    let middle = means.len() / 2;
    let median = *means.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_fog = |i: usize| {
        let thinness = spacing[i].mean / median;
        let limit = NO_SURFACE * (THINNER / thinness).powi(2).min(1.0);
        thinness > THIN && flatness(position, i, neighbours.of(i)) > limit
    };
    let seems: Vec<bool> = (0..position.len()).into_par_iter().map(is_fog).collect();
    // Some of a fog looks flat by chance.
    let among_fog = |i: usize| {
        let near = &neighbours.of(i)[..NEAREST];
        spacing[i].mean > THIN * median && 2 * near.iter().filter(|j| seems[**j as usize]).count() >= NEAREST
    };
    let is_fog = (0..position.len()).into_par_iter().map(|i| seems[i] || among_fog(i)).collect();
    Some(Fog { is_fog, median })
}

/// Which distinct points are lone.
fn lone(neighbours: &Neighbours, spacing: &[Spacing]) -> Vec<bool> {
    let is_lone = |i: usize| {
        let mut around = [0.0; NEAREST];
        let near = &neighbours.of(i)[..NEAREST];
        around.iter_mut().zip(near).for_each(|(to, j)| *to = spacing[*j as usize].mean);
        let of_neighbours = *around.select_nth_unstable_by(NEAREST / 2, f64::total_cmp).1;
        spacing[i].mean > LONE * of_neighbours
    };
    (0..spacing.len()).into_par_iter().map(is_lone).collect()
}

/// Which distinct points are strays of either kind; `None` as in [`fog`].
pub(super) fn find(position: &[Vec3], neighbours: &Neighbours, spacing: &[Spacing]) -> Option<Vec<bool>> {
    let fog = fog(position, neighbours, spacing)?.is_fog;
    Some(fog.into_iter().zip(lone(neighbours, spacing)).map(|(fog, lone)| fog || lone).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::neighbours::Distinct;
    use crate::model::spacing::spacing;

    /// Points of a low-discrepancy sequence in [0, 1)^3.
    fn points(count: usize) -> impl Iterator<Item = Vec3> {
        (1..=count).map(|i| {
            let part = |factor: f64| (i as f64 * factor).fract() as f32;
            Vec3::new(part(0.819_172_513), part(0.671_043_606), part(0.549_700_477))
        })
    }

    /// Which of some points are strays.
    fn found(points: &[Vec3]) -> Vec<bool> {
        let distinct = Distinct::new(points);
        let neighbours = Neighbours::new(&distinct.position, NEAREST, &|_, _| {});
        let strays = find(&distinct.position, &neighbours, &spacing(&distinct.position, &neighbours)).unwrap();
        distinct.of.iter().map(|i| strays[*i as usize]).collect()
    }

    /// A floor and a wall that get four times as thin to their far ends, and a fog in the air between them.
    #[test]
    fn fog_is_told_from_thin_surfaces_and_edges() {
        let thinner = |x: f32| 4.0 * (0.3 * x + 0.7 * x * x);
        let floor = points(8000).map(|p| Vec3::new(thinner(p.x), 0.002 * p.z, thinner(p.y)));
        let wall = points(8000).map(|p| Vec3::new(0.002 * p.z, thinner(p.x), thinner(p.y)));
        let surfaces: Vec<Vec3> = floor.chain(wall).collect();
        let fog: Vec<Vec3> = points(80).map(|p| 0.3 + 3.4 * p).collect();
        let strays = found(&[surfaces.clone(), fog].concat());
        let [lost, kept] = [
            strays[..surfaces.len()].iter().filter(|stray| **stray).count(),
            strays[surfaces.len()..].iter().filter(|stray| !**stray).count(),
        ];
        assert!(lost <= 16 && kept <= 4, "{lost} of {} points lost, {kept} of 80 strays kept", surfaces.len());
    }

    #[test]
    fn a_volume_and_a_line_have_no_strays() {
        assert!(found(&points(5000).collect::<Vec<_>>()).iter().filter(|stray| **stray).count() < 5);
        let line: Vec<Vec3> = (0..500).map(|i| Vec3::X * i as f32).collect();
        assert!(!found(&line).contains(&true));
    }

    #[test]
    fn lone_points_are_strays() {
        let mut all: Vec<Vec3> = points(4000).map(|p| Vec3::new(p.x, 0.0, p.y)).collect();
        all.push(Vec3::new(0.5, 0.3, 0.5));
        let strays = found(&all);
        assert!(strays[4000]);
        assert!(strays[..4000].iter().filter(|stray| **stray).count() < 3);
    }

    #[test]
    fn few_points_have_none() {
        let few: Vec<Vec3> = points(10).collect();
        let neighbours = Neighbours::new(&few, NEAREST, &|_, _| {});
        assert!(find(&few, &neighbours, &spacing(&few, &neighbours)).is_none());
    }
}
