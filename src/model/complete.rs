//! Completes a cloud into surfels: recentres it, and gives every point a normal, axes and a linear colour.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::cloud::{Cloud, ColourStorage, PLAIN, each_column};
use super::error::ModelError;
use super::neighbours::{Distinct, Neighbours};
use super::normals::Seen;
use super::options::{ColourSpace, Kind, LoadOptions, LoadProgress};
use super::surfels::{KeptLevels, Material, Normalisation, Surfels};
use super::tidy::MAX_COORDINATE;
use super::{colour_by, normals, radii, spacing, spheres, strays, tidy, variance};
use crate::math::{Bounds, srgb};

/// Smallest length, model units. Its square does not underflow in `f32`.
const TINY: f64 = 1e-18;
/// Greatest magnitude of a linear colour: the greatest 16-bit float.
const BRIGHTEST: f32 = 65_504.0;
/// Least sine of the angle between two axes.
const PARALLEL: f64 = 1e-4;

/// Makes a cloud renderable. Returns the surfels in the order of the cloud, and the notes of the cloud and of this
/// function.
///
/// Points that are not finite or farther than 1e18 from the origin are dropped. Positions become relative to the centre
/// of their box. Missing normals and radii are estimated; the missing normal of an elliptical splat is that of u x v.
/// Lengths are kept within 1e-18..=1e18. Missing colours are white. A column whose length is not that of `position` is
/// ignored. There are at most 2^32 - 1 points. The result does not depend on the number of threads.
///
/// # Errors
/// [`ModelError::NoPoints`] if no point is left.
pub fn complete(
    mut cloud: Cloud,
    options: &LoadOptions,
    progress: LoadProgress<'_>,
) -> Result<(Surfels, Vec<String>), ModelError> {
    let mut notes = std::mem::take(&mut cloud.notes);
    drop_misfits(&mut cloud, &mut notes);
    drop_unusable(&mut cloud, &mut notes);
    if cloud.position.is_empty() {
        return Err(ModelError::NoPoints);
    }
    if options.points.clean {
        clean(&mut cloud, progress, &mut notes);
    }
    let (origin, position) = recentred(&cloud.position);
    cloud.position = Vec::new();

    if let Some(radius) = options.points.radius {
        cloud.axes = Vec::new();
        cloud.radius = vec![radius as f32; position.len()];
    }
    let stations: Vec<Vec3> = cloud.stations.iter().map(|place| (*place - origin).as_vec3()).collect();
    let as_spheres = options.kind == Some(Kind::Spheres);
    let (normal, axes) = if as_spheres {
        balls(&mut cloud, &position, options.radius_scale, &mut notes)
    } else {
        surfaces(&mut cloud, &position, &stations, options.radius_scale, progress, &mut notes)
    };
    let (axis_u, axis_v) = axes.into_par_iter().map(|[u, v]| (u, v)).unzip();
    let colour = match &options.points.colour_by {
        Some(by) if !cloud.value.is_empty() => {
            let without = cloud.value.iter().filter(|value| value.is_nan()).count();
            if without > 0 {
                notes.push(format!("{without} points have no value in `{}` (drawn grey)", by.column));
            }
            by.colours(&cloud.value, by.range.or(colour_by::range(&cloud.value)).unwrap_or_default())
        }
        _ => linear_colours(&cloud, position.len(), options.colour_space, &mut notes),
    };
    repair(&mut cloud.material, Material::is_valid, Material::default(), "reflection coefficients", &mut notes);
    repair(&mut cloud.velocity, Vec3::is_finite, Vec3::ZERO, "velocities", &mut notes);
    repair(&mut cloud.acceleration, Vec3::is_finite, Vec3::ZERO, "accelerations", &mut notes);
    repair(&mut cloud.opacity, |opacity| (0.0..=1.0).contains(&opacity), 1.0, "opacities", &mut notes);
    let surfels = Surfels {
        origin,
        position,
        axis_u,
        axis_v,
        normal,
        colour,
        material: cloud.material,
        velocity: cloud.velocity,
        id: cloud.id,
        acceleration: cloud.acceleration,
        velocity_unit: cloud.velocity_unit,
        opacity: cloud.opacity,
        normalisation: Normalisation::default(),
        levels: KeptLevels::default(),
        two_sided: cloud.two_sided,
        signs_estimated: cloud.signs_estimated,
        spheres: as_spheres,
    };
    Ok((surfels, notes))
}

