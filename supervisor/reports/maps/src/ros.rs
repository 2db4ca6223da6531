//! Map files of the ROS map_server: YAML that names an image and thresholds.
//!
//! [`load_placed`] also reads resolution and origin. [`load`] works in cells.

use std::{
    collections::HashMap,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use common::file;
use yaml_rust2::parser::{Event, Parser};

use crate::{
    error::MapError,
    file::read,
    image::{self, Lightness},
    map::{Map, PlacedMap},
};

/// Largest map file. A usual one has a dozen short lines.
const LONGEST: u64 = 64 << 10;
const CELL_M: RangeInclusive<f64> = 0.005..=1.0;
const FARTHEST_M: f64 = 1e6;

/// Scalars and lists of scalars, including other programs' keys.
struct Keys(HashMap<String, Vec<String>>);

pub(super) fn load(file: &Path) -> Result<Map, MapError> {
    let (image, lightness) = of_keys(file, |keys| keys.image(file))?;
    image::load(&image, lightness)
}

/// Loads a map with its position.
///
/// # Errors
/// The YAML or its image cannot be read, or is not a map.
pub fn load_placed(file: &Path) -> Result<PlacedMap, MapError> {
    placed(file, image::load)
}

pub(super) fn load_occupied(file: &Path) -> Result<PlacedMap, MapError> {
    placed(file, |image, lightness| {
        image::pixels(image, Lightness { free_thresh: f64::INFINITY, ..lightness })
    })
}

fn placed(
    file: &Path,
    map_of: fn(&Path, Lightness) -> Result<Map, MapError>,
) -> Result<PlacedMap, MapError> {
    let ((cell_m, corner_m), (image, lightness)) =
        of_keys(file, |keys| Ok((keys.place()?, keys.image(file)?)))?;
    Ok(PlacedMap { map: map_of(&image, lightness)?, cell_m, corner_m })
}

fn of_keys<T>(file: &Path, value: impl FnOnce(&Keys) -> Result<T, String>) -> Result<T, MapError> {
    let text = String::from_utf8(read(file, LONGEST)?)
        .map_err(|_| "not UTF-8 text; give the YAML of a map_server map".to_owned());
    text.and_then(|text| value(&Keys::parse(&text)?)).map_err(|problem| MapError::of(file, problem))
}

/// Saves an image of rows of `cols` pixels, the first at the top, as a map of cells of `cell_m`
/// metres, whose corner of least x and y is given.
///
/// A pixel is 0 if occupied, 254 if free, 205 if unknown, as the map_saver writes them.
pub(super) fn save(
    file: &Path,
    cols: usize,
    pixels: &[u8],
    cell_m: f64,
    [x, y]: [f64; 2],
) -> Result<(), MapError> {
    let unwritable =
        |cause| MapError::of(file, format!("{cause}; give the name of a map to write"));
    assert!(pixels.len().is_multiple_of(cols));
    let image = file.with_extension("pgm");
    let mut bytes = format!("P5\n{cols} {}\n255\n", pixels.len() / cols).into_bytes();
    bytes.extend_from_slice(pixels);
    file::replace(&image, bytes).map_err(unwritable)?;
    let name = image.file_name().unwrap_or_default().to_string_lossy();
    // A name in single quotes is literal, except for doubled quotes.
    let name = name.replace('\'', "''");
    let yaml = format!(
        "image: '{name}'\nmode: trinary\nresolution: {cell_m:?}\norigin: [{x:?}, {y:?}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    file::replace(file, yaml).map_err(unwritable)
}

fn missing(needed: &str) -> String {
    format!("not a map_server map: it needs at least `{needed}`")
}

impl Keys {
    /// Reads YAML event by event and refuses aliases, which bounds memory by the text's length.
    fn parse(text: &str) -> Result<Self, String> {
        let refused = |problem: &str| format!("not a map_server map: {problem}");
        let mut values: HashMap<String, Vec<String>> = HashMap::new();
        let mut parser = Parser::new_from_str(text);
        let (mut depth, mut key) = (0_u32, None);
        loop {
            let (event, _) = parser.next_token().map_err(|error| refused(&error.to_string()))?;
            match event {
                Event::StreamEnd => return Ok(Self(values)),
                Event::Alias(_) => return Err(refused("it has aliases; write each value out")),
                Event::MappingStart(..) | Event::SequenceStart(..) => depth += 1,
                Event::MappingEnd | Event::SequenceEnd => {
                    depth -= 1;
                    if depth == 1 {
                        key = None;
                    }
                }
                Event::Scalar(scalar, ..) => match (depth, key.take()) {
                    (1, None) => {
                        values.insert(scalar.clone(), Vec::new());
                        key = Some(scalar);
                    }
                    (1 | 2, Some(named)) => {
                        values.entry(named.clone()).or_default().push(scalar);
                        // A list continues until its end.
                        key = (depth == 2).then_some(named);
                    }
                    _ => {}
                },
                _ => {}
            }
        }
    }

    /// Returns `None` for a missing key.
    fn scalar(&self, key: &str) -> Result<Option<&str>, String> {
        match self.0.get(key).map(Vec::as_slice) {
            None => Ok(None),
            Some([scalar]) => Ok(Some(scalar)),
            Some(_) => Err(format!("{key}: is not a single value")),
        }
    }

    fn number(&self, key: &str) -> Result<Option<f64>, String> {
        let number =
            |text: &str| text.parse().map_err(|_| format!("{key}: {text:?} is not a number"));
        self.scalar(key)?.map(number).transpose()
    }

    fn image(&self, file: &Path) -> Result<(PathBuf, Lightness), String> {
        let image = self.scalar("image")?.ok_or_else(|| missing("image: FILE"))?;
        // `join` keeps an absolute path.
        Ok((file.parent().unwrap_or(Path::new("")).join(image), self.lightness()?))
    }

    /// Returns the side of a cell and the corner of least x and y, metres.
    fn place(&self) -> Result<(f64, [f64; 2]), String> {
        let cell_m = self.number("resolution")?.ok_or_else(|| missing("resolution: METRES"))?;
        if !CELL_M.contains(&cell_m) {
            let (least, most) = (CELL_M.start(), CELL_M.end());
            return Err(format!(
                "resolution: {cell_m} is not a cell size; set it to {least} to {most} m"
            ));
        }
        let origin = self.0.get("origin").ok_or_else(|| missing("origin: [x, y, 0]"))?;
        let numbers: Vec<f64> = origin.iter().map_while(|number| number.parse().ok()).collect();
        match numbers[..] {
            [x, y, 0.0] if x.abs() <= FARTHEST_M && y.abs() <= FARTHEST_M && origin.len() == 3 => {
                Ok((cell_m, [x, y]))
            }
            _ => Err(format!(
                "origin: {:?} is not supported; set it to [x, y, 0] in metres, without rotation",
                origin.get(..3).unwrap_or(origin)
            )),
        }
    }

    fn lightness(&self) -> Result<Lightness, String> {
        if let Some(mode) = self.scalar("mode")?.filter(|mode| *mode != "trinary") {
            return Err(format!("mode: {mode:?} is not supported; set it to trinary"));
        }
        // The map_server writes 0 and 1, people write false and true.
        let negate = match self.scalar("negate")? {
            None | Some("0" | "false") => false,
            Some("1" | "true") => true,
            Some(other) => {
                return Err(format!("negate: {other} is neither 0 nor 1; set it to one of them"));
            }
        };
        let usual = Lightness::default();
        let share = |key: &str, usual: f64| match self.number(key)?.unwrap_or(usual) {
            value if (0.0..=1.0).contains(&value) => Ok(value),
            value => Err(format!(
                "{key}: {value} is not a share of darkness; set it to a value from 0 to 1"
            )),
        };
        Ok(Lightness {
            negate,
            free_thresh: share("free_thresh", usual.free_thresh)?,
            occupied_thresh: share("occupied_thresh", usual.occupied_thresh)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map_of(yaml: &str, grey: u8) -> Result<Map, MapError> {
        read_by(load, yaml, grey)
    }

    fn read_by<T>(
        read: fn(&Path) -> Result<T, MapError>,
        yaml: &str,
        grey: u8,
    ) -> Result<T, MapError> {
        let directory = tempfile::tempdir().unwrap();
        let image = [b"P5 5 5 255\n".as_slice(), &[grey; 25]].concat();
        std::fs::write(directory.path().join("grey.pgm"), image).unwrap();
        let file = directory.path().join("map.yaml");
        std::fs::write(&file, yaml).unwrap();
        read(&file)
    }

    fn is_free(yaml: &str, grey: u8) -> bool {
        !map_of(yaml, grey).unwrap().blocked[12]
    }

    #[test]
    fn thresholds_and_negation_are_those_of_the_file() {
        let whole = "# saved\nimage: grey.pgm\nmode: trinary\nresolution: 0.05\norigin: [0.0, -1, 0]\n\
                     negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
        assert!(is_free(whole, 200));
        assert!(!is_free(whole, 190));
        assert!(!is_free("image: grey.pgm", 200), "0.196 unless it says so");
        for negate in ["1", "true"] {
            let negated = format!("image: ./grey.pgm\nnegate: {negate}");
            assert!(is_free(&negated, 20) && !is_free(&negated, 235));
        }
        assert!(!is_free("image: grey.pgm\nfree_thresh: 0.9\noccupied_thresh: 0.2", 128));
    }

    #[test]
    fn a_file_that_cannot_be_meant_is_refused_with_its_key() {
        let cases = [
            ("", "image"),
            ("free_thresh: 0.2", "image"),
            ("image: [1, 2]", "image"),
            ("image: grey.pgm\nmode: scale", "mode"),
            ("image: grey.pgm\nnegate: 7", "negate"),
            ("image: grey.pgm\nfree_thresh: 1.5", "free_thresh"),
            ("image: grey.pgm\noccupied_thresh: .nan", "occupied_thresh"),
            ("image: elsewhere.pgm", "elsewhere.pgm"),
            ("image: {{{{", "map_server"),
            ("\u{0}\u{1}", "map_server"),
        ];
        for (yaml, named) in cases {
            let error = map_of(yaml, 255).unwrap_err().to_string();
            assert!(error.contains(named) && error.lines().count() == 1, "{yaml:?} gave {error}");
        }
    }

    #[test]
    fn a_yaml_made_to_explode_is_refused() {
        let mut bomb = String::from("a0: &a0 [x, x, x, x, x, x, x, x, x]\n");
        for nth in 1..12 {
            let last = nth - 1;
            bomb +=
                &format!("a{nth}: &a{nth} [*a{last}, *a{last}, *a{last}, *a{last}, *a{last}]\n");
        }
        bomb += "image: *a11\n";
        assert!(map_of(&bomb, 255).is_err());
        let long = map_of(&"#".repeat(1 << 17), 255).unwrap_err();
        assert!(long.to_string().contains("has at most"), "{long}");
    }

    #[test]
    fn a_placed_map_has_its_cells_in_metres_and_one_that_lies_nowhere_is_refused_with_its_key() {
        let placed = |place: &str| read_by(load_placed, &format!("image: grey.pgm\n{place}"), 255);
        let map = placed("resolution: 0.05\norigin: [-2.5, 3, 0.0]").unwrap();
        assert_eq!((map.cell_m, map.corner_m), (0.05, [-2.5, 3.0]));
        let cases = [
            ("origin: [0, 0, 0]", "resolution"),
            ("resolution: 0.05", "origin"),
            ("resolution: 0\norigin: [0, 0, 0]", "resolution"),
            ("resolution: -1\norigin: [0, 0, 0]", "resolution"),
            ("resolution: .nan\norigin: [0, 0, 0]", "resolution"),
            ("resolution: 0.05\norigin: [0, 0]", "origin"),
            ("resolution: 0.05\norigin: [0, .inf, 0]", "origin"),
            ("resolution: 0.05\norigin: [0, 0, 0.7]", "origin"),
        ];
        for (place, named) in cases {
            let error = placed(place).unwrap_err().to_string();
            assert!(error.contains(named), "{place:?} gave {error}");
        }
    }
}
