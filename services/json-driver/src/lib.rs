//! Driver of robots that speak JSON lines ([`common::json_wire`]).

#[cfg(test)]
mod gyro_tests;

use std::{collections::BTreeMap, time::Duration};

use common::{
    driver::{
        Base, Driver, Heard, LaserScan, Motion, Refusal, StopMethod, Turn, WireTally, beam, gyro,
        odometry::{Odometry, motion, twist, wheel_speeds},
        range_reading,
    },
    json_wire::{Lines, Order, Report, Scan, line, parse},
    kinematics::Twist,
    mission::{Body, Mission, Sensor, TouchRow},
    samples::{LONGEST_SWEEP_NS, RangeReading, Sweep},
};

/// Largest plausible clock, seconds either way: twice the time since 1970.
const MOST_CLOCK_S: f64 = 4e9;
/// Orders that one report may acknowledge.
const MOST_ANSWERED: usize = 64;

#[derive(Debug)]
pub struct Json {
    body: Body,
    rate_hz: f64,
    lines: Lines,
    table: Vec<Sensor>,
    lasers: Vec<(usize, Sensor)>,
    touches: Vec<TouchRow>,
    answered: Option<u64>,
    /// Earlier count, if the newest line counts less: an old line, or a restarted robot, as the
    /// next line tells.
    fell_from: Option<u64>,
    odometry: Odometry,
    gyro: gyro::Angle,
    tally: WireTally,
}

impl Json {
    pub fn new(mission: &Mission) -> Self {
        Self {
            lasers: mission.lasers_of_base(),
            touches: mission.touches(),
            body: mission.body(),
            rate_hz: mission.robot.rate_hz,
            lines: Lines::default(),
            table: mission.sensor_table(),
            answered: None,
            fell_from: None,
            odometry: Odometry::default(),
            gyro: gyro::Angle::default(),
            tally: WireTally::default(),
        }
    }

    /// Takes a report, or refuses it without effect; the error says why.
    fn take(&mut self, report: &Report, heard: &mut Heard) -> Result<(), Refusal> {
        let readings = self.readings_of(&report.ranges)?;
        if report.clock_s.is_some_and(|clock| clock.abs() > MOST_CLOCK_S) {
            return Err("clock_s is out of range; send seconds".into());
        }
        let stamp_ns = report.clock_s.map(|clock| (clock * 1e9).round() as i64);
        let mut scans = self.scans_of(report)?;
        for scan in &mut scans {
            scan.stamp_ns = stamp_ns.map(|stamp_ns| stamp_ns + scan.sweep.first_beam_ns);
        }
        let touched = report.touched.iter().map(|(name, feels)| {
            let names = self.touches.iter().map(|row| &row.name);
            Ok((row_of(["touched", name], "row of robot.touch", names)?, *feels))
        });
        let touched = touched.collect::<Result<Vec<_>, Refusal>>()?;
        let turned = match (report.wheels, report.odometry) {
            (Some(_), Some(_)) => {
                return Err("wheels and odometry are both given; send one of them".into());
            }
            (Some(turned), None) => Some(turned),
            (None, Some(odometry)) => {
                let turned = self.odometry.turned(odometry, &self.body);
                Some(turned.ok_or("odometry is out of range; send metres and radians")?)
            }
            (None, None) => None,
        };
        if turned.is_some() && report.speeds.is_none() {
            return Err("wheels or odometry lack speeds; send both".into());
        }
        if report.gyro.is_some() && turned.is_none() {
            return Err("gyro lacks wheels or odometry; send both".into());
        }
        heard.readings.extend(readings);
        if let (Some(turned), Some(speeds)) = (turned, report.speeds) {
            let why = self.gyro.take(report.gyro, turned, &self.body, 1e9 / self.rate_hz);
            heard.refused = why.map(Refusal::from).or(heard.refused.take());
            let held = report.held.unwrap_or_default();
            heard.motion = Some(Motion { stamp_ns, ..motion(&self.body, turned, speeds, held) });
            heard.stamp_ns = stamp_ns.or(heard.stamp_ns);
        }
        heard.scans.extend(scans);
        heard.touched.extend(touched);
        if let Some(count) = report.heard {
            let before = self.answered.replace(count).unwrap_or(count);
            if count < before {
                self.fell_from.get_or_insert(before);
            } else {
                heard.restarted |= self.fell_from.take().is_some_and(|highest| count < highest);
            }
            let answered = count.saturating_sub(before);
            let answered = heard.acknowledged.saturating_add(answered as usize);
            heard.acknowledged = answered.min(MOST_ANSWERED);
        }
        if let Some(volts) = report.battery_v {
            heard.take_battery(volts);
        }
        Ok(())
    }

