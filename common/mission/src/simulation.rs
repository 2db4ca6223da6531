//! Simulated sensors, wheels and radio of the robot, and the moving obstacles around it.
//!
//! Every number has three presets. `realism = "laboratory"` is ideal: rough surfaces, a fast speed
//! loop, a perfect radio. `"measured"`, the default, has the values of real robots; `"harsh"` has
//! wheels that slip five times as much. A key in a mission overrides its preset.
//! `supervisor/guide/simulation-keys.csv` documents each key and its source.

use glam::DVec2;

use crate::geometry::Shapes;

keys! {
    Simulation {
        realism: Realism,
        /// One real robot is reported to ignore it.
        ignores_time: bool,
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
        goes_on_after_contact: bool,
        #[serde(rename = "block", skip_serializing_if = "Vec::is_empty")]
        blocks: Vec<Block>,
        #[serde(rename = "shove", skip_serializing_if = "Vec::is_empty")]
        shoves: Vec<Shove>,
    }
}

words! {
    #[derive(Default)]
    Realism {
        Laboratory,
        /// The radio is perfect unless the mission sets its keys.
        #[default]
        Measured,
        /// More slip than in any log found, in the same direction for each robot.
        Harsh,
    }
}

rows! {
    Ranger {
        /// Index among the six of the standard frame.
        index: u8,
        forward_m: f64,
        bearing_deg: f64,
    }

    /// Obstacle that appears, disappears or moves.
    Thing {
        shape: Shapes,
        /// It appears later while the robot occupies the place.
        #[serde(default)]
        from_s: f64,
        until_s: Option<f64>,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        moves: Vec<Move>,
    }

    #[derive(Copy)]
    Move {
        at_s: f64,
        /// From the shape's position, metres.
        by: DVec2,
    }

    /// Gives way.
    Person {
        at: DVec2,
        goals: Vec<DVec2>,
        /// 1.34 is the mean of people (Helbing and Molnar, 1995).
        #[serde(default = "walking_m_s")]
        speed_m_s: f64,
        /// Nominal.
        #[serde(default = "person_radius_m")]
        radius_m: f64,
    }

    #[derive(Copy)]
    Hole {
        at: DVec2,
        size_m: DVec2,
    }

    #[derive(Copy)]
    Block {
        wheels: BlockedWheels,
        #[serde(default)]
        from_s: f64,
        until_s: Option<f64>,
    }

    /// Motion that the wheels do not measure, until an obstacle is in the way.
    #[derive(Copy)]
    Shove {
        #[serde(default)]
        from_s: f64,
        until_s: Option<f64>,
        /// Share of the wheels' travel lost, as on ice; 1 for a lifted robot.
        #[serde(default)]
        slip: f64,
        /// In the mission frame.
        #[serde(default)]
        velocity_m_s: DVec2,
        #[serde(default)]
        turn_deg_s: f64,
    }
}

