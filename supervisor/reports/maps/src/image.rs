//! Images as maps, in which light pixels are free.

use std::{
    error::Error,
    io::{self, BufRead, BufReader, Seek},
    path::Path,
};

use harmonic::MAX_SIDE;

use crate::{
    error::MapError,
    file::{check_size, open},
    map::Map,
};

/// Bytes of 4 channels of 16 bits, with margin for ASCII Netpbm.
const LONGEST: u64 = (MAX_SIDE as u64).pow(2) * 8 + (1 << 20);

#[derive(Clone, Copy, Debug)]
pub(super) struct Lightness {
    pub negate: bool,
    /// Darkness below which a pixel is free, 0 to 1.
    pub free_thresh: f64,
    /// Darkness above which a pixel is occupied.
    pub occupied_thresh: f64,
}

impl Default for Lightness {
    /// Returns the thresholds that the map_saver writes.
    fn default() -> Self {
        Self { negate: false, free_thresh: 0.196, occupied_thresh: 0.65 }
    }
}

impl Lightness {
    /// Takes a brightness of 0 to 1.
    fn is_free(self, brightness: f64) -> bool {
        let darkness = if self.negate { brightness } else { 1.0 - brightness };
        darkness < self.free_thresh && darkness <= self.occupied_thresh
    }
}

type Cause = Box<dyn Error>;

/// Loads a map whose rim is blocked like a mission's perimeter.
pub(super) fn load(file: &Path, lightness: Lightness) -> Result<Map, MapError> {
    pixels(file, lightness).map(Map::with_rim)
}

/// Loads a map that blocks only pixels.
pub(super) fn pixels(file: &Path, lightness: Lightness) -> Result<Map, MapError> {
    let mut reader = BufReader::new(open(file, LONGEST)?);
    let start = reader.fill_buf().map_err(MapError::unreadable(file))?;
    // The first bytes decide: a PNG may be called .pgm.
    let decoded = match start {
        [0x89, b'P', b'N', b'G', ..] => png(reader, lightness, file),
        [b'P', kind @ (b'2' | b'3' | b'5' | b'6'), ..] => {
            let kind = *kind;
            reader.consume(2);
            netpbm(reader, kind, lightness, file)
        }
        _ => {
            return Err(MapError::of(
                file,
                "neither a PGM nor a PNG image by its first bytes; save it as one of them",
            ));
        }
    };
    decoded.map_err(|cause| match cause.downcast() {
        Ok(size) => *size,
        Err(cause) => MapError::of(
            file,
            format!("a damaged or unusual image ({cause}); save it again as an 8-bit PGM or PNG"),
        ),
    })
}

/// Reads greys (2 and 5) or colours (3 and 6), in ASCII (2 and 3) or binary.
fn netpbm(reader: impl BufRead, kind: u8, lightness: Lightness, file: &Path) -> Result<Map, Cause> {
    let mut bytes = reader.bytes();
    let mut header = || number(&mut bytes);
    let (cols, rows, most) = (header()?, header()?, header()?);
    // Checked first, because decoding allocates by the header.
    check_size(cols.into(), rows.into()).map_err(|problem| MapError::of(file, problem))?;
    if !(1..=0xffff).contains(&most) {
        return Err(format!("its brightest is {most}").into());
    }
    let mut sample = || match kind {
        b'2' | b'3' => number(&mut bytes),
        _ if most < 256 => byte(&mut bytes).map(u32::from),
        _ => Ok(u32::from(byte(&mut bytes)?) << 8 | u32::from(byte(&mut bytes)?)),
    };
    let channels = if matches!(kind, b'2' | b'5') { 1 } else { 3 };
    let mut free = Vec::new();
    for _ in 0..u64::from(cols) * u64::from(rows) {
        let mut sum = 0.0;
        for _ in 0..channels {
            sum += f64::from(sample()?.min(most));
        }
        free.push(lightness.is_free(sum / f64::from(most * channels)));
    }
    Ok(Map::new(cols as usize, free))
}

fn byte(bytes: &mut impl Iterator<Item = io::Result<u8>>) -> Result<u8, Cause> {
    Ok(bytes.next().ok_or("it ends early")??)
}

/// Skips comments before the number, and the one space after it.
fn number(bytes: &mut impl Iterator<Item = io::Result<u8>>) -> Result<u32, Cause> {
    let mut number: Option<u32> = None;
    loop {
        let byte = match bytes.next().transpose()? {
            Some(byte) => byte,
            None => return number.ok_or_else(|| "it ends early".into()),
        };
        match (byte, number) {
            (b'0'..=b'9', _) => {
                let grown = number
                    .unwrap_or(0)
                    .checked_mul(10)
                    .and_then(|tens| tens.checked_add((byte - b'0').into()));
                number = Some(grown.ok_or("a number is too large")?);
            }
            (b'#', None) => while !matches!(bytes.next().transpose()?, Some(b'\n') | None) {},
            (_, Some(number)) if byte.is_ascii_whitespace() => return Ok(number),
            (_, None) if byte.is_ascii_whitespace() => {}
            _ => return Err("a number contains an invalid character".into()),
        }
    }
}

