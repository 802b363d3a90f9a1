//! `Pointshop3D` surfel files (.sfl): surfel sets with a table of properties, in the container of `sfl_container`.
//!
//! All sets are merged, each at its finest resolution. Positions are transformed by the root's right, up and back
//! vectors and then by the set's transform, normals by the inverse transpose, radii and axes by the matrix itself.

use glam::{DMat3, DMat4, DVec3, Vec3};

use super::cloud::{Cloud, ColourStorage};
use super::error::ParseError;
use super::sfl_codes::{ColourModel, NormalCode, cube_normal};
use super::sfl_container::{Container, Directory};
use super::surfels::Material;

/// Flag of a surfel that is not shown.
const INVISIBLE: u32 = 0x400;

/// Numbers of the properties (tag 0153): each is a bit.
mod bit {
    pub(super) const POSITION: usize = 0;
    pub(super) const NORMAL: usize = 1;
    pub(super) const RADIUS: usize = 4;
    pub(super) const AMBIENT_COLOUR: usize = 8;
    pub(super) const AMBIENT: usize = 9;
    pub(super) const DIFFUSE_COLOUR: usize = 10;
    pub(super) const DIFFUSE: usize = 11;
    pub(super) const SPECULAR: usize = 13;
    pub(super) const SHININESS: usize = 14;
    pub(super) const OLD_SHININESS: usize = 15;
    pub(super) const AXES: usize = 24;
    pub(super) const FLAGS: usize = 27;
}

/// Reads an .sfl file. `progress` now and then gets the share of the file read.
///
/// # Errors
/// The error names the byte. Offsets are outside the file, there are cycles or unknown codes, records do not fit, or
/// there is no surfel set.
pub(super) fn parse(bytes: &[u8], progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let container = Container::new(bytes);
    let directories = container.directories()?;
    let mut cloud = Cloud { colour_storage: ColourStorage::Integer, ..Cloud::default() };
    let sets = surfel_sets(&directories);
    let Some((root, _)) = directories.split_first().filter(|_| !sets.is_empty()) else {
        return Err(ParseError::byte(16, "no surfel set", "a directory with the tags 0151 to 0154"));
    };
    for list in directories.iter().filter(|directory| directory.has(0x0130)) {
        let announced = container.integer(list, 0x0130)?.unwrap_or_default();
        if announced != sets.len() {
            let found = format!("{} surfel sets where the list announces {announced}", sets.len());
            return Err(list.fault(found, "as many as it announces"));
        }
    }
    let axes = root_axes(container, root)?;
    let default_units = units(container, root, 0x0113)?.unwrap_or(1.0);
    let mut state = Merge { cloud: &mut cloud, invisible: 0 };
    let mut used_bytes = 0_usize;
    for (set, resolutions) in sets {
        if resolutions.is_empty() {
            continue;
        }
        if let Some(announced) = container.integer(set, 0x0140)?
            && announced != resolutions.len()
        {
            let found = format!("{} resolutions where the set announces {announced}", resolutions.len());
            return Err(set.fault(found, "as many as it announces"));
        }
        let finest = container.integer(set, 0x0141)?.unwrap_or(resolutions.len() - 1);
        let Some(resolution) = resolutions.get(finest) else {
            return Err(set.fault(format!("finest resolution {finest}"), format!("below {}", resolutions.len())));
        };
        let scale = units(container, set, 0x0160)?.map_or(1.0, |units| units / default_units);
        if scale != 1.0 {
            state.cloud.notes.push(format!("a surfel set in other units is scaled by {scale}"));
        }
        let set_matrix = container.floats::<16>(set, 0x0161)?.map_or(DMat4::IDENTITY, |m| {
            // The file stores the matrix row-major.
            DMat4::from_cols_array(&m).transpose()
        });
        let map = Map::new(set_matrix, axes * scale).ok_or_else(|| {
            set.fault("a transform that is singular or projective", "an affine transform that can be inverted")
        })?;
        let layout = Layout::read(container, set)?;
        if matches!(layout.colour_model, ColourModel::Yuv { .. }) && layout.colour.is_some() {
            state.cloud.notes.push("YUV colours taken as full-range BT.601 (no reference exists)".to_owned());
        }
        let records = layout.records(container, resolution)?;
        used_bytes = used_bytes.saturating_add(records.1.len());
        // Sets that share one block of the file would multiply memory.
        if used_bytes > bytes.len() {
            return Err(resolution.fault("surfel data that is shared with another set", "separate data"));
        }
        state.merge(&layout, &map, records, progress)?;
    }
    let invisible = state.invisible;
    if invisible > 0 {
        cloud.notes.push(format!("{invisible} surfels dropped: flagged invisible"));
    }
    if cloud.axes.iter().all(|[u, _]| *u == Vec3::ZERO) {
        cloud.axes = Vec::new();
    }
    Ok(cloud)
}

