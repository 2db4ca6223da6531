//! The payloads of the topics, as they lie in shared memory: `repr(C)`, no pointers, units in every name
//! or doc. Each has a `type_name` other languages can give; size and name are checked at attach.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl` that promises a
//! self-contained type of uniform layout. All fields below are plain numbers and arrays of them in
//! `repr(C)` structs, so the promise holds; nothing else in the module is unsafe.
//!
//! Any bit pattern may arrive from another process: states travel as bytes and are read through
//! `from_byte`, never as Rust enums.
#![allow(unsafe_code)]

use crate::bus::ZeroCopySend;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    clock::MissionTime,
    grid::{GridFrame, Revision, Window},
    kinematics::{Pose2, Twist},
    latency,
};

/// Which sample this is, who wrote it and when: the first field of every payload and header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Stamp")]
#[repr(C)]
pub struct Stamp {
    /// The tick it belongs to: one tick runs from a motor frame to its command.
    pub tick: u64,
    /// Mission time, nanoseconds.
    pub stamp_ns: u64,
    /// Which life of its writer: grows by one each time the supervisor starts the stage.
    pub generation: u32,
    /// Counts the writer's samples on this topic in this life, from 0.
    pub sequence: u32,
}

impl Stamp {
    /// Mission time.
    #[must_use]
    pub const fn time(&self) -> MissionTime {
        MissionTime(self.stamp_ns)
    }
}

/// A payload or header that starts with a [`Stamp`].
pub trait Stamped {
    /// The stamp.
    fn stamp(&self) -> &Stamp;
    /// The stamp, to be filled in by the writer.
    fn stamp_mut(&mut self) -> &mut Stamp;
}

macro_rules! stamped {
    ($($payload:ty),* $(,)?) => {$(
        impl Stamped for $payload {
            fn stamp(&self) -> &Stamp {
                &self.stamp
            }
            fn stamp_mut(&mut self) -> &mut Stamp {
                &mut self.stamp
            }
        }
    )*};
}
stamped!(
    RangeSample,
    WheelSample,
    PoseSample,
    GridHeader,
    GuidanceSample,
    FieldHeader,
    CommandSample,
    HealthSample,
    LinkSample,
    InfraredSample,
    PowerSample,
    SurroundingsSample,
    DirectiveSample,
    RosterHeader,
    DeathSample,
    StallSample,
    RequestSample,
    FaultSample,
);

/// What a byte on the bus stands for.
macro_rules! wire_enum {
    ($(#[$meta:meta])* $name:ident, unknown = $unknown:ident { $($(#[$doc:meta])* $variant:ident = $byte:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum $name { $($(#[$doc])* $variant = $byte),* }
        impl $name {
            /// The value a byte stands for; an unheard-of byte is read as the safe one.
            #[must_use]
            pub const fn from_byte(byte: u8) -> Self {
                match byte {
                    $($byte => Self::$variant,)*
                    _ => Self::$unknown,
                }
            }
        }
        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                value as u8
            }
        }
    };
}

wire_enum! {
    /// What the front sonar said in a tick.
    RangeStatus, unknown = Absent {
        /// No sonar frame came since the last tick: the map stays as it is.
        Absent = 0,
        /// `range_m` holds a distance.
        Measured = 1,
        /// 255: nothing in range, or no echo.
        Nothing = 2,
        /// 4: at 4 cm or nearer.
        AtContact = 3,
        /// 0: no valid reading.
        Invalid = 4,
    }
}

/// Topic `range`: the front sonar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Range")]
#[repr(C)]
pub struct RangeSample {
    /// Which sample.
    pub stamp: Stamp,
    /// S of (19): metres from the sensor, where the status says so; else 0.
    pub range_m: f64,
    /// A [`RangeStatus`].
    pub status: u8,
    /// The byte as the robot sent it, cm.
    pub raw_cm: u8,
}

/// Topic `wheels`: the encoders.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Wheels")]
#[repr(C)]
pub struct WheelSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Left encoder, counts modulo 32768, growing forward.
    pub left_counts: u16,
    /// Right encoder, counts modulo 32768, growing forward.
    pub right_counts: u16,
    /// Left speed, counts a second, forward positive.
    pub left_counts_per_s: i32,
    /// Right speed, counts a second, forward positive.
    pub right_counts_per_s: i32,
    /// Times this life of the link noticed that the robot restarted its counts: the step from a sample with
    /// a lower number is no motion.
    pub restarts: u32,
}

