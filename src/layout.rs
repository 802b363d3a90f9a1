//! Plain structs that passes exchange; their memory layout is the same on the CPU and on the GPU.

use bytemuck::{Pod, Zeroable};

use crate::film::Aov;
use crate::frame::Frame;
use crate::model::Material;
use crate::options::Shading;
use crate::shading::ShadingLight;

/// A surfel's kernel, posed and projected for one time sample.
///
/// At the sample position p = pixel + 1/2 + offset of the group's raster, with (x, y) = p - `reference`: the splat's
/// plane has depth 1 / (i.(x, y, 1)) on the ray, and the ray meets it at tangent-plane coordinates u = u.(x, y, 1) *
/// depth, v likewise (ray casting of Wolf 2008, section 4.2.1, eq. 4.2, as a homography; docs/math.md).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Splat {
    /// Where x and y are counted from, minus the sub-pixel offset, pixels: the projected centre of an ordinary splat,
    /// the camera's axis for one that reaches the camera plane.
    pub reference: [f32; 2],
    /// Inverse depth: coefficients of x, y and 1.
    pub inverse_depth: [f32; 3],
    /// u times inverse depth.
    pub u: [f32; 3],
    /// v times inverse depth.
    pub v: [f32; 3],
    /// Depth of the centre; 0 where the low-pass disc around `reference` does not exist. Below 0 for a sphere, of which
    /// this is the disc that faces the eye: minus its radius over the distance of its centre.
    pub centre_depth: f32,
    /// The pixels that the splat may touch, as `PixelRect::bounds` has them.
    pub bounds: [u16; 4],
    /// Index of the surfel in its model.
    pub surfel: u32,
    /// Bit 0: seen from behind (normals turn to the viewer). A backend may use the bits above.
    pub flags: u32,
}

impl Splat {
    /// Is it the disc of a sphere?
    #[inline(always)]
    pub fn is_sphere(&self) -> bool {
        self.centre_depth < 0.0
    }

    /// The radius of a sphere over the distance of its centre; 0 of a disc.
    #[inline(always)]
    pub fn sine(&self) -> f32 {
        if self.centre_depth < 0.0 { -self.centre_depth } else { 0.0 }
    }
}

/// A surfel's kernel after projection, convolved with the low-pass filter of full EWA (docs/math.md, section 3).
///
/// With (x, y) counted from `disc.reference`: the surfel's affine image is met at (`u`.(x, y), `v`.(x, y)) in units of
/// its axes, in perspective at that over 1 - `shrink`.(x, y), and (`p`.(x, y)) is V'^-1 (x, y).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct EwaSplat {
    /// The unfiltered kernel. Its bounds are those of the disc alone.
    pub disc: Splat,
    /// Coefficients of x and y.
    pub u: [f32; 2],
    /// Coefficients of x and y.
    pub v: [f32; 2],
    /// Coefficients of x and y.
    pub shrink: [f32; 2],
    /// The symmetric inverse V'^-1: xx, xy, yy; pixels^-2.
    pub p: [f32; 3],
    /// Weight at the centre before normalisation, sqrt(|V| / |V'|), in (0, 1].
    pub peak: f32,
    /// Weight at the centre, normalised (docs/math.md, section 3).
    pub weight: f32,
    /// 1 for a splat that is not filtered, because it reaches the camera plane or is a sphere; else 0.
    pub crossing: u32,
    /// The pixels whose tiles list the splat: those that it may touch, and the apron around them. They lie where a
    /// second splat would have its bounds: lists are made of those.
    pub listed_bounds: [u16; 4],
    /// The pixels in which the filtered kernel may have weight, as `PixelRect::bounds` has them.
    pub filtered_bounds: [u16; 4],
}

