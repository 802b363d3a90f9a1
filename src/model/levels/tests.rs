//! Tests of the tree: what merging keeps, that coarse levels cover what fine ones do, and sizes that cannot be merged.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::octree::FEW;
use super::*;

/// Discs on a unit ball, each 1.2 times as large as the distance to the next.
fn ball(count: usize) -> Surfels {
    let golden = PI * (3.0 - 5.0_f32.sqrt());
    let radius = 1.2 * (4.0 * PI / count as f32).sqrt();
    of_fronts((0..count).map(|i| {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
        let across = (1.0 - z * z).sqrt();
        let front = Vec3::new(across * (golden * i as f32).cos(), across * (golden * i as f32).sin(), z);
        (front, front, radius)
    }))
}

fn of_fronts(discs: impl Iterator<Item = (Vec3, Vec3, f32)>) -> Surfels {
    let mut surfels = Surfels { origin: DVec3::new(3.0, -2.0, 5.0), ..Surfels::default() };
    for (position, front, radius) in discs {
        let (u, v) = front.any_orthonormal_pair();
        surfels.position.push(position);
        surfels.axis_u.push(u * radius);
        surfels.axis_v.push(v * radius);
        surfels.normal.push(front);
        surfels.colour.push(Vec3::new(0.2, 0.5, 0.7));
    }
    surfels.spatially_ordered()
}

/// All cuts that have the nodes of one depth, or leaves above it, from the root on.
fn cuts(levels: &Levels) -> Vec<Vec<u32>> {
    let mut cuts = vec![vec![0]];
    loop {
        let last = cuts.last().unwrap();
        let below = |&node: &u32| {
            let of = &levels.nodes[node as usize];
            if of.is_leaf() { vec![node] } else { of.children.clone().collect() }
        };
        let next: Vec<u32> = last.iter().flat_map(below).collect();
        if next == *last {
            return cuts;
        }
        cuts.push(next);
    }
}

fn tree(surfels: &Surfels) -> Arc<Levels> {
    Arc::new(Levels::of(surfels).expect("levels"))
}

fn area(surfels: &Surfels, i: usize) -> f64 {
    surfels.axis_u[i].as_dvec3().cross(surfels.axis_v[i].as_dvec3()).length()
}

#[test]
fn leaves_are_the_model() {
    let model = Arc::new(ball(5000));
    let levels = tree(&model);
    let leaves = cuts(&levels).pop().unwrap();
    let gathered = levels.gather(&model, &leaves, None);
    assert_eq!(gathered.position, model.position);
    assert_eq!(gathered.axis_u, model.axis_u);
    assert_eq!(gathered.normalisation(), model.normalisation());
    // As many again, in all levels together, as a third to a half of the model.
    let merged = levels.merged.len() as f64 / model.len() as f64;
    assert!((0.15..0.6).contains(&merged), "{merged}");
}

