//! Payloads of supervision: health, roster, orders, requests, deaths, stalls, faults.

use std::time::Duration;

use serde::{Deserialize, Serialize, Serializer};

use super::{
    localisation::BeaconRefusal,
    navigation::{MOST_TARGETS, TargetPoint},
};
use crate::{
    bus::{ZeroCopySend, unpadded},
    mission::wire_enum,
};

wire_enum! {
    HealthState, unknown = Starting {
        /// Opening its topics, or waiting for essential input.
        Starting = 0,
        Ready = 1,
        Stopping = 2,
    }
}

pub type Name = [u8; 24];

fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut padded = [0; N];
    for (slot, byte) in padded.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    padded
}

/// Encodes `text` as UTF-8, cut at 24 bytes and padded with zeros.
pub fn name(text: &str) -> Name {
    padded(text)
}

/// Returns the text of a [`Name`]; empty if it is invalid UTF-8.
pub fn name_str(name: &Name) -> &str {
    std::str::from_utf8(unpadded(name)).unwrap_or_default()
}

payloads! {
    "firsthand.Health" HealthSample {
        stage: Name,
        pid: u32,
        /// A [`HealthState`].
        state: u8 as HealthState,
        turns: u64,
        /// Newest fault request to this generation; 0 for none.
        last_fault: u64,
        /// A [`FaultAnswer`].
        fault_answer: u8 as FaultAnswer,
    }
}

wire_enum! {
    /// Supervisor's order to the robot.
    #[derive(Serialize, Deserialize)]
    #[serde(from = "u8", into = "u8")]
    Order, unknown = Stop {
        /// Stand still; start no ticks.
        Hold = 0,
        Drive = 1,
        /// Stand still; the mission ends.
        Stop = 2,
    }
}

payloads! {
    "firsthand.Directive" DirectiveSample {
        /// Epoch of the belief: a mapper with a lower one resets the sensed belief.
        epoch: u64,
        /// An [`Order`].
        order: u8 as Order,
        /// A [`HoldReason`].
        reason: u8 as HoldReason,
    }

    /// Lead of the link over the supervisor in lockstep. It makes a recovery step begin at a tick
    /// that is independent of machine speed.
    "firsthand.TickLimit" TickLimitSample {
        last_tick: u64,
        /// First tick of the newest recovery step; 0 for none.
        holds_from_tick: u64,
        /// Epoch of the belief from that tick on.
        epoch: u64,
        /// Current target: after an arrival, ticks wait for the next target.
        target_number: u64,
    }
}

wire_enum! {
    StageState, unknown = Down {
        Down = 0,
        Starting = 1,
        Running = 2,
        /// Waits before its next start after too many deaths.
        BackingOff = 3,
        /// Was asked to stop, or aborted because it hung.
        Stopping = 4,
        /// Only an operator restarts it after far too many deaths.
        Held = 5,
    }
}

wire_enum! {
    /// Reason why the robot has no order to drive.
    #[derive(Serialize, Deserialize)]
    #[serde(from = "u8", into = "u8")]
    HoldReason, unknown = Starting {
        /// A stage is unready, the robot does not answer, or there is no field yet.
        Starting = 0,
        None = 1,
        /// Lasts until the operator resumes.
        Operator = 2,
        StageHeld = 3,
        Ending = 4,
        /// Waiting for the next target.
        Waiting = 5,
        /// The beacon was not heard for a while, or not yet; the robot continues once it is.
        Lost = 6,
    }
}

payloads! {
    /// Roster; the slice has one [`RosterEntry`] per stage.
    "firsthand.RosterHeader" RosterHeader {
        supervisor_pid: u32,
        /// The current [`Order`].
        order: u8 as Order,
        /// A [`HoldReason`].
        reason: u8 as HoldReason,
        simulated: u8,
        /// Newest answered request; 0 for none.
        last_request: u64,
        /// A [`RequestAnswer`].
        answer: u8 as RequestAnswer,
    }
}