/// Topic `pose`: where dead reckoning believes the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Pose")]
#[repr(C)]
pub struct PoseSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Metres in the mission frame.
    pub x_m: f64,
    /// Metres in the mission frame.
    pub y_m: f64,
    /// theta, radians counter-clockwise from x; not wrapped.
    pub heading_rad: f64,
    /// v over the last tick, m/s.
    pub v_m_s: f64,
    /// omega over the last tick, rad/s.
    pub omega_rad_s: f64,
    /// Length of the way so far, metres.
    pub travelled_m: f64,
    /// The encoder counts it was computed at.
    pub left_counts: u16,
    /// The encoder counts it was computed at.
    pub right_counts: u16,
}

impl PoseSample {
    /// Position and heading.
    #[must_use]
    pub const fn pose(&self) -> Pose2 {
        Pose2 {
            position: DVec2::new(self.x_m, self.y_m),
            heading: self.heading_rad,
        }
    }

    /// Speeds over the last tick.
    #[must_use]
    pub const fn twist(&self) -> Twist {
        Twist {
            v: self.v_m_s,
            omega: self.omega_rad_s,
        }
    }
}

/// How a map lies and which part of which version came along.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Part")]
#[repr(C)]
pub struct Part {
    /// The version the map has with these cells. Consecutive versions differ in one window.
    pub version: u64,
    /// N: the map is N x N cells.
    pub cells: u32,
    /// First column of the window.
    pub col: u32,
    /// First row of the window.
    pub row: u32,
    /// Columns of the window.
    pub width: u32,
    /// Rows of the window.
    pub height: u32,
    /// 1: the window is the whole map.
    pub keyframe: u32,
    /// Delta: side of a cell, metres.
    pub resolution_m: f64,
    /// Where cell (N/2, N/2) lies, metres.
    pub centre_x_m: f64,
    /// Where cell (N/2, N/2) lies, metres.
    pub centre_y_m: f64,
}

impl Part {
    /// The part as [`crate::grid::Replica`] takes it.
    #[must_use]
    pub const fn revision(&self) -> Revision {
        Revision {
            frame: GridFrame {
                cells: self.cells,
                resolution_m: self.resolution_m,
                centre: DVec2::new(self.centre_x_m, self.centre_y_m),
            },
            window: Window {
                col: self.col,
                row: self.row,
                width: self.width,
                height: self.height,
            },
            version: self.version,
            keyframe: self.keyframe == 1,
        }
    }
}

impl From<Revision> for Part {
    fn from(revision: Revision) -> Self {
        Self {
            version: revision.version,
            cells: revision.frame.cells,
            col: revision.window.col,
            row: revision.window.row,
            width: revision.window.width,
            height: revision.window.height,
            keyframe: revision.keyframe.into(),
            resolution_m: revision.frame.resolution_m,
            centre_x_m: revision.frame.centre.x,
            centre_y_m: revision.frame.centre.y,
        }
    }
}

/// Topic `grid`, header; the slice is one [`crate::grid::CellState`] byte a cell of the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.GridHeader")]
#[repr(C)]
pub struct GridHeader {
    /// Which sample.
    pub stamp: Stamp,
    /// Which part of which version.
    pub part: Part,
    /// Range samples that put a hazard on the map so far.
    pub safety_events: u64,
    /// The belief's epoch: grows when the sensed belief was reset.
    pub epoch: u64,
}

wire_enum! {
    /// What the planner says of the pose.
    GuidanceStatus, unknown = Waiting {
        /// No field yet.
        Waiting = 0,
        /// Go along (ex, ey).
        Along = 1,
        /// The robot's cell is the target's.
        AtTarget = 2,
        /// The robot stands in a hazard cell: (ex, ey) leads to the nearest free one.
        WayOut = 3,
        /// The belief isolates the robot from the target; (ex, ey), unless 0, is where to look meanwhile.
        Unreachable = 4,
        /// Nobody has looked where the way leads: turn on the spot until the robot faces (ex, ey).
        Look = 5,
    }
}

