//! How the points of a file move towards the file beside it.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::files::File;
use crate::model::PointTree;
use crate::model::paths::{OwnPaths, elapsed};

/// Points that one task moves. Nothing depends on it.
const CHUNK: usize = 4096;

/// The paths of the points of `file` towards the file `beside` it, which is `step` frames later (negative: earlier),
/// per frame. `per_frame`: units of time of the files' velocities in a frame.
///
/// Points that both files have go along the cubic curve that has the places and velocities of both (Hermite), or along
/// a straight line where the files have no velocities. They are matched by identity, or by row where the files have as
/// many points and no identities; `within` matches these by place. All other points follow their own velocity and
/// acceleration.
///
/// # Errors
/// The points cannot be matched, and say nothing of how they move: the numbers of points.
pub(super) fn paths(
    file: &File,
    beside: Option<&File>,
    within: Option<f64>,
    step: f64,
    per_frame: f64,
) -> Result<Arc<OwnPaths>, [usize; 2]> {
    let (model, surfels) = (&file.model, file.model.surfels());
    let own = model.paths();
    let rates = [per_frame, per_frame * per_frame];
    let of_file = |i: usize| [0, 1].map(|c| own.columns[c].get(i).map_or(DVec3::ZERO, |r| r.as_dvec3() * rates[c]));
    let partners = beside.map_or_else(Vec::new, |beside| match within {
        Some(within) if file.rows && beside.rows => nearest(file, beside, within, per_frame * step),
        _ => partners(file, beside),
    });
    let moves = !own.is_empty();
    if let Some(beside) = beside.filter(|beside| partners.is_empty() && beside.points > 0 && !moves) {
        return Err([file.points, beside.points]);
    }
    let beside = beside.filter(|_| !partners.is_empty());
    let path = |i: usize| -> [DVec3; 3] {
        let [velocity, acceleration] = of_file(i);
        let Some((beside, partner)) = beside.zip(partners.get(i).copied().flatten()) else {
            return [velocity, acceleration, DVec3::ZERO];
        };
        let (other, partner) = (beside.model.surfels(), partner as usize);
        let way =
            (other.origin - surfels.origin) + (other.position[partner].as_dvec3() - surfels.position[i].as_dvec3());
        if !moves || other.paths().is_empty() {
            return [way / step, DVec3::ZERO, DVec3::ZERO];
        }
        let theirs = other.velocity.get(partner).map_or(DVec3::ZERO, |v| v.as_dvec3() * per_frame);
        let (m0, m1) = (velocity * step, theirs * step);
        [velocity, (way * 3.0 - m0 * 2.0 - m1) * (2.0 / (step * step)), (m0 + m1 - way * 2.0) * (6.0 / step.powi(3))]
    };
    let mut columns = [0; 3].map(|_| vec![Vec3::ZERO; surfels.len()]);
    let [first, second, third] = &mut columns;
    let chunks = first.par_chunks_mut(CHUNK).zip(second.par_chunks_mut(CHUNK)).zip(third.par_chunks_mut(CHUNK));
    chunks.enumerate().for_each(|(chunk, ((first, second), third))| {
        for l in 0..first.len() {
            let [velocity, acceleration, jerk] = path(chunk * CHUNK + l);
            (first[l], second[l], third[l]) = (velocity.as_vec3(), acceleration.as_vec3(), jerk.as_vec3());
        }
    });
    // What moves no point by more than half the rounding of its place costs time for nothing.
    let size = model.bounds().size().max_element().max(f64::from(model.median_radius()));
    let least = (size * f64::from(f32::EPSILON) / 4.0) as f32;
    for (column, factor) in columns.iter_mut().zip(elapsed(0.5 * step.abs())) {
        let rests = |rate: &Vec3| rate.abs().max_element() * (factor as f32) <= least;
        if column.par_iter().all(rests) {
            *column = Vec::new();
        }
    }
    Ok(Arc::new(OwnPaths { columns }))
}

