//! What part of a light's plane its maps cover, and how finely: what the camera sees, in slices of its depth.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::cells::{Cells, Ground};
use super::centres::Centres;
use super::run::Run;
use super::view::LightView;
use crate::backend::cpu::columns::{Columns, point, turn};
use crate::backend::cpu::tiles::{LANES, Lanes};
use crate::frame::{Blocks, Frame, PosedSample, Raster};
use crate::math::simd::dispatch;

/// Slices of the depth before the camera. Two end at twice the depth at which they begin.
pub(in crate::backend) const SLICES: usize = 80;

/// Most texels of a side of a map.
pub(in crate::backend) const MOST_SIDE: f64 = 65_000.0;

/// Times that texels grow until all fit, and the factor.
pub(in crate::backend) const MOST_TRIES: usize = 100;
pub(in crate::backend) const GROWTH: f64 = 1.02;
/// Pixels around the image in which surfels receive shadows, because filters and offsets reach there.
const MARGIN: f32 = 2.0;
/// What pixels show of a surfel reaches beyond it: factor on how much farther behind the ground its edge is.
const SLACK: f32 = 1.5;

/// Texels that there is room for beside those that maps are to have, because maps have borders: one for so many, and so
/// many.
pub(in crate::backend) const SHARE_OF_MORE: u64 = 32;
pub(in crate::backend) const MORE_TEXELS: u64 = 4096;

/// The room for maps that are to have so many texels.
pub(in crate::backend) const fn with_borders(texels: u64) -> u64 {
    texels + texels / SHARE_OF_MORE + MORE_TEXELS
}

/// The slice of a depth. What is nearer than the first, and what is not a number, is in the first. Without branches:
/// loops over lanes ask it.
#[inline(always)]
pub(super) fn slice_of(depth: f32, near: f32) -> usize {
    let times = depth / near;
    let bits = times.to_bits();
    // The exponent of two, and whether the rest is above its root.
    let half = u32::from(bits & 0x007f_ffff > 0x0035_04f3);
    let slice = (2 * (bits >> 23)).wrapping_sub(2 * 127).wrapping_add(half).min(SLICES as u32 - 1);
    (slice & 0_u32.wrapping_sub(u32::from(times > 1.0))) as usize
}

/// What a view of a light shows of receivers in a slice.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Least and greatest x, then y, on the plane of the view.
    bounds: [[f32; 2]; 2],
    /// Least depth before the camera.
    nearest: f32,
    /// Greatest distance along the axis of the view.
    farthest: f32,
}

const NOTHING: Seen = Seen { bounds: [[f32::INFINITY, f32::NEG_INFINITY]; 2], nearest: f32::INFINITY, farthest: 0.0 };

impl Seen {
    fn and(self, other: Self) -> Self {
        let bounds = [0, 1].map(|c: usize| {
            let ([a, b], [c, d]) = (self.bounds[c], other.bounds[c]);
            [a.min(c), b.max(d)]
        });
        let (nearest, farthest) = (self.nearest.min(other.nearest), self.farthest.max(other.farthest));
        Self { bounds, nearest, farthest }
    }
}

/// The part of a view's plane that a map covers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MapArea {
    /// The first texel's corner.
    pub first: [f32; 2],
    /// Edge of a texel.
    pub texel: f32,
    /// Columns and rows; 0 where there is nothing to receive a shadow.
    pub size: [usize; 2],
}

impl MapArea {
    /// May it show anything within a rectangle of the plane?
    pub(super) fn touches(&self, bounds: [[f32; 2]; 2]) -> bool {
        (0..2).all(|c| {
            let last = self.first[c] + self.texel * self.size[c] as f32;
            bounds[c][1] >= self.first[c] && bounds[c][0] <= last
        })
    }
}

/// What the views of a light show of receivers, view by view and slice by slice.
pub(super) struct Fit {
    seen: Vec<Seen>,
    /// What receives shadows there.
    pub cells: Vec<Cells>,
    /// The ground, as each view has it.
    pub grounds: Vec<Ground>,
    is_point: bool,
}

