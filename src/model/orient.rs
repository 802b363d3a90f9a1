//! Signs of estimated normals, chosen so that a surface has one outside.
//!
//! The method is that of Hoppe et al. 1992. Signs are passed along a minimum spanning forest of the neighbour graph, so
//! that they cross where the surface is flattest. Given normals are roots of the forest. The other trees get a sign
//! from their shape.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::neighbours::{Neighbours, Tree};
use super::options::LoadProgress;
use super::sides::directions;

/// Least evidence, of at most 2, with which a component's own shape decides its sign.
const CONFIDENT: f64 = 0.25;
/// Neighbours that a point is linked to. With 16 the signs are the same at twice the memory.
const EDGES: usize = 8;
/// Edges between two reports of progress.
const REPORT: usize = 1 << 18;

/// Gives the normals of distinct points consistent signs. Normals that are `given` keep theirs.
///
/// A component is a tree of the forest without a given normal. Its shape turns it outward: see [`Component::evidence`].
/// A component without a clear shape (a scrap of a surface, say) follows the nearest points of the others if they are
/// nearer than it is wide. Otherwise its largest mean normal component is made positive: floors face up, walls face +z
/// or +x.
///
/// Returns for each point whether its sign follows from a given normal.
///
/// Memory: 12 bytes for each edge, at most 8 edges for each point. The result does not depend on the number of threads.
pub(super) fn orient(
    position: &[Vec3],
    normal: &mut [Vec3],
    given: Vec<bool>,
    neighbours: &Neighbours,
    progress: LoadProgress<'_>,
) -> Vec<bool> {
    let mut forest = Forest::new(given);
    grow(&mut forest, position, normal, neighbours, progress);
    let (component_of, components) = components(&mut forest, position, normal, neighbours);
    let mut turn: Vec<Option<bool>> = components.iter().map(Component::turn).collect();
    if turn.contains(&None) {
        follow(position, normal, &component_of, &components, &mut turn);
    }
    for (n, &component) in normal.iter_mut().zip(&component_of) {
        let i = component as usize;
        if turn[i].unwrap_or_else(|| components[i].faces_down()) {
            *n = -*n;
        }
    }
    component_of.iter().map(|&component| components[component as usize].given).collect()
}

/// An edge of the neighbour graph: its cost as ordered bits, and its two ends.
type Edge = (u32, u32, u32);

/// Joins points along the cheapest edges first (Kruskal).
fn grow(forest: &mut Forest, position: &[Vec3], normal: &[Vec3], neighbours: &Neighbours, progress: LoadProgress<'_>) {
    let link = |i: usize, j: usize| link(position[i], normal[i], position[j], normal[j]);
    let given = &forest.given;
    let mut edges: Vec<Edge> = (0..position.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            linked(neighbours, i).iter().filter_map(move |&j| {
                let seen_from_there = (j as usize) < i && linked(neighbours, j as usize).contains(&(i as u32));
                let needed = !(seen_from_there || given[i] && given[j as usize]);
                needed.then(|| (link(i, j as usize).1.to_bits(), i as u32, j))
            })
        })
        .collect();
    edges.par_sort_unstable();
    for (done, &(_, i, j)) in edges.iter().enumerate() {
        forest.join(i, j, || link(i as usize, j as usize).0);
        if done % REPORT == 0 {
            progress("orienting normals", done as f32 / edges.len() as f32);
        }
    }
}

fn linked(neighbours: &Neighbours, i: usize) -> &[u32] {
    let near = neighbours.of(i);
    &near[..near.len().min(EDGES)]
}

/// Tells whether two neighbouring normals disagree in sign, and the cost, >= 0, of relying on the answer.
///
/// On a circle through both points, one normal is the other mirrored in the plane between the points, so the normals
/// are compared after that mirroring (Xie et al. 2003). This is right around sharp edges and across thin plates, where
/// the plain product fails. It is wrong for two samples of one surface that noise has put one above the other, so steep
/// edges cost more.
///
/// Measured on the front view of the guanyin scan: the pixels of 280 000 that show a back (most are its open crown) are
/// 1900 with the mirroring, with the cost, or with both, and 4000 with neither. Without the cost a noisy sphere gets
/// wrong signs.
fn link(p: Vec3, n: Vec3, q: Vec3, m: Vec3) -> (bool, f32) {
    let along = (q.as_dvec3() - p.as_dvec3()).normalize_or_zero();
    let (n, m) = (n.as_dvec3(), m.as_dvec3());
    let agreement = n.dot(m - 2.0 * along.dot(m) * along);
    let steep = along.dot(n).powi(2) + along.dot(m).powi(2);
    (agreement < 0.0, (1.0 - agreement.abs() + steep).max(0.0) as f32)
}

