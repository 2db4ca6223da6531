//! The payloads of the link: the robot's sensors, and the state of the link itself.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    bus::{Stamp, ZeroCopySend, layouts},
    latency,
    mission::{INFRARED_RANGERS, Sensor},
};

wire_enum! {
    /// The kind of a reading.
    RangeStatus, unknown = Absent {
        /// No frame with it came since the last tick: the map stays as it is.
        Absent = 0,
        /// `range_m` holds a distance.
        Measured = 1,
        /// Nothing in range: no echo, or a ray without end.
        Nothing = 2,
        /// A sonar at 4 cm or nearer.
        AtContact = 3,
        /// No valid reading: a sonar's 0, or the voltage of an infrared ranger that is dead or saturated.
        Invalid = 4,
    }
}

payloads! {
    /// Topic `ranges`, header; the slice is one [`RangeReading`] a sensor of the mission.
    "firsthand.RangesHeader" RangesHeader {}
}

/// The reading of a ranging sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.RangeReading")]
#[repr(C)]
pub struct RangeReading {
    /// S of (19): metres from the sensor, where the status says that it holds a distance; else 0.
    pub range_m: f64,
    /// The value as the robot sent it: centimetres of a sonar, AD counts of an infrared ranger; 0 if none came.
    pub raw: u16,
    /// The row of [`crate::mission::Mission::sensor_table`].
    pub sensor: u8,
    /// A [`RangeStatus`].
    pub status: u8,
}

impl RangeReading {
    /// The kind of the reading.
    pub const fn status(&self) -> RangeStatus {
        RangeStatus::from_byte(self.status)
    }
}

payloads! {
    /// Topic `scan`, header; the slice has the ranges of the laser's beams counter-clockwise, metres: infinite for nothing in reach, not a
    /// number for no reading.
    "firsthand.ScanHeader" ScanHeader {
        /// The row of [`crate::mission::Mission::sensor_table`].
        sensor: u64,
        /// Position of the laser on the robot, metres ahead of and to the left of its centre.
        x_m: f64,
        y_m: f64,
        /// Bearing of the first beam from the robot's axis, radians.
        first_rad: f64,
        /// Angle from beam to beam, radians.
        step_rad: f64,
        /// The range up to which the laser sees, metres.
        reach_m: f64,
    }
}

impl ScanHeader {
    /// The header of a laser's scans: `sensor` stands in `row` of the mission's table.
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
    /// Topic `wheels`: the encoders. A car has the encoder of the driven wheel at the left, and that of the steering at the right,
    /// which is 0 straight ahead and grows to the left.
    "firsthand.Wheels" WheelSample {
        /// Left encoder, counts modulo 32768, growing forward.
        left_counts: u16,
        /// Right encoder, counts modulo 32768, growing forward.
        right_counts: u16,
        /// Left speed, counts a second, forward positive.
        left_counts_per_s: i32,
        /// Right speed, counts a second, forward positive.
        right_counts_per_s: i32,
        /// Times this process of the link noticed that the robot restarted its counts: the step from a sample with
        /// a lower number is no motion.
        restarts: u32,
    }
}

payloads! {
    /// Topic `contact`: wheels that were told to turn are held. They stand by their encoders, and their motors draw a high current.
    #[derive(Serialize, Deserialize)]
    "firsthand.Contact" ContactSample {
        /// The direction from the body's centre in which something touches the body, radians counter-clockwise from the robot's axis.
        bearing_rad: f64,
        /// Half the angle in which that may be, radians; 0 if it is not known where, because the robot was told to turn on the spot.
        half_width_rad: f64,
        /// 1: the left wheel is held, or the driven wheels of a car.
        left: u8,
        /// 1: the right wheel is held.
        right: u8,
    }
}

wire_enum! {
    /// The action of the link's failsafe, the least severe first.
    #[derive(PartialOrd, Ord)]
    Action, unknown = Stop, text = effect {
        /// Commands pass as they are.
        Go = 0 "goes",
        /// Commands pass at a fraction of their speed, along the same curve.
        Slow = 1 "goes at half speed",
        /// The robot stands; it drives again when the cause has ended.
        Stop = 2 "stands",
        /// The robot stands until the process ends: the mission is over.
        End = 3 "stands, and the mission ends",
    }
}