/// Area, middle, colour and vector area of each cut are those of the model. The vector area of a closed surface is 0;
/// that of a folded sheet is what is seen of it from its front.
#[test]
fn merging_keeps_sums() {
    let mut ball = ball(20_000);
    for (colour, position) in ball.colour.iter_mut().zip(&ball.position) {
        *colour = (*position * 0.5 + Vec3::splat(0.5)) * 0.8;
    }
    // Narrow folds, whose sides lean by 27 degrees to the left and to the right.
    let along = 128;
    let folded = of_fronts((0..along * along).map(|i| {
        let (x, y) = (i % along, i / along);
        let side = if x % 2 == 0 { 0.45 } else { -0.45 };
        (Vec3::new(x as f32, y as f32, 0.0), Vec3::new(side, 0.0, (1.0_f32 - 0.45 * 0.45).sqrt()), 0.8)
    }));
    for (model, seen) in [(ball, DVec3::ZERO), (folded, DVec3::Z * (1.0_f64 - 0.45 * 0.45).sqrt())] {
        let model = Arc::new(model);
        let levels = tree(&model);
        let sums = |cut: &[u32]| {
            let (mut sum, mut middle, mut colour, mut vector) = (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
            for &node in cut {
                let node = &levels.nodes[node as usize];
                let (of, merged) = if node.is_leaf() { (&*model, false) } else { (&levels.merged, true) };
                for i in node.surfels.clone().map(|i| i as usize) {
                    let [share, alike] = if merged { [levels.share[i], levels.alike[i]] } else { [1.0; 2] };
                    let below = f64::from(share) * area(of, i);
                    sum += below;
                    middle += below * of.position[i].as_dvec3();
                    colour += below * of.colour[i].as_dvec3();
                    vector += below * f64::from(alike) * of.normal[i].as_dvec3();
                }
            }
            (sum, middle / sum, colour / sum, vector / sum)
        };
        let cuts = cuts(&levels);
        let (whole, centre, mean, _) = sums(cuts.last().unwrap());
        assert!(cuts.len() >= 4, "{}", cuts.len());
        for cut in &cuts {
            let (sum, middle, colour, vector) = sums(cut);
            assert!((sum / whole - 1.0).abs() < 1e-5, "{sum} {whole}");
            let size = (model.bounds().max - model.bounds().min).max_element();
            assert!((middle - centre).length() < 1e-5 * size && (colour - mean).length() < 1e-5, "{middle} {colour}");
            assert!((vector - seen).length() < 1e-5, "{} nodes: {vector}", cut.len());
        }
    }
}

/// Every level is sound, has one colour where the model has one, lies on the ball, and holds its box.
#[test]
fn every_level_is_a_surface_of_the_model() {
    let model = Arc::new(ball(20_000));
    let levels = tree(&model);
    for cut in cuts(&levels) {
        let surfels = levels.gather(&model, &cut, None);
        surfels.check().unwrap();
        assert!(surfels.normalisation().iter().all(|&factor| factor > 0.0 && factor <= LARGEST));
        for i in 0..surfels.len() {
            assert!((surfels.colour[i] - Vec3::new(0.2, 0.5, 0.7)).length() < 1e-6);
            assert!(surfels.axis_u[i].cross(surfels.axis_v[i]).dot(surfels.normal[i]) >= 0.0);
        }
        for node in cut.iter().map(|&node| &levels.nodes[node as usize]) {
            let of = if node.is_leaf() { &*model } else { &levels.merged };
            for i in node.surfels.clone().map(|i| i as usize) {
                let depth = f64::from(1.0 - of.position[i].length());
                // What is merged lies inside, by no more than the node says of the mean square.
                assert!(depth > -1e-5 && depth <= 3.0 * f64::from(node.deviation) + 1e-5, "{depth}");
            }
        }
    }
}

/// Points of the ball lie in a disc of each level, seen from outside.
#[test]
fn no_level_has_holes() {
    let model = Arc::new(ball(20_000));
    let levels = tree(&model);
    for cut in cuts(&levels).into_iter().skip(2) {
        let surfels = levels.gather(&model, &cut, None);
        for point in ball(3000).position {
            let covers = |i: usize| {
                let (u, v) = (surfels.axis_u[i], surfels.axis_v[i]);
                let front = u.cross(v).normalize();
                // Along the ray to the middle of the ball.
                let along = surfels.position[i].dot(front) / point.dot(front);
                let from = point * along - surfels.position[i];
                let (a, b) = (from.dot(u) / u.length_squared(), from.dot(v) / v.length_squared());
                along > 0.5 && a * a + b * b <= 1.0
            };
            assert!((0..surfels.len()).any(covers), "{} surfels: {point}", surfels.len());
        }
    }
}

/// Fronts more than 60 degrees apart stay apart: both sides of a thin plate have their colours at all levels.
#[test]
fn thin_sheets_keep_both_sides() {
    let plate = |side: f32| {
        (0..4000).map(move |i| (Vec3::new((i % 64) as f32, (i / 64) as f32, side * 1e-3), Vec3::Z * side, 0.8))
    };
    let mut model = of_fronts(plate(1.0).chain(plate(-1.0)));
    for (colour, normal) in model.colour.iter_mut().zip(&model.normal) {
        *colour = if normal.z > 0.0 { Vec3::X } else { Vec3::Y };
    }
    let model = Arc::new(model);
    let levels = tree(&model);
    for cut in cuts(&levels) {
        let surfels = levels.gather(&model, &cut, None);
        for (normal, colour) in surfels.normal.iter().zip(&surfels.colour) {
            let want = if normal.z > 0.0 { Vec3::X } else { Vec3::Y };
            assert!((*colour - want).length() < 1e-6 && normal.z.abs() > 0.999, "{normal} {colour}");
        }
    }
    // Nor do colours of the other side show beside a disc.
    let within =
        |node: &&Node| !node.is_leaf() && node.spacing < 3.0 && node.corners[0].x > 5.0 && node.corners[1].x < 58.0;
    let within = levels.nodes.iter().filter(within).filter(|node| node.corners[0].y > 5.0 && node.corners[1].y < 56.0);
    let most = within.map(|node| node.deviation / node.spacing).fold(f32::NAN, f32::max);
    assert!(most < 1e-2, "{most}");
}

/// A rough plate under a lamp mirrors a wide highlight on every level, as bright as that of all its surfels, and with
/// the same light over all directions.
#[test]
fn highlights_keep_their_light() {
    let mut model = of_fronts((0..4096).map(|i| (Vec3::new((i % 64) as f32, (i / 64) as f32, 0.0), Vec3::Z, 0.8)));
    let mut random = Pcg64Mcg::seed_from_u64(11);
    // Sums of six are nearly normal.
    let mut noise = || (0..6).map(|_| random.random_range(-0.08_f32..0.08)).sum::<f32>();
    for normal in &mut model.normal {
        *normal = Vec3::new(noise(), noise(), 1.0).normalize();
    }
    let model = Arc::new(model);
    let levels = tree(&model);
    let whole = Material { ambient: 0.0, diffuse: 0.0, specular: 0.6, shininess: 40.0 };
    let seen = |surfels: &Surfels, areas: &[f64], towards: DVec3| {
        let of = |i: usize| {
            let material = surfels.material.get(i).unwrap_or(&whole);
            // The lamp is far above.
            let mirrored = DVec3::Z.reflect(surfels.normal[i].as_dvec3()) * -1.0;
            let lobe = mirrored.dot(towards).max(0.0).powf(material.shininess.into());
            areas[i] * f64::from(material.specular) * lobe
        };
        (0..surfels.len()).map(of).sum::<f64>() / areas.iter().sum::<f64>()
    };
    let around = |height: f64| {
        let across = (1.0 - height * height).sqrt();
        (0..24).map(move |i| {
            let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
            DVec3::new(across * angle.cos(), across * angle.sin(), height)
        })
    };
    let all = vec![1.0; model.len()];
    let cuts = cuts(&levels);
    for cut in &cuts[..cuts.len() - 1] {
        let surfels = levels.gather(&model, cut, Some(whole));
        let nodes = cut.iter().map(|&node| &levels.nodes[node as usize]);
        let areas = nodes.flat_map(|node| {
            let shares = node.surfels.clone().map(|i| if node.is_leaf() { 1.0 } else { levels.share[i as usize] });
            shares.collect::<Vec<f32>>()
        });
        let areas: Vec<f64> = areas.enumerate().map(|(i, share)| f64::from(share) * area(&surfels, i)).collect();
        let ratio = |towards: &[DVec3]| {
            let sum =
                |surfels: &Surfels, areas: &[f64]| towards.iter().map(|&to| seen(surfels, areas, to)).sum::<f64>();
            sum(&surfels, &areas) / sum(&model, &all)
        };
        let everywhere: Vec<DVec3> = (0..24).flat_map(|i| around((f64::from(i) + 0.5) / 24.0)).collect();
        assert!((ratio(&everywhere) - 1.0).abs() < 0.01, "{}", ratio(&everywhere));
        // No power of a cosine is just as wide.
        assert!((ratio(&[DVec3::Z]) - 1.0).abs() < 0.15, "{}", ratio(&[DVec3::Z]));
        let aside: Vec<DVec3> = around(0.9).collect();
        assert!((ratio(&aside) - 1.0).abs() < 0.1, "{}", ratio(&aside));
    }
    // Numbers as large as floats can be stay finite.
    let extreme = Material { shininess: f32::MAX, ..whole };
    for alike in [0.0, 1e-30, 0.5, 1.0] {
        assert!(gloss(extreme, alike).is_valid() && gloss(Material { shininess: 0.0, ..whole }, alike).is_valid());
    }
    // A smooth plate keeps the material of its object, for which no column is needed.
    let smooth = Arc::new(Surfels { normal: vec![Vec3::Z; model.len()], ..(*model).clone() });
    assert!(tree(&smooth).gather(&smooth, &cuts[0], Some(whole)).material.is_empty());
}

/// Stripes change across themselves, and noise in all directions of the plane.
#[test]
fn a_node_knows_where_its_detail_changes() {
    let plane = |colour: fn(usize, usize) -> f32| {
        let places = (0..4096).map(|i| (Vec3::new((i % 64) as f32, (i / 64) as f32, 0.0), Vec3::Z, 1.2));
        let mut model = of_fronts(places);
        for (own, place) in model.colour.iter_mut().zip(&model.position) {
            *own = Vec3::splat(colour(place.x as usize, place.y as usize));
        }
        let levels = tree(&model);
        let node = levels.nodes.iter().find(|node| !node.is_leaf()).unwrap();
        (node.rest, [node.along.x_axis.x, node.along.y_axis.y, node.along.z_axis.z])
    };
    let (rest, [x, y, z]) = plane(|x, _| (x % 2) as f32);
    assert!(rest > 0.3 && x > 0.8 && y < 0.2 && z.abs() < 1e-6, "{rest} {x} {y} {z}");
    let (rest, [x, y, _]) = plane(|x, y| (libm::sinf((x * 12 + y * 78) as f32) * 43_758.547).abs().fract());
    assert!(rest > 0.2 && (x - y).abs() < 0.2, "{rest} {x} {y}");
    assert_eq!(plane(|_, _| 0.5).0, 0.0);
}

/// Discs 1 apart on a square of 96 x 96, of a colour at each place.
fn square(colour: fn(Vec3) -> f32) -> Surfels {
    let mut model = of_fronts((0..96 * 96).map(|i| (Vec3::new((i % 96) as f32, (i / 96) as f32, 0.0), Vec3::Z, 1.2)));
    for (own, place) in model.colour.iter_mut().zip(&model.position) {
        *own = Vec3::splat(colour(*place));
    }
    model
}

/// The nodes with cells of about 3, each with the distance of its box from the edge of the square.
fn deviations(model: &Surfels) -> Vec<(f32, Node)> {
    let levels = tree(model);
    let of = levels.nodes.iter().filter(|node| !node.is_leaf() && (2.5..3.5).contains(&node.spacing));
    let nodes: Vec<(f32, Node)> = of
        .map(|node| {
            let [low, high] = node.corners;
            (low.min(Vec3::splat(95.0) - high).truncate().min_element(), node.clone())
        })
        .collect();
    assert!(nodes.len() >= 16, "{}", nodes.len());
    nodes
}

/// Discs reach over those that they replace. That counts at the rim of a plane, and not within.
#[test]
fn reach_counts_where_a_surface_ends() {
    for (inside, node) in deviations(&square(|_| 0.5)) {
        let in_cells = node.deviation / node.spacing;
        if inside < 1.0 {
            assert!(in_cells > 0.01, "at the rim: {in_cells} {node:?}");
        } else if inside > 6.0 {
            assert!(in_cells < 1e-4, "within: {in_cells} {node:?}");
        }
    }
    // A ball ends nowhere: what is left is how far flat discs lie from it, the height of an arc. Where it cuts off the
    // corner of a cell, no disc may be in that.
    let levels = tree(&ball(200_000));
    let inner = || levels.nodes.iter().filter(|node| !node.is_leaf() && node.spacing < 0.2);
    let ends = inner().filter(|node| node.deviation > 0.25 * node.spacing * node.spacing).count();
    assert!(ends * 20 < inner().count(), "{ends} of {}", inner().count());
}

/// It counts where colours change, too, the less the less they do.
#[test]
fn reach_counts_where_a_colour_ends() {
    let within = |colour| {
        let nodes = deviations(&square(colour));
        nodes.into_iter().filter(|(inside, _)| *inside > 6.0).map(|(_, node)| node.deviation).fold(0.0, f32::max)
    };
    let [black, grey, slow] = [
        within(|place| if place.x < 48.0 { 0.0 } else { 1.0 }),
        within(|place| if place.x < 48.0 { 0.4 } else { 0.5 }),
        within(|place| 0.4 + 0.001 * place.x),
    ];
    assert!(black > 0.05 && grey < 0.2 * black && slow < 0.2 * grey, "{black} {grey} {slow}");
}

/// A box of squares ends at its edges, although another side begins there.
#[test]
fn a_sharp_edge_is_an_end() {
    let side = |i: usize| ((i % 48) as f32 + 0.5, (i / 48) as f32 + 0.5);
    let up = (0..48 * 48).map(|i| (Vec3::new(side(i).0, side(i).1, 0.0), Vec3::Z, 1.2));
    let along = (0..48 * 48).map(|i| (Vec3::new(0.0, side(i).1, -side(i).0), Vec3::NEG_X, 1.2));
    let levels = tree(&of_fronts(up.chain(along)));
    let at_edge = |node: &&Node| !node.is_leaf() && node.spacing > 1.5 && node.corners[0].x < 0.1;
    let nodes: Vec<&Node> = levels.nodes.iter().filter(at_edge).collect();
    assert!(nodes.len() > 4);
    assert!(nodes.iter().all(|node| node.deviation > 0.01 * node.spacing), "{nodes:?}");
}

#[test]
fn what_has_no_levels() {
    assert!(Levels::of(&Surfels::default()).is_none());
    assert!(Levels::of(&ball(FEW)).is_none());
    // Not along the curve.
    let mut model = ball(5000);
    model.position.swap(0, 4000);
    assert!(Levels::of(&model).is_none());
    // All in one place: there is no cell to divide.
    let same = of_fronts((0..1000).map(|_| (Vec3::ONE, Vec3::Z, 0.1)));
    let levels = tree(&same);
    assert_eq!(levels.nodes.len(), 1);
    // Very many in one place, and one elsewhere: pairs of all would take hours.
    let places = (0..300_000).map(|i| (Vec3::X * f32::from(u8::from(i == 0)), Vec3::Z, 0.1));
    assert_eq!(tree(&of_fronts(places)).merged.len(), 2);
    // Areas that are no numbers.
    assert!(Levels::of(&of_fronts((0..1000).map(|i| (Vec3::X * i as f32, Vec3::Z, 1e25)))).is_none());
}

/// A file brings the tree of its model along, and it is used until the model changes.
#[test]
fn a_file_keeps_the_tree() {
    let mut model = flying(5000);
    model.material = vec![Material { specular: 0.3, ..Material::default() }; model.len()];
    model.opacity = vec![0.9; model.len()];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.bin");
    // The file has another order than a renderer.
    let mut other = model.clone();
    let columns = [&mut other.position, &mut other.axis_u, &mut other.axis_v, &mut other.normal, &mut other.colour];
    columns.into_iter().chain([&mut other.velocity]).for_each(|column| column.reverse());
    crate::model::write_bin(&path, &other).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let parsed = crate::model::parse(&bytes, crate::model::ModelFormat::Bin).unwrap();
    let crate::model::Parsed::Surfels(read) = parsed else { panic!("surfels") };
    assert_eq!(read.position, other.position);
    let read = read.spatially_ordered();
    let made = Levels::of(&model).unwrap();
    let kept = read.tree().unwrap();
    assert!(Arc::ptr_eq(&kept, &read.tree().unwrap()), "it was made anew");
    assert!((&kept.nodes, &kept.share, &kept.alike) == (&made.nodes, &made.share, &made.alike));
    let (kept, made) = (&kept.merged, &made.merged);
    assert!(kept.position == made.position && kept.axis_u == made.axis_u && kept.axis_v == made.axis_v);
    assert!(kept.normal == made.normal && kept.colour == made.colour && kept.opacity == made.opacity);
    assert!(kept.material == made.material && kept.rates() == made.rates());
    for change in [
        (|model| model.colour[7].x += 0.1) as fn(&mut Surfels),
        |model| model.normal[9] = Vec3::X,
        |model| model.material[9].shininess = 2.0,
        |model| model.opacity[9] = 0.5,
        |model| model.velocity[9] = Vec3::X,
        |model| model.acceleration[9] = Vec3::X,
    ] {
        let mut other = read.clone();
        change(&mut other);
        let made = other.tree().unwrap();
        assert!(!Arc::ptr_eq(&made, &other.tree().unwrap()), "a tree of other surfels was kept");
    }
    // What shows all its surfels has no tree in its file: discs that cross each other.
    for i in 0..model.len() {
        let [u, v, front] = if i % 2 == 0 { [Vec3::X, Vec3::Y, Vec3::Z] } else { [Vec3::Y, Vec3::Z, Vec3::X] };
        (model.axis_u[i], model.axis_v[i], model.normal[i]) = (0.1 * u, 0.1 * v, front);
    }
    let loose = folder.path().join("loose.bin");
    crate::model::write_bin(&loose, &model).unwrap();
    assert!(!std::fs::read(&loose).unwrap().windows(10).any(|name| name == b"level_node"));
}

/// The tree does not depend on the number of threads.
#[test]
fn threads_change_nothing() {
    let model = ball(20_000);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (a, b) = (one.install(|| tree(&model)), tree(&model));
    assert!(a.nodes == b.nodes && a.merged.position == b.merged.position && a.merged.axis_u == b.merged.axis_u);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any discs have sound levels, or none.
    #[test]
    fn any_discs_have_sound_levels(
        size in -18.0_f32..18.0,
        radius in -18.0_f32..18.0,
        flat in prop::array::uniform3(prop::bool::ANY),
        seed in any::<u32>(),
    ) {
        let number = |i: usize, k: u32| {
            let mixed = (i as u32).wrapping_mul(2_654_435_761).wrapping_add(k.wrapping_mul(40_503)).wrapping_add(seed);
            (mixed ^ mixed >> 15).wrapping_mul(2_246_822_519) as f32 / u32::MAX as f32
        };
        let (size, radius) = (10.0_f32.powf(size), 10.0_f32.powf(radius));
        let discs = (0..600).map(|i| {
            let place: [f32; 3] = [0, 1, 2].map(|axis| if flat[axis] { 0.0 } else { size * number(i, axis as u32) });
            let (z, turn) = (2.0 * number(i, 3) - 1.0, TAU * number(i, 4));
            let front = Vec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z);
            (Vec3::from(place), front, radius * (0.5 + number(i, 5)))
        });
        let model = Arc::new(of_fronts(discs));
        // The largest of these discs are larger than a model may have.
        if let (Some(levels), Ok(())) = (Levels::of(&model).map(Arc::new), model.check()) {
            for cut in cuts(&levels) {
                prop_assert!(levels.gather(&model, &cut, None).check().is_ok());
            }
            let back = Levels::from_columns(levels.columns(), levels.merged.clone(), model.len());
            prop_assert!(back.is_ok_and(|back| back.nodes == levels.nodes));
        }
    }
}

