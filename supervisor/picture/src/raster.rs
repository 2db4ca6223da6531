//! A drawing as pixels must contain no text, because no fonts are loaded.

use resvg::{tiny_skia::Pixmap, usvg};
use thiserror::Error;

/// A fault of the program with any map.
#[derive(Debug, Error)]
pub enum RasterError {
    #[error("the picture could not be read back: {0}; report this map")]
    Drawing(#[from] usvg::Error),
    #[error("no picture of {width} x {height} pixels can be made; report this map")]
    Size { width: u32, height: u32 },
    #[error("the picture could not be encoded: {0}; report this map")]
    Encoding(String),
}

/// A PNG file with a pixel for each unit.
///
/// # Errors
/// `svg` is no SVG, or no pixmap of its size can be allocated.
pub fn png(svg: &str) -> Result<Vec<u8>, RasterError> {
    let tree = usvg::Tree::from_str(svg, &usvg::Options::default())?;
    let size = tree.size().to_int_size();
    let (width, height) = (size.width(), size.height());
    let mut pixels = Pixmap::new(width, height).ok_or(RasterError::Size { width, height })?;
    resvg::render(&tree, usvg::Transform::identity(), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| RasterError::Encoding(error.to_string()))
}