/// Topic `guidance`: E of (11) at the robot's pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Guidance")]
#[repr(C)]
pub struct GuidanceSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Ex: unit vector, 0 where there is none.
    pub ex: f64,
    /// Ey.
    pub ey: f64,
    /// dst of (14): straight to the target, metres.
    pub distance_m: f64,
    /// The most tangential speed that what is believed of the way ahead allows, m/s; infinite for no limit.
    pub speed_limit_m_s: f64,
    /// A [`GuidanceStatus`].
    pub status: u8,
    /// Mission time of the pose it was computed for, nanoseconds.
    pub pose_ns: u64,
    /// The version of `grid` it was computed from.
    pub grid_version: u64,
    /// That version's safety events.
    pub safety_events: u64,
    /// That version's belief epoch.
    pub epoch: u64,
    /// Full solves in this life of the planner.
    pub full_solves: u64,
    /// Local updates in this life of the planner.
    pub local_updates: u64,
    /// Wall-clock of the last full solve, nanoseconds.
    pub full_solve_ns: u64,
    /// Wall-clock of the last local update, nanoseconds.
    pub local_update_ns: u64,
}

/// Topic `field`, header; the slice is one [`FieldCell`] a cell of the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.FieldHeader")]
#[repr(C)]
pub struct FieldHeader {
    /// Which sample.
    pub stamp: Stamp,
    /// Which part of which version.
    pub part: Part,
    /// The version of `grid` it was computed from.
    pub grid_version: u64,
    /// X_T, metres.
    pub target_x_m: f64,
    /// X_T, metres.
    pub target_y_m: f64,
    /// Certificate: the worst componentwise relative residual of the last full solve.
    pub worst_residual: f64,
    /// Certificate: free cells from which the target can be reached.
    pub reachable: u64,
}

/// The policy at one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.FieldCell")]
#[repr(C)]
pub struct FieldCell {
    /// Ex at the cell's centre: unit vector, 0 where there is no guidance.
    pub ex: f32,
    /// Ey.
    pub ey: f32,
    /// log2 u; -inf on hazards and where the target cannot be reached.
    pub log2_u: f32,
}

wire_enum! {
    /// Why a command is what it is.
    CommandState, unknown = Halt {
        /// No guidance to follow: stand.
        Halt = 0,
        /// Following the guidance.
        Driving = 1,
        /// The target is reached: stand for good.
        Arrived = 2,
    }
}

/// Topic `command`: U of (17).
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Command")]
#[repr(C)]
pub struct CommandSample {
    /// Which sample.
    pub stamp: Stamp,
    /// omega_L, rad/s.
    pub left_rad_s: f64,
    /// omega_R, rad/s.
    pub right_rad_s: f64,
    /// vc of (16), m/s.
    pub v_m_s: f64,
    /// wc of (15), rad/s.
    pub omega_rad_s: f64,
    /// dst of (14), metres.
    pub distance_m: f64,
    /// Mission time of the oldest pose it was computed from, the guidance's among them, nanoseconds: the link
    /// lets no old one move the robot, whatever the stamp says.
    pub pose_ns: u64,
    /// Mission time of the guidance it follows, nanoseconds; likewise.
    pub guidance_ns: u64,
    /// A [`CommandState`].
    pub state: u8,
}

wire_enum! {
    /// How a stage is.
    HealthState, unknown = Starting {
        /// Opening its topics, or waiting for what it cannot work without.
        Starting = 0,
        /// Working, or ready to.
        Ready = 1,
        /// Told to stop, or stopping for a reason of its own.
        Stopping = 2,
    }
}

/// A short name in shared memory: UTF-8, padded with zeros.
pub type Name = [u8; 24];

/// `text` as a [`Name`], cut at 24 bytes.
#[must_use]
pub fn name(text: &str) -> Name {
    let mut name = [0; 24];
    for (slot, byte) in name.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    name
}

/// What a [`Name`] says; what is not UTF-8 is left out.
#[must_use]
pub fn name_str(name: &Name) -> &str {
    let text = name.split(|&byte| byte == 0).next().unwrap_or_default();
    std::str::from_utf8(text).unwrap_or_default()
}

