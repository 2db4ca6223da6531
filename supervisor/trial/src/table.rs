//! Tables of wheels and ranges: CSV with a header.
//!
//! The columns are `time_s`, the robot's pose `x_m`, `y_m`, `heading_rad` or its wheels' angles
//! `left_rad`, `right_rad`, and ranges counter-clockwise in metres, whose names begin with `range`.
//! An empty range means no echo; a row without ranges is no scan.

use common::{kinematics::Pose2, mission::Mission};

use crate::carmen::{Reading, pose};

const TIME: &str = "time_s";
const POSE: [&str; 3] = ["x_m", "y_m", "heading_rad"];
const WHEELS: [&str; 2] = ["left_rad", "right_rad"];

pub(crate) struct Table {
    time: usize,
    wheels: Wheels,
    ranges: Vec<usize>,
}

enum Wheels {
    Pose([usize; 3]),
    Angles {
        columns: [usize; 2],
        newest: Option<[f64; 2]>,
        /// Metres.
        radius: f64,
        track: f64,
    },
}

pub(crate) fn is_header(line: &str) -> bool {
    line.split(',').any(|name| name.trim() == TIME)
}

impl Table {
    pub(crate) fn new(header: &str, robot: Option<&str>) -> Result<Self, String> {
        let names: Vec<_> = header.split(',').map(str::trim).collect();
        let column = |name: &str| names.iter().position(|it| *it == name);
        let wheels = if let [Some(x), Some(y), Some(heading)] = POSE.map(column) {
            Wheels::Pose([x, y, heading])
        } else if let [Some(left), Some(right)] = WHEELS.map(column) {
            let robot = robot.ok_or(
                "wheel angles need sizes; give --robot with robot.wheel_radius_m and robot.track_m",
            )?;
            let mission = Mission::parse(&format!("target = [0, 0]\n{robot}"), "robot");
            let body = mission.map_err(|error| error.to_string())?.body();
            let (radius, track) = (body.wheel_radius_m, body.track_m);
            Wheels::Angles { columns: [left, right], newest: None, radius, track }
        } else {
            return Err(format!("give columns {} or {}", POSE.join(", "), WHEELS.join(", ")));
        };
        let time = column(TIME).ok_or("give a column time_s")?;
        let is_range = |it: &usize| names[*it].starts_with("range");
        Ok(Self { time, wheels, ranges: (0..names.len()).filter(is_range).collect() })
    }

    pub(crate) fn take(&mut self, line: &str, log: &mut Reading) -> Option<()> {
        let words: Vec<_> = line.split(',').map(str::trim).collect();
        let number = |column: usize| -> Option<f64> {
            words.get(column)?.parse().ok().filter(|it: &f64| it.abs() <= 1e12)
        };
        let odometry = match &mut self.wheels {
            Wheels::Pose([x, y, heading]) => pose([number(*x)?, number(*y)?, number(*heading)?]),
            Wheels::Angles { columns: [left, right], newest, radius, track } => {
                let angles = [number(*left)?, number(*right)?];
                let before = newest.replace(angles).unwrap_or(angles);
                let [left, right] = [0, 1].map(|it| *radius * (angles[it] - before[it]));
                let last = log.last.unwrap_or_default();
                last.along_arc(f64::midpoint(left, right), (right - left) / *track)
            }
        };
        log.odometry(odometry, number(self.time)?);
        let range = |column: &usize| match *words.get(*column)? {
            "" => Some(f32::INFINITY),
            word => word.parse().ok(),
        };
        let ranges = self.ranges.iter().map(range).collect::<Option<Vec<f32>>>()?;
        if ranges.iter().any(|range| range.is_finite()) {
            log.scan(ranges, Pose2::default())?;
        }
        Some(())
    }
}