impl Fit {
    /// What they show of all surfels that the camera may see, and of the centres of Gaussians.
    pub(super) fn of(
        runs: &[Run<'_>],
        centres: &[Centres<'_>],
        views: &[LightView],
        sample: &PosedSample,
        raster: &Raster,
        frame: &Frame,
    ) -> Self {
        let nothing = || vec![NOTHING; views.len() * SLICES];
        let eye = Eye::new(sample, raster, frame);
        let slices = |view| Slice::all(view, (raster, eye.margin), frame.near, sample.world_from_camera);
        let slices: Vec<Slice> = views.iter().flat_map(slices).collect();
        // The centres of Gaussians that are seen ask maps, although they may lie beside the image: (view and slice,
        // their place in the view, depth).
        let asks = |centre: Vec3, radius: f32, ask: &mut dyn FnMut(usize, Vec3, f32)| {
            let (depth, sees) = eye.sees_ball(centre, radius);
            if depth >= frame.near && sees {
                for (number, view) in views.iter().enumerate() {
                    ask(number * SLICES + slice_of(depth, frame.near), view.place(centre), depth);
                }
            }
        };
        let of_centres = |mut seen: Vec<Seen>, centres: &Centres<'_>| {
            centres.each().for_each(|(centre, radius)| {
                asks(centre, radius, &mut |at, place, nearest| {
                    if let Some(bounds) = on_view(&views[at / SLICES], place, 0.0) {
                        seen[at] = seen[at].and(Seen { bounds, nearest, farthest: place.z });
                    }
                });
            });
            seen
        };
        let join = |a: Vec<Seen>, b: Vec<Seen>| a.into_iter().zip(b).map(|(a, b)| a.and(b)).collect();
        let centres_seen: Vec<Seen> = centres.par_iter().fold(nothing, of_centres).reduce(nothing, join);
        let cells: Vec<_> = slices.iter().zip(&centres_seen).map(|(slice, seen)| slice.cells_with(seen)).collect();
        // One surfel that is far away makes a run too large for numbers.
        let may_see =
            |run: &&Run<'_>| run.receives && (!run.reach.is_finite() || eye.sees_ball(run.middle, run.reach).1);
        let seen_runs: Vec<_> = runs.iter().filter(may_see).collect();
        let weight = |run: &Run<'_>| (run.reach / eye.sees_ball(run.middle, 0.0).0.max(frame.near)).powi(2);
        let weights: Vec<_> = seen_runs.iter().map(|run| (*run, weight(run))).collect();
        let plane = Ground::vote(&weights);
        let grounds: Vec<_> = views.iter().map(|view| Ground::seen_by(view, plane)).collect();
        let receivers = Receivers { eye: &eye, views, slices: &slices, cells: &cells, grounds: &grounds };
        let of_run = |mut seen: Vec<Seen>, run: &&Run<'_>| {
            receive(&receivers, run, &mut seen);
            seen
        };
        centres.par_iter().flat_map_iter(Centres::each).for_each(|(centre, radius)| {
            asks(centre, radius, &mut |at, place, _| {
                if let Some(bounds) = on_view(&views[at / SLICES], place, 0.0) {
                    cells[at].receive(bounds, grounds[at / SLICES].behind(place, 0.0, 0.0)[1]);
                }
            });
        });
        let seen = join(seen_runs.par_iter().fold(nothing, of_run).reduce(nothing, join), centres_seen);
        Self { seen, cells, grounds, is_point: views.iter().any(|view| view.is_point) }
    }