/// Disjoint sets that also know each point's sign relative to the root of its set.
struct Forest {
    parent: Vec<u32>,
    /// Sign of each point relative to its parent: true where opposite.
    opposite: Vec<bool>,
    size: Vec<u32>,
    /// For a root: true if the set holds a given normal. All signs relative to that normal are then right.
    given: Vec<bool>,
}

impl Forest {
    fn new(given: Vec<bool>) -> Self {
        let n = given.len();
        Self { parent: (0..n as u32).collect(), opposite: vec![false; n], size: vec![1; n], given }
    }

    /// Root of `x`, and whether the sign of `x` is opposite to the root's. Halves the path on the way.
    fn find(&mut self, mut x: u32) -> (u32, bool) {
        let mut opposite = false;
        loop {
            let (i, parent) = (x as usize, self.parent[x as usize]);
            if parent == x {
                return (x, opposite);
            }
            self.opposite[i] ^= self.opposite[parent as usize];
            self.parent[i] = self.parent[parent as usize];
            opposite ^= self.opposite[i];
            x = self.parent[i];
        }
    }

    /// Joins the sets of two points, unless they are one set or at least one of them has its sign.
    fn join(&mut self, i: u32, j: u32, opposite: impl Fn() -> bool) {
        let ((a, from_a), (b, from_b)) = (self.find(i), self.find(j));
        let rank = |r: u32| (self.given[r as usize], self.size[r as usize], u32::MAX - r);
        if a == b || (self.given[a as usize] && self.given[b as usize]) {
            return;
        }
        let (root, child) = if rank(a) > rank(b) { (a, b) } else { (b, a) };
        self.parent[child as usize] = root;
        self.opposite[child as usize] = from_a ^ from_b ^ opposite();
        self.size[root as usize] += self.size[child as usize];
    }
}

/// A tree of the forest, with the sums that its sign is judged by.
#[derive(Default)]
struct Component {
    given: bool,
    /// Area-weighted sum of positions, and the sum of areas.
    moment: DVec3,
    area: f64,
    /// Area-weighted sums of (position - centroid) . normal and of |position - centroid|.
    flux: f64,
    arms: f64,
    /// For each direction the greatest extent, and the normal there.
    extreme: Vec<(f32, Vec3)>,
    /// Sum of the normals.
    normal: DVec3,
}

impl Component {
    /// Evidence that the normals point outward, -2..=2.
    ///
    /// It is the sum of two means. The first is that of (position - centroid) . normal, which by the divergence theorem
    /// measures the enclosed volume: 1 for a sphere, about 0 for a plate or a terrain, whatever the dents. The second
    /// is that of direction . normal at the extreme points along 14 directions, which also finds the outside of a thin
    /// closed shell.
    fn evidence(&self) -> f64 {
        let volume = if self.arms > 0.0 { self.flux / self.arms } else { 0.0 };
        let votes: f32 = directions().zip(&self.extreme).map(|(d, (_, n))| d.dot(*n)).sum();
        volume + f64::from(votes) / self.extreme.len().max(1) as f64
    }

    /// Tells whether the signs must be turned; `None` if the shape does not show it.
    fn turn(&self) -> Option<bool> {
        let evidence = self.evidence();
        if self.given {
            Some(false)
        } else if evidence.abs() > CONFIDENT {
            Some(evidence < 0.0)
        } else {
            None
        }
    }

    /// True if the largest component of the mean normal is negative. Among equals z comes before y, and y before x.
    fn faces_down(&self) -> bool {
        let [x, y, z] = self.normal.to_array();
        let largest = if x.abs() > y.abs().max(z.abs()) {
            x
        } else if y.abs() > z.abs() {
            y
        } else {
            z
        };
        largest < 0.0
    }
}

