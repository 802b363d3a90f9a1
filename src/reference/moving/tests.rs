//! Both versions of the traversal against each other and against every surfel by itself. They are few enough for Miri.

use super::*;
use crate::reference::boxes::PACKET;
use crate::reference::traverse::plain as by_plain_code;
use proptest::prelude::*;

/// Times of the rays.
const RANGE: [f64; 2] = [-0.5, 0.8];

/// Random number in [0, 1), the same for the same two numbers.
fn random(i: u64, k: u64) -> f64 {
    f64::from(crate::sampling::hash(i, k)) / 4_294_967_296.0
}

fn vector(i: u64, k: u64) -> DVec3 {
    DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) * 2.0 - 1.0
}

/// A model, and the column of its paths that surfels have none of. Every other size moves by itself; of 60 and 2000
/// each surfel, of others those at one side, far.
fn cloud(n: u64) -> (Surfels, Vec<Vec3>) {
    let mut surfels = Surfels::default();
    for i in 0..n {
        surfels.position.push(vector(i, 0).as_vec3());
        surfels.axis_u.push((vector(i, 3) * 0.3).as_vec3());
        surfels.axis_v.push((vector(i, 6) * 0.3).as_vec3());
        surfels.normal.push(Vec3::Z);
        surfels.colour.push(Vec3::ONE);
    }
    if n % 2 == 1 {
        return (surfels, Vec::new());
    }
    let speed = |i: u64| match n {
        60 | 2000 => 1.0,
        _ if vector(i, 0).x > 0.8 => 20.0,
        _ => 0.0,
    };
    surfels.velocity = (0..n).map(|i| (vector(i, 20) * speed(i)).as_vec3()).collect();
    surfels.acceleration = (0..n).map(|i| (vector(i, 30) * speed(i)).as_vec3()).collect();
    (surfels, (0..n).map(|i| (vector(i, 40) * speed(i)).as_vec3()).collect())
}

fn paths((surfels, third): &(Surfels, Vec<Vec3>)) -> Paths<'_> {
    Paths { columns: [&surfels.velocity, &surfels.acceleration, third] }
}

