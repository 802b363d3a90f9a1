//! From a mesh to surfels: hits of a layered depth cube, painted (Pfister et al. 2000, section 5).

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::band::Bands;
use super::edges::Edges;
use super::facets::{Facets, Hit};
use super::fill::{self, Extra};
use super::fineness::{Fineness, divide};
use super::paint::Palette;
use super::spacing::Counted;
use super::{Mesh, Texture};
use super::{piles, raster};
use crate::model::options::{MeshOptions, Spacing};
use crate::model::surfels::{KeptLevels, Normalisation, Surfels, VelocityUnit};

/// Surfels of a mesh where nothing else decides.
const USUAL: f64 = 200_000.0;

/// How many times too many surfels all parts of a mesh share by wider spacings: by up to twice of what they need. Where
/// there are more, the nearest parts give way first: a camera at a wall would take all surfels for what it hardly sees.
const EXCESS: f64 = 4.0;

/// Least radius, model units: its square does not underflow in `f32`.
const SMALLEST: f64 = 1e-18;

/// Surfels that one task paints. Nothing depends on it.
const CHUNK: usize = 1024;

/// What sampling gives.
#[derive(Clone, Debug)]
pub(crate) struct Sampled {
    pub(crate) surfels: Surfels,
    /// Distance of the rays, model units.
    pub(crate) spacing: f64,
    pub(crate) notes: Vec<String>,
}

/// Why a mesh cannot be sampled.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unsampled {
    /// It has no triangle with an area.
    Flat {
        /// Triangles without one.
        triangles: usize,
    },
    /// The spacing is too small.
    Fine {
        /// What was given.
        spacing: f64,
        /// About the least one that is possible.
        least: f64,
    },
}

/// Samples a mesh. `radius_scale` is a factor on the radii. Without it the shadow of a surfel along its ray is a circle
/// of one spacing: the rays stand on a square grid, so shadows of .71 spacings would close it.
///
/// The result does not depend on the number of threads.
pub(crate) fn sample(mesh: &Mesh, options: &MeshOptions, radius_scale: f64) -> Result<Sampled, Unsampled> {
    let facets = Facets::new(mesh);
    if facets.kept.is_empty() {
        return Err(Unsampled::Flat { triangles: mesh.triangles.len() });
    }
    let edges = Edges::new(&facets);
    let counted = Counted::new(&facets, &edges, options.reduce);
    let bands = match options.spacing {
        Spacing::Of(given) if counted.allows(given) => counted.bands(given).0,
        Spacing::Of(given) => return Err(Unsampled::Fine { spacing: given, least: counted.finest() }),
        Spacing::Surfels(count) => counted.of_count(f64::from(count)),
        Spacing::Auto | Spacing::None => counted.of_count(USUAL),
    };
    Ok(sampled(&counted, &bands, &mesh.textures, radius_scale, About::new(&facets)))
}

/// Samples a mesh as finely as its parts need, with at least and at most about so many surfels. `None` if no triangle
/// has an area.
pub(crate) fn sample_as(
    mesh: &Mesh,
    fineness: &Fineness,
    surfels: [f64; 2],
    reduce: bool,
    radius_scale: f64,
) -> Option<Sampled> {
    let whole = Facets::new(mesh);
    if whole.kept.is_empty() {
        return None;
    }
    let about = About::new(&whole);
    // One spacing for all where surfels suffice for it: levels of detail take what is far.
    let uniform = fineness.of_box(whole.origin, whole.size);
    let edges = Edges::new(&whole);
    let counted = Counted::new(&whole, &edges, reduce);
    if counted.estimate(uniform) <= surfels[1] && counted.bands(uniform).1 <= surfels[1] {
        let spacing = counted.within(uniform, surfels);
        return Some(sampled(&counted, &counted.bands(spacing).0, &mesh.textures, radius_scale, about));
    }
    let divided = divide(&whole, fineness);
    let least = divided.least(&divided.projected(reduce), EXCESS * surfels[1]);
    let facets = Facets::new(&divided.mesh).with_levels(divided.levels(least));
    let edges = Edges::new(&facets);
    let counted = Counted::new(&facets, &edges, reduce);
    let spacing = counted.within(least, surfels);
    Some(sampled(&counted, &counted.bands(spacing).0, &mesh.textures, radius_scale, about))
}

/// Facts of a mesh before its triangles are halved.
#[derive(Clone, Copy)]
struct About {
    /// Triangles of the file.
    all: usize,
    kept: usize,
    repeated: usize,
    two_sided: bool,
}

impl About {
    fn new(facets: &Facets<'_>) -> Self {
        let (all, kept) = (facets.mesh.triangles.len(), facets.kept.len());
        let two_sided = facets.mesh.materials.iter().any(|material| material.two_sided) || facets.is_open();
        Self { all, kept, repeated: facets.repeated.len(), two_sided }
    }
}

