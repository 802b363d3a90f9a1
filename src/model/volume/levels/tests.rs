use glam::{DMat3, DVec3, Quat, Vec3};

use super::*;
use crate::math::random::Random;

/// A block of kernels whose extinctions and colours differ.
fn block(cells: u32) -> Gaussians {
    let mut random = Random(7);
    let mut made = Gaussians { optics: Optics::Extinction { layer: 1.25 }, linear: true, ..Gaussians::default() };
    for i in 0..cells.pow(3) {
        let [x, y, z] = [i % cells, i / cells % cells, i / cells.pow(2)].map(|x| x as f32);
        made.position.push(Vec3::new(x, y, z));
        made.sigma.push(Vec3::new(0.6, 0.5, 0.4));
        made.rotation.push(Quat::from_xyzw(random.next(), random.next(), random.next(), 1.0).normalize());
        made.opacity.push(random.next());
        made.base.push(random.vector());
    }
    made
}

/// Extinction, mean, second moments about 0 and mean colour of some kernels together.
fn moments<'a>(kernels: impl Iterator<Item = (&'a Gaussians, usize)>) -> (f64, DVec3, DMat3, DVec3) {
    let mut sums = (0.0, DVec3::ZERO, DMat3::ZERO, DVec3::ZERO);
    for (of, i) in kernels {
        let (mass, place) = (f64::from(of.opacity[i]), of.position[i].as_dvec3());
        let own = merge::covariance(of.sigma[i], of.rotation[i]).as_dmat3();
        sums.0 += mass;
        sums.1 += place * mass;
        sums.2 += (own + DMat3::from_cols(place * place.x, place * place.y, place * place.z)) * mass;
        sums.3 += of.base[i].as_dvec3() * mass;
    }
    let (mass, place, second, colour) = sums;
    (mass, place / mass, second * mass.recip(), colour / mass)
}

fn leaves(levels: &VolumeLevels, node: u32) -> Vec<u32> {
    let of = &levels.nodes()[node as usize];
    if of.is_leaf() {
        return vec![node];
    }
    of.children.clone().flat_map(|child| leaves(levels, child)).collect()
}

/// The kernels of a node have all extinction of those below it, and their mean, spread and colour.
#[test]
fn nodes_keep_the_moments_of_what_is_below() {
    let volume = block(40);
    let levels = VolumeLevels::of(&volume).unwrap();
    let mut inner = 0;
    for (node, of) in (0..).zip(levels.nodes()) {
        let (mass, place, second, colour) = moments(levels.own(&volume, node));
        let below = leaves(&levels, node);
        let all = moments(below.iter().flat_map(|&leaf| levels.own(&volume, leaf)));
        assert!((mass - all.0).abs() < 1e-4 * all.0, "{node}: {mass} for {}", all.0);
        assert!((place - all.1).length() < 1e-3 && (colour - all.3).length() < 1e-4, "{node}");
        let off = (second - all.2).to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        assert!(off < 0.01, "{node}: {off}");
        inner += u32::from(!of.is_leaf());
    }
    assert!(inner > 8, "{inner}");
    let root = levels.gather(&volume, &[0]);
    assert!(root.len() < volume.len() / 8 && root.check().is_ok() && root.optics == volume.optics);
    let all: Vec<u32> = leaves(&levels, 0);
    assert_eq!(levels.gather(&volume, &all).len(), volume.len());
}

