use std::fs;

use tempfile::TempDir;

/// Returns a folder with the ROS map `hall.yaml` of a drawing: `#` is solid, `?` unknown, and all
/// else free. `placed` gives its resolution and origin.
pub fn drawn(map: &str, placed: &str) -> TempDir {
    let rows: Vec<_> = map.lines().collect();
    let folder = tempfile::tempdir().unwrap();
    let mut image = format!("P5 {} {} 255\n", rows[0].len(), rows.len()).into_bytes();
    image.extend(rows.concat().bytes().map(|letter| match letter {
        b'#' => 0,
        b'?' => 205,
        _ => 254,
    }));
    fs::write(folder.path().join("hall.pgm"), image).unwrap();
    fs::write(folder.path().join("hall.yaml"), format!("image: hall.pgm\n{placed}")).unwrap();
    folder
}
