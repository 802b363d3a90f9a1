//! How fine each part of a mesh has to be: the farther from the camera, the coarser.
//!
//! Triangles get levels. Those of level k have rays that are 2^k times as far apart as those of the nearest ones. A
//! triangle that reaches over several levels is halved until it does not.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec2, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::facets::Facets;
use super::{Mesh, Triangle};
use crate::math::norm;

/// Coarsest level: rays 4096 times as far apart as the nearest ones.
const COARSEST: i32 = 12;
/// Farthest over nearest spacing of a triangle from which on it is halved.
const WIDE: f64 = 2.0;
/// Spacings of its longest edge up to which a triangle is not halved.
const SHORT: f64 = 16.0;
/// Part of the image that is added on all sides: frames between those that are looked at may show it.
const MARGIN: f64 = 0.5;
/// Factor on spacings beside that.
const BESIDE: f64 = 4.0;
/// Most triangles that are added.
const MOST_ADDED: usize = 1 << 20;

/// The distance of rays that parts of a mesh need, by their distances from cameras.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fineness {
    views: Vec<View>,
}

/// What a camera shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    /// Where surfaces show, units of the camera's space.
    pub(crate) near: f64,
    /// The corners of the image at a distance of 1, y up: the lower left one, then the upper right one.
    pub(crate) window: [DVec2; 2],
    /// How far apart rays may be at a distance of 1, units of the camera's space.
    pub(crate) spacing: f64,
}

/// A camera that sees the mesh.
#[derive(Clone, Debug)]
struct View {
    /// In the model.
    eye: DVec3,
    camera_from_model: DMat3,
    lens: Lens,
    /// Units of the model for one of the camera's space.
    scale: f64,
}

impl Fineness {
    /// Adds a camera. Nothing happens where a number is not finite.
    pub(crate) fn add(&mut self, camera_from_model: DMat4, lens: Lens) {
        let linear = DMat3::from_mat4(camera_from_model);
        let eye = camera_from_model.inverse().transform_point3(DVec3::ZERO);
        let scale = norm(&linear).recip();
        let spacing = lens.spacing * scale;
        if eye.is_finite() && lens.near > 0.0 && spacing.is_finite() && spacing > 0.0 {
            self.views.push(View { eye, camera_from_model: linear, lens, scale });
        }
    }

    /// The cameras of both.
    pub(crate) fn join(&mut self, other: Self) {
        self.views.extend(other.views);
    }

    /// Does no camera see it?
    pub(crate) fn is_empty(&self) -> bool {
        self.views.is_empty()
    }

    /// The spacing where a box about `middle` is nearest.
    pub(super) fn of_box(&self, middle: DVec3, size: DVec3) -> f64 {
        let of_view = |view: &View| {
            let nearest = view.eye.clamp(middle - 0.5 * size, middle + 0.5 * size) - view.eye;
            view.scale * view.lens.spacing * (view.camera_from_model * nearest).length().max(view.lens.near)
        };
        self.views.iter().map(of_view).fold(f64::INFINITY, f64::min)
    }

    /// The spacing where a triangle is nearest, and one that is enough everywhere else on it.
    fn range(&self, corner: [DVec3; 3]) -> [f64; 2] {
        let of_view = |view: &View| {
            let corner = corner.map(|place| view.camera_from_model * (place - view.eye));
            let farthest = corner.iter().map(|place| place.length()).fold(0.0, f64::max);
            let beside = if view.lens.is_beside(corner) { BESIDE } else { 1.0 };
            [distance(corner), farthest]
                .map(|distance| beside * view.scale * view.lens.spacing * distance.max(view.lens.near))
        };
        self.views.iter().map(of_view).fold([f64::INFINITY; 2], |[a, b], [c, d]| [a.min(c), b.min(d)])
    }
}