/// Topic `health`: the heartbeat of every stage, beaten from inside its work loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Health")]
#[repr(C)]
pub struct HealthSample {
    /// Which sample.
    pub stamp: Stamp,
    /// The stage.
    pub stage: Name,
    /// Its process.
    pub pid: u32,
    /// A [`HealthState`].
    pub state: u8,
    /// Times round the work loop.
    pub turns: u64,
    /// The fault that this life was asked for last; 0 for none.
    pub last_fault: u64,
    /// What it made of it: a [`FaultAnswer`].
    pub fault_answer: u8,
}

wire_enum! {
    /// What the link's failsafe does with the robot, the mildest first.
    #[derive(PartialOrd, Ord)]
    Action, unknown = Stop {
        /// Commands pass as they are.
        Go = 0,
        /// Commands pass at a share of their speed, along the same curve.
        Slow = 1,
        /// The robot stands; it goes on when the cause is gone.
        Stop = 2,
        /// The robot stands for good: the mission ends.
        End = 3,
    }
}

wire_enum! {
    /// Why the link's failsafe does it; `firsthand failsafe` tells of each.
    Cause, unknown = NotOrdered {
        /// Nothing is wrong.
        None = 0,
        /// The supervisor has not said drive.
        NotOrdered = 1,
        /// The supervisor ends the mission.
        MissionOver = 2,
        /// A battery that the robot drives on is empty.
        BatteryEmpty = 3,
        /// An operator said stop.
        OperatorStop = 4,
        /// A stage is held.
        StageHeld = 5,
        /// The supervisor says nothing any more.
        SupervisorSilent = 6,
        /// The robot does not answer; it is told to stand in case it hears.
        RobotLost = 7,
        /// No command yet, or the newest is too old: a stage is down or slow.
        CommandStale = 8,
        /// The command was computed from too old a pose.
        PoseStale = 9,
        /// The command follows too old a guidance.
        GuidanceStale = 10,
        /// A battery that the robot drives on is low.
        BatteryLow = 11,
    }
}

/// Topic `link`: the state of the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Link")]
#[repr(C)]
pub struct LinkSample {
    /// Which sample.
    pub stamp: Stamp,
    /// 1: the robot answers.
    pub connected: u32,
    /// What the failsafe does: an [`Action`].
    pub action: u8,
    /// Why: a [`Cause`].
    pub cause: u8,
    /// Frames received whole.
    pub frames_in: u64,
    /// Bytes that belonged to no frame.
    pub bytes_dropped: u64,
    /// Datagrams from another address than the robot's, dropped.
    pub strangers: u64,
    /// Messages the wire did not take, lost.
    pub unsent: u64,
    /// Times the robot was lost.
    pub losses: u64,
    /// Times the robot was seen to have restarted its counts.
    pub reboots: u64,
    /// For how long the robot has not answered, nanoseconds of the machine's clock; 0 while it does.
    pub lost_ns: u64,
    /// Attempts to reach it since: pings, or openings of the wire.
    pub attempts: u64,
    /// Until the next attempt, nanoseconds of the machine's clock.
    pub next_attempt_ns: u64,
    /// Commands sent.
    pub commands_out: u64,
    /// Commands sent a second time, halfway to the next tick.
    pub repeated_commands: u64,
    /// Ticks given to the stages a second time, because no command came.
    pub repeated_ticks: u64,
    /// From the datagram in to the datagram out, last tick, nanoseconds.
    pub latency_ns: u64,
    /// The longest of this life of the link, nanoseconds.
    pub latency_max_ns: u64,
    /// All of this life, a [`crate::latency::Histogram`]: bucket k counts those from 2^(k/8) microseconds.
    pub latency_histogram: [u32; latency::BUCKETS],
}

