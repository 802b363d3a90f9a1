//! A small picture of kernels from one side of a volume, without perspective.

use std::f32::consts::{LOG2_E, TAU};

use glam::{Mat3, Vec2, Vec3};

use crate::math::fast;

/// Variance by which the filter widens a kernel, pixels^2: that of a renderer's filter and of a pixel's square.
const FILTER: f32 = 0.25;
/// Where kernels end, in standard deviations.
const REACH: f32 = 3.0;
/// What lets less light through hides all behind it.
const OPAQUE: f32 = 1e-4;

/// A kernel as it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    pub(super) position: Vec3,
    pub(super) covariance: Mat3,
    /// The integral of its extinction.
    pub(super) extinction: f32,
    /// Linear light.
    pub(super) colour: Vec3,
    pub(super) normal: Option<Vec3>,
    /// The node that it counts for.
    pub(super) node: u32,
}

/// The view along an axis, and the pixels of its picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// 0 to 2.
    pub(super) axis: usize,
    /// Corner of the picture, model units.
    pub(super) low: Vec3,
    /// Pixels of a length of 1 of the model.
    pub(super) pixels: f32,
    /// Pixels along the axes of the model.
    pub(super) size: [usize; 3],
    /// Factor on extinctions.
    pub(super) density: f32,
}

/// A kernel on a picture.
pub(super) struct Splat {
    place: Vec2,
    /// The inverse of its covariance, pixels^-2: xx, xy, yy.
    conic: [f32; 3],
    /// The optical depth at its centre.
    depth: f32,
    columns: [usize; 2],
    rows: [usize; 2],
    pub(super) colour: Vec3,
    pub(super) node: u32,
}

impl Side {
    /// The axes of the model along rows and columns.
    fn axes(&self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        let [u, v] = self.axes();
        self.size[u] * self.size[v]
    }

    /// The splats of marks, the nearest first.
    pub(super) fn splats(&self, marks: &[Mark]) -> Vec<Splat> {
        let place = |(mark, i): (&Mark, u32)| (mark.position[self.axis], i);
        let mut order: Vec<(f32, u32)> = marks.iter().zip(0..).map(place).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.iter().filter_map(|(_, i)| self.splat(&marks[*i as usize])).collect()
    }

    /// `None` for a kernel beside the picture.
    fn splat(&self, mark: &Mark) -> Option<Splat> {
        let [u, v] = self.axes();
        let place = (mark.position - self.low) * self.pixels;
        let place = Vec2::new(place[u], place[v]);
        let squared = self.pixels * self.pixels;
        let entry = |a: usize, b: usize| mark.covariance.col(a)[b] * squared;
        let (xx, xy, yy) = (entry(u, u) + FILTER, entry(u, v), entry(v, v) + FILTER);
        let determinant = xx * yy - xy * xy;
        let depth = mark.extinction * self.density * squared / (TAU * determinant.sqrt());
        let range = |middle: f32, variance: f32, size: usize| {
            let end = |x: f32| x.clamp(0.0, size as f32) as usize;
            let reach = REACH * variance.sqrt();
            [end((middle - reach).floor()), end((middle + reach).ceil())]
        };
        let (columns, rows) = (range(place.x, xx, self.size[u]), range(place.y, yy, self.size[v]));
        let conic = [yy / determinant, -xy / determinant, xx / determinant];
        let shows = determinant > 0.0 && depth.is_finite() && columns[0] < columns[1] && rows[0] < rows[1];
        let (colour, node) = (self.lit(mark), mark.node);
        shows.then_some(Splat { place, conic, depth, columns, rows, colour, node })
    }

    /// The colour of a kernel under a light aslant from behind the eye; its own where it emits.
    fn lit(&self, mark: &Mark) -> Vec3 {
        let Some(normal) = mark.normal else { return mark.colour };
        let mut to_eye = Vec3::ZERO;
        to_eye[self.axis] = -1.0;
        let normal = normal.normalize_or_zero();
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        let [u, v] = self.axes();
        let mut to_light = to_eye;
        (to_light[u], to_light[v]) = (0.7, 0.7);
        mark.colour * (0.3 + 0.7 * normal.dot(to_light.normalize()).max(0.0))
    }

    /// Draws splats over each other and gives `paint` the pixel, the splat and its share of the pixel. Returns what
    /// each pixel lets through.
    pub(super) fn draw(&self, splats: &[Splat], mut paint: impl FnMut(usize, &Splat, f32)) -> Vec<f32> {
        let width = self.size[self.axes()[0]];
        let mut through = vec![1.0_f32; self.len()];
        for splat in splats {
            let [xx, xy, yy] = splat.conic.map(|entry| entry * LOG2_E);
            for row in splat.rows[0]..splat.rows[1] {
                let y = row as f32 + 0.5 - splat.place.y;
                for column in splat.columns[0]..splat.columns[1] {
                    let pixel = row * width + column;
                    if through[pixel] < OPAQUE {
                        continue;
                    }
                    let x = column as f32 + 0.5 - splat.place.x;
                    let depth = splat.depth * fast::exp2(-0.5 * (xx * x * x + yy * y * y) - xy * x * y);
                    let left = fast::exp2(-LOG2_E * depth);
                    paint(pixel, splat, (1.0 - left) * through[pixel]);
                    through[pixel] *= left;
                }
            }
        }
        through
    }
}
