//! Pass `resolve` of what is transparent: over the opaque picture of the instant, decoded, and added to the film with
//! the time weight (docs/math.md, section 11).
//!
//! In: a tile's composite, and the opaque picture of its group. Out: the tile's film. One instant at a time.

use super::accumulators::Composite;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::tiles::{LANES, TILE, TileRect};
use crate::film::{Background, Blending, FilmPlanes};
use crate::math::simd::dispatch;
use crate::math::srgb;

/// What the pass needs beside the composite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Over<'a> {
    /// The opaque picture of the group, premultiplied.
    pub opaque: &'a TileFilm,
    /// What turns that picture's sums into means over the group.
    pub scale: f32,
    /// Share of the exposure.
    pub weight: f32,
    pub blending: Blending,
    pub background: Background,
    pub planes: &'a FilmPlanes,
}

type Lanes = [f32; LANES];

dispatch! {
    /// Adds one instant to `film`.
    ///
    /// The film holds what the picture has more than the background that shows through: developing adds that.
    pub(super) fn resolve(over: &Over<'_>, composite: &Composite, tile: &TileRect, film: &mut TileFilm) = resolve_body
}

#[inline(always)]
fn resolve_body(over: &Over<'_>, composite: &Composite, tile: &TileRect, film: &mut TileFilm) {
    film.values.resize(over.planes.count * TILE * TILE, 0.0);
    let behind = over.background.colour.as_vec3().to_array();
    let coded = over.blending == Blending::Coded;
    let behind_coded = if coded { behind.map(srgb::from_linear) } else { behind };
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let opaque = |plane: usize| -> Lanes {
                let mut out = [0.0; LANES];
                let first = (plane * TILE + y) * TILE + x;
                if let Some(row) = over.opaque.values.get(first..first + LANES) {
                    out.copy_from_slice(row);
                    for value in &mut out {
                        *value *= over.scale;
                    }
                }
                out
            };
            let through = composite.lanes(0, [x, y]);
            let solid = opaque(3);
            if through.iter().zip(&solid).all(|(&through, &solid)| through == 1.0 && solid == 0.0) {
                continue;
            }
            let mut alpha = [0.0; LANES];
            let mut inverse = [0.0; LANES];
            for l in 0..LANES {
                alpha[l] = 1.0 - through[l] * (1.0 - solid[l]);
                inverse[l] = if solid[l] > 0.0 { 1.0 / solid[l] } else { 0.0 };
            }
            let mut add = |plane: usize, value: &Lanes| {
                let out = &mut film.values[(plane * TILE + y) * TILE + x..][..LANES];
                for l in 0..LANES {
                    out[l] += over.weight * value[l];
                }
            };
            for c in 0..3 {
                let own = composite.lanes(Composite::colour() + c, [x, y]);
                let of_opaque = opaque(c);
                let mut seen = [0.0; LANES];
                for l in 0..LANES {
                    let linear = of_opaque[l] * inverse[l];
                    let shown = if coded { srgb::from_linear_nearly(linear) } else { linear };
                    let front = own[l] + through[l] * (shown * solid[l]);
                    seen[l] = if !coded {
                        front
                    } else if over.background.transparent {
                        let inverse = if alpha[l] > 0.0 { 1.0 / alpha[l] } else { 0.0 };
                        alpha[l] * srgb::to_linear_nearly(front * inverse)
                    } else {
                        let behind_through = 1.0 - alpha[l];
                        srgb::to_linear_nearly(front + behind_through * behind_coded[c]) - behind_through * behind[c]
                    };
                }
                add(c, &seen);
            }
            add(3, &alpha);
            // Opaque surfels show through what is before them.
            let mut mixed = |plane: usize, channel: Option<usize>| {
                let own = channel.map_or([0.0; LANES], |channel| composite.lanes(channel, [x, y]));
                let of_opaque = opaque(plane);
                let mut sum = [0.0; LANES];
                for l in 0..LANES {
                    sum[l] = own[l] + through[l] * of_opaque[l];
                }
                add(plane, &sum);
            };
            if let Some(plane) = over.planes.depth {
                mixed(plane, composite.depth());
            }
            if let Some(plane) = over.planes.normal {
                (0..3).for_each(|c| mixed(plane + c, composite.normal().map(|channel| channel + c)));
            }
            if let Some(plane) = over.planes.velocity {
                (0..2).for_each(|c| mixed(plane + c, composite.velocity().map(|channel| channel + c)));
            }
        }
    }
}