impl Default for LinkSample {
    fn default() -> Self {
        Self {
            stamp: Stamp::default(),
            connected: 0,
            action: Action::Stop.into(),
            cause: Cause::NotOrdered.into(),
            frames_in: 0,
            bytes_dropped: 0,
            strangers: 0,
            unsent: 0,
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
    /// What the failsafe does.
    #[must_use]
    pub const fn action(&self) -> Action {
        Action::from_byte(self.action)
    }

    /// Why.
    #[must_use]
    pub const fn cause(&self) -> Cause {
        Cause::from_byte(self.cause)
    }

    /// Whether the link lets no command pass.
    #[must_use]
    pub fn stopped(&self) -> bool {
        self.action() >= Action::Stop
    }
}

/// Topic `infrared`: the seven infrared rangers, which look straight ahead of themselves. Which one looks
/// where differs from robot to robot; no source numbers them.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Infrared")]
#[repr(C)]
pub struct InfraredSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Metres from each ranger, 0.09 to 0.81; 0.81 is also nothing.
    pub range_m: [f64; 7],
    /// As the robot sent them, AD counts.
    pub raw_ad: [u16; 7],
}

/// Topic `power`: what the batteries give and the motors draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Power")]
#[repr(C)]
pub struct PowerSample {
    /// Which sample.
    pub stamp: Stamp,
    /// The boards' battery, volts.
    pub board_v: f64,
    /// The motors' battery, volts.
    pub motor_v: f64,
    /// The servos' battery, volts.
    pub servo_v: f64,
    /// The two motor drivers, degrees Celsius by the vendor's formula.
    pub driver_c: [f64; 2],
    /// What the motors of the six channels draw, AD counts: no source says how many are an ampere.
    pub current_ad: [u16; 6],
    /// 1: the boards' battery is low by the mission's `robot.low_battery_v`.
    pub board_low: u8,
    /// 1: the motors' battery is low.
    pub motor_low: u8,
    /// 1: the servos' battery is low.
    pub servo_low: u8,
}

impl PowerSample {
    /// Whether any battery is low.
    #[must_use]
    pub const fn is_low(&self) -> bool {
        self.board_low == 1 || self.motor_low == 1 || self.servo_low == 1
    }
}

/// Topic `surroundings`: what else the robot feels of where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Surroundings")]
#[repr(C)]
pub struct SurroundingsSample {
    /// Which sample.
    pub stamp: Stamp,
    /// At the board, degrees Celsius by the vendor's formula.
    pub temperature_c: f64,
    /// The two human sensors: presence, AD counts.
    pub human_alarm_ad: [u16; 2],
    /// The two human sensors: motion, AD counts around the middle of their scale.
    pub human_motion_ad: [u16; 2],
    /// Tilt along x and y, AD counts.
    pub tilt_ad: [u16; 2],
}

wire_enum! {
    /// What the supervisor wants of the robot.
    Order, unknown = Stop {
        /// Stand still; do not start ticks.
        Hold = 0,
        /// Go to the target.
        Drive = 1,
        /// Stand still for good: the mission ends.
        Stop = 2,
    }
}

/// Topic `directive`: the supervisor's word to all stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Directive")]
#[repr(C)]
pub struct DirectiveSample {
    /// Which sample.
    pub stamp: Stamp,
    /// The belief's epoch: a mapper that holds a lower one resets the sensed belief.
    pub epoch: u64,
    /// An [`Order`].
    pub order: u8,
    /// Why it is not to drive: a [`HoldReason`].
    pub reason: u8,
}

wire_enum! {
    /// Where the supervisor has a stage.
    StageState, unknown = Down {
        /// No process; one will be started.
        Down = 0,
        /// Started, not ready yet.
        Starting = 1,
        /// Beating.
        Running = 2,
        /// Died too often; waits before the next start.
        BackingOff = 3,
        /// Told to stop.
        Stopping = 4,
        /// Died far too often: only an operator's word starts it again.
        Held = 5,
    }
}

wire_enum! {
    /// Why the robot is not ordered to drive.
    HoldReason, unknown = Starting {
        /// Not all stages are ready, or the robot does not answer, or there is no field yet.
        Starting = 0,
        /// It may drive.
        None = 1,
        /// An operator said stop, and has not said resume.
        Operator = 2,
        /// A stage is held.
        StageHeld = 3,
        /// The mission ends.
        Ending = 4,
    }
}

/// Topic `roster`, header; the slice is one [`RosterEntry`] a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.RosterHeader")]
#[repr(C)]
pub struct RosterHeader {
    /// Which sample.
    pub stamp: Stamp,
    /// The supervisor's process.
    pub supervisor_pid: u32,
    /// The current [`Order`].
    pub order: u8,
    /// A [`HoldReason`].
    pub reason: u8,
    /// 1: the robot is a simulated one.
    pub simulated: u8,
    /// The request that was taken last; 0 for none.
    pub last_request: u64,
}

/// One stage, as the supervisor sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.RosterEntry")]
#[repr(C)]
pub struct RosterEntry {
    /// The stage.
    pub stage: Name,
    /// Its process; 0 for none.
    pub pid: u32,
    /// Which life.
    pub generation: u32,
    /// A [`StageState`].
    pub state: u8,
    /// Times it was started again.
    pub restarts: u32,
    /// Age of this life, nanoseconds.
    pub uptime_ns: u64,
    /// Age of its last heartbeat, nanoseconds; u64::MAX for none yet.
    pub beat_age_ns: u64,
    /// Age of its last output on any topic, nanoseconds; u64::MAX for none yet.
    pub output_age_ns: u64,
}

wire_enum! {
    /// How a stage's process ended.
    DeathCause, unknown = Exited {
        /// By itself; `code` is its exit code.
        Exited = 0,
        /// By a signal; `code` is its number.
        Signalled = 1,
        /// By a signal, and it left a core; `code` is its number.
        SignalledWithCore = 2,
        /// It was not the supervisor's child: who started it knows.
        Unknown = 3,
    }
}

wire_enum! {
    /// What the supervisor does about a death.
    NextStep, unknown = Nothing {
        /// Nothing: the run ends.
        Nothing = 0,
        /// A successor is started at once.
        StartNow = 1,
        /// A successor is started after `next_after_ns`.
        StartLater = 2,
        /// It died too often: an operator's word starts it.
        Hold = 3,
    }
}

/// Text in shared memory: UTF-8, filled up with zeros.
#[derive(Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[type_name("firsthand.Words")]
#[repr(C)]
pub struct Words {
    bytes: [u8; 400],
}

impl Default for Words {
    fn default() -> Self {
        Self { bytes: [0; 400] }
    }
}

impl std::fmt::Debug for Words {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(to, "{:?}", self.text())
    }
}

