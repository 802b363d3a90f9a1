//! The film: accumulators that become a [`Picture`].

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::limits;

/// A set of channels beside colour (arbitrary output variable): its coverage-weighted mean over the exposure, divided
/// by alpha, where it does not say otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Aov {
    /// Temporal coverage, 0..=1.
    Alpha,
    /// Camera depth, scene units; +inf where alpha is 0.
    Depth,
    /// Shading normal, world space; 0 where alpha is 0.
    Normal,
    /// Screen velocity, pixels per shutter, x right, y down, forward in time; 0 where alpha is 0.
    Velocity,
    /// Time samples of the pixel; never divided by alpha.
    Samples,
    /// Standard error of the picture's colour and of the coverage; of the reference only, and never divided by alpha.
    Error,
    /// Estimated error by detail that is left out ([`Detail`](crate::options::Detail)), for the block of 32 x 32 pixels
    /// around: root mean square of display values. Of splatting only.
    LodError,
    /// Index of the object that has the largest share of the pixel over the exposure: 1 for the first of the scene; 0
    /// where nothing is seen. Never a mean. [`Layer::names`] has the names. The reference does not make it.
    Object,
}

impl Aov {
    /// All that every renderer makes, in the order of their layers.
    pub const ALL: [Self; 5] = [Self::Alpha, Self::Depth, Self::Normal, Self::Velocity, Self::Samples];
    /// All that a file may hold, in the order of their layers.
    pub const LAYERS: [Self; 8] = [
        Self::Alpha,
        Self::Depth,
        Self::Normal,
        Self::Velocity,
        Self::Samples,
        Self::Error,
        Self::LodError,
        Self::Object,
    ];

    /// Layer name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Velocity => "velocity",
            Self::Samples => "samples",
            Self::Error => "error",
            Self::LodError => "lod_error",
            Self::Object => "object",
        }
    }

    /// What it holds, with units, for people: the one place that says it. Help texts and EXR headers quote it.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Alpha => "share of the exposure in which surfaces cover the pixel, 0 to 1",
            Self::Depth => "distance from the camera along its axis (-z), scene units; infinite where nothing is seen",
            Self::Normal => "mean shading normal, x, y, z of the world, at most 1 long; 0 where nothing is seen",
            Self::Velocity => {
                "mean motion on the image, pixels a shutter, x right, y down, forward in time; 0 where nothing is seen"
            }
            Self::Samples => "time samples of the pixel, a count",
            Self::Error => {
                "error of r, g, b and coverage: of a reference its standard error, linear light; of mode auto its \
                 estimate for the block around, root mean square of display values"
            }
            Self::LodError => {
                "estimated error by detail that is left out, for the block around, root mean square of display values"
            }
            Self::Object => {
                "index of the object that has the largest share of the pixel over the exposure, never a mean; 0 where \
                 nothing is seen; the same attribute names the objects (entry `objects`)"
            }
        }
    }

    /// Would half precision spoil it? It has 11 significant bits: too few for distances, and for counts and indices
    /// above 2048.
    pub const fn needs_float(self) -> bool {
        matches!(self, Self::Depth | Self::Samples | Self::Object)
    }

    /// Channel names inside the layer.
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Alpha => &["A"],
            Self::Depth => &["Z"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Velocity => &["X", "Y"],
            Self::Samples => &["N"],
            Self::Error => &["R", "G", "B", "A"],
            Self::LodError => &["Y"],
            Self::Object => &["ID"],
        }
    }
}

/// One AOV of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Which.
    pub aov: Aov,
    /// One row-major plane a channel, in the order of [`Aov::channels`].
    pub planes: Vec<Vec<f32>>,
    /// For [`Aov::Object`] the names of the objects, index 1 first. Else empty.
    pub names: Vec<String>,
}

/// A finished image: row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear Rec.709, premultiplied by alpha, row-major. Alpha is 1 where a background was composited.
    pub rgba: Vec<[f32; 4]>,
    /// AOVs, in the order of [`Aov::LAYERS`].
    pub layers: Vec<Layer>,
}

impl Picture {
    /// Greatest width and height, pixels.
    pub const MAX_SIZE: u32 = *limits::SIDE.end();
}

/// What shows where the film is not covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// Linear Rec.709.
    pub colour: DVec3,
    /// Leave it out and keep alpha.
    pub transparent: bool,
}

/// What shows where the film is not covered, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Backdrop {
    /// Its colour is that of all pixels, unless there is a picture.
    pub background: Background,
    /// A picture in place of the colour: linear Rec.709, row-major.
    pub picture: Option<Vec<[f32; 3]>>,
}

impl Backdrop {
    /// The colour alone.
    pub const fn plain(background: Background) -> Self {
        Self { background, picture: None }
    }

    /// The light that is added where pixel `pixel` is not covered: none where the background is left out.
    pub fn at(&self, pixel: usize) -> DVec3 {
        if self.background.transparent {
            return DVec3::ZERO;
        }
        let of_picture = self.picture.as_ref().and_then(|picture| picture.get(pixel));
        of_picture.map_or(self.background.colour, |&colour| glam::Vec3::from(colour).as_dvec3())
    }
}

/// In which numbers transparent things are composited: that of the whole image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blending {
    /// sRGB-encoded values. Each instant is decoded before it is averaged over time.
    Coded,
    /// Linear light.
    Linear,
}

/// Which planes a film has: r, g, b, alpha, then those of the AOVs (alpha and samples need none of their own).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmPlanes {
    /// Number of planes.
    pub count: usize,
    /// Plane of depth.
    pub depth: Option<usize>,
    /// First of three planes of the normal.
    pub normal: Option<usize>,
    /// First of two planes of velocity.
    pub velocity: Option<usize>,
    /// Plane of the sum of weights, where colours are divided by them at the end.
    pub weight: Option<usize>,
}