impl Lens {
    /// Does a triangle lie beside the image, and well beside it? Camera space.
    fn is_beside(&self, corner: [DVec3; 3]) -> bool {
        let [low, high] = self.window;
        let margin = MARGIN * (high - low);
        let [low, high] = [low - margin, high + margin];
        let sides: [fn(DVec3, DVec2, DVec2) -> bool; 5] = [
            |p, _, _| p.z >= 0.0,
            |p, low, _| p.x < low.x * -p.z,
            |p, _, high| p.x > high.x * -p.z,
            |p, low, _| p.y < low.y * -p.z,
            |p, _, high| p.y > high.y * -p.z,
        ];
        sides.iter().any(|is_off| corner.iter().all(|&p| is_off(p, low, high)))
    }
}

/// Triangles of which wide ones were halved.
pub(super) struct Divided {
    /// The triangles that are used, without textures.
    pub(super) mesh: Mesh,
    /// The spacing that each of them needs, model units.
    pub(super) wanted: Vec<f64>,
}

/// Halves the wide triangles of a mesh.
pub(super) fn divide(facets: &Facets<'_>, fineness: &Fineness) -> Divided {
    let source = facets.mesh;
    let triangles: Vec<Triangle> = facets.kept.iter().map(|&i| source.triangles[i as usize]).collect();
    let mut pieces = Pieces {
        mesh: Mesh {
            position: source.position.clone(),
            normal: source.normal.clone(),
            uv: source.uv.clone(),
            colour: source.colour.clone(),
            triangles,
            materials: source.materials.clone(),
            textures: Vec::new(),
            notes: Vec::new(),
        },
        welded: facets.welded.clone(),
        middles: HashMap::new(),
        welds: HashMap::new(),
    };
    let mut range: Vec<[f64; 2]> =
        pieces.mesh.triangles.par_iter().map(|triangle| fineness.range(pieces.corners(triangle))).collect();
    let most = pieces.mesh.triangles.len() + MOST_ADDED;
    while pieces.mesh.triangles.len() <= most {
        let marked = pieces.marked(&range);
        if marked.is_empty() {
            break;
        }
        range = pieces.halve(&marked, &range, fineness);
    }
    Divided { mesh: pieces.mesh, wanted: range.into_iter().map(|[nearest, _]| nearest).collect() }
}

impl Divided {
    /// The areas of the triangles as rays see them ([`super::raster::hits`]).
    pub(super) fn projected(&self, reduce: bool) -> Vec<f64> {
        let of = |triangle: &Triangle| {
            let [a, b, c] = triangle.corners.map(|v| self.mesh.position[v as usize]);
            let sides = (b - a).cross(c - a).abs();
            0.5 * if reduce { sides.max_element() } else { sides.element_sum() }
        };
        self.mesh.triangles.par_iter().map(of).collect()
    }

    /// The least spacing that a triangle needs.
    pub(super) fn nearest(&self) -> f64 {
        self.wanted.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The level of each triangle where no spacing is below `least`, which is that of level 0.
    pub(super) fn levels(&self, least: f64) -> Vec<u8> {
        let level = |wanted: &f64| (libm::log2(wanted / least).floor() as i32).clamp(0, COARSEST) as u8;
        self.wanted.iter().map(level).collect()
    }

    /// The least spacing with which there are about `most` surfels. `projected` are the areas of the triangles as rays
    /// see them. The nearest parts give way first.
    pub(super) fn least(&self, projected: &[f64], most: f64) -> f64 {
        let count = |least: f64| -> f64 {
            let levels = self.levels(least);
            let of = |(area, level): (&f64, u8)| area / (least * f64::from(level).exp2()).powi(2);
            projected.iter().zip(levels).map(of).sum()
        };
        let nearest = self.nearest();
        if count(nearest) <= most {
            return nearest;
        }
        let whole: f64 = projected.iter().sum();
        // One spacing for all makes as many.
        let (mut low, mut high) = (nearest, (whole / most).sqrt().max(nearest));
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            if count(middle) > most { low = middle } else { high = middle }
        }
        high
    }
}

