#![no_main]
//! Any bytes as scans: read or refused, never a panic. The sums of pages are made right first: few changes would get
//! past them.

use libfuzzer_sys::fuzz_target;
use splatblur::model::{ModelFormat, parse};

/// Bytes of a page, and of the sum at its end.
const PAGE: usize = 1024;
const SUM: usize = 4;

/// CRC-32C (Castagnoli), bit by bit.
fn sum(bytes: &[u8]) -> u32 {
    let bit = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| bit(crc)))
}

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = bytes.to_vec();
    for page in bytes.chunks_exact_mut(PAGE) {
        let (data, at) = page.split_at_mut(PAGE - SUM);
        at.copy_from_slice(&sum(data).to_be_bytes());
    }
    let _ = parse(&bytes, ModelFormat::E57);
});