    /// The areas of maps whose texels are at most as large as a pixel of what they show; larger where all together
    /// would be more than `most`. `focal`: pixels of the image. `jitter`: where grids begin, texels.
    pub(super) fn areas(&self, focal: f32, most: u64, jitter: [f32; 2]) -> Vec<MapArea> {
        let fine = |seen: &Seen| {
            let pixel = f64::from(seen.nearest / focal);
            if self.is_point { pixel / f64::from(seen.farthest) } else { pixel }
        };
        let extents = |seen: &Seen| seen.bounds.map(|[low, high]| f64::from(high - low).max(0.0));
        // With what rows have beyond their last texel.
        let texels = |seen: &Seen| {
            let [x, y] = extents(seen).map(|extent| extent / fine(seen) + 2.0);
            (x + LANES as f64) * y
        };
        let some = self.seen.iter().filter(|seen| seen.nearest < f32::INFINITY);
        let mut coarser = (some.clone().map(texels).sum::<f64>() / most as f64).sqrt().max(1.0);
        // What maps have beside their extents may be too much.
        let room = with_borders(most) as f64;
        let size = |seen: &Seen, coarser: f64| {
            let extents = extents(seen);
            let texel = extents.into_iter().fold(fine(seen) * coarser, |texel, extent| texel.max(extent / MOST_SIDE));
            (texel, extents.map(|extent| (extent / texel) as usize + 2))
        };
        for _ in 0..MOST_TRIES {
            let of = |seen: &Seen| {
                let [columns, rows] = size(seen, coarser).1;
                columns as f64 * rows as f64
            };
            if some.clone().map(of).sum::<f64>() <= room {
                break;
            }
            coarser *= GROWTH;
        }
        let area = |seen: &Seen| {
            if seen.nearest == f32::INFINITY {
                return MapArea::default();
            }
            let (texel, size) = size(seen, coarser);
            let first = [0, 1].map(|c: usize| (f64::from(seen.bounds[c][0]) - f64::from(jitter[c]) * texel) as f32);
            MapArea { first, texel: texel as f32, size }
        };
        self.seen.iter().map(area).collect()
    }
}

/// What the camera sees.
struct Eye<'a> {
    from_world: Mat3,
    raster: &'a Raster,
    margin: f32,
    /// Slopes of the sides of the image, and the lengths of vectors of depth 1 along them.
    ends: [[f32; 2]; 2],
    lengths: [[f32; 2]; 2],
    near: f32,
    /// Where blocks alone are rendered, what they show.
    wanted: Option<&'a Blocks>,
}

impl<'a> Eye<'a> {
    fn new(sample: &PosedSample, raster: &'a Raster, frame: &'a Frame) -> Self {
        let margin = margin(frame, raster);
        let ends = slopes(raster, margin);
        let lengths = ends.map(|ends| ends.map(|slope: f32| (1.0 + slope * slope).sqrt()));
        let from_world = sample.world_from_camera.transpose();
        Self { from_world, raster, margin, ends, lengths, near: frame.near, wanted: wanted(frame) }
    }

    /// The depth of a ball, and whether the camera sees any of it.
    fn sees_ball(&self, centre: Vec3, radius: f32) -> (f32, bool) {
        let ([depth], [sees]) = self.sees(&centre.to_array().map(|x| [x]), &[radius]);
        (depth, sees != 0)
    }

    /// The depths of balls, and 1 for each that the camera sees any of, else 0. It sees nothing of one that is not
    /// finite.
    #[inline(always)]
    fn sees<const N: usize>(&self, centres: &[[f32; N]; 3], radii: &[f32; N]) -> ([f32; N], [u32; N]) {
        let mut at = turn(&self.from_world, centres);
        let mut sees = [0; N];
        for l in 0..N {
            (at[1][l], at[2][l]) = (-at[1][l], -at[2][l]);
            let (depth, radius) = (at[2][l], radii[l]);
            let mut outside = false;
            for c in 0..2 {
                let ([low, high], [before, beyond]) = (self.ends[c], self.lengths[c].map(|length| length * radius));
                outside |= (at[c][l] - low * depth < -before) | (at[c][l] - high * depth > beyond);
            }
            sees[l] = u32::from((depth + radius).is_finite() & (depth + radius >= self.near) & !outside);
        }
        if let Some(blocks) = self.wanted {
            for l in 0..N {
                sees[l] &= u32::from(self.wants(blocks, [at[0][l], at[1][l]], at[2][l], radii[l]));
            }
        }
        (at[2], sees)
    }

