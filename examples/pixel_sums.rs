//! One line for each picture: for each group of its channels an exact sum and the CRC-32 of all values.
//!
//! `tests/pixel_sums` calls it. The line does not depend on the text in the header of a file. Pictures are read by the
//! `exr` and `image` crates directly, not by splatblur: a change of our readers cannot hide a change of our pictures.
//!
//! Lines of standard input are `label<TAB>path of an .exr or a .png`. A line of the result is
//! `label: A 5184 01234567, depth 12.5 +3 infinite 89abcdef, rgb 1234.5678 00ff00ff`. The sum is exact up to one
//! rounding to `f64`; `+3 infinite` counts the values that have no sum. The checksum is taken over the bits of all
//! values: channel after channel in the order of their names, row after row.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;

/// Channels by name: the bits and the values of all pixels.
type Channels = BTreeMap<String, Vec<f32>>;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (label, path) = line.split_once('\t').ok_or("a line is `label<TAB>path`")?;
        let channels = read(Path::new(path)).map_err(|why| format!("{path}: {why}"))?;
        writeln!(out, "{label}: {}", groups(channels).join(", "))?;
    }
    Ok(())
}

fn read(path: &Path) -> Result<Channels, Box<dyn Error>> {
    if path.extension().is_some_and(|extension| extension == "png") { png(path) } else { exr(path) }
}

/// All channels of all parts, as they stand in the file.
fn exr(path: &Path) -> Result<Channels, Box<dyn Error>> {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_file(path)?;
    let mut channels = Channels::new();
    for (number, part) in image.layer_data.iter().enumerate() {
        for channel in &part.channel_data.list {
            let name = if number == 0 { channel.name.to_string() } else { format!("{number}.{}", channel.name) };
            channels.insert(name, channel.sample_data.values_as_f32().collect());
        }
    }
    Ok(channels)
}

/// The four channels of a PNG, 16 bits each, as whole numbers.
fn png(path: &Path) -> Result<Channels, Box<dyn Error>> {
    let pixels = image::open(path)?.into_rgba16().into_raw();
    let plane = |channel: usize| pixels.iter().skip(channel).step_by(4).map(|&v| f32::from(v)).collect();
    Ok(["R", "G", "B", "A"].iter().enumerate().map(|(channel, name)| ((*name).to_owned(), plane(channel))).collect())
}

/// Red, green and blue are one group; so are the channels of a layer.
fn groups(channels: Channels) -> Vec<String> {
    let mut groups: BTreeMap<String, Sum> = BTreeMap::new();
    for (name, values) in channels {
        let group = match (name.as_str(), name.rsplit_once('.')) {
            ("R" | "G" | "B", _) => "rgb",
            (_, Some((layer, _))) => layer,
            (name, None) => name,
        };
        let sum = groups.entry(group.to_owned()).or_default();
        for value in values {
            sum.add(value);
        }
    }
    groups.into_iter().map(|(name, sum)| format!("{name} {}", sum.text())).collect()
}

/// A sum without rounding: for each exponent the sum of the mantissas.
struct Sum {
    mantissas: [i64; 256],
    infinite: usize,
    crc: crc32fast::Hasher,
}

impl Default for Sum {
    fn default() -> Self {
        Self { mantissas: [0; 256], infinite: 0, crc: crc32fast::Hasher::new() }
    }
}

impl Sum {
    fn add(&mut self, value: f32) {
        let bits = value.to_bits();
        self.crc.update(&bits.to_le_bytes());
        let (exponent, fraction) = (bits >> 23 & 0xff, i64::from(bits & 0x7f_ffff));
        if exponent == 0xff {
            self.infinite += 1;
            return;
        }
        // Subnormal numbers have no hidden bit, and the exponent of the smallest normal ones.
        let mantissa = if exponent == 0 { fraction } else { fraction | 0x80_0000 };
        self.mantissas[exponent.max(1) as usize] += if value.is_sign_negative() { -mantissa } else { mantissa };
    }

    /// Sums of mantissas are below 2^53 for any picture of less than 2^29 values, so each product is exact.
    fn text(&self) -> String {
        let sum: f64 = self.mantissas.iter().zip(0..).map(|(&sum, at)| sum as f64 * f64::powi(2.0, at - 150)).sum();
        let infinite = if self.infinite > 0 { format!(" +{} infinite", self.infinite) } else { String::new() };
        format!("{sum}{infinite} {:08x}", self.crc.clone().finalize())
    }
}
