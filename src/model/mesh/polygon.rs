//! Polygons to triangles.

use glam::{DVec2, DVec3};

/// Most corners of a polygon whose ears are clipped: the time grows with their cube at worst.
const MOST_CORNERS: usize = 512;

/// The triangles of a polygon, as indices of its corners, in its winding; `None` where it crosses itself, has no area,
/// or too many corners that turn inwards.
///
/// Convex polygons become fans, others lose their ears one by one (Meisters 1975).
pub(super) fn triangulate(corners: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let count = corners.len();
    let fan = || (1..count - 1).map(|i| [0, i, i + 1]).collect();
    if count <= 3 {
        return Some(fan());
    }
    let flat = flattened(corners)?;
    let next = |i: usize| (i + 1) % count;
    let before = |i: usize| (i + count - 1) % count;
    if (0..count).all(|i| area(flat[before(i)], flat[i], flat[next(i)]) >= 0.0) && turns_once(&flat) {
        return Some(fan());
    }
    if count > MOST_CORNERS {
        return None;
    }
    let mut left: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let n = left.len();
        let is_ear = |at: usize| {
            let [a, b, c] = [left[(at + n - 1) % n], left[at], left[(at + 1) % n]];
            let [p, q, r] = [flat[a], flat[b], flat[c]];
            let inside = |&&i: &&usize| {
                let x = flat[i];
                i != a
                    && i != b
                    && i != c
                    && x != p
                    && x != q
                    && x != r
                    && area(p, q, x) >= 0.0
                    && area(q, r, x) >= 0.0
                    && area(r, p, x) >= 0.0
            };
            area(p, q, r) > 0.0 && left.iter().find(inside).is_none()
        };
        // A corner on a straight line has no area: it goes when no ear is left.
        let flat_corner = |at: usize| {
            let [a, b, c] = [left[(at + n - 1) % n], left[at], left[(at + 1) % n]];
            area(flat[a], flat[b], flat[c]) == 0.0
        };
        let at = (0..n).find(|&at| is_ear(at)).or_else(|| (0..n).find(|&at| flat_corner(at)))?;
        triangles.push([left[(at + n - 1) % n], left[at], left[(at + 1) % n]]);
        left.remove(at);
    }
    triangles.push([left[0], left[1], left[2]]);
    Some(triangles)
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
    use super::*;

    fn total(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let area = |t: &[usize; 3]| 0.5 * (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).z;
        assert!(triangles.iter().all(|t| area(t) >= 0.0), "{triangles:?}");
        triangles.iter().map(area).sum()
    }

    fn polygon(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|&(x, y)| DVec3::new(x, y, 3.0)).collect()
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
        let square = polygon(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]);
        assert_eq!(total(&square, &triangulate(&square).unwrap()), 4.0);
    }

    #[test]
    fn what_has_no_area_or_crosses_itself_is_none() {
        assert_eq!(triangulate(&polygon(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)])), None);
        assert_eq!(triangulate(&polygon(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])), None);
        let many: Vec<DVec3> = (0..2000).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.0)).collect();
        assert_eq!(triangulate(&many), None);
    }
}
