//! Which column of a table of points means what: the one list of names that PLY properties and the headers of text
//! files share.
//!
//! Names count in any letter case and order. If a file has several names for one thing, the first in the list
//! is taken.
//!
//! | what | names |
//! |---|---|
//! | position | x y z, position_x.., pos_x.., points_x.., px py pz |
//! | normal | nx ny nz, normal_x.., normals_x.. |
//! | colour | red green blue, r g b, diffuse_red.., colors_x.., color_x.., rgb_x.. |
//! | grey without a colour | intensity, quality, grey, gray, scalar_* |
//! | cut-off radius | radius, radii, psz, point_size, size, value, scale (a float) |
//! | axes | tux tuy tuz tvx tvy tvz |
//! | velocity, acceleration | vx vy vz, velocity_x.., vel_x.., v_x.. ; ax ay az, acceleration_x.., accel_x.. |
//! | identity in a sequence | id, ids, particle_id, point_id |
//! | material (ours) | ambient diffuse specular shininess |
//! | a part of a vector | 0 1 2 in place of x y z, and `:` in place of `_`, as ParaView writes (points:0) |
//! | opacity | alpha, opacity (not beside f_dc_0 and scale_0) |
//! | sample of a volume | density; volume |

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::cloud::Cloud;
use super::colour_by::ColourBy;
use super::error::ParseError;
use super::ply_header::{Element, PropertyKind, Scalar};
use super::surfels::Material;
use super::tidy::MAX_COORDINATE;

/// Numbers are read as `f64`, which has all whole numbers up to this.
const MOST_ID: f64 = (1_u64 << 53) as f64;

/// Names of the material properties, in the order of [`Material`]'s fields.
pub(super) const MATERIAL: [&str; 4] = ["ambient", "diffuse", "specular", "shininess"];

/// Names of vectors that are places, before their parts.
const POSITIONS: [&str; 8] = ["", "points_", "position_", "positions_", "pos_", "p", "xyz_", "coords_"];

/// The ways in which the parts of a vector are named.
fn parts(name: &str) -> impl Iterator<Item = [String; 3]> {
    let with = |name: &str, ends: [&str; 3]| ends.map(|end| format!("{name}{end}"));
    let letters = ["x", "y", "z"];
    let numbers = ["0", "1", "2"];
    let stem = name.strip_suffix('_');
    let colon = stem.map(|stem| format!("{stem}:"));
    let more = colon.map(|colon| [with(name, numbers), with(&colon, numbers), with(&colon, letters)]);
    std::iter::once(with(name, letters)).chain(more.into_iter().flatten())
}

/// Has a table with these names places?
pub(super) fn has_places(names: &[String]) -> bool {
    let has = |part: &String| names.contains(part);
    POSITIONS.iter().any(|name| parts(name).any(|parts| parts.iter().all(has)))
}

/// Is this the name of a part of a place?
pub(super) fn is_place(name: &str) -> bool {
    POSITIONS.iter().any(|vector| parts(vector).flatten().any(|part| part == name))
}

/// Places of the columns of a cloud in a record: indices of the wanted numbers.
pub(super) struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    colour: Option<[usize; 3]>,
    grey: Option<usize>,
    radius: Option<usize>,
    axes: Option<[usize; 6]>,
    velocity: Option<[usize; 3]>,
    acceleration: Option<[usize; 3]>,
    id: Option<usize>,
    material: [Option<usize>; 4],
    opacity: Option<usize>,
    value: Option<usize>,
    density: Option<usize>,
    volume: Option<usize>,
    /// Type of the colours, or of what is shown as grey; `None` where there is neither.
    pub(super) colour_type: Option<Scalar>,
    /// Type of the normals, where there are some; a float where they have several.
    pub(super) normal_type: Option<Scalar>,
    /// Type of the opacities, where there are some.
    pub(super) opacity_type: Option<Scalar>,
}

