//! How a frame is rendered: options, and the plan that a backend executes.

use crate::film::Aov;
use crate::sampling::pixel_offsets;
use crate::time::Shutter;

/// How motion becomes blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlurMode {
    /// No motion: everything at the frame number, averaged over sub-pixel offsets.
    Still {
        /// Sub-pixel positions, >= 1.
        pixel_samples: u32,
    },
    /// Temporal supersampling (thesis 3.6.1, 4.3): one visibility test, one normalisation and one shading per time sample.
    Supersample {
        /// Time samples, >= 1.
        samples: u32,
    },
}

/// How sub-pixel positions are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelFilter {
    /// Mean over the pixel's square: each time sample has its own sub-pixel offset.
    #[default]
    Box,
    /// Pixel centres.
    Point,
}

/// Screen-space prefilter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefilter {
    /// Botsch et al. 2005 (thesis 4.2.3): the smaller of the object-space and the screen-space radius.
    #[default]
    Approx,
    /// Object-space kernels alone.
    None,
}

/// Where shading happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Per pixel, with the averaged normal (deferred; thesis 4.1.1).
    #[default]
    Phong,
    /// Per surfel.
    Gouraud,
}

/// How frames are splatted. Defaults: design section 2.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Blur mode.
    pub mode: BlurMode,
    /// Sub-pixel positions.
    pub filter: PixelFilter,
    /// Screen-space prefilter.
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Show the back faces of all objects, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Depth tolerance for all objects, world units, >= 0; overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of the sub-pixel offsets.
    pub seed: u64,
    /// Bytes that a frame and the models may take together.
    pub memory: u64,
    /// Extra channels, in the order of [`Aov::ALL`], each at most once.
    pub aovs: Vec<Aov>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            mode: BlurMode::Supersample { samples: 32 },
            filter: PixelFilter::Box,
            prefilter: Prefilter::Approx,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            seed: 1,
            memory: 1 << 30,
            aovs: Vec::new(),
        }
    }
}

/// A stage of rendering a group of time samples; see docs/architecture.md for what each reads and writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Surfels to splats: posed, projected, bounded, culled.
    Project,
    /// Splats to per-tile lists, in global surfel order.
    Bin,
    /// T(x, t) per pixel, from the splats of the group.
    Visibility,
    /// Weighted sums of the attributes of the splats that pass the depth test.
    Attribute,
    /// Normalise, shade, add to the film with the time weight.
    Resolve,
}

impl BlurMode {
    /// Passes of one group, in order. The only place that knows the order.
    pub const fn passes(self) -> &'static [Pass] {
        use Pass::{Attribute, Bin, Project, Resolve, Visibility};
        match self {
            Self::Still { .. } | Self::Supersample { .. } => &[Project, Bin, Visibility, Attribute, Resolve],
        }
    }
}

/// A moment of the exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSample {
    /// Scene time, frames.
    pub time: f64,
    /// Share of the exposure; all samples of a frame sum to 1.
    pub weight: f64,
    /// Offset of the sample position from the pixel's centre, pixels, each in [-1/2, 1/2).
    pub offset: [f32; 2],
}

/// Time samples that share one visibility test and one resolve.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// At least one.
    pub samples: Vec<TimeSample>,
}

/// What a backend executes for one frame: `passes` for each group, in order. Backends know nothing about blur modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Stages of each group.
    pub passes: &'static [Pass],
    /// Groups, in the order in which they are added to the film.
    pub groups: Vec<Group>,
}

impl Plan {
    /// The plan of frame `frame` with this shutter.
    pub fn new(mode: BlurMode, filter: PixelFilter, seed: u64, shutter: &Shutter, frame: f64) -> Self {
        let moments: Vec<(f64, f64)> = match mode {
            BlurMode::Still { pixel_samples } => vec![(frame, 1.0 / f64::from(pixel_samples)); pixel_samples as usize],
            BlurMode::Supersample { samples } => {
                shutter.strata(samples).iter().map(|&(t, weight)| (shutter.frame_time(frame, t), weight)).collect()
            }
        };
        let offsets = match filter {
            PixelFilter::Box => pixel_offsets(moments.len() as u32, seed),
            PixelFilter::Point => vec![[0.0; 2]; moments.len()],
        };
        let groups = moments
            .iter()
            .zip(offsets)
            .map(|(&(time, weight), offset)| Group { samples: vec![TimeSample { time, weight, offset }] })
            .collect();
        Self { passes: mode.passes(), groups }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Weight;

    fn times(plan: &Plan) -> Vec<(f64, f64)> {
        plan.groups.iter().flat_map(|g| &g.samples).map(|s| (s.time, s.weight)).collect()
    }

    #[test]
    fn supersample_takes_mid_strata() {
        let shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Ramp { centre: 1.0 } };
        let plan = Plan::new(BlurMode::Supersample { samples: 2 }, PixelFilter::Point, 1, &shutter, 10.0);
        assert_eq!(times(&plan), [(9.75, 0.25), (10.25, 0.75)]);
        assert!(plan.groups.iter().all(|g| g.samples[0].offset == [0.0; 2]));
    }

    #[test]
    fn still_stays_at_the_frame_number() {
        let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box };
        let plan = Plan::new(BlurMode::Still { pixel_samples: 4 }, PixelFilter::Box, 1, &shutter, 3.0);
        assert_eq!(times(&plan), [(3.0, 0.25); 4]);
        assert!(plan.groups.iter().any(|g| g.samples[0].offset != [0.0; 2]));
    }

    #[test]
    fn one_sample_sits_at_mid_shutter_and_pixel_centre() {
        let plan = Plan::new(BlurMode::Supersample { samples: 1 }, PixelFilter::Box, 9, &Shutter::default(), 3.0);
        assert_eq!(plan.groups[0].samples, [TimeSample { time: 3.0, weight: 1.0, offset: [0.0; 2] }]);
    }
}
