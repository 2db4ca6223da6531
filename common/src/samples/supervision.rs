//! The payloads of supervision: health, roster, orders, requests, deaths, stalls, faults.

use serde::{Deserialize, Serialize, Serializer, ser::SerializeStruct as _};

use super::navigation::{MOST_TARGETS, TargetPoint};
use crate::bus::{ZeroCopySend, layouts};

wire_enum! {
    /// The state of a stage's process.
    HealthState, unknown = Starting {
        /// Opening its topics, or waiting for what it cannot work without.
        Starting = 0,
        /// Working, or ready to.
        Ready = 1,
        /// Stopping, on request or for a reason of its own.
        Stopping = 2,
    }
}

/// A short name in shared memory: UTF-8, padded with zeros.
pub type Name = [u8; 24];

/// `text` as a [`Name`], cut at 24 bytes.
pub fn name(text: &str) -> Name {
    let mut name = [0; 24];
    for (slot, byte) in name.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    name
}

/// The text of a [`Name`]; what is not UTF-8 is left out.
pub fn name_str(name: &Name) -> &str {
    let text = name.split(|&byte| byte == 0).next().unwrap_or_default();
    std::str::from_utf8(text).unwrap_or_default()
}

payloads! {
    /// Topic `health`: the heartbeat of every stage, published from inside its work loop.
    "firsthand.Health" HealthSample {
        stage: Name,
        /// The process of the stage.
        pid: u32,
        /// A [`HealthState`].
        state: u8,
        /// Iterations of the work loop.
        turns: u64,
        /// The newest fault request to this generation; 0 for none.
        last_fault: u64,
        /// The answer to that request: a [`FaultAnswer`].
        fault_answer: u8,
    }
}

wire_enum! {
    /// The supervisor's order to the robot.
    #[derive(Serialize, Deserialize)]
    #[serde(from = "u8", into = "u8")]
    Order, unknown = Stop {
        /// Stand still; do not start ticks.
        Hold = 0,
        /// Go to the target.
        Drive = 1,
        /// Stand still for good: the mission ends.
        Stop = 2,
    }
}

payloads! {
    /// Topic `directive`: the supervisor's order to all stages.
    "firsthand.Directive" DirectiveSample {
        /// The belief's epoch: a mapper that holds a lower one resets the sensed belief.
        epoch: u64,
        /// An [`Order`].
        order: u8,
        /// Why the robot is not to drive: a [`HoldReason`].
        reason: u8,
    }
}

payloads! {
    /// Topic `tick_limit`: in lockstep, how far the link may go ahead of the supervisor, so that a recovery step against a stall
    /// holds from a tick that does not depend on the machine.
    "firsthand.TickLimit" TickLimitSample {
        /// The last tick that the link may begin.
        last_tick: u64,
        /// The first tick in which the newest recovery step holds; 0 for none.
        holds_from_tick: u64,
        /// The belief's epoch from that tick on.
        epoch: u64,
        /// The number of the current target: no tick follows an arrival before the next target is published.
        target_number: u64,
    }
}

wire_enum! {
    /// The state of a stage, as the supervisor sees it.
    StageState, unknown = Down {
        /// No process; one will be started.
        Down = 0,
        /// Started, not ready yet.
        Starting = 1,
        /// The stage sends heartbeats.
        Running = 2,
        /// The stage died too often, and waits before the next start.
        BackingOff = 3,
        /// The process was asked to stop, or aborted because it hung.
        Stopping = 4,
        /// The stage died far too often: only an operator starts it again.
        Held = 5,
    }
}

wire_enum! {
    /// Why the robot is not ordered to drive.
    #[derive(Serialize, Deserialize)]
    #[serde(from = "u8", into = "u8")]
    HoldReason, unknown = Starting {
        /// Not all stages are ready, or the robot does not answer, or there is no field yet.
        Starting = 0,
        /// The robot may drive.
        None = 1,
        /// An operator said stop, and has not said resume.
        Operator = 2,
        /// A stage is held.
        StageHeld = 3,
        /// The mission ends.
        Ending = 4,
    }
}

payloads! {
    /// Topic `roster`, header; the slice is one [`RosterEntry`] a stage.
    "firsthand.RosterHeader" RosterHeader {
        /// The supervisor's process.
        supervisor_pid: u32,
        /// The current [`Order`].
        order: u8,
        /// A [`HoldReason`].
        reason: u8,
        /// 1: the robot is a simulated one.
        simulated: u8,
        /// The request that was answered last; 0 for none.
        last_request: u64,
        /// The answer to that request: a [`RequestAnswer`].
        answer: u8,
    }
}