impl Columns {
    /// Chooses the columns to use. A note says which one is shown as grey.
    ///
    /// # Errors
    /// The element has no x, y and z, or colours of several types.
    pub(super) fn find(
        finder: &mut Finder<'_>,
        element: &Element,
        by: Option<&ColourBy>,
        notes: &mut Vec<String>,
    ) -> Result<Self, ParseError> {
        let position = finder.position()?;
        let normal = finder.take_vector(&["n", "normal_", "normals_"]);
        let normal_type = normal.map(|n| finder.one_type(n).unwrap_or(Scalar::F64));
        let colour_names =
            [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];
        let colour = finder.take_first(&colour_names);
        let colour = colour.or_else(|| finder.take_vector(&["colors_", "color_", "colours_", "colour_", "rgb_"]));
        let mut colour_type = match colour.map(|c| finder.one_type(c)) {
            Some(Err([one, other])) => {
                let found = format!("colour channels of types {} and {}", one.name(), other.name());
                return Err(ParseError::line(element.line, found, "one type"));
            }
            known => known.and_then(Result::ok),
        };
        let axes = finder.take(["tux", "tuy", "tuz", "tvx", "tvy", "tvz"]);
        let mut radius = finder.take_first(&[["radius"], ["radii"], ["psz"], ["point_size"], ["size"], ["value"]]);
        if radius.is_none() && !finder.has("scale_0") {
            radius = finder.take(["scale"]).filter(|s| finder.scalar(s[0]).is_float());
        }
        let velocity = finder.take_vector(&["v", "velocity_", "velocities_", "vel_", "v_"]);
        let acceleration = finder.take_vector(&["a", "acceleration_", "accelerations_", "accel_", "acc_"]);
        let id = finder.take_first(&[["id"], ["ids"], ["particle_id"], ["point_id"]]).map(|s| s[0]);
        let material = MATERIAL.map(|name| finder.take([name]).map(|s| s[0]));
        // What stands beside the columns of a capture is the logit of one, even where others of them are missing.
        let logit = finder.has("f_dc_0") && finder.has("scale_0");
        let opacity = finder.take(["alpha"]).or_else(|| if logit { None } else { finder.take(["opacity"]) });
        let opacity = opacity.map(|s| s[0]);
        let density = finder.take(["density"]).map(|s| s[0]);
        let volume = density.and_then(|_| finder.take(["volume"])).map(|s| s[0]);
        let mut grey = None;
        if colour.is_none() && by.is_none() {
            let scalars = element.properties.iter().map(|p| p.name.as_str()).filter(|n| n.starts_with("scalar_"));
            let name = ["intensity", "quality", "grey", "gray"].into_iter().chain(scalars).find(|n| finder.has(n));
            if let Some(name) = name {
                grey = finder.take([name]).map(|s| s[0]);
                colour_type = grey.map(|s| finder.scalar(s));
                notes.push(format!("no colours: `{name}` is shown as grey"));
            }
        }
        // Another meaning of the column stays.
        let value = by.and_then(|by| finder.share(&by.name()));
        Ok(Self {
            position,
            normal,
            colour,
            grey,
            radius: radius.map(|s| s[0]),
            axes,
            velocity,
            acceleration,
            id,
            material,
            opacity,
            value,
            density,
            volume,
            colour_type,
            normal_type,
            opacity_type: opacity.map(|index| finder.scalar(index)),
        })
    }

    /// True if there are no colours, and something is shown as grey in their place.
    pub(super) fn is_grey(&self) -> bool {
        self.grey.is_some()
    }

