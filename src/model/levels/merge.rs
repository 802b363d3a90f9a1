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

/// A disc of a model or of a level, with what its level needs to know of the discs below it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) position: Vec3,
    pub(super) axis_u: Vec3,
    pub(super) axis_v: Vec3,
    pub(super) normal: Vec3,
    pub(super) colour: Vec3,
    pub(super) opacity: f32,
    pub(super) material: Material,
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
        let cross = axis_u.cross(axis_v);
        let shown = displayed(colour);
        Self {
            position: surfels.position[i],
            axis_u,
            axis_v,
            normal: surfels.normal[i],
            colour,
            opacity: surfels.opacity.get(i).copied().unwrap_or(1.0),
            material: surfels.material.get(i).copied().unwrap_or_default(),
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

    /// The mean square of what it leaves out of the colours below, and of the light that changes with their fronts.
    pub(super) fn rest(&self) -> f32 {
        let own = displayed(self.colour);
        let colours = (self.squares - 2.0 * own.dot(self.shown) + own.length_squared()).max(0.0);
        (colours + own.length_squared() * self.turns()) / 3.0
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
    /// How far it reaches in the direction `towards`, unit length.
    fn reach(&self, towards: Vec2) -> f32 {
        self.place.dot(towards) + (self.u.dot(towards).powi(2) + self.v.dot(towards).powi(2)).sqrt()
    }

    /// The least factor on the semi-axes `half` of an ellipse about the middle that holds it, or somewhat more.
    fn held_by(&self, half: Vec2) -> f32 {
        let (u, v) = (self.u / half, self.v / half);
        let (sum, product) = (u.length_squared() + v.length_squared(), u.perp_dot(v));
        let longest = (0.5 * (sum + (sum * sum - 4.0 * product * product).max(0.0).sqrt())).sqrt();
        (self.place / half).length() + longest
    }
}

/// One disc in place of `discs` of a cell with this edge; there is one at least. Area, middle, mean colour and mean
/// normal are theirs, weighted by their areas. In the mean over all directions it reaches as far as they do.
pub(super) fn merge(discs: &[&Disc], edge: f32) -> Disc {
    let area: f32 = discs.iter().map(|disc| disc.area).sum();
    let mean = |of: &dyn Fn(&Disc) -> Vec3| discs.iter().map(|disc| of(disc) * (disc.area / area)).sum::<Vec3>();
    let number = |of: &dyn Fn(&Disc) -> f32| discs.iter().map(|disc| of(disc) * (disc.area / area)).sum::<f32>();
    let position = mean(&|disc| disc.position);
    let towards = mean(&Disc::front).try_normalize().unwrap_or_else(|| discs[0].front());
    let (right, up) = if towards == Vec3::ZERO { (Vec3::X, Vec3::Y) } else { towards.any_orthonormal_pair() };
    let flat = |v: Vec3| Vec2::new(v.dot(right), v.dot(up));
    // The greater axis of the ellipse of moments. A uniform disc has a quarter of the squares of its semi-axes.
    let [xx, xy, yy] = discs.iter().fold([0.0; 3], |[xx, xy, yy], disc| {
        let parts = [(flat(disc.position - position), 1.0), (flat(disc.axis_u), 0.25), (flat(disc.axis_v), 0.25)];
        parts.into_iter().fold([xx, xy, yy], |[xx, xy, yy], (of, share)| {
            let weight = share * disc.area;
            [xx + weight * of.x * of.x, xy + weight * of.x * of.y, yy + weight * of.y * of.y]
        })
    });
    let angle = 0.5 * libm::atan2f(2.0 * xy, xx - yy);
    let along = Vec2::new(libm::cosf(angle), libm::sinf(angle));
    let turn = Mat2::from_cols(along, along.perp()).transpose();
    let flats = || {
        discs.iter().map(|disc| Flat {
            place: turn * flat(disc.position - position),
            u: turn * flat(disc.axis_u),
            v: turn * flat(disc.axis_v),
        })
    };
    let half = flats().fold(Vec2::splat(f32::MIN_POSITIVE), |half, Flat { place, u, v }| {
        half.max(place.abs() + (u * u + v * v).map(f32::sqrt))
    });
    let holding = half * flats().map(|flat| flat.held_by(half)).fold(0.0, f32::max);
    let directions = DIRECTIONS;
    let held = directions.map(|to| flats().map(|flat| flat.reach(to)).fold(f32::NEG_INFINITY, f32::max));
    let reach = |semi: Vec2| directions.map(|to| (to * semi).length());
    let as_far = held.iter().sum::<f32>() / reach(half).iter().sum::<f32>();
    let semi = (half * as_far).max(holding.min(Vec2::splat(LEAST * edge)));
    let in_space = |of: Vec2| right * of.x + up * of.y;
    let (axis_u, axis_v) = (in_space(along) * semi.x, in_space(along.perp()) * semi.y);
    let off = number(&|disc| {
        let [u, v] = [disc.axis_u.dot(towards), disc.axis_v.dot(towards)];
        disc.deviation + disc.reach() + (disc.position - position).dot(towards).powi(2) + 0.5 * (u * u + v * v)
    });
    let over =
        reach(semi).iter().zip(held).map(|(own, held)| (own - held).powi(2)).sum::<f32>() / DIRECTIONS.len() as f32;
    let gap = directions[..DIRECTIONS.len() / 2].iter().map(|to| gap(flats(), *to)).fold(0.0, f32::max);
    let (shown, front) = (mean(&|disc| disc.shown), mean(&|disc| disc.front));
    let below: Mat3 = discs.iter().map(|disc| disc.changes * (disc.area / area)).sum();
    let changes = below + changes(discs, area, edge);
    let coefficient = |of: fn(&Material) -> f32| number(&|disc| of(&disc.material));
    Disc {
        position,
        axis_u,
        axis_v,
        normal: mean(&|disc| disc.normal).try_normalize().unwrap_or(towards),
        colour: mean(&|disc| disc.colour),
        opacity: number(&|disc| disc.opacity),
        material: Material {
            ambient: coefficient(|of| of.ambient),
            diffuse: coefficient(|of| of.diffuse),
            specular: coefficient(|of| of.specular),
            shininess: coefficient(|of| of.shininess),
        },
        area,
        radius: number(&|disc| disc.radius),
        shown,
        squares: number(&|disc| disc.squares),
        front,
        shading: mean(&|disc| disc.shading),
        deviation: off + gap * gap,
        over,
        contrast: 0.0,
        changes,
    }
}

/// In which directions colours and fronts change between discs of a cell with this edge: the sum over pairs of d
/// d^T, d from one to the other as a unit vector, weighted by the square of their change over that of their distance.
fn changes(discs: &[&Disc], area: f32, edge: f32) -> Mat3 {
    let mut sum = Mat3::ZERO;
    for (i, one) in discs.iter().enumerate() {
        for other in discs[i + 1..].iter().take(BESIDE) {
            let away = (other.position - one.position) / edge;
            let shown = 0.5 * (one.shown + other.shown).length_squared();
            let change =
                (other.shown - one.shown).length_squared() + shown * (other.front - one.front).length_squared();
            let share = 2.0 * (one.area / area) * (other.area / area);
            // One over the distance for the gradient, one more for the unit vector, both squared.
            let over = away.length_squared().max(1e-6).recip();
            let along = away * (over * (share * change).sqrt());
            sum += Mat3::from_cols(along * along.x, along * along.y, along * along.z);
        }
    }
    sum
}

/// The widest gap between discs as they are seen along a line in the direction `to`: the merged disc closes it.
fn gap(flats: impl Iterator<Item = Flat>, to: Vec2) -> f32 {
    let mut reaches: Vec<(f32, f32)> = flats.map(|flat| (-flat.reach(-to), flat.reach(to))).collect();
    reaches.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut covered = f32::INFINITY;
    let mut gap: f32 = 0.0;
    for (from, end) in reaches {
        gap = gap.max(from - covered);
        covered = if covered.is_finite() { covered.max(end) } else { end };
    }
    gap
}

/// A colour as it is displayed: what eyes see of a difference.
pub(super) fn displayed(colour: Vec3) -> Vec3 {
    colour.clamp(Vec3::ZERO, Vec3::ONE).map(srgb::from_linear_nearly)
}
