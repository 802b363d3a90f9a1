//! What the crate `image` says of picture files, for messages of one line.

use std::error::Error as _;

use image::ImageError;

/// The cause that the decoder or the encoder itself gives. `image` puts a line with the format's name before it, which
/// our messages have in their own words.
pub(crate) fn cause(error: &ImageError) -> String {
    error.source().map_or_else(|| error.to_string(), ToString::to_string)
}

#[cfg(test)]
mod tests {
    use image::ImageFormat;

    use super::*;

    #[test]
    fn causes_are_those_of_decoders() {
        let of = |bytes: &[u8]| cause(&image::load_from_memory_with_format(bytes, ImageFormat::Png).unwrap_err());
        assert_eq!(of(b"no picture"), "Invalid PNG signature.");
        // The signature alone: what is wrong is found by the reader.
        assert_eq!(of(b"\x89PNG\r\n\x1a\n"), "unexpected end of file");
    }
}