    /// What was expected in place of a number of a record that would put a point in a wrong place later on.
    pub(super) fn fault(&self, index: usize, value: f64) -> Option<&'static str> {
        let is_of = |column: Option<[usize; 3]>| column.is_some_and(|column| column.contains(&index));
        if is_of(self.velocity) || is_of(self.acceleration) {
            let usable = value.abs() <= MAX_COORDINATE;
            return (!usable).then_some("a finite number up to 1e18");
        }
        let usable = self.id != Some(index) || value.fract() == 0.0 && value.abs() <= MOST_ID;
        (!usable).then_some("a whole number up to 2^53")
    }

    /// Appends the point of a record. Colours, opacities, and normals of whole numbers are as the file has them: what
    /// stands for 1 may depend on all points.
    pub(super) fn push(&self, values: &[f64], cloud: &mut Cloud) {
        let vector = |s: [usize; 3]| Vec3::new(values[s[0]] as f32, values[s[1]] as f32, values[s[2]] as f32);
        cloud.position.push(DVec3::from_array(self.position.map(|s| values[s])));
        if let Some(n) = self.normal {
            // The vector is scaled in f64: an f32 overflow would lose the direction.
            let wide = DVec3::new(values[n[0]], values[n[1]], values[n[2]]);
            let largest = wide.abs().max_element();
            let whole = self.normal_type.is_some_and(|kind| !kind.is_float());
            let near_one = (0.5..2.0).contains(&largest) || largest == 0.0;
            cloud.normal.push(if near_one || whole { wide.as_vec3() } else { (wide / largest).as_vec3() });
        }
        if let Some(c) = self.colour {
            cloud.colour.push(vector(c));
        } else if let Some(g) = self.grey {
            cloud.colour.push(Vec3::splat(values[g] as f32));
        }
        if let Some(r) = self.radius {
            cloud.radius.push(values[r] as f32);
        }
        if let Some([a, b, c, d, e, f]) = self.axes {
            cloud.axes.push([vector([a, b, c]), vector([d, e, f])]);
        }
        cloud.velocity.extend(self.velocity.map(vector));
        cloud.acceleration.extend(self.acceleration.map(vector));
        cloud.id.extend(self.id.map(|id| values[id] as i64));
        cloud.opacity.extend(self.opacity.map(|opacity| values[opacity] as f32));
        cloud.value.extend(self.value.map(|value| values[value]));
        cloud.density.extend(self.density.map(|density| values[density] as f32));
        cloud.volume.extend(self.volume.map(|volume| values[volume] as f32));
        if self.material.iter().any(Option::is_some) {
            let d = Material::default();
            let value = |i: usize, default: f32| {
                let found = self.material[i].map(|index| values[index] as f32);
                found.filter(|x| x.is_finite() && *x >= 0.0).unwrap_or(default)
            };
            cloud.material.push(Material {
                ambient: value(0, d.ambient),
                diffuse: value(1, d.diffuse),
                specular: value(2, d.specular),
                shininess: value(3, d.shininess),
            });
        }
    }
}

/// Gives each wanted column an index in the record that is read.
pub(super) struct Finder<'a> {
    element: &'a Element,
    /// Columns that are plain numbers, by name.
    by_name: HashMap<&'a str, (usize, Scalar)>,
    /// Index of each column of the element, if it is wanted.
    indices: Vec<Option<usize>>,
    /// Type of the number at each index.
    types: Vec<Scalar>,
}

