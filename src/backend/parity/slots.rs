//! What slots of a batch hold: the CPU's splats and lists, in the device's order, and their comparison with the
//! device's.

use bytemuck::Pod;

use super::compare::{Tally, largest};
use super::harness::{Harness, WIDE};
use super::posed::Posed;
use crate::backend::cpu::published::LowPassSplat;
use crate::backend::gpu::layout::{TILE, WIDEST};
use crate::backend::gpu::slots::Slot;
use crate::layout::{EwaSplat, FilteredSplat, Splat, SweptFilter, SweptSplat};

/// What a slot may hold.
pub(super) trait Slotted: Pod {
    /// The pixels whose tiles list it.
    fn bounds(&self) -> [u16; 4];
    /// All bounds.
    fn all_bounds(&self) -> Vec<[u16; 4]> {
        vec![self.bounds()]
    }
    fn surfel(&self) -> u32;
    /// The same, with the number of its segment among its flags.
    fn with_segment(self, segment: u32) -> Self;
    /// What must be equal, and floats, each with the scale of its rounding.
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>);
}

impl Slotted for Splat {
    fn bounds(&self) -> [u16; 4] {
        self.bounds
    }
    fn surfel(&self) -> u32 {
        self.surfel
    }
    fn with_segment(self, segment: u32) -> Self {
        Self { flags: self.flags | segment << 1, ..self }
    }
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>) {
        let Self { reference, inverse_depth, u, v, centre_depth, .. } = *self;
        let skew = skew(u, v);
        let floats = vec![reference.to_vec(), inverse_depth.to_vec(), u.to_vec(), v.to_vec(), vec![centre_depth]];
        let with_scale = |part: Vec<f32>| {
            let scale = largest(&part) * skew;
            (part, scale)
        };
        ([self.surfel, self.flags], floats.into_iter().map(with_scale).collect())
    }
}

impl Slotted for LowPassSplat {
    fn bounds(&self) -> [u16; 4] {
        self.0.bounds
    }
    fn surfel(&self) -> u32 {
        self.0.surfel
    }
    fn with_segment(self, segment: u32) -> Self {
        Self(self.0.with_segment(segment))
    }
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>) {
        self.0.parts()
    }
}

impl Slotted for EwaSplat {
    fn bounds(&self) -> [u16; 4] {
        self.listed_bounds
    }
    fn all_bounds(&self) -> Vec<[u16; 4]> {
        vec![self.listed_bounds, self.filtered_bounds, self.disc.bounds]
    }
    fn surfel(&self) -> u32 {
        self.disc.surfel
    }
    fn with_segment(self, segment: u32) -> Self {
        Self { disc: self.disc.with_segment(segment), ..self }
    }
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>) {
        let Self { disc, u, v, shrink, p, peak, weight, crossing, .. } = *self;
        let ([surfel, flags], mut floats) = disc.parts();
        // The forms are quotients of what the disc's are made of.
        let skew = skew(disc.u, disc.v);
        floats.extend([u.to_vec(), v.to_vec(), shrink.to_vec(), p.to_vec(), vec![peak, weight]].map(|part| {
            let scale = largest(&part) * skew;
            (part, scale)
        }));
        ([surfel, flags << 1 | crossing], floats)
    }
}

impl Slotted for SweptSplat {
    fn bounds(&self) -> [u16; 4] {
        self.bounds
    }
    fn surfel(&self) -> u32 {
        self.surfel
    }
    fn with_segment(self, segment: u32) -> Self {
        Self { flags: self.flags | segment << 3, ..self }
    }
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>) {
        let Self { reference, inverse_depth, u, v, u_rate, v_rate, motion, ends, .. } = *self;
        // Rates are differences of products of what the forms are made of.
        let rate = largest(&u).max(largest(&v)).max(1.0) * largest(&motion).max(1.0);
        let skew = skew(u, v);
        let mut floats = vec![
            (reference.to_vec(), largest(&reference)),
            (inverse_depth.to_vec(), largest(&inverse_depth) * skew),
            (u.to_vec(), largest(&u) * skew),
            (v.to_vec(), largest(&v) * skew),
            (u_rate.to_vec(), largest(&u_rate).max(rate) * skew),
            (v_rate.to_vec(), largest(&v_rate).max(rate) * skew),
            (motion.to_vec(), largest(&motion)),
        ];
        floats.extend(ends.map(|end| (end.to_vec(), largest(&end))));
        ([self.surfel, self.flags], floats)
    }
}

