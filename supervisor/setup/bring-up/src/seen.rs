//! What a robot says of itself while it stands, and the mission file that follows. Pure.
//!
//! The robot is only asked for reports: no order releases its brake or moves it. Its answers may be
//! hostile, so stored data are limited, and the mission is validated like any other.

use std::collections::BTreeSet;

use common::{
    driver::Base,
    json_wire::{Lines, Report, Scan, parse},
    mission::{Mission, MissionError, Protocol},
    samples::RangeStatus,
};
use link::drivers;

/// Maximum stored sensors; no mission with so many is valid.
const MOST: usize = 33;
/// Maximum letters of a printed refusal.
const MOST_TOLD: usize = 200;

#[derive(Debug)]
pub struct Seen {
    protocol: Protocol,
    /// Mission of a robot that says nothing.
    pub mission: Mission,
    driver: Box<dyn Base>,
    lines: Lines,
    /// Newest reading of each sensor, under its JSON name.
    report: Report,
    /// JSON words received, or X80 sensors with a reading.
    words: BTreeSet<String>,
    /// Number of motion reports, and times of the first and the last, seconds.
    ticks: (u32, [f64; 2]),
    /// Reason why the newest line is not of the protocol.
    pub refused: String,
}

impl Seen {
    /// # Errors
    /// None: the mission that it begins with is valid.
    pub fn new(protocol: Protocol) -> Result<Self, MissionError> {
        let mut mission = Mission::parse("target = [2, 0]\nrobot.rate_hz = 10", "")?;
        mission.robot.protocol = Some(protocol);
        let driver = drivers::base(&mission).0;
        let (lines, report, words, ticks, refused) = Default::default();
        Ok(Self { protocol, mission, driver, lines, report, words, ticks, refused })
    }

    /// Returns the request for a report. After the first motion report it is empty, which shows the
    /// robot's own rate.
    pub fn ask(&mut self) -> Vec<u8> {
        match self.protocol {
            _ if self.ticks.0 > 0 => Vec::new(),
            Protocol::Arduino => self.driver.poll(),
            Protocol::X80 => self.driver.ask_for_sensors(),
            _ => self.driver.ping(),
        }
    }

    pub fn is_known(&self) -> bool {
        self.ticks.0 > 0 || !self.words.is_empty()
    }

    pub fn hear(&mut self, bytes: &[u8], at_s: f64) {
        if self.protocol == Protocol::Json {
            for line in self.lines.push(bytes) {
                match parse(&line) {
                    Ok(report) => self.take(report, at_s),
                    Err(why) => {
                        let plain = why.chars().filter(|letter| !letter.is_control());
                        self.refused = plain.take(MOST_TOLD).collect();
                    }
                }
            }
            return;
        }
        let heard = self.driver.hear(bytes);
        let table = self.mission.sensor_table();
        let read = heard.readings.iter().filter(|it| it.status() != RangeStatus::Invalid);
        self.words.extend(read.map(|it| table[usize::from(it.sensor)].name.clone()));
        if heard.motion.is_some() {
            self.tick(at_s);
        }
    }

    fn tick(&mut self, at_s: f64) {
        let (count, [first_s, _]) = self.ticks;
        self.ticks = (count + 1, [if count == 0 { at_s } else { first_s }, at_s]);
    }

    fn take(&mut self, mut report: Report, at_s: f64) {
        if let Ok(serde_json::Value::Object(words)) = serde_json::to_value(&report) {
            self.words.extend(words.into_iter().map(|(word, _)| word));
        }
        if report.speeds.is_some() {
            self.tick(at_s);
        }
        if let Some(ranges) = report.scan {
            report.scans.insert("laser".to_owned(), Scan { ranges, ..Scan::default() });
        }
        self.report.battery_v = report.battery_v.or(self.report.battery_v);
        let kept = &mut self.report;
        if kept.ranges.len() + kept.scans.len() + kept.touched.len() < MOST {
            kept.ranges.extend(report.ranges);
            kept.scans.extend(report.scans);
            kept.touched.extend(report.touched);
        }
    }

