//! Maps of ROS map_server, PGM, PNG and MovingAI. A map says which cells are free.
//!
//! [`load`] chooses a reader by file extension. [`load_placed`] reads a ROS map with its position
//! in metres.
//!
//! Sizes are checked before allocation. Errors name file, cause and remedy.

mod error;
mod file;
mod image;
mod map;
mod moving_ai;
mod prior;
mod ros;

use std::path::Path;

pub use error::MapError;
pub use map::{MOST_BOXES, Map, PlacedMap};
pub use prior::{save_believed, with_prior_map};
pub use ros::load_placed;

/// Loads a map in the format of its file extension.
///
/// # Errors
/// The file cannot be read, or is not a map of that format.
pub fn load(file: &Path) -> Result<Map, MapError> {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("yaml" | "yml") => ros::load(file),
        Some("pgm" | "png" | "pbm" | "ppm" | "pnm") => {
            image::load(file, image::Lightness::default())
        }
        Some("map") => moving_ai::load(file),
        _ => Err(MapError::of(
            file,
            "not the name of a map; give a .yaml of the ROS map_server, a .pgm or .png image, or a MovingAI .map",
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn what_is_no_file_of_a_known_kind_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("folder.map");
        fs::create_dir(&folder).unwrap();
        let refused = |file: &Path| load(file).unwrap_err().to_string();
        assert!(refused(&folder).contains("not a regular file"));
        let missing = directory.path().join("missing.png");
        assert!(refused(&missing).contains("can be read"));
        let nameless = directory.path().join("map");
        assert!(refused(&nameless).contains("not the name of a map"));
    }
}