structs! {
    "firsthand.RosterEntry" RosterEntry {
        stage: Name,
        /// 0 for none.
        pid: u32,
        generation: u32,
        /// A [`StageState`].
        state: u8 as StageState,
        restarts: u32,
        uptime_ns: u64,
        /// Age of its last heartbeat; u64::MAX for none yet.
        beat_age_ns: u64,
        /// Age of its last output on any topic; u64::MAX for none yet.
        output_age_ns: u64,
    }
}

wire_enum! {
    DeathCause, unknown = Exited {
        /// `code` is the exit code.
        Exited = 0,
        /// `code` is the signal's number.
        Signalled = 1,
        /// Dumped core; `code` is the signal's number.
        SignalledWithCore = 2,
        /// The process was not the supervisor's child.
        Unknown = 3,
    }
}

impl DeathCause {
    pub fn in_words(self, code: i32) -> String {
        match self {
            Self::Exited => format!("exit code {code}"),
            Self::Signalled => format!("signal {code}"),
            Self::SignalledWithCore => format!("signal {code}, core dumped"),
            Self::Unknown => "ended; systemctl status says how".to_owned(),
        }
    }
}

wire_enum! {
    NextStep, unknown = Nothing {
        /// The run ends.
        Nothing = 0,
        StartNow = 1,
        StartLater = 2,
        /// Only an operator restarts it.
        Hold = 3,
    }
}

structs! {
    /// Text in shared memory.
    "firsthand.Words" Words {
        /// UTF-8, padded with zeros.
        bytes: [u8; 400],
    }
}

/// Encodes `text` as [`Words`], cut at 400 bytes.
pub fn words(text: &str) -> Words {
    Words { bytes: padded(text) }
}

impl Words {
    /// Returns the text, with a replacement for a truncated character.
    pub fn text(&self) -> std::borrow::Cow<'_, str> {
        String::from_utf8_lossy(unpadded(&self.bytes))
    }
}

payloads! {
    /// Trouble of a stage that the user can mend. The stage repeats it while it lasts.
    "firsthand.Complaint" ComplaintSample {
        stage: Name,
        /// Part of the input, by its own name; empty for the whole.
        input: Words,
        what: Words,
        /// Empty if `what` includes it.
        remedy: Words,
    }

    "firsthand.Death" DeathSample {
        stage: Name,
        pid: u32,
        generation: u32,
        /// Age of its last heartbeat; u64::MAX for none.
        beat_age_ns: u64,
        uptime_ns: u64,
        /// Pause before its successor.
        next_after_ns: u64,
        code: i32,
        /// Deaths in the last ten seconds, including this one.
        deaths_in_window: u32,
        /// A [`DeathCause`].
        cause: u8 as DeathCause,
        /// A [`NextStep`].
        next: u8 as NextStep,
        /// 1: the supervisor ended it: it hung or was never ready.
        hung: u8,
        log_tail: Words,
    }
}

wire_enum! {
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    RecoveryStep, unknown = GiveUp {
        /// A new planner generation solves the full field.
        Replan = 0,
        Reset = 1,
        GiveUp = 2,
    }
}

wire_enum! {
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    StallCause, unknown = Still {
        /// The robot neither drives nor turns.
        Still = 0,
        /// The robot moves without leaving its place.
        Pinned = 1,
        /// The robot drives inside a hazard, u = 0, and fails to leave it.
        InsideHazard = 2,
        /// The belief has no path to the target, u = 0.
        CutOff = 3,
        Held = 4,
        /// The robot drives far without approaching its target.
        Wandering = 5,
        /// Consistent fixes or an operator place it elsewhere.
        Relocated = 6,
    }
}

payloads! {
    /// Stall, serialized as a line of `stalls.jsonl`.
    "firsthand.Stall" StallSample {
        /// Believed position, metres.
        x_m: f64,
        y_m: f64,
        /// Epoch from now on.
        epoch: u64,
        /// Planner generations for stalls, including this one.
        replans: u32,
        /// Resets of the sensed map, including this one.
        resets: u64,
        /// A [`StallCause`].
        cause: u8 as StallCause,
        /// A [`RecoveryStep`].
        recovery: u8 as RecoveryStep,
    }
}