    /// Returns a mission for the robot at `address`. Lines that begin with `# -` list the readings.
    pub fn mission_at(&self, address: &str) -> String {
        let Report { ranges, scans, touched, battery_v, .. } = &self.report;
        let (count, [first_s, last_s]) = self.ticks;
        let ticks_hz = f64::from(count.saturating_sub(1)) / (last_s - first_s).max(0.1);
        let (name, keys) = match self.protocol {
            Protocol::X80 => (
                "x80",
                "model = \"x80\"                    # or \"x80sv\", whose encoders differ\n# wheel_radius_m = 0.085         # MEASURE these, and remove the first #\n# track_m = 0.26                 # between the middles of the wheels\n# radius_m = 0.19                # of the disc that covers the body\n# counts_per_turn = 1200         # of a wheel\n".to_owned(),
            ),
            Protocol::Json => (
                "json",
                format!("counts_per_turn = 3600.0         # angles are rounded to 0.1 degrees; nothing to measure\n{SIZES}"),
            ),
            Protocol::Arduino => (
                "arduino",
                format!("counts_per_turn = 1200.0         # MEASURE: encoder counts of a turn of a wheel\n{SIZES}\n[robot.arduino]\nsonars = {{ front = 4 }}           # MEASURE: the pin of each sonar, by the name of its row\n\n[[robot.sensor]]\nname = \"front\"\nkind = \"cone\"\n{PLACE}"),
            ),
            Protocol::Ros2 => (
                "ros2",
                format!("counts_per_turn = 3600.0         # odometry is rounded to 0.1 degrees of a wheel; nothing to measure\n{SIZES}\n[[robot.sensor]]                 # MEASURE all of its row\nname = \"scan\"\nkind = \"scan\"\nforward_m = 0.0\nbearing_deg = 0.0\nfield_of_view_deg = 360\nbeams = 360\nreach_m = 8.0\n"),
            ),
        };
        // A robot that only answers is asked ten times a second.
        let rate_hz = if (5.0..=50.0).contains(&ticks_hz) { ticks_hz.round() } else { 10.0 };
        let gyro = if self.words.contains("gyro") { "gyro = true\n" } else { "" };
        let battery = battery_v.map_or(String::new(), |volts| {
            format!("# - battery: {volts:.1} V; robot.low_battery_v, by default 6.6, says when it is low\n")
        });
        let unasked = match self.protocol {
            Protocol::Ros2 => {
                "ROS 2; MEASURE on the robot: `echo $ROS_DOMAIN_ID` is the number in address (nothing: 0), `ros2 topic hz /odom` and `/scan` are rate_hz here and in the sensor's row"
            }
            _ => {
                "an RPLIDAR with its own serial line; `firsthand help arduino-robot` has its row; MEASURE its scan rate with `firsthand topic hz scan`, the row's rate_hz"
            }
        };
        let words = &self.words;
        let mut text = format!(
            "# Written by `firsthand init`. MEASURE and PLACEHOLDER mark what the robot at {address:?} cannot say: correct these lines.\n# - protocol: {name}\n# - reports of motion: {ticks_hz:.1} a second (0: only when it is asked)\n# - words or sensors that were heard: {words:?}\n# - not asked: {unasked}\n{battery}target = [2.0, 0.0]              # PLACEHOLDER: metres ahead of where it starts, and to its left\ncontroller.speed_m_s = 0.25\n\n[perimeter]                      # PLACEHOLDER: the square that it does not leave\nwidth_m = 6.0\ncentre = [1.0, 0.0]\n\n[robot]\nprotocol = \"{name}\"\naddress = {address:?}\nrate_hz = {rate_hz:.1}                   # reports a second\n{gyro}{keys}"
        );
        let mut row = |of: &str, name: &str, keys: &str| {
            text += &format!("\n[[robot.{of}]]\nname = {name:?}\n{keys}");
        };
        for name in ranges.keys() {
            row(
                "sensor",
                name,
                &format!(
                    "kind = \"cone\"                    # a sonar; \"ray\" is an infrared ranger\n{PLACE}"
                ),
            );
        }
        for (name, scan) in scans {
            row(
                "sensor",
                name,
                &format!(
                    "kind = \"scan\"                    # a laser, by this number of beams\nbeams = {}\nfield_of_view_deg = 360.0        # MEASURE: the first beam of a whole turn looks back\nreach_m = 8.0                    # MEASURE: its data sheet states it\n{PLACE}",
                    scan.ranges.len()
                ),
            );
        }
        for name in touched.keys() {
            row(
                "touch",
                name,
                "kind = \"bumper\"                  # or \"cliff\"\nbearing_deg = 0.0                # MEASURE: positive to the left\n",
            );
        }
        text
    }
}

const SIZES: &str = "wheel_radius_m = 0.033           # MEASURE\ntrack_m = 0.16                   # MEASURE: between the middles of the wheels\nradius_m = 0.12                  # MEASURE: of the disc that covers the body\ntop_speed_m_s = 0.3              # MEASURE\n";
const PLACE: &str = "forward_m = 0.1                  # MEASURE: from the middle between the wheels, along its bearing\nbearing_deg = 0.0                # MEASURE: 0 looks ahead, positive to the left\n";

#[cfg(test)]
mod tests;
