//! Pictures of triangle meshes by the definition, in f64: each pixel is the mean of rays that stop at the nearest
//! triangle (Möller and Trumbore 1997) and read its texture. Shares no code with the program: other crates read the
//! files.

use std::fs;
use std::path::Path;

use glam::{DMat4, DVec2, DVec3};
use splatblur::film::Picture;

use super::Random;

/// A pinhole camera.
#[derive(Clone, Copy, Debug)]
pub struct TriangleCamera {
    pub eye: DVec3,
    pub at: DVec3,
    pub up: DVec3,
    /// Vertical angle of view, degrees.
    pub fovy: f64,
    /// Width and height, pixels.
    pub size: [u32; 2],
}

impl TriangleCamera {
    /// The direction through a point of the film, pixels. Its part along the view is 1 long, so that a ray's parameter
    /// is the depth.
    fn direction(&self, [x, y]: [f64; 2]) -> DVec3 {
        let [width, height] = self.size.map(f64::from);
        let forward = (self.at - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let up = right.cross(forward);
        let focal = height / 2.0 / (self.fovy.to_radians() / 2.0).tan();
        forward + right * ((x - width / 2.0) / focal) - up * ((y - height / 2.0) / focal)
    }
}

/// A texture that repeats, in linear light.
pub struct Image {
    pub size: [u32; 2],
    pub texels: Vec<DVec3>,
}

impl Image {
    /// A texture of rows from the top, red, green and blue in sRGB.
    pub fn new(size: [u32; 2], texels: impl Iterator<Item = [u8; 3]>) -> Self {
        let linear = |byte: u8| {
            let x = f64::from(byte) / 255.0;
            if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
        };
        Self { size, texels: texels.map(|texel| DVec3::from(texel.map(linear))).collect() }
    }

    /// Between the four texels around a point. (0, 0) is the upper left corner.
    fn at(&self, uv: DVec2) -> DVec3 {
        let [width, height] = self.size.map(i64::from);
        let p = uv * DVec2::new(width as f64, height as f64) - 0.5;
        let (x, y) = (p.x.floor(), p.y.floor());
        let (right, down) = (p.x - x, p.y - y);
        let texel = |i: i64, j: i64| {
            self.texels[((y as i64 + j).rem_euclid(height) * width + (x as i64 + i).rem_euclid(width)) as usize]
        };
        let upper = texel(0, 0) * (1.0 - right) + texel(1, 0) * right;
        let lower = texel(0, 1) * (1.0 - right) + texel(1, 1) * right;
        upper * (1.0 - down) + lower * down
    }
}

/// What triangles look like. Both sides show.
pub struct Paint {
    /// Linear.
    pub colour: DVec3,
    pub image: Option<usize>,
}

/// A box of triangles, with those of its two halves behind it.
struct Node {
    low: DVec3,
    high: DVec3,
    /// First triangle in `order`, or the second half.
    first: usize,
    /// Triangles; 0: the halves are the next node and `first`.
    count: usize,
}

/// Triangles, ready to be looked at.
#[derive(Default)]
pub struct Triangles {
    corners: Vec<[DVec3; 3]>,
    /// Texture coordinates of each corner; may be empty.
    uvs: Vec<[DVec2; 3]>,
    /// Which paint each triangle has; empty where all have the first.
    paint_of: Vec<usize>,
    paints: Vec<Paint>,
    images: Vec<Image>,
    nodes: Vec<Node>,
    order: Vec<usize>,
}

/// Where a ray ends.
pub struct Stop {
    /// Ray parameter.
    pub depth: f64,
    triangle: usize,
    weight: [f64; 2],
}

impl Triangles {
    /// White triangles.
    pub fn new(corners: Vec<[DVec3; 3]>) -> Self {
        Self { corners, paints: vec![Paint { colour: DVec3::ONE, image: None }], ..Self::default() }.ready()
    }

    /// The same triangles, all with one texture.
    #[must_use]
    pub fn with_paint(self, paint: Paint, uvs: Vec<[DVec2; 3]>, image: Image) -> Self {
        Self { paints: vec![paint], uvs, images: vec![image], ..self }
    }

    /// Sorts the triangles into boxes.
    #[must_use]
    fn ready(mut self) -> Self {
        self.order = (0..self.corners.len()).collect();
        self.nodes.clear();
        self.halve(0, self.corners.len());
        self
    }

    fn halve(&mut self, from: usize, to: usize) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in self.order[from..to].iter().flat_map(|&i| self.corners[i]) {
            (low, high) = (low.min(p), high.max(p));
        }
        let node = self.nodes.len();
        self.nodes.push(Node { low, high, first: from, count: to - from });
        if to - from <= 4 {
            return;
        }
        let size = high - low;
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let corners = &self.corners;
        let middle = |i: &usize| corners[*i].iter().map(|p| p[axis]).sum::<f64>();
        self.order[from..to].sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let half = usize::midpoint(from, to);
        self.halve(from, half);
        (self.nodes[node].first, self.nodes[node].count) = (self.nodes.len(), 0);
        self.halve(half, to);
    }