/// `text` as [`Words`], cut at 400 bytes.
#[must_use]
pub fn words(text: &str) -> Words {
    let mut words = Words::default();
    for (slot, byte) in words.bytes.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    words
}

impl Words {
    /// What they say; a character that was cut is replaced.
    #[must_use]
    pub fn text(&self) -> std::borrow::Cow<'_, str> {
        let text = self.bytes.split(|&byte| byte == 0).next();
        String::from_utf8_lossy(text.unwrap_or_default())
    }
}

/// Topic `deaths`: a stage's process ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Death")]
#[repr(C)]
pub struct DeathSample {
    /// Which sample.
    pub stamp: Stamp,
    /// The stage.
    pub stage: Name,
    /// Its process.
    pub pid: u32,
    /// Which life.
    pub generation: u32,
    /// Age of its last heartbeat, nanoseconds; u64::MAX if it never beat.
    pub beat_age_ns: u64,
    /// Length of its life, nanoseconds.
    pub uptime_ns: u64,
    /// Pause before its successor, nanoseconds.
    pub next_after_ns: u64,
    /// Exit code or signal number.
    pub code: i32,
    /// Deaths of this stage within the last ten seconds, this one among them.
    pub deaths_in_window: u32,
    /// A [`DeathCause`].
    pub cause: u8,
    /// A [`NextStep`].
    pub next: u8,
    /// 1: it hung, or was never ready, and the supervisor ended it.
    pub hung: u8,
    /// The end of its log.
    pub last_words: Words,
}

wire_enum! {
    /// What a robot that stalls is tried to be freed by.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    StallRung, unknown = GiveUp {
        /// A fresh planner, which solves the full field.
        Replan = 0,
        /// What was sensed is forgotten.
        Forget = 1,
        /// The mission ends: the target is unreachable.
        GiveUp = 2,
    }
}

wire_enum! {
    /// How a robot that should get on does not.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    StallCause, unknown = Still {
        /// It neither drives nor turns.
        Still = 0,
        /// It moves, and stays where it is.
        Pinned = 1,
        /// It stands in hazard, u = 0, and drives without coming out.
        Buried = 2,
        /// It stands where the belief has no way to the target, u = 0.
        CutOff = 3,
    }
}