/// Empties columns of another length than that of `position`, and notes them.
fn drop_misfits(cloud: &mut Cloud, notes: &mut Vec<String>) {
    let points = cloud.position.len();
    macro_rules! check {
        ($column:ident, $name:expr) => {
            let length = cloud.$column.len();
            if length != points && length != 0 {
                notes.push(format!("{} ignored: {length} of them for {points} points", $name));
                cloud.$column = Vec::new();
            }
        };
    }
    each_column!(check);
}

fn drop_unusable(cloud: &mut Cloud, notes: &mut Vec<String>) {
    // NaN and infinity fail the comparison too.
    let kept: Vec<bool> =
        cloud.position.par_iter().map(|p| p.abs().cmple(DVec3::splat(MAX_COORDINATE)).all()).collect();
    let dropped = kept.iter().filter(|&&k| !k).count();
    if dropped > 0 {
        notes.push(format!("{dropped} points dropped: position not finite or beyond {MAX_COORDINATE:e}"));
        tidy::retain(cloud, &kept);
    }
}

/// The centre of the box of some points, and their places relative to it.
fn recentred(position: &[DVec3]) -> (DVec3, Vec<Vec3>) {
    let origin = box_of(position).centre();
    (origin, position.par_iter().map(|p| (p - origin).as_vec3()).collect())
}

/// Leaves stray points out.
fn clean(cloud: &mut Cloud, progress: LoadProgress<'_>, notes: &mut Vec<String>) {
    let (_, position) = recentred(&cloud.position);
    let distinct = Distinct::new(&position);
    let neighbours = Neighbours::new(&distinct.position, variance::NEAREST, progress);
    let spacing = spacing::spacing(&distinct.position, &neighbours);
    let Some(strays) = strays::find(&distinct.position, &neighbours, &spacing) else { return };
    let kept: Vec<bool> = distinct.of.iter().map(|i| !strays[*i as usize]).collect();
    let dropped = kept.iter().filter(|kept| !**kept).count();
    let share = 100.0 * dropped as f64 / kept.len() as f64;
    notes.push(format!("{dropped} stray points left out ({share:.2} %)"));
    tidy::retain(cloud, &kept);
}

fn box_of(position: &[DVec3]) -> Bounds {
    let merge = |mut a: Bounds, b: Bounds| {
        a.merge(&b);
        a
    };
    let add = |mut bounds: Bounds, &p: &DVec3| {
        bounds.add(p);
        bounds
    };
    position.par_iter().fold(Bounds::default, add).reduce(Bounds::default, merge)
}

/// Returns the normals and axes of all points, and empties `normal`, `radius` and `axes` of the cloud. Says in the
/// cloud whether signs were estimated, and shows both sides where they mean nothing.
fn surfaces(
    cloud: &mut Cloud,
    position: &[Vec3],
    stations: &[Vec3],
    radius_scale: f64,
    progress: LoadProgress<'_>,
    notes: &mut Vec<String>,
) -> (Vec<Vec3>, Vec<[Vec3; 2]>) {
    let points = position.len();
    let mut normal = std::mem::take(&mut cloud.normal);
    normal.resize(points, Vec3::ZERO);
    let mut radius = std::mem::take(&mut cloud.radius);
    radius.resize(points, 0.0);
    let mut axes = std::mem::take(&mut cloud.axes);
    let elliptical = !axes.is_empty();
    axes.resize(points, [Vec3::ZERO; 2]);

    // The loop takes what the file says of each point; zero stands for what is missing.
    let mut flat = 0;
    for ((n, r), a) in normal.iter_mut().zip(&mut radius).zip(&mut axes) {
        *n = unit(*n).unwrap_or(Vec3::ZERO);
        *r = length(f64::from(*r)).unwrap_or(0.0);
        let lengths = a.map(|axis| length(axis.as_dvec3().length()).unwrap_or(0.0));
        if let Some(across) = plane(*a, lengths) {
            *r = lengths[0].max(lengths[1]);
            if *n == Vec3::ZERO {
                *n = across;
            }
        } else if elliptical {
            flat += 1;
            *a = [Vec3::ZERO; 2];
            let longer = lengths[0].max(lengths[1]);
            *r = if longer > 0.0 { longer } else { *r };
        }
    }
    if flat > 0 {
        notes.push(format!("axes of {flat} points are zero, parallel or not finite: drawn as discs"));
    }
    let seen = Seen { stations, of: &cloud.station };
    if let Some(reliable) = estimate(position, &seen, &mut normal, &mut radius, progress, notes) {
        cloud.signs_estimated = true;
        cloud.two_sided |= !reliable;
    }

    let (normals, radii) = (&normal, &radius);
    axes.par_iter_mut().enumerate().for_each(|(i, a)| *a = scaled_axes(*a, normals[i], radii[i], radius_scale));
    (normal, axes)
}