    /// Does a ball touch a block that is wanted? `at`: its place to the right and downwards.
    fn wants(&self, blocks: &Blocks, at: [f32; 2], depth: f32, radius: f32) -> bool {
        if depth - radius < self.near {
            return true;
        }
        let Raster { axis, focal, size, first, .. } = self.raster;
        let pixels = [0, 1].map(|c: usize| {
            let ends = [at[c] - radius, at[c] + radius];
            let place = |end: f32, depth: f32| axis[c] + focal * end / depth;
            // An end is farthest out at the nearer of the depths.
            let [low, high] = ends.map(|end| [place(end, depth - radius), place(end, depth + radius)]);
            let within = |pixel: f32| pixel.clamp(0.0, (size[c] as f32 - 1.0).max(0.0)) as usize;
            [within(low[0].min(low[1]) - 3.0), within(high[0].max(high[1]) + 3.0)]
        });
        blocks.touch(*first, [pixels[0][0], pixels[0][1], pixels[1][0], pixels[1][1]])
    }
}

/// Notes of what the camera sees are taken with these.
struct Receivers<'a> {
    eye: &'a Eye<'a>,
    views: &'a [LightView],
    /// View by view.
    slices: &'a [Slice],
    cells: &'a [Cells],
    /// One for each view.
    grounds: &'a [Ground],
}

dispatch! {
    /// Notes what the views show of the surfels of a run that the camera may see.
    fn receive(on: &Receivers<'_>, run: &Run<'_>, seen: &mut [Seen]) = receive_body
}

#[inline(always)]
fn receive_body(on: &Receivers<'_>, run: &Run<'_>, seen: &mut [Seen]) {
    let near = on.eye.near;
    let mut columns = Columns::default();
    run.load(&mut columns);
    for first in (0..run.len).step_by(LANES) {
        let [position, u, v] = columns.lanes(first);
        let (centres, radii) = (run.centres(&position), run.radii(&u, &v));
        let (depths, mut sees) = on.eye.sees(&centres, &radii);
        sees.iter_mut().skip(run.len - first).for_each(|sees| *sees = 0);
        if sees.iter().all(|&sees| sees == 0) {
            continue;
        }
        let (mut from, mut slices) = ([0.0; LANES], [[0; LANES]; 2]);
        for l in 0..LANES {
            from[l] = (depths[l] - radii[l]).max(near);
            slices[0][l] = slice_of(from[l], near);
            slices[1][l] = slice_of(depths[l] + radii[l], near);
        }
        for (number, (view, ground)) in on.views.iter().zip(on.grounds).enumerate() {
            let places = view.places(&centres);
            let middle = ground.middles(&places);
            let half = if run.are_balls() {
                ground.of_balls(&run.balls(&u))
            } else {
                ground.of_discs(&run.seen_by(view).axes([&u, &v]))
            };
            let (mut bounds, mut behind) = ([[[0.0; LANES]; 2]; 2], [0.0; LANES]);
            for l in 0..LANES {
                for c in 0..2 {
                    (bounds[c][0][l], bounds[c][1][l]) = (places[c][l] - radii[l], places[c][l] + radii[l]);
                }
                behind[l] = middle[l] + SLACK * half[l];
            }
            let slice = slices[0][sees.iter().position(|&sees| sees != 0).unwrap_or(0)];
            let is_in = |l: usize| sees[l] == 0 || (slices[0][l] == slice && slices[1][l] == slice);
            if !view.is_point && (0..LANES).all(is_in) {
                let at = number * SLICES + slice;
                let mut farthest = [0.0; LANES];
                for l in 0..LANES {
                    farthest[l] = places[2][l] + radii[l];
                }
                on.slices[at].shows_all(&mut bounds, &from, &farthest, &mut sees, &mut seen[at]);
                on.cells[at].receive_all(&bounds, &behind, &sees);
                continue;
            }
            for l in (0..LANES).filter(|&l| sees[l] != 0) {
                let (radius, place) = (radii[l], point(&places, l));
                let (mut shown, mut behind) = (bounds.map(|ends| ends.map(|end| end[l])), behind[l]);
                if view.is_point {
                    let Some(of_point) = on_view(view, place, radius) else { continue };
                    (shown, [_, behind]) = (of_point, ground.behind(place, radius, SLACK * half[l]));
                }
                for slice in slices[0][l]..=slices[1][l] {
                    let at = number * SLICES + slice;
                    let nearest = from[l].max(on.slices[at].start);
                    if let Some(shown) = on.slices[at].shows(shown, nearest, place.z + radius) {
                        seen[at] = seen[at].and(shown);
                        if !view.is_beside(place, radius) {
                            on.cells[at].receive(shown.bounds, behind);
                        }
                    }
                }
            }
        }
    }
}

