//! Tests of `firsthand field`: the field of a map, and refusals of invalid maps.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::support::{printed, refused};
use serde_json::Value;

/// Room of 24 x 16 cells with a wall across it with one doorway, and a closed closet.
const ROOMS: &str = "\
@@@@@@@@@@@@@@@@@@@@@@@@
@...........@..........@
@...........@..........@
@...........@..........@
@......................@
@...........@..........@
@...........@..........@
@...........@..........@
@...........@.....@@@..@
@...........@.....@.@..@
@...........@.....@@@..@
@...........@..........@
@...........@..........@
@...........@..........@
@...........@..........@
@@@@@@@@@@@@@@@@@@@@@@@@
";

fn write_map(directory: &Path) -> PathBuf {
    let file = directory.join("rooms.map");
    let text = format!("type octile\nheight 16\nwidth 24\nmap\n{ROOMS}");
    fs::write(&file, text).unwrap();
    file
}

fn report(map: &Path, arguments: &[&str]) -> Value {
    let field = ["field", map.to_str().unwrap(), "--json"];
    serde_json::from_str(&printed(&[&field, arguments].concat())).unwrap()
}

#[track_caller]
fn assert_refuses(map: &Path, arguments: &[&str], code: &str, names: &[&str]) {
    let field = ["field", map.to_str().unwrap()];
    refused(&[&field, arguments].concat(), code, names);
}

/// Reads a NumPy field: u, from its mantissa and exponent, ex and ey of each of 24 x 16 cells.
fn values(file: &Path) -> Vec<(f64, f64, f64)> {
    let bytes = fs::read(file).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
    let begin = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(begin % 64, 0);
    let types = "[('mantissa', '<f8'), ('exponent', '<i4'), ('ex', '<f4'), ('ey', '<f4')]";
    let text = format!("{{'descr': {types}, 'fortran_order': False, 'shape': (16, 24)}}");
    let header = str::from_utf8(&bytes[10..begin]).unwrap();
    assert_eq!(header.strip_suffix('\n').unwrap().trim_end(), text);
    let (cells, rest) = bytes[begin..].as_chunks::<20>();
    assert_eq!((cells.len(), rest.len()), (24 * 16, 0));
    let value = |cell: &[u8; 20]| {
        let (mantissa, rest) = cell.split_first_chunk().unwrap();
        let (exponent, rest) = rest.split_first_chunk().unwrap();
        let (ex, ey) = rest.split_first_chunk().unwrap();
        let exponent = i32::from_le_bytes(*exponent);
        let direction = [*ex, *ey.first_chunk().unwrap()].map(f32::from_le_bytes);
        let [ex, ey] = direction.map(f64::from);
        (f64::from_le_bytes(*mantissa) * f64::from(exponent).exp2(), ex, ey)
    };
    cells.iter().map(value).collect()
}

const TARGET: usize = 12 * 24 + 3;
const CLOSET: usize = 9 * 24 + 19;

#[test]
fn the_field_of_a_map_is_written_with_the_means_and_directions_and_reported() {
    let directory = tempfile::tempdir().unwrap();
    let [out, picture] = ["rooms.npy", "rooms.svg"].map(|name| directory.path().join(name));
    let files = ["--out", out.to_str().unwrap(), "--picture", picture.to_str().unwrap()];
    let map = write_map(directory.path());
    let free: Vec<bool> = ROOMS.lines().flat_map(str::bytes).map(|cell| cell == b'.').collect();
    // A screening length of 2.5 cells gives k = (1 / (2 x 2.5))^2.
    let screened = ["--screening-cells", "2.5"];
    for (screening, k) in [(&[][..], 0.0), (&screened[..], 0.04)] {
        let report = report(&map, &[&["--target-cell", "3,12"], &files[..], screening].concat());
        let cells = values(&out);
        for (at, &(u, ex, ey)) in cells.iter().enumerate() {
            if !free[at] || at == CLOSET || at == TARGET {
                let expected = if at == TARGET { 1.0 } else { 0.0 };
                assert_eq!((u, ex, ey), (expected, 0.0, 0.0), "cell {at}");
                continue;
            }
            let around = [at - 1, at + 1, at - 24, at + 24].map(|near| cells[near].0);
            let mean = around.iter().sum::<f64>() / 4.0 / (1.0 + k);
            assert!((mean / u - 1.0).abs() < 1e-3, "cell {at}: {u}, mean {mean}");
            // Uphill, with y down.
            let rise = (around[1] - around[0]) * ex + (around[3] - around[2]) * ey;
            assert!(rise > 0.0 && (ex.hypot(ey) - 1.0).abs() < 1e-5, "cell {at}");
        }
        // All but the closet.
        let reachable = free.iter().filter(|free| **free).count() - 1;
        let found = ["rows", "cols", "reachable", "target"].map(|key| report[key].clone());
        let expected = serde_json::json!([16, 24, reachable, [3, 12]]);
        assert_eq!(Value::from(found.to_vec()), expected, "{report}");
        assert!(report["worst_residual"].as_f64() < Some(1e-2), "{report}");
    }
    assert!(fs::read_to_string(picture).unwrap().starts_with("<svg"));
}

#[test]
fn a_target_that_is_none_is_answered_with_the_nearest_that_is() {
    let directory = tempfile::tempdir().unwrap();
    let map = write_map(directory.path());
    for (target, nearest) in [("12,12", "11,12"), ("99999,3", "22,3"), ("0,0", "1,1")] {
        let names = ["rooms.map", &format!("--target-cell {nearest}")];
        assert_refuses(&map, &["--target-cell", target], "target", &names);
    }
    assert_refuses(&map, &["--target-cell", "3;4"], "usage", &["3;4"]);
    for (length, named) in [("-1", "-1"), ("0", "0"), ("nan", "NaN")] {
        let screened = ["--target-cell", "3,12", "--screening-cells", length];
        assert_refuses(&map, &screened, "", &[named]);
    }
}

#[test]
fn a_file_that_is_no_map_or_cannot_be_written_is_named() {
    let directory = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("short.pgm", b"P5 24 16 255\nabc".as_slice()),
        ("black.pgm", b"P5 3 3 255\n\0\0\0\0\0\0\0\0\0"),
        ("rooms.txt", b"@@@"),
    ] {
        let file = directory.path().join(name);
        fs::write(&file, bytes).unwrap();
        assert_refuses(&file, &["--target-cell", "1,1"], "", &[name]);
    }
    let map = write_map(directory.path());
    let out = directory.path().join("no/such/folder.npy");
    let out = ["--target-cell", "3,12", "--out", out.to_str().unwrap()];
    assert_refuses(&map, &out, "", &["folder.npy"]);
}
