//! Hits that coincide: where triangles of one plane and colour overlap, a pile of surfels would show what one of them
//! shows, and cost as much as all.
//!
//! Two hits coincide if one ray made both, they see the same side at the same depth, and they are painted alike. Such
//! hits are rare in usual models, which meet a ray once at each depth.

use std::hash::{DefaultHasher, Hash, Hasher};

use rayon::prelude::*;

use super::band::Bands;
use super::facets::{Facets, Hit};
use super::paint::Palette;
use super::raster::{SAME_DEPTH, axis_of, drop_at};

/// Steps of a colour, and of a coordinate of a normal, that are the same: more than rounding makes.
const STEPS: f32 = 65_536.0;

/// Drops all but the first of hits that coincide, and gives the number of those dropped. `rays`: that of each hit.
pub(super) fn merge(
    facets: &Facets<'_>,
    palette: &Palette<'_>,
    bands: &Bands,
    hits: &mut Vec<Hit>,
    rays: &[u64],
) -> usize {
    let mut order: Vec<(u64, u32)> = rays.par_iter().copied().zip(0..rays.len() as u32).collect();
    order.par_sort_unstable();
    let runs: Vec<&[(u64, u32)]> = order.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1).collect();
    let mut drop: Vec<usize> = runs.par_iter().flat_map(|run| again(facets, palette, bands, hits, run)).collect();
    drop.par_sort_unstable();
    drop_at(&drop, hits);
    drop.len()
}

/// The hits of one ray that coincide with an earlier one.
fn again(facets: &Facets<'_>, palette: &Palette<'_>, bands: &Bands, hits: &[Hit], run: &[(u64, u32)]) -> Vec<usize> {
    let place = |&(ray, index): &(u64, u32)| {
        let hit = &hits[index as usize];
        let (axis, shape) = (axis_of(ray), facets.shape(hit.triangle));
        (shape.across[axis] > 0.0, hit.position(&shape.corner)[axis], index)
    };
    let mut places: Vec<(bool, f64, u32)> = run.iter().map(place).collect();
    places.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let depth = SAME_DEPTH * bands.of(0).spacing(true);
    let mut again = Vec::new();
    for same in places.chunk_by(|a, b| a.0 == b.0 && (b.1 - a.1).abs() <= depth).filter(|same| same.len() > 1) {
        let looks = |&(_, _, index): &(bool, f64, u32)| (look(palette, &hits[index as usize]), index);
        let mut looks: Vec<(u64, u32)> = same.par_iter().map(looks).collect();
        looks.par_sort_unstable();
        for alike in looks.chunk_by(|a, b| a.0 == b.0) {
            again.extend(alike[1..].iter().map(|(_, index)| *index as usize));
        }
    }
    again
}

/// What a hit looks like, as one number: its plane, normal, colours and opacity, rounded.
fn look(palette: &Palette<'_>, hit: &Hit) -> u64 {
    let brush = palette.brush(hit.triangle, hit.fine);
    let dab = brush.dab(hit);
    let mut hasher = DefaultHasher::new();
    let mut add = |x: f32| ((x * STEPS).round() as i64).hash(&mut hasher);
    for vector in [brush.face(), dab.normal, dab.colour] {
        vector.to_array().into_iter().for_each(&mut add);
    }
    add(dab.opacity.unwrap_or(-1.0));
    hasher.finish()
}