/// Triangles that are being halved.
struct Pieces {
    mesh: Mesh,
    /// As [`Facets::welded`].
    welded: Vec<u32>,
    /// The vertex in the middle of two others, the lower one first.
    middles: HashMap<[u32; 2], u32>,
    /// The same of welded vertices.
    welds: HashMap<[u32; 2], u32>,
}

impl Pieces {
    fn corners(&self, triangle: &Triangle) -> [DVec3; 3] {
        triangle.corners.map(|v| self.mesh.position[v as usize])
    }

    /// The edge from corner `k` to the next by its welded vertices, the lower one first.
    fn edge(&self, triangle: &Triangle, k: usize) -> [u32; 2] {
        let [a, b] = [k, (k + 1) % 3].map(|k| self.welded[triangle.corners[k] as usize]);
        [a.min(b), a.max(b)]
    }

    /// The longest edges of wide triangles, in order.
    fn marked(&self, range: &[[f64; 2]]) -> Vec<[u32; 2]> {
        let longest = |(triangle, [near, far]): (&Triangle, &[f64; 2])| {
            if *far <= WIDE * near {
                return None;
            }
            let corner = self.corners(triangle);
            let length = |k: usize| corner[k].distance_squared(corner[(k + 1) % 3]);
            // Of equally long ones that of the least vertices, so that triangles on both sides agree.
            let longer = |a: &usize, b: &usize| {
                let order = length(*a).total_cmp(&length(*b));
                order.then_with(|| self.edge(triangle, *b).cmp(&self.edge(triangle, *a)))
            };
            let k = (0..3).max_by(longer)?;
            (length(k) > (SHORT * near).powi(2)).then(|| self.edge(triangle, k))
        };
        let mut marked: Vec<[u32; 2]> = self.mesh.triangles.par_iter().zip(range).filter_map(longest).collect();
        marked.par_sort_unstable();
        marked.dedup();
        marked
    }

    /// Cuts all triangles at the middles of marked edges, so that none ends within the edge of another. Gives the
    /// ranges of all.
    fn halve(&mut self, marked: &[[u32; 2]], range: &[[f64; 2]], fineness: &Fineness) -> Vec<[f64; 2]> {
        let mut at_mark = vec![false; self.mesh.position.len()];
        marked.iter().flatten().for_each(|&v| at_mark[v as usize] = true);
        let old = std::mem::take(&mut self.mesh.triangles);
        let (mut triangles, mut ranges) = (Vec::with_capacity(old.len()), Vec::with_capacity(old.len()));
        let mut pieces = Vec::new();
        for (triangle, range) in old.iter().zip(range) {
            let at_marks = triangle.corners.iter().filter(|&&v| at_mark[self.welded[v as usize] as usize]).count();
            let is_cut = [0, 1, 2].map(|k| at_marks > 1 && marked.binary_search(&self.edge(triangle, k)).is_ok());
            if is_cut == [false; 3] {
                triangles.push(*triangle);
                ranges.push(*range);
                continue;
            }
            pieces.clear();
            self.cut(triangle, is_cut, &mut pieces);
            for &corners in &pieces {
                let piece = Triangle { corners, ..*triangle };
                ranges.push(fineness.range(self.corners(&piece)));
                triangles.push(piece);
            }
        }
        self.mesh.triangles = triangles;
        ranges
    }

