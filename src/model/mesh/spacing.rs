//! How many surfels a spacing makes, the spacing for a number of them, and how much finer they are at sharp edges.

use rayon::prelude::*;

use super::band::{self, Bands};
use super::edges::Edges;
use super::facets::Facets;
use super::raster;

/// Most surfels of a mesh.
pub(super) const MOST: f64 = (1_u64 << 26) as f64;
/// Most spacings along the diagonal of the box: whole numbers of cells stay small.
const MOST_CELLS: f64 = (1_u64 << 21) as f64;

/// Least spacing at sharp edges, coarse spacings.
const FINEST: f64 = 1.0 / 3.0;
/// Greatest spacing at sharp edges that is worth a grid of its own, coarse spacings.
const COARSEST: f64 = 0.7;
/// Most surfels that sharp edges add, as a share of those of the whole surface.
const MOST_AT_EDGES: f64 = 0.75;

/// Most parts of edges, as a share of all surfels and triangles. A part lies in up to 27 cells of 16 bytes.
const MOST_PARTS: f64 = 0.25;
/// So many parts are never too many.
const FEW_PARTS: f64 = 1e5;

/// Spacings that are tried for a number of surfels.
const TRIES: usize = 8;
/// Logarithm of the ratio of two counts that are as good as the same.
const NEARLY: f64 = 0.02;

/// A mesh whose surfels are counted.
pub(super) struct Counted<'a> {
    pub(super) facets: &'a Facets<'a>,
    pub(super) edges: &'a Edges,
    /// See [`raster::hits`].
    pub(super) reduce: bool,
    /// Size of each usable triangle: spacings are tried by the dozen.
    sizes: Vec<Size>,
}

/// What [`Counted::estimate`] asks of a triangle.
struct Size {
    level: u8,
    /// Area of its projections.
    projected: f64,
    height: f64,
    longest: f64,
}

impl<'a> Counted<'a> {
    pub(super) fn new(facets: &'a Facets<'a>, edges: &'a Edges, reduce: bool) -> Self {
        let size = |&i: &u32| {
            let shape = facets.shape(i);
            let sides = shape.across.abs();
            let projected = 0.5 * if reduce { sides.max_element() } else { sides.element_sum() };
            // As it would be on level 0.
            let less = f64::from(facets.level(i)).exp2().recip();
            Size {
                level: facets.level(i),
                projected: projected * less * less,
                height: shape.height() * less,
                longest: shape.longest * less,
            }
        };
        Self { facets, edges, reduce, sizes: facets.kept.par_iter().map(size).collect() }
    }

    /// About as many surfels as rays with `spacing` make where no edge is sharp. A family of rays makes one for each
    /// spacing^2 of a triangle's projection. A thin triangle counts by its length, and each triangle takes some work.
    pub(super) fn estimate(&self, spacing: f64) -> f64 {
        self.of_levels(spacing).into_iter().sum()
    }

    /// The same of each level.
    fn of_levels(&self, spacing: f64) -> Vec<f64> {
        let count = |size: &Size| {
            let of_area = size.projected / spacing / spacing;
            if size.height < 0.5 * spacing { of_area.max(0.25 * size.longest / spacing) } else { of_area }
        };
        // Sums of whole chunks in their order do not depend on threads.
        let of_chunk = |chunk: &[Size]| {
            let mut sums = vec![0.0; self.facets.levels()];
            for size in chunk {
                sums[usize::from(size.level)] += count(size);
            }
            sums
        };
        let sums: Vec<Vec<f64>> = self.sizes.par_chunks(4096).map(of_chunk).collect();
        (0..self.facets.levels()).map(|level| sums.iter().map(|of_chunk| of_chunk[level]).sum()).collect()
    }

    /// The bands at sharp edges where the coarse spacing of level 0 is given, and about as many surfels as there are in
    /// all.
    ///
    /// The fine spacing is such that the band adds no more than a share of what there is without it. Where nearly all
    /// is band there is none: the surface is rough, and not a thing with outlines. Nor is there where edges are so many
    /// that they take longer than the sampling. Each level has a band of its own, or none.
    pub(super) fn bands(&self, coarse: f64) -> (Bands, f64) {
        let mut bands = Bands::none(coarse, self.facets.levels());
        let mut count = 0.0;
        let mut triangles = vec![0.0; self.facets.levels()];
        for size in &self.sizes {
            triangles[usize::from(size.level)] += 1.0;
        }
        for (level, all) in self.of_levels(coarse).into_iter().enumerate() {
            count += all;
            let most = (MOST_PARTS * (all + triangles[level])).max(FEW_PARTS);
            let Some(band) = bands.of(level as u8).with_edges(self.edges, level, most) else { continue };
            let within = raster::count(self.facets, level as u8, &band, band::reach(FINEST), self.reduce) as f64;
            // The fine grid takes the place of the coarse one within a part of the band.
            let replaced = band::coarse_from(FINEST) / band::reach(FINEST);
            let density = (replaced + MOST_AT_EDGES * all / within.max(1.0)).min(FINEST.powi(-2));
            if density.sqrt() * COARSEST >= 1.0 {
                bands.set(level, band.refined(density.sqrt().recip()));
                count += within * (density - replaced);
            }
        }
        (bands, count)
    }

    /// True if the spacing can be worked with.
    pub(super) fn allows(&self, spacing: f64) -> bool {
        spacing >= self.least() && self.estimate(spacing) <= MOST
    }

    /// The least spacing that a mesh can be sampled with.
    fn least(&self) -> f64 {
        self.facets.size.length() / MOST_CELLS
    }

    /// About the least spacing that is allowed.
    pub(super) fn finest(&self) -> f64 {
        self.without_band(MOST)
    }

    /// The spacing that makes about as many surfels where no edge is sharp.
    fn without_band(&self, surfels: f64) -> f64 {
        // At the diagonal of the box a handful of surfels is left.
        let (mut low, mut high) = (self.least(), self.facets.size.length());
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            if self.estimate(middle) > surfels { low = middle } else { high = middle }
        }
        high
    }

    /// The bands at sharp edges with which there are about `surfels` of them.
    pub(super) fn of_count(&self, surfels: f64) -> Bands {
        let first = self.without_band(surfels);
        let (mut spacing, mut last) = (first, f64::INFINITY);
        for _ in 0..TRIES {
            let (bands, count) = self.bands(spacing);
            let ratio = count / surfels;
            let off = ratio.ln().abs();
            if off < NEARLY {
                return bands;
            }
            if off > 0.9 * last {
                break;
            }
            last = off;
            // Counts fall with the square of the spacing or more slowly.
            spacing = (spacing * ratio.sqrt()).clamp(self.least(), self.facets.size.length());
        }
        // The count leaps where the band comes and goes.
        Bands::none(first, self.facets.levels())
    }

    /// The coarse spacing, or one that makes at least and at most so many surfels.
    pub(super) fn within(&self, spacing: f64, [least, most]: [f64; 2]) -> f64 {
        let without = self.estimate(spacing);
        if without >= least && without * (1.0 + MOST_AT_EDGES) <= most {
            return spacing;
        }
        let coarse = |count: f64| self.of_count(count).of(0).spacing(false);
        let finest = coarse(most);
        // What was counted without a band may have one.
        let excess = (self.bands(finest).1 / most).max(1.0);
        spacing.min(coarse(least)).max(finest * excess.sqrt())
    }
}