/// A surfel's kernel in motion over an interval, tau in [-1, 1], projected (docs/math.md, section 7).
///
/// With (x, y) counted from `reference` as in [`Splat`] and w = i.(x, y, 1): on the ray through a sample position the
/// kernel is met at tangent-plane coordinates (`u`.(x, y, 1) + tau `u_rate`.(x, y, 1)) / w, v likewise, and at depth (1
/// + k tau) / w with k = i.motion: all linear in tau. It is met only where w > 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SweptSplat {
    /// Where x and y are counted from, minus the sub-pixel offset, pixels: the projected centre at tau = 0 of an
    /// ordinary splat, the camera's axis for one that reaches the camera plane.
    pub reference: [f32; 2],
    /// Inverse depth at tau = 0: coefficients of x, y and 1.
    pub inverse_depth: [f32; 3],
    /// u times inverse depth at tau = 0.
    pub u: [f32; 3],
    /// v times inverse depth at tau = 0.
    pub v: [f32; 3],
    /// Change of u times inverse depth to tau = 1.
    pub u_rate: [f32; 3],
    /// Change of v times inverse depth to tau = 1.
    pub v_rate: [f32; 3],
    /// Motion from tau = 0 to 1 in screen space, sheared so that `reference` is its axis: x and y times depth, depth.
    pub motion: [f32; 3],
    /// Pixel columns (first, last) and rows between which the kernel lies at tau = -1 and at tau = 1, not rounded; at
    /// other times they are what lies between.
    pub ends: [[f32; 4]; 2],
    /// The pixels that the kernel may touch, as `PixelRect::bounds` has them.
    pub bounds: [u16; 4],
    /// Index of the surfel in its model.
    pub surfel: u32,
    /// [`FLAG_BACK`], [`FLAG_LOW_PASS`], [`FLAG_CROSSING`]. A backend may use the bits above.
    pub flags: u32,
}

/// The kernel of a [`SweptSplat`], convolved with the low-pass filter of full EWA (docs/math.md, section 7).
///
/// It is a swept kernel of its own: the forms are those of a `SweptSplat`, counted from the same reference. Those that
/// have no constants there have none here.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SweptFilter {
    /// Inverse depth of its own plane: coefficients of x and y. The constant is that of the unfiltered kernel.
    pub inverse_depth: [f32; 2],
    /// Coefficients of x and y.
    pub u: [f32; 2],
    /// Coefficients of x and y.
    pub v: [f32; 2],
    /// Change of u times inverse depth to tau = 1.
    pub u_rate: [f32; 3],
    /// Change of v times inverse depth to tau = 1.
    pub v_rate: [f32; 3],
    /// The depth of its own plane at tau is (1 + k tau) / w.
    pub k: f32,
    /// Weight at the centre before normalisation, sqrt(|V| / |V'|), in (0, 1].
    pub peak: f32,
    /// Weight at the centre, of colours (docs/math.md, section 3).
    pub weight: f32,
    /// Weight at the centre, of coverage: `peak` times the surfel's normalisation. 0 for a kernel that is not
    /// filtered: its forms are those of the splat, and its coverage has its `weight`.
    pub coverage: f32,
}

/// A kernel in motion and its filtered kernel, as the GPU has them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FilteredSplat {
    /// The kernel. Its bounds and ends hold the filtered kernel, too.
    pub splat: SweptSplat,
    /// The kernel, filtered.
    pub filtered: SweptFilter,
}

impl SweptFilter {
    /// The kernel that is not filtered: it reaches the camera plane, or the filter is zero.
    pub fn unfiltered(weight: f32) -> Self {
        Self { peak: 1.0, weight, ..Self::zeroed() }
    }

    /// Is the kernel its disc?
    pub fn is_unfiltered(&self) -> bool {
        self.coverage == 0.0
    }
}

/// A 3D Gaussian of a capture or of a volume, posed and projected for one time sample (docs/math.md, sections 11 and
/// 12).
///
/// At the sample position p = pixel + 1/2 + offset of the group's raster, with (x, y) = p - `reference`: the number
/// 2^(`peak` - `along` x^2 - `across` (y - `slope` x)^2) is its alpha, or for a volume its optical depth in powers
/// of 1/2.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GaussianSplat {
    /// The projected centre, pixels; sub-pixel offsets are not in it.
    pub reference: [f32; 2],
    /// Fall of its log2 with x^2, pixels^-2, where y = `slope` x.
    pub along: f32,
    /// Where on a column it is largest: y over x.
    pub slope: f32,
    /// Fall of its log2 away from that place, pixels^-2.
    pub across: f32,
    /// Its log2 at the centre.
    pub peak: f32,
    /// Depth of the centre, scene units.
    pub depth: f32,
    /// Colour as seen from the eye, in the numbers that the image is composited in; >= 0.
    pub colour: [f32; 3],
    /// The pixels that the splat may touch, as `PixelRect::bounds` has them.
    pub bounds: [u16; 4],
    /// Index among all Gaussians of the frame: those of its first object first.
    pub index: u32,
    /// For a volume the number of its layer, from 1 on, rising with depth. 0 for a capture.
    pub layer: u32,
}