/// Topic `stalls`: the robot should get on and does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Stall")]
#[repr(C)]
pub struct StallSample {
    /// Which sample; its tick and time are those of the pose it was seen at.
    pub stamp: Stamp,
    /// Where the robot believes it is, metres.
    pub x_m: f64,
    /// Where the robot believes it is, metres.
    pub y_m: f64,
    /// The belief's epoch from now on.
    pub epoch: u64,
    /// Fresh planners tried so far in this mission, this one among them.
    pub replans: u32,
    /// Beliefs forgotten so far in this mission, this one among them.
    pub resets: u64,
    /// A [`StallCause`].
    pub cause: u8,
    /// A [`StallRung`]: what is done about it.
    pub rung: u8,
}

wire_enum! {
    /// What an operator asks of the supervisor.
    RequestKind, unknown = Nothing {
        /// Nothing.
        Nothing = 0,
        /// A fresh life of a stage; one that is held is released.
        Restart = 1,
        /// Let the robot stand.
        Stop = 2,
        /// Let it go on.
        Resume = 3,
    }
}

/// Topic `requests`: an operator's word to the supervisor.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Request")]
#[repr(C)]
pub struct RequestSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Names the request: the roster's `last_request` says that it was taken. Never 0.
    pub id: u64,
    /// The stage it is about; empty for none.
    pub stage: Name,
    /// A [`RequestKind`].
    pub kind: u8,
}

wire_enum! {
    /// What can be broken in a running stage on purpose; [`crate::faults::TABLE`] says where and how.
    #[derive(Serialize, Deserialize)]
    FaultKind, unknown = Nothing {
        /// Nothing.
        Nothing = 0,
        /// A turn of the work loop that does not end.
        Spin = 1,
        /// A live field whose ways all lead to where the robot is.
        CorruptField = 2,
        /// No direction, as where the gradient is zero.
        Saddle = 3,
        /// Hazard believed wherever the robot is.
        BuryRobot = 4,
        /// A closed wall believed around the target, whatever is forgotten.
        CutOff = 5,
    }
}

wire_enum! {
    /// What a stage made of a fault it was asked for.
    FaultAnswer, unknown = Refused {
        /// Asked for none.
        None = 0,
        /// It is broken now.
        Taken = 1,
        /// Not done: the robot is a real one, and the request does not say that it is meant all the same.
        Refused = 2,
        /// Not done: the stage has no such fault, or nothing yet to break.
        Impossible = 3,
    }
}

/// Topic `faults`: break something in a stage, to see the rest cope.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Fault")]
#[repr(C)]
pub struct FaultSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Names the request: the stage's `last_fault` in `health` says that it was answered. Never 0.
    pub id: u64,
    /// The stage it is for.
    pub stage: Name,
    /// A [`FaultKind`].
    pub kind: u8,
    /// 1: meant although the robot is a real one.
    pub although_real: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unheard_of_byte_is_read_as_the_safe_state() {
        assert_eq!(Order::from_byte(200), Order::Stop);
        assert_eq!(CommandState::from_byte(200), CommandState::Halt);
        assert_eq!(GuidanceStatus::from_byte(200), GuidanceStatus::Waiting);
        assert_eq!(RangeStatus::from_byte(200), RangeStatus::Absent);
        assert_eq!(Action::from_byte(200), Action::Stop);
    }

    #[test]
    fn names_survive_shared_memory() {
        assert_eq!(name_str(&name("dead-reckoning")), "dead-reckoning");
        assert_eq!(name_str(&name(&"x".repeat(40))).len(), 24);
        assert_eq!(name_str(&[0xff; 24]), "");
    }

    #[test]
    fn a_revision_survives_shared_memory() {
        let frame = GridFrame {
            cells: 40,
            resolution_m: 0.1,
            centre: DVec2::new(1.0, -2.0),
        };
        let revision = Revision {
            frame,
            window: frame.whole(),
            version: 7,
            keyframe: true,
        };
        assert_eq!(Part::from(revision).revision(), revision);
    }
}
