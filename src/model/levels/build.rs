//! Builds the tree: nodes from the top, merged surfels from the bottom.

use std::ops::Range;

use glam::{IVec3, Mat3, Vec3};
use rayon::prelude::*;

use super::grid::Grid;
use super::merge::{AGREE, Disc, Merger};
use super::octree::{Draft, FEW, drafts, shift};
use super::rims::Occupied;
use super::{Levels, Node, Rates};
use crate::model::order::{BITS, morton_codes};
use crate::model::surfels::Surfels;

/// Discs of a cell, in the mean, from which on a cell within a surface is hardly ever empty.
const SEVERAL: usize = 2;

impl Levels {
    /// The tree of surfels along their Morton curve ([`Surfels::spatially_ordered`]). `None` where they do not lie so,
    /// are too few for any level, or have sizes that cannot be merged.
    pub(crate) fn of(surfels: &Surfels) -> Option<Self> {
        if surfels.len() <= FEW || u32::try_from(surfels.len()).is_err() {
            return None;
        }
        let codes: Vec<u64> = morton_codes(&surfels.position).into_iter().map(|(code, _)| code).collect();
        if !codes.is_sorted() {
            return None;
        }
        let [low, high] = surfels
            .position
            .iter()
            .fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], &place| [low.min(place), high.max(place)]);
        let grid = Grid::new(low, (high - low).max_element() / ((1_u32 << BITS) - 1) as f32);
        let (drafts, depths) = drafts(&codes, FEW);
        let occupied = occupied(surfels, &codes, &drafts, &grid);
        let mut nodes: Vec<Node> = Vec::new();
        nodes.resize(drafts.len(), Node::default());
        let mut merged = Merged {
            of: Surfels { origin: surfels.origin, ..Surfels::default() },
            share: Vec::new(),
            alike: Vec::new(),
        };
        // The merged discs of the nodes of the depth below, which are many and large: no others are held.
        let (mut first_below, mut all_below): (usize, Vec<Vec<Disc>>) = (drafts.len(), Vec::new());
        for depth in depths.into_iter().rev() {
            let made: Vec<(Node, Vec<Disc>)> = depth
                .clone()
                .into_par_iter()
                .map(|i| {
                    let draft = &drafts[i];
                    if draft.children.is_empty() {
                        let discs: Vec<Disc> = draft.leaves.clone().map(|i| Disc::of(surfels, i)).collect();
                        return (leaf(draft, &discs), Vec::new());
                    }
                    let children = draft.children.start as usize..draft.children.end as usize;
                    let mut below = Vec::new();
                    for child in children.clone() {
                        if drafts[child].children.is_empty() {
                            below.extend(drafts[child].leaves.clone().map(|i| Disc::of(surfels, i)));
                        } else {
                            below.extend_from_slice(&all_below[child - first_below]);
                        }
                    }
                    let cells = occupied.partition_point(|cells| cells.shift < shift(draft.bits));
                    let own = merge_cells(&below, draft.bits, &grid, &occupied[cells]);
                    (inner(draft, &nodes[children], &own, &grid), own)
                })
                .collect();
            first_below = depth.start;
            all_below.clear();
            for (i, (node, own)) in depth.zip(made) {
                nodes[i] = node;
                if !nodes[i].is_leaf() {
                    nodes[i].surfels = merged.add(&own, surfels)?;
                }
                all_below.push(own);
            }
        }
        merged.shrink();
        Some(Self { nodes, merged: merged.of, share: merged.share, alike: merged.alike })
    }
}

/// The merged surfels so far: those of a node one after the other, those of deeper nodes first.
struct Merged {
    of: Surfels,
    share: Vec<f32>,
    alike: Vec<f32>,
}

impl Merged {
    /// Adds the surfels of a node, with the columns that the model has, and gives their range. `None` if one has no
    /// area, or a number is not finite.
    fn add(&mut self, discs: &[Disc], model: &Surfels) -> Option<Range<u32>> {
        let start = self.share.len() as u32;
        for disc in discs {
            let area = disc.axis_u.cross(disc.axis_v).length();
            let finite = [disc.position, disc.axis_u, disc.axis_v, disc.normal, disc.rates[0], disc.rates[1]]
                .iter()
                .all(|v| v.is_finite());
            if !finite || area.is_nan() || area <= 0.0 {
                return None;
            }
            let of = &mut self.of;
            of.position.push(disc.position);
            of.axis_u.push(disc.axis_u);
            of.axis_v.push(disc.axis_v);
            of.normal.push(disc.normal);
            of.colour.push(disc.colour);
            if !model.opacity.is_empty() {
                of.opacity.push(disc.opacity);
            }
            let [velocity, acceleration] = disc.rates;
            if !model.velocity.is_empty() {
                of.velocity.push(velocity);
            }
            if !model.acceleration.is_empty() {
                of.acceleration.push(acceleration);
            }
            if !model.material.is_empty() {
                of.material.push(disc.material);
            }
            self.share.push(disc.area / area);
            self.alike.push(disc.alike());
        }
        Some(start..start + discs.len() as u32)
    }

    /// Gives back what columns have grown beyond their length.
    fn shrink(&mut self) {
        let of = &mut self.of;
        let columns = [&mut of.position, &mut of.axis_u, &mut of.axis_v, &mut of.normal, &mut of.colour];
        columns.into_iter().chain([&mut of.velocity, &mut of.acceleration]).for_each(Vec::shrink_to_fit);
        of.opacity.shrink_to_fit();
        of.material.shrink_to_fit();
        self.share.shrink_to_fit();
        self.alike.shrink_to_fit();
    }
}