/// The surfel sets, each with its resolutions. Their tags show which they are.
fn surfel_sets(directories: &[Directory]) -> Vec<(&Directory, Vec<&Directory>)> {
    let mut sets: Vec<(&Directory, Vec<&Directory>)> = Vec::new();
    for directory in directories {
        if directory.has(0x0151) || directory.has(0x0153) {
            sets.push((directory, Vec::new()));
        } else if directory.has(0x0171)
            && let Some((_, resolutions)) = sets.last_mut()
        {
            resolutions.push(directory);
        }
    }
    sets
}

fn root_axes(container: Container<'_>, root: &Directory) -> Result<DMat3, ParseError> {
    let axis =
        |tag, default: DVec3| Ok::<_, ParseError>(container.floats::<3>(root, tag)?.map_or(default, DVec3::from_array));
    // Each axis is a row, so the new position is (right.p, up.p, back.p).
    Ok(DMat3::from_cols(axis(0x0110, DVec3::X)?, axis(0x0111, DVec3::Y)?, axis(0x0112, DVec3::Z)?).transpose())
}

fn units(container: Container<'_>, directory: &Directory, tag: u16) -> Result<Option<f64>, ParseError> {
    match container.floats::<1>(directory, tag)? {
        Some([units]) if units > 0.0 => Ok(Some(units)),
        Some([units]) => Err(directory.fault(format!("units {units}"), "more than 0")),
        None => Ok(None),
    }
}

/// The map from a set's coordinates to the model's.
struct Map {
    linear: DMat3,
    translation: DVec3,
    /// Inverse transpose of the linear part.
    normal: DMat3,
    /// The scale if the linear part is a similarity.
    similarity: Option<f64>,
    /// Cube root of |det|.
    mean_scale: f64,
}

impl Map {
    fn new(set: DMat4, first: DMat3) -> Option<Self> {
        let linear = DMat3::from_mat4(set) * first;
        let determinant = linear.determinant();
        let normal = linear.inverse().transpose();
        let affine = set.row(3).abs_diff_eq(glam::DVec4::W, 1e-6);
        if !(affine && determinant.is_finite() && determinant != 0.0 && normal.is_finite()) {
            return None;
        }
        let mean_scale = determinant.abs().cbrt();
        let gram = (linear.transpose() * linear) * (1.0 / (mean_scale * mean_scale));
        let similarity = gram.abs_diff_eq(DMat3::IDENTITY, 1e-5).then_some(mean_scale);
        Some(Self { linear, translation: set.w_axis.truncate(), normal, similarity, mean_scale })
    }
}

/// Places of the used properties in a record.
struct Layout {
    size: usize,
    normal_code: NormalCode,
    colour_model: ColourModel,
    position: usize,
    normal: Option<usize>,
    radius: Option<usize>,
    colour: Option<usize>,
    /// Ambient, diffuse and specular coefficient, shininess.
    material: [Option<usize>; 4],
    axes: Option<usize>,
    flags: Option<usize>,
}