/// The same of points that are drawn as spheres. Their radius is that of the file, or the longer axis.
fn balls(
    cloud: &mut Cloud,
    position: &[Vec3],
    radius_scale: f64,
    notes: &mut Vec<String>,
) -> (Vec<Vec3>, Vec<[Vec3; 2]>) {
    let axes = std::mem::take(&mut cloud.axes);
    let mut radius = std::mem::take(&mut cloud.radius);
    radius.resize(position.len(), 0.0);
    for (i, radius) in radius.iter_mut().enumerate() {
        let longer =
            axes.get(i).map_or(0.0, |axes| axes.map(|axis| axis.as_dvec3().length()).into_iter().fold(0.0, f64::max));
        *radius = length(longer).or_else(|| length(f64::from(*radius))).unwrap_or(0.0);
    }
    if let Some(usual) = spheres::complete_radii(position, &mut radius) {
        notes.push(format!("spheres without a radius have one of {usual:.6}, after the distances of neighbours"));
    }
    cloud.normal = Vec::new();
    // They have no sides.
    (cloud.two_sided, cloud.signs_estimated) = (true, false);
    let scaled = |radius: &f32| {
        let radius = f64::from(*radius);
        spheres::axes((radius * radius_scale.min(MAX_COORDINATE / radius).max(TINY / radius)) as f32)
    };
    (vec![Vec3::Z; position.len()], radius.par_iter().map(scaled).collect())
}

/// A unit vector along `n`; `None` if `n` is zero or not finite.
fn unit(n: Vec3) -> Option<Vec3> {
    if n.is_finite() && n.is_normalized() { Some(n) } else { n.as_dvec3().try_normalize().map(DVec3::as_vec3) }
}

/// A length that `f32` can square; `None` if it is not positive or beyond [`MAX_COORDINATE`].
fn length(l: f64) -> Option<f32> {
    (l > 0.0 && l <= MAX_COORDINATE).then(|| l.max(TINY) as f32)
}

/// Unit normal of the plane of two axes; `None` if they span none.
fn plane([u, v]: [Vec3; 2], lengths: [f32; 2]) -> Option<Vec3> {
    if lengths.contains(&0.0) {
        return None;
    }
    let across = u.as_dvec3().normalize_or_zero().cross(v.as_dvec3().normalize_or_zero());
    if across.length() > PARALLEL { unit(across.as_vec3()) } else { None }
}

/// Fills in the normals and radii that are zero. If there were such normals: can their signs be relied on?
fn estimate(
    position: &[Vec3],
    seen: &Seen<'_>,
    normal: &mut [Vec3],
    radius: &mut [f32],
    progress: LoadProgress<'_>,
    notes: &mut Vec<String>,
) -> Option<bool> {
    let normals_missing = normal.contains(&Vec3::ZERO);
    let radii_missing = radius.contains(&0.0);
    if !normals_missing && !radii_missing {
        return None;
    }
    let points = position.len();
    let share = |count: usize| if count == points { "all".to_owned() } else { format!("{count} of") };
    let distinct = Distinct::new(position);
    let mut signs = None;
    let count = if normals_missing { variance::NEAREST } else { spacing::NEAREST };
    let neighbours = Neighbours::new(&distinct.position, count, progress);
    let least = |count: usize| count.min(distinct.position.len() - 1);
    if normals_missing {
        let estimated = normals::estimate(normal, &distinct, seen, &neighbours, progress);
        let near = least(variance::NEAREST);
        let backs = 100.0 * estimated.most_backs;
        let sides = if seen.is_known() {
            "turned to the scanners: both sides show".to_owned()
        } else if estimated.reliable {
            format!("closed ({backs:.1} % of the worst view shows backs): one-sided")
        } else {
            format!("open or unclear ({backs:.1} % of the worst view shows backs): both sides show")
        };
        let share = share(estimated.count);
        notes.push(format!("normals of {share} {points} points estimated from {near} neighbours; {sides}"));
        // A room that was scanned from inside has no outside.
        signs = Some(estimated.reliable && !seen.is_known());
    }
    if normals_missing && spheres::fills_volume(position) {
        notes.push(
            "the points fill a volume: normals of its inside say nothing (kind `spheres` draws a sphere about each)"
                .to_owned(),
        );
    }
    if radii_missing {
        let estimated = radii::estimate(radius, &distinct, &neighbours);
        let near = least(spacing::NEAREST);
        notes.push(format!("radii of {} {points} points estimated from {near} neighbours", share(estimated.count)));
        if estimated.fog > 0 {
            notes.push(format!(
                "{} points are in the air, and are drawn as small as most (`clean` leaves them out)",
                estimated.fog
            ));
        }
        if estimated.lone > 0 {
            notes.push(format!("radii of {} lone points limited to those around them", estimated.lone));
        }
    }
    signs
}