wire_enum! {
    /// The cause for which the link's failsafe acts; `firsthand table failsafe` explains each.
    Cause, unknown = NotOrdered, text = name {
        /// Nothing is wrong.
        None = 0 "nothing is wrong",
        /// The supervisor has not ordered to drive.
        NotOrdered = 1 "no order to drive",
        /// The supervisor ends the mission.
        MissionOver = 2 "mission over",
        /// A battery that the robot drives on is empty.
        BatteryEmpty = 3 "battery empty",
        /// An operator has asked for a stop.
        OperatorStop = 4 "stopped by an operator",
        /// A stage is held.
        StageHeld = 5 "stage held",
        /// The supervisor publishes nothing any more.
        SupervisorSilent = 6 "supervisor silent",
        /// The robot does not answer; stops are sent in case it receives them.
        RobotLost = 7 "robot lost",
        /// No command yet, or the newest is too old: a stage is down or slow.
        CommandStale = 8 "command stale",
        /// The command was computed from too old a pose.
        PoseStale = 9 "pose stale",
        /// The command follows too old a guidance.
        GuidanceStale = 10 "guidance stale",
        /// A battery that the robot drives on is low.
        BatteryLow = 11 "battery low",
        /// The encoders contradict the commands.
        OdometryImplausible = 12 "odometry implausible",
        /// The encoders have contradicted the commands for so long that the mission ends.
        OdometryGivenUp = 13 "odometry implausible for long",
        /// The robot was told to stand, and its encoders say that it moves.
        RobotDoesNotStop = 14 "robot does not obey",
        /// The robot answers and sends no motor frames.
        FramesSilent = 15 "motor frames missing",
        /// Motor frames come less often than commands last.
        FramesSlow = 16 "motor frames too slow",
        /// A ranging sensor that the mission uses gives no readings.
        RangeSilent = 17 "ranging sensor silent",
        /// The robot's frames are old.
        RobotLate = 18 "robot late",
        /// Something holds a wheel that was told to turn.
        WheelsHeld = 19 "wheels held",
        /// The reading of a ranging sensor does not change although the robot moves, or the front sonar hears nothing of what others see.
        RangeImplausible = 20 "ranging sensor implausible",
        /// An infrared ranger that the mission uses gives no readings, and the sensors that are left cover the ground ahead.
        InfraredSilent = 21 "infrared ranger silent",
        /// Another node publishes what the robot is told.
        AnotherCommander = 22 "another commander",
    }
}

/// Topic `link`: the state of the connection to the robot.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Link")]
#[repr(C)]
pub struct LinkSample {
    pub stamp: Stamp,
    /// 1: the robot answers.
    pub connected: u32,
    /// The failsafe's [`Action`].
    pub action: u8,
    /// The [`Cause`] of the action.
    pub cause: u8,
    /// 1: the encoders say that no wheel turns; 0: a wheel turns, or it is not known.
    pub at_rest: u8,
    /// Frames received whole.
    pub frames_in: u64,
    /// Bytes that belonged to no frame.
    pub bytes_dropped: u64,
    /// Datagrams from another address than the robot's, dropped.
    pub foreign_datagrams: u64,
    /// Messages that could not be sent, lost.
    pub unsent: u64,
    /// Samples that the link ignored, because the supervisor does not name their process.
    pub ignored_samples: u64,
    /// The process that wrote the last ignored sample; 0 for none.
    pub ignored_writer: u32,
    /// A port that is not the robot's, from which its host answered; 0 for none.
    pub other_port: u32,
    /// Times the robot was lost.
    pub losses: u64,
    /// Times the robot was seen to have restarted its counts.
    pub reboots: u64,
    /// For how long the robot has not answered, nanoseconds of the machine's clock; 0 while it does.
    pub lost_ns: u64,
    /// Attempts to reach the robot since it was lost: pings, or attempts to open the connection.
    pub attempts: u64,
    /// The time until the next attempt, nanoseconds of the machine's clock.
    pub next_attempt_ns: u64,
    /// Commands sent.
    pub commands_out: u64,
    /// Commands sent a second time, halfway to the next tick.
    pub repeated_commands: u64,
    /// Ticks given to the stages a second time, because no command came.
    pub repeated_ticks: u64,
    /// The time from the datagram in to the datagram out in the last tick, nanoseconds.
    pub latency_ns: u64,
    /// The longest latency of this process of the link, nanoseconds.
    pub latency_max_ns: u64,
    /// All latencies of this process, a [`crate::latency::Histogram`]: bucket k counts those from 2^(k/8) microseconds.
    pub latency_histogram: [u32; latency::BUCKETS],
}

