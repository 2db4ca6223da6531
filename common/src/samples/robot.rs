//! Payloads of the link: the robot's sensors and the link's own state.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    bus::{Field, Kind, Layout as _, Value, ZeroCopySend},
    latency,
    mission::{INFRARED_RANGERS, Sensor, wire_enum},
};

wire_enum! {
    RangeStatus, unknown = Absent {
        /// No frame with it since the last tick: the map stays unchanged.
        Absent = 0,
        Measured = 1,
        /// No echo, or a ray without end.
        Nothing = 2,
        /// Sonar range of 4 cm or less.
        AtContact = 3,
        /// Sonar range of 0, or the voltage of a dead or saturated infrared ranger.
        Invalid = 4,
    }
}

payloads! {
    /// Ranges; the slice has one [`RangeReading`] per sensor of the mission.
    "firsthand.RangesHeader" RangesHeader {}
}

structs! {
    #[derive(Serialize, Deserialize)]
    "firsthand.RangeReading" RangeReading {
        /// S of (19): metres from the sensor if measured, else 0.
        range_m: f64,
        /// Raw value: centimetres of a sonar, AD counts of an infrared ranger; 0 if absent.
        raw: u16,
        /// Row of [`crate::mission::Mission::sensor_table`].
        sensor: u8,
        /// A [`RangeStatus`].
        status: u8 as RangeStatus,
    }
}

payloads! {
    /// Laser scan; the slice holds ranges counter-clockwise, metres: infinite if nothing is in
    /// reach, NaN for a missing reading.
    "firsthand.ScanHeader" ScanHeader {
        /// Row of [`crate::mission::Mission::sensor_table`].
        sensor: u64,
        /// Position of the laser, metres ahead of and to the left of the robot's centre.
        x_m: f64,
        y_m: f64,
        /// Bearing of the first beam from the robot's axis, radians.
        first_rad: f64,
        step_rad: f64,
        reach_m: f64,
        /// Time of the first measured beam relative to the tick; negative before it.
        first_beam_ns: i64,
        /// Time between adjacent beams counter-clockwise; negative for a laser that turns
        /// clockwise.
        beam_ns: i64,
        /// Beam that was measured first.
        first_beam: u64,
    }
}

/// Longest age and duration of a scan, nanoseconds. Dead reckoning cannot use older ones.
pub const LONGEST_SWEEP_NS: i64 = 2_000_000_000;

/// Measurement times of a scan's beams relative to a tick: see [`ScanHeader`]. By default all are
/// at the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sweep {
    pub first_beam_ns: i64,
    pub beam_ns: i64,
    pub first_beam: u64,
}

impl Sweep {
    /// Returns whether dead reckoning still knows the motion at these times. The numbers from
    /// shared memory are untrusted.
    pub fn is_plausible(&self, beams: usize) -> bool {
        let most = LONGEST_SWEEP_NS.unsigned_abs();
        self.first_beam_ns.unsigned_abs() <= most
            && self.beam_ns.unsigned_abs().saturating_mul(beams as u64) <= most
            && (self.first_beam == 0 || self.first_beam < beams as u64)
    }

    /// Returns the time of a beam among `beams` in a plausible sweep, relative to the tick.
    pub const fn beam_time_ns(&self, beam: usize, beams: usize) -> i64 {
        let first = self.first_beam as usize;
        let beams = if beams == 0 { 1 } else { beams };
        let before = if self.beam_ns < 0 {
            (first + beams - beam) % beams
        } else {
            (beam + beams - first) % beams
        };
        self.first_beam_ns + self.beam_ns.abs() * before as i64
    }

    pub const fn middle_ns(&self, beams: usize) -> i64 {
        self.first_beam_ns + self.beam_ns.abs() * beams as i64 / 2
    }
}

impl DoubtsSample {
    /// Returns each doubt's name, meaning and evidence.
    pub fn each(&self) -> Vec<(&'static str, &'static str, f64)> {
        let (Kind::Struct(structure), Value::Struct(values)) = (Self::kind(), self.value()) else {
            return Vec::new();
        };
        let doubt = |(field, (name, value)): (Field, _)| match value {
            Value::Double(evidence) => Some((name, field.doc.trim(), evidence)),
            _ => None,
        };
        structure.fields.into_iter().zip(values).filter_map(doubt).collect()
    }
}

impl ScanHeader {
    pub const fn sweep(&self) -> Sweep {
        let Self { first_beam_ns, beam_ns, first_beam, .. } = *self;
        Sweep { first_beam_ns, beam_ns, first_beam }
    }

    pub const fn swept(self, sweep: Sweep) -> Self {
        let Sweep { first_beam_ns, beam_ns, first_beam } = sweep;
        Self { first_beam_ns, beam_ns, first_beam, ..self }
    }