fn hierarchy<'a>(model: &(Surfels, Vec<Vec3>), range: [f64; 2]) -> Hierarchy<'a> {
    Hierarchy::new(&model.0, &paths(model), (range, 1 << 16), (&|_| (), &|| false))
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
fn depth_of(model: &(Surfels, Vec<Vec3>), i: usize, ray: &ModelRay) -> Option<f64> {
    let surfels = &model.0;
    let [c, a, b] = [surfels.position[i], surfels.axis_u[i], surfels.axis_v[i]].map(Vec3::as_dvec3);
    let [v, acceleration, third] = [&surfels.velocity, &surfels.acceleration, &model.1]
        .map(|column| column.get(i).copied().unwrap_or_default().as_dvec3());
    let t = ray.elapsed[0];
    let c = c + t * (v + t / 2.0 * (acceleration + t / 3.0 * third));
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
    let (surfels_of, packets) = if cfg!(miri) { ([1, 59, 60, 62], 6) } else { ([1, 1999, 2000, 2002], 400) };
    let mut met = 0;
    for n in surfels_of {
        let model = cloud(n);
        let hierarchy = hierarchy(&model, RANGE);
        let slices: Vec<usize> = hierarchy.levels.iter().map(Vec::len).collect();
        if n >= 1000 {
            // What is fast has a level of its own beside what rests.
            let fits = match n {
                2000 => slices[0] > 1,
                2002 => slices.len() > 1 && slices[0] == 1 && slices[slices.len() - 1] >= 8,
                _ => slices == [1],
            };
            assert!(fits, "{n}: {slices:?}");
        }
        for number in 0..packets {
            let rays = packet(number, [PACKET, 1, 5][number as usize % 3]);
            let start = || {
                let mut found = vec![Found::default(); rays.len()];
                found.iter_mut().for_each(Found::clear);
                found
            };
            let (mut quick, mut plain, mut stack) = (start(), start(), Vec::new());
            hierarchy.meet(&rays, &mut quick, &mut stack);
            hierarchy.each(&rays, |bvh, times| by_plain_code(bvh, &rays, times, &mut plain, &mut stack));
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
                    (0..model.0.len()).filter_map(|i| Some((i, depth_of(&model, i, ray)?))).collect();
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

proptest! {
    /// At random times the boxes on the way to a surfel hold all of it, those for a packet of several times too, and it
    /// is in one leaf of each slice.
    #[test]
    fn moving_boxes_hold_their_surfels(
        seed in any::<u64>(),
        n in 1_u64..120,
        speed in prop::sample::select(vec![0.0, 0.01, 1.0, 30.0, 1e4]),
        bend in prop::sample::select(vec![0.0, 1.0, 100.0]),
        from in -3.0_f64..3.0,
        length in prop::sample::select(vec![0.0, 1e-3, 1.0, 50.0]),
        shares in prop::collection::vec(0.0_f64..=1.0, 4),
        spheres in any::<bool>(),
    ) {
        let mut model = cloud(2 * n);
        model.0.spheres = spheres;
        let (velocity, acceleration) = (&mut model.0.velocity, &mut model.0.acceleration);
        for (column, by) in [(velocity, speed), (acceleration, speed * bend), (&mut model.1, bend)] {
            for (i, rate) in column.iter_mut().enumerate() {
                *rate = (vector(seed ^ i as u64, 60) * by).as_vec3();
            }
        }
        let span = [from, from + length];
        let hierarchy = hierarchy(&model, span);
        for share in shares {
            let time = (from + share * length).min(span[1]);
            let mut seen = vec![0; model.0.len()];
            for level in &hierarchy.levels {
                let bvh = &level[hierarchy.slice(level.len(), time)];
                prop_assert!(bvh.span[0] <= time && time <= bvh.span[1]);
                let [start, end] = bvh.span;
                let share = if end > start { (time - start) / (end - start) } else { 0.0 };
                for shares in [[share; 2], [share * 0.7, share], [share, 0.5 + 0.5 * share]] {
                    walk(bvh, shares.map(|share| share as f32), |surfel, [low, high]| {
                        let [c, u, v] = [model.0.position[surfel], model.0.axis_u[surfel], model.0.axis_v[surfel]]
                            .map(Vec3::as_dvec3);
                        let [a, b, d] = [model.0.velocity[surfel], model.0.acceleration[surfel], model.1[surfel]]
                            .map(Vec3::as_dvec3);
                        let c = c + time * (a + time / 2.0 * (b + time / 3.0 * d));
                        let half = if spheres { DVec3::splat(u.length()) } else { (u * u + v * v).map(f64::sqrt) };
                        assert!(low.cmple(c - half).all() && high.cmpge(c + half).all(), "{surfel} at {time}");
                        seen[surfel] += 1;
                    });
                }
            }
            prop_assert!(seen.iter().all(|&count| count == 3));
        }
    }
}

/// Calls `found` with each surfel and each box on the way to it.
fn walk(bvh: &Bvh<'_>, shares: [f32; 2], mut found: impl FnMut(usize, [DVec3; 2])) {
    let mut work = vec![(0_u32, [DVec3::NEG_INFINITY, DVec3::INFINITY])];
    while let Some((number, within)) = work.pop() {
        if number & LEAF != 0 {
            let leaf = &bvh.leaves[(number & !LEAF) as usize];
            leaf.element.into_iter().filter(|&i| i != u32::MAX).for_each(|i| found(i as usize, within));
            continue;
        }
        let node = &bvh.nodes[number as usize];
        let sides = moved(&node.sides, &bvh.drifts[number as usize], shares);
        for slot in 0..WIDTH {
            let [low, high] = corners(&sides, slot).map(|corner| Vec3::from_array(corner).as_dvec3());
            if low.x <= high.x {
                // What a ray must enter to come here.
                work.push((node.children[slot], [within[0].max(low), within[1].min(high)]));
            }
        }
    }
}
