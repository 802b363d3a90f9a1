//! One disc in place of several.

use std::f32::consts::FRAC_1_SQRT_2;

use glam::{Mat2, Mat3, Vec2, Vec3};

use crate::math::srgb;
use crate::model::surfels::{Material, Surfels};

/// Cosine of the greatest angle between fronts that are merged: thin sheets keep both sides.
pub(super) const AGREE: f32 = 0.5;
/// Directions in which the outline of a disc is held against those of the discs below it, and what is beside it is
/// looked at. They are written out, since sines of the platform's library are not the same everywhere.
pub(super) const DIRECTIONS: [Vec2; 8] = [
    Vec2::new(1.0, 0.0),
    Vec2::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    Vec2::new(0.0, 1.0),
    Vec2::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    Vec2::new(-1.0, 0.0),
    Vec2::new(-FRAC_1_SQRT_2, -FRAC_1_SQRT_2),
    Vec2::new(0.0, -1.0),
    Vec2::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2),
];
/// Discs of its cell that each disc is compared with. Any number of discs may lie in one place.
const BESIDE: usize = 16;
/// Least semi-axis of a merged disc, in edges of its cell: discs about the middles of cells cover their corners.
const LEAST: f32 = 0.72;
/// The same where its surface goes on around it: nearly half of a cell's diagonal. A plane of any direction may cut a
/// cell that far from its middle, and what is not covered there is a hole.
const LEAST_WITHIN: f32 = 0.85;

/// A disc of a model or of a level, with what its level needs to know of the discs below it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) position: Vec3,
    pub(super) axis_u: Vec3,
    pub(super) axis_v: Vec3,
    pub(super) normal: Vec3,
    pub(super) colour: Vec3,
    pub(super) opacity: f32,
    /// Mean square of the opacities of the model below.
    opacities: f32,
    pub(super) material: Material,
    /// Velocity and acceleration; zero in a model without any.
    pub(super) rates: [Vec3; 2],
    /// Mean squares of how far those of the model below are from these.
    pub(super) strays: [f32; 2],
    /// Sum of |u x v| of the discs of the model below it.
    pub(super) area: f32,
    /// Mean of their longer axes.
    pub(super) radius: f32,
    /// Mean of their colours as they are displayed.
    shown: Vec3,
    /// Mean square of these.
    squares: f32,
    /// Mean of their fronts: shorter the more these differ.
    front: Vec3,
    /// Mean of their shading normals, likewise.
    shading: Vec3,
    /// Mean square of how far it lies from one of them, or those below reach over others where that shows.
    pub(super) deviation: f32,
    /// Mean square of how far it reaches over those of the level below.
    over: f32,
    /// What shows where it reaches over its neighbours, as a share of white.
    pub(super) contrast: f32,
    /// Directions in which what it leaves out changes ([`changes`]), of all levels below together.
    pub(super) changes: Mat3,
}

impl Disc {
    /// A disc of the model.
    pub(super) fn of(surfels: &Surfels, i: usize) -> Self {
        let (axis_u, axis_v, colour) = (surfels.axis_u[i], surfels.axis_v[i], surfels.colour[i]);
        let opacity = surfels.opacity.get(i).copied().unwrap_or(1.0);
        let cross = axis_u.cross(axis_v);
        let shown = displayed(colour);
        Self {
            position: surfels.position[i],
            axis_u,
            axis_v,
            normal: surfels.normal[i],
            colour,
            opacity,
            opacities: opacity * opacity,
            material: surfels.material.get(i).copied().unwrap_or_default(),
            rates: surfels.rates().map(|column| column.get(i).copied().unwrap_or_default()),
            strays: [0.0; 2],
            area: cross.length().max(f32::MIN_POSITIVE),
            radius: axis_u.length().max(axis_v.length()),
            shown,
            squares: shown.length_squared(),
            front: cross.normalize_or_zero(),
            shading: surfels.normal[i],
            deviation: 0.0,
            over: 0.0,
            contrast: 0.0,
            changes: Mat3::ZERO,
        }
    }

    /// The mean square of how far it reaches over those below, as far as that shows.
    pub(super) fn reach(&self) -> f32 {
        self.contrast * self.contrast * self.over
    }

    /// The direction of its front, unit length.
    pub(super) fn front(&self) -> Vec3 {
        self.axis_u.cross(self.axis_v).normalize_or_zero()
    }

    /// Half of its extent along each axis of space.
    pub(super) fn extent(&self) -> Vec3 {
        (self.axis_u * self.axis_u + self.axis_v * self.axis_v).map(f32::sqrt)
    }

    /// The mean square of what it leaves out of the colours below, of the light that changes with their fronts, and of
    /// what shows through them, which may differ from them by all of white.
    pub(super) fn rest(&self) -> f32 {
        let own = displayed(self.colour);
        let colours = (self.squares - 2.0 * own.dot(self.shown) + own.length_squared()).max(0.0);
        let through = (self.opacities - self.opacity * self.opacity).max(0.0);
        (colours + own.length_squared() * self.turns()) / 3.0 + through
    }

