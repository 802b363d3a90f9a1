//! Do the rows of two files stand for the same points? Where files have no identities and no velocities nothing says
//! so, and a wrong guess sends every point across the model.

use glam::DVec3;

use super::files::File;
use crate::math::Bounds;

/// Points that are looked at, evenly among the rows: a look costs milliseconds, whatever the size of the files.
const POINTS: usize = 4096;
/// Points whose neighbours are sought.
const ASKED: usize = 256;
/// Fewest points that anything can be told of.
const FEWEST: usize = 100;

/// What to say where the rows of two files of one sequence hardly stand for the same points; `None` where they may.
///
/// Points that are neighbours move about alike, whatever moves them, and a turn by 180 degrees parts them by twice
/// their distance. In another order each goes to a place of its own, while a point of the other file is much nearer.
/// So it is another order if by row neighbours part by 3 times their distance and by a twentieth of the whole, and the
/// nearest point is at half the way of a row; all are medians.
pub(super) fn in_another_order(file: &File, beside: &File) -> Option<String> {
    if file.points != beside.points || file.points < FEWEST {
        return None;
    }
    let step = file.points.div_ceil(POINTS);
    let of = |file: &File| -> Vec<DVec3> {
        let surfels = file.model.surfels();
        let rows = file.by_id.iter().step_by(step);
        rows.map(|&i| surfels.origin + surfels.position[i as usize].as_dvec3()).collect()
    };
    let (here, there) = (of(file), of(beside));
    let whole = here.iter().copied().collect::<Bounds>().size().length();
    let mut found = Vec::new();
    for i in (0..here.len()).step_by(here.len().div_ceil(ASKED)) {
        let distance = |j: usize| here[j].distance_squared(here[i]);
        let others = (0..here.len()).filter(|&j| distance(j) > 0.0);
        let Some(near) = others.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) else { continue };
        let [own, other] = [i, near].map(|j| there[j] - here[j]);
        let nearest = there.iter().map(|p| p.distance_squared(here[i])).fold(f64::INFINITY, f64::min);
        found.push([distance(near).sqrt(), own.distance(other), nearest.sqrt(), own.length()]);
    }
    let median = |column: usize| {
        let mut values: Vec<f64> = found.iter().map(|row| row[column]).collect();
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    let [apart, parted, nearest, way] = [0, 1, 2, 3].map(median);
    (parted > 3.0 * apart && parted > 0.05 * whole && nearest < 0.5 * way).then(|| {
        format!(
            "rows of this file and the next may stand for different points: by row a point goes {way:.3}, and its \
             neighbour elsewhere, while the nearest point is at {nearest:.3}; an `id` for each point says which are \
             the same"
        )
    })
}
