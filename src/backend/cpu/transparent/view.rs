//! What the Gaussians of one object are seen with, at one sample.

use crate::backend::cpu::shadows::Shadows;
use crate::film::Blending;
use crate::frame::{Blocks, FrameObject, PixelRect, PosedObject, PosedSample, Raster};
use crate::scene::Drawing;

/// What `project` needs beside the Gaussians.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct GaussianView<'a> {
    pub object: &'a FrameObject,
    /// `None`: no shadows fall on it.
    pub shaded: Option<Shaded<'a>>,
    pub drawing: Drawing,
    pub sample: &'a PosedSample,
    pub posed: &'a PosedObject,
    /// Least depth that is drawn, scene units; infinite for an object that is hidden.
    pub near: f32,
    pub raster: Raster,
    /// Size of the image, pixels.
    pub size: [u32; 2],
    /// Pixels of the image to one of the raster.
    pub stride: f32,
    /// The pixels that are wanted.
    pub pixels: PixelRect,
    /// Blocks of those pixels that are wanted; `None`: all.
    pub wanted: Option<&'a Blocks>,
    /// Least and greatest offset of the sample positions that the splats are for, raster pixels.
    pub offsets: [[f32; 2]; 2],
    /// Depth of a layer of volumes, scene units, > 0.
    pub layer: f32,
    /// Variance by which the filter of the image widens a volume's kernel, raster pixels^2.
    pub variance: f32,
    /// The numbers in which the image is composited.
    pub blending: Blending,
    /// With velocities of centres?
    pub velocity: bool,
    /// Index of the object's first Gaussian among all of the frame.
    pub first: u32,
    /// Leave nothing out, so that splat `i` is Gaussian `i` of the range.
    pub all: bool,
}

/// The shadows that fall on an object: those of the middle of its group, where it is then.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Shaded<'a> {
    pub shadows: &'a Shadows,
    pub sample: &'a PosedSample,
    pub posed: &'a PosedObject,
}
