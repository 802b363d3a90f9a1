//! The hierarchies of one model, whose surfels may move by themselves.
//!
//! A surfel at rest in its model has one box. One that moves has a box that moves with it: its sides go from where they
//! are at the start of a span of time to where they are at its end, with constant speed, as in hierarchies for motion
//! blur (Hou et al. 2010, "Micropolygon ray tracing with defocus and motion blur"; Wald et al. 2014, "Embree"). That is
//! tight where neighbours move together on straight paths. Where they part, or their paths bend, boxes get long: the
//! span is cut into equal slices, each with a hierarchy of its own, as temporal splits do (Woop, Áfra and Benthin 2017,
//! "STBVH"). How often is found for groups of neighbours, so that what rests costs no memory for what is fast. A ray
//! goes through one slice of each level of cuts.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::boxes::{above, below, corners, moved};
use super::bvh::{Bvh, LEAF, WIDTH};
use super::traverse::{Found, ModelRay, Waiting, traverse};
use crate::model::Surfels;
use crate::model::disc_tree;
use crate::model::mesh::MeshSurface;
use crate::model::paths::{Paths, elapsed};

/// Slices of the span that a level may have.
const SLICES: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Neighbours that are cut alike.
const GROUP: usize = 8;

/// Boxes of groups may grow within a slice by this share of their size.
const GROWTH: f64 = 1.0;

/// Entries of hierarchies that surfels may always have, and how many for each surfel where that is more.
const ENTRIES: usize = 1 << 22;
const ENTRIES_EACH: usize = 4;

/// Rays that an entry is worth: one takes about as long as the building of an entry.
const RAYS_AN_ENTRY: u64 = 2;

/// The hierarchies of one model.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy<'a> {
    levels: Vec<Level<'a>>,
    /// Times of the first slice's start and of the last one's end.
    span: [f64; 2],
}

/// Hierarchies of some surfels for equal slices of the span, in the order of time.
type Level<'a> = Vec<Bvh<'a>>;

/// Adds up shares of work that several threads do, and tells the sum.
pub(super) struct Shares<'t> {
    /// In millionths of `whole`.
    done: AtomicU64,
    whole: f64,
    told: &'t (dyn Fn(f64) + Sync),
}

impl<'t> Shares<'t> {
    /// `told` hears shares of `whole`, 0 to 1.
    pub(super) const fn new(whole: f64, told: &'t (dyn Fn(f64) + Sync)) -> Self {
        Self { done: AtomicU64::new(0), whole, told }
    }

    /// So much more is done.
    pub(super) fn add(&self, more: f64) {
        let more = (more / self.whole * 1e6).round() as u64;
        let done = self.done.fetch_add(more, Ordering::Relaxed) + more;
        (self.told)((done as f64 / 1e6).min(1.0));
    }
}

/// Number of slices, and the surfels that move in each.
type Cut = (usize, Vec<u32>);

impl<'a> Hierarchy<'a> {
    /// The hierarchies of surfels that move along `paths`, for times in `range`. Building them should be worth it for
    /// this number of rays. Finished shares are told; once it is stopped, they hold only a part.
    pub(super) fn new(
        surfels: &Surfels,
        paths: &Paths<'_>,
        ([from, to], rays): ([f64; 2], u64),
        (told, stopped): (&(dyn Fn(f64) + Sync), &(dyn Fn() -> bool + Sync)),
    ) -> Self {
        if paths.is_empty() {
            let levels = vec![vec![Bvh::of_surfels(surfels)]];
            told(1.0);
            return Self { levels, span: [0.0; 2] };
        }
        let span = [from.min(to), from.max(to)];
        let cuts = cuts(surfels, paths, span, rays);
        let entries: usize = cuts.iter().map(|(slices, members)| slices * members.len()).sum();
        let build = |(slices, members): &Cut| {
            let build = |at: usize| {
                let members = if stopped() { &[] } else { members.as_slice() };
                let edges = [at, at + 1].map(|at| edge(span, *slices, at));
                let bvh = Bvh::of_moving(surfels, paths, members, edges);
                told(members.len() as f64 / entries as f64);
                bvh
            };
            (0..*slices).into_par_iter().map(build).collect()
        };
        Self { levels: cuts.par_iter().map(build).collect(), span }
    }