    pub fn of(row: usize, sensor: &Sensor) -> Self {
        let at = sensor.mount.forward_m * DVec2::from_angle(sensor.mount.bearing_rad);
        let (first, step_rad) = sensor.fan();
        Self {
            sensor: row as u64,
            x_m: at.x,
            y_m: at.y,
            first_rad: sensor.mount.looks_rad() + first,
            step_rad,
            reach_m: sensor.reach_m,
            ..Self::default()
        }
    }
}

payloads! {
    /// Wheel counts. A car has the driven wheel's encoder at the left, the steering's at the right:
    /// 0 straight ahead, growing to the left.
    "firsthand.Wheels" WheelSample {
        /// Counts modulo 32768, growing forward.
        left_counts: u16,
        right_counts: u16,
        /// Counts per second, forward positive.
        left_counts_per_s: i32,
        right_counts_per_s: i32,
        /// Restarts of the robot's counts noticed by this link process. The step from a lower
        /// number is no motion.
        restarts: u32,
        /// Counted share of the commanded distance, right wheel over left, and its standard
        /// deviation; 1 and 0 if unknown and for a car.
        told_ratio: f64 = 1.0,
        told_ratio_sd: f64,
        /// Travel, left and right, that the counts or the commands and ranges alone show, metres
        /// since the start of the link process.
        untold_m: [f64; 2],
    }

    /// Evidence of the link against a healthy robot. At 1 the robot stands.
    "firsthand.Doubts" DoubtsSample {
        /// The left wheel does not follow its commands
        left_wheel: f64,
        /// The right wheel does not follow its commands
        right_wheel: f64,
        /// The robot does not turn as commanded
        turn: f64,
        /// The wheels turn without a command
        uncommanded: f64,
        /// Counts jump farther than wheels can turn
        jumps: f64,
        /// By its ranges, the robot rolls another distance than its wheels count
        miscounted: f64,
        /// Readings of sonars and infrared rangers are later than stated
        late_ranges: f64,
        /// Scans are later than stated
        late_scans: f64,
        /// Scans do not change although the wheels turn
        frozen_scans: f64,
        /// Scans show another scale than the wheels
        scaled_scans: f64,
        /// A reading stays although the robot moves
        stuck: f64,
        /// Readings do not follow from one another
        inconsistent: f64,
        /// A sensor hears nothing where a reading is due
        deaf: f64,
    }

    /// Counts of [`WheelSample`] without wraparound, whole numbers.
    #[derive(Serialize, Deserialize)]
    "firsthand.Counts" CountsSample {
        left_counts: f64,
        right_counts: f64,
    }

    #[derive(Serialize, Deserialize)]
    "firsthand.BaseResponse" BaseResponseSample {
        /// Time from a command to its effect, including the lag, seconds.
        dead_time_s: f64,
        /// Infinite for a base that the dead time alone describes.
        acceleration_m_s2: f64,
    }

    /// Contact. Blocked wheels stand by their encoders while their motors draw a high current;
    /// otherwise a bumper or cliff sensor reported it.
    #[derive(Serialize, Deserialize)]
    "firsthand.Contact" ContactSample {
        /// Direction of the contact from the body's centre, radians counter-clockwise from the
        /// robot's axis.
        bearing_rad: f64,
        /// Half of the angle that contains it, radians; 0 if unknown, because the command was a
        /// turn on the spot.
        half_width_rad: f64,
        /// 1: blocked; also the driven wheels of a car.
        left: u8,
        right: u8,
    }
}

wire_enum! {
    /// Motion according to the encoders.
    Rest, unknown = Unknown {
        /// Their newest frames are old or unusable.
        Unknown = 0,
        AtRest = 1,
        Moving = 2,
    }
}

wire_enum! {
    /// Action of the link's failsafe, the least severe first.
    #[derive(PartialOrd, Ord)]
    Action, unknown = Stop, text = effect {
        Go = 0 "goes",
        /// Commands pass at a fraction of their speed, along the same curve.
        Slow = 1 "goes at half speed",
        /// The robot stands until the cause ends.
        Stop = 2 "stands",
        /// The robot stands until the process ends: the mission is over.
        End = 3 "stands, and the mission ends",
    }
}

impl Action {
    /// Returns the share of the commanded speed. Half speed saves current on a low battery; at
    /// lower speeds wheels begin to stick.
    pub const fn speed_share(self) -> f64 {
        match self {
            Self::Go => 1.0,
            Self::Slow => 0.5,
            Self::Stop | Self::End => 0.0,
        }
    }
}