impl Slotted for FilteredSplat {
    fn bounds(&self) -> [u16; 4] {
        self.splat.bounds
    }
    fn surfel(&self) -> u32 {
        self.splat.surfel
    }
    fn with_segment(self, segment: u32) -> Self {
        Self { splat: self.splat.with_segment(segment), ..self }
    }
    fn parts(&self) -> ([u32; 2], Vec<(Vec<f32>, f32)>) {
        let SweptFilter { inverse_depth, u, v, u_rate, v_rate, k, peak, weight, coverage } = self.filtered;
        let ([surfel, flags], mut floats) = self.splat.parts();
        // What the forms are made of is that of the splat's.
        let skew = skew(self.splat.u, self.splat.v);
        let motion = largest(&self.splat.motion).max(1.0);
        let rate = largest(&u).max(largest(&v)).max(1.0) * motion;
        floats.extend([
            (inverse_depth.to_vec(), largest(&inverse_depth) * skew),
            (u.to_vec(), largest(&u) * skew),
            (v.to_vec(), largest(&v) * skew),
            (u_rate.to_vec(), largest(&u_rate).max(rate) * skew),
            (v_rate.to_vec(), largest(&v_rate).max(rate) * skew),
            (vec![k], k.abs().max(largest(&inverse_depth) * motion) * skew),
            (vec![peak, weight, coverage], weight.max(peak).max(coverage) * skew),
        ]);
        ([surfel, flags << 1 | u32::from(self.filtered.is_unfiltered())], floats)
    }
}

/// How much a splat's forms magnify rounding: the product of the lengths of its axes on the screen over their area. It
/// is large for a splat that is seen nearly edge-on.
fn skew(u: [f32; 3], v: [f32; 3]) -> f32 {
    let area = (u[0] * v[1] - u[1] * v[0]).abs();
    (u[0].hypot(u[1]) * v[0].hypot(v[1]) / area.max(1e-30)).max(1.0)
}

/// The CPU's splats by slot, and their lists.
pub(super) struct Slots<S> {
    pub splats: Vec<Option<S>>,
    /// Tiles of each slot's splat, or [`WIDE`].
    touched: Vec<u32>,
    starts: Vec<u32>,
    list: Vec<u32>,
    pub wide: Vec<u32>,
}