/// The ball with velocities that grow with the place, and one acceleration.
fn flying(count: usize) -> Surfels {
    let mut surfels = ball(count);
    surfels.velocity = surfels.position.iter().map(|place| Vec3::new(2.0 * place.x, 1.0, place.y)).collect();
    surfels.acceleration = vec![Vec3::Y; surfels.len()];
    surfels
}

/// Each cut has the model's mean velocity; boxes hold the velocities below, and the stray is how far these are from
/// those of the node's surfels.
#[test]
fn merging_keeps_velocities() {
    let model = Arc::new(flying(20_000));
    let levels = tree(&model);
    let mean = |surfels: &Surfels, share: &dyn Fn(usize) -> f64| {
        let weights = (0..surfels.len()).map(|i| area(surfels, i) * share(i));
        let sum =
            |of: &Vec<Vec3>| weights.clone().zip(of).map(|(weight, rate)| weight * rate.as_dvec3()).sum::<DVec3>();
        (sum(&surfels.velocity) / weights.clone().sum::<f64>(), sum(&surfels.acceleration) / weights.sum::<f64>())
    };
    let (velocity, acceleration) = mean(&model, &|_| 1.0);
    for cut in cuts(&levels) {
        let surfels = levels.gather(&model, &cut, None);
        surfels.check().unwrap();
        let factors = levels.factors(&model, &cut);
        let own = f64::from(model.mean_normalisation());
        let leaves = cut.iter().all(|&node| levels.nodes[node as usize].is_leaf());
        let share = |i: usize| if leaves { 1.0 } else { f64::from(factors[i]) / own };
        let (of_cut, accelerations) = mean(&surfels, &share);
        assert!((of_cut - velocity).length() < 1e-3, "{of_cut} {velocity}");
        assert!((accelerations - acceleration).length() < 1e-6, "{accelerations}");
    }
    for (i, node) in levels.nodes.iter().enumerate() {
        let [velocities, accelerations] = node.rates;
        assert!(accelerations.corners == [Vec3::Y; 2] && accelerations.stray < 1e-6);
        let (mut leaves, mut open) = (Vec::new(), vec![i]);
        while let Some(i) = open.pop() {
            let node = &levels.nodes[i];
            open.extend(node.children.clone().map(|child| child as usize));
            if node.is_leaf() {
                leaves.extend(node.surfels.clone().map(|i| model.velocity[i as usize]));
            }
        }
        let low = leaves.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = leaves.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        assert_eq!(velocities.corners, [low, high]);
        // Velocities change by 2 along x and 1 along y, and cells are cubes that a surface crosses in many ways.
        let expected = node.spacing * (5.0_f32 / 12.0).sqrt();
        assert!(
            node.is_leaf() || (0.2..1.1).contains(&(velocities.stray / expected)),
            "{} {expected}",
            velocities.stray
        );
    }
    assert_eq!(tree(&ball(2000)).merged.rates().map(Vec::len), [0; 2]);
}