    /// The hierarchy of the triangles of a mesh, relative to `origin`.
    pub(super) fn of_triangles(surface: MeshSurface<'a>, origin: DVec3) -> Self {
        Self { levels: vec![vec![Bvh::of_triangles(surface, origin)]], span: [0.0; 2] }
    }

    /// The triangles that it holds; `None`: it holds surfels.
    pub(super) fn surface(&self) -> Option<&MeshSurface<'a>> {
        self.levels.first()?.first()?.surface.as_ref()
    }

    /// Memory of all, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.levels.iter().flatten().map(Bvh::bytes).sum()
    }

    /// As [`traverse`], of all surfels at the times of the rays.
    pub(super) fn meet(&self, rays: &[ModelRay], found: &mut [Found], stack: &mut Vec<Waiting>) {
        self.each(rays, |bvh, times| traverse(bvh, rays, times, found, stack));
    }

    /// Calls `go` with each hierarchy that rays go through, and the times of those that do.
    #[inline(always)]
    fn each(&self, rays: &[ModelRay], mut go: impl FnMut(&Bvh<'_>, [f64; 2])) {
        let (first, last) = rays
            .iter()
            .map(|ray| ray.elapsed[0])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), time| (first.min(time), last.max(time)));
        for level in &self.levels {
            if let [whole] = &level[..] {
                go(whole, [f64::NEG_INFINITY, f64::INFINITY]);
                continue;
            }
            let (first, last) = (self.slice(level.len(), first), self.slice(level.len(), last));
            for (at, bvh) in level.iter().enumerate().take(last + 1).skip(first) {
                go(bvh, self.times(level.len(), at));
            }
        }
    }

    /// Number of the slice that a time is in.
    fn slice(&self, slices: usize, time: f64) -> usize {
        let [from, to] = self.span;
        // The cast takes NaN and what is before the span to 0.
        let mut slice = (((time - from) / (to - from) * slices as f64) as usize).min(slices - 1);
        // Rounding may have taken it beside its slice.
        while slice > 0 && time < edge(self.span, slices, slice) {
            slice -= 1;
        }
        while slice + 1 < slices && time >= edge(self.span, slices, slice + 1) {
            slice += 1;
        }
        slice
    }

    /// The times of a slice. The first and the last one have what rounding takes out of the span.
    fn times(&self, slices: usize, slice: usize) -> [f64; 2] {
        let [start, end] = [slice, slice + 1].map(|at| edge(self.span, slices, at));
        [if slice == 0 { f64::NEG_INFINITY } else { start }, if slice + 1 == slices { f64::INFINITY } else { end }]
    }

    /// Centre and radius of a sphere around all at the times of the span from one to another.
    pub(super) fn sphere(&self, [from, to]: [f64; 2]) -> (DVec3, f64) {
        if let Some(rigid) = self.levels.iter().flatten().next().filter(|bvh| bvh.drifts.is_empty()) {
            return (rigid.centre, rigid.radius);
        }
        let [from, to] = [from.min(to), from.max(to)];
        let mut boxes = Vec::new();
        for level in &self.levels {
            let [first, last] = [from, to].map(|time| self.slice(level.len(), time));
            level[first..=last].iter().for_each(|bvh| outline(bvh, [from, to], &mut boxes));
        }
        let (low, high) =
            boxes.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |sum, b| (sum.0.min(b[0]), sum.1.max(b[1])));
        if !low.cmple(high).all() {
            return (DVec3::ZERO, 0.0);
        }
        let centre = 0.5 * (low + high);
        let farthest = boxes.iter().map(|b| (b[1] - centre).max(centre - b[0]).length_squared()).fold(0.0, f64::max);
        (centre, farthest.sqrt() * (1.0 + 1e-9))
    }
}

/// Time of the edge before slice `at` of equal slices.
fn edge([from, to]: [f64; 2], slices: usize, at: usize) -> f64 {
    if at == slices { to } else { from + (to - from) * (at as f64 / slices as f64) }
}