impl Serialize for StallSample {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Stall {
            tick: u64,
            time_s: f64,
            x_m: f64,
            y_m: f64,
            cause: StallCause,
            recovery: RecoveryStep,
            epoch: u64,
            replans: u32,
            resets: u64,
        }
        let Self { stamp, x_m, y_m, epoch, replans, resets, .. } = *self;
        let tick = stamp.tick;
        let time_s = stamp.seconds();
        let cause = self.cause();
        let recovery = self.recovery();
        Stall { tick, time_s, x_m, y_m, cause, recovery, epoch, replans, resets }.serialize(to)
    }
}

wire_enum! {
    FollowState, unknown = Lost {
        /// Following has ended.
        Ended = 0,
        Heard = 1,
        /// Not heard for 1 s, or not yet: the robot stands.
        Lost = 2,
    }
}

payloads! {
    /// State of following a beacon, or of the last following.
    "firsthand.Following" FollowingSample {
        /// A [`FollowState`].
        state: u8 as FollowState,
        /// The newest [`BeaconRefusal`].
        refusal: u8 as BeaconRefusal,
        /// Distance that the robot keeps between its centre and the beacon, metres.
        distance_m: f64,
        /// Newest used beacon, metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Mission time of its capture, nanoseconds; u64::MAX for never.
        heard_ns: u64,
        /// Samples of the beacon.
        used: u64,
        refused: u64,
        /// Losses of the beacon after it was heard.
        lost: u64,
        /// Distance and time of the robot meanwhile.
        followed_m: f64,
        followed_s: f64,
    }
}

impl FollowingSample {
    /// Returns the seconds since the beacon was heard, at mission time `now_s`; `None` if never.
    pub fn heard_ago_s(&self, now_s: f64) -> Option<f64> {
        (self.heard_ns != u64::MAX).then(|| (now_s - self.heard_ns as f64 * 1e-9).max(0.0))
    }

    /// Describes the result of the following so far.
    pub fn result(&self) -> String {
        let lost = match self.lost {
            0 => "never lost".to_owned(),
            1 => "lost once".to_owned(),
            2 => "lost twice".to_owned(),
            times => format!("lost {times} times"),
        };
        format!("followed {:.0} m for {:.0} s, {lost}", self.followed_m, self.followed_s)
    }
}

/// Silence of manual requests that stops a manually driven robot.
pub const DEAD_MAN: Duration = Duration::from_millis(300);

wire_enum! {
    RequestKind, unknown = Nothing {
        Nothing = 0,
        /// Starts a new generation of a stage, held or not.
        Restart = 1,
        Stop = 2,
        Resume = 3,
        /// Replaces the robot's targets.
        Goto = 4,
        /// Appends to the robot's targets.
        Append = 5,
        /// Sets the pose of the standing robot to the target, with the deviations.
        Place = 6,
        /// Adds a zone with the targets as corners.
        AddZone = 7,
        /// Removes the zones around the first target.
        RemoveZone = 8,
        /// Drives manually towards the target: ahead and to the left, in shares of full speed. The
        /// robot stops without another such request within [`DEAD_MAN`].
        Hand = 9,
        /// Follows the beacon at the distance in the first deviation.
        Follow = 10,
        /// Ends following and waits for a target.
        EndFollow = 11,
    }
}