/// Pixels around the image in which surfels receive shadows, too. Where the samples of a group shade their own surfels,
/// what one of them sees may be beside the image of the middle one, and so may held objects: by half the image, which
/// is more than most cameras move in an exposure.
pub(in crate::backend) fn margin(frame: &Frame, raster: &Raster) -> f32 {
    let [width, height] = raster.size;
    let beside = frame.shades_samples() || frame.holds() != Some(false);
    if beside { (0.5 * width.max(height) as f32).max(MARGIN) } else { MARGIN }
}

/// The blocks that are rendered, whose receivers alone count; `None`: all. Held objects are shown elsewhere than they
/// are, and intervals render all.
pub(in crate::backend) fn wanted(frame: &Frame) -> Option<&Blocks> {
    frame.wanted.as_ref().filter(|_| frame.swept.is_none() && frame.holds() == Some(false))
}

/// Slopes of the sides of the image, by which `margin` pixels around it are seen, too.
fn slopes(raster: &Raster, margin: f32) -> [[f32; 2]; 2] {
    let slope = |c: usize, pixel: f32| (pixel - raster.axis[c]) / raster.focal;
    [0, 1].map(|c: usize| [slope(c, -margin), slope(c, raster.size[c] as f32 + margin)])
}

/// What a view of a light shows of the part of space that a slice is. A large surfel is seen in part: what a slice
/// shows of it is within the slice.
pub(in crate::backend) struct Slice {
    /// Least and greatest x, then y, on the plane of the view.
    pub bounds: [[f32; 2]; 2],
    /// Greatest distance along the axis of the view.
    pub farthest: f32,
    /// Depth before the camera at which it begins.
    pub start: f32,
}

impl Slice {
    /// All slices in a view, from the depth `near`, of what a raster shows with a margin around it.
    pub(in crate::backend) fn all(
        view: &LightView,
        (raster, margin): (&Raster, f32),
        near: f32,
        world_from_camera: Mat3,
    ) -> Vec<Self> {
        let ends = slopes(raster, margin);
        let slice = |slice: usize| {
            let start = (0.5 * slice as f32).exp2();
            let depths = [start, start * std::f32::consts::SQRT_2].map(|start| start * near);
            Self::of(view, depths, ends, world_from_camera)
        };
        (0..SLICES).map(slice).collect()
    }

