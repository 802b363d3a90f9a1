//! Colours of points by a column of numbers.
//!
//! Readers fill the column `value` of a cloud where the file has a column of the wanted name; here is what follows from
//! other columns. Colours are made when a cloud is completed.

use glam::Vec3;

use super::cloud::Cloud;
use super::colour_map::ColourMap;
use super::error::ParseError;
use super::surfels::Surfels;

/// Colour of points without a value: the grey .5 of a display, linear.
const NO_VALUE: f32 = 0.214_041_14;
/// Names of columns that an error shows.
const SHOWN: usize = 24;

/// Colours of points by a column of numbers (`<pointModel colourBy="...">`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColourBy {
    /// Name of the column, in any letter case: one of the file, else `x`, `y` or `z`, `speed` (the length of
    /// velocities), `radius`, `opacity`, `density` or `id`.
    pub column: String,
    /// The colours.
    pub map: ColourMap,
    /// The values of the first and of the last colour, two finite numbers that differ; `None`: the least and the
    /// greatest one.
    pub range: Option<[f64; 2]>,
}

impl ColourBy {
    /// Reads a range as `-1..2.5`; `None` unless it is two finite numbers that differ.
    pub fn parse_range(text: &str) -> Option<[f64; 2]> {
        let (first, last) = text.split_once("..")?;
        let number = |word: &str| word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let range = [number(first)?, number(last)?];
        (range[0] != range[1]).then_some(range)
    }

    /// The name as readers look for it.
    pub(super) fn name(&self) -> String {
        self.column.trim().to_lowercase()
    }

    /// What the colours stand for.
    pub(super) fn note(&self, [first, last]: [f64; 2]) -> String {
        // Nine digits tell what differs, and hide how it was rounded.
        let [first, last] = [first, last].map(|end| format!("{end:.8e}").parse().unwrap_or(end));
        format!("coloured by `{}`: {} from {first} to {last}", self.column.trim(), self.map)
    }

    /// Linear colours of values, for a range; a grey where there is none.
    pub(super) fn colours(&self, values: &[f64], [first, last]: [f64; 2]) -> Vec<Vec3> {
        let along = |value: f64| if first == last { value * 0.0 + 0.5 } else { (value - first) / (last - first) };
        let colour = |value: &f64| self.map.linear(along(*value)).unwrap_or(Vec3::splat(NO_VALUE));
        values.iter().map(colour).collect()
    }
}

/// The least and the greatest of the finite values; `None` where there is none.
pub(super) fn range(values: &[f64]) -> Option<[f64; 2]> {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    finite.fold(None, |range, value| match range {
        None => Some([value; 2]),
        Some([least, greatest]) => Some([value.min(least), value.max(greatest)]),
    })
}

/// Fills the values of a cloud whose file has no column of this name with what its other columns say.
pub(super) fn derive(cloud: &mut Cloud, by: &ColourBy) {
    if !cloud.value.is_empty() {
        return;
    }
    let wide = |column: &[f32]| column.iter().copied().map(f64::from).collect();
    cloud.value = match by.name().as_str() {
        "x" => cloud.position.iter().map(|p| p.x).collect(),
        "y" => cloud.position.iter().map(|p| p.y).collect(),
        "z" => cloud.position.iter().map(|p| p.z).collect(),
        "speed" => cloud.velocity.iter().map(|v| v.as_dvec3().length()).collect(),
        "radius" => wide(&cloud.radius),
        "opacity" => wide(&cloud.opacity),
        "density" => wide(&cloud.density),
        "id" => cloud.id.iter().map(|id| *id as f64).collect(),
        _ => Vec::new(),
    };
}

/// The same of surfels that are already complete. Velocities that a file left out are 0.
pub(super) fn of_surfels(surfels: &Surfels, by: &ColourBy) -> Result<Vec<f64>, ParseError> {
    let places =
        |axis: usize| surfels.position.iter().map(|p| surfels.origin[axis] + f64::from(p[axis])).collect::<Vec<f64>>();
    let values = match by.name().as_str() {
        "x" => places(0),
        "y" => places(1),
        "z" => places(2),
        "speed" => surfels.velocity.iter().map(|v| v.as_dvec3().length()).collect(),
        "radius" => (0..surfels.len()).map(|i| f64::from(surfels.radius(i))).collect(),
        "opacity" => surfels.opacity.iter().copied().map(f64::from).collect(),
        "id" => surfels.id.iter().map(|id| *id as f64).collect(),
        _ => Vec::new(),
    };
    if values.len() == surfels.len() { Ok(values) } else { Err(missing(by, &[])) }
}

/// The error for a file without the column.
pub(super) fn missing(by: &ColourBy, columns: &[String]) -> ParseError {
    let found = format!("no column {:?} to colour by", by.column);
    if by.name() == "speed" {
        return ParseError::byte(0, found, "one of this name, or velocities (vx, vy and vz)");
    }
    let mut known: Vec<&str> = columns.iter().map(String::as_str).take(SHOWN).collect();
    let more = columns.len() > SHOWN;
    known.extend(["x", "y", "z", "speed"].into_iter().filter(|name| !columns.iter().any(|known| known == name)));
    let tail = if more { " and others" } else { "" };
    ParseError::byte(0, found, format!("{}{tail}", known.join(", ")))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn by(column: &str) -> ColourBy {
        ColourBy { column: column.to_owned(), map: ColourMap::parse("grey").unwrap(), range: None }
    }

    #[test]
    fn values_follow_from_columns() {
        let cloud = Cloud {
            position: vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)],
            velocity: vec![Vec3::new(3.0, 0.0, 4.0), Vec3::ZERO],
            id: vec![7, 9],
            ..Cloud::default()
        };
        let values = |column: &str| {
            let mut cloud = cloud.clone();
            derive(&mut cloud, &by(column));
            cloud.value
        };
        assert_eq!(values("X"), [1.0, 4.0]);
        assert_eq!(values("z"), [3.0, 6.0]);
        assert_eq!(values(" Speed "), [5.0, 0.0]);
        assert_eq!(values("id"), [7.0, 9.0]);
        assert!(values("radius").is_empty() && values("pressure").is_empty());
    }

    #[test]
    fn ranges_leave_out_what_is_no_number() {
        assert_eq!(range(&[f64::NAN, 2.0, f64::INFINITY, -1.0]), Some([-1.0, 2.0]));
        assert_eq!(range(&[f64::NAN]), None);
    }

    #[test]
    fn texts_of_ranges() {
        assert_eq!(ColourBy::parse_range("-1..2.5"), Some([-1.0, 2.5]));
        assert_eq!(ColourBy::parse_range(" 1e3 .. -2. "), Some([1000.0, -2.0]));
        for wrong in ["", "1", "1..", "..1", "1..1", "a..b", "nan..1", "0..inf", "1..2..3"] {
            assert_eq!(ColourBy::parse_range(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn colours_go_along_the_range_in_either_direction() {
        let grey = |values: &[f64], range| by("z").colours(values, range).iter().map(|c| c.x).collect::<Vec<_>>();
        assert_eq!(grey(&[-1.0, 1.0, 3.0, 9.0], [1.0, 3.0]), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(grey(&[1.0, 3.0], [3.0, 1.0]), [1.0, 0.0]);
        assert_eq!(grey(&[f64::NAN, 2.0], [2.0, 2.0]), [NO_VALUE, NO_VALUE]);
    }
}