/// One stage, as the supervisor sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.RosterEntry")]
#[repr(C)]
pub struct RosterEntry {
    pub stage: Name,
    /// The process of the stage; 0 for none.
    pub pid: u32,
    /// The generation.
    pub generation: u32,
    /// A [`StageState`].
    pub state: u8,
    /// Times the stage was started again.
    pub restarts: u32,
    /// Age of its process, nanoseconds.
    pub uptime_ns: u64,
    /// Age of its last heartbeat, nanoseconds; u64::MAX for none yet.
    pub beat_age_ns: u64,
    /// Age of its last output on any topic, nanoseconds; u64::MAX for none yet.
    pub output_age_ns: u64,
}

wire_enum! {
    /// How a stage's process ended.
    DeathCause, unknown = Exited {
        /// The process ended by itself; `code` is its exit code.
        Exited = 0,
        /// A signal ended the process; `code` is the signal's number.
        Signalled = 1,
        /// A signal ended the process, which left a core; `code` is the signal's number.
        SignalledWithCore = 2,
        /// The cause is not known, because the process was not the supervisor's child.
        Unknown = 3,
    }
}

wire_enum! {
    /// The supervisor's action after a death.
    NextStep, unknown = Nothing {
        /// Nothing: the run ends.
        Nothing = 0,
        /// A successor is started at once.
        StartNow = 1,
        /// A successor is started after `next_after_ns`.
        StartLater = 2,
        /// The stage died too often: only an operator starts it again.
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
pub fn words(text: &str) -> Words {
    let mut words = Words::default();
    for (slot, byte) in words.bytes.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    words
}

impl Words {
    /// The text; a character that was cut is replaced.
    pub fn text(&self) -> std::borrow::Cow<'_, str> {
        let text = self.bytes.split(|&byte| byte == 0).next();
        String::from_utf8_lossy(text.unwrap_or_default())
    }
}

payloads! {
    /// Topic `deaths`: a stage's process ended.
    "firsthand.Death" DeathSample {
        stage: Name,
        /// The process of the stage.
        pid: u32,
        /// The generation.
        generation: u32,
        /// Age of its last heartbeat, nanoseconds; u64::MAX if it never beat.
        beat_age_ns: u64,
        /// Age of its process, nanoseconds.
        uptime_ns: u64,
        /// Pause before its successor, nanoseconds.
        next_after_ns: u64,
        /// Exit code or signal number.
        code: i32,
        /// Deaths of this stage within the last ten seconds, this one among them.
        deaths_in_window: u32,
        /// A [`DeathCause`].
        cause: u8,
        /// A [`NextStep`].
        next: u8,
        /// 1: the process hung, or was never ready, and the supervisor ended it.
        hung: u8,
        /// The end of its log.
        log_tail: Words,
    }
}

wire_enum! {
    /// A measure against a stall.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    RecoveryStep, unknown = GiveUp {
        /// A new generation of the planner, which solves the full field.
        Replan = 0,
        /// The sensed map is reset.
        Reset = 1,
        /// The mission ends: the target is unreachable.
        GiveUp = 2,
    }
}

wire_enum! {
    /// Why a robot that should get on does not.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    StallCause, unknown = Still {
        /// The robot neither drives nor turns.
        Still = 0,
        /// The robot moves, but does not leave its place.
        Pinned = 1,
        /// The robot is in hazard, u = 0, and drives without coming out.
        InsideHazard = 2,
        /// The robot is where the belief has no way to the target, u = 0.
        CutOff = 3,
        /// Something holds the robot's wheels.
        Held = 4,
        /// The robot drives far and comes no nearer to its target.
        Wandering = 5,
        /// Fixes that agree say that the robot is elsewhere.
        Relocated = 6,
    }
}

payloads! {
    /// Topic `stalls`: the robot should get on and does not. Serialized it is a line of `stalls.jsonl`.
    "firsthand.Stall" StallSample {
        /// Where the robot believes it is, metres.
        x_m: f64,
        /// Where the robot believes it is, metres.
        y_m: f64,
        /// The belief's epoch from now on.
        epoch: u64,
        /// Generations of the planner started for a stall so far in this mission, this one among them.
        replans: u32,
        /// Resets of the sensed map so far in this mission, this one among them.
        resets: u64,
        /// A [`StallCause`].
        cause: u8,
        /// The measure against the stall: a [`RecoveryStep`].
        recovery: u8,
    }
}

impl StallSample {
    /// The cause of the stall.
    pub const fn cause(&self) -> StallCause {
        StallCause::from_byte(self.cause)
    }

    /// The measure against the stall.
    pub const fn recovery(&self) -> RecoveryStep {
        RecoveryStep::from_byte(self.recovery)
    }
}

impl Serialize for StallSample {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut line = to.serialize_struct("Stall", 9)?;
        line.serialize_field("tick", &self.stamp.tick)?;
        line.serialize_field("time_s", &self.stamp.time().seconds())?;
        line.serialize_field("x_m", &self.x_m)?;
        line.serialize_field("y_m", &self.y_m)?;
        line.serialize_field("cause", &self.cause())?;
        line.serialize_field("recovery", &self.recovery())?;
        line.serialize_field("epoch", &self.epoch)?;
        line.serialize_field("replans", &self.replans)?;
        line.serialize_field("resets", &self.resets)?;
        line.end()
    }
}