/// The axes of a surfel: those of the file, or those of a disc perpendicular to the normal. (u x v) . normal >= 0.
fn scaled_axes(axes: [Vec3; 2], normal: Vec3, radius: f32, scale: f64) -> [Vec3; 2] {
    let [u, v] = if axes == [Vec3::ZERO; 2] {
        // This orthonormal frame is that of Duff et al. 2017, which is continuous except at n.z = 0.
        let (u, v) = normal.any_orthonormal_pair();
        let radius = f64::from(radius);
        [u.as_dvec3() * radius, v.as_dvec3() * radius]
    } else {
        axes.map(Vec3::as_dvec3)
    };
    // A factor that would leave the range is limited, so that the axes keep their ratio.
    let (longer, shorter) = (u.length().max(v.length()), u.length().min(v.length()));
    let scale = scale.min(MAX_COORDINATE / longer).max(TINY / shorter);
    // Lengths are limited, not components: these would turn an axis onto the other.
    let [u, v] = [u, v].map(|a| (a * scale).clamp_length_max(MAX_COORDINATE).as_vec3());
    if u.cross(v).dot(normal) < 0.0 { [v, u] } else { [u, v] }
}

/// Colours in linear light; grey where there is none.
fn linear_colours(cloud: &Cloud, points: usize, space: Option<ColourSpace>, notes: &mut Vec<String>) -> Vec<Vec3> {
    if cloud.colour.is_empty() {
        notes.push("no colours: grey".to_owned());
        return vec![Vec3::splat(PLAIN); points];
    }
    let unusable = cloud.colour.par_iter().filter(|c| !c.is_finite()).count();
    if unusable > 0 {
        notes.push(format!("colours of {unusable} points are not finite: white"));
    }
    let by_storage = match cloud.colour_storage {
        ColourStorage::Integer => ColourSpace::Srgb,
        ColourStorage::Float => ColourSpace::Linear,
    };
    let is_linear = space.unwrap_or(by_storage) == ColourSpace::Linear;
    // Colours stored as bytes take one of 256 values. The transfer curve costs a power, a table only a look-up.
    let bytes: Vec<(f32, f32)> =
        (0..=255_u8).map(|b| f32::from(b) / 255.0).map(|encoded| (encoded, srgb::to_linear(encoded))).collect();
    let channel = |encoded: f32| {
        if is_linear {
            return encoded;
        }
        match bytes.get((encoded * 255.0).round() as usize) {
            Some(&(exact, linear)) if exact == encoded => linear,
            _ => srgb::to_linear(encoded),
        }
    };
    let clamped = |c: f32| channel(c).clamp(-BRIGHTEST, BRIGHTEST);
    let linear = |c: &Vec3| if c.is_finite() { Vec3::from(c.to_array().map(clamped)) } else { Vec3::ONE };
    cloud.colour.par_iter().map(linear).collect()
}

/// Replaces the entries that are not valid, and notes their number.
fn repair<T: Copy>(column: &mut [T], is_valid: fn(T) -> bool, fill: T, name: &str, notes: &mut Vec<String>) {
    let mut count = 0;
    for entry in column.iter_mut().filter(|e| !is_valid(**e)) {
        *entry = fill;
        count += 1;
    }
    if count > 0 {
        notes.push(format!("{name} of {count} points are not valid: replaced by the default"));
    }
}

#[cfg(test)]
mod tests;
