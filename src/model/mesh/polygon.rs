//! Polygons to triangles.

use glam::{DVec2, DVec3};

/// Most corners of a concave polygon whose ears are clipped: the time grows with their square.
const MOST_CORNERS: usize = 256;

/// The triangles of a polygon, as indices of its corners, in its winding; `None` where it crosses itself, has no area,
/// or is concave with too many corners.
///
/// Convex polygons become fans. Others lose their ears one by one (Meisters 1975).
pub(in crate::model) fn triangulate(corners: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let count = corners.len();
    if count < 3 {
        return Some(Vec::new());
    }
    if count == 3 {
        return Some(fan(count));
    }
    let flat = flattened(corners)?;
    let next = |i: usize| (i + 1) % count;
    let before = |i: usize| (i + count - 1) % count;
    let turns_left = |i: usize| {
        let [p, q, r] = [before(i), i, next(i)].map(|k| flat[k]);
        let turn = area(p, q, r);
        // A way back has no area either.
        turn > 0.0 || turn == 0.0 && (q - p).dot(r - q) >= 0.0
    };
    if (0..count).all(turns_left) && turns_once(&flat) {
        return Some(fan(count));
    }
    if count > MOST_CORNERS { None } else { clipped(&flat) }
}

/// The triangles from the first corner to all edges.
pub(in crate::model) fn fan(count: usize) -> Vec<[usize; 3]> {
    (1..count.saturating_sub(1)).map(|i| [0, i, i + 1]).collect()
}

/// The note on `count` polygons that [`triangulate`] does not cut.
pub(in crate::model) fn fans(count: usize) -> String {
    format!("faces that cross themselves or have too many corners are drawn as fans ({count})")
}

/// The corners that are left, as a ring.
struct Ring<'a> {
    flat: &'a [DVec2],
    next: Vec<usize>,
    before: Vec<usize>,
    /// Corners that may lie in an ear: those that did not turn left at first. Cutting makes no others.
    inward: Vec<usize>,
}

impl Ring<'_> {
    /// Twice the area that a corner cuts off.
    fn area(&self, i: usize) -> f64 {
        area(self.flat[self.before[i]], self.flat[i], self.flat[self.next[i]])
    }

    fn is_ear(&self, i: usize) -> bool {
        let [p, q, r] = [self.before[i], i, self.next[i]].map(|k| self.flat[k]);
        let within = |&k: &usize| {
            let x = self.flat[k];
            let other = x != p && x != q && x != r;
            other && area(p, q, x) >= 0.0 && area(q, r, x) >= 0.0 && area(r, p, x) >= 0.0
        };
        self.area(i) > 0.0 && !self.inward.iter().any(within)
    }
}

/// Ears of a counter-clockwise polygon: after each cut its two neighbours alone can have become ears.
fn clipped(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let count = flat.len();
    let next: Vec<usize> = (0..count).map(|i| (i + 1) % count).collect();
    let before: Vec<usize> = (0..count).map(|i| (i + count - 1) % count).collect();
    let mut ring = Ring { flat, next, before, inward: Vec::new() };
    ring.inward = (0..count).filter(|&i| ring.area(i) <= 0.0).collect();
    if ring.inward.is_empty() {
        // It turns left everywhere, and more than once.
        return None;
    }
    let mut ears: Vec<bool> = (0..count).map(|i| ring.is_ear(i)).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    let mut at = 0;
    for left in (4..=count).rev() {
        // Once round.
        let ear = std::iter::successors(Some(at), |&i| Some(ring.next[i])).take(left).find(|&i| ears[i])?;
        let (a, c) = (ring.before[ear], ring.next[ear]);
        triangles.push([a, ear, c]);
        (ring.next[a], ring.before[c]) = (c, a);
        ring.inward.retain(|&k| k != ear);
        let spike = |k: usize| flat[ring.before[k]] == flat[ring.next[k]];
        ears[a] = spike(a) || ring.is_ear(a);
        ears[c] = spike(c) || ring.is_ear(c);
        at = c;
    }
    triangles.push([ring.before[at], at, ring.next[at]]);
    // What crosses itself covers more than its area, or turns over.
    let of_triangle = |t: &[usize; 3]| area(flat[t[0]], flat[t[1]], flat[t[2]]);
    triangles.iter().all(|t| of_triangle(t) >= 0.0).then_some(triangles)
}