/// For each point of `file` the same one in `beside`, where there is one; empty if points cannot be matched.
fn partners(file: &File, beside: &File) -> Vec<Option<u32>> {
    if file.rows != beside.rows || file.rows && file.points != beside.points {
        return Vec::new();
    }
    let mut partners = vec![None; file.points];
    let (ids, other_ids) = (&file.model.surfels().id, &beside.model.surfels().id);
    let mut others = beside.by_id.iter().peekable();
    for &i in &file.by_id {
        let id = ids[i as usize];
        while others.next_if(|&&other| other_ids[other as usize] < id).is_some() {}
        let same = others.next_if(|&&other| other_ids[other as usize] == id);
        partners[i as usize] = same.copied();
    }
    if file.rows && !rows_agree(file, beside, &partners) { Vec::new() } else { partners }
}

/// For each point of `file` the one of `beside` that is nearest to it, if it is nearest to that one, too, and they are
/// not farther apart than `within`, model units. Both are where their velocities lead them in half the `time`, in units
/// of the velocities: so the same two are found from either file.
fn nearest(file: &File, beside: &File, within: f64, time: f64) -> Vec<Option<u32>> {
    let origin = file.model.surfels().origin;
    let places = |file: &File, time: f64| -> Vec<Vec3> {
        let surfels = file.model.surfels();
        let own = |i: usize| surfels.velocity.get(i).map_or(DVec3::ZERO, |v| v.as_dvec3() * (0.5 * time));
        let place = |i: usize| (surfels.origin - origin + surfels.position[i].as_dvec3() + own(i)).as_vec3();
        (0..surfels.len()).into_par_iter().map(place).collect()
    };
    let (here, there) = (places(file, time), places(beside, -time));
    let of = |from: &[Vec3], to: &[Vec3]| -> Vec<Option<u32>> {
        let tree = PointTree::new(to.iter().copied().zip(0..));
        let nearest = |found: &mut Vec<(f64, u32)>, p: &Vec3| {
            tree.nearest(*p, u32::MAX, 1, found);
            found.first().filter(|(square, _)| *square <= within * within).map(|(_, index)| *index)
        };
        from.par_iter().map_init(Vec::new, nearest).collect()
    };
    let (forth, back) = rayon::join(|| of(&here, &there), || of(&there, &here));
    let mutual = |(i, partner): (usize, Option<u32>)| partner.filter(|j| back[*j as usize] == Some(i as u32));
    forth.into_iter().enumerate().map(mutual).collect()
}

/// How many points of two files are the same by their places.
pub(super) fn matched(file: &File, beside: &File, within: f64) -> String {
    if !beside.rows {
        return "points with an `id` are matched by it, and not by `match`".to_owned();
    }
    let matched = nearest(file, beside, within, 0.0).iter().flatten().count();
    format!(
        "matched by places within {within}: {matched} of {} points, with {} of the next file",
        file.points, beside.points
    )
}

/// Do rows stand for the same points? Where there are velocities, most points must lie about where these lead.
fn rows_agree(file: &File, beside: &File, partners: &[Option<u32>]) -> bool {
    let (model, other) = (file.model.surfels(), beside.model.surfels());
    if model.velocity.is_empty() || other.velocity.is_empty() {
        return true;
    }
    // The way of a point has the direction of its velocities, or the other one where `beside` is the earlier file.
    let along = |(i, partner): (usize, &Option<u32>)| {
        let partner = (*partner)? as usize;
        let way = (other.origin - model.origin) + (other.position[partner] - model.position[i]).as_dvec3();
        let mean = (model.velocity[i] + other.velocity[partner]).as_dvec3();
        Some(way.dot(mean) / (way.length() * mean.length()))
    };
    let cosines: Vec<f64> = partners.iter().enumerate().filter_map(along).filter(|cosine| cosine.is_finite()).collect();
    let sum: f64 = cosines.iter().sum();
    cosines.is_empty() || (sum / cosines.len() as f64).abs() > 0.5
}
