//! Logs of lines: CARMEN's messages, or a table of numbers with a header (CSV).

use std::{
    fs::File,
    io::{BufRead, BufReader, Read as _},
    path::Path,
};

use flate2::read::MultiGzDecoder;

use crate::{
    Instant, Log, LogError, Said,
    carmen::Reading,
    rate_hz,
    table::{Table, is_header},
};

/// Longest line: 16,384 beams of 12 characters, and as much again.
const LONGEST_LINE: u64 = 400_000;
/// Most instants: a day at 50 Hz.
const MOST_INSTANTS: usize = 4_320_000;

/// Reads a log, compressed by gzip if `is_packed`.
pub(crate) fn read(file: &Path, is_packed: bool, robot: Option<&str>) -> Result<Log, LogError> {
    let unreadable = |cause| LogError::Unreadable { file: file.to_owned(), cause };
    let opened = File::open(file).map_err(unreadable)?;
    let mut lines: Box<dyn BufRead> = if is_packed {
        Box::new(BufReader::new(MultiGzDecoder::new(opened)))
    } else {
        Box::new(BufReader::new(opened))
    };
    let form = |problem| LogError::Form { file: file.to_owned(), problem };
    let (mut log, mut table, mut bytes) = (Reading::default(), None, Vec::new());
    for number in 1_u64.. {
        bytes.clear();
        let read = lines.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut bytes);
        if read.map_err(unreadable)? == 0 {
            break;
        }
        let line = String::from_utf8_lossy(&bytes);
        let taken = match &mut table {
            None if number == 1 && is_header(&line) => {
                table = Some(Table::new(&line, robot).map_err(form)?);
                Some(())
            }
            Some(table) => table.take(&line, &mut log),
            None => log.take(&line),
        };
        if taken.is_none() || log.instants.len() > MOST_INSTANTS {
            return Err(form(if table.is_some() {
                format!("line {number} lacks numbers of its columns; complete it")
            } else {
                format!("line {number} is no message of CARMEN; give ODOM and FLASER lines")
            }));
        }
    }
    let Reading { instants, is_corrected, .. } = log;
    let robot = robot.map_or_else(|| self::robot(&instants), str::to_owned);
    Ok(Log { instants, is_corrected, robot })
}

fn robot(instants: &[Instant]) -> String {
    let rate_hz = rate_hz(instants.windows(2).map(|it| it[1].time_s - it[0].time_s));
    let beams = instants.iter().find_map(|it| match &it.said {
        Said::Line(Some(ranges)) => Some(ranges.len()),
        _ => None,
    });
    let beams = beams.unwrap_or(1);
    // A log may hold fewer reports than its robot gave, so they are late after the longest time.
    format!(
        "[robot]\nprotocol = 'json'\nrate_hz = {rate_hz:.2}\ncommand_limit_s = 5\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\n\
        field_of_view_deg = 180\nreach_m = 30\nbeams = {beams}\n"
    )
}