/// Twice the signed area of a triangle.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// True if a polygon whose corners all turn left turns once, and not several times, as a star does.
fn turns_once(flat: &[DVec2]) -> bool {
    let edges = flat.iter().zip(flat.iter().cycle().skip(1)).map(|(a, b)| *b - *a);
    // Once round, an edge goes from downwards to upwards once.
    let mut ups = edges.filter(|edge| edge.y != 0.0).map(|edge| edge.y > 0.0);
    let Some(first) = ups.next() else { return true };
    let (mut last, mut changes) = (first, 0);
    for up in ups.chain([first]) {
        changes += usize::from(up != last);
        last = up;
    }
    changes <= 2
}

/// The polygon on the coordinate plane that it is nearest to, counter-clockwise; `None` without area.
fn flattened(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    // Newell's normal, about a corner so that positions far away keep their digits.
    let origin = *corners.first()?;
    let rounds = corners.iter().zip(corners.iter().cycle().skip(1));
    let normal: DVec3 = rounds.map(|(a, b)| (*a - origin).cross(*b - origin)).sum();
    let size = normal.abs();
    if !(normal.is_finite() && size.max_element() > 0.0) {
        return None;
    }
    let (axis, pick): (f64, fn(DVec3) -> DVec2) = if size.z >= size.x && size.z >= size.y {
        (normal.z, |p| DVec2::new(p.x, p.y))
    } else if size.x >= size.y {
        (normal.x, |p| DVec2::new(p.y, p.z))
    } else {
        (normal.y, |p| DVec2::new(p.z, p.x))
    };
    let side = if axis < 0.0 { -1.0 } else { 1.0 };
    Some(corners.iter().map(|p| pick(*p - origin) * DVec2::new(side, 1.0)).collect())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn total(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let area = |t: &[usize; 3]| 0.5 * (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).z;
        assert!(triangles.iter().all(|t| area(t) >= 0.0), "{triangles:?}");
        triangles.iter().map(area).sum()
    }

    fn polygon(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|&(x, y)| DVec3::new(x, y, 3.0)).collect()
    }

    /// A star of `points` points whose inner corners are at `inner`.
    fn star(points: u32, inner: f64) -> Vec<DVec3> {
        let corner = |i: u32| {
            let angle = std::f64::consts::PI * f64::from(i) / f64::from(points);
            DVec3::new(angle.cos(), angle.sin(), 0.0) * if i.is_multiple_of(2) { 1.0 } else { inner }
        };
        (0..2 * points).map(corner).collect()
    }

    #[test]
    fn concave_polygons_keep_their_area_and_side() {
        // An L, whose area a fan from its first corner would miss.
        let l = polygon(&[(2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 0.0), (2.0, 0.0)]);
        for turn in 0..6 {
            let mut corners = l.clone();
            corners.rotate_left(turn);
            let triangles = triangulate(&corners).unwrap();
            assert_eq!(triangles.len(), 4);
            assert_eq!(total(&corners, &triangles), 3.0);
        }
        // The other way round each triangle has the other side.
        let clockwise: Vec<DVec3> = l.iter().rev().copied().collect();
        let triangles = triangulate(&clockwise).unwrap();
        let turned: Vec<[usize; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        assert_eq!((triangles.len(), total(&clockwise, &turned)), (4, 3.0));
        let square = polygon(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]);
        assert_eq!(total(&square, &triangulate(&square).unwrap()), 4.0);
    }

    #[test]
    fn stars_and_combs_keep_their_area() {
        for (points, inner) in [(5, 0.4), (7, 0.1), (64, 0.5), (128, 0.9)] {
            let corners = star(points, inner);
            let triangles = triangulate(&corners).unwrap();
            assert_eq!(triangles.len(), corners.len() - 2);
            // Two triangles a point, each between the middle, a tip and an inner corner.
            let area = f64::from(points) * inner * (std::f64::consts::PI / f64::from(points)).sin();
            assert!((total(&corners, &triangles) - area).abs() < 1e-12, "{points}");
        }
        // Teeth of width 1 and height 4 on a bar of height 1, with corners on straight lines.
        let mut comb = vec![(20.0, 0.0), (20.0, 1.0)];
        for i in (0..10).rev() {
            let x = 2.0 * f64::from(i);
            comb.extend([(x + 1.0, 1.0), (x + 1.0, 5.0), (x, 5.0), (x, 1.0)]);
        }
        comb.extend([(0.0, 0.0), (7.0, 0.0)]);
        let corners = polygon(&comb);
        assert_eq!(total(&corners, &triangulate(&corners).unwrap()), 60.0);
    }

    #[test]
    fn a_polygon_may_touch_itself() {
        // Two squares that share a corner.
        let bow =
            polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(total(&bow, &triangulate(&bow).unwrap()), 2.0);
    }

    /// Outlines of random trees of squares: with corners on straight lines, slits, and places that they touch twice.
    #[test]
    fn outlines_of_trees_of_squares_keep_their_area() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        for round in 0..12_000 {
            let mut ring = vec![[0, 0], [1, 0], [1, 1], [0, 1]];
            let mut cells = vec![[0, 0]];
            let most = 2 + round % 120;
            for _ in 0..20 * most {
                // The cell beyond an edge, to the right of it.
                let at = random.random_range(0..ring.len());
                let [a, b] = [ring[at], ring[(at + 1) % ring.len()]];
                let right = [b[1] - a[1], a[0] - b[0]];
                let cell = [0, 1].map(|k| a[k].min(b[k]) + right[k].min(0));
                if cells.len() < most && !cells.contains(&cell) {
                    cells.push(cell);
                    let beyond = [a, b].map(|p| [p[0] + right[0], p[1] + right[1]]);
                    let after = at + 1;
                    ring.splice(after..after, beyond);
                }
            }
            let corners: Vec<DVec3> = ring.iter().map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), 0.0)).collect();
            let triangles = triangulate(&corners).unwrap_or_else(|| unreachable!("{ring:?}"));
            assert_eq!(total(&corners, &triangles), cells.len() as f64, "{ring:?}");
        }
    }

    #[test]
    fn what_has_no_area_or_crosses_itself_is_none() {
        assert_eq!(triangulate(&polygon(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)])), None);
        assert_eq!(triangulate(&polygon(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])), None);
        // Half of it turns over, and the rest has an area.
        assert_eq!(triangulate(&polygon(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)])), None);
        let angle = |i: u32| 0.8 * std::f64::consts::PI * f64::from(i);
        let pentagram: Vec<DVec3> = (0..5).map(|i| DVec3::new(angle(i).cos(), angle(i).sin(), 0.0)).collect();
        assert_eq!(triangulate(&pentagram), None);
        assert_eq!(triangulate(&[DVec3::ZERO; 9]), None);
        assert_eq!(triangulate(&[DVec3::NAN; 5]), None);
        assert_eq!(triangulate(&[]), Some(Vec::new()));
    }

    /// A comb of 2^20 corners would take a day.
    #[test]
    fn many_corners_take_no_time() {
        let start = std::time::Instant::now();
        let many: Vec<DVec3> = (0..1 << 20).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.0)).collect();
        assert_eq!(triangulate(&many), None);
        // Ears are not looked for where there are too many corners.
        assert_eq!(triangulate(&star(MOST_CORNERS as u32 / 2 + 1, 0.5)), None);
        // Convex ones are fans however many corners they have.
        let round = star(1 << 19, 1.0);
        assert_eq!(triangulate(&round).map(|triangles| triangles.len()), Some((1 << 20) - 2));
        let spiky = star(MOST_CORNERS as u32 / 2, 0.01);
        for _ in 0..100 {
            assert!(triangulate(&spiky).is_some());
        }
        assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
    }
}
