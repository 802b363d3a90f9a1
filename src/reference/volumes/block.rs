//! Extinction and emission at equal distances along a ray, and the light of that.
//!
//! The nodes form panels of three. Within a panel the optical depths t at its middle and at its end are integrals of
//! the parabola through its three extinctions f. What the panel hides is exactly 1 - exp(-t). Its colour is the mean of
//! the colours at its nodes, with Simpson's weights times f exp(-t). So a constant colour is exact however dense it is,
//! and all else is of fourth order.

use glam::{DVec2, DVec3};

use crate::math::simd::dispatch;
use crate::reference::composite::Composite;

/// Most panels of a block.
pub(super) const PANELS: usize = 96;

/// Nodes, and room for the rest of a vector.
const NODES: usize = 2 * PANELS + 1 + LANES;

const LANES: usize = 4;

/// Values at a node: extinction per unit of depth; that times red, green, blue; times the velocity on the film.
const VALUES: usize = 6;

/// A kernel along a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Where it begins and ends to count, camera depth.
    pub start: f64,
    pub end: f64,
    /// Depth of its peak.
    pub centre: f64,
    /// Standard deviation, depth.
    pub sigma: f64,
    /// Extinction per unit of depth at the peak of a kernel that the ray goes through the centre of.
    pub peak: f64,
    /// Square of the distance from the ray, in standard deviations.
    pub q: f64,
    /// Colour in the numbers of the image's blending, and velocity on the film, pixels per shutter.
    pub colour: [f64; 3],
    pub velocity: [f64; 2],
}

/// A stretch of a ray.
#[derive(Clone, Debug)]
pub(super) struct Block {
    from: f64,
    /// Distance of nodes.
    step: f64,
    panels: usize,
    /// Whether velocities are wanted.
    pub moves: bool,
    values: [[f64; NODES]; VALUES],
}

impl Block {
    pub(super) fn new(moves: bool) -> Self {
        Self { from: 0.0, step: 0.0, panels: 0, moves, values: [[0.0; NODES]; VALUES] }
    }

    /// Sums `lines` at the nodes of `panels` panels, of which the first begins at the depth `from`.
    pub(super) fn fill(&mut self, lines: &[Line], from: f64, step: f64, panels: usize) {
        (self.from, self.step, self.panels) = (from, step, panels.min(PANELS));
        fill(self, lines);
    }

    /// The greatest optical depth of a panel.
    pub(super) fn densest(&self) -> f64 {
        (0..self.panels).map(|panel| self.depths(2 * panel)[1]).fold(0.0, f64::max)
    }

    /// Optical depths at the middle and at the end of the panel that begins at a node.
    fn depths(&self, node: usize) -> [f64; 2] {
        let [f0, f1, f2] = [0, 1, 2].map(|i| self.values[0][node + i]);
        let whole = self.step * (f0 + 4.0 * f1 + f2) / 3.0;
        // The parabola may be below 0 where extinctions are not.
        [(self.step * (5.0 * f0 + 8.0 * f1 - f2) / 12.0).clamp(0.0, whole), whole]
    }

    /// Adds the light of the block.
    pub(super) fn shine(&self, sum: &mut Composite) {
        for panel in 0..self.panels {
            let node = 2 * panel;
            let [middle, end] = self.depths(node);
            if sum.is_opaque() {
                return;
            }
            let through = [1.0, libm::exp(-middle), libm::exp(-end)];
            let simpson = [1.0, 4.0 * through[1], through[2]];
            let mean = |values: &[f64; NODES]| {
                simpson[0] * values[node] + simpson[1] * values[node + 1] + simpson[2] * values[node + 2]
            };
            let weight = mean(&self.values[0]);
            if weight <= 0.0 {
                continue;
            }
            let share = sum.transmittance * -libm::expm1(-end) / weight;
            let [_, r, g, b, x, y] = &self.values;
            sum.colour += share * DVec3::new(mean(r), mean(g), mean(b));
            if self.moves {
                sum.velocity += share * DVec2::new(mean(x), mean(y));
            }
            let depth: f64 = (0..3)
                .map(|i| simpson[i] * self.values[0][node + i] * (self.from + self.step * (node + i) as f64))
                .sum();
            sum.depth += share * depth;
            sum.transmittance *= through[2];
            sum.any = true;
        }
    }
}

dispatch! {
    fn fill(block: &mut Block, lines: &[Line]) = fill_body
}

/// Sums Gaussians at equal distances. With x from the peak and the distance h, g(x + n h) follows from g(x) by
/// multiplications: exp(-(x + h)^2 / 2) / exp(-x^2 / 2) = exp(-x h - h^2 / 2), and that ratio itself falls by exp(-h^2)
/// a step. Four nodes go together.
#[inline(always)]
fn fill_body(block: &mut Block, lines: &[Line]) {
    let nodes = 2 * block.panels + 1;
    let used = if block.moves { VALUES } else { 4 };
    for values in &mut block.values[..used] {
        values[..nodes + LANES].fill(0.0);
    }
    let over = 1.0 / block.step;
    let (mut last, mut fall) = (0.0, 1.0);
    for line in lines {
        // The casts saturate.
        let first = ((line.start - block.from) * over).ceil().max(0.0) as usize;
        let end = (((line.end - block.from) * over).floor() + 1.0).max(0.0) as usize;
        let end = end.min(nodes);
        if first >= end {
            continue;
        }
        let inverse = 1.0 / line.sigma;
        let h = block.step * inverse;
        if h != last {
            (last, fall) = (h, libm::exp(-h * h));
        }
        let x = (block.from + block.step * first as f64 - line.centre) * inverse;
        let g = line.peak * libm::exp(-0.5 * (line.q + x * x));
        let r = libm::exp(-h * (x + 0.5 * h));
        let c2 = fall * fall;
        let c4 = c2 * c2;
        let (c6, c16) = (c4 * c2, c4 * c4 * c4 * c4);
        let r = [r, r * fall, r * c2, r * c2 * fall];
        let mut g = [g, g * r[0], g * r[0] * r[1], g * r[0] * r[1] * r[2]];
        // The ratio over four steps.
        let mut ratio = r.map(|r| r * r * (r * r) * c6);
        let [red, green, blue] = line.colour;
        let mut node = first;
        while node < end {
            let [f, rs, gs, bs, xs, ys] = &mut block.values;
            add(f, node, &g, 1.0);
            add(rs, node, &g, red);
            add(gs, node, &g, green);
            add(bs, node, &g, blue);
            if block.moves {
                add(xs, node, &g, line.velocity[0]);
                add(ys, node, &g, line.velocity[1]);
            }
            for l in 0..LANES {
                g[l] *= ratio[l];
                ratio[l] *= c16;
            }
            node += LANES;
        }
    }
}

/// Adds `factor` g to the values from `node` on.
#[inline(always)]
fn add(values: &mut [f64; NODES], node: usize, g: &[f64; LANES], factor: f64) {
    // One test of bounds for all lanes, so that they become a vector.
    if let Some(values) = values.get_mut(node..).and_then(<[f64]>::first_chunk_mut::<LANES>) {
        for l in 0..LANES {
            values[l] += g[l] * factor;
        }
    }
}