impl Layout {
    fn read(container: Container<'_>, set: &Directory) -> Result<Self, ParseError> {
        let missing = |tag: &str| set.fault(format!("a surfel set without tag {tag}"), "tags 0151 to 0154");
        let size = container.integer(set, 0x0151)?.filter(|s| *s > 0).ok_or_else(|| missing("0151 (surfel size)"))?;
        let masks = container.integers(set, 0x0152)?;
        let mask = masks.and_then(|m| m.first().copied()).ok_or_else(|| missing("0152 (property mask)"))?;
        let indices = container.integers(set, 0x0153)?.ok_or_else(|| missing("0153 (property indices)"))?;
        let offsets = container.integers(set, 0x0154)?.ok_or_else(|| missing("0154 (property offsets)"))?;
        if indices.len() != offsets.len() {
            let found = format!("{} property indices, {} offsets", indices.len(), offsets.len());
            return Err(set.fault(found, "as many of both"));
        }
        let version = container.integer(set, 0x0150)?.unwrap_or(0);
        let normal_code = NormalCode::from_mask(mask)
            .ok_or_else(|| set.fault("normal code 1 (ico8)", "0 (none), 2 (cub16) or 3 (cub32)"))?;
        let colour_model = ColourModel::from_mask(mask);
        let mut seen = std::collections::HashSet::new();
        if let Some(twice) = indices.iter().find(|i| !seen.insert(**i)) {
            return Err(set.fault(format!("property {twice} a second time"), "each once"));
        }
        let find = |bit: usize, bytes: usize| -> Result<Option<usize>, ParseError> {
            let Some(k) = indices.iter().position(|i| *i == bit as i64) else { return Ok(None) };
            let offset = offsets.get(k).copied().unwrap_or(-1);
            match usize::try_from(offset) {
                Ok(at) if at.saturating_add(bytes) <= size => Ok(Some(at)),
                _ => {
                    let found = format!("property {bit} of {bytes} bytes at {offset}");
                    Err(set.fault(found, format!("inside a surfel of {size} bytes")))
                }
            }
        };
        let position =
            find(bit::POSITION, 12)?.ok_or_else(|| set.fault("surfels without positions", "property 0 (position)"))?;
        let axes = find(bit::AXES, 24)?;
        // Old elliptical surfels announce a normal and a radius but do not have them.
        let has_all = version > 0 || axes.is_none();
        let normal = if has_all { find(bit::NORMAL, normal_code.size())? } else { None };
        let radius = if has_all { find(bit::RADIUS, 4)? } else { None };
        let colour_bit =
            [bit::DIFFUSE_COLOUR, bit::AMBIENT_COLOUR].into_iter().find(|b| indices.contains(&(*b as i64)));
        let colour_model = match (colour_bit, colour_model) {
            (_, Ok(model)) => model,
            (None, Err(_)) => ColourModel::Grey { bytes: 1 },
            (Some(_), Err(bits)) => {
                let known = "01 (L), 09 (LA), 07 (RGB), 0f (RGBA), 10 (YUV) or 18 (YUVA)";
                return Err(set.fault(format!("colour model {bits:02x}"), known));
            }
        };
        let colour = match colour_bit {
            Some(bit) => find(bit, colour_model.size())?,
            None => None,
        };
        let shininess = match find(bit::SHININESS, 1)? {
            Some(at) => Some(at),
            None => find(bit::OLD_SHININESS, 1)?,
        };
        let material = [find(bit::AMBIENT, 1)?, find(bit::DIFFUSE, 1)?, find(bit::SPECULAR, 1)?, shininess];
        let flags = find(bit::FLAGS, 4)?;
        Ok(Self { size, normal_code, colour_model, position, normal, radius, colour, material, axes, flags })
    }

    /// The records of a resolution, and where they begin in the file.
    fn records<'a>(&self, container: Container<'a>, resolution: &Directory) -> Result<(usize, &'a [u8]), ParseError> {
        let count = container.integer(resolution, 0x0170)?;
        let (Some(count), Some((at, block))) = (count, container.block(resolution, 0x0171)?) else {
            return Err(resolution.fault("a resolution without tags 0170 and 0171", "both"));
        };
        if count.checked_mul(self.size) != Some(block.len()) {
            let found = format!("{count} surfels of {} bytes in a block of {} bytes", self.size, block.len());
            return Err(resolution.fault(found, "a block that holds just them"));
        }
        Ok((at, block))
    }
}

/// Appends sets to a cloud. Arrays that only some sets have are filled up with "missing" values.
struct Merge<'a> {
    cloud: &'a mut Cloud,
    invisible: usize,
}