wire_enum! {
    /// A request of an operator to the supervisor.
    RequestKind, unknown = Nothing {
        /// Nothing.
        Nothing = 0,
        /// A new generation of a stage; one that is held is released.
        Restart = 1,
        /// The robot is to stand.
        Stop = 2,
        /// The robot is to go on.
        Resume = 3,
        /// The robot is to go to these targets, and no longer to those that it has.
        Goto = 4,
        /// The robot is to go to these targets after those that it has.
        Append = 5,
    }
}

wire_enum! {
    /// The supervisor's answer to a request. Each text completes "the supervisor refuses: ".
    RequestAnswer, unknown = Unknown, text = text {
        /// The request is carried out.
        Taken = 0 "it is not refused",
        /// No such request.
        Unknown = 1 "it knows no such request; are both of the same version?",
        /// The mission does not run.
        NotRunning = 2 "the mission has not begun, or ends; wait until `firsthand status` says driving",
        /// An operator stopped the robot.
        Stopped = 3 "an operator stopped the robot; `firsthand resume` first",
        /// No list of targets.
        Malformed = 4 "a target is no place; give 1 to 16 places of finite numbers, metres",
        /// Too many targets.
        TooMany = 5 "a list has at most 16 targets; wait until some are reached",
        /// A target is not inside the perimeter.
        Outside = 6 "a target is outside the perimeter, or on its rim; name a place inside",
        /// A target is in a believed hazard.
        InHazard = 7 "a target is in a believed hazard; name a free place (`firsthand top` shows them)",
        /// A car does not turn on the spot.
        NoHeading = 8 "a car does not turn on the spot, so its targets have no heading; leave it out",
        /// The planner goes where it calibrates.
        FixedTarget = 9 "a calibration drives where it must; wait until it ends",
    }
}

payloads! {
    /// Topic `requests`: an operator's requests to the supervisor.
    "firsthand.Request" RequestSample {
        /// Identifies the request: the roster's `last_request` says that it was taken. Never 0.
        id: u64,
        /// When the operator asked, nanoseconds of the machine's monotonic clock.
        asked_ns: u64,
        /// The stage that the request is about; empty for none.
        stage: Name,
        /// A [`RequestKind`].
        kind: u8,
        /// The number of targets in `targets`.
        target_count: u8,
        targets: [TargetPoint; MOST_TARGETS],
    }
}

impl RequestSample {
    /// The targets; none if their number cannot be.
    pub fn targets(&self) -> Option<&[TargetPoint]> {
        self.targets.get(..usize::from(self.target_count)).filter(|targets| !targets.is_empty())
    }
}

wire_enum! {
    /// A fault that can be injected into a running stage; [`crate::faults::TABLE`] says where and how.
    #[derive(Serialize, Deserialize)]
    FaultKind, unknown = Nothing {
        /// Nothing.
        Nothing = 0,
        /// An iteration of the work loop that does not end.
        Spin = 1,
        /// A current field whose ways all lead to where the robot is.
        CorruptField = 2,
        /// No direction, as where the gradient is zero.
        Saddle = 3,
        /// Hazard believed wherever the robot is.
        HazardAroundRobot = 4,
        /// A closed wall believed around the target, also after a reset.
        CutOff = 5,
        /// The stage beats, and publishes no output.
        Mute = 6,
    }
}

wire_enum! {
    /// A stage's answer to a fault request.
    FaultAnswer, unknown = Refused {
        /// No fault was requested.
        None = 0,
        /// The fault is injected.
        Taken = 1,
        /// Not done: the robot is a real one, and the request does not say `although_real`.
        Refused = 2,
        /// Not done: the stage has no such fault, or nothing yet to break.
        Impossible = 3,
    }
}

payloads! {
    /// Topic `faults`: requests to inject a fault into a stage.
    "firsthand.Fault" FaultSample {
        /// Identifies the request: the stage's `last_fault` in `health` says that it was answered. Never 0.
        id: u64,
        /// The stage that the request is for.
        stage: Name,
        /// A [`FaultKind`].
        kind: u8,
        /// 1: the fault is to be injected although the robot is a real one.
        although_real: u8,
    }
}

payloads! {
    /// Topic `inputs`, header; the slice is a piece of the entries that [`crate::inputs`] describes. Pieces of a generation follow
    /// each other by their sequence.
    "firsthand.InputsHeader" InputsHeader {
        stage: Name,
    }
}

layouts! {
    RosterEntry { stage pid generation state restarts uptime_ns beat_age_ns output_age_ns }
    Words { bytes }
}
