//! Images as maps: what is light is free.

use std::{
    io::{BufReader, Seek as _},
    path::Path,
};

use ::image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits};
use harmonic::MAX_SIDE;

use crate::maps::{
    error::MapError,
    file::{check_size, open},
    map::Map,
};

/// The largest map in 16 bits a channel, four channels, with room for the words of a Netpbm in ASCII.
const LONGEST: u64 = (MAX_SIDE as u64).pow(2) * 8 + (1 << 20);

/// Which pixels are free, as the ROS map_server tells them in its trinary mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lightness {
    /// Whether dark means free.
    pub(super) negate: bool,
    /// A pixel is free if its darkness, 0 to 1, is below this
    pub(super) free_thresh: f64,
    /// and not above this.
    pub(super) occupied_thresh: f64,
}

impl Default for Lightness {
    /// The thresholds the map_server's own map_saver writes.
    fn default() -> Self {
        Self {
            negate: false,
            free_thresh: 0.196,
            occupied_thresh: 0.65,
        }
    }
}

impl Lightness {
    /// Whether a pixel of this brightness, 0 to 1, is free.
    fn is_free(self, brightness: f64) -> bool {
        let darkness = if self.negate {
            brightness
        } else {
            1.0 - brightness
        };
        darkness < self.free_thresh && darkness <= self.occupied_thresh
    }
}

/// The map in an image, a cell a pixel.
pub(super) fn load(file: &Path, lightness: Lightness) -> Result<Map, MapError> {
    let image = decode(file)?;
    let (cols, rows) = (image.width() as usize, image.height() as usize);
    Ok(match &image {
        DynamicImage::ImageLuma8(grey) => {
            // By far the most maps, and some are large: one look-up a pixel.
            let free: Vec<bool> = (0..=u8::MAX)
                .map(|grey| lightness.is_free(f64::from(grey) / 255.0))
                .collect();
            Map::new(cols, rows, grey.iter().map(|&grey| free[usize::from(grey)]))
        }
        other => {
            let pixels = other.to_rgba16();
            let with_alpha = other.color().has_alpha();
            let free = pixels.pixels().map(|pixel| {
                // The map_server's trinary mode takes alpha for a fourth colour.
                let channels = if with_alpha { 4 } else { 3 };
                let sum: f64 = pixel.0[..channels].iter().copied().map(f64::from).sum();
                lightness.is_free(sum / (65_535.0 * channels as f64))
            });
            Map::new(cols, rows, free)
        }
    })
}

fn decode(file: &Path) -> Result<DynamicImage, MapError> {
    let unreadable = |cause| MapError::Unreadable {
        file: file.to_owned(),
        cause,
    };
    let damaged = |cause: ::image::ImageError| {
        MapError::malformed(
            file,
            format!("a damaged or unusual image ({cause}); save it anew as an 8-bit PGM or PNG"),
        )
    };
    let reader = || -> Result<_, MapError> {
        let mut opened = open(file, LONGEST)?;
        opened.rewind().map_err(unreadable)?;
        // By its first bytes: a PNG that is called .pgm is still a PNG.
        let mut reader = ImageReader::new(BufReader::new(opened))
            .with_guessed_format()
            .map_err(unreadable)?;
        match reader.format() {
            Some(ImageFormat::Pnm | ImageFormat::Png) => {}
            _ => {
                return Err(MapError::malformed(
                    file,
                    "neither a PGM nor a PNG image by its first bytes; save it as one of them",
                ));
            }
        }
        let mut limits = Limits::default();
        // The size is checked below, where it can be told.
        limits.max_alloc = Some(LONGEST);
        reader.limits(limits);
        Ok(reader)
    };
    // Its size first: decoding takes memory for whatever the header claims.
    let decoder = reader()?.into_decoder().map_err(damaged)?;
    let (cols, rows) = decoder.dimensions();
    check_size(file, cols.into(), rows.into())?;
    drop(decoder);
    reader()?.decode().map_err(damaged)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The map in a file of these bytes.
    fn map_of(bytes: &[u8], lightness: Lightness) -> Result<Map, MapError> {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("map.pgm");
        std::fs::write(&file, bytes).unwrap();
        load(&file, lightness)
    }

    /// Whether the middle of 3 x 3 pixels is free.
    fn middle_is_free(header: &[u8], pixel: &[u8], lightness: Lightness) -> bool {
        let map = map_of(&[header, &pixel.repeat(9)].concat(), lightness).unwrap();
        assert_eq!((map.cols, map.rows), (3, 3));
        !map.blocked[4]
    }

    #[test]
    fn a_pixel_is_free_from_the_lightness_of_the_usual_threshold_on() {
        let usual = Lightness::default();
        // 1 - 205 / 255 = 0.19607..., which the map_server's 0.196 takes for unknown.
        for (grey, free) in [(0, false), (205, false), (206, true), (255, true)] {
            assert_eq!(
                middle_is_free(b"P5 3 3 255\n", &[grey], usual),
                free,
                "{grey}"
            );
        }
        // A quarter of the range in 16 bits, and in colours.
        assert!(!middle_is_free(b"P5 3 3 65535\n", &[0x40, 0], usual));
        assert!(middle_is_free(b"P6 3 3 255\n", &[255, 255, 200], usual));
        assert!(middle_is_free(b"P5 3 3 100\n", &[90], usual));
    }

    #[test]
    fn a_negated_map_is_free_where_it_is_dark() {
        let negated = Lightness {
            negate: true,
            ..Lightness::default()
        };
        assert!(middle_is_free(b"P5 3 3 255\n", &[10], negated));
        assert!(!middle_is_free(b"P5 3 3 255\n", &[240], negated));
    }

    #[test]
    fn a_damaged_image_is_refused_and_a_large_one_before_it_is_read() {
        let usual = Lightness::default();
        let damaged: [&[u8]; 6] = [
            b"",
            b"P5",
            b"P5 3 3 255\n1234",
            b"P5 3 3 0\n123456789",
            b"P2 2 2 255\n1 2 x 4",
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
        ];
        for bytes in damaged {
            let error = map_of(bytes, usual).unwrap_err();
            assert!(matches!(error, MapError::Malformed { .. }), "{error}");
        }
        for header in [
            "P5 99999 3 255\n",
            "P5 0 3 255\n",
            "P5 4000000000 4000000000 255\n",
        ] {
            let error = map_of(header.as_bytes(), usual).unwrap_err();
            assert!(matches!(error, MapError::Size { .. }), "{header}: {error}");
        }
    }
}