    /// The part of space between two depths and the sides of the image, whose slopes are `ends`.
    fn of(view: &LightView, depths: [f32; 2], ends: [[f32; 2]; 2], world_from_camera: Mat3) -> Self {
        let corner = |n: usize| {
            let (depth, x, y) = (depths[n & 1], ends[0][n >> 1 & 1], ends[1][n >> 2]);
            view.place(world_from_camera * Vec3::new(x * depth, -y * depth, -depth))
        };
        let corners: [Vec3; 8] = std::array::from_fn(corner);
        let [start, _] = depths;
        let farthest = corners.iter().map(|corner| corner.z).fold(f32::NEG_INFINITY, f32::max);
        // What is behind a face is on another.
        if view.is_point && farthest <= 0.0 {
            return Self { bounds: NOTHING.bounds, farthest, start };
        }
        // Beside a light that is a point, space is no part of a face.
        if view.is_point && corners.iter().any(|corner| corner.z <= 1e-3 * corner.length()) {
            return Self { bounds: [[-1.0, 1.0]; 2], farthest, start };
        }
        let bounds = [0, 1].map(|c: usize| {
            let on_plane = |corner: &Vec3| if view.is_point { corner[c] / corner.z } else { corner[c] };
            let least = corners.iter().map(on_plane).fold(f32::INFINITY, f32::min);
            let most = corners.iter().map(on_plane).fold(f32::NEG_INFINITY, f32::max);
            let margin = 1e-3 * (most - least);
            [least - margin, most + margin]
        });
        Self { bounds, farthest, start }
    }

    /// Cells of all that it shows, and of what is seen of the centres of Gaussians, too.
    fn cells_with(&self, seen: &Seen) -> Cells {
        let own = Seen { bounds: self.bounds, ..NOTHING };
        Cells::new(own.and(*seen).bounds)
    }

    /// What it shows of things with these bounds is added to `seen`: their bounds become those of what it shows, and
    /// `sees` 0 where that is nothing.
    #[inline(always)]
    fn shows_all(
        &self,
        bounds: &mut [[Lanes; 2]; 2],
        nearest: &Lanes,
        farthest: &Lanes,
        sees: &mut [u32; LANES],
        seen: &mut Seen,
    ) {
        for c in 0..2 {
            let [least, most] = self.bounds[c];
            for l in 0..LANES {
                let (low, high) = (bounds[c][0][l].max(least), bounds[c][1][l].min(most));
                (bounds[c][0][l], bounds[c][1][l]) = (low, high);
                sees[l] &= u32::from(low <= high);
            }
        }
        for l in (0..LANES).filter(|&l| sees[l] != 0) {
            let (nearest, farthest) = (nearest[l].max(self.start), farthest[l].min(self.farthest));
            *seen = seen.and(Seen { bounds: bounds.map(|ends| ends.map(|end| end[l])), nearest, farthest });
        }
    }

    /// What it shows of something with these bounds; `None` where that is beside it.
    fn shows(&self, bounds: [[f32; 2]; 2], nearest: f32, farthest: f32) -> Option<Seen> {
        let bounds = [0, 1].map(|c: usize| {
            let ([a, b], [c, d]) = (bounds[c], self.bounds[c]);
            [a.max(c), b.min(d)]
        });
        let farthest = farthest.min(self.farthest);
        bounds.iter().all(|[low, high]| low <= high).then_some(Seen { bounds, nearest, farthest })
    }
}

/// The bounds of a ball on the plane of a view; `None` where it is beside or behind.
pub(super) fn on_view(view: &LightView, place: Vec3, radius: f32) -> Option<[[f32; 2]; 2]> {
    if !view.is_point {
        return Some([0, 1].map(|c: usize| [place[c] - radius, place[c] + radius]));
    }
    if place.z <= -radius {
        return None;
    }
    if place.z <= 2.0 * radius {
        return Some([[-1.0, 1.0]; 2]);
    }
    let bounds = [0, 1].map(|c: usize| {
        let at = place[c] / place.z;
        let extent = 2.0 * radius / place.z * (1.0 + at.abs());
        [(at - extent).max(-1.0), (at + extent).min(1.0)]
    });
    bounds.iter().all(|[low, high]| low <= high).then_some(bounds)
}
