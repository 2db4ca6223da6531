//! Stop-time table: how long robots moved after their fault.

use std::{fmt::Display, path::Path};

use console::table::Table;
use serde::Serialize;

use simulation::{Promise, RobotFault};

use crate::error::Result;

/// Minimum time between the last tick with a turning wheel and the end of a mission that ends at
/// rest.
const AT_REST_BEFORE_S: f64 = 0.15;

/// Headings of the table; `>` aligns to the right.
const HEADINGS: [&str; 8] = [
    "robot fault",
    ">last command",
    ">at rest",
    ">promised",
    ">way",
    ">touches",
    ">kept",
    "outcome: reason",
];

#[derive(Debug, Serialize)]
pub struct Entry {
    pub fault: RobotFault,
    pub seed: u64,
    /// Maximum of `last_moving_s` and `rest_s`; none if the robot may go on.
    pub promised_s: Option<f64>,
    /// Last command that moves a wheel; none if the mission ended before the fault.
    pub last_moving_s: Option<f64>,
    /// Last tick with a turning wheel, by the ground truth; none as above.
    pub rest_s: Option<f64>,
    pub way_m: f64,
    pub watched_s: f64,
    pub collisions: u64,
    /// Mission outcome; `goes on` if still open at the end of the watch.
    pub outcome: &'static str,
    /// Reason of the outcome. For an open mission, why the link blocks commands; empty if they
    /// pass.
    pub reason: String,
}

impl Entry {
    pub fn is_kept(&self) -> bool {
        let (Some(last_moving_s), Some(rest_s)) = (self.last_moving_s, self.rest_s) else {
            return false;
        };
        let reacts = match self.promised_s {
            Some(limit_s) => last_moving_s.max(rest_s) <= limit_s && !self.reason.is_empty(),
            None => {
                rest_s + AT_REST_BEFORE_S <= self.watched_s
                    || self.fault.row().promise != Promise::EndsAtRest
            }
        };
        reacts && self.collisions == 0 && self.outcome != "wrong_place"
    }
}

#[derive(Default, Serialize)]
pub struct StopTimeTable {
    pub entries: Vec<Entry>,
}

impl StopTimeTable {
    pub fn is_kept(&self) -> bool {
        self.entries.iter().all(Entry::is_kept)
    }

    /// Writes the table to `file`, with `section` in the first column.
    pub fn write(&self, section: &str, file: &Path) -> Result {
        let mut writer = csv::Writer::from_path(file)?;
        let headings = HEADINGS.map(|heading| heading.trim_start_matches('>'));
        writer.serialize(("section", headings))?;
        for row in self.rows() {
            writer.serialize((section, row))?;
        }
        Ok(writer.flush()?)
    }

    fn rows(&self) -> impl Iterator<Item = [String; HEADINGS.len()]> {
        self.entries.chunk_by(|one, next| one.fault == next.fault).map(|entries| {
            let kept = entries.iter().filter(|entry| entry.is_kept()).count();
            let way = entries.iter().map(|entry| entry.way_m).fold(0.0, f64::max);
            let told = entries.iter().find(|entry| !entry.is_kept()).unwrap_or(&entries[0]);
            let reason = if told.reason.is_empty() { "no reason" } else { &told.reason };
            [
                told.fault.row().name.clone(),
                longest(entries, |entry| entry.last_moving_s),
                longest(entries, |entry| entry.rest_s),
                told.promised_s.map_or("-".to_owned(), |seconds| format!("{seconds:.2} s")),
                format!("{way:.2} m"),
                entries.iter().map(|entry| entry.collisions).sum::<u64>().to_string(),
                format!("{kept} of {}", entries.len()),
                format!("{}: {reason}", told.outcome),
            ]
        })
    }

    pub fn text(&self) -> String {
        let mut table = Table::new(HEADINGS);
        for row in self.rows() {
            table.row(row.each_ref().map(|cell| cell as &dyn Display));
        }
        format!("{table}Times and ways are maxima per fault, counted from the fault.\n")
    }
}

/// Returns the maximum, marked as a lower bound if the robot still moved at the end of the watch.
fn longest(entries: &[Entry], time: impl Fn(&Entry) -> Option<f64>) -> String {
    /// Margin before the end of the watch in which a moving robot was last seen to move.
    const STILL_S: f64 = 0.5;
    let times = entries.iter().filter_map(|entry| Some((time(entry)?, entry.watched_s)));
    let longest = times.max_by(|a, b| a.0.total_cmp(&b.0));
    longest.map_or("-".to_owned(), |(seconds, watched_s)| {
        let more = if seconds + STILL_S >= watched_s { "> " } else { "" };
        format!("{more}{seconds:.2} s")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(fault: RobotFault) -> Entry {
        Entry {
            fault,
            seed: 1,
            promised_s: (fault.row().promise == Promise::Rests).then_some(2.0),
            last_moving_s: Some(0.7),
            rest_s: Some(0.9),
            way_m: 0.12,
            watched_s: 10.0,
            collisions: 0,
            outcome: "goes on",
            reason: "robot lost".to_owned(),
        }
    }

    #[test]
    fn a_promise_is_broken_by_motion_a_touch_a_wrong_place_or_silence_about_the_reason() {
        use RobotFault::{CountsReset, Silence};
        #[rustfmt::skip]
        let rows = [
            (entry(Silence), true),
            (Entry { last_moving_s: Some(2.1), ..entry(Silence) }, false),
            (Entry { rest_s: Some(9.9), ..entry(Silence) }, false),
            (Entry { collisions: 1, ..entry(Silence) }, false),
            (Entry { reason: String::new(), ..entry(Silence) }, false),
            (Entry { last_moving_s: None, rest_s: None, ..entry(Silence) }, false),
            (Entry { rest_s: Some(9.9), ..entry(CountsReset) }, true),
            (Entry { collisions: 1, ..entry(CountsReset) }, false),
            (Entry { outcome: "wrong_place", ..entry(CountsReset) }, false),
        ];
        for (entry, kept) in rows {
            assert_eq!(entry.is_kept(), kept, "{entry:?}");
            let table = StopTimeTable { entries: vec![entry] };
            assert_eq!(table.is_kept(), kept);
        }
    }

    #[test]
    fn the_table_shows_the_longest_time_of_each_kind_and_who_still_moved() {
        let moved = Entry { last_moving_s: Some(9.9), ..entry(RobotFault::Silence) };
        let table = StopTimeTable { entries: vec![entry(RobotFault::Silence), moved] };
        let text = table.text();
        let row = text.lines().nth(1).unwrap_or_default();
        let words: Vec<_> = row.split_whitespace().collect();
        let want = "silence > 9.90 s 0.90 s 2.00 s 0.12 m 0 1 of 2 goes on: robot lost";
        assert_eq!(words.join(" "), want);
    }
}
