//! The pixels that a sample position is rendered for.

use glam::DVec2;

use super::strips::PosedStrip;
use crate::options::Prefilter;

/// The pixels that a group is rendered for, as an image of their own: every `Frame::stride`-th pixel of the frame's
/// image.
///
/// Raster pixel (i, j) is pixel (`origin.x` + i stride, `origin.y` + j stride) of the image. With stride 1 it is the
/// image, or a strip of it that a rolling shutter reads out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Raster pixels; an axis is 0 where the image is smaller than the phase.
    pub size: [u32; 2],
    /// Pixel of the image that the first raster pixel is.
    pub origin: [u32; 2],
    /// Pixels from the first one of the phase to the first one of a strip, raster pixels; else 0.
    pub first: [u32; 2],
    /// The axis along which the pixels of a strip are read out one after the other: 0 for columns, 1 for rows. `None`:
    /// all at once.
    pub readout: Option<usize>,
    /// Where the camera's axis meets the raster, raster pixels.
    pub axis: [f32; 2],
    /// Focal length, raster pixels: (height / 2) / tan(fovy / 2) / stride.
    pub focal: f32,
    /// Radius of the low-pass disc of the approximate EWA filter, raster pixels (Botsch et al. 2005; Wolf 2008, 4.2.3).
    pub low_pass: f32,
    /// Standard deviation of the low-pass filter of full EWA, raster pixels; 0 without it.
    pub sigma: f32,
    /// Standard deviation of what this sample position sees of the scene, raster pixels: with full EWA that of its
    /// filter, else its share of the pixel's square. What surfaces mirror is filtered by it.
    pub pixel: f32,
    /// Offset of the sample position from the raster pixel's centre, raster pixels.
    pub offset: [f32; 2],
}

/// The pixels of the image that a raster has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RasterArea {
    /// As [`Raster::origin`].
    pub origin: [u32; 2],
    /// As [`Raster::size`].
    pub size: [u32; 2],
    /// First and one past the last column of the raster, then rows, that the image takes. A strip has pixels around
    /// them for filters that reach so far.
    pub shown: [[u32; 2]; 2],
}

impl RasterArea {
    /// Fills what row `y` of the image takes of the raster, each `stride`-th place of `out`. `write` writes a row of
    /// the raster to every `stride`-th place from the first.
    pub fn fill(&self, y: usize, stride: usize, out: &mut [f32], write: impl FnOnce(usize, &mut [f32])) {
        let [left, top] = self.origin.map(|pixel| pixel as usize);
        let [columns, rows] = self.shown.map(|ends| ends.map(|pixel| pixel as usize));
        let Some(below) = y.checked_sub(top).filter(|below| below.is_multiple_of(stride)) else { return };
        let row = below / stride;
        if !(rows[0]..rows[1]).contains(&row) || columns[0] >= columns[1] {
            return;
        }
        let place = |column: usize| left + column * stride;
        if columns == [0, self.size[0] as usize] {
            return write(row, &mut out[left..=place(columns[1] - 1)]);
        }
        let mut line = vec![0.0; (self.size[0] as usize - 1) * stride + 1];
        write(row, &mut line);
        for column in columns[0]..columns[1] {
            out[place(column)] = line[column * stride];
        }
    }
}

/// Radius of the low-pass disc of the approximate EWA filter, pixels of a raster with this stride (Botsch et al. 2005).
pub(super) fn low_pass_radius(stride: u32) -> f32 {
    (std::f64::consts::SQRT_2 / f64::from(stride)) as f32
}

impl Raster {
    /// The pixels of the image that it has. The image takes those that its strip shows, or all.
    pub(super) fn area(&self, strip: Option<&PosedStrip>) -> RasterArea {
        let mut shown = self.size.map(|pixels| [0, pixels]);
        if let Some(strip) = strip {
            let from = |pixel: u32| pixel.saturating_sub(self.first[strip.axis]).min(self.size[strip.axis]);
            shown[strip.axis] = [from(strip.shown.start), from(strip.shown.end)];
        }
        RasterArea { origin: self.origin, size: self.size, shown }
    }

    /// The raster with the standard deviation that the filter of see-through surfels has: they are always filtered as
    /// full EWA does, with the approximate filter by a Gaussian as wide as its disc.
    #[must_use]
    pub fn for_see_through(self, prefilter: Prefilter) -> Self {
        if prefilter == Prefilter::Approx { Self { sigma: 0.5 * self.low_pass, ..self } } else { self }
    }

    /// Variance of the low-pass filter of `prefilter`, raster pixels^2, for kernels that are Gaussians. A disc of the
    /// approximate filter ends where a Gaussian has two standard deviations.
    pub fn variance(&self, prefilter: Prefilter) -> f32 {
        /// Share of the variance of a Gaussian that is left where it is cut at two standard deviations, as the kernels
        /// of surfels are: 1 - 2 / (e^2 - 1).
        const CUT: f32 = 0.686_965;
        let sigma = if prefilter == Prefilter::Approx { 0.5 * self.low_pass } else { self.sigma };
        CUT * sigma * sigma
    }

    /// Pixels within which the filter of full EWA reaches from one pixel to another.
    pub fn apron(&self) -> usize {
        (2.0 * self.sigma).ceil() as usize
    }

    /// The raster of an image of `size` pixels whose first pixel is `phase`, or a strip of it; without filters and
    /// offset. `lens`: focal length, pixels of the image, and the camera's shift.
    pub(super) fn new(
        size: [u32; 2],
        lens: (f64, DVec2),
        stride: u32,
        phase: [u32; 2],
        strip: Option<&PosedStrip>,
    ) -> Self {
        let (focal, shift) = lens;
        let s = f64::from(stride);
        let mut first = [0; 2];
        let mut pixels = [0, 1].map(|i| size[i].saturating_sub(phase[i]).div_ceil(stride));
        if let Some(PosedStrip { axis, posed, .. }) = strip {
            first[*axis] = posed.start;
            pixels[*axis] = posed.end.min(pixels[*axis]).saturating_sub(posed.start);
        }
        let origin = [0, 1].map(|i| phase[i] + stride * first[i]);
        let axis = |i: usize| (((0.5 + shift[i]) * f64::from(size[i]) - f64::from(origin[i]) - 0.5) / s + 0.5) as f32;
        Self {
            size: pixels,
            origin,
            first,
            readout: strip.map(|strip| strip.axis),
            axis: [axis(0), axis(1)],
            focal: (focal / s) as f32,
            low_pass: low_pass_radius(stride),
            sigma: 0.0,
            pixel: 0.0,
            offset: [0.0; 2],
        }
    }

    /// The raster at a sample position `offset` from the pixels' centres, pixels of the image.
    pub(super) fn at(self, offset: [f32; 2], stride: u32) -> Self {
        Self { offset: offset.map(|o| (f64::from(o) / f64::from(stride)) as f32), ..self }
    }
}
