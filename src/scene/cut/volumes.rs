//! The kernels of a volume that are fine enough for a frame.

use glam::{DVec2, DVec3, Vec3};

use super::{BlockErrors, CutTolerance, ImagePlane, View};
use crate::model::{NodeError, Optics, VolumeLevels, VolumeNode};
use crate::scene::model::GaussianModel;

/// Depth of a layer of kernels, pixels, from which on none are merged: the kernels of a grid then lie .8 pixels apart.
const COARSE: f64 = 1.0;

/// The model with the kernels that its pictures need; `None` where these are all. What it leaves out is added to
/// `errors`. No tree is built for a volume whose kernels all lie wider apart than that. `opacity` is the object's.
pub(super) fn cut(
    model: &GaussianModel,
    opacity: f64,
    views: &[View],
    tolerance: CutTolerance,
    image: ImagePlane,
    errors: &mut BlockErrors,
) -> Option<GaussianModel> {
    let Optics::Extinction { layer } = model.gaussians().optics else { return None };
    let corners = model.bounds().corners();
    let is_fine = |view: &View| {
        let place = |corner: &DVec3| view.camera_from_model.transform_point3(*corner).length();
        let farthest = corners.iter().map(place).fold(view.near, f64::max);
        f64::from(layer) * view.pixels / farthest < COARSE
    };
    if views.is_empty() || !views.iter().all(is_fine) {
        return None;
    }
    let crop = model.crop.map_or([Vec3::NEG_INFINITY, Vec3::INFINITY], |crop| crop.map(DVec3::as_vec3));
    let middle = &views[views.len() / 2];
    // A ray through an object of twice the size is twice as long.
    let factor = opacity * middle.pixels / middle.focal;
    model.cut(|levels| {
        let of_nodes = &*levels.errors(model.gaussians(), factor);
        let mut nodes = Vec::new();
        Chooser { levels, of_nodes, views, tolerance, image, crop, errors }.choose(0, &mut nodes);
        nodes
    })
}

struct Chooser<'a> {
    levels: &'a VolumeLevels,
    /// What pictures miss by each node.
    of_nodes: &'a [NodeError],
    views: &'a [View],
    tolerance: CutTolerance,
    image: ImagePlane,
    /// Corners of the box that shows.
    crop: [Vec3; 2],
    /// What the chosen nodes leave out.
    errors: &'a mut BlockErrors,
}

impl Chooser<'_> {
    /// Adds the coarsest nodes below `node` that are fine enough, from one end of their curve to the other.
    fn choose(&mut self, node: u32, cut: &mut Vec<u32>) {
        let levels = self.levels;
        let of = &levels.nodes()[node as usize];
        let ([low, high], [least, most]) = (of.corners, self.crop);
        if low.cmpgt(most).any() || high.cmplt(least).any() {
            return;
        }
        if of.is_leaf() {
            return cut.push(node);
        }
        let shows_whole = low.cmpge(least).all() && high.cmple(most).all();
        let measured = self.of_nodes[node as usize];
        let error = measured.at(f64::from(of.spacing) * self.density(of));
        if shows_whole && error <= self.tolerance.rest {
            self.add_error(of, error, f64::from(measured.area));
            return cut.push(node);
        }
        of.children.clone().for_each(|child| self.choose(child, cut));
    }

    /// Pixels of a length of 1 of the model at its nearest.
    fn density(&self, node: &VolumeNode) -> f64 {
        let corners = node.corners.map(Vec3::as_dvec3);
        self.views.iter().map(|view| view.density_in(corners)).fold(0.0, f64::max)
    }

    /// Adds what the picture misses at mid-exposure by a node that covers `area`, model units^2.
    fn add_error(&mut self, node: &VolumeNode, error: f64, area: f64) {
        let view = &self.views[self.views.len() / 2];
        let [low, high] = node.corners.map(Vec3::as_dvec3);
        let place = view.camera_from_model.transform_point3(0.5 * (low + high));
        if -place.z <= view.near {
            return;
        }
        let density = view.pixels / place.length();
        let on_image = self.image.axis + place.truncate() * DVec2::new(1.0, -1.0) * (view.focal / -place.z);
        let radius = 0.5 * (high - low).length() * density;
        self.errors.add(on_image, radius, error * error * area * density * density);
    }
}