    /// How alike the shading normals below are: the length of their mean, from 0 to 1.
    pub(super) fn alike(&self) -> f32 {
        self.shading.length().min(1.0)
    }

    /// The mean square of how far the fronts below are from their mean, each of length 1.
    pub(super) fn turns(&self) -> f32 {
        (1.0 - self.front.length_squared()).clamp(0.0, 1.0)
    }
}

/// A disc as it lies on the plane of the merged one: its middle and semi-axes.
#[derive(Clone, Copy)]
struct Flat {
    place: Vec2,
    u: Vec2,
    v: Vec2,
}

impl Flat {
    /// Where it begins and ends in the direction `towards`, unit length.
    fn span(&self, towards: Vec2) -> (f32, f32) {
        let middle = self.place.dot(towards);
        let half = (self.u.dot(towards).powi(2) + self.v.dot(towards).powi(2)).sqrt();
        (middle - half, middle + half)
    }

    /// The least factor on the semi-axes `half` of an ellipse about the middle that holds it, or somewhat more.
    fn held_by(&self, half: Vec2) -> f32 {
        let (u, v) = (self.u / half, self.v / half);
        let (sum, product) = (u.length_squared() + v.length_squared(), u.perp_dot(v));
        let longest = (0.5 * (sum + (sum * sum - 4.0 * product * product).max(0.0).sqrt())).sqrt();
        (self.place / half).length() + longest
    }
}

/// Memory that serves one cell after the other.
#[derive(Default)]
pub(super) struct Merger {
    /// Shares of the discs of all area.
    shares: Vec<f32>,
    flats: Vec<Flat>,
    /// Where each disc begins and ends along a line.
    spans: Vec<(f32, f32)>,
}

/// How far a merged disc reaches, and how far it could.
pub(super) struct Outline {
    semi: Vec2,
    /// Semi-axes with which it holds all discs below it.
    holding: Vec2,
    /// How far these reach in each of [`DIRECTIONS`].
    held: [f32; DIRECTIONS.len()],
}

impl Outline {
    /// The mean square of how far it reaches over the discs below it.
    fn over(&self) -> f32 {
        let own = DIRECTIONS.map(|to| (to * self.semi).length());
        own.iter().zip(self.held).map(|(own, held)| (own - held).powi(2)).sum::<f32>() / DIRECTIONS.len() as f32
    }

    /// Widens `disc`, whose outline it is, within a surface that goes on around it. `edge`: of its cell.
    pub(super) fn widen(mut self, disc: &mut Disc, edge: f32) {
        let before = self.semi;
        self.semi = before.max(self.holding.min(Vec2::splat(LEAST_WITHIN * edge)));
        disc.axis_u *= self.semi.x / before.x;
        disc.axis_v *= self.semi.y / before.y;
        disc.over = self.over();
    }
}