/// The cells that hold discs, of rising sizes: those of all nodes, but where cells are so small that many are empty
/// within a surface.
fn occupied(surfels: &Surfels, codes: &[u64], drafts: &[Draft], grid: &Grid) -> Vec<Occupied> {
    let mut shifts: Vec<u32> =
        drafts.iter().filter(|draft| !draft.children.is_empty()).map(|draft| shift(draft.bits)).collect();
    shifts.sort_unstable();
    shifts.dedup();
    let holds_several = |shift: &u32| {
        let cells = codes.chunk_by(|a, b| a >> (3 * shift) == b >> (3 * shift)).count();
        SEVERAL * cells <= codes.len()
    };
    let most = shifts.last().copied();
    shifts.retain(|shift| Some(*shift) == most || holds_several(shift));
    let mut occupied: Vec<Occupied> = Vec::new();
    for shift in shifts {
        let next = match occupied.last() {
            Some(finer) => finer.coarser(shift),
            None => Occupied::of(surfels, grid, shift),
        };
        occupied.push(next);
    }
    occupied
}

/// Merges discs with like fronts in the cells of a node whose edge is 2 to `bits`.
fn merge_cells(below: &[Disc], bits: u32, grid: &Grid, occupied: &Occupied) -> Vec<Disc> {
    let (shift, edge) = (shift(bits), grid.edge(shift(bits)));
    let cell = |disc: &Disc| {
        let IVec3 { x, y, z } = grid.place(disc.position, shift);
        [z, y, x]
    };
    let mut order: Vec<([i32; 3], u32)> = below.iter().zip(0..).map(|(disc, i)| (cell(disc), i)).collect();
    order.sort_unstable();
    let (mut own, mut merger) = (Vec::new(), Merger::default());
    // Sums of fronts, and the discs of each. Those of the cells before are used again.
    let mut groups: Vec<(Vec3, Vec<&Disc>)> = Vec::new();
    for of_cell in order.chunk_by(|a, b| a.0 == b.0) {
        let mut count = 0;
        for (_, i) in of_cell {
            let disc = &below[*i as usize];
            let front = disc.front();
            let same = |(of_group, _): &(Vec3, _)| of_group.dot(front) >= AGREE * of_group.length();
            let group = groups[..count].iter().position(same).unwrap_or(count);
            if group == count {
                count += 1;
                if group == groups.len() {
                    groups.push((Vec3::ZERO, Vec::new()));
                }
                groups[group].0 = Vec3::ZERO;
                groups[group].1.clear();
            }
            groups[group].0 += front * disc.area;
            groups[group].1.push(disc);
        }
        own.extend(groups[..count].iter().map(|(_, discs)| {
            let (mut disc, outline) = merger.merge(discs, edge);
            disc.contrast = occupied.contrast(&disc, grid);
            if disc.contrast < 1.0 {
                outline.widen(&mut disc, edge);
            }
            disc
        }));
    }
    own
}

/// The box around boxes, each by its corners.
fn around(boxes: impl Iterator<Item = [Vec3; 2]>) -> [Vec3; 2] {
    boxes.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], [a, b]| [low.min(a), high.max(b)])
}

fn leaf(draft: &Draft, discs: &[Disc]) -> Node {
    let corners = around(discs.iter().map(|disc| [disc.position - disc.extent(), disc.position + disc.extent()]));
    let rates = [0, 1].map(|order| {
        let own = || discs.iter().map(|disc| disc.rates[order]);
        let mean = own().map(|rate| rate / discs.len() as f32).sum();
        Rates { corners: around(own().map(|rate| [rate, rate])), mean, stray: 0.0 }
    });
    Node { corners, rates, surfels: draft.leaves.start as u32..draft.leaves.end as u32, ..Node::default() }
}

fn inner(draft: &Draft, children: &[Node], own: &[Disc], grid: &Grid) -> Node {
    let area: f32 = own.iter().map(|disc| disc.area).sum();
    let mean = |of: fn(&Disc) -> f32| own.iter().map(|disc| of(disc) * (disc.area / area)).sum::<f32>();
    // Few of them may be where it shows how far they reach.
    let weights = || own.iter().map(|disc| disc.contrast * disc.contrast);
    let reach = own.iter().zip(weights()).map(|(disc, weight)| weight * disc.reach()).sum::<f32>()
        / weights().sum::<f32>().max(f32::MIN_POSITIVE);
    let axis = own.iter().map(|disc| disc.front() * (disc.area / area)).sum::<Vec3>().normalize_or_zero();
    let changes: Mat3 = own.iter().map(|disc| disc.changes * (disc.area / area)).sum();
    let rates = [0, 1].map(|order| {
        let mean = own.iter().map(|disc| disc.rates[order] * (disc.area / area)).sum();
        let stray = own.iter().map(|disc| disc.strays[order] * (disc.area / area)).sum::<f32>().sqrt();
        Rates { corners: around(children.iter().map(|child| child.rates[order].corners)), mean, stray }
    });
    let trace = changes.x_axis.x + changes.y_axis.y + changes.z_axis.z;
    Node {
        corners: around(children.iter().map(|child| child.corners)),
        axis,
        spacing: grid.edge(shift(draft.bits)),
        deviation: (mean(|disc| disc.deviation) + reach).sqrt(),
        rest: mean(Disc::rest).sqrt(),
        turns: mean(Disc::turns).sqrt(),
        along: if trace > 0.0 { changes * trace.recip() } else { Mat3::ZERO },
        rates,
        surfels: 0..0,
        children: draft.children.clone(),
    }
}
