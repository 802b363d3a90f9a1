//! Partial sums as bytes, from which a later run can continue. They are exact, so a run in parts gives the same picture
//! as a run in one piece.
//!
//! The bytes are little endian: the mark `SBREFSM2`; the length and text of the settings; width, height and number of
//! planes of AOVs (u32); samples (u64). Then comes one bit for each pixel that tells whether anything was seen in it,
//! and for each such pixel its 64 sums (f64), its range (8 f32) and its planes (f64). The last four bytes are the
//! CRC-32 of all that.

use super::error::ReferenceError;
use super::sampler::SCRAMBLINGS;
use super::sums::Sums;

const MARK: &[u8; 8] = b"SBREFSM2";

impl Sums {
    /// The content of a file: the sums and the settings that they belong to.
    pub fn to_bytes(&self, settings: &str) -> Vec<u8> {
        let mut out = MARK.to_vec();
        out.extend((settings.len() as u32).to_le_bytes());
        out.extend(settings.as_bytes());
        for number in [self.width, self.height, self.planes as u32] {
            out.extend(number.to_le_bytes());
        }
        out.extend(self.samples.to_le_bytes());
        let seen: Vec<bool> = self.colour.iter().map(|sums| sums.iter().any(|s| s[3] > 0.0)).collect();
        out.extend(seen.chunks(8).map(|bits| bits.iter().rev().fold(0_u8, |byte, &bit| byte << 1 | u8::from(bit))));
        for i in (0..seen.len()).filter(|&i| seen[i]) {
            self.colour[i].iter().flatten().for_each(|sum| out.extend(sum.to_le_bytes()));
            self.range[i].iter().flatten().for_each(|value| out.extend(value.to_le_bytes()));
            self.extra[i * self.planes..][..self.planes].iter().for_each(|sum| out.extend(sum.to_le_bytes()));
        }
        let crc = crc32fast::hash(&out);
        out.extend(crc.to_le_bytes());
        out
    }

    /// Reads the sums and settings that [`Self::to_bytes`] wrote.
    ///
    /// # Errors
    /// The bytes are no such file, or are damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, String), ReferenceError> {
        read(bytes).ok_or(ReferenceError::Damaged)
    }
}

fn read(bytes: &[u8]) -> Option<(Sums, String)> {
    let (bytes, crc) = bytes.split_last_chunk()?;
    if !bytes.starts_with(MARK) || crc32fast::hash(bytes) != u32::from_le_bytes(*crc) {
        return None;
    }
    let mut rest = &bytes[MARK.len()..];
    let length = u32::from_le_bytes(take(&mut rest)?) as usize;
    let settings = std::str::from_utf8(rest.get(..length)?).ok()?.to_owned();
    rest = &rest[length..];
    let mut number = || take(&mut rest).map(u32::from_le_bytes);
    let (width, height, planes) = (number()?, number()?, number()? as usize);
    let samples = u64::from_le_bytes(take(&mut rest)?);
    let pixels = (width as usize).checked_mul(height as usize)?;
    let bits = rest.get(..pixels.div_ceil(8))?;
    rest = &rest[bits.len()..];
    if !samples.is_multiple_of(SCRAMBLINGS as u64) || planes > 6 {
        return None;
    }
    let mut sums = Sums::empty(width, height, planes)?;
    sums.samples = samples;
    for i in (0..pixels).filter(|&i| bits[i / 8] >> (i % 8) & 1 == 1) {
        for sum in sums.colour[i].iter_mut().flatten() {
            *sum = f64::from_le_bytes(take(&mut rest)?);
        }
        for value in sums.range[i].iter_mut().flatten() {
            *value = f32::from_le_bytes(take(&mut rest)?);
        }
        for sum in &mut sums.extra[i * planes..][..planes] {
            *sum = f64::from_le_bytes(take(&mut rest)?);
        }
    }
    rest.is_empty().then_some((sums, settings))
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Aov;

    #[test]
    fn bytes_come_back() {
        let mut sums = Sums::new([5, 3], &[Aov::Depth, Aov::Velocity]).unwrap();
        sums.samples = 32;
        sums.colour[7][3] = [0.1, 2.0, -1e-300, 1.0];
        sums.range[7] = [[0.5, 0.5, 0.5, 1.0], [0.75, 0.75, 0.75, 1.0]];
        sums.extra[7 * 3 + 2] = 4.5;
        let bytes = sums.to_bytes("settings");
        assert_eq!(Sums::from_bytes(&bytes).unwrap(), (sums, "settings".to_owned()));
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 4;
            assert!(Sums::from_bytes(&damaged).is_err(), "byte {i}");
            assert!(Sums::from_bytes(&bytes[..i]).is_err(), "cut at {i}");
        }
    }
}