impl Merger {
    /// One disc in place of `discs` of a cell with this edge; there is one at least. Area, middle, mean colour and mean
    /// normal are theirs, weighted by their areas. In the mean over all directions it reaches as far as they do.
    pub(super) fn merge(&mut self, discs: &[&Disc], edge: f32) -> (Disc, Outline) {
        let area: f32 = discs.iter().map(|disc| disc.area).sum();
        self.shares.clear();
        self.shares.extend(discs.iter().map(|disc| disc.area / area));
        let shares = &self.shares;
        let position = mean(discs, shares, |disc| disc.position);
        let towards = mean(discs, shares, Disc::front).try_normalize().unwrap_or_else(|| discs[0].front());
        let (right, up) = if towards == Vec3::ZERO { (Vec3::X, Vec3::Y) } else { towards.any_orthonormal_pair() };
        let flat = |v: Vec3| Vec2::new(v.dot(right), v.dot(up));
        self.flats.clear();
        self.flats.extend(discs.iter().map(|disc| Flat {
            place: flat(disc.position - position),
            u: flat(disc.axis_u),
            v: flat(disc.axis_v),
        }));
        // The greater axis of the ellipse of moments. A uniform disc has a quarter of the squares of its semi-axes.
        let [xx, xy, yy] = discs.iter().zip(&self.flats).fold([0.0; 3], |[xx, xy, yy], (disc, flat)| {
            let parts = [(flat.place, 1.0), (flat.u, 0.25), (flat.v, 0.25)];
            parts.into_iter().fold([xx, xy, yy], |[xx, xy, yy], (of, share)| {
                let weight = share * disc.area;
                [xx + weight * of.x * of.x, xy + weight * of.x * of.y, yy + weight * of.y * of.y]
            })
        });
        let angle = 0.5 * libm::atan2f(2.0 * xy, xx - yy);
        let along = Vec2::new(libm::cosf(angle), libm::sinf(angle));
        let turn = Mat2::from_cols(along, along.perp()).transpose();
        for flat in &mut self.flats {
            *flat = Flat { place: turn * flat.place, u: turn * flat.u, v: turn * flat.v };
        }
        let half = self.flats.iter().fold(Vec2::splat(f32::MIN_POSITIVE), |half, Flat { place, u, v }| {
            half.max(place.abs() + (u * u + v * v).map(f32::sqrt))
        });
        let holding = half * self.flats.iter().map(|flat| flat.held_by(half)).fold(0.0, f32::max);
        let (held, gap) = self.outline();
        let reach = |semi: Vec2| DIRECTIONS.map(|to| (to * semi).length());
        let as_far = held.iter().sum::<f32>() / reach(half).iter().sum::<f32>();
        let semi = (half * as_far).max(holding.min(Vec2::splat(LEAST * edge)));
        let in_space = |of: Vec2| right * of.x + up * of.y;
        let (axis_u, axis_v) = (in_space(along) * semi.x, in_space(along.perp()) * semi.y);
        let shares = &self.shares;
        let number = |of: &dyn Fn(&Disc) -> f32| discs.iter().zip(shares).map(|(disc, share)| of(disc) * share).sum();
        let off: f32 = number(&|disc| {
            let [u, v] = [disc.axis_u.dot(towards), disc.axis_v.dot(towards)];
            disc.deviation + disc.reach() + (disc.position - position).dot(towards).powi(2) + 0.5 * (u * u + v * v)
        });
        let outline = Outline { semi, holding, held };
        let below: Mat3 = discs.iter().zip(shares).map(|(disc, share)| disc.changes * *share).sum();
        let rates = [0, 1].map(|order| mean(discs, shares, |disc| disc.rates[order]));
        let stray =
            |disc: &Disc, order: usize| disc.strays[order] + (disc.rates[order] - rates[order]).length_squared();
        let coefficient = |of: fn(&Material) -> f32| number(&|disc| of(&disc.material));
        let disc = Disc {
            position,
            axis_u,
            axis_v,
            normal: mean(discs, shares, |disc| disc.normal).try_normalize().unwrap_or(towards),
            colour: mean(discs, shares, |disc| disc.colour),
            opacity: number(&|disc| disc.opacity),
            opacities: number(&|disc| disc.opacities),
            material: Material {
                ambient: coefficient(|of| of.ambient),
                diffuse: coefficient(|of| of.diffuse),
                specular: coefficient(|of| of.specular),
                shininess: coefficient(|of| of.shininess),
            },
            rates,
            strays: [0, 1].map(|order| number(&|disc| stray(disc, order))),
            area,
            radius: number(&|disc| disc.radius),
            shown: mean(discs, shares, |disc| disc.shown),
            squares: number(&|disc| disc.squares),
            front: mean(discs, shares, |disc| disc.front),
            shading: mean(discs, shares, |disc| disc.shading),
            deviation: off + gap * gap,
            over: outline.over(),
            contrast: 0.0,
            changes: below + changes(discs, shares, edge),
        };
        (disc, outline)
    }

    /// How far the discs reach in each of [`DIRECTIONS`], and the widest gap between them along one of these lines: a
    /// merged disc closes it.
    fn outline(&mut self) -> ([f32; DIRECTIONS.len()], f32) {
        let mut held = [f32::NEG_INFINITY; DIRECTIONS.len()];
        let mut widest: f32 = 0.0;
        // The second half of the directions are the first, backwards.
        for (direction, to) in DIRECTIONS[..DIRECTIONS.len() / 2].iter().enumerate() {
            self.spans.clear();
            self.spans.extend(self.flats.iter().map(|flat| flat.span(*to)));
            let back = direction + DIRECTIONS.len() / 2;
            for (from, end) in &self.spans {
                held[direction] = held[direction].max(*end);
                held[back] = held[back].max(-from);
            }
            self.spans.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let mut covered = f32::INFINITY;
            for (from, end) in &self.spans {
                widest = widest.max(from - covered);
                covered = if covered.is_finite() { covered.max(*end) } else { *end };
            }
        }
        (held, widest)
    }
}

fn mean(discs: &[&Disc], shares: &[f32], of: impl Fn(&Disc) -> Vec3) -> Vec3 {
    discs.iter().zip(shares).map(|(disc, share)| of(disc) * *share).sum()
}

/// In which directions colours and fronts change between discs of a cell with this edge: the sum over pairs of d
/// d^T, d from one to the other as a unit vector, weighted by the square of their change over that of their distance.
fn changes(discs: &[&Disc], shares: &[f32], edge: f32) -> Mat3 {
    let mut sum = Mat3::ZERO;
    for (i, one) in discs.iter().enumerate() {
        for (other, of_other) in discs[i + 1..].iter().zip(&shares[i + 1..]).take(BESIDE) {
            let away = (other.position - one.position) / edge;
            let shown = 0.5 * (one.shown + other.shown).length_squared();
            let change =
                (other.shown - one.shown).length_squared() + shown * (other.front - one.front).length_squared();
            let share = 2.0 * shares[i] * of_other;
            // One over the distance for the gradient, one more for the unit vector, both squared.
            let over = away.length_squared().max(1e-6).recip();
            let along = away * (over * (share * change).sqrt());
            sum += Mat3::from_cols(along * along.x, along * along.y, along * along.z);
        }
    }
    sum
}

/// A colour as it is displayed: what eyes see of a difference.
pub(super) fn displayed(colour: Vec3) -> Vec3 {
    colour.clamp(Vec3::ZERO, Vec3::ONE).map(srgb::from_linear_nearly)
}