    /// The pieces of a triangle that is cut at the middles of some edges.
    fn cut(&mut self, triangle: &Triangle, is_cut: [bool; 3], pieces: &mut Vec<[u32; 3]>) {
        let corner = triangle.corners;
        let middle = [0, 1, 2].map(|k| if is_cut[k] { self.middle(corner[k], corner[(k + 1) % 3]) } else { 0 });
        // Begin at an edge that is cut, and at the one that is not after two that are.
        let first = (0..3).find(|&k| is_cut[k] && (!is_cut[(k + 2) % 3] || is_cut == [true; 3])).unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|k| corner[(first + k) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|k| middle[(first + k) % 3]);
        match [is_cut[(first + 1) % 3], is_cut[(first + 2) % 3]] {
            [false, _] => pieces.extend([[a, ab, c], [ab, b, c]]),
            [true, false] => pieces.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
            [true, true] => pieces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]),
        }
    }

    /// The vertex in the middle of two others.
    fn middle(&mut self, a: u32, b: u32) -> u32 {
        let key = [a.min(b), a.max(b)];
        if let Some(&known) = self.middles.get(&key) {
            return known;
        }
        let [i, j] = key.map(|v| v as usize);
        let mesh = &mut self.mesh;
        let new = mesh.position.len() as u32;
        // The order of two numbers does not change their sum: vertices at one place stay together.
        mesh.position.push(0.5 * (mesh.position[i] + mesh.position[j]));
        let normal = [i, j].map(|v| mesh.normal.get(v).copied().unwrap_or_default());
        let mean = if normal.contains(&Vec3::ZERO) { Vec3::ZERO } else { (normal[0] + normal[1]).normalize_or_zero() };
        push_where_there(&mut mesh.normal, mean);
        let uv = [i, j].map(|v| mesh.uv.get(v).copied().unwrap_or_default());
        push_where_there(&mut mesh.uv, Vec2::midpoint(uv[0], uv[1]));
        let colour = [i, j].map(|v| mesh.colour.get(v).copied().unwrap_or_default());
        push_where_there(&mut mesh.colour, Vec4::midpoint(colour[0], colour[1]));
        let welded = [i, j].map(|v| self.welded[v]);
        let weld = *self.welds.entry([welded[0].min(welded[1]), welded[0].max(welded[1])]).or_insert(new);
        self.welded.push(weld);
        self.middles.insert(key, new);
        new
    }
}

/// Adds to a column that is not left out.
fn push_where_there<T>(column: &mut Vec<T>, value: T) {
    if !column.is_empty() {
        column.push(value);
    }
}