    /// The nearest triangle on a ray.
    pub fn stop(&self, eye: DVec3, direction: DVec3) -> Option<Stop> {
        let inverse = direction.recip();
        let mut nearest: Option<Stop> = None;
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let Some(node) = self.nodes.get(index) else { continue };
            let (a, b) = ((node.low - eye) * inverse, (node.high - eye) * inverse);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            // Rounding must not part a flat box from its triangles.
            if enter > leave * (1.0 + 1e-12) || nearest.as_ref().is_some_and(|stop| stop.depth < enter) {
                continue;
            }
            if node.count == 0 {
                open.extend([index + 1, node.first]);
                continue;
            }
            for &triangle in &self.order[node.first..node.first + node.count] {
                let [p, q, r] = self.corners[triangle];
                let (e, f) = (q - p, r - p);
                let across = direction.cross(f);
                let determinant = e.dot(across);
                let from = eye - p;
                let b = from.dot(across) / determinant;
                let c = direction.dot(from.cross(e)) / determinant;
                let depth = f.dot(from.cross(e)) / determinant;
                let inside = b >= 0.0 && c >= 0.0 && b + c <= 1.0 && depth > 0.0;
                if inside && nearest.as_ref().is_none_or(|stop| depth < stop.depth) {
                    nearest = Some(Stop { depth, triangle, weight: [b, c] });
                }
            }
        }
        nearest
    }

    fn colour(&self, stop: &Stop) -> DVec3 {
        let paint = &self.paints[self.paint_of.get(stop.triangle).copied().unwrap_or(0)];
        let Some(image) = paint.image else { return paint.colour };
        let [a, b, c] = self.uvs[stop.triangle];
        paint.colour * self.images[image].at(a + (b - a) * stop.weight[0] + (c - a) * stop.weight[1])
    }

    /// The mesh before a background: `side` x `side` rays a pixel, each at a random place of its part of the pixel.
    pub fn picture(&self, view: &TriangleCamera, side: u32, background: DVec3) -> Picture {
        use rayon::prelude::*;
        let [width, height] = view.size;
        let rgba = (0..width * height).into_par_iter().map(|pixel| {
            let mut random = Random(u64::from(pixel) * 7919 + 1);
            let mut sum = DVec3::ZERO;
            for part in 0..side * side {
                let mut along =
                    |at: u32, part: u32| f64::from(at) + (f64::from(part) + random.next()) / f64::from(side);
                let at = [along(pixel % width, part % side), along(pixel / width, part / side)];
                sum += self.stop(view.eye, view.direction(at)).map_or(background, |stop| self.colour(&stop));
            }
            (sum / f64::from(side * side)).as_vec3().extend(1.0).to_array()
        });
        Picture { width, height, rgba: rgba.collect(), layers: Vec::new() }
    }

    /// The depths of 3 x 3 rays in each pixel, where they meet anything.
    pub fn depths(&self, view: &TriangleCamera) -> Vec<[Option<f64>; 9]> {
        use rayon::prelude::*;
        let [width, height] = view.size;
        let ray = |pixel: u32, part: u32| {
            let at = [pixel % width * 3 + part % 3, pixel / width * 3 + part / 3];
            let direction = view.direction(at.map(|x| (f64::from(x) + 0.5) / 3.0));
            self.stop(view.eye, direction).map(|stop| stop.depth)
        };
        let pixels = (0..width * height).into_par_iter();
        pixels.map(|pixel| std::array::from_fn(|part| ray(pixel, part as u32))).collect()
    }

    /// The scene of a .glb at rest, with base colours and PNG textures that repeat.
    pub fn of_glb(path: &Path) -> Self {
        let gltf::Gltf { document, blob } = gltf::Gltf::open(path).expect("a glTF file");
        let blob = blob.expect("one file");
        let mut all = Self { paints: vec![Paint { colour: DVec3::ONE, image: None }], ..Self::default() };
        for texture in document.textures() {
            let sampler = texture.sampler();
            let repeats = gltf::texture::WrappingMode::Repeat;
            assert!((sampler.wrap_s(), sampler.wrap_t()) == (repeats, repeats), "the tracer repeats textures");
            let gltf::image::Source::View { view, .. } = texture.source().source() else { panic!("an image inside") };
            all.images.push(png(&blob[view.offset()..view.offset() + view.length()]));
        }
        for material in document.materials() {
            assert!(material.alpha_mode() == gltf::material::AlphaMode::Opaque, "the tracer knows no opacity");
            let look = material.pbr_metallic_roughness();
            let [r, g, b, _] = look.base_color_factor().map(f64::from);
            let image = look.base_color_texture().map(|texture| texture.texture().index());
            all.paints.push(Paint { colour: DVec3::new(r, g, b), image });
        }
        let mut open: Vec<_> =
            document.default_scene().expect("a scene").nodes().map(|n| (n, DMat4::IDENTITY)).collect();
        while let Some((node, parent)) = open.pop() {
            let matrix = node.transform().matrix().map(|column| column.map(f64::from));
            let place = parent * DMat4::from_cols_array_2d(&matrix);
            open.extend(node.children().map(|child| (child, place)));
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                let reader = primitive.reader(|_| Some(&blob));
                let at = |p: [f32; 3]| place.transform_point3(DVec3::from(p.map(f64::from)));
                let position: Vec<DVec3> = reader.read_positions().expect("positions").map(at).collect();
                let uvs = reader.read_tex_coords(0).map(gltf::mesh::util::ReadTexCoords::into_f32);
                let uv: Vec<DVec2> = uvs.into_iter().flatten().map(|uv| DVec2::from(uv.map(f64::from))).collect();
                let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
                for corner in indices.as_chunks::<3>().0 {
                    let corner = corner.map(|i| i as usize);
                    all.corners.push(corner.map(|i| position[i]));
                    all.uvs.push(corner.map(|i| uv.get(i).copied().unwrap_or_default()));
                    all.paint_of.push(primitive.material().index().map_or(0, |index| index + 1));
                }
            }
        }
        all.ready()
    }

    /// The triangles of an .obj, all with one texture.
    pub fn of_obj(path: &Path, image: Image) -> Self {
        let text = fs::read_to_string(path).expect("a text");
        let mut all = Self { paints: vec![Paint { colour: DVec3::ONE, image: Some(0) }], ..Self::default() };
        let (mut position, mut uv) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let key = words.next().unwrap_or_default();
            let words: Vec<&str> = words.collect();
            let number = |i: usize| words[i].parse::<f64>().expect("a number");
            let index =
                |word: &str, k: usize| word.split('/').nth(k).and_then(|i| i.parse().ok()).unwrap_or(0_usize) - 1;
            match key {
                "v" => position.push(DVec3::new(number(0), number(1), number(2))),
                // The lowest row of an image has v = 0.
                "vt" => uv.push(DVec2::new(number(0), 1.0 - number(1))),
                "f" => {
                    assert_eq!(words.len(), 3, "the tracer cuts no polygons");
                    all.corners.push([0, 1, 2].map(|k| position[index(words[k], 0)]));
                    all.uvs.push([0, 1, 2].map(|k| uv[index(words[k], 1)]));
                }
                _ => {}
            }
        }
        all.images.push(image);
        all.ready()
    }
}