fn png(reader: impl BufRead + Seek, lightness: Lightness, file: &Path) -> Result<Map, Cause> {
    let limits = png::Limits { bytes: LONGEST as usize };
    let mut decoder = png::Decoder::new_with_limits(reader, limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let (cols, rows) = decoder.read_header_info()?.size();
    check_size(cols.into(), rows.into()).map_err(|problem| MapError::of(file, problem))?;
    let mut reader = decoder.read_info()?;
    let (colour, depth) = reader.output_color_type();
    // Like the map_server's trinary mode, which takes alpha as a fourth colour.
    let weights: &[f64] = match colour {
        png::ColorType::Grayscale => &[1.0],
        png::ColorType::GrayscaleAlpha => &[0.75, 0.25],
        png::ColorType::Rgba => &[0.25; 4],
        png::ColorType::Rgb | png::ColorType::Indexed => &[1.0 / 3.0; 3],
    };
    let mut samples = vec![0; reader.output_buffer_size().ok_or("it is too large")?];
    reader.next_frame(&mut samples)?;
    let bytes = if depth == png::BitDepth::Sixteen { 2 } else { 1 };
    let brightness = |sample: &[u8]| match *sample {
        [high, low] => f64::from(u16::from_be_bytes([high, low])) / 65_535.0,
        _ => f64::from(sample[0]) / 255.0,
    };
    let is_free = |pixel: &[u8]| {
        let samples = pixel.chunks_exact(bytes).map(brightness);
        lightness.is_free(samples.zip(weights).map(|(sample, weight)| sample * weight).sum())
    };
    Ok(Map::new(cols as usize, samples.chunks_exact(bytes * weights.len()).map(is_free)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map_of(bytes: &[u8]) -> Result<Map, MapError> {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("map.pgm");
        std::fs::write(&file, bytes).unwrap();
        load(&file, Lightness::default())
    }

    fn middle_is_free(header: &[u8], pixel: &[u8]) -> bool {
        let map = map_of(&[header, &pixel.repeat(9)].concat()).unwrap();
        assert_eq!((map.cols, map.rows), (3, 3));
        !map.blocked[4]
    }

    #[test]
    fn a_pixel_is_free_from_the_lightness_of_the_usual_threshold_on() {
        // 1 - 205 / 255 = 0.19607..., unknown by the map_server's 0.196.
        for (grey, free) in [(0, false), (205, false), (206, true), (255, true)] {
            assert_eq!(middle_is_free(b"P5 3 3 255\n", &[grey]), free, "{grey}");
        }
        // The pixel has a quarter of the range, in 16 bits and in colours.
        assert!(!middle_is_free(b"P5 3 3 65535\n", &[0x40, 0]));
        assert!(middle_is_free(b"P6 3 3 255\n", &[255, 255, 200]));
        assert!(middle_is_free(b"P5 3 3 100\n", &[90]));
    }

    #[test]
    fn a_damaged_image_is_refused_and_a_large_one_before_it_is_read() {
        let damaged: [&[u8]; 6] = [
            b"",
            b"P5",
            b"P5 3 3 255\n1234",
            b"P5 3 3 0\n123456789",
            b"P2 2 2 255\n1 2 x 4",
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
        ];
        for bytes in damaged {
            let error = map_of(bytes).unwrap_err();
            assert!(error.to_string().contains("save it"), "{error}");
        }
        for header in ["P5 99999 3 255\n", "P5 0 3 255\n", "P5 4000000000 4000000000 255\n"] {
            let error = map_of(header.as_bytes()).unwrap_err();
            assert!(error.to_string().contains("on each side"), "{header}: {error}");
        }
    }

    fn middle_of_png_is_free(colour: png::ColorType, depth: png::BitDepth, pixel: &[u8]) -> bool {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 3, 3);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&pixel.repeat(9)).unwrap();
        drop(writer);
        middle_is_free(&bytes, &[])
    }

    #[test]
    fn a_png_is_read_in_greys_and_colours_with_alpha_as_a_fourth_colour() {
        use png::{BitDepth::*, ColorType::*};
        for (colour, depth, pixel, free) in [
            (Grayscale, Eight, &[205][..], false),
            (Grayscale, Eight, &[206], true),
            (Grayscale, Sixteen, &[206, 0], true),
            (Grayscale, Sixteen, &[0, 255], false),
            (Rgb, Eight, &[255, 255, 200], true),
            (Rgb, Eight, &[255, 255, 60], false),
            (Rgba, Eight, &[255, 255, 255, 0], false),
            (GrayscaleAlpha, Eight, &[240, 255], true),
            (GrayscaleAlpha, Eight, &[240, 0], false),
        ] {
            let found = middle_of_png_is_free(colour, depth, pixel);
            assert_eq!(found, free, "{colour:?} {depth:?} {pixel:?}");
        }
    }

    #[test]
    fn a_map_in_ascii_with_comments_is_read_as_in_binary() {
        let ascii = b"P2\n# by hand\n3 3 255\n0 0 0 0 206 0\n0 0 0";
        let map = map_of(ascii).unwrap();
        assert_eq!(map.blocked.iter().filter(|blocked| !**blocked).count(), 1);
    }
}