/// The splat shows its back.
pub const FLAG_BACK: u32 = 1;
/// The low-pass disc around `reference` exists.
pub const FLAG_LOW_PASS: u32 = 2;
/// The kernel reaches the camera plane, and no boxes bound it: `ends` mean nothing.
pub const FLAG_CROSSING: u32 = 4;

/// Which weighted sums the attribute pass has for each sample position, and in which channels.
///
/// Channel 0 is the sum of weights, 1 to 3 are colour. The other channels exist only where they are needed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channels {
    /// Number of channels.
    pub count: usize,
    /// First of three: world-space normal.
    pub normal: Option<usize>,
    /// Depth.
    pub depth: Option<usize>,
    /// First of two: screen velocity, pixels per shutter.
    pub velocity: Option<usize>,
    /// First of four: ambient, diffuse, specular, shininess; only where materials differ.
    pub material: Option<usize>,
    /// Reflection coefficient; only where objects differ in it.
    pub reflection: Option<usize>,
    /// 1 where shadows fall on the surfel, else 0; only where there are shadows and they do not fall on all.
    pub receives: Option<usize>,
    /// 1 for a shadow catcher, else 0; only where there is one.
    pub catcher: Option<usize>,
    /// 1 for held objects, 0 for others; only where shadows are asked and both are there.
    pub held: Option<usize>,
    /// First of three: from the surfel to where it is in the middle of the strip, world axes; only where shadows are
    /// asked and a rolling shutter reads what moves.
    pub moved: Option<usize>,
    /// Opacity; only for what light passes through.
    pub opacity: Option<usize>,
    /// The material of all objects, where they have the same.
    pub uniform: Option<Material>,
    /// The reflection coefficient of all objects, where they have the same; else 0.
    pub mirror: f32,
    /// Are all objects held?
    pub all_held: bool,
}

impl Channels {
    /// Largest number of channels.
    pub const MOST: usize = 22;

    /// The channels that `frame` needs.
    pub fn of(frame: &Frame) -> Self {
        let deferred = frame.shading == Shading::Phong;
        let is_point = |light: &ShadingLight| matches!(light, ShadingLight::Point { .. }) || light.has_shadows();
        let lit_by_points = frame.all_samples().any(|sample| sample.lights.iter().any(is_point));
        let first = frame.objects.first().and_then(|object| object.material);
        let uniform = first.filter(|_| frame.objects.iter().all(|object| object.material == first));
        let mirror = frame.objects.first().map(|object| object.reflection);
        let mirror = mirror.filter(|&first| frame.objects.iter().all(|object| object.reflection == first));
        let mut count = 4;
        let mut take = |wanted: bool, n: usize| {
            wanted.then(|| {
                count += n;
                count - n
            })
        };
        let normal = take(deferred || frame.aovs.contains(&Aov::Normal), 3);
        let depth = take(deferred && lit_by_points || frame.aovs.contains(&Aov::Depth), 1);
        let velocity = take(frame.aovs.contains(&Aov::Velocity), 2);
        let material = take(deferred && uniform.is_none(), 4);
        let reflection = take(deferred && frame.surroundings.is_some() && mirror.is_none(), 1);
        let mirror = mirror.unwrap_or_default();
        let mut surfels = frame.objects.iter().filter(|object| object.has_surfels());
        let receives = take(deferred && frame.has_shadows() && !surfels.clone().all(|object| object.receives), 1);
        let catcher = take(deferred && surfels.any(|object| object.catcher), 1);
        let all_held = frame.holds();
        let held = take(deferred && frame.has_shadows() && all_held.is_none(), 1);
        let all_held = all_held.unwrap_or(false);
        let moved = take(deferred && frame.has_shadows() && frame.moves_while_read(), 3);
        Self {
            count,
            normal,
            depth,
            velocity,
            material,
            reflection,
            receives,
            catcher,
            held,
            moved,
            opacity: None,
            uniform,
            mirror,
            all_held,
        }
    }

    /// The same and the opacity.
    #[must_use]
    pub fn with_opacity(self) -> Self {
        Self { count: self.count + 1, opacity: Some(self.count), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_splat_is_a_cache_line() {
        assert_eq!(size_of::<Splat>(), 64);
        assert_eq!(size_of::<GaussianSplat>(), 56);
        assert_eq!(size_of::<EwaSplat>(), 128);
        assert_eq!(size_of::<SweptSplat>(), 128);
        assert_eq!(size_of::<SweptFilter>(), 64);
    }
}
