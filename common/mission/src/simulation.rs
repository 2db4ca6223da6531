//! Simulated sensors, wheels and radio of the robot, and the moving obstacles around it.
//!
//! Every number has three presets. `realism = "laboratory"` is ideal: rough surfaces, a fast speed
//! loop, a perfect radio. `"measured"`, the default, has the values of real robots; `"harsh"` has
//! wheels that slip five times as much. A key in a mission overrides its preset. The guide has all
//! sources.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::geometry::Shapes;

keys! {
    Simulation {
        /// Preset of every unwritten key.
        realism: Realism,
        /// Ignores the time limit of commands, as one real robot is reported to do.
        ignores_time: bool,
        /// Host silence that stops the motors; by default none.
        stops_when_silent_s: Option<f64>,
        sonar: SonarKeys,
        infrared: InfraredKeys,
        laser: LaserKeys,
        gyro: GyroKeys,
        wheels: WheelKeys,
        heights: HeightKeys,
        battery: BatteryKeys,
        radio: RadioKeys,
        /// Rangers besides the front one and its two neighbours.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        ring: Vec<Ranger>,
        #[serde(rename = "thing", skip_serializing_if = "Vec::is_empty")]
        things: Vec<Thing>,
        #[serde(rename = "person", skip_serializing_if = "Vec::is_empty")]
        people: Vec<Person>,
        /// Name of another robot on this machine in the same world, whose mission has the same
        /// frame and names this one.
        #[serde(skip_serializing_if = "Option::is_none")]
        other: Option<String>,
        #[serde(rename = "hole", skip_serializing_if = "Vec::is_empty")]
        holes: Vec<Hole>,
        /// Continues the mission after a contact.
        goes_on_after_contact: bool,
        #[serde(rename = "block", skip_serializing_if = "Vec::is_empty")]
        blocks: Vec<Block>,
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Realism {
    Laboratory,
    /// Errors as measured on real robots. The radio is perfect unless the mission sets its keys.
    #[default]
    Measured,
    /// More slip than in any log found, in the same direction for each robot.
    Harsh,
}

rows! {
    Ranger {
        /// Index among the six of the standard frame.
        index: u8,
        forward_m: f64,
        /// Counter-clockwise from the robot's axis.
        bearing_deg: f64,
    }

    /// Obstacle that appears, disappears or moves.
    Thing {
        /// Shape before any move.
        shape: Shapes,
        /// Time of appearance; it is delayed while the robot occupies the place.
        #[serde(default)]
        from_s: f64,
        /// Absent for a thing that stays.
        until_s: Option<f64>,
        /// Positions in order of time, joined by straight lines.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        moves: Vec<Move>,
    }

    #[derive(Copy)]
    Move {
        at_s: f64,
        /// Displacement from the shape's position, metres.
        by: DVec2,
    }

    /// Person who walks from goal to goal in a loop and gives way.
    Person {
        /// Start position.
        at: DVec2,
        goals: Vec<DVec2>,
        /// Unhindered walking speed; 1.34 is the mean of people (Helbing and Molnar, 1995).
        #[serde(default = "walking_m_s")]
        speed_m_s: f64,
        /// Radius of the person's cylinder; nominal.
        #[serde(default = "person_radius_m")]
        radius_m: f64,
    }

    /// Rectangle without floor. A wheel over it is a contact.
    #[derive(Copy)]
    Hole {
        /// Centre.
        at: DVec2,
        /// Extent along x and y.
        size_m: DVec2,
    }

    /// Block that stops wheels for a while, for example a cable around an axle.
    #[derive(Copy)]
    Block {
        wheels: BlockedWheels,
        #[serde(default)]
        from_s: f64,
        until_s: Option<f64>,
    }
}

const fn walking_m_s() -> f64 {
    1.34
}

const fn person_radius_m() -> f64 {
    0.25
}

impl Hole {
    pub fn contains(&self, point: DVec2) -> bool {
        (2.0 * (point - self.at)).abs().cmplt(self.size_m).all()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BlockedWheels {
    Left,
    Right,
    Both,
}

/// Key, its value and its range.
pub type Ranged = (&'static str, f64, std::ops::RangeInclusive<f64>);

/// Returns the value for `realism` from laboratory, measured and harsh ones; a missing one repeats
/// the one before.
const fn chosen(row: &[f64], realism: Realism) -> f64 {
    let column = realism as usize;
    row[if column < row.len() { column } else { row.len() - 1 }]
}

/// Declares the settled struct for the simulator and the written one with optional keys from one
/// table: key, range, and a row for [`chosen`].
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

        rows! {
            #[doc = concat!("`[", $table, "]` as a mission writes it: [`", stringify!($settled), "`].")]
            #[derive(Copy, Default)]
            #[serde(default)]
            $written { $($(#[$doc])* $key: Option<f64>,)* }
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
    /// Physics of the ultrasonic rangers (the DUR5200 of the X80, 40 kHz).
    SonarPhysics, written as SonarKeys in "simulation.sonar" {
        /// Half of the beam angle with echoes at full range, degrees.
        cone_deg in 0.0..=60.0 => 15.0;
        /// Half angle at which the last answer fades, degrees; up to `cone_deg` there is no lobe.
        lobe_deg in 0.0..=60.0 => 15.0, 25.0;
        /// Standard deviation of a range, metres.
        noise_m in 0.0..=1.0 => 0.01;
        /// Further standard deviation per metre of range.
        noise_per_m in 0.0..=1.0 => 0.005;
        /// Greatest angle between beam and normal of an answering wall, degrees; 90 is a rough
        /// wall.
        wall_limit_deg in 0.0..=90.0 => 90.0, 22.5;
        /// Greatest angle between beam and normal of an answering drum, degrees.
        drum_limit_deg in 0.0..=90.0 => 90.0, 50.0;
        /// Share of pings answered by an edge whose wall is silent.
        edge_share in 0.0..=1.0 => 0.0, 0.5;
        /// Greatest distance at which an edge answers, metres.
        edge_reach_m in 0.0..=2.55 => 1.2;
        /// Share of pings at a wall too oblique to answer that return by a second wall.
        multipath_share in 0.0..=1.0 => 0.0, 0.3;
        /// Share of answers lost one by one.
        dropout_share in 0.0..=1.0 => 0.0;
        /// Dropout share of weak echoes, from near the limits and from edges.
        weak_dropout_share in 0.0..=1.0 => 0.0, 0.1;
        /// Share of pings with a false echo from a shorter distance.
        false_echo_share in 0.0..=1.0 => 0.0, 0.005;
        /// Share of pings that receive a neighbour's echo.
        crosstalk_share in 0.0..=1.0 => 0.0, 0.005;
        /// Share of readings without an echo regardless of obstacles. Silence comes in runs,
        /// independent per ranger (a two-state model, E. N. Gilbert 1960). X80s have shown 2 %.
        silence_share in 0.0..=0.5 => 0.0, 0.02;
        /// Mean duration of a run of silence, seconds.
        ///
        /// Source: a public eight-sonar log of an L-shaped corridor (Udacity RoboND, 413 samples,
        /// 0.21 s apart). A run lies between two echoes of at most 2.55 m, with at most 0.5 m of
        /// motion. They differ by at most this motion and 0.1 m. There are four runs, of 1, 2, 3
        /// and 7 readings: 3.25 on average, 0.7 s. They are 0.9 % of the 1,402 readings in such
        /// echoes or runs. Without the 0.5 m limit there is a fifth, of 17 (2.1 % in all). Longer
        /// runs, up to 142, look along the corridor.
        silence_mean_s in 0.001..=60.0 => 0.7;
        /// Time from a range's measurement to the wheel counts of its tick, seconds, at most one
        /// tick. Nominal: a range from a random moment between two 7 Hz ticks averages half a
        /// period.
        age_s in 0.0..=1.0 => 0.0, 0.07;
        /// Greatest distance at which a post 3 cm in diameter is detected on the axis, metres. It
        /// scales all other echoes: see `x80_sim::sonar`.
        ///
        /// Devantech's technical page of the SRF04, also at 40 kHz, gives "more than 2 m" for a 3
        /// cm broom handle. The X80's ranger was not measured.
        post_reach_m in 0.05..=10.0 => 2.55, 2.0;
    }
}

section! {
    /// Physics of the infrared rangers.
    InfraredPhysics, written as InfraredKeys in "simulation.infrared" {
        /// Standard deviation of a reading, AD counts.
        noise_counts in 0.0..=1000.0 => 5.0, 15.0;
    }
}

section! {
    /// Timing of laser scans from a JSON robot. Moving things are seen where they are when the scan
    /// is sent.
    LaserTiming, written as LaserKeys in "simulation.laser" {
        /// Time from a scan's last beam to its tick, seconds.
        delay_s in 0.0..=1.0 => 0.0;
        /// Time in which the laser measures the beams of a scan, counter-clockwise, seconds.
        sweep_s in 0.0..=1.0 => 0.0;
        /// Share of these times that the robot states; 0 omits them.
        stated_share in 0.0..=1.0 => 1.0;
    }
}

section! {
    /// Gyro of a robot that has one and speaks JSON. The bias is constant within a mission.
    GyroPhysics, written as GyroKeys in "simulation.gyro" {
        /// Standard deviation of the angle, degrees per square root of a second.
        noise_deg_sqrt_s in 0.0..=10.0 => 0.0, 0.015, 0.05;
        /// Greatest bias, uniformly drawn from the seed, degrees per second.
        bias_spread_deg_s in 0.0..=10.0 => 0.0, 0.02, 0.05;
        /// Greatest relative scale error, uniformly drawn from the seed.
        scale_spread in 0.0..=0.5 => 0.0, 0.005, 0.01;
    }
}

section! {
    /// Wheel speed loops and ground contact.
    WheelPhysics, written as WheelKeys in "simulation.wheels" {
        /// Steady speed over commanded speed.
        gain in 0.05..=2.0 => 1.0, 0.78;
        /// Time before a command has any effect, seconds.
        delay_s in 0.0..=1.0 => 0.0, 0.07;
        /// Time constant of the speed loop, seconds.
        lag_s in 0.0..=5.0 => 0.06, 0.08;
        /// Greatest acceleration of a wheel rim, m/s^2. The robot's stated response replaces the
        /// unwritten keys of delay, lag and acceleration; for acceleration the model's does, too.
        acceleration_m_s2 in 0.05..=f64::INFINITY => f64::INFINITY;
        /// Commands below this leave the wheel at rest, counts per second.
        dead_band_counts in 0.0..=1000.0 => 0.0, 20.0;
        /// Standard deviation of the speed of a turning wheel, counts per second.
        noise_counts in 0.0..=1000.0 => 0.0, 12.0;
        /// Share of the rolled distance lost to slip; negative values gain distance.
        slip_share in -0.1..=0.5 => 0.0, 0.0, 0.005;
        /// Greatest error of `slip_share`, uniformly drawn from the seed.
        slip_share_spread in 0.0..=0.1 => 0.0, 0.005, 0.0;
        /// Standard deviation of the distance lost or gained by slip, metres per square root of a
        /// metre. Measured: the upper end of the intervals of public Khepera III logs; see the
        /// guide.
        slip_noise in 0.0..=0.5 => 0.0, 0.001, 0.005;
        /// Standard deviation of a reported wheel position, counts.
        count_noise in 0.0..=100.0 => 0.0, 0.5;
        /// Diameter of the right wheel over that of the left one; their mean is nominal.
        diameter_ratio in 0.8..=1.25 => 1.0;
        /// Greatest relative error of `diameter_ratio`, uniformly drawn, so each seed has its own
        /// robot. Measured: the root mean square of a Khepera III's.
        ///
        /// Unequal diameters and an uncertain track dominate the systematic errors of dead
        /// reckoning. Source: J. Borenstein, L. Feng, "Measurement and correction of systematic
        /// odometry errors in mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996:
        /// UMBmark.
        diameter_spread in 0.0..=0.1 => 0.0, 0.008, 0.005;
        /// Track on the ground over the nominal one.
        track_scale in 0.8..=1.25 => 1.0;
        /// Greatest relative error of `track_scale`, uniformly drawn from the seed; same source as
        /// `diameter_spread`.
        track_spread in 0.0..=0.1 => 0.0, 0.025, 0.005;
        /// Share of the commanded distance that a wheel slips while the body is blocked; 0 is a
        /// stalled wheel.
        ///
        /// The vendor rates each X80 motor at 22 kg cm: 26 N at the rim, 52 N together. Tyres hold
        /// at most the weight, 3.5 kg or 34 N, times the friction, so they slip before the motors
        /// stall.
        contact_slip in 0.0..=1.0 => 0.0, 1.0;
    }
}

section! {
    /// Heights of the body and its sensors above the floor, equal in all presets, for shapes with
    /// `bottom_m` or `top_m`. Nominal: the X80's drawing gives none.
    Heights, written as HeightKeys in "simulation.heights" {
        /// Ground clearance: lower shapes pass under the body, metres.
        ground_clearance_m in 0.0..=5.0 => 0.03;
        /// Top of the body: higher shapes pass over it, metres.
        body_top_m in 0.01..=5.0 => 0.255;
        /// Height of the ultrasonic rangers, metres.
        sonar_m in 0.0..=5.0 => 0.18;
        /// Height of the infrared rangers, metres.
        infrared_m in 0.0..=5.0 => 0.18;
    }
}

section! {
    /// Batteries; all three are alike.
    BatteryPhysics, written as BatteryKeys in "simulation.battery" {
        /// Volts at the start.
        start_v in 1.0..=9.0 => 7.8;
        /// Volts lost per minute.
        drain_v_per_min in 0.0..=9.0 => 0.0, 0.01;
    }
}

section! {
    /// Radio channel that is good or out in both directions alike, and its effects on datagrams.
    Radio, written as RadioKeys in "simulation.radio" {
        /// Share of the time for which the radio is out.
        outage_share in 0.0..=0.95 => 0.0;
        /// Mean duration of an outage, seconds.
        outage_mean_s in 0.001..=60.0 => 0.5;
        /// Longest outage, seconds.
        outage_max_s in 0.001..=600.0 => 2.0;
        /// Share of datagrams lost while the radio is good.
        loss_share in 0.0..=0.95 => 0.0;
        /// One-way delay of a datagram, seconds.
        delay_s in 0.0..=5.0 => 0.0;
        /// Mean of the additional, exponentially distributed delay, seconds.
        jitter_s in 0.0..=5.0 => 0.0;
        /// Share of datagrams that arrive twice.
        duplicate_share in 0.0..=1.0 => 0.0;
        /// Share of datagrams that arrive after the next one.
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

/// Declares the sections, in the order of the guide.
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

            /// Returns each key with its value and range.
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
