use std::{collections::BTreeMap, f64::consts::TAU, path::PathBuf, sync::LazyLock};

use crate::{
    arduino::ArduinoBoard,
    footprint::Footprint,
    kinematics::{Ackermann, DifferentialDrive, Drive, Twist},
    odometry::Odometry,
    response::{Response, ResponseKeys},
    ros2::Ros2Topics,
    sensor::SensorRow,
    touch::TouchRow,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// `models.toml` holds the numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// 1200 counts per wheel turn.
    #[default]
    X80,
    /// 756 counts per wheel turn.
    X80sv,
    /// Clearpath Jackal: four wheels, coupled on each side, as a disc around its corners. Source:
    /// its data sheet, and the `jackal_control` package, also for its accelerations.
    Jackal,
    /// ROBOTIS TurtleBot 3 Burger. Source: its e-Manual; radius and accelerations from its Nav2
    /// parameters.
    #[serde(rename = "turtlebot3-burger")]
    TurtleBot3Burger,
    /// ROBOTIS TurtleBot 3 Waffle. Source: its e-Manual; radius and accelerations from its Nav2
    /// parameters.
    #[serde(rename = "turtlebot3-waffle")]
    TurtleBot3Waffle,
    /// Clearpath TurtleBot 4: a Create 3 with a laser that is turned to its left. Source of the
    /// laser's place: `turtlebot4_description`.
    TurtleBot4,
    /// iRobot Create 3. Source: the control parameters of `create3_sim`, and its documentation of
    /// `safety_override`: by default at most 0.306 m/s, and hardly backwards.
    ///
    /// It comes without a laser; a mission without sensor rows assumes one in its centre.
    Create3,
    /// Yujin Kobuki. Source: its user guide; accelerations from its ROS velocity smoother.
    Kobuki,
    /// Kobuki with a depth camera beside the laser, like a TurtleBot 2.
    TurtleBot2,
    /// Small car on the X80's boards. Nominal: the size of a model car of about 1:14.
    Car,
}

words! {
    #[derive(Default)]
    Protocol {
        #[default]
        X80,
        Json,
        Ros2,
        Arduino,
    }
}

impl Protocol {
    pub const fn has_scans(self) -> bool {
        matches!(self, Self::Json | Self::Ros2)
    }
}

rows! {
    #[derive(Copy, Eq)]
    Channel {
        channel: u8,
        /// Counts fall when the robot drives forward.
        reversed: bool,
    }
}

keys! {
    RobotConfig {
        model: Model,
        /// Defaults to the model's: [`RobotConfig::protocol`].
        protocol: Option<Protocol>,
        /// In the form of [`crate::address::Address`].
        address: Option<String>,
        rate_hz: f64 = 7.0,
        /// r of (2).
        wheel_radius_m: Option<f64>,
        /// W of (2); unused by a car.
        track_m: Option<f64>,
        /// L of (3).
        wheelbase_m: Option<f64>,
        steering_limit_deg: Option<f64>,
        steering_rate_deg_s: Option<f64>,
        /// 0 is straight ahead.
        steering_counts_per_turn: Option<f64>,
        counts_per_turn: Option<f64>,
        radius_m: Option<f64>,
        /// Corners of a body other than a disc, metres in the robot's frame.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        footprint: Vec<DVec2>,
        top_speed_m_s: Option<f64>,
        left: Channel = Channel { channel: 0, reversed: true },
        /// A car's steering is positive to the left.
        right: Channel = Channel { channel: 1, reversed: false },
        speed_trim: Option<bool>,
        gyro: Option<bool>,
        command_limit_s: f64 = 0.25,
        low_battery_v: BatteryLimits,
        /// Defaults to the simulated robot's value; no X80 was measured.
        held_current_ad: u16 = 1000,
        /// Read by [`crate::Mission::with_calibration`].
        calibration: Option<PathBuf>,
        #[serde(skip_serializing_if = "crate::is_default")]
        response: ResponseKeys,
        odometry: Odometry,
        #[serde(skip_serializing_if = "crate::is_default")]
        arduino: ArduinoBoard,
        #[serde(skip_serializing_if = "crate::is_default")]
        ros2: Ros2Topics,
        #[serde(rename = "sensor", skip_serializing_if = "Vec::is_empty")]
        sensors: Vec<SensorRow>,
        /// Up to [`crate::MOST_TOUCHES`] bumpers and cliff sensors; by default those of the model:
        /// [`crate::Mission::touches`].
        #[serde(rename = "touch", skip_serializing_if = "Vec::is_empty")]
        touches: Vec<TouchRow>,
    }
}

