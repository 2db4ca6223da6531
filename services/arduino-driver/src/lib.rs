//! ROSArduinoBridge: one-letter requests ended by a carriage return, and answer lines in the order
//! of the requests.
//!
//! The board sends only on request. Each poll requests a round: the range of each sonar, `p PIN`,
//! and then the encoder counts, `e`, which begin a tick. A board with a gyro adds its angle.
//! Answers carry no name and bytes may be lost, so these rules assign each answer to its request:
//!
//! 1. A round is requested once all requests are answered. Its ranges count only if all came,
//!    followed by its counts, whose form is unique.
//! 2. A line that does not fit, or a round incomplete after `robot.command_limit_s`, drops the
//!    round. The driver then requests only the baud rate, `b`, and drops all lines until a number
//!    greater than any range.
//! 3. That number answers the only pending `b`: another is requested only after [`LATEST_S`].
//!    Earlier requests are answered or lost by then, so rule 1 holds again.
//!
//! Answers must come in order, and within [`LATEST_S`] or never. The protocol has no checksum, so a
//! digit changed into another passes: counts then jump, which the link judges, or a range is wrong
//! once.

mod answers;

use std::time::Duration;

use common::{
    driver::{
        Base, Driver, Heard, Motion, Turn, WireTally, counts::wheel_sample, gyro, range_reading,
    },
    json_wire::Lines,
    mission::{Body, Mission, Sensor},
    wire::COUNT_CYCLE,
};

use self::answers::Answer;

/// Lines taken at once; a round has at most seven.
const MOST_AT_ONCE: usize = 64;
/// Latest answer; the board waits for an echo for at most 1 s.
const LATEST_S: f64 = 2.0;
/// Gyro unit, radians.
const GYRO_RAD: f64 = 1e-4;
/// Largest plausible multiple of a wheel's top speed.
const IMPLAUSIBLE: f64 = 1.5;

#[derive(Debug)]
enum Waits {
    No,
    /// Round requested at poll `since`, and its ranges, centimetres.
    Round {
        since: u64,
        ranges: Vec<u16>,
    },
    /// Baud rate; none if not requested yet.
    Baud {
        since: Option<u64>,
    },
}

#[derive(Debug)]
pub struct Arduino {
    body: Body,
    pid_rate_hz: f64,
    rate_hz: f64,
    most_counts_s: f64,
    /// Polls until a round is overdue, and until a request is lost.
    overdue: u64,
    lost: u64,
    /// In the order of requests.
    sonars: Vec<(u8, usize, Sensor)>,
    lines: Lines,
    waits: Waits,
    polls: u64,
    /// Newest counts, their poll, and speeds up to them, counts/s.
    counts: Option<([i32; 2], u64, [i32; 2])>,
    gyro: gyro::Angle,
    /// Unreported reason for dropping the newest round.
    dropped: Option<String>,
    tally: WireTally,
}

impl Arduino {
    pub fn new(mission: &Mission) -> Self {
        let robot = &mission.robot;
        let body = mission.body();
        let pin = |(row, sensor): (usize, Sensor)| {
            Some((*robot.arduino.sonars.get(&sensor.name)?, row, sensor))
        };
        Self {
            body,
            pid_rate_hz: robot.arduino.pid_rate_hz,
            rate_hz: robot.rate_hz,
            most_counts_s: IMPLAUSIBLE * body.top_speed_m_s / body.metres_per_count(),
            overdue: (robot.command_limit_s * robot.rate_hz).ceil() as u64,
            lost: (LATEST_S * robot.rate_hz).ceil() as u64,
            sonars: mission.sensor_table().into_iter().enumerate().filter_map(pin).collect(),
            lines: Lines::default(),
            waits: Waits::Baud { since: None },
            polls: 0,
            counts: None,
            gyro: gyro::Angle::default(),
            dropped: None,
            tally: WireTally::default(),
        }
    }

    fn take(&mut self, line: &[u8], heard: &mut Heard) -> Result<(), String> {
        let answer = Answer::parse(line)?;
        // Only the baud rate shows that the board understands it.
        heard.anything |= answer == Answer::Baud || !matches!(self.waits, Waits::Baud { .. });
        match (answer, &mut self.waits) {
            (Answer::Done, _) => heard.acknowledged += 1,
            (Answer::Baud, waits @ Waits::Baud { since: Some(_) }) => *waits = Waits::No,
            (_, Waits::Baud { .. }) => {}
            (Answer::Centimetres(range), Waits::Round { ranges, .. })
                if ranges.len() < self.sonars.len() =>
            {
                ranges.push(range);
            }
            (Answer::Counts(counts, gyro), Waits::Round { since, ranges })
                if ranges.len() == self.sonars.len() =>
            {
                let since = *since;
                let ranges = std::mem::take(ranges);
                self.waits = Waits::No;
                for ((_, row, sensor), centimetres) in self.sonars.iter().zip(ranges) {
                    // 0 means no echo.
                    let range = (centimetres > 0).then(|| f64::from(centimetres) / 100.0);
                    heard.readings.push(range_reading(*row, sensor, range));
                }
                let wheels = counts.map(|count| {
                    f64::from(count) * self.body.metres_per_count() / self.body.wheel_radius_m
                });
                let angle = gyro.map(|angle| f64::from(angle) * GYRO_RAD);
                let why = self.gyro.take(angle, wheels, &self.body, 1e9 / self.rate_hz);
                heard.refused = why.map(Into::into);
                heard.motion = Some(self.motion(counts, since));
            }
            (Answer::Invalid, _) => {
                return Err("the board reports an invalid request; it arrived garbled".to_owned());
            }
            (_, _) => {
                let line = String::from_utf8_lossy(line);
                return Err(format!("{:?} is an unexpected answer", line.trim()));
            }
        }
        Ok(())
    }