pub fn lasts(time_s: f64, from_s: f64, until_s: Option<f64>) -> bool {
    time_s >= from_s && until_s.is_none_or(|until_s| time_s < until_s)
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

words! {
    BlockedWheels {
        Left,
        Right,
        Both,
    }
}

pub type Ranged = (&'static str, f64, std::ops::RangeInclusive<f64>);

const SHARE: std::ops::RangeInclusive<f64> = 0.0..=1.0;

/// Returns the value for `realism` from laboratory, measured and harsh ones; a missing one repeats
/// the one before.
const fn chosen(row: &[f64], realism: Realism) -> f64 {
    let column = realism as usize;
    row[if column < row.len() { column } else { row.len() - 1 }]
}

/// Declares the sections, in the order of the guide: for each the settled struct for the simulator,
/// and the written one with optional keys, from one table of key, range, and a row for [`chosen`].
macro_rules! sections {
    ($(
        $(#[$about:meta])*
        $section:ident: $settled:ident, written as $written:ident {
            $($(#[$doc:meta])* $key:ident in $range:expr => $($value:expr),+;)*
        }
    )*) => {
        $(
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
                    vec![$((
                        concat!("simulation.", stringify!($section), ".", stringify!($key)),
                        self.$key,
                        $range,
                    ),)*]
                }
            }

            rows! {
                #[doc = concat!("`[simulation.", stringify!($section), "]` as a mission writes it: [`", stringify!($settled), "`].")]
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
        )*

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

sections! {
    /// Physics of the ultrasonic rangers (the DUR5200 of the X80, 40 kHz).
    sonar: SonarPhysics, written as SonarKeys {
        /// Half of the beam angle with echoes at full range, degrees.
        cone_deg in 0.0..=60.0 => 15.0;
        /// Half angle at which the last answer fades, degrees; up to `cone_deg` there is no lobe.
        lobe_deg in 0.0..=60.0 => 15.0, 25.0;
        noise_m in 0.0..=1.0 => 0.01;
        noise_per_m in 0.0..=1.0 => 0.005;
        /// 90 is a rough wall.
        wall_limit_deg in 0.0..=90.0 => 90.0, 22.5;
        drum_limit_deg in 0.0..=90.0 => 90.0, 50.0;
        edge_share in SHARE => 0.0, 0.5;
        edge_reach_m in 0.0..=2.55 => 1.2;
        multipath_share in SHARE => 0.0, 0.3;
        dropout_share in SHARE => 0.0;
        /// Weak echoes are those near the limits and from edges.
        weak_dropout_share in SHARE => 0.0, 0.1;
        false_echo_share in SHARE => 0.0, 0.005;
        crosstalk_share in SHARE => 0.0, 0.005;
        /// Independent per ranger: a two-state model (E. N. Gilbert 1960).
        silence_share in 0.0..=0.5 => 0.0, 0.02;
        /// Source: a public eight-sonar log of an L-shaped corridor (Udacity RoboND, 413 samples,
        /// 0.21 s apart). A run lies between two echoes of at most 2.55 m, with at most 0.5 m of
        /// motion. They differ by at most this motion and 0.1 m. There are four runs, of 1, 2, 3
        /// and 7 readings: 3.25 on average, 0.7 s. They are 0.9 % of the 1,402 readings in such
        /// echoes or runs. Without the 0.5 m limit there is a fifth, of 17 (2.1 % in all). Longer
        /// runs, up to 142, look along the corridor.
        silence_mean_s in 0.001..=60.0 => 0.7;
        /// At most one tick. Nominal: a range from a random moment between two 7 Hz ticks averages
        /// half a period.
        age_s in 0.0..=1.0 => 0.0, 0.07;
        /// On the axis. It scales all other echoes: see `x80_sim::sonar`.
        ///
        /// Devantech's technical page of the SRF04, also at 40 kHz, gives "more than 2 m" for a 3
        /// cm broom handle. The X80's ranger was not measured.
        post_reach_m in 0.05..=10.0 => 2.55, 2.0;
    }

    infrared: InfraredPhysics, written as InfraredKeys {
        noise_counts in 0.0..=1000.0 => 5.0, 15.0;
    }

    /// Timing of laser scans from a JSON robot. Moving things are seen where they are when the scan
    /// is sent.
    laser: LaserTiming, written as LaserKeys {
        delay_s in 0.0..=1.0 => 0.0;
        sweep_s in 0.0..=1.0 => 0.0;
        stated_share in SHARE => 1.0;
    }

    /// Gyro of a robot that has one. The bias is constant within a mission.
    gyro: GyroPhysics, written as GyroKeys {
        noise_deg_sqrt_s in 0.0..=10.0 => 0.0, 0.015, 0.05;
        /// Uniform.
        bias_spread_deg_s in 0.0..=10.0 => 0.0, 0.02, 0.05;
        /// Uniform.
        scale_spread in 0.0..=0.5 => 0.0, 0.005, 0.01;
    }

    /// Wheel speed loops and ground contact.
    wheels: WheelPhysics, written as WheelKeys {
        gain in 0.05..=2.0 => 1.0, 0.78;
        delay_s in 0.0..=1.0 => 0.0, 0.07;
        lag_s in 0.0..=5.0 => 0.06, 0.08;
        /// At a wheel rim. The robot's stated response replaces the unwritten keys of delay, lag
        /// and acceleration; for acceleration the model's does, too.
        acceleration_m_s2 in 0.05..=f64::INFINITY => f64::INFINITY;
        dead_band_counts in 0.0..=1000.0 => 0.0, 20.0;
        noise_counts in 0.0..=1000.0 => 0.0, 12.0;
        /// Negative values gain distance.
        slip_share in -0.1..=0.5 => 0.0, 0.0, 0.005;
        /// Uniform.
        slip_share_spread in 0.0..=0.1 => 0.0, 0.005, 0.0;
        /// Measured: the upper end of the intervals of public Khepera III logs.
        slip_noise in 0.0..=0.5 => 0.0, 0.001, 0.005;
        count_noise in 0.0..=100.0 => 0.0, 0.5;
        /// Their mean is nominal.
        diameter_ratio in 0.8..=1.25 => 1.0;
        /// Uniform, so each seed has its own robot. Measured: the root mean square of a Khepera
        /// III's.
        ///
        /// Unequal diameters and an uncertain track dominate the systematic errors of dead
        /// reckoning. Source: J. Borenstein, L. Feng, "Measurement and correction of systematic
        /// odometry errors in mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996:
        /// UMBmark.
        diameter_spread in 0.0..=0.1 => 0.0, 0.008, 0.005;
        track_scale in 0.8..=1.25 => 1.0;
        /// Uniform; same source as `diameter_spread`.
        track_spread in 0.0..=0.1 => 0.0, 0.025, 0.005;
        /// 0 is a stalled wheel.
        ///
        /// The vendor rates each X80 motor at 22 kg cm: 26 N at the rim, 52 N together. Tyres hold
        /// at most the weight, 3.5 kg or 34 N, times the friction, so they slip before the motors
        /// stall.
        contact_slip in SHARE => 0.0, 1.0;
    }

    /// Heights of the body and its sensors above the floor, equal in all presets, for shapes with
    /// `bottom_m` or `top_m`. Nominal: the X80's drawing gives none.
    heights: Heights, written as HeightKeys {
        ground_clearance_m in 0.0..=5.0 => 0.03;
        body_top_m in 0.01..=5.0 => 0.255;
        sonar_m in 0.0..=5.0 => 0.18;
        infrared_m in 0.0..=5.0 => 0.18;
    }

    /// Batteries; all three are alike.
    battery: BatteryPhysics, written as BatteryKeys {
        start_v in 1.0..=9.0 => 7.8;
        drain_v_per_min in 0.0..=9.0 => 0.0, 0.01;
    }

    /// Radio channel that is good or out in both directions alike, and its effects on datagrams.
    radio: Radio, written as RadioKeys {
        outage_share in 0.0..=0.95 => 0.0;
        outage_mean_s in 0.001..=60.0 => 0.5;
        outage_max_s in 0.001..=600.0 => 2.0;
        loss_share in 0.0..=0.95 => 0.0;
        delay_s in 0.0..=5.0 => 0.0;
        jitter_s in 0.0..=5.0 => 0.0;
        duplicate_share in SHARE => 0.0;
        reorder_share in SHARE => 0.0;
        split_share in SHARE => 0.0;
        merge_share in SHARE => 0.0;
    }
}

impl Heights {
    pub fn touched(&self, shapes: &Shapes) -> Shapes {
        shapes.between(self.ground_clearance_m, self.body_top_m)
    }
}