/// Adds boxes that hold all of a hierarchy between two times: those of its upper two levels of nodes.
fn outline(bvh: &Bvh<'_>, times: [f64; 2], out: &mut Vec<[DVec3; 2]>) {
    let length = bvh.span[1] - bvh.span[0];
    let share = |time: f64| if length > 0.0 { ((time - bvh.span[0]) / length).clamp(0.0, 1.0) } else { 0.0 };
    // A little more, for the rounding to f32.
    let shares = [below(share(times[0])), above(share(times[1]))];
    let mut add = |node: usize, is_open: &mut dyn FnMut(u32) -> bool| {
        let sides = moved(&bvh.nodes[node].sides, &bvh.drifts[node], shares);
        for slot in 0..WIDTH {
            let [low, high] = corners(&sides, slot).map(|corner| Vec3::from_array(corner).as_dvec3());
            if low.x <= high.x && !is_open(bvh.nodes[node].children[slot]) {
                out.push([low, high]);
            }
        }
    };
    if bvh.nodes.is_empty() {
        return;
    }
    let mut inner = Vec::new();
    add(0, &mut |child| {
        let is_node = child & LEAF == 0;
        inner.extend(is_node.then_some(child as usize));
        is_node
    });
    for node in inner {
        add(node, &mut |_| false);
    }
}

/// Into how many slices the span is cut for which surfels: as many as keep boxes around neighbours short, as far as
/// memory and the number of rays allow.
fn cuts(surfels: &Surfels, paths: &Paths<'_>, span: [f64; 2], rays: u64) -> Vec<Cut> {
    let middle = elapsed(0.5 * (span[0] + span[1]));
    let all = 0..surfels.len();
    let place: Vec<DVec3> =
        all.clone().into_par_iter().map(|i| paths.exact_place(surfels.position[i], i, middle)).collect();
    let reach: Vec<f32> =
        all.into_par_iter().map(|i| surfels.axis_u[i].length().max(surfels.axis_v[i].length())).collect();
    let order = disc_tree::order(&place.par_iter().map(|place| place.as_vec3()).collect::<Vec<_>>(), &reach);
    let needed = |group: &[u32]| {
        let mut places = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let mut ways = places;
        let (mut largest, mut bend) = (0.0_f64, 0.0_f64);
        let widen = |[low, high]: &mut [DVec3; 2], p: DVec3| (*low, *high) = (low.min(p), high.max(p));
        for i in group.iter().map(|&i| i as usize) {
            let [start, end] = span.map(|time| paths.exact_place(surfels.position[i], i, elapsed(time)));
            widen(&mut places, place[i]);
            widen(&mut ways, end - start);
            largest = largest.max(f64::from(reach[i]));
            bend = bend.max(paths.bend(i, span).max_element());
        }
        let allowed = GROWTH * ((places[1] - places[0]).max_element() + 2.0 * largest);
        let spread = (ways[1] - ways[0]).max_element();
        // What parts with constant speed parts less in a shorter time, and what bends by its square.
        let fits = |slices: &usize| {
            let slices = *slices as f64;
            spread <= allowed * slices && 2.0 * bend <= allowed * slices * slices
        };
        SLICES.iter().position(fits).unwrap_or(SLICES.len() - 1)
    };
    let needs: Vec<usize> = order.par_chunks(GROUP).map(needed).collect();
    let mut levels: [Vec<u32>; SLICES.len()] = Default::default();
    for (group, need) in order.chunks(GROUP).zip(needs) {
        levels[need].extend(group);
    }
    let most = ENTRIES.max(ENTRIES_EACH * surfels.len()).min((rays / RAYS_AN_ENTRY) as usize);
    fewer(&mut levels, most);
    SLICES.into_iter().zip(levels).filter(|(_, members)| !members.is_empty()).collect()
}

/// Moves surfels to lower levels until all together have at most so many entries, and to higher ones where that costs
/// little: each level takes rays time.
fn fewer(levels: &mut [Vec<u32>; SLICES.len()], most: usize) {
    let entries = |levels: &[Vec<u32>]| levels.iter().zip(SLICES).map(|(level, slices)| level.len() * slices).sum();
    for high in (1..SLICES.len()).rev() {
        if entries(levels) <= most {
            break;
        }
        let moved = std::mem::take(&mut levels[high]);
        levels[high - 1].extend(moved);
    }
    for low in 0..SLICES.len() - 1 {
        let Some(next) = (low + 1..SLICES.len()).find(|&next| !levels[next].is_empty()) else { break };
        let all: usize = entries(levels);
        let more = levels[low].len() * (SLICES[next] - SLICES[low]);
        if all + more <= most && (more <= all / 4 || all + more <= most / 8) {
            let moved = std::mem::take(&mut levels[low]);
            levels[next].extend(moved);
        }
    }
}

#[cfg(test)]
mod tests;
