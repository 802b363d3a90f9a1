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
    let volume = block(20);
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
    let empty = Gaussians { opacity: vec![0.0; volume.len()], ..volume.clone() };
    assert!(VolumeLevels::of(&empty).is_none_or(|levels| levels.merged.check().is_ok()));
    let huge = Gaussians { opacity: vec![f32::MAX; volume.len()], ..volume };
    assert!(VolumeLevels::of(&huge).is_none());
}

/// Errors grow with the width of cells. Wild colours are missed more than one colour is.
#[test]
fn errors_grow_with_cells_and_with_what_they_hold() {
    let wild = block(40);
    let plain = Gaussians { base: vec![Vec3::ONE; wild.len()], ..wild.clone() };
    let error = |volume: &Gaussians| {
        let levels = VolumeLevels::of(volume).unwrap();
        let node = levels.nodes().iter().find(|node| !node.is_leaf() && node.error.is_finite()).unwrap().clone();
        assert!(node.area > 0.0 && node.spacing > 0.0);
        let errors = [0.25, 0.5, 1.0, 1.5, 2.0].map(|pixels| node.error_at(pixels));
        assert!(errors.is_sorted() && errors[0] > 0.0, "{errors:?}");
        errors[2]
    };
    let [of_wild, of_plain] = [error(&wild), error(&plain)];
    assert!(of_wild > 1.5 * of_plain, "{of_wild} {of_plain}");
}