/// Decodes a PNG without the program.
pub fn png(bytes: &[u8]) -> Image {
    let image = image::load_from_memory(bytes).expect("a PNG").to_rgb8();
    Image::new([image.width(), image.height()], image.pixels().map(|pixel| pixel.0))
}

/// Distances from the middle to a closed surface without corners: waves in a few random directions.
pub fn blob(random: &mut Random) -> impl Fn(DVec3) -> f64 + use<> {
    let waves: Vec<(DVec3, f64, f64, f64)> = (0..6)
        .map(|_| (random.direction(), 1.0 + 4.0 * random.next(), 6.3 * random.next(), 0.1 * random.next()))
        .collect();
    move |p| 1.0 + waves.iter().map(|(d, pitch, phase, height)| height * (pitch * d.dot(p) + phase).sin()).sum::<f64>()
}

/// The corners of a sphere that `reach` pushes outwards, `n` x `n` squares on each of a cube's sides, and where in its
/// square of 0 to 1 each corner lies. Two triangles a square, counter-clockwise seen from outside.
pub fn cube_sphere(n: u32, reach: impl Fn(DVec3) -> f64) -> Vec<[(DVec3, DVec2); 3]> {
    let mut triangles = Vec::new();
    for side in 0..6_usize {
        let sign = if side < 3 { 1.0 } else { -1.0 };
        let at = |i: u32, j: u32| {
            let uv = DVec2::new(f64::from(i), f64::from(j)) / f64::from(n);
            let [x, y] = [i, j].map(|k| (f64::from(2 * k) - f64::from(n)) / f64::from(n));
            let mut p = DVec3::ZERO;
            (p[side % 3], p[(side + 1) % 3], p[(side + 2) % 3]) = (sign, x * sign, y);
            // Equal to the last digit on the sides that share it: the squares in the order of their size.
            let mut squares = (p * p).to_array();
            squares.sort_by(f64::total_cmp);
            let p = p / squares.iter().sum::<f64>().sqrt();
            (p * reach(p), uv)
        };
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}