keys! {
    /// Low-battery limits, volts; 0 disables a limit.
    ///
    /// The X80's packs have six NiMH cells, 7.2 V. At 1.1 V per cell nine tenths of the charge are
    /// used, and the rest lasts for minutes. With a low board or motor battery the robot drives at
    /// half speed. If one of them stays below 10/11 of its limit (1.0 V per cell) for 2 s, the
    /// mission ends.
    #[derive(Copy)]
    BatteryLimits {
        board: f64 = 6.6,
        motor: f64 = 6.6,
        servo: f64 = 6.6,
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// r.
    pub wheel_radius_m: f64,
    /// W.
    pub track_m: f64,
    pub counts_per_turn: f64,
    /// Radius of a disc that covers the body at any heading.
    pub radius_m: f64,
    /// `None` for a disc.
    pub footprint: Option<Footprint>,
    pub top_speed_m_s: f64,
    pub response: Response,
    pub steering: Option<Steering>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    /// L.
    pub wheelbase_m: f64,
    pub limit_rad: f64,
    pub rate_rad_s: f64,
    pub counts_per_turn: f64,
}

impl Steering {
    pub fn angle(&self, counts: f64) -> f64 {
        counts * TAU / self.counts_per_turn
    }

    /// Converts a steering `angle`, radians, to counts; a rate becomes counts per second.
    pub fn counts(&self, angle: f64) -> f64 {
        angle * self.counts_per_turn / TAU
    }
}

/// Speed of a car that is commanded to turn at a lower one.
const CREEP_M_S: f64 = 0.1;

impl Body {
    pub fn drive(&self) -> Drive {
        match self.ackermann() {
            Some(ackermann) => Drive::Ackermann(ackermann),
            None => Drive::Differential(DifferentialDrive {
                top_wheel_speed: self.top_rad_s(),
                ..self.unlimited()
            }),
        }
    }

    pub fn unlimited(&self) -> DifferentialDrive {
        DifferentialDrive {
            radius: self.wheel_radius_m,
            track: self.track_m,
            top_wheel_speed: f64::INFINITY,
        }
    }

    pub fn top_rad_s(&self) -> f64 {
        self.top_speed_m_s / self.wheel_radius_m
    }

    /// Returns the wheel speeds, rad/s, of the next tick on the way from `told` to `wanted`. They
    /// grow within the body's accelerations and fall at once.
    pub fn reached(&self, told: [f64; 2], wanted: [f64; 2], rate_hz: f64) -> [f64; 2] {
        let Response { acceleration_m_s2, turn_acceleration_rad_s2, .. } = self.response;
        let acceleration = [acceleration_m_s2, turn_acceleration_rad_s2];
        if acceleration == [f64::INFINITY; 2] {
            return wanted;
        }
        assert!(rate_hz > 0.0);
        let drive = self.unlimited();
        let [now, then] = [wanted, told].map(|wheels| drive.twist(wheels));
        let grown = |now: f64, then: f64, acceleration: f64| {
            let most = (then * now.signum()).max(0.0) + acceleration / rate_hz;
            now.clamp(-most, most)
        };
        let omega = grown(now.omega, then.omega, acceleration[1]);
        // Slowing down to keep the curve needs no limit.
        let turned = if omega == now.omega { 1.0 } else { (omega / now.omega).abs() };
        drive.wheels(Twist { v: grown(now.v * turned, then.v, acceleration[0]), omega })
    }

    pub fn ackermann(&self) -> Option<Ackermann> {
        let steering = self.steering?;
        Some(Ackermann {
            wheel_radius: self.wheel_radius_m,
            wheelbase: steering.wheelbase_m,
            steering_limit: steering.limit_rad,
            top_wheel_speed: self.top_rad_s(),
            creep: CREEP_M_S,
        })
    }

    pub fn metres_per_count(&self) -> f64 {
        TAU * self.wheel_radius_m / self.counts_per_turn
    }
}

static MODELS: LazyLock<BTreeMap<Model, RobotConfig>> =
    LazyLock::new(|| toml::from_str(include_str!("models.toml")).unwrap_or_default());

/// Silence of a lost robot, in command limits. It outlasts short radio fades, and the last command
/// has expired.
const SILENT_LIMITS: f64 = 3.0;

impl RobotConfig {
    /// Returns the time without data after which a robot or sensor counts as silent, seconds.
    pub fn silent_after_s(&self) -> f64 {
        SILENT_LIMITS * self.command_limit_s
    }

    pub(crate) fn preset(&self) -> &Self {
        MODELS.get(&self.model).unwrap_or(self)
    }

    pub fn gyro(&self) -> bool {
        self.gyro.unwrap_or_default()
    }

    pub fn protocol(&self) -> Protocol {
        self.protocol.or(self.preset().protocol).unwrap_or_default()
    }

    pub fn body(&self) -> Body {
        let preset = self.preset();
        let value = |of: fn(&Self) -> Option<f64>| of(self).or(of(preset)).unwrap_or_default();
        let track_m = value(|it| it.track_m);
        let written = Footprint::new(&self.footprint).ok();
        let outline = Footprint::new(&preset.footprint).ok();
        let covers_m = written.map(|written| written.circumscribed_m());
        let response = preset.response.over(Response::X80, track_m);
        Body {
            // A radius alone means a disc.
            footprint: written.or(outline.filter(|_| self.radius_m.is_none())),
            wheel_radius_m: value(|it| it.wheel_radius_m),
            track_m,
            counts_per_turn: value(|it| it.counts_per_turn),
            radius_m: self.radius_m.or(covers_m).or(preset.radius_m).unwrap_or_default(),
            top_speed_m_s: value(|it| it.top_speed_m_s),
            response: self.response.over(response, track_m),
            steering: preset.wheelbase_m.map(|_| Steering {
                wheelbase_m: value(|it| it.wheelbase_m),
                limit_rad: value(|it| it.steering_limit_deg).to_radians(),
                rate_rad_s: value(|it| it.steering_rate_deg_s).to_radians(),
                counts_per_turn: value(|it| it.steering_counts_per_turn),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_has_a_body_and_no_other_is_preset() {
        use Model::*;
        let models = [
            &[X80, X80sv, Jackal][..],
            &[TurtleBot3Burger, TurtleBot3Waffle, TurtleBot4],
            &[Create3, Kobuki, TurtleBot2, Car],
        ];
        assert_eq!(MODELS.keys().copied().collect::<Vec<_>>(), models.concat());
        for model in models.concat() {
            let body = RobotConfig { model, ..RobotConfig::default() }.body();
            let sizes = [body.wheel_radius_m, body.track_m, body.radius_m, body.top_speed_m_s];
            assert!(sizes.iter().all(|size| *size > 0.0), "{model:?}: {body:?}");
            let has_outline = matches!(model, Jackal | TurtleBot3Waffle);
            assert_eq!(body.footprint.is_some(), has_outline, "{model:?}");
            assert_eq!(body.steering.is_some(), model == Car, "{model:?}");
        }
    }
}