    /// Returns the motion at counts requested at poll `since`. Speeds are those of the interval
    /// before, so that jumped counts cannot vouch for themselves.
    fn motion(&mut self, counts: [i32; 2], since: u64) -> Motion {
        let (speeds, newest) = self.counts.map_or(([0; 2], [0; 2]), |(then, at, speeds)| {
            let gap_s = since.saturating_sub(at).max(1) as f64 / self.rate_hz;
            // Counts of 32 bits wrap.
            let turned = [0, 1].map(|wheel| f64::from(counts[wheel].wrapping_sub(then[wheel])));
            let is_plausible = turned.iter().all(|way| way.abs() <= self.most_counts_s * gap_s);
            let newest = if is_plausible { turned.map(|way| (way / gap_s) as i32) } else { [0; 2] };
            (speeds, newest)
        });
        self.counts = Some((counts, since, newest));
        // The samples' cycle divides that of 32 bits, so wrapped counts continue.
        let counts = counts.map(|count| count.rem_euclid(i32::from(COUNT_CYCLE)) as u16);
        // The board measures no currents.
        Motion { wheels: wheel_sample(counts, speeds), ..Motion::default() }
    }

    /// Restarts with an unmistakable request.
    fn begin_anew(&mut self) {
        if !matches!(self.waits, Waits::Baud { .. }) {
            self.waits = Waits::Baud { since: None };
        }
    }
}

impl Driver for Arduino {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        let mut lines = self.lines.push(bytes);
        let mut heard = Heard { refused: self.dropped.take().map(Into::into), ..Heard::default() };
        if lines.len() > MOST_AT_ONCE {
            let dropped = lines.drain(MOST_AT_ONCE..).map(|line| line.len()).sum::<usize>();
            self.tally.bytes_dropped += dropped as u64;
            heard.refused = Some("the board sends more lines than requested".into());
            self.begin_anew();
        }
        for line in lines {
            let taken = self.take(&line, &mut heard);
            if !self.tally.count(&line, taken, &mut heard) {
                self.begin_anew();
            }
        }
        heard
    }

    fn reset(&mut self) {
        self.lines.reset();
        self.waits = Waits::Baud { since: None };
    }

    fn tally(&self) -> WireTally {
        self.tally.with_dropped(self.lines.dropped())
    }
}

impl Base for Arduino {
    fn is_polled(&self) -> bool {
        true
    }

    fn turn_for_tick(&mut self) -> Option<Turn> {
        self.gyro.for_tick(self.rate_hz)
    }

    fn poll(&mut self) -> Vec<u8> {
        self.polls += 1;
        let now = self.polls;
        let overdue = self.overdue;
        if let Waits::Round { since, ranges } = &self.waits
            && now - since >= overdue
        {
            let asked = self.sonars.get(ranges.len());
            let asked = asked.map_or_else(|| "e".to_owned(), |(pin, ..)| format!("p {pin}"));
            self.dropped = Some(format!(
                "the answer to `{asked}` is overdue by robot.command_limit_s; check that the sonar is connected and that the line loses no bytes"
            ));
            self.begin_anew();
        }
        match &self.waits {
            Waits::No => {
                self.waits = Waits::Round { since: now, ranges: Vec::new() };
                let pins = self.sonars.iter().map(|(pin, ..)| format!("p {pin}\r"));
                pins.chain(["e\r".to_owned()]).collect::<String>().into_bytes()
            }
            Waits::Baud { since } if since.is_none_or(|since| now - since >= self.lost) => {
                self.waits = Waits::Baud { since: Some(now) };
                // The first carriage return ends a truncated request.
                b"\rb\r".to_vec()
            }
            Waits::Baud { .. } | Waits::Round { .. } => Vec::new(),
        }
    }

    fn owed(&self, sent: &[u8]) -> usize {
        usize::from(sent.starts_with(b"m "))
    }

    /// Encodes whole counts per run of the board's speed loop; its firmware has its own time limit.
    /// A command that would round to 0 is enlarged to one count of the faster wheel.
    fn velocity(&self, counts: [i16; 2], _limit: Duration) -> Vec<u8> {
        let exact = counts.map(|counts| f64::from(counts) / self.pid_rate_hz);
        let greatest = exact[0].abs().max(exact[1].abs());
        let enlarged = if greatest > 0.0 && greatest < 0.5 { 1.0 / greatest } else { 1.0 };
        let [left, right] = exact.map(|speed| (speed * enlarged).round() as i32);
        format!("m {left} {right}\r").into_bytes()
    }
}

#[cfg(test)]
mod tests;
