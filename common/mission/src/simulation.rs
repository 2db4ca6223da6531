//! The simulated robot's sensors, wheels and radio, and the obstacles that move around it.
//!
//! Every number has three presets. `realism = "laboratory"` is ideal: rough surfaces, a prompt speed loop, a perfect
//! radio. `"measured"`, the default, has the values of real robots, `"harsh"` wheels that slip five times as much; a
//! key in a mission overrides its preset. The guide has the source of each value.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::geometry::Shapes;

keys! {
    Simulation {
        /// The preset of every key that is not written.
        realism: Realism,
        /// One real robot is said to ignore the time limit of commands.
        ignores_time: bool,
        /// The host's silence after which the motors stop; by default they never do.
        stops_when_silent_s: Option<f64>,
        sonar: SonarKeys,
        infrared: InfraredKeys,
        laser: LaserKeys,
        gyro: GyroKeys,
        wheels: WheelKeys,
        heights: HeightKeys,
        battery: BatteryKeys,
        radio: RadioKeys,
        /// Rangers besides the front one and the two at its sides.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        ring: Vec<Ranger>,
        #[serde(rename = "thing", skip_serializing_if = "Vec::is_empty")]
        things: Vec<Thing>,
        #[serde(rename = "person", skip_serializing_if = "Vec::is_empty")]
        people: Vec<Person>,
        /// The name of another robot on this machine, which runs in the same world: a mission with the same frame that names this one.
        #[serde(skip_serializing_if = "Option::is_none")]
        other: Option<String>,
        #[serde(rename = "hole", skip_serializing_if = "Vec::is_empty")]
        holes: Vec<Hole>,
        /// A contact does not end the mission.
        goes_on_after_contact: bool,
        #[serde(rename = "block", skip_serializing_if = "Vec::is_empty")]
        blocks: Vec<Block>,
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Realism {
    Laboratory,
    /// Errors as measured on real robots. The radio is perfect unless the mission says otherwise.
    #[default]
    Measured,
    /// More slip than in any log that was found, each robot's in the same direction.
    Harsh,
}

impl Realism {
    pub const ALL: [Self; 3] = [Self::Laboratory, Self::Measured, Self::Harsh];

    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Laboratory => "laboratory",
            Self::Measured => "measured",
            Self::Harsh => "harsh",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranger {
    /// The index among the six of the standard frame.
    pub index: u8,
    pub forward_m: f64,
    /// Counter-clockwise from the robot's axis.
    pub bearing_deg: f64,
}

/// A thing is not always there, or not always in the same place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thing {
    /// The thing before any move.
    pub shape: Shapes,
    /// It appears later if the robot is in its place.
    #[serde(default)]
    pub from_s: f64,
    /// None is never.
    pub until_s: Option<f64>,
    /// Positions in order of time, with straight lines between them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moves: Vec<Move>,
}

/// Somebody who walks to one goal after the other, again and again, and gives way as people do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// At the start.
    pub at: DVec2,
    pub goals: Vec<DVec2>,
    /// The speed at which somebody walks whom nothing hinders; 1.34 is the mean of people (Helbing and Molnar, 1995).
    #[serde(default = "walking_m_s")]
    pub speed_m_s: f64,
    /// The person is a cylinder of this radius; nominal.
    #[serde(default = "person_radius_m")]
    pub radius_m: f64,
}

const fn walking_m_s() -> f64 {
    1.34
}

const fn person_radius_m() -> f64 {
    0.25
}

/// A rectangle without floor. A wheel over it is a contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Its middle.
    pub at: DVec2,
    /// Along x and y.
    pub size_m: DVec2,
}

impl Hole {
    pub fn contains(&self, point: DVec2) -> bool {
        (2.0 * (point - self.at)).abs().cmplt(self.size_m).all()
    }
}

/// A block keeps wheels from turning for a while, for example a cable around an axle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    pub wheels: BlockedWheels,
    #[serde(default)]
    pub from_s: f64,
    pub until_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BlockedWheels {
    Left,
    Right,
    Both,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    pub at_s: f64,
    /// Displacement from the shape's position, metres.
    pub by: DVec2,
}

