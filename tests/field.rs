//! Tests of `firsthand field`: the field of a map, and refusals of invalid maps.

use std::path::{Path, PathBuf};

use crate::support::{printed, refused};
use serde_json::Value;

/// Returns a room of 24 x 16 cells with a rim, a wall across it with one doorway, and a closed
/// closet.
fn rooms() -> Vec<String> {
    (0..16)
        .map(|row| {
            (0..24)
                .map(|col| {
                    let rim = col == 0 || row == 0 || col == 23 || row == 15;
                    let wall = col == 12 && row != 4;
                    let closet = (18..=20).contains(&col)
                        && (8..=10).contains(&row)
                        && (col, row) != (19, 9);
                    if rim || wall || closet { '@' } else { '.' }
                })
                .collect()
        })
        .collect()
}

fn write_map(directory: &Path) -> PathBuf {
    let file = directory.join("rooms.map");
    let text = format!("type octile\nheight 16\nwidth 24\nmap\n{}\n", rooms().join("\n"));
    std::fs::write(&file, text).unwrap();
    file
}

fn write_image(directory: &Path) -> PathBuf {
    let file = directory.join("rooms.pgm");
    let pixels: Vec<u8> =
        rooms().concat().bytes().map(|cell| if cell == b'.' { 254 } else { 0 }).collect();
    std::fs::write(&file, [b"P5\n24 16\n255\n".as_slice(), &pixels].concat()).unwrap();
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

/// Reads a NumPy field: mantissa and exponent of u, ex and ey of each of 24 x 16 cells.
fn values(file: &Path) -> Vec<(f64, i32, f32, f32)> {
    let bytes = std::fs::read(file).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
    let begin = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(begin % 64, 0);
    let header = str::from_utf8(&bytes[10..begin]).unwrap().trim_end();
    let types = "[('mantissa', '<f8'), ('exponent', '<i4'), ('ex', '<f4'), ('ey', '<f4')]";
    let text = format!("{{'descr': {types}, 'fortran_order': False, 'shape': (16, 24)}}");
    assert_eq!(header, text);
    assert_eq!(bytes[begin - 1], b'\n');
    let cells = bytes[begin..].chunks(20);
    assert_eq!(cells.len(), 24 * 16);
    let four = |cell: &[u8], at: usize| -> [u8; 4] { cell[at..at + 4].try_into().unwrap() };
    cells
        .map(|cell| {
            (
                f64::from_le_bytes(cell[..8].try_into().unwrap()),
                i32::from_le_bytes(four(cell, 8)),
                f32::from_le_bytes(four(cell, 12)),
                f32::from_le_bytes(four(cell, 16)),
            )
        })
        .collect()
}

/// Solves the rooms and returns (u, ex, ey) per cell from the file.
fn solved(screening: &[&str]) -> Vec<(f64, f64, f64)> {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("rooms.npy");
    let mut arguments = vec!["--target-cell", "3,12", "--out", out.to_str().unwrap()];
    arguments.extend(screening);
    report(&write_map(directory.path()), &arguments);
    let cell = |(mantissa, exponent, ex, ey): (f64, i32, f32, f32)| {
        (mantissa * f64::from(exponent).exp2(), ex.into(), ey.into())
    };
    values(&out).into_iter().map(cell).collect()
}

const TARGET: usize = 12 * 24 + 3;
const CLOSET: usize = 9 * 24 + 19;

#[test]
fn u_in_the_file_is_the_mean_of_its_neighbours_over_1_plus_k() {
    // A screening length of 2.5 cells gives k = (1 / (2 x 2.5))^2.
    let screened = ["--screening-cells", "2.5"];
    for (screening, k) in [(&[][..], 0.0), (&screened[..], 0.04)] {
        let cells = solved(screening);
        let free: Vec<bool> = rooms().concat().bytes().map(|cell| cell == b'.').collect();
        for (at, &(u, ..)) in cells.iter().enumerate() {
            if !free[at] || at == CLOSET {
                assert_eq!(u, 0.0, "cell {at}");
            } else if at == TARGET {
                assert_eq!(u, 1.0);
            } else {
                let around = [at - 1, at + 1, at - 24, at + 24].map(|near| cells[near].0);
                let mean = around.iter().sum::<f64>() / 4.0 / (1.0 + k);
                assert!((mean / u - 1.0).abs() < 1e-3, "cell {at}: {u}, mean {mean}");
            }
        }
    }
}

#[test]
fn guidance_in_the_file_is_uphill_with_y_down_and_of_unit_length() {
    let cells = solved(&[]);
    for (at, &(u, ex, ey)) in cells.iter().enumerate() {
        if u == 0.0 || at == TARGET {
            assert_eq!((ex, ey), (0.0, 0.0), "cell {at}");
            continue;
        }
        assert!((ex.hypot(ey) - 1.0).abs() < 1e-5, "cell {at}");
        let rise =
            (cells[at + 1].0 - cells[at - 1].0) * ex + (cells[at + 24].0 - cells[at - 24].0) * ey;
        assert!(rise > 0.0, "cell {at} leads downhill");
    }
}

#[test]
fn the_report_tells_size_reach_method_and_time() {
    let directory = tempfile::tempdir().unwrap();
    let map = write_map(directory.path());
    let report = report(&map, &["--target-cell", "3,12"]);
    let free = rooms().concat().matches('.').count() as u64;
    assert_eq!(report["rows"], 16);
    assert_eq!(report["cols"], 24);
    assert_eq!(report["reachable"], free - 1, "all but the closet");
    assert_eq!(report["target"], serde_json::json!([3, 12]));
    assert!(!report["method"].as_str().unwrap().is_empty());
    assert!(report["solve_ms"].as_f64().unwrap() > 0.0);
    assert!(report["worst_residual"].as_f64().unwrap() < 1e-2);
    assert!(report["log10_u_min"].as_f64().unwrap() < 0.0);
    assert!(report["peak_memory_bytes"].as_u64().unwrap() > 100_000);
}

#[test]
fn every_format_of_one_map_gives_one_field() {
    let directory = tempfile::tempdir().unwrap();
    let image = write_image(directory.path());
    let yaml = directory.path().join("rooms.yaml");
    std::fs::write(
        &yaml,
        "image: rooms.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    )
    .unwrap();
    let [first, image, yaml] = [write_map(directory.path()), image, yaml].map(|map| {
        let out = directory.path().join("out.npy");
        report(&map, &["--target-cell", "3,12", "--out", out.to_str().unwrap()]);
        values(&out)
    });
    assert_eq!(first, image);
    assert_eq!(first, yaml);
}

#[test]
fn the_picture_is_of_a_size_to_look_at() {
    let directory = tempfile::tempdir().unwrap();
    let picture = directory.path().join("rooms.svg");
    report(
        &write_map(directory.path()),
        &["--target-cell", "3,12", "--picture", picture.to_str().unwrap()],
    );
    let svg = std::fs::read_to_string(picture).unwrap();
    let width = svg.split("width=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!((900..=2500).contains(&width.parse::<u32>().unwrap()), "{width} pixels wide");
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
        ("huge.pgm", b"P5 100000 100000 255\n"),
        ("noise.png", &[7; 300]),
        ("noise.yaml", b"\xff\xfe\x00"),
        ("nothing.map", b""),
        ("black.pgm", b"P5 3 3 255\n\0\0\0\0\0\0\0\0\0"),
        ("rooms.txt", b"@@@"),
    ] {
        let file = directory.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        assert_refuses(&file, &["--target-cell", "1,1"], "", &[name]);
    }
    let map = write_map(directory.path());
    let out = directory.path().join("no/such/folder.npy");
    let out = ["--target-cell", "3,12", "--out", out.to_str().unwrap()];
    assert_refuses(&map, &out, "", &["folder.npy"]);
}