wire_enum! {
    /// Supervisor's answer to a request. Each text completes "the supervisor refuses: ".
    RequestAnswer, unknown = Unknown, text = text {
        Taken = 0 "it is not refused",
        Unknown = 1 "the request is unknown; use the supervisor's version of firsthand",
        NotRunning = 2 "the mission has not begun, or is ending; wait until `firsthand status` says driving or waiting",
        Stopped = 3 "an operator stopped the robot; run `firsthand resume` first",
        Malformed = 4 "a target is not a position; give 1 to 16 positions of finite numbers in metres",
        TooMany = 5 "a list has at most 16 targets; wait until some are reached",
        Outside = 6 "a target is outside the perimeter, or on its edge; give a position inside",
        InHazard = 7 "a target is in a believed hazard; give a free position (`firsthand top` shows hazards)",
        NoHeading = 8 "a car cannot turn on the spot to a target's heading; omit the heading",
        FixedTarget = 9 "a calibration sets its own targets; wait until it ends",
        Moves = 10 "the robot moves, or is about to; run `firsthand stop` first",
        NoZone = 11 "a zone has 3 to 16 corners, and a robot has at most 16 zones",
        ZoneHere = 12 "the robot stands in that zone, or overlaps it; drive away first",
        NotInZone = 13 "no zone contains that position",
        NotStaying = 14 "only a robot that stays can be driven by hand or follow; start it with `--stay`",
        TooNear = 15 "at that distance the robot could touch what it follows; give at least 0.3 m more than its radius, and at most 10 m",
        NotFollowing = 16 "the robot is not following",
    }
}

payloads! {
    "firsthand.Request" RequestSample {
        /// Number that the roster's `last_request` repeats with the answer. Never 0.
        id: u64,
        /// Machine's monotonic clock.
        asked_ns: u64,
        /// Empty for none.
        stage: Name,
        /// A [`RequestKind`].
        kind: u8 as RequestKind,
        target_count: u8,
        /// A [`RequestAnswer`], in `orders`.
        answer: u8 as RequestAnswer,
        targets: [TargetPoint; MOST_TARGETS],
        /// Standard deviations of position, metres, and heading, radians. For following, the first
        /// is the distance, metres.
        deviations: [f64; 2],
    }
}

impl RequestSample {
    /// Returns the targets; `None` if the count is 0 or too great.
    pub fn targets(&self) -> Option<&[TargetPoint]> {
        self.targets.get(..usize::from(self.target_count)).filter(|targets| !targets.is_empty())
    }
}

payloads! {
    /// Age of the samples that a mirror shows.
    "firsthand.Mirror" MirrorSample {
        /// Greatest age of the newest sample since its publication by the robot, nanoseconds.
        age_ns: u64,
    }
}

impl MirrorSample {
    pub const fn age_s(&self) -> f64 {
        self.age_ns as f64 * 1e-9
    }
}

wire_enum! {
    /// Fault that can be injected into a running stage; [`crate::faults::TABLE`] says where and
    /// how.
    #[derive(Serialize, Deserialize)]
    FaultKind, unknown = Nothing {
        Nothing = 0,
        /// Endless iteration of the work loop.
        Spin = 1,
        /// Current field whose paths all lead to the robot.
        CorruptField = 2,
        /// Missing direction, as at a zero gradient.
        Saddle = 3,
        HazardAroundRobot = 4,
        /// Closed wall believed around the target, even after a reset.
        CutOff = 5,
        /// Heartbeats without output.
        Mute = 6,
    }
}

wire_enum! {
    FaultAnswer, unknown = Refused {
        None = 0,
        Taken = 1,
        /// The robot is real, and the request lacks `although_real`.
        Refused = 2,
        /// The stage has no such fault, or nothing yet to break.
        Impossible = 3,
    }
}

payloads! {
    "firsthand.Fault" FaultSample {
        /// Number that the stage's `last_fault` in `health` repeats with the answer. Never 0.
        id: u64,
        stage: Name,
        /// A [`FaultKind`].
        kind: u8 as FaultKind,
        /// 1: inject the fault into a real robot too.
        although_real: u8,
    }

    /// Inputs of a stage; the slice is a piece of the entries of [`crate::inputs`], ordered by
    /// sequence within a generation.
    "firsthand.InputsHeader" InputsHeader {
        stage: Name,
    }
}