    fn readings_of(
        &self,
        ranges: &BTreeMap<String, Option<f64>>,
    ) -> Result<Vec<RangeReading>, Refusal> {
        let reading = |(name, range): (&String, &Option<f64>)| {
            let names = self.table.iter().map(|sensor| &sensor.name);
            let row = row_of(["ranges", name], "row of robot.sensor", names)?;
            Ok(range_reading(row, &self.table[row], *range))
        };
        ranges.iter().map(reading).collect()
    }

    fn scans_of(&self, report: &Report) -> Result<Vec<LaserScan>, Refusal> {
        let only = report.scan.as_ref().map(|beams| {
            let [laser] = &self.lasers[..] else {
                return Err(format!(
                    "a scan came without a name, and the mission has {} lasers; add a row of kind scan, or send scans by the names of rows",
                    self.lasers.len()
                )
                .into());
            };
            scan_of(laser, beams, [report.scan_age_s, report.scan_time_s])
        });
        let named = report.scans.iter().map(|(name, Scan { ranges, age_s, time_s })| {
            let names = self.lasers.iter().map(|(_, sensor)| &sensor.name);
            let laser = &self.lasers[row_of(["scans", name], "laser", names)?];
            scan_of(laser, ranges, [*age_s, *time_s])
        });
        only.into_iter().chain(named).collect()
    }
}

/// Returns the place of a reported name among `names`, those of the mission's `kind`.
fn row_of<'a>(
    [key, name]: [&str; 2],
    kind: &str,
    names: impl Iterator<Item = &'a String> + Clone,
) -> Result<usize, Refusal> {
    names.clone().position(|known| known == name).ok_or_else(|| Refusal {
        input: format!("{key}.{name}"),
        what: format!("no {kind} is named {name:?}"),
        remedy: format!("send one of the names {:?}, or rename a row", names.collect::<Vec<_>>()),
    })
}

fn scan_of(
    (row, sensor): &(usize, Sensor),
    beams: &[Option<f32>],
    [age_s, time_s]: [Option<f64>; 2],
) -> Result<LaserScan, Refusal> {
    if beams.len() != sensor.beams {
        let came = beams.len();
        let name = &sensor.name;
        let want = sensor.beams;
        return Err(Refusal {
            input: "scan".to_owned(),
            what: format!("the scan has {came} beams, and {name:?} has {want}"),
            remedy: format!("send {want}, or set beams = {came} in its row of robot.sensor"),
        });
    }
    let nanoseconds = |word: &str, seconds: Option<f64>| {
        let ns = seconds.unwrap_or_default() * 1e9;
        if (0.0..=LONGEST_SWEEP_NS as f64).contains(&ns) {
            Ok(ns.round() as i64)
        } else {
            Err(format!("the {word} of a scan is outside 0 to 2 s; send seconds"))
        }
    };
    let beam_ns = nanoseconds("time", time_s)? / beams.len().max(1) as i64;
    // An upside-down laser first measures another beam than its row's first, and in reverse.
    let sweep = Sweep {
        first_beam_ns: -nanoseconds("age", age_s)?,
        beam_ns: if sensor.is_upside_down { -beam_ns } else { beam_ns },
        first_beam: sensor.mirrored(0) as u64,
    };
    let mut beams: Vec<_> = beams.iter().map(|range| beam(sensor, *range)).collect();
    sensor.mirror(&mut beams);
    Ok(LaserScan { row: *row, beams, sweep, stamp_ns: None })
}

impl Driver for Json {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        let mut heard = Heard::default();
        for line in self.lines.push(bytes) {
            let report = parse(&line).map_err(|why: String| Refusal::from(why));
            let taken = report.and_then(|report| self.take(&report, &mut heard));
            heard.anything |= self.tally.count(&line, taken, &mut heard);
        }
        heard
    }

    fn reset(&mut self) {
        self.lines.reset();
    }

    fn tally(&self) -> WireTally {
        self.tally.with_dropped(self.lines.dropped())
    }

    fn greeting(&self) -> Vec<u8> {
        line(&Order::Hello { rate_hz: self.rate_hz })
    }
}