impl<'a> Finder<'a> {
    pub(super) fn new(element: &'a Element) -> Self {
        let plain = element.properties.iter().enumerate().filter_map(|(i, p)| match p.kind {
            PropertyKind::Scalar(scalar) => Some((p.name.as_str(), (i, scalar))),
            PropertyKind::List { .. } => None,
        });
        Self { element, by_name: plain.collect(), indices: vec![None; element.properties.len()], types: Vec::new() }
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// Indices of x, y and z.
    ///
    /// # Errors
    /// One is missing.
    pub(super) fn position(&mut self) -> Result<[usize; 3], ParseError> {
        self.take_vector(&POSITIONS).ok_or_else(|| {
            let found = format!("an element `{}` without x, y and z", self.element.name);
            ParseError::line(self.element.line, found, "numbers x, y and z")
        })
    }

    /// Indices of the parts of a vector: those that the first of some names has.
    fn take_vector(&mut self, names: &[&str]) -> Option<[usize; 3]> {
        names.iter().find_map(|name| self.parts_of(name).and_then(|parts| self.take(parts)))
    }

    /// The columns of a vector: `name` followed by x, y and z, or by 0, 1 and 2 where it ends in `_`, for which `:` may
    /// stand.
    fn parts_of(&self, name: &str) -> Option<[&'a str; 3]> {
        parts(name).find_map(|parts| {
            let known = parts.map(|part| self.by_name.get_key_value(part.as_str()).map(|(name, _)| *name));
            let [Some(x), Some(y), Some(z)] = known else { return None };
            Some([x, y, z])
        })
    }

    /// Indices of all the names, or `None` if one is missing.
    pub(super) fn take<const N: usize>(&mut self, names: [&str; N]) -> Option<[usize; N]> {
        let mut found = [(0, Scalar::F32); N];
        for (place, name) in found.iter_mut().zip(names) {
            *place = *self.by_name.get(name)?;
        }
        Some(found.map(|(property, scalar)| {
            let index = self.types.len();
            self.types.push(scalar);
            self.indices[property] = Some(index);
            index
        }))
    }

    /// The index of a column that may be wanted already.
    fn share(&mut self, name: &str) -> Option<usize> {
        let (property, _) = *self.by_name.get(name)?;
        self.indices[property].or_else(|| self.take([name]).map(|[index]| index))
    }

    /// The indices of the first of several namings that is complete.
    fn take_first<const N: usize>(&mut self, namings: &[[&str; N]]) -> Option<[usize; N]> {
        namings.iter().find_map(|names| self.take(*names))
    }

    fn scalar(&self, index: usize) -> Scalar {
        self.types[index]
    }

    /// The type of columns that stand for one vector, or two types that they have.
    fn one_type(&self, columns: [usize; 3]) -> Result<Scalar, [Scalar; 2]> {
        let [kind, others @ ..] = columns.map(|index| self.scalar(index));
        others.into_iter().find(|other| *other != kind).map_or(Ok(kind), |other| Err([kind, other]))
    }

    /// Type of x; a float of 32 bits only if y and z are, too.
    pub(super) fn position_type(&self) -> Scalar {
        let parts = POSITIONS.iter().find_map(|name| self.parts_of(name));
        let [x, y, z] = parts.unwrap_or_default().map(|name| self.by_name.get(name).map_or(Scalar::F64, |(_, k)| *k));
        if x == y && y == z { x } else { Scalar::F64 }
    }

    /// How many numbers of a record are wanted.
    pub(super) fn wanted(&self) -> usize {
        self.types.len()
    }

    /// Index of each column of the element, if it is wanted.
    pub(super) fn indices(&self) -> &[Option<usize>] {
        &self.indices
    }

    /// The names of all columns that are plain numbers.
    pub(super) fn numbers(&self) -> Vec<String> {
        let properties = self.element.properties.iter();
        properties.filter(|p| matches!(p.kind, PropertyKind::Scalar(_))).map(|p| p.name.clone()).collect()
    }

    /// The names of the columns that are not wanted, for a note; `None` if there are none.
    pub(super) fn ignored(&self) -> Option<String> {
        let unused = self.element.properties.iter().zip(&self.indices).filter(|(_, index)| index.is_none());
        // Confidence has no meaning for surfels, but many files have it.
        let names: Vec<&str> = unused.map(|(p, _)| p.name.as_str()).filter(|n| *n != "confidence").collect();
        (!names.is_empty()).then(|| list(&names))
    }
}

/// The first names as one text, and how many more there are.
pub(super) fn list(names: &[&str]) -> String {
    const SHOWN: usize = 12;
    let more = names.len().saturating_sub(SHOWN);
    let shown = names.iter().take(SHOWN).map(|name| match *name {
        "" => "(no name)".to_owned(),
        name => name.chars().take(40).flat_map(char::escape_debug).collect(),
    });
    let shown: Vec<String> = shown.collect();
    let tail = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{tail}", shown.join(", "))
}
