//! `firsthand field MAP`: the harmonic field of a map, without a robot.

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use crate::{error::Result, missions::statistics::rounded};
use clap::Args;
use common::{process_status::kibibytes, samples::FieldCell};
use harmonic::{Cancellation, Cell, Domain, Field, Screening, Settings, SolveError, Solver};
use maps::Map;
use picture::FieldOnMap;
use serde_json::{Value, json};

use console::failure::Refused;

/// Solve the harmonic field of a map: numbers for NumPy, a picture, the solving time.
///
/// Cells that are not free, and the map's rim, count as blocked.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A ROS map_server YAML, a PGM or PNG image (light is free), or a MovingAI .map.
    map: PathBuf,
    /// Column and row of the target, from 0; row 0 is the top of the map.
    #[arg(long, value_name = "COL,ROW", value_parser = cell)]
    target_cell: Cell,
    /// Screening length in cells, over which u falls by a further factor of e; without it, none.
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    screening_cells: Option<f64>,
    /// Write a NumPy array with the fields of u (mantissa, exponent) and the guidance (ex, ey).
    #[arg(long, value_name = "F.npy")]
    out: Option<PathBuf>,
    /// Draw level sets of log u, u the potential, and lines of the guidance.
    #[arg(long, value_name = "F.svg")]
    picture: Option<PathBuf>,
    /// Print only one line of JSON, at the end, on standard output.
    #[arg(long)]
    json: bool,
}

fn cell(text: &str) -> Result<Cell, &'static str> {
    let number = |text: &str| text.trim().parse::<usize>().ok();
    text.split_once(',')
        .and_then(|(col, row)| Some(Cell::new(number(col)?, number(row)?)))
        .ok_or("give a cell as column,row, counted from 0, such as 120,45")
}

pub fn main(arguments: &Arguments) -> Result {
    let map = maps::load(&arguments.map)?;
    let domain = domain(arguments, &map)?;
    let began = Instant::now();
    let field = Solver::new(Settings::default()).solve(&domain, &Cancellation::new());
    let field = field.map_err(|cause| format!("{}: {cause}", arguments.map.display()))?;
    let report = report(arguments, &field, began.elapsed());
    if let Some(file) = &arguments.out {
        write(file, array(&field))?;
    }
    if let Some(file) = &arguments.picture {
        write(file, draw(&map, &field))?;
    }
    crate::print(&report, arguments.json)
}

fn domain(arguments: &Arguments, map: &Map) -> Result<Domain> {
    let target = arguments.target_cell;
    let screening = Screening::cells(arguments.screening_cells.unwrap_or(f64::INFINITY));
    let domain = Domain::new(map.cols, map.rows, map.blocked.clone(), target)
        .and_then(|domain| domain.with_screening(&screening));
    domain.map_err(|cause| {
        let file = arguments.map.display();
        let at_target =
            matches!(cause, SolveError::TargetBlocked { .. } | SolveError::Outside { .. });
        match map.nearest_free(target.col, target.row) {
            Some((col, row)) if at_target => Refused::new(
                "target",
                format!("{file}: {cause}; give the nearest free cell, --target-cell {col},{row}"),
            )
            .into(),
            None if at_target => format!(
                "{file}: the map has no free cell (the rim counts as blocked); check its thresholds and `negate`"
            )
            .into(),
            _ => format!("{file}: {cause}").into(),
        }
    })
}

fn report(arguments: &Arguments, field: &Field, took: Duration) -> Value {
    let verification = field.verification();
    let mut report = json!({
        "rows": field.height(),
        "cols": field.width(),
        "target": [field.target().col, field.target().row],
        "reachable": verification.reachable,
        "method": verification.method.name(),
        "worst_residual": verification.worst_residual,
        "log10_u_min": field.log10_u_min(),
        "solve_ms": rounded(took.as_secs_f64() * 1e3),
    });
    if let Some(length) = arguments.screening_cells {
        report["screening_cells"] = length.into();
    }
    // Memory after solving, without output files.
    if let Some(peak) = kibibytes("self/status", "VmHWM") {
        report["peak_memory_bytes"] = (peak * 1024).into();
    }
    report
}

fn write(file: &Path, content: impl AsRef<[u8]>) -> Result<(), String> {
    fs::write(file, content)
        .map_err(|cause| format!("cannot write {}: {cause}; give another file", file.display()))
}

/// Encodes u and guidance as a structured NumPy array of shape (rows, cols), format version 1.0.
fn array(field: &Field) -> Vec<u8> {
    let header = format!(
        "{{'descr': [('mantissa', '<f8'), ('exponent', '<i4'), ('ex', '<f4'), ('ey', '<f4')], \
         'fortran_order': False, 'shape': ({}, {})}}",
        field.height(),
        field.width()
    );
    const BEFORE: usize = 10;
    let length = (BEFORE + header.len() + 1).next_multiple_of(64) - BEFORE;
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((length as u16).to_le_bytes());
    array.extend(format!("{header:<0$}\n", length - 1).bytes());
    for cell in cells(field) {
        let (u, [ex, ey]) = (field.u(cell), guidance(field, cell));
        array.extend(u.mantissa.to_le_bytes());
        array.extend(u.exponent.to_le_bytes());
        array.extend([ex, ey].map(f32::to_le_bytes).concat());
    }
    array
}

fn cells(field: &Field) -> impl Iterator<Item = Cell> {
    let width = field.width();
    (0..field.height()).flat_map(move |row| (0..width).map(move |col| Cell::new(col, row)))
}

fn guidance(field: &Field, cell: Cell) -> [f32; 2] {
    // The field would give a blocked cell its way out of the wall.
    let direction = field.direction(cell).filter(|_| field.is_reachable(cell));
    direction.unwrap_or_default().map(|component| component as f32)
}

fn draw(map: &Map, field: &Field) -> String {
    let drawn: Vec<FieldCell> = cells(field)
        .map(|cell| {
            let [ex, ey] = guidance(field, cell);
            FieldCell { ex, ey, log2_u: field.u(cell).log2() as f32 }
        })
        .collect();
    picture::map_svg(&FieldOnMap {
        size: (map.cols, map.rows),
        blocked: &map.blocked,
        cells: &drawn,
        target: (field.target().col, field.target().row),
    })
}