/// Captures, volumes of few kernels and such as have all of them in one place have no levels, and do not end the
/// program.
#[test]
fn what_cannot_be_merged_has_no_levels() {
    let volume = block(20);
    let capture = Gaussians { optics: Optics::Alpha, ..volume.clone() };
    assert!(VolumeLevels::of(&capture).is_none());
    assert!(VolumeLevels::of(&block(5)).is_none());
    let flat = Gaussians { position: vec![Vec3::ONE; volume.len()], ..volume.clone() };
    assert!(VolumeLevels::of(&flat).is_none_or(|levels| levels.nodes()[0].is_leaf()));
    // What cannot be seen is not used, as in a volume without extinction, or one so small that squares are too large.
    let empty = Gaussians { opacity: vec![0.0; volume.len()], ..volume.clone() };
    let tiny = |v: &Vec3| *v * 1e-22;
    let tiny = Gaussians {
        position: volume.position.iter().map(tiny).collect(),
        sigma: volume.sigma.iter().map(tiny).collect(),
        ..volume.clone()
    };
    for unseen in [empty, tiny] {
        let levels = VolumeLevels::of(&unseen).unwrap();
        assert!(levels.errors(&unseen, 1.0)[0].at(1e-3).is_infinite());
    }
    let huge = Gaussians { opacity: vec![f32::MAX; volume.len()], ..volume };
    assert!(VolumeLevels::of(&huge).is_none());
}

/// Errors grow with the width of cells. Wild colours are missed more than one colour is.
#[test]
fn errors_grow_with_cells_and_with_what_they_hold() {
    let wild = block(40);
    let plain = Gaussians { base: vec![Vec3::ONE; wild.len()], ..wild.clone() };
    let error = |volume: &Gaussians, factor: f64| {
        let levels = VolumeLevels::of(volume).unwrap();
        let measured = levels.errors(volume, factor);
        let used = |node: &VolumeNode, of: &NodeError| !node.is_leaf() && of.at(1.0).is_finite();
        let node = levels.nodes().iter().zip(&*measured).find(|(node, of)| used(node, of)).unwrap().1;
        assert!(node.area > 0.0);
        let errors = [0.25, 0.5, 1.0, 1.5, 2.0].map(|pixels| node.at(pixels));
        assert!(errors.is_sorted_by(|a, b| a < b) && errors[0] > 0.0, "{errors:?}");
        errors[2]
    };
    let [of_wild, of_plain, of_thin] = [error(&wild, 1.0), error(&plain, 1.0), error(&wild, 1e-3)];
    assert!(of_wild > 1.5 * of_plain, "{of_wild} {of_plain}");
    assert!(of_wild > 3.0 * of_thin, "{of_wild} {of_thin}");
}

/// A large slice is looked at from its front, whatever way it lies: its wild colours show there alone.
#[test]
fn slices_are_seen_from_their_fronts() {
    let mut random = Random(3);
    let (cells, margin) = (300, 40);
    for axis in 0..3 {
        let mut slice = Gaussians { optics: Optics::Extinction { layer: 1.25 }, linear: true, ..Gaussians::default() };
        for i in 0..cells * cells {
            let [x, y] = [i % cells, i / cells];
            let inside = [x, y].iter().all(|place| (margin..cells - margin).contains(place));
            let mut place = [0.0; 3];
            (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (x as f32, y as f32);
            slice.position.push(Vec3::from_array(place));
            slice.sigma.push(Vec3::splat(0.6));
            slice.rotation.push(Quat::IDENTITY);
            slice.opacity.push(3.0);
            slice.base.push(Gaussians::base_of(Vec3::splat(if inside { random.next() } else { 0.5 })));
        }
        let levels = VolumeLevels::of(&slice).unwrap();
        let measured = levels.errors(&slice, 1.0);
        let middle = |node: &VolumeNode| 0.5 * (node.corners[0] + node.corners[1]);
        let wild = |node: &&(&VolumeNode, &NodeError)| {
            let off = (middle(node.0) - 0.5 * cells as f32).to_array();
            (0..3).filter(|i| *i != axis).all(|i| off[i].abs() < 60.0)
        };
        let used = levels.nodes().iter().zip(&*measured).filter(|(node, of)| !node.is_leaf() && of.at(1.0).is_finite());
        let of_wild: Vec<f64> = used.collect::<Vec<_>>().iter().filter(wild).map(|(_, of)| of.at(1.0)).collect();
        let most = of_wild.iter().fold(0.0, |most: f64, error| most.max(*error));
        assert!(of_wild.len() > 3 && most > 0.015, "{axis}: {of_wild:?}");
    }
}