impl Merge<'_> {
    fn merge(
        &mut self,
        layout: &Layout,
        map: &Map,
        (start, records): (usize, &[u8]),
        progress: &dyn Fn(f32),
    ) -> Result<(), ParseError> {
        const CHUNK: usize = 1 << 16;
        let before = self.cloud.position.len();
        let count = records.len() / layout.size;
        let has_material = layout.material.iter().any(Option::is_some);
        // Earlier sets lack these arrays.
        if has_material && self.cloud.material.is_empty() {
            self.cloud.material = vec![Material::default(); before];
        }
        let keep_material = !self.cloud.material.is_empty() || has_material;
        for (i, record) in records.chunks_exact(layout.size).enumerate() {
            if i % CHUNK == 0 {
                progress(i as f32 / count as f32);
            }
            if layout.flags.is_some_and(|at| u32::from_be_bytes(array(record, at)) & INVISIBLE != 0) {
                self.invisible += 1;
                continue;
            }
            let p = vector(record, layout.position);
            self.cloud.position.push(map.linear * p + map.translation);
            let local = layout.normal(record).ok_or_else(|| {
                let at = start + i * layout.size + layout.normal.unwrap_or(0);
                ParseError::byte(at, "a coded normal of face 7", "a face from 0 to 6")
            })?;
            self.push_shape(layout, map, record, local);
            let colour = layout.colour.and_then(|at| record.get(at..));
            self.cloud.colour.push(colour.map_or(Vec3::ONE, |raw| layout.colour_model.decode(raw)));
            if keep_material {
                self.cloud.material.push(layout.material(record));
            }
        }
        Ok(())
    }

    /// Appends normal, radius and axes of a surfel.
    fn push_shape(&mut self, layout: &Layout, map: &Map, record: &[u8], local: DVec3) {
        let mut normal = map.normal * local;
        let radius = layout.radius.map_or(0.0, |at| f64::from(f32::from_be_bytes(array(record, at))));
        let mut axes = [DVec3::ZERO; 2];
        let mut mapped_radius = radius * map.mean_scale;
        if let Some(at) = layout.axes {
            axes = [vector(record, at), vector(record, at + 12)].map(|a| map.linear * a);
            if local == DVec3::ZERO {
                normal = axes[0].cross(axes[1]);
            }
            if layout.radius.is_none() {
                mapped_radius = axes[0].length().max(axes[1].length());
            }
        } else if map.similarity.is_none() && radius > 0.0 && local.length() > 0.0 {
            // A circle becomes an ellipse, and any two orthogonal radii of the circle become semi-axes of it.
            let (u, v) = local.normalize().any_orthonormal_pair();
            axes = [u, v].map(|a| map.linear * (a * radius));
        }
        self.cloud.normal.push(normal.normalize_or_zero().as_vec3());
        self.cloud.radius.push(mapped_radius as f32);
        self.cloud.axes.push(axes.map(DVec3::as_vec3));
    }
}

impl Layout {
    /// Unit normal in the set's coordinates, zero if there is none; `None` for an invalid code.
    fn normal(&self, record: &[u8]) -> Option<DVec3> {
        let Some(at) = self.normal else { return Some(DVec3::ZERO) };
        match self.normal_code {
            NormalCode::Plain => {
                let n = vector(record, at);
                Some(if n.is_finite() { n } else { DVec3::ZERO })
            }
            NormalCode::Cube16 => cube_normal(u32::from(u16::from_be_bytes(array(record, at))), 6),
            NormalCode::Cube32 => cube_normal(u32::from_be_bytes(array(record, at)), 14),
        }
    }

    fn material(&self, record: &[u8]) -> Material {
        let d = Material::default();
        let byte = |i: usize| self.material[i].and_then(|at| record.get(at)).map(|b| f32::from(*b));
        let share = |i: usize, default: f32| byte(i).map_or(default, |b| b / 255.0);
        Material {
            ambient: share(0, d.ambient),
            diffuse: share(1, d.diffuse),
            specular: share(2, d.specular),
            shininess: byte(3).unwrap_or(d.shininess),
        }
    }
}

/// Bytes of a record at an offset that [`Layout::read`] has checked. Bytes beyond the end are zero.
fn array<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
    record.get(at..).and_then(<[u8]>::first_chunk::<N>).copied().unwrap_or([0; N])
}

fn vector(record: &[u8], at: usize) -> DVec3 {
    DVec3::from_array([0, 4, 8].map(|k| f64::from(f32::from_be_bytes(array(record, at + k)))))
}