/// Makes the signs consistent within each component. Returns the component of each point, and the components in the
/// order of their first points.
fn components(
    forest: &mut Forest,
    position: &[Vec3],
    normal: &mut [Vec3],
    neighbours: &Neighbours,
) -> (Vec<u32>, Vec<Component>) {
    let mut of_root = vec![u32::MAX; position.len()];
    let mut components: Vec<Component> = Vec::new();
    // A point's share of the surface is proportional to the square of the distance to its farthest neighbour.
    let area = |i: usize| {
        neighbours
            .of(i)
            .last()
            .map_or(1.0, |&j| position[i].as_dvec3().distance_squared(position[j as usize].as_dvec3()))
    };
    let directions: Vec<Vec3> = directions().collect();
    let mut component_of = Vec::with_capacity(position.len());
    for (i, (&p, n)) in position.iter().zip(normal.iter_mut()).enumerate() {
        let (root, opposite) = forest.find(i as u32);
        let index = &mut of_root[root as usize];
        if *index == u32::MAX {
            *index = components.len() as u32;
            let extreme = vec![(f32::NEG_INFINITY, Vec3::ZERO); directions.len()];
            components.push(Component { given: forest.given[root as usize], extreme, ..Component::default() });
        }
        component_of.push(*index);
        if opposite {
            *n = -*n;
        }
        let component = &mut components[*index as usize];
        component.moment += area(i) * p.as_dvec3();
        component.area += area(i);
        component.normal += n.as_dvec3();
        for (extreme, direction) in component.extreme.iter_mut().zip(&directions) {
            let extent = direction.dot(p);
            if extent > extreme.0 {
                *extreme = (extent, *n);
            }
        }
    }
    for (i, (p, n)) in position.iter().zip(normal.iter()).enumerate() {
        let component = &mut components[component_of[i] as usize];
        let arm = p.as_dvec3() - component.moment / component.area;
        component.flux += area(i) * arm.dot(n.as_dvec3());
        component.arms += area(i) * arm.length();
    }
    (component_of, components)
}