fn sampled(counted: &Counted<'_>, bands: &Bands, textures: &[Texture], radius_scale: f64, about: About) -> Sampled {
    let Counted { facets, edges, reduce, .. } = *counted;
    let About { all, kept, repeated, two_sided } = about;
    let mut notes = Vec::new();
    let dropped = all - kept - repeated;
    if dropped > 0 {
        notes.push(format!("{dropped} of {all} triangles dropped: without an area"));
    }
    let spacing = |hit: &Hit| bands.of(facets.level(hit.triangle)).spacing(hit.fine);
    let radii = bands.levels().map(|band| [false, true].map(|fine| band.spacing(fine) * radius_scale));
    let palette = Palette::new(facets, textures, radii.collect());
    let (mut hits, rays) = raster::hits(facets, bands, reduce);
    let merged = piles::merge(facets, &palette, bands, &mut hits, &rays);
    drop(rays);
    if merged + repeated > 0 {
        notes.push(format!(
            "merged what coincides: {repeated} triangles that repeat another, {merged} surfels of one ray, plane and \
             colour"
        ));
    }
    hits.par_chunks_mut(CHUNK).for_each(|hits| {
        for run in hits.chunk_by_mut(|a, b| a.triangle == b.triangle) {
            let shape = facets.shape(run[0].triangle);
            for hit in run {
                *hit = edges.moved(*hit, &shape, spacing(hit));
            }
        }
    });
    let mut position: Vec<Vec3> = positions(facets, &hits);
    let extras = fill::extras(facets, edges, bands, &hits, &position);
    let rays = hits.len();
    hits.extend(extras.iter().map(|extra| extra.hit));
    position.extend(extras.iter().map(|extra| extra.position.as_vec3()));
    let surfels = painted(&palette, &hits, position);
    let mut surfels = Surfels { origin: facets.origin, two_sided, ..surfels };
    for (i, Extra { hit, radius: own, .. }) in (rays..).zip(&extras) {
        let spacing = spacing(hit);
        let ratio = (own / spacing).max(SMALLEST / spacing).min(1.0) as f32;
        surfels.axis_u[i] *= ratio;
        surfels.axis_v[i] *= ratio;
    }
    drop_cut_out(&mut surfels);
    let at_edges = hits.iter().filter(|hit| hit.fine).count();
    let nearest = bands.of(0);
    let [coarse, fine] = [false, true].map(|fine| nearest.spacing(fine));
    let finer = format!(", {at_edges} of them {:.2} times finer at sharp edges", coarse / fine);
    let farther = bands.levels().last().map_or(coarse, |band| band.spacing(false));
    notes.push(format!(
        "{kept} triangles sampled with spacing {coarse:.4e}{}: {} surfels{}, {}",
        if farther > coarse { format!(" to {farther:.4e}, by their distances") } else { String::new() },
        surfels.len(),
        if at_edges > 0 { finer.as_str() } else { "" },
        if two_sided { "both sides show (open, or two-sided materials)" } else { "one-sided (closed)" }
    ));
    Sampled { surfels, spacing: coarse, notes }
}

fn positions(facets: &Facets<'_>, hits: &[Hit]) -> Vec<Vec3> {
    let mut position = vec![Vec3::ZERO; hits.len()];
    position.par_chunks_mut(CHUNK).zip(hits.par_chunks(CHUNK)).for_each(|(position, hits)| {
        let mut at = 0;
        for run in hits.chunk_by(|a, b| a.triangle == b.triangle) {
            let shape = facets.shape(run[0].triangle);
            for hit in run {
                position[at] = hit.position(&shape.corner).as_vec3();
                at += 1;
            }
        }
    });
    position
}

/// Columns of the painted hits. A surfel that is cut out has the opacity -1.
fn painted(palette: &Palette<'_>, hits: &[Hit], position: Vec<Vec3>) -> Surfels {
    let count = hits.len();
    let [mut axis_u, mut axis_v, mut normal, mut colour] = [(); 4].map(|()| vec![Vec3::ZERO; count]);
    let mut opacity = vec![1.0_f32; count];
    (
        hits.par_chunks(CHUNK),
        axis_u.par_chunks_mut(CHUNK),
        axis_v.par_chunks_mut(CHUNK),
        normal.par_chunks_mut(CHUNK),
        colour.par_chunks_mut(CHUNK),
        opacity.par_chunks_mut(CHUNK),
    )
        .into_par_iter()
        .for_each(|(hits, axis_u, axis_v, normal, colour, opacity)| {
            let mut at = 0;
            for run in hits.chunk_by(Hit::is_beside) {
                let brush = palette.brush(run[0].triangle, run[0].fine);
                let radius = palette.radius(run[0].triangle, run[0].fine).max(SMALLEST) as f32;
                for hit in run {
                    let dab = brush.dab(hit);
                    [axis_u[at], axis_v[at]] = dab.axes.map(|axis| axis * radius);
                    normal[at] = dab.normal;
                    colour[at] = dab.colour;
                    opacity[at] = dab.opacity.unwrap_or(-1.0);
                    at += 1;
                }
            }
        });
    Surfels {
        origin: DVec3::ZERO,
        position,
        axis_u,
        axis_v,
        normal,
        colour,
        opacity,
        material: Vec::new(),
        velocity: Vec::new(),
        id: Vec::new(),
        acceleration: Vec::new(),
        velocity_unit: VelocityUnit::Second,
        normalisation: Normalisation::default(),
        levels: KeptLevels::default(),
        two_sided: false,
        signs_estimated: false,
        spheres: false,
    }
}

/// Drops surfels that are cut out, and a column of opacities that are all as good as 1.
fn drop_cut_out(surfels: &mut Surfels) {
    let kept: Vec<bool> = surfels.opacity.iter().map(|opacity| *opacity >= 0.0).collect();
    if kept.contains(&false) {
        let s = &mut *surfels;
        for column in [&mut s.position, &mut s.axis_u, &mut s.axis_v, &mut s.normal, &mut s.colour] {
            keep(column, &kept);
        }
        keep(&mut s.opacity, &kept);
    }
    if surfels.opacity.iter().all(|opacity| *opacity >= 254.0 / 255.0) {
        surfels.opacity = Vec::new();
    }
}

fn keep<T>(column: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    column.retain(|_| kept.next() == Some(&true));
}