impl FilmPlanes {
    /// The planes that `aovs` need.
    pub fn of(aovs: &[Aov]) -> Self {
        let mut count = 4;
        let mut take = |aov: Aov| {
            aovs.contains(&aov).then(|| {
                count += aov.channels().len();
                count - aov.channels().len()
            })
        };
        let (depth, normal, velocity) = (take(Aov::Depth), take(Aov::Normal), take(Aov::Velocity));
        Self { count, depth, normal, velocity, weight: None }
    }

    /// With a plane for the sum of weights.
    #[must_use]
    pub const fn pooled(self) -> Self {
        Self { count: self.count + 1, weight: Some(self.count), ..self }
    }

    /// First plane of an AOV that is wanted; alpha shares the film's own.
    fn first(&self, aov: Aov) -> usize {
        match aov {
            Aov::Alpha | Aov::Samples | Aov::Error | Aov::LodError | Aov::Object => Some(3),
            Aov::Depth => self.depth,
            Aov::Normal => self.normal,
            Aov::Velocity => self.velocity,
        }
        .unwrap_or(3)
    }
}

/// Accumulated, premultiplied values of an image, plane by plane.
pub trait Film: Sync {
    /// Copies row `y` of plane `plane` to `out`, which is as long as the image is wide.
    fn row(&self, plane: usize, y: u32, out: &mut [f32]);

    /// Time samples that each pixel of row `y` saw.
    fn samples(&self, y: u32, out: &mut [f32]);
}

/// Premultiplied `colour` over `behind`, of which the share `through` shows: 1 - alpha.
#[inline(always)]
pub(crate) fn over(colour: [f32; 3], through: f32, behind: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| colour[c] + through * behind[c])
}

/// Develops the film in the columns of each row that are `wanted`; all else is 0.
///
/// Composites the colours once over the background (docs/math.md, section 6), and divides the AOVs by alpha (section
/// 8). `memory` of an earlier picture is used again.
pub fn develop(
    film: &impl Film,
    size: [u32; 2],
    aovs: &[Aov],
    backdrop: &Backdrop,
    wanted: impl Fn(usize) -> Vec<Range<usize>> + Sync,
    memory: Option<Vec<[f32; 4]>>,
) -> Picture {
    let [width, height] = size;
    let columns = width as usize;
    let planes = FilmPlanes::of(aovs);
    let background = backdrop.background;
    let behind = background.colour.as_vec3().to_array();
    let pixels = columns * height as usize;
    let memory = memory.filter(|memory| memory.len() == pixels);
    let used = memory.is_some();
    let mut rgba = memory.unwrap_or_else(|| vec![[0.0; 4]; pixels]);
    rgba.par_chunks_mut(columns).zip(0..height).for_each_init(
        || vec![0.0; 4 * columns],
        |rows, (out, y)| {
            let wanted = wanted(y as usize);
            if used && wanted.iter().map(Range::len).sum::<usize>() < columns {
                out.fill([0.0; 4]);
            }
            if wanted.is_empty() {
                return;
            }
            rows.chunks_exact_mut(columns).enumerate().for_each(|(plane, row)| film.row(plane, y, row));
            let (colour, alpha) = rows.split_at(3 * columns);
            let (red, rest) = colour.split_at(columns);
            let (green, blue) = rest.split_at(columns);
            for span in wanted {
                let colours = red[span.clone()].iter().zip(&green[span.clone()]).zip(&blue[span.clone()]);
                let first = y as usize * columns + span.start;
                let picture = backdrop.picture.as_deref().map(|picture| &picture[first..]);
                let pixels = out[span.clone()].iter_mut().zip(colours).zip(&alpha[span]).enumerate();
                for (x, ((out, ((r, g), b)), alpha)) in pixels {
                    let through = if background.transparent { 0.0 } else { 1.0 - alpha };
                    let cover = if background.transparent { *alpha } else { 1.0 };
                    let behind = picture.map_or(behind, |picture| picture[x]);
                    let [r, g, b] = over([*r, *g, *b], through, behind);
                    *out = [r, g, b, cover];
                }
            }
        },
    );
    let plane = |aov: Aov, channel: usize| {
        let mut plane = vec![0.0; columns * height as usize];
        plane.par_chunks_mut(columns).zip(0..height).for_each_init(
            || [vec![0.0; columns], vec![0.0; columns]],
            |[alphas, sums], (out, y)| {
                let wanted = wanted(y as usize);
                if wanted.is_empty() {
                    return;
                }
                if aov == Aov::Samples {
                    film.samples(y, alphas);
                } else {
                    film.row(3, y, alphas);
                    film.row(planes.first(aov) + channel, y, sums);
                }
                for x in wanted.into_iter().flatten() {
                    out[x] = aov_value(aov, sums[x], alphas[x]);
                }
            },
        );
        plane
    };
    let layers = Aov::ALL
        .into_iter()
        .filter(|aov| aovs.contains(aov))
        .map(|aov| {
            let planes = (0..aov.channels().len()).map(|channel| plane(aov, channel)).collect();
            Layer { aov, planes, names: Vec::new() }
        })
        .collect();
    Picture { width, height, rgba, layers }
}

fn aov_value(aov: Aov, sum: f32, alpha: f32) -> f32 {
    match aov {
        Aov::Alpha | Aov::Samples => alpha,
        _ if alpha > 0.0 => sum / alpha,
        Aov::Depth => f32::INFINITY,
        Aov::Normal | Aov::Velocity | Aov::Error | Aov::LodError | Aov::Object => 0.0,
    }
}