/// Gives the components without a clear shape the sign of the nearest points that have one.
fn follow(
    position: &[Vec3],
    normal: &[Vec3],
    component_of: &[u32],
    components: &[Component],
    turn: &mut [Option<bool>],
) {
    let decided = |i: &usize| turn[component_of[*i] as usize].is_some();
    let tree = Tree::new((0..position.len()).filter(decided).map(|i| (position[i], i as u32)));
    let mut nearest = vec![f64::INFINITY; components.len()];
    let mut agreement = vec![0.0; components.len()];
    let mut found = Vec::new();
    for i in (0..position.len()).filter(|i| !decided(i)) {
        let component = component_of[i] as usize;
        tree.nearest(position[i], u32::MAX, 1, &mut found);
        if let Some(&(square, j)) = found.first() {
            nearest[component] = square.min(nearest[component]);
            let sign = if turn[component_of[j as usize] as usize] == Some(true) { -1.0 } else { 1.0 };
            agreement[component] += sign * f64::from(normal[i].dot(normal[j as usize])) / square;
        }
    }
    for (component, turn) in turn.iter_mut().enumerate() {
        // The extents along +x and -x sum to the width along x, and so on.
        let width =
            |axis: usize| components[component].extreme[2 * axis].0 + components[component].extreme[2 * axis + 1].0;
        let wide = f64::from(width(0).max(width(1)).max(width(2)));
        if turn.is_none() && agreement[component] != 0.0 && nearest[component] <= wide * wide {
            *turn = Some(agreement[component] < 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::normals::tests::{completed, estimated, noise, sphere};

    /// Share of points whose normal agrees with `truth`.
    fn right(points: &[Vec3], truth: impl Fn(Vec3) -> Vec3) -> f64 {
        let normals = estimated(points);
        normals.iter().zip(points).filter(|(n, p)| n.dot(truth(**p)) > 0.0).count() as f64 / points.len() as f64
    }

    #[test]
    fn two_spheres_both_look_outward() {
        let ball = sphere(2000);
        let apart = Vec3::new(5.0, 0.0, 0.0);
        let points: Vec<Vec3> = ball.iter().copied().chain(ball.iter().map(|&p| 0.3 * p + apart)).collect();
        assert_eq!(right(&points, |p| if p.x > 3.0 { p - apart } else { p }), 1.0);
    }

    #[test]
    fn a_noisy_sphere_looks_outward() {
        // The noise is half the distance between points in every direction.
        let points: Vec<Vec3> = sphere(20_000).iter().zip(0..).map(|(&p, i)| p + 0.0125 * noise(i)).collect();
        let share = right(&points, |p| p);
        assert!(share > 0.9999, "{share}");
    }

    #[test]
    fn both_sides_of_a_thin_plate_look_outward() {
        // Each side has 60 x 60 points, and each rim has 3 rows. The thickness is two spacings.
        let mut points = Vec::new();
        for i in 0..60 {
            for j in 0..60 {
                for k in 0..3 {
                    if k != 1 || i == 0 || i == 59 || j == 0 || j == 59 {
                        points.push(Vec3::new(i as f32, j as f32, k as f32));
                    }
                }
            }
        }
        let share = right(&points, |p| if p.z == 1.0 { p - Vec3::new(29.5, 29.5, 1.0) } else { Vec3::Z * (p.z - 1.0) });
        assert!(share > 0.999, "{share}");
    }

    #[test]
    fn an_open_bowl_looks_outward_and_a_terrain_up() {
        let bowl: Vec<Vec3> = sphere(4000).into_iter().filter(|p| p.y < 0.1).collect();
        assert_eq!(right(&bowl, |p| p), 1.0);
        let terrain: Vec<Vec3> = (0..10_000)
            .map(|i| {
                let (x, z) = (f64::from(i % 100) * 0.1, f64::from(i / 100) * 0.1);
                DVec3::new(x, 0.3 * libm::sin(2.0 * x) * libm::cos(z), z).as_vec3()
            })
            .collect();
        assert_eq!(right(&terrain, |_| Vec3::Y), 1.0);
    }

    #[test]
    fn a_scrap_follows_a_near_surface_and_faces_up_far_from_any() {
        // A flat scrap lies below a ball, too far away to be linked to it. By itself it faces up; near the ball it
        // faces down.
        let below = |y: f32| {
            let scrap = (0..169)
                .map(move |i| Vec3::new((i % 13) as f32 - 6.0, 0.0, (i / 13) as f32 - 6.0) * 0.01 + y * Vec3::Y);
            sphere(20_000).into_iter().chain(scrap).collect::<Vec<Vec3>>()
        };
        assert_eq!(right(&below(-1.065), |p| p), 1.0, "near");
        assert_eq!(right(&below(-2.0), |p| if p.y < -1.5 { Vec3::Y } else { p }), 1.0, "far");
    }

    #[test]
    fn links_see_the_two_sides_of_a_plate_and_of_an_edge() {
        let disagree = |p, n, q, m| link(p, n, q, m).0;
        assert!(!disagree(Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::Y));
        assert!(disagree(Vec3::ZERO, Vec3::Y, Vec3::X, -Vec3::Y));
        assert!(!disagree(Vec3::ZERO, -Vec3::Z, Vec3::Z, Vec3::Z));
        assert!(disagree(Vec3::ZERO, Vec3::Z, Vec3::Z, Vec3::Z));
        // A wedge of 20 degrees with its edge along z; its sides face up and down.
        let (s, c) = libm::sincosf(10_f32.to_radians());
        assert!(!disagree(Vec3::new(c, s, 0.0), Vec3::new(-s, c, 0.0), Vec3::new(c, -s, 0.1), Vec3::new(-s, -c, 0.0)));
        // Flat links cost least, steep ones most.
        let cost = |q| link(Vec3::ZERO, Vec3::Y, q, Vec3::Y).1;
        assert!(cost(Vec3::X) < 1e-6 && cost(Vec3::ONE) > 0.5 && cost(Vec3::Y) > 1.9);
    }

    #[test]
    fn volume_and_extreme_points_both_count() {
        let blind = vec![(1.0, Vec3::ZERO); 14];
        let seeing: Vec<(f32, Vec3)> = directions().map(|d| (1.0, d)).collect();
        let component = |flux, extreme| Component { flux, arms: 2.0, extreme, ..Component::default() };
        assert_eq!(component(1.0, blind.clone()).evidence(), 0.5);
        assert!((component(0.0, seeing).evidence() - 1.0).abs() < 1e-6);
        assert_eq!(component(-1.0, blind.clone()).turn(), Some(true));
        assert_eq!(component(0.1, blind).turn(), None);
    }

    #[test]
    fn opposed_given_normals_do_not_fight() {
        // Two faces of a box meet in an edge. One normal of each is given.
        let face = |at: fn(f32, f32) -> Vec3| (0..300).map(move |i| at((i % 20) as f32, (i / 20 + 1) as f32));
        let points: Vec<Vec3> = face(|x, d| Vec3::new(x, 0.0, d)).chain(face(|x, d| Vec3::new(x, -d, 0.0))).collect();
        for front in [Vec3::Z, -Vec3::Z] {
            let mut given = vec![Vec3::ZERO; 600];
            given[150] = Vec3::Y;
            given[450] = front;
            let normals = completed(&points, given);
            // The five rows farthest from the edge.
            assert!(normals[200..300].iter().all(|n| n.y > 0.99));
            assert!(normals[500..600].iter().all(|n| n.dot(front) > 0.99), "{front}");
        }
    }
}
