//! How many surfels a spacing makes, and the spacing for a number of them.

use rayon::prelude::*;

use super::facets::Facets;

/// Most surfels of a mesh.
pub(super) const MOST: f64 = (1_u64 << 26) as f64;
/// Most spacings along the diagonal of the box: whole numbers of cells stay small.
const MOST_CELLS: f64 = (1_u64 << 21) as f64;

/// About as many surfels as rays with `spacing` make. A family of rays makes one for each spacing^2 of a triangle's
/// projection. A thin triangle counts by its length, and each triangle takes some work.
pub(super) fn estimate(facets: &Facets<'_>, spacing: f64, reduce: bool) -> f64 {
    let count = |&i: &u32| {
        let shape = facets.shape(i);
        let size = shape.across.abs();
        let projected = 0.5 * if reduce { size.max_element() } else { size.element_sum() };
        let of_area = projected / spacing / spacing;
        if shape.height() < 0.5 * spacing { of_area.max(0.25 * shape.longest / spacing) } else { of_area }
    };
    // Sums of whole chunks in their order do not depend on threads.
    let sums: Vec<f64> = facets.kept.par_chunks(4096).map(|chunk| chunk.iter().map(count).sum()).collect();
    sums.into_iter().sum()
}

/// The least spacing that a mesh can be sampled with.
pub(super) fn least(facets: &Facets<'_>) -> f64 {
    facets.size.length() / MOST_CELLS
}

/// The spacing that makes about `surfels` of them.
pub(super) fn of_count(facets: &Facets<'_>, surfels: f64, reduce: bool) -> f64 {
    // At the diagonal of the box a handful of surfels is left.
    let (mut low, mut high) = (least(facets), facets.size.length());
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if estimate(facets, middle, reduce) > surfels { low = middle } else { high = middle }
    }
    high
}