impl<S: Slotted> Slots<S> {
    /// The slots of the batch. Lists are those of `tiles`.
    pub(super) fn new(harness: &Harness<'_>, tiles: &[[usize; 2]], posed: &[Posed<'_, S>]) -> Self {
        let (batch, wants) = (&harness.batch, |tile| harness.wants(tile));
        let slots = batch.slots as usize;
        let mut splats = vec![None; slots];
        for (segment, object, _) in &batch.segments {
            let first = segment.buffer_start + segment.first_surfel;
            let surfels = first..first + segment.surfels;
            let sample = (segment.flags >> 3).saturating_sub(1) as usize;
            let all = posed.iter().find(|posed| (posed.chunk.sample, posed.chunk.object) == (sample, *object)).unwrap();
            for splat in all.splats.iter().filter(|splat| surfels.contains(&splat.surfel())) {
                let slot = (segment.first_slot + splat.surfel() - first) as usize;
                splats[slot] = Some(splat.with_segment(segment.index));
            }
        }
        let tiles_of = |splat: &S| splat.bounds().map(|pixel| usize::from(pixel) / TILE as usize);
        let count = |splat: &Option<S>| {
            let Some(splat) = splat else { return 0 };
            let [x0, x1, y0, y1] = tiles_of(splat);
            let wanted = (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| [x, y])).filter(|&tile| wants(tile));
            let count = wanted.count() as u32;
            if (x1 + 1 - x0) * (y1 + 1 - y0) > WIDEST as usize && count > 0 { WIDE } else { count }
        };
        let touched: Vec<u32> = splats.iter().map(count).collect();
        let wide: Vec<u32> = (0..slots as u32).filter(|&slot| touched[slot as usize] == WIDE).collect();
        let (mut starts, mut list) = (Vec::new(), Vec::new());
        for &[x, y] in tiles {
            starts.push(list.len() as u32);
            list.extend((0..slots as u32).filter(|&slot| {
                touched[slot as usize] != WIDE
                    && wants([x, y])
                    && splats[slot as usize].as_ref().is_some_and(|splat| {
                        let [x0, x1, y0, y1] = tiles_of(splat);
                        (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
                    })
            }));
        }
        starts.extend([list.len() as u32, 0, wide.len() as u32]);
        Self { splats, touched, starts, list, wide }
    }

    /// Writes the splats, and how many tiles each touches, to the device.
    pub(super) fn feed_splats(&self, harness: &Harness<'_>) {
        let buffers = &harness.gpu.state.buffers;
        let splats: Vec<S> = self.splats.iter().map(|splat| splat.unwrap_or(S::zeroed())).collect();
        harness.write(&buffers[Slot::Splats], &splats);
        harness.write(&buffers[Slot::Touched], &self.touched);
    }

    /// Writes the lists to the device.
    pub(super) fn feed_lists(&self, harness: &Harness<'_>) {
        let buffers = &harness.gpu.state.buffers;
        harness.write(&buffers[Slot::Starts], &self.starts);
        harness.write(&buffers[Slot::List], &self.list);
        harness.write(&buffers[Slot::Wide], &self.wide);
    }

    /// Against the splats on the device.
    pub(super) fn compare_splats(&self, harness: &Harness<'_>) -> Result<(), String> {
        let buffers = &harness.gpu.state.buffers;
        let touched: Vec<u32> = harness.read(&buffers[Slot::Touched], self.touched.len());
        let splats: Vec<S> = harness.read(&buffers[Slot::Splats], self.splats.len());
        let mut tally = Tally::of(Slot::Splats);
        for (slot, (want, got)) in self.splats.iter().zip(&splats).enumerate() {
            if touched[slot] != self.touched[slot] {
                tally.count += 1;
                tally.otherwise(|| format!("slot {slot}: {} tiles, not {}", touched[slot], self.touched[slot]));
                continue;
            }
            let Some(want) = want else { continue };
            let ((got_same, got_floats), (same, floats)) = (got.parts(), want.parts());
            if got_same != same {
                return Err(format!("slot {slot}: {got_same:?}, not {same:?}"));
            }
            if got.all_bounds() != want.all_bounds() {
                let (got, want) = (got.all_bounds(), want.all_bounds());
                tally.otherwise(|| format!("slot {slot}: bounds {got:?}, not {want:?}"));
            }
            for (part, ((got, _), (want, scale))) in got_floats.iter().zip(&floats).enumerate() {
                tally.floats(got, want, *scale, || format!("slot {slot}, part {part}"));
            }
        }
        tally.check("splats")
    }

    /// Against the lists on the device.
    pub(super) fn compare_lists(&self, harness: &Harness<'_>) -> Result<(), String> {
        let buffers = &harness.gpu.state.buffers;
        let same = |what: &str, got: Vec<u32>, want: &[u32]| {
            if got == want { Ok(()) } else { Err(format!("{what}: {got:?}, not {want:?}")) }
        };
        same("starts", harness.read(&buffers[Slot::Starts], self.starts.len()), &self.starts)?;
        same("list", harness.read(&buffers[Slot::List], self.list.len()), &self.list)?;
        same("wide", harness.read(&buffers[Slot::Wide], self.wide.len()), &self.wide)
    }
}
