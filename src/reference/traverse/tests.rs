//! Both versions of the traversal against each other and against every surfel by itself. They are few enough for Miri.

use super::*;
use crate::model::Surfels;
use crate::model::paths::elapsed;
use glam::Vec3;

/// Times of the rays.
const RANGE: [f64; 2] = [-0.5, 0.8];

/// Random number in [0, 1), the same for the same two numbers.
fn random(i: u64, k: u64) -> f64 {
    f64::from(crate::sampling::hash(i, k)) / 4_294_967_296.0
}

fn vector(i: u64, k: u64) -> DVec3 {
    DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) * 2.0 - 1.0
}

fn cloud(n: u64) -> Surfels {
    let mut surfels = Surfels::default();
    for i in 0..n {
        surfels.position.push(vector(i, 0).as_vec3());
        surfels.axis_u.push((vector(i, 3) * 0.3).as_vec3());
        surfels.axis_v.push((vector(i, 6) * 0.3).as_vec3());
        surfels.normal.push(Vec3::Z);
        surfels.colour.push(Vec3::ONE);
    }
    // Every other size of model moves by itself.
    if n.is_multiple_of(2) {
        surfels.velocity = (0..n).map(|i| vector(i, 20).as_vec3()).collect();
        surfels.acceleration = (0..n).map(|i| vector(i, 30).as_vec3()).collect();
    }
    surfels
}

/// Rays of a packet: from one place outside the model through places near each other, or in all directions.
fn packet(number: u64, rays: usize) -> Vec<ModelRay> {
    let eye = vector(number, 100).normalize() * 5.0;
    let spread = if number.is_multiple_of(2) { 0.2 } else { 3.0 };
    let target = vector(number, 110) * 0.5;
    let ray = |lane: usize| ModelRay {
        origin: eye,
        direction: (target + vector(number, 120 + 3 * lane as u64) * spread - eye) * 0.25,
        near: 0.1,
        epsilon: 0.3,
        two_sided: number.is_multiple_of(3),
        object: 7,
        lane,
        elapsed: elapsed(RANGE[0] + (RANGE[1] - RANGE[0]) * random(number, 150 + lane as u64)),
    };
    (0..rays).map(ray).collect()
}

/// The depth of surfel `i` on the ray, where the ray meets it: the plane's equation, then two equations for u and v.
fn depth_of(surfels: &Surfels, i: usize, ray: &ModelRay) -> Option<f64> {
    let [c, a, b] = [surfels.position[i], surfels.axis_u[i], surfels.axis_v[i]].map(Vec3::as_dvec3);
    let [v, acceleration] =
        [&surfels.velocity, &surfels.acceleration].map(|column| column.get(i).copied().unwrap_or_default().as_dvec3());
    let c = c + v * ray.elapsed[0] + acceleration * (ray.elapsed[0] * ray.elapsed[0] / 2.0);
    let normal = a.cross(b);
    let facing = normal.dot(ray.direction);
    let depth = normal.dot(c - ray.origin) / facing;
    let p = ray.origin + ray.direction * depth - c;
    let (aa, ab, bb, pa, pb) = (a.dot(a), a.dot(b), b.dot(b), p.dot(a), p.dot(b));
    let det = aa * bb - ab * ab;
    let (u, v) = ((pa * bb - pb * ab) / det, (pb * aa - pa * ab) / det);
    (u * u + v * v <= 1.0 && depth >= ray.near && (ray.two_sided || facing < 0.0)).then_some(depth)
}

fn hits(found: &Found) -> Vec<(u32, u64, u64, u64, bool)> {
    let mut all: Vec<_> =
        found.hits.iter().map(|h| (h.element, h.depth.to_bits(), h.u.to_bits(), h.v.to_bits(), h.back)).collect();
    all.sort_unstable();
    all
}

#[test]
fn both_versions_find_what_each_surfel_says() {
    let (surfels_of, packets) = if cfg!(miri) { ([1, 59, 60], 6) } else { ([1, 1999, 2000], 400) };
    let mut met = 0;
    for n in surfels_of {
        let surfels = cloud(n);
        let bvh = Bvh::new(&surfels, &surfels.paths(), RANGE);
        for number in 0..packets {
            let rays = packet(number, [PACKET, 1, 5][number as usize % 3]);
            let start = || {
                let mut found = vec![Found::default(); rays.len()];
                found.iter_mut().for_each(Found::clear);
                found
            };
            let (mut quick, mut plain, mut stack) = (start(), start(), Vec::new());
            traverse(&bvh, &rays, &mut quick, &mut stack);
            traverse_body(&bvh, &rays, &mut plain, &mut stack, enter_beam, enter_rays);
            for (lane, ray) in rays.iter().enumerate() {
                // To the bit, also where AVX2 found the boxes in another order.
                let limit = quick[lane].limit;
                assert_eq!(limit.to_bits(), plain[lane].limit.to_bits());
                let of = |found: &Found| {
                    let within = found.hits.iter().copied().filter(|hit| hit.depth <= limit).collect();
                    hits(&Found { hits: within, limit, ..Found::default() })
                };
                assert_eq!(of(&quick[lane]), of(&plain[lane]));
                let all: Vec<(usize, f64)> =
                    (0..surfels.len()).filter_map(|i| Some((i, depth_of(&surfels, i, ray)?))).collect();
                let nearest = all.iter().map(|hit| hit.1).fold(f64::INFINITY, f64::min);
                assert!((limit - (nearest + 0.3)).abs() < 1e-8 || limit == nearest + 0.3, "{limit} {nearest}");
                let mut want: Vec<u32> = all.iter().filter(|hit| hit.1 <= limit).map(|hit| hit.0 as u32).collect();
                want.sort_unstable();
                let got: Vec<u32> = of(&quick[lane]).iter().map(|hit| hit.0).collect();
                assert_eq!(got, want, "packet {number}, lane {lane}");
                met += want.len();
            }
        }
    }
    assert!(met > if cfg!(miri) { 5 } else { 2000 }, "{met}");
}
