//! Slabs of depth: which Gaussians are worked on together where all do not fit into memory.

use super::project::Projected;
use super::sorted::{CHUNK, key_of, tiles_listed};
use super::{BYTES, BYTES_UNLISTED, Run, TransparentGroup};

/// Depths as integers, with indices among all Gaussians of the frame: from the first, included, to the last, excluded.
/// `None`: no end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Slab {
    from: Option<u64>,
    to: Option<u64>,
}

impl Slab {
    pub(super) fn is_whole(&self) -> bool {
        self.from.is_none() && self.to.is_none()
    }

    /// Which splats lie in it.
    pub(super) fn holds(&self, projected: &Projected) -> Vec<bool> {
        let within = |rank: u64| self.from.is_none_or(|from| rank >= from) && self.to.is_none_or(|to| rank < to);
        projected.splats.iter().map(|splat| within(rank(splat.depth, splat.index))).collect()
    }
}

/// Drops the splats that are not `kept`.
pub(super) fn retain(kept: &[bool], projected: &mut Projected) {
    let Projected { splats, bounds, velocities } = projected;
    retain_of(kept, splats);
    retain_of(kept, bounds);
    retain_of(kept, velocities);
}

fn retain_of<T>(kept: &[bool], values: &mut Vec<T>) {
    let mut kept = kept.iter();
    values.retain(|_| kept.next().is_some_and(|kept| *kept));
}

fn rank(depth: f32, index: u32) -> u64 {
    u64::from(key_of(depth)) << 32 | u64::from(index)
}

/// The slabs of a group, the nearest first; one where all Gaussians fit. Depths are those of `sample`.
pub(super) fn slabs(group: &TransparentGroup<'_>, still: &[Run<'_>], moving: &[Run<'_>], sample: usize) -> Vec<Slab> {
    let count: usize = still.iter().chain(moving).map(|run| run.gaussians.len()).sum();
    let fit = (group.splat_bytes / BYTES) as usize;
    if count <= fit {
        return vec![Slab::default()];
    }
    let mut ranks = Vec::new();
    let mut projected = Projected::default();
    let mut touched = 0;
    for run in still.iter().chain(moving) {
        group.project_run(run, sample, group.several(), &mut projected);
        ranks.extend(projected.splats.iter().map(|splat| rank(splat.depth, splat.index)));
        touched += projected.bounds.iter().map(|&bounds| tiles_listed(bounds)).sum::<usize>();
    }
    // Lists take what splats touch on the mean, and twice that, as it differs from slab to slab.
    let of_lists = 2 * size_of::<u32>() * touched / ranks.len().max(1);
    let fit = group.splat_bytes as usize / (BYTES_UNLISTED + of_lists);
    ranks.sort_unstable();
    let cuts: Vec<u64> = ranks.chunks(fit.max(CHUNK)).skip(1).map(|slab| slab[0]).collect();
    let ends = cuts.iter().copied().map(Some).chain([None]);
    let starts = [None].into_iter().chain(cuts.iter().copied().map(Some));
    starts.zip(ends).map(|(from, to)| Slab { from, to }).collect()
}