/// Distance of a triangle from the origin.
fn distance([a, b, c]: [DVec3; 3]) -> f64 {
    let across = (b - a).cross(c - a);
    // Is the foot of the plane within all three edges?
    let foot = across * (a.dot(across) / across.length_squared());
    let within = |p: DVec3, q: DVec3| (q - p).cross(foot - p).dot(across) >= 0.0;
    if within(a, b) && within(b, c) && within(c, a) {
        return foot.length();
    }
    let to_edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let t = -p.dot(along) / along.length_squared();
        (p + along * if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 }).length()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::mesh::sample::{Sampled, sample_as};
    use crate::model::mesh::{MeshMaterial, Texture};

    /// A camera at `eye` that looks along -z through a square window.
    fn camera(eye: DVec3) -> Fineness {
        let mut fineness = Fineness::default();
        let lens = Lens { near: 0.1, window: [DVec2::splat(-0.5), DVec2::splat(0.5)], spacing: 0.01 };
        fineness.add(DMat4::from_translation(-eye), lens);
        fineness
    }

    fn mesh(position: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            position: position.iter().map(|&place| DVec3::from(place)).collect(),
            triangles: triangles.iter().map(|&corners| Triangle { corners, material: 0 }).collect(),
            materials: vec![MeshMaterial::default()],
            ..Mesh::default()
        }
    }

    /// A floor from before the camera to far away, in two triangles.
    fn floor() -> Mesh {
        mesh(&[[-50.0, 0.0, 1.0], [50.0, 0.0, 1.0], [50.0, 0.0, -99.0], [-50.0, 0.0, -99.0]], &[[0, 1, 2], [0, 2, 3]])
    }

    /// A closed box around the camera.
    fn room() -> Mesh {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 9.0 } else { -9.0 });
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let corners: Vec<[f64; 3]> = (0..8).map(corner).collect();
        mesh(&corners, &triangles)
    }

    fn all(mesh: &Mesh, fineness: &Fineness, most: f64) -> Sampled {
        sample_as(mesh, fineness, [1.0, most], true, 1.0).unwrap()
    }

    /// The pieces cover what the triangles do, none ends within an edge of another, and each is about as large as its
    /// distance.
    #[test]
    fn pieces_fit_together() {
        for (mesh, eye) in [(floor(), DVec3::Y), (room(), DVec3::new(0.3, 0.2, -8.0)), (room(), DVec3::X * 11.0)] {
            let fineness = camera(eye);
            let facets = Facets::new(&mesh);
            let divided = divide(&facets, &fineness);
            let (levels, pieces) = (divided.levels(divided.nearest()), divided.mesh);
            let area = |mesh: &Mesh| {
                let facets = Facets::new(mesh);
                assert_eq!(facets.kept.len(), mesh.triangles.len());
                facets.kept.iter().map(|&i| facets.shape(i).across).fold(DVec3::ZERO, |sum, across| sum + across.abs())
            };
            assert!(area(&mesh).abs_diff_eq(area(&pieces), 1e-6), "{} {}", area(&mesh), area(&pieces));
            assert_eq!(Facets::new(&pieces).is_open(), facets.is_open());
            assert!(pieces.triangles.len() > mesh.triangles.len() && levels.len() == pieces.triangles.len());
            assert!(pieces.triangles.len() < 5000, "{}", pieces.triangles.len());
            for triangle in &pieces.triangles {
                let corner = triangle.corners.map(|v| pieces.position[v as usize]);
                let [near, far] = fineness.range(corner);
                let longest =
                    [0, 1, 2].map(|k| corner[k].distance(corner[(k + 1) % 3])).into_iter().fold(0.0, f64::max);
                assert!(far <= WIDE * near || longest <= SHORT * near, "{corner:?}");
            }
        }
    }

    /// Surfels are as fine as their places need, and not much finer; they leave no holes between levels.
    #[test]
    fn surfels_are_as_fine_as_their_places_need() {
        for (mesh, eye) in [(floor(), DVec3::Y), (room(), DVec3::new(0.3, 0.2, -8.0))] {
            let fineness = camera(eye);
            let Sampled { surfels, .. } = all(&mesh, &fineness, 1e7);
            let wanted = |place: DVec3| fineness.range([place; 3])[0];
            let places: Vec<DVec3> = surfels.position.iter().map(|at| at.as_dvec3() + surfels.origin).collect();
            let mut much_finer = 0;
            for (place, axis) in places.iter().zip(&surfels.axis_u) {
                let radius = f64::from(axis.length());
                assert!(radius <= 1.001 * wanted(*place), "{place} {radius} {}", wanted(*place));
                // Levels, the range of a triangle, and one that the image meets: a factor of 2, 2 and 4.
                much_finer += usize::from(radius < wanted(*place) / 16.0);
            }
            assert!(much_finer * 10 < places.len(), "{much_finer} of {}", places.len());
            // Each surfel's neighbourhood is covered: points between it and where its grid goes on.
            let mut order: Vec<usize> = (0..places.len()).collect();
            order.sort_by(|&a, &b| places[a].x.total_cmp(&places[b].x));
            let xs: Vec<f64> = order.iter().map(|&i| places[i].x).collect();
            let pieces = divide(&Facets::new(&mesh), &fineness).mesh;
            for step in 0..10_000_usize {
                // Points of the pieces, half of them on edges, where levels meet.
                let share = |prime: f64| (step as f64 * prime).fract();
                let corner =
                    pieces.triangles[step % pieces.triangles.len()].corners.map(|v| pieces.position[v as usize]);
                let (b, c) = (share(0.618_034), if step.is_multiple_of(2) { 0.0 } else { share(0.754_877_7) });
                let (b, c) = if b + c > 1.0 { (1.0 - b, 1.0 - c) } else { (b, c) };
                let k = step / 2 % 3;
                let [p, q, r] = [0, 1, 2].map(|i| corner[(k + i) % 3]);
                let point = p + b * (q - p) + c * (r - p);
                // Discs reach no farther than some spacings.
                let most = 4.0 * wanted(point);
                let from = xs.partition_point(|&x| x < point.x - most);
                let end = xs.partition_point(|&x| x <= point.x + most);
                let covers = |&i: &usize| {
                    let away = point - places[i];
                    let (u, v) = (surfels.axis_u[i].as_dvec3(), surfels.axis_v[i].as_dvec3());
                    let flat = u.cross(v).normalize().dot(away).abs() < 1e-3;
                    flat && (away.dot(u) / u.length_squared()).hypot(away.dot(v) / v.length_squared()) <= 1.0
                };
                assert!(order[from..end].iter().any(covers), "nothing covers {point}");
            }
        }
    }

    /// A closed mesh is one-sided however it is halved. The number of surfels is kept, with farther parts coarser.
    #[test]
    fn limits_hold() {
        let fineness = camera(DVec3::new(0.3, 0.2, -8.0));
        let sampled = all(&room(), &fineness, 30_000.0);
        assert!(!sampled.surfels.two_sided);
        let count = sampled.surfels.len();
        assert!((20_000..33_000).contains(&count), "{count}");
        let lengths = || sampled.surfels.axis_u.iter().map(|axis| axis.length());
        assert!(lengths().fold(0.0, f32::max) > 4.0 * lengths().fold(f32::INFINITY, f32::min));
        let again = all(&room(), &fineness, 30_000.0);
        assert!(again.surfels.position == sampled.surfels.position);
    }

    /// Textures and normals go on over halved edges.
    #[test]
    fn halves_look_as_the_whole() {
        let texels = (0..64_u32).map(|i| [(4 * (i % 8) * 8) as u8, (4 * (i / 8) * 8) as u8, 90, 255]).collect();
        let textures = vec![Texture { size: [8, 8], texels, wrap: [crate::model::mesh::Wrap::Clamp; 2] }];
        let plain = floor();
        let mesh = Mesh {
            uv: plain.position.iter().map(|p| Vec2::new(p.x as f32 / 100.0 + 0.5, p.z as f32 / 100.0 + 0.99)).collect(),
            materials: vec![MeshMaterial { texture: Some(0), ..MeshMaterial::default() }],
            textures,
            ..plain
        };
        let Sampled { surfels, .. } = all(&mesh, &camera(DVec3::Y), 1e6);
        // Red grows with x, from the first texel's middle to the last one's.
        for (at, colour) in surfels.position.iter().zip(&surfels.colour) {
            let x = f64::from(at.x) + surfels.origin.x;
            let share = ((x / 100.0 + 0.5) * 8.0 - 0.5).clamp(0.0, 7.0);
            let [low, high] =
                [share.floor(), share.ceil()].map(|i| crate::math::srgb::to_linear((32.0 * i) as f32 / 255.0));
            assert!(colour.x >= low - 0.02 && colour.x <= high + 0.02, "{x} {} {low} {high}", colour.x);
        }
    }

    #[test]
    fn the_distance_of_a_triangle_is_that_of_its_nearest_point() {
        let triangle = |z: f64, x: f64| [DVec3::new(x, 0.0, z), DVec3::new(x + 2.0, 0.0, z), DVec3::new(x, 2.0, z)];
        for (corner, wanted) in [
            (triangle(3.0, -0.5), 3.0),
            (triangle(3.0, 4.0), 5.0),
            (triangle(4.0, -3.0), 4.0_f64.hypot(1.0)),
            ([DVec3::X; 3], 1.0),
        ] {
            assert!((distance(corner) - wanted).abs() < 1e-12, "{corner:?} {}", distance(corner));
        }
        // Over the long side.
        let off = triangle(1.0, -3.0);
        let nearest =
            (0..=1000).map(|i| off[1].lerp(off[2], f64::from(i) / 1000.0).length()).fold(f64::INFINITY, f64::min);
        assert!((distance(off) - nearest).abs() < 1e-5);
    }
}