impl Default for LinkSample {
    fn default() -> Self {
        Self {
            stamp: Stamp::default(),
            connected: 0,
            action: Action::Stop.into(),
            cause: Cause::NotOrdered.into(),
            at_rest: 0,
            frames_in: 0,
            bytes_dropped: 0,
            foreign_datagrams: 0,
            unsent: 0,
            ignored_samples: 0,
            ignored_writer: 0,
            other_port: 0,
            losses: 0,
            reboots: 0,
            lost_ns: 0,
            attempts: 0,
            next_attempt_ns: 0,
            commands_out: 0,
            repeated_commands: 0,
            repeated_ticks: 0,
            latency_ns: 0,
            latency_max_ns: 0,
            latency_histogram: [0; latency::BUCKETS],
        }
    }
}

impl LinkSample {
    /// The failsafe's action.
    pub const fn action(&self) -> Action {
        Action::from_byte(self.action)
    }

    /// The cause of the action.
    pub const fn cause(&self) -> Cause {
        Cause::from_byte(self.cause)
    }

    /// Whether the link lets no command pass.
    pub fn stopped(&self) -> bool {
        self.action() >= Action::Stop
    }
}

payloads! {
    /// Topic `infrared`: the seven infrared rangers, in the order of their channels.
    "firsthand.Infrared" InfraredSample {
        /// Metres from each ranger, 0.09 to 0.81; 0.81 is also nothing.
        range_m: [f64; INFRARED_RANGERS],
        /// The readings as the robot sent them, AD counts.
        raw_ad: [u16; INFRARED_RANGERS],
    }
}

payloads! {
    /// Topic `power`: voltages of the batteries, currents of the motors.
    "firsthand.Power" PowerSample {
        /// The boards' battery, volts.
        board_v: f64,
        /// The motors' battery, volts.
        motor_v: f64,
        /// The servos' battery, volts.
        servo_v: f64,
        /// The two motor drivers, degrees Celsius by the vendor's formula.
        driver_c: [f64; 2],
        /// Currents of the motors of the six channels, AD counts: no source says how many are an ampere.
        current_ad: [u16; 6],
        /// 1: the boards' battery is low by the mission's `robot.low_battery_v`.
        board_low: u8,
        /// 1: the motors' battery is low.
        motor_low: u8,
        /// 1: the servos' battery is low.
        servo_low: u8,
    }
}

impl PowerSample {
    /// Whether any battery is low.
    pub const fn is_low(&self) -> bool {
        self.board_low == 1 || self.motor_low == 1 || self.servo_low == 1
    }
}

payloads! {
    /// Topic `surroundings`: human sensors, tilt, temperature.
    "firsthand.Surroundings" SurroundingsSample {
        /// At the board, degrees Celsius by the vendor's formula.
        temperature_c: f64,
        /// The two human sensors: presence, AD counts.
        human_alarm_ad: [u16; 2],
        /// The two human sensors: motion, AD counts around the middle of their scale.
        human_motion_ad: [u16; 2],
        /// Tilt along x and y, AD counts.
        tilt_ad: [u16; 2],
    }
}

wire_enum! {
    /// The direction of bytes on the wire.
    Direction, unknown = Received {
        /// From the robot.
        Received = 0,
        /// To the robot.
        Sent = 1,
    }
}

payloads! {
    /// Topic `wire`, header; the slice is the bytes of one datagram, or of one read from a connection or serial line.
    "firsthand.WireHeader" WireHeader {
        /// Reading of the machine's monotonic clock in the step that took or gave them, nanoseconds.
        machine_ns: u64,
        /// A [`Direction`].
        direction: u8,
    }
}

layouts! {
    RangeReading { range_m raw sensor status }
    LinkSample { stamp connected action cause at_rest frames_in bytes_dropped foreign_datagrams unsent ignored_samples ignored_writer other_port losses reboots lost_ns attempts next_attempt_ns commands_out repeated_commands repeated_ticks latency_ns latency_max_ns latency_histogram }
}