impl Base for Json {
    fn ask_for_sensors(&self) -> Vec<u8> {
        self.greeting()
    }

    fn ping(&self) -> Vec<u8> {
        line(&Order::Ping {})
    }

    fn owed(&self, sent: &[u8]) -> usize {
        sent.iter().filter(|byte| **byte == b'\n').count()
    }

    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8> {
        let wheels = wheel_speeds(&self.body, counts);
        let Twist { v, omega } = twist(&self.body, counts);
        line(&Order::Drive { wheels, twist: [v, omega], for_s: limit.as_secs_f64() })
    }

    fn turn_for_tick(&mut self) -> Option<Turn> {
        self.gyro.for_tick(self.rate_hz)
    }

    fn odometry(&mut self) -> Option<&mut Odometry> {
        Some(&mut self.odometry)
    }

    fn other_stops(&self) -> Vec<StopMethod> {
        vec![StopMethod { name: "brake", bytes: line(&Order::Brake {}) }]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use common::samples::RangeStatus;

    use super::*;

    fn driver_of(text: &str) -> Json {
        let text = format!("target = [3, 0]\n{text}");
        Json::new(&Mission::parse(&text, "m.toml").unwrap())
    }

    pub(crate) fn driver() -> Json {
        driver_of("robot.protocol = 'json'\nrobot.counts_per_turn = 3600")
    }

    fn refuses(heard: &Heard, why: &str) -> bool {
        heard.refused.as_ref().is_some_and(|refused| refused.to_string().contains(why))
    }

    fn driver_with_laser(keys: &str) -> Json {
        driver_of(&format!(
            "robot.protocol = 'json'\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\n{keys}\n"
        ))
    }

    impl Json {
        fn hears(&mut self, line: &str) -> Heard {
            self.hear(format!("{line}\n").as_bytes())
        }
    }

    #[test]
    fn the_angles_of_wheels_are_counts_and_backward_ones_count_down() {
        let said = r#"{"wheels":[6.283185307,-3.141592654],"speeds":[1,-1],"held":[false,true]}"#;
        let motion = driver().hears(said).motion.unwrap();
        assert_eq!((motion.wheels.left_counts, motion.wheels.right_counts), (3600, 32_768 - 1800));
        assert_eq!(motion.wheels.right_counts_per_s, -573);
        assert_eq!(motion.currents, [0, 4095]);
    }

    #[test]
    fn odometry_is_the_way_of_wheels_on_an_arc_too() {
        let mut driver = driver();
        let at = |driver: &mut Json, pose: &str| {
            let said = format!("{{\"odometry\":{pose},\"speeds\":[0,0]}}");
            let wheels = driver.hears(&said).motion.unwrap().wheels;
            [wheels.left_counts, wheels.right_counts]
        };
        assert_eq!(at(&mut driver, "[5,5,0]"), [0, 0]);
        // A quarter circle of 1 m to the left: the right wheel rolls (1 + W / 2) pi / 2, r = 0.085
        // m, W = 0.26 m.
        let counts = |radius: f64| (radius * 0.25 * TAU / 0.085 * 3600.0 / TAU).round() as u16;
        assert_eq!(at(&mut driver, "[6,6,1.5707963267948966]"), [counts(0.87), counts(1.13)]);
    }

    #[test]
    fn a_range_of_no_sensor_and_a_motion_without_speeds_are_refused_with_the_remedy() {
        for (said, why) in [
            (
                r#"{"ranges":{"nose":1}}"#,
                "no row of robot.sensor is named \"nose\"; send one of the names [\"front\",",
            ),
            (r#"{"wheels":[0,0]}"#, "lack speeds"),
            (r#"{"wheels":[0,0],"odometry":[0,0,0],"speeds":[0,0]}"#, "send one of them"),
            (r#"{"odometry":[1e300,0,0],"speeds":[0,0]}"#, "odometry is out of range"),
            (r#"{"wheel":[0,0]}"#, "unknown field `wheel`"),
        ] {
            let heard = driver().hears(said);
            assert!(!heard.anything && heard.motion.is_none(), "{said}");
            assert!(refuses(&heard, why), "{said}");
        }
    }

    #[test]
    fn a_refused_line_is_taken_in_no_part_and_another_keeps_the_battery_of_the_one_before() {
        let mut driver = driver();
        let half = r#"{"heard":9,"battery_v":12,"ranges":{"front":1,"nose":1}}"#;
        let refused = driver.hears(half);
        assert!(refused.readings.is_empty() && refused.power.is_none(), "{refused:?}");
        let both = driver.hears("{\"battery_v\":12}\n{\"heard\":1}");
        assert!(both.power.is_some_and(|power| power.motor_v == 12.0));
    }

    #[test]
    fn a_line_of_16384_beams_with_all_digits_is_taken_and_a_laser_upside_down_is_mirrored() {
        let mut driver = driver_with_laser("beams = 16384\nroll_deg = 180");
        let range = |beam: u16| 1.000_000_000_000_123_4 + f64::from(beam) * 1e-4;
        let beams = Vec::from_iter((0..16_384).map(|beam| range(beam).to_string()));
        let heard = driver.hears(&format!("{{\"scan\":[{}]}}", beams.join(",")));
        let scan = &heard.scans[0].beams;
        assert_eq!((scan.len(), scan[0]), (16_384, range(16_383) as f32));
    }

    #[test]
    fn null_and_what_is_beyond_reach_are_nothing_and_less_than_0_or_beyond_twice_the_reach_is_no_reading()
     {
        for (said, status) in [
            ("null", RangeStatus::Nothing),
            ("5", RangeStatus::Nothing),
            ("5.2", RangeStatus::Invalid),
            ("1e308", RangeStatus::Invalid),
            ("-1", RangeStatus::Invalid),
            ("0.5", RangeStatus::Measured),
        ] {
            let heard = driver().hears(&format!("{{\"ranges\":{{\"front\":{said}}}}}"));
            assert_eq!(heard.readings[0].status(), status, "{said}");
        }
        let mut driver = driver_with_laser("beams = 3");
        let beams = driver.hears(r#"{"scan":[null,1e308,1]}"#).scans.remove(0).beams;
        assert!(beams[0] == f32::INFINITY && beams[1].is_nan(), "{beams:?}");
    }

    #[test]
    fn a_robot_that_counts_its_orders_acknowledges_them_and_a_restarted_one_begins_again() {
        let mut driver = driver();
        let counts = [(5, 0), (8, 3), (8, 0), (2, 0), (1_000_000, 64), (u64::MAX, 64)];
        for (count, answered) in counts {
            let heard = driver.hears(&format!("{{\"heard\":{count}}}"));
            assert_eq!((heard.acknowledged, heard.restarted), (answered, false), "{count}");
        }
        let sent = [driver.greeting(), driver.velocity([1, 1], Duration::ZERO)].concat();
        assert_eq!(driver.owed(&sent), 2);
        let most = format!("{{\"heard\":0}}\n{{\"heard\":1}}\n{{\"heard\":{}}}", u64::MAX);
        let many = format!("{most}\n{most}");
        assert_eq!(driver.hears(&many).acknowledged, 64);
        // One old line is no restart.
        let mut driver = self::driver();
        for (count, restarted) in
            [(90, false), (60, false), (91, false), (0, false), (2, true), (3, false)]
        {
            let heard = driver.hears(&format!("{{\"heard\":{count}}}"));
            assert_eq!(heard.restarted, restarted, "{count}");
        }
    }

    #[test]
    fn a_scan_is_as_old_and_took_as_long_as_the_robot_says_and_neither_if_it_says_nothing() {
        let mut driver = driver_of("robot.model = 'kobuki'");
        let mut sweep = |words: &str| {
            let line = format!("{{\"scan\":[{}]{words}}}", vec!["1"; 360].join(","));
            driver.hears(&line).scans.pop().map(|scan| scan.sweep)
        };
        assert_eq!(sweep(""), Some(Sweep::default()));
        let sent = Sweep { first_beam_ns: -300_000_000, beam_ns: 500_000, first_beam: 0 };
        assert_eq!(sweep(",\"scan_age_s\":0.3,\"scan_time_s\":0.18"), Some(sent));
        for wrong in ["\"scan_age_s\":-0.1", "\"scan_time_s\":2.1", "\"scan_age_s\":200"] {
            assert_eq!(sweep(&format!(",{wrong}")), None, "{wrong}");
        }
    }

    #[test]
    fn a_robot_that_says_its_clock_has_its_wheels_and_scans_stamped_by_it_and_one_that_no_clock_says_is_refused()
     {
        let mut driver = driver_of("robot.model = 'kobuki'");
        let mut stamps = |words: &str| {
            let beams = vec!["1"; 360].join(",");
            let line = format!("{{\"wheels\":[0,0],\"speeds\":[0,0],\"scan\":[{beams}]{words}}}");
            let heard = driver.hears(&line);
            let scan = heard.scans.first()?.stamp_ns;
            Some([heard.stamp_ns, heard.motion.and_then(|motion| motion.stamp_ns), scan])
        };
        let clock = 1_500_000_000;
        let stamped = [clock, clock, clock - 300_000_000].map(Some);
        assert_eq!(stamps(",\"clock_s\":1.5,\"scan_age_s\":0.3"), Some(stamped));
        assert_eq!(stamps(",\"scan_age_s\":0.3"), Some([None; 3]));
        assert_eq!(stamps(",\"clock_s\":1e300"), None);
    }

    #[test]
    fn scans_of_several_lasers_are_told_apart_by_the_names_of_their_rows() {
        let mut driver = driver_of(
            "robot.protocol = 'json'\n\
            [[robot.sensor]]\nname = 'front'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nbeams = 3\n\
            [[robot.sensor]]\nname = 'back'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nbeams = 3\n",
        );
        let said =
            r#"{"scans":{"back":{"ranges":[1,2,3],"age_s":0.2},"front":{"ranges":[4,5,6]}}}"#;
        let scans = driver.hears(said).scans;
        let told = |scan: &LaserScan| (scan.row, scan.beams[0], scan.sweep.first_beam_ns);
        assert_eq!(Vec::from_iter(scans.iter().map(told)), [(1, 1.0, -200_000_000), (0, 4.0, 0)]);
        for (said, why) in [
            (r#"{"scan":[1,2,3]}"#, "by the names of rows"),
            (
                r#"{"scans":{"left":{"ranges":[1,2,3]}}}"#,
                "no laser is named \"left\"; send one of the names [\"front\"",
            ),
            (r#"{"scans":{"back":{"ranges":[1,2]}}}"#, "\"back\" has 3"),
        ] {
            assert!(refuses(&driver.hears(said), why), "{said}");
        }
    }

    #[test]
    fn what_bumpers_feel_is_told_by_the_names_of_their_rows() {
        let mut driver = driver_of("robot.model = 'kobuki'");
        let said = r#"{"touched":{"bumper-right":true,"cliff-left":false}}"#;
        assert_eq!(driver.hears(said).touched, [(2, true), (3, false)]);
        let refused = driver.hears(r#"{"touched":{"nose":true}}"#);
        let why = "no row of robot.touch is named \"nose\"; send one of the names [\"bump";
        assert!(refuses(&refused, why), "{refused:?}");
    }

    #[test]
    fn a_command_is_said_as_wheel_speeds_and_as_a_twist() {
        let said = driver().velocity([-573, 573], Duration::from_millis(250));
        // 2 * 0.085 m/s over 0.26 m.
        let want = "Ok(Drive { wheels: [-1.000073661, 1.000073661], twist: [0.000000000, 0.653894317], for_s: 0.250000000 })";
        assert_eq!(format!("{:.9?}", parse::<Order>(&said)), want);
    }

    #[test]
    fn the_first_beam_of_a_sweep_is_the_first_in_time_of_an_upside_down_laser_too() {
        for (wide_deg, roll_deg, first) in [(90, 0, 0), (90, 180, 3), (360, 0, 0), (360, 180, 0)] {
            let keys = format!("beams = 4\nfield_of_view_deg = {wide_deg}\nroll_deg = {roll_deg}");
            let mut driver = driver_with_laser(&keys);
            let said = r#"{"wheels":[0,0],"speeds":[0,0],"scan":[1,2,3,4],"scan_time_s":0.4}"#;
            let LaserScan { beams, sweep, .. } = driver.hears(said).scans.remove(0);
            let time = |beam| (sweep.beam_time_ns(beam, 4), beams[beam]);
            let mut measured = [0, 1, 2, 3].map(time);
            measured.sort_by_key(|(at, _)| *at);
            let measured = measured.into_iter().map(|(at, range)| (at / 1_000_000, range));
            let said = [(0, 1.0), (100, 2.0), (200, 3.0), (300, 4.0)];
            assert!(measured.eq(said), "{wide_deg} {roll_deg}: {sweep:?} {beams:?}");
            assert_eq!(sweep.first_beam, first, "{wide_deg} {roll_deg}");
        }
    }
}