wire_enum! {
    /// Cause of the failsafe's action; `firsthand table failsafe` explains each.
    Cause, unknown = NotOrdered, text = name {
        None = 0 "nothing is wrong",
        NotOrdered = 1 "no order to drive",
        MissionOver = 2 "mission over",
        BatteryEmpty = 3 "battery empty",
        OperatorStop = 4 "stopped by an operator",
        StageHeld = 5 "stage held",
        SupervisorSilent = 6 "supervisor silent",
        /// The robot does not answer; stops are sent in case it receives them.
        RobotLost = 7 "robot lost",
        /// No command yet, or an old one: a stage is down or slow.
        CommandStale = 8 "command stale",
        PoseStale = 9 "pose stale",
        GuidanceStale = 10 "guidance stale",
        BatteryLow = 11 "battery low",
        OdometryImplausible = 12 "odometry implausible",
        /// The encoders contradicted the commands for too long; the mission ends.
        OdometryGivenUp = 13 "odometry implausible for long",
        /// The robot moves by its encoders despite a command to stand.
        RobotDoesNotStop = 14 "robot does not obey",
        FramesSilent = 15 "motor frames missing",
        FramesSlow = 16 "motor frames too slow",
        RangeSilent = 17 "ranging sensor silent",
        RobotLate = 18 "robot late",
        WheelsHeld = 19 "wheels held",
        /// A reading stays constant while the robot moves, or the front sonar misses echoes of
        /// other sensors.
        RangeImplausible = 20 "ranging sensor implausible",
        /// An infrared ranger is silent, and the other sensors cover the ground ahead.
        InfraredSilent = 21 "infrared ranger silent",
        AnotherCommander = 22 "another commander",
        BaseSlow = 23 "base slower than stated",
        /// Its readings may be outdated: the robot drives slowly, which reveals it.
        RangeDoubtful = 24 "ranging sensor doubtful",
        /// A bumper is pressed, or a cliff sensor detects a missing floor.
        Felt = 25 "bumper or cliff sensor",
    }
}

payloads! {
    "firsthand.Link" LinkSample {
        /// 1: the robot answers.
        connected: u32,
        /// The failsafe's [`Action`].
        action: u8 as Action = Action::Stop.into(),
        /// The [`Cause`] of the action.
        cause: u8 as Cause = Cause::NotOrdered.into(),
        /// A [`Rest`]. 1: no wheel turns.
        at_rest: u8 as Rest,
        frames_in: u64,
        /// Bytes outside any frame.
        bytes_dropped: u64,
        /// Dropped datagrams from other addresses.
        foreign_datagrams: u64,
        unsent: u64,
        /// Samples of processes that the supervisor does not name.
        ignored_samples: u64,
        /// 0 for none.
        ignored_writer: u32,
        /// Another port from which the robot's host answered; 0 for none.
        other_port: u32,
        losses: u64,
        /// Restarts of the robot's counts.
        reboots: u64,
        /// Time without an answer, by the machine's clock; 0 while the robot answers.
        lost_ns: u64,
        /// Pings or connection attempts since the robot was lost.
        attempts: u64,
        /// Time until the next attempt, by the machine's clock.
        next_attempt_ns: u64,
        commands_out: u64,
        repeated_commands: u64,
        /// Ticks repeated to the stages for lack of a command.
        repeated_ticks: u64,
        /// Latency of the last tick, from the incoming to the outgoing datagram.
        latency_ns: u64,
        /// Longest latency in this link process.
        latency_max_ns: u64,
        /// A [`crate::latency::Histogram`] of this process: bucket k counts latencies from 2^(k/8)
        /// microseconds.
        latency_histogram: [u32; latency::BUCKETS],
    }
}

impl LinkSample {
    pub fn stopped(&self) -> bool {
        self.action() >= Action::Stop
    }
}

payloads! {
    /// Infrared ranges in the order of the rangers' channels.
    "firsthand.Infrared" InfraredSample {
        /// Metres from each ranger, 0.09 to 0.81; 0.81 may also mean nothing in reach.
        range_m: [f64; INFRARED_RANGERS],
        raw_ad: [u16; INFRARED_RANGERS],
    }

    "firsthand.Power" PowerSample {
        board_v: f64,
        motor_v: f64,
        servo_v: f64,
        /// Temperatures of the two motor drivers, degrees Celsius by the vendor's formula.
        driver_c: [f64; 2],
        /// Motor currents of the six channels, AD counts; no source gives the scale in amperes.
        current_ad: [u16; 6],
        /// 1: low by the mission's `robot.low_battery_v`.
        board_low: u8,
        motor_low: u8,
        servo_low: u8,
    }
}

impl PowerSample {
    pub const fn is_low(&self) -> bool {
        self.board_low == 1 || self.motor_low == 1 || self.servo_low == 1
    }
}

payloads! {
    "firsthand.Surroundings" SurroundingsSample {
        /// Board temperature, degrees Celsius by the vendor's formula.
        temperature_c: f64,
        /// Presence, AD counts.
        human_alarm_ad: [u16; 2],
        /// Motion, AD counts around the middle of the scale.
        human_motion_ad: [u16; 2],
        tilt_ad: [u16; 2],
    }
}

wire_enum! {
    Direction, unknown = Received {
        Received = 0,
        Sent = 1,
    }
}

payloads! {
    /// Wire traffic; the slice holds the bytes of one datagram, or of one read from a connection or
    /// serial line.
    "firsthand.WireHeader" WireHeader {
        /// Machine's monotonic clock in the step that received or sent the bytes.
        machine_ns: u64,
        /// A [`Direction`].
        direction: u8,
    }
}
