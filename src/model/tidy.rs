//! The step that every format needs after reading: it drops points that cannot be drawn, makes odd attributes harmless,
//! and counts both in the notes.

use glam::{DVec3, Vec3};

use super::cloud::{Cloud, each_column};
pub(super) use crate::limits::MAX_COORDINATE;
use crate::math::Bounds;

/// Drops points whose position is not finite or beyond [`MAX_COORDINATE`], and normalises normals.
///
/// Unusable attributes become "missing" for that point (normal and axes zero, radius zero), and [`super::complete`]
/// estimates them. A colour that is not finite becomes white.
pub(super) fn tidy(mut cloud: Cloud) -> Cloud {
    let keep: Vec<bool> = cloud.position.iter().map(|p| drawable(*p)).collect();
    let dropped = keep.iter().filter(|k| !**k).count();
    if dropped > 0 {
        retain(&mut cloud, &keep);
        cloud.notes.push(format!("{dropped} points dropped: a coordinate is not finite or beyond {MAX_COORDINATE:e}"));
    }
    for normal in &mut cloud.normal {
        *normal = unit(*normal);
    }
    for radius in &mut cloud.radius {
        if !(radius.is_finite() && *radius > 0.0 && f64::from(*radius) <= MAX_COORDINATE) {
            *radius = 0.0;
        }
    }
    // These are counted when they are replaced.
    each(&mut cloud.axes, |[u, v]| !usable(*u, *v), [Vec3::ZERO; 2]);
    let odd = each(&mut cloud.colour, |c| !c.is_finite(), Vec3::ONE);
    note(&mut cloud.notes, odd, "a colour that is not finite (drawn white)");
    clamp_colours(&mut cloud);
    let odd = each(&mut cloud.opacity, |o| !(0.0..=1.0).contains(o), 1.0);
    note(&mut cloud.notes, odd, "an opacity outside 0 to 1 (taken as 1)");
    drop_idle_opacities(&mut cloud);
    // Points that rest cost nothing.
    for rates in [&mut cloud.velocity, &mut cloud.acceleration] {
        if rates.iter().all(|rate| *rate == Vec3::ZERO) {
            *rates = Vec::new();
        }
    }
    cloud
}

/// Raises what is negative in colours to 0: no surface reflects less than nothing.
pub(super) fn clamp_colours(cloud: &mut Cloud) {
    let negative = |c: &Vec3| c.min_element() < 0.0;
    let count = cloud.colour.iter().filter(|c| negative(c)).count();
    cloud.colour.iter_mut().filter(|c| negative(c)).for_each(|c| *c = c.max(Vec3::ZERO));
    note(&mut cloud.notes, count, "a negative colour (taken as 0)");
}

/// What to say of 32-bit coordinates of `points` points in a box: their steps are too coarse for its size, or for the
/// distance of the points. `None` if they are fine enough.
///
/// The step is the distance of two floats at the largest coordinate. It is too coarse if it is above a thousandth of
/// the box, which shows in a picture, or above the distance of points that cover a square as large as the box.
pub(super) fn coarse(bounds: &Bounds, points: usize) -> Option<String> {
    if bounds.is_empty() {
        return None;
    }
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element() as f32;
    let extent = bounds.size().max_element();
    let step = largest.next_up() - largest;
    let fewest = 1000.0_f64.max((points as f64).sqrt());
    (extent > 0.0 && f64::from(step) * fewest > extent).then(|| {
        let extent = extent as f32;
        format!(
            "float coordinates up to {largest} have steps of {step}, for an extent of {extent}: write doubles, or take \
                 an offset off"
        )
    })
}

/// Box around the points that can be drawn.
pub(super) fn box_of(position: &[DVec3]) -> Bounds {
    position.iter().filter(|p| drawable(**p)).copied().collect()
}

/// Empties a column of opacities that says nothing, so that the model stays opaque and needs no order: all are as good
/// as 1, or all are 0, as exporters write that know no opacity.
fn drop_idle_opacities(cloud: &mut Cloud) {
    /// Less would be seen in 8 bits.
    const OPAQUE: f32 = 254.0 / 255.0;
    if cloud.opacity.iter().all(|opacity| *opacity >= OPAQUE) {
        cloud.opacity = Vec::new();
    } else if cloud.opacity.iter().all(|opacity| *opacity == 0.0) {
        cloud.opacity = Vec::new();
        cloud.notes.push("the opacities of all points are 0: taken as opaque".to_owned());
    }
}

/// Keeps the points whose flag is set, in order.
pub(super) fn retain(cloud: &mut Cloud, keep: &[bool]) {
    fn filter<T>(items: &mut Vec<T>, keep: &[bool]) {
        let mut flags = keep.iter();
        items.retain(|_| flags.next().copied().unwrap_or(false));
    }
    filter(&mut cloud.position, keep);
    macro_rules! filter_column {
        ($column:ident, $name:expr) => {
            filter(&mut cloud.$column, keep);
        };
    }
    each_column!(filter_column);
}

/// True for axes that span a plane: they are finite, not too long, and not parallel (sine of the angle above 1e-6).
pub(super) fn usable(u: Vec3, v: Vec3) -> bool {
    let (u, v) = (u.as_dvec3(), v.as_dvec3());
    let area = u.cross(v).length();
    let product = u.length() * v.length();
    u.is_finite() && v.is_finite() && u.abs().max(v.abs()).max_element() <= MAX_COORDINATE && area > 1e-6 * product
}

/// Unit vector along `normal`; zero where `normal` has no direction. A vector that is one already (to 1e-6) is
/// unchanged, so that re-reading is exact.
pub(super) fn unit(normal: Vec3) -> Vec3 {
    let wide = normal.as_dvec3();
    if (wide.length_squared() - 1.0).abs() < 1e-6 {
        return normal;
    }
    let length = wide.length();
    if length.is_finite() && length > 1e-30 { (wide / length).as_vec3() } else { Vec3::ZERO }
}

fn drawable(p: DVec3) -> bool {
    // Comparisons with NaN are false.
    p.x.abs() <= MAX_COORDINATE && p.y.abs() <= MAX_COORDINATE && p.z.abs() <= MAX_COORDINATE
}

fn each<T: Copy>(items: &mut [T], odd: impl Fn(&T) -> bool, instead: T) -> usize {
    let mut count = 0;
    for item in items.iter_mut().filter(|item| odd(item)) {
        *item = instead;
        count += 1;
    }
    count
}

fn note(notes: &mut Vec<String>, count: usize, what: &str) {
    if count > 0 {
        notes.push(format!("{count} points have {what}"));
    }
}