/// A key with its value and the range for it.
pub type Ranged = (&'static str, f64, std::ops::RangeInclusive<f64>);

/// The value of `realism` in a row of laboratory, measured and harsh ones; one that is left out is that before it.
const fn chosen(row: &[f64], realism: Realism) -> f64 {
    let column = realism as usize;
    row[if column < row.len() { column } else { row.len() - 1 }]
}

/// Makes two structs from one table of keys: the settled one that the simulator reads, and the written one, whose keys may all be
/// missing. The columns of the table are key, range, and a row for [`chosen`].
macro_rules! section {
    (
        $(#[$about:meta])*
        $settled:ident, written as $written:ident in $table:literal {
            $($(#[$doc:meta])* $key:ident in $range:expr => $($value:expr),+;)*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $settled {
            $($(#[$doc])* pub $key: f64,)*
        }

        impl $settled {
            pub const fn preset(realism: Realism) -> Self {
                Self { $($key: chosen(&[$($value),+], realism),)* }
            }

            fn ranges(&self) -> Vec<Ranged> {
                vec![$((concat!($table, ".", stringify!($key)), self.$key, $range),)*]
            }
        }

        #[doc = concat!("`[", $table, "]` as a mission writes it: [`", stringify!($settled), "`].")]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $written {
            $($(#[$doc])* pub $key: Option<f64>,)*
        }

        impl $written {
            pub fn over(&self, realism: Realism) -> $settled {
                let preset = $settled::preset(realism);
                $settled { $($key: self.$key.unwrap_or(preset.$key),)* }
            }
        }
    };
}

section! {
    /// The ultrasonic rangers' physics (the DUR5200 of the X80, 40 kHz).
    SonarPhysics, written as SonarKeys in "simulation.sonar" {
        /// Half of the beam angle within which the sonar hears an echo at its full range, degrees.
        cone_deg in 0.0..=60.0 => 15.0;
        /// Half angle at which the last answer fades, degrees; no wider than the cone is no lobe.
        lobe_deg in 0.0..=60.0 => 15.0, 25.0;
        /// Standard deviation of a range, metres.
        noise_m in 0.0..=1.0 => 0.01;
        /// Further standard deviation per metre of range.
        noise_per_m in 0.0..=1.0 => 0.005;
        /// Greatest angle between beam and normal at which a wall answers, degrees; 90 is a rough wall.
        wall_limit_deg in 0.0..=90.0 => 90.0, 22.5;
        /// Greatest angle between beam and normal at which a drum answers, degrees.
        drum_limit_deg in 0.0..=90.0 => 90.0, 50.0;
        /// Share of pings that an edge answers when its wall does not.
        edge_share in 0.0..=1.0 => 0.0, 0.5;
        /// Farthest an edge answers, metres.
        edge_reach_m in 0.0..=2.55 => 1.2;
        /// Share of pings at a wall too oblique to answer whose echo comes back by a second wall.
        multipath_share in 0.0..=1.0 => 0.0, 0.3;
        /// Share of answers lost one by one.
        dropout_share in 0.0..=1.0 => 0.0;
        /// The dropout share of weak echoes, which come from near the limits and from edges.
        weak_dropout_share in 0.0..=1.0 => 0.0, 0.1;
        /// Share of pings with a false echo from a shorter distance.
        false_echo_share in 0.0..=1.0 => 0.0, 0.005;
        /// Share of pings that receive a neighbour's echo.
        crosstalk_share in 0.0..=1.0 => 0.0, 0.005;
        /// Share of the readings in which a ranger hears nothing, whatever stands there: runs of silence, each ranger's
        /// for itself (a two-state model, E. N. Gilbert 1960). 2 % has been seen on X80s.
        silence_share in 0.0..=0.5 => 0.0, 0.02;
        /// Mean duration of such a run, seconds.
        ///
        /// From a public eight-sonar log of an L-shaped corridor (Udacity RoboND, 413 samples, one each 0.21 s): the
        /// silences between two echoes of 2.55 m at most that differ by no more than the robot moved and 0.1 m,
        /// while it moved 0.5 m at most. There are four, of 1, 2, 3 and 7 readings: 3.25 on average, 0.7 s, and 0.9 % of
        /// the 1,402 readings that are echoes of 2.55 m at most or one of these. Without the limit of 0.5 m there is a
        /// fifth, of 17 (2.1 % in all). The longer ones, up to 142, look out into the corridor: geometry makes those.
        silence_mean_s in 0.001..=60.0 => 0.7;
        /// The time from the measurement of a range to the wheel counts of the same tick, seconds, at most a tick. A range that was measured
        /// at any moment between two ticks of 7 Hz is half a period old on average. This value is nominal, not measured.
        age_s in 0.0..=1.0 => 0.0, 0.07;
        /// The greatest distance at which a post 3 cm in diameter is detected on the axis, metres. All other echoes follow from it: see
        /// `x80_sim::sonar`. Devantech's technical page of the SRF04, another ranger at 40 kHz, gives "more than 2 m" for a broom handle of
        /// 3 cm. The X80's ranger was not measured.
        post_reach_m in 0.05..=10.0 => 2.55, 2.0;
    }
}

section! {
    /// The infrared rangers' physics.
    InfraredPhysics, written as InfraredKeys in "simulation.infrared" {
        /// Standard deviation of a reading, AD counts.
        noise_counts in 0.0..=1000.0 => 5.0, 15.0;
    }
}

section! {
    /// When a robot that speaks JSON sends its laser's scans. Things that move are seen where they are when the scan is sent.
    LaserTiming, written as LaserKeys in "simulation.laser" {
        /// Time from a scan's last beam to its tick, seconds.
        delay_s in 0.0..=1.0 => 0.0;
        /// Time in which the laser measures the beams of a scan one after another, counter-clockwise, seconds.
        sweep_s in 0.0..=1.0 => 0.0;
        /// Share of these times that the robot states; with 0 it says nothing of them.
        stated_share in 0.0..=1.0 => 1.0;
    }
}

section! {
    /// The gyro of a robot that has one and speaks JSON. The bias does not change within a mission.
    GyroPhysics, written as GyroKeys in "simulation.gyro" {
        /// Standard deviation of the angle, degrees per square root of a second.
        noise_deg_sqrt_s in 0.0..=10.0 => 0.0, 0.015, 0.05;
        /// Greatest bias, evenly drawn from the seed, degrees per second.
        bias_spread_deg_s in 0.0..=10.0 => 0.0, 0.02, 0.05;
        /// Greatest error of the scale, as a share of it, evenly drawn from the seed.
        scale_spread in 0.0..=0.5 => 0.0, 0.005, 0.01;
    }
}

section! {
    /// The wheels' speed loops and how they meet the ground.
    WheelPhysics, written as WheelKeys in "simulation.wheels" {
        /// Steady speed over commanded speed.
        gain in 0.05..=2.0 => 1.0, 0.78;
        /// Time before a command has any effect, seconds.
        delay_s in 0.0..=1.0 => 0.0, 0.07;
        /// Time constant of the speed loop, seconds.
        lag_s in 0.0..=5.0 => 0.06, 0.08;
        /// The most by which a rim gains or loses speed, m/s^2. Where this or the delay is not written and the robot's response is
        /// stated or its model's, the simulated base has that.
        acceleration_m_s2 in 0.05..=f64::INFINITY => f64::INFINITY;
        /// Commands below this do not turn the wheel, counts per second.
        dead_band_counts in 0.0..=1000.0 => 0.0, 20.0;
        /// Standard deviation of the speed of a turning wheel, counts per second.
        noise_counts in 0.0..=1000.0 => 0.0, 12.0;
        /// Share of the rolled way that slips away; below 0 it is won.
        slip_share in -0.1..=0.5 => 0.0, 0.0, 0.005;
        /// Greatest error of `slip_share`, evenly drawn from the seed.
        slip_share_spread in 0.0..=0.1 => 0.0, 0.005, 0.0;
        /// Standard deviation of the way lost or won by slip, metres per square root of a metre. Measured: the upper end of the
        /// intervals of public logs of a Khepera III; see the guide.
        slip_noise in 0.0..=0.5 => 0.0, 0.001, 0.005;
        /// Standard deviation of a reported wheel position, counts.
        count_noise in 0.0..=100.0 => 0.0, 0.5;
        /// Diameter of the right wheel over that of the left one; their mean is the nominal one.
        diameter_ratio in 0.8..=1.25 => 1.0;
        /// Greatest error of `diameter_ratio`, as a share of it, evenly drawn from the seed: each seed has a robot of its own. Unequal
        /// diameters and an uncertain track are the two systematic errors that dominate dead reckoning (J. Borenstein, L. Feng,
        /// "Measurement and correction of systematic odometry errors in mobile robots", IEEE
        /// Trans. Robotics and Automation 12(6), 1996: UMBmark). Measured: the root mean square of a Khepera III's.
        diameter_spread in 0.0..=0.1 => 0.0, 0.008, 0.005;
        /// Track on the ground over the nominal one.
        track_scale in 0.8..=1.25 => 1.0;
        /// Greatest error of `track_scale`, as a share of it, evenly drawn from the seed; the source of `diameter_spread`.
        track_spread in 0.0..=0.1 => 0.0, 0.025, 0.005;
        /// Share of the way asked of a wheel that it turns on, slipping, while something holds the body; 0 is a wheel
        /// that stalls. The vendor gives each motor of an X80 22 kg cm: 26 N at the rim, 52 N together. Tyres hold at most
        /// the weight, 3.5 kg or 34 N, times the friction: they slip before the motors stall.
        contact_slip in 0.0..=1.0 => 0.0, 1.0;
    }
}

section! {
    /// The heights of the body and its sensors above the floor, equal in all presets. They are nominal, because the X80's drawing gives
    /// none. They matter for shapes of the world that have `bottom_m` or `top_m`.
    Heights, written as HeightKeys in "simulation.heights" {
        /// Shapes below this height pass under the body, metres.
        ground_clearance_m in 0.0..=5.0 => 0.03;
        /// Shapes above this height pass over the body, metres.
        body_top_m in 0.01..=5.0 => 0.255;
        /// The ultrasonic rangers, metres.
        sonar_m in 0.0..=5.0 => 0.18;
        /// The infrared rangers, metres.
        infrared_m in 0.0..=5.0 => 0.18;
    }
}

section! {
    /// The batteries: all three alike.
    BatteryPhysics, written as BatteryKeys in "simulation.battery" {
        /// Volts at the start.
        start_v in 1.0..=9.0 => 7.8;
        /// Volts lost a minute.
        drain_v_per_min in 0.0..=9.0 => 0.0, 0.01;
    }
}

section! {
    /// The radio: a channel that is good or out, both ways alike, and what it does to datagrams.
    Radio, written as RadioKeys in "simulation.radio" {
        /// Share of the time for which the radio is out.
        outage_share in 0.0..=0.95 => 0.0;
        /// Mean duration of an outage, seconds.
        outage_mean_s in 0.001..=60.0 => 0.5;
        /// No outage is longer, seconds.
        outage_max_s in 0.001..=600.0 => 2.0;
        /// Share of datagrams lost while the radio is good.
        loss_share in 0.0..=0.95 => 0.0;
        /// Time a datagram takes each way, seconds.
        delay_s in 0.0..=5.0 => 0.0;
        /// Mean of the further time a datagram takes, exponentially distributed, seconds.
        jitter_s in 0.0..=5.0 => 0.0;
        /// Share of datagrams that arrive twice.
        duplicate_share in 0.0..=1.0 => 0.0;
        /// Share of datagrams that arrive behind the next.
        reorder_share in 0.0..=1.0 => 0.0;
        /// Share of datagrams that arrive in two parts.
        split_share in 0.0..=1.0 => 0.0;
        /// Share of datagrams that arrive joined to the next.
        merge_share in 0.0..=1.0 => 0.0;
    }
}

impl Heights {
    pub fn touched(&self, shapes: &Shapes) -> Shapes {
        shapes.between(self.ground_clearance_m, self.body_top_m)
    }
}

/// The sections, in the order of the guide.
macro_rules! physics {
    ($($section:ident: $settled:ident,)*) => {
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Physics {
            $(pub $section: $settled,)*
        }

        impl Simulation {
            pub fn physics(&self) -> Physics {
                Physics { $($section: self.$section.over(self.realism),)* }
            }

            /// Each key, its value and the range for it.
            pub fn ranges(&self) -> Vec<Ranged> {
                let physics = self.physics();
                [$(physics.$section.ranges(),)*].concat()
            }
        }
    };
}

physics! {
    sonar: SonarPhysics,
    infrared: InfraredPhysics,
    laser: LaserTiming,
    gyro: GyroPhysics,
    wheels: WheelPhysics,
    heights: Heights,
    battery: BatteryPhysics,
    radio: Radio,
}
