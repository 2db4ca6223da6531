//! A log of eight sonars with the robot's odometry: `t_s,x_m,y_m,theta_rad,z0_m` to `z7_m`, a sample a line; metres,
//! radians, `inf` where a sonar heard nothing.

use std::{
    f64::consts::{PI, TAU},
    fs::File,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use common::kinematics::Pose2;
use glam::DVec2;
use thiserror::Error;

/// Sonars of a sample.
pub const SONARS: usize = 8;
/// Where z0 to z7 look, degrees counter-clockwise from the robot's axis.
pub const BEARINGS_DEG: [f64; SONARS] = [-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0];

const HEADER: &str = "t_s,x_m,y_m,theta_rad,z0_m,z1_m,z2_m,z3_m,z4_m,z5_m,z6_m,z7_m";
/// A longer file is no log of a mission.
const MAX_BYTES: u64 = 16 << 20;
/// A robot that is farther away than this did not drive there, metres.
const FARTHEST_M: f64 = 200.0;

/// What was logged at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogSample {
    /// Seconds.
    pub time_s: f64,
    /// By odometry, in the frame of the log: metres, radians counter-clockwise, not wrapped.
    pub pose: Pose2,
    /// What each sonar gave, metres; none for nothing.
    pub ranges_m: [Option<f64>; SONARS],
}

/// Why a log cannot be read.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file.
    #[error("cannot read {}: {source}; give a file that is there", file.display())]
    Unreadable {
        /// Which.
        file: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// What is in it.
    #[error("{}:{line}: {problem}; {remedy}", file.display())]
    Malformed {
        /// Which.
        file: PathBuf,
        /// The line, from 1 on.
        line: usize,
        /// What is wrong.
        problem: String,
        /// What would be right.
        remedy: &'static str,
    },
}

/// The samples in `file`, one or more, in order of time.
///
/// # Errors
/// When it cannot be read or a line is no sample.
pub fn read(file: &Path) -> Result<Vec<LogSample>, LogError> {
    let mut text = String::new();
    let opened = File::open(file).and_then(|it| it.take(MAX_BYTES + 1).read_to_string(&mut text));
    match opened {
        Ok(read) if read as u64 > MAX_BYTES => Err(io::Error::other("it is over 16 MiB")),
        Ok(_) => Ok(()),
        Err(source) => Err(source),
    }
    .map_err(|source| LogError::Unreadable {
        file: file.to_path_buf(),
        source,
    })?;
    parse(&text).map_err(|(line, problem, remedy)| LogError::Malformed {
        file: file.to_path_buf(),
        line,
        problem,
        remedy,
    })
}

/// A line, what is wrong with it, the remedy.
type Objection = (usize, String, &'static str);

fn parse(text: &str) -> Result<Vec<LogSample>, Objection> {
    let mut lines = (1..).zip(text.lines());
    if lines.next().map(|(_, line)| line.trim()) != Some(HEADER) {
        let remedy = "the first line must be t_s,x_m,y_m,theta_rad,z0_m,...,z7_m";
        return Err((1, "not the head of a sonar log".to_owned(), remedy));
    }
    let mut samples: Vec<LogSample> = Vec::new();
    for (number, line) in lines {
        let objection = |problem: String, remedy| (number, problem, remedy);
        let mut sample = sample(line).map_err(|(problem, remedy)| objection(problem, remedy))?;
        if let Some(last) = samples.last() {
            if sample.time_s < last.time_s {
                let problem = format!("{} s comes after {} s", sample.time_s, last.time_s);
                return Err(objection(problem, "sort the lines by time"));
            }
            let turn = sample.pose.heading - last.pose.heading;
            sample.pose.heading = last.pose.heading + (turn + PI).rem_euclid(TAU) - PI;
        }
        samples.push(sample);
    }
    if samples.is_empty() {
        return Err((1, "no sample follows".to_owned(), "give a log with samples"));
    }
    Ok(samples)
}

fn sample(line: &str) -> Result<LogSample, (String, &'static str)> {
    let mut values = [0.0_f64; 4 + SONARS];
    let mut fields = line.split(',');
    for value in &mut values {
        let field = fields.next().unwrap_or_default().trim();
        *value = field.parse().map_err(|_| {
            let shown: String = field.chars().take(20).collect();
            (
                format!("{shown:?} is no number"),
                "give twelve numbers, with commas",
            )
        })?;
    }
    if fields.next().is_some() {
        return Err((
            "more than twelve values".to_owned(),
            "give twelve numbers, with commas",
        ));
    }
    let [time_s, x, y, heading, ranges @ ..] = values;
    let near = |value: f64| value.abs() <= FARTHEST_M;
    if !(time_s.is_finite() && near(x) && near(y) && heading.is_finite()) {
        let remedy = "give seconds, a place within 200 m of the origin, and radians";
        return Err((format!("no robot is at {x}, {y}, {heading}"), remedy));
    }
    if let Some(range) = ranges.iter().find(|range| range.is_nan() || **range < 0.0) {
        return Err((format!("{range} m is no range"), "give 0 or more, or inf"));
    }
    Ok(LogSample {
        time_s,
        pose: Pose2 {
            position: DVec2::new(x, y),
            heading,
        },
        ranges_m: ranges.map(|range| range.is_finite().then_some(range)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_read_with_headings_that_do_not_jump() {
        let text =
            format!("{HEADER}\n0,0,0,6.2,inf,1,1,1,1,1,1,2\n1,0.5,0,0.1,inf,1,1,1,1,1,1,2\n");
        let samples = parse(&text).unwrap();
        assert_eq!(samples.len(), 2);
        assert_eq!(samples[0].ranges_m[0], None);
        assert_eq!(samples[0].ranges_m[7], Some(2.0));
        let turn = samples[1].pose.heading - samples[0].pose.heading;
        assert!((turn - (0.1 + TAU - 6.2)).abs() < 1e-9, "{turn}");
    }

    #[test]
    fn what_is_no_log_is_refused_with_its_line() {
        let good = "0,0,0,0,1,1,1,1,1,1,1,1";
        for (line, text) in [
            (1, String::new()),
            (1, "t,x\n".to_owned()),
            (1, HEADER.to_owned()),
            (2, format!("{HEADER}\n1,2,3\n")),
            (2, format!("{HEADER}\n{good},1\n")),
            (
                3,
                format!("{HEADER}\n{good}\n{}\n", good.replace("1,1", "x,1")),
            ),
            (
                2,
                format!("{HEADER}\n{}\n", good.replacen("0,0,0", "0,1e300,0", 1)),
            ),
            (2, format!("{HEADER}\n{}\n", good.replace("1,1", "NaN,1"))),
            (2, format!("{HEADER}\n{}\n", good.replace("1,1", "-1,1"))),
            (3, format!("{HEADER}\n5,0,0,0,1,1,1,1,1,1,1,1\n{good}\n")),
        ] {
            assert_eq!(parse(&text).unwrap_err().0, line, "{text}");
        }
    }
}
