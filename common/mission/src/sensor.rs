//! THE table of the robot's ranging sensors. Link, mapper and simulator read it, and a reading names its sensor by
//! the row.
//!
//! A mission writes rows as `[[robot.sensor]]`. Without them the table is that of the X80: the front sonar as
//! `[sonar]` says, the two beside it, and seven infrared rangers. The key `sensors` says which rows the mapper uses.

use serde::{Deserialize, Serialize};

use crate::sonar::Mount;

/// The limit also holds for the readings in a sample of `ranges`.
pub const MOST_SENSORS: usize = 16;
/// Of all lasers together.
pub const MOST_BEAMS: usize = 16_384;
pub const MOST_LASERS: usize = 4;
pub const INFRARED_RANGERS: usize = 7;
pub const SONARS: usize = 6;

/// The two sonars beside the front one: degrees from it, and metres from the robot's centre.
const SIDE_BEARING_DEG: f64 = 45.0;
const SIDE_FORWARD_M: f64 = 0.194;
/// Sonars within this of the front one's bearing belong to the set "three-front".
const BESIDE_FRONT_DEG: f64 = 60.0;

/// Bearing from the robot's axis, degrees counter-clockwise, and distance from the centre as a share of the body's
/// radius, in the order of the frames, on which two independent drivers agree: from left to right in front, then
/// right, rear, left. The rangers at the sides of an X80 are 121 mm from the centre, the others at the rim.
const RING: [(f64, f64); INFRARED_RANGERS] = [
    (33.75, 1.0),
    (11.25, 1.0),
    (-11.25, 1.0),
    (-33.75, 1.0),
    (-90.0, 0.121 / 0.19),
    (180.0, 1.0),
    (90.0, 0.121 / 0.19),
];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SensorKind {
    /// A sonar: something stands on the arc of an echo, and nothing that is square to the beam stands nearer.
    #[default]
    Cone,
    /// An infrared ranger: the ray is free up to where it ends.
    Ray,
    /// A laser, or a depth camera: a fan of beams, each of which is free up to where it ends.
    Scan,
}

/// A product, for the mapper's model of its readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensorModel {
    /// The DUR5200 of the X80, 40 kHz, a cone. Source: the X80's user manual, 2006; `sonar_model` of the mapper has its numbers.
    Dur5200,
    /// The infrared ranger of the X80, 10 to 80 cm, a ray. Source: the formula in the X80's user manual, 2006; `infrared_model` of the
    /// mapper has its numbers.
    X80Infrared,
    /// Hokuyo's UST-10LX, a laser: 270 degrees in 1,081 beams, 0.06 to 10 m, 40 Hz. Source: its specification, C-42-04077, 2014.
    #[serde(rename = "ust-10lx")]
    Ust10lx,
    /// Slamtec's RPLIDAR A1, a laser: 360 degrees, 0.15 to 12 m, 5.5 Hz, 8,000 readings a second. Source: its data sheet, 2020.
    RplidarA1,
    /// Slamtec's RPLIDAR C1, a laser: 360 degrees in 500 readings, 0.05 to 12 m, 10 Hz, 30 mm. Source: its data sheet, 2023.
    RplidarC1,
    /// The LDS-02 of a TurtleBot 3, a laser: 360 degrees in steps of 1, 0.16 to 8 m, 5 Hz. Source: ROBOTIS e-Manual.
    #[serde(rename = "lds-02")]
    Lds02,
    /// Intel's RealSense D435, a depth camera, as a fan: each beam is the nearest thing in a column of its picture that the body can touch,
    /// as ROS's `pointcloud_to_laserscan` makes it. 87 by 58 degrees, 0.3 to 3 m, 2 % at 2 m. Source: its product brief, 2018; two
    /// columns a degree are nominal.
    D435,
}

/// A laser that may have a serial line of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rplidar {
    pub baud: u32,
    /// The time from one measurement of a standard scan to the next.
    pub sample_us: u16,
    pub turns_hz: f64,
    /// Its motor stands while the line's DTR is set.
    pub stands_by_dtr: bool,
    /// The byte of its model in its own words.
    pub number: u8,
}

/// What the source of a [`SensorModel`] says of it.
pub(crate) struct Product {
    pub(crate) kind: SensorKind,
    /// A ray has 0.
    field_of_view_deg: f64,
    reach_m: f64,
    least_m: f64,
    /// A sensor that is no laser has 1.
    beams: usize,
    noise: (f64, f64),
    /// The upright field of view of a depth camera, degrees; 0 of others.
    tall_deg: f64,
}

impl SensorModel {
    pub(crate) const fn product(self) -> Product {
        use SensorKind::{Cone, Ray, Scan};
        let (kind, field_of_view_deg, reach_m, least_m, beams, noise) = match self {
            Self::Dur5200 => (Cone, 30.0, 2.55, 0.0, 1, (0.0, 0.0)),
            Self::X80Infrared => (Ray, 0.0, 0.81, 0.0, 1, (0.0, 0.0)),
            Self::Ust10lx => (Scan, 270.0, 10.0, 0.06, 1081, (0.02, 0.0)),
            Self::RplidarA1 => (Scan, 360.0, 12.0, 0.15, 360, (0.005, 0.005)),
            Self::RplidarC1 => (Scan, 360.0, 12.0, 0.05, 500, (0.015, 0.0)),
            Self::Lds02 => (Scan, 360.0, 8.0, 0.16, 360, (0.0075, 0.025)),
            Self::D435 => (Scan, 87.0, 3.0, 0.3, 175, (0.005, 0.01)),
        };
        let tall_deg = if matches!(self, Self::D435) { 58.0 } else { 0.0 };
        Product { kind, field_of_view_deg, reach_m, least_m, beams, noise, tall_deg }
    }

    /// An A1 measures 8,000 times a second, of which its line carries 2,304 in a standard scan: it says one in four.
    pub const fn rplidar(self) -> Option<Rplidar> {
        match self {
            Self::RplidarA1 => Some(Rplidar {
                baud: 115_200,
                sample_us: 508,
                turns_hz: 5.5,
                stands_by_dtr: true,
                number: 0x18,
            }),
            Self::RplidarC1 => Some(Rplidar {
                baud: 460_800,
                sample_us: 200,
                turns_hz: 10.0,
                stands_by_dtr: false,
                number: 0x41,
            }),
            _ => None,
        }
    }

    const fn of(kind: SensorKind) -> Self {
        match kind {
            SensorKind::Cone => Self::Dur5200,
            SensorKind::Ray => Self::X80Infrared,
            SensorKind::Scan => Self::Ust10lx,
        }
    }

    /// Reach at a black surface, which reflects a tenth of the light. The specification of the UST-10LX gives 4 m, and
    /// 10 m for white. The others are given the same share of their reach, which is nominal: Slamtec gives it for its
    /// RPLIDAR A3 (black 10 m, white 25 m).
    pub const fn black_reach_m(self) -> f64 {
        0.4 * self.reach_m()
    }

    pub const fn field_of_view_deg(self) -> f64 {
        self.product().field_of_view_deg
    }

    pub const fn reach_m(self) -> f64 {
        self.product().reach_m
    }

    pub const fn least_m(self) -> f64 {
        self.product().least_m
    }

    /// The rise of its highest beam, and the fall of its lowest, a metre; 0 for a laser, whose beams are level.
    pub fn rise(self) -> f64 {
        (0.5 * self.product().tall_deg).to_radians().tan()
    }

    /// The range from which a beam passes no thing that the body can touch, metres: a depth camera looks over and under what is nearer.
    pub fn clears_from_m(self) -> f64 {
        let Product { least_m, tall_deg, .. } = self.product();
        if tall_deg > 0.0 { least_m } else { 0.0 }
    }

    /// Standard deviation of a range: metres, and a share of it. The manuals give 15 mm up to half a metre and 5 %
    /// beyond for the LDS-02, less than 1 % for the A1, 40 mm at most for the UST-10LX: these are taken as two
    /// deviations.
    pub const fn beam_noise(self) -> (f64, f64) {
        self.product().noise
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorRow {
    pub name: String,
    pub kind: SensorKind,
    /// Of an X80: a cone has the sonar's index in the standard frame, 0 to 5, a ray the infrared ranger, 0 to 6. Other robots' protocols
    /// have no channels.
    pub channel: Option<u8>,
    /// Distance from the robot's centre along its bearing.
    pub forward_m: f64,
    /// delta of (19), from the robot's axis counter-clockwise.
    pub bearing_deg: f64,
    /// Angle from the bearing to a laser's middle beam, counter-clockwise; 0 looks outward.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub turned_deg: f64,
    /// 180 for a laser that is mounted upside down, otherwise 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub roll_deg: f64,
    /// A laser's, above the ground, which the simulator alone reads; by default `simulation.heights.infrared_m`.
    pub height_m: Option<f64>,
    /// The default is the model's; a ray has none.
    pub field_of_view_deg: Option<f64>,
    /// The default is the model's.
    pub reach_m: Option<f64>,
    /// Beams lie evenly over the field of view; the default is the model's.
    pub beams: Option<u16>,
    /// A sensor may measure less often than the frames come. Readings between are not used.
    pub rate_hz: Option<f64>,
    /// The default is the X80's.
    pub model: Option<SensorModel>,
    /// Of an RPLIDAR with a wire of its own, written as that of the robot.
    pub address: Option<String>,
}

fn is_zero(deg: &f64) -> bool {
    *deg == 0.0
}

keys! {
    /// The front sonar of a robot without `[[robot.sensor]]`.
    SonarConfig {
        /// The index among the six of the standard frame.
        index: u8 = 1,
        /// Distance from the robot's centre along its bearing; the paper writes W/2.
        forward_m: f64 = 0.1915,
        /// delta of (19), from the robot's axis.
        bearing_deg: f64,
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    pub name: String,
    pub kind: SensorKind,
    /// The row's, or the least that no other sensor of its kind has.
    pub channel: u8,
    pub mount: Mount,
    /// A ray has 0.
    pub field_of_view_deg: f64,
    pub reach_m: f64,
    /// A sensor that is no laser has 1.
    pub beams: usize,
    pub is_upside_down: bool,
    pub height_m: Option<f64>,
    pub every_ticks: u64,
    pub model: SensorModel,
    pub used: bool,
}

impl Sensor {
    fn of(row: &SensorRow, channel: u8, rate_hz: f64) -> Self {
        let model = row.model.unwrap_or(SensorModel::of(row.kind));
        let product = model.product();
        Self {
            name: row.name.clone(),
            kind: row.kind,
            channel,
            mount: Mount {
                forward_m: row.forward_m,
                bearing_rad: row.bearing_deg.to_radians(),
                turned_rad: row.turned_deg.to_radians(),
            },
            field_of_view_deg: row.field_of_view_deg.unwrap_or(product.field_of_view_deg),
            reach_m: row.reach_m.unwrap_or(product.reach_m),
            every_ticks: row.rate_hz.map_or(1.0, |hz| (rate_hz / hz).round().max(1.0)) as u64,
            is_upside_down: row.roll_deg != 0.0,
            height_m: row.height_m,
            beams: row.beams.map_or(product.beams, usize::from),
            model,
            used: false,
        }
    }

    /// Bearing of the first beam from the sensor's own, and the angle from beam to beam, radians counter-clockwise.
    pub fn fan(&self) -> (f64, f64) {
        let wide = self.field_of_view_deg.to_radians();
        // The first and last beam of a whole turn would coincide.
        let steps = if wide >= std::f64::consts::TAU - 1e-9 { self.beams } else { self.beams - 1 };
        (-wide / 2.0, wide / steps.max(1) as f64)
    }

    /// The robot's frame of a laser that is mounted upside down has its beams in the other order: mirrored on its middle beam. The mirror
    /// image of the mirror image is the original.
    pub fn mirror<T>(&self, beams: &mut [T]) {
        let is_circle = self.field_of_view_deg >= 360.0;
        // The first beam of a whole turn looks back, and so does its mirror image.
        if let Some(mirrored) = beams.get_mut(usize::from(is_circle)..)
            && self.is_upside_down
        {
            mirrored.reverse();
        }
    }

    /// The number of a beam before [`Sensor::mirror`] or after it.
    pub fn mirrored(&self, beam: usize) -> usize {
        match (self.is_upside_down, self.field_of_view_deg >= 360.0) {
            (false, _) => beam,
            (true, true) => self.beams.saturating_sub(beam) % self.beams.max(1),
            (true, false) => self.beams.saturating_sub(beam + 1),
        }
    }

    /// Angle from the robot's axis to where it turns to look at a place. For a laser that sees all around it is the
    /// bearing: such a laser is never turned.
    pub fn faces_rad(&self) -> f64 {
        match self.field_of_view_deg >= 360.0 {
            true => self.mount.bearing_rad,
            false => self.mount.looks_rad(),
        }
    }

    pub fn bearing_deg(&self) -> f64 {
        self.mount.bearing_rad.to_degrees()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sensors {
    /// The cone whose bearing is the least.
    Front,
    #[serde(rename = "front+infrared")]
    FrontInfrared,
    /// The front sonar and the cones within 60 degrees of it.
    ThreeFront,
    Laser,
    All,
}

/// The sensors on a robot with frames at `rate_hz`; those of `set` are marked as used.
pub(crate) fn table(
    rows: &[SensorRow],
    rate_hz: f64,
    sonar: &SonarConfig,
    set: Sensors,
) -> Vec<Sensor> {
    let mut table: Vec<Sensor> = Vec::with_capacity(rows.len());
    for row in rows {
        let of_kind = |other: &&SensorRow| other.kind == row.kind;
        let is_free = |channel: &u8| {
            !rows.iter().filter(of_kind).any(|other| other.channel == Some(*channel))
                && !table.iter().any(|held| (held.kind, held.channel) == (row.kind, *channel))
        };
        let channel = row.channel.or_else(|| (0..=u8::MAX).find(is_free)).unwrap_or_default();
        table.push(Sensor::of(row, channel, rate_hz));
    }
    let Some(front) = front(&table, sonar) else {
        return table;
    };
    let front_deg = table[front].bearing_deg();
    for (index, sensor) in table.iter_mut().enumerate() {
        let beside = (sensor.bearing_deg() - front_deg).abs() <= BESIDE_FRONT_DEG;
        let is_cone = sensor.kind == SensorKind::Cone;
        let is_scan = sensor.kind == SensorKind::Scan;
        sensor.used = index == front && set != Sensors::Laser
            || match set {
                Sensors::Front => false,
                Sensors::FrontInfrared => sensor.kind == SensorKind::Ray,
                Sensors::Laser => is_scan,
                Sensors::ThreeFront => is_cone && beside,
                Sensors::All => true,
            };
    }
    table
}

/// Without rows of the mission it is the first, wherever `[sonar]` says that it looks. A robot without sonars has
/// instead the sensor that looks most nearly there.
pub(crate) fn front(table: &[Sensor], sonar: &SonarConfig) -> Option<usize> {
    let ahead = |sensor: &Sensor| (sensor.bearing_deg() - sonar.bearing_deg).abs();
    let any_cone = table.iter().any(|sensor| sensor.kind == SensorKind::Cone);
    let candidates = table.iter().enumerate();
    let candidates = candidates.filter(|(_, sensor)| !any_cone || sensor.kind == SensorKind::Cone);
    candidates.min_by(|(_, a), (_, b)| ahead(a).total_cmp(&ahead(b))).map(|(index, _)| index)
}

/// The car has the same boards and sensors.
pub(crate) fn x80(radius_m: f64, sonar: &SonarConfig) -> Vec<SensorRow> {
    let cone = |name, beside: u8, forward_m, bearing_deg| SensorRow {
        name: String::from(name),
        channel: Some((sonar.index % SONARS as u8 + beside) % SONARS as u8),
        forward_m,
        bearing_deg,
        ..SensorRow::default()
    };
    let ahead = sonar.bearing_deg;
    let cones = [
        cone("front", 0, sonar.forward_m, ahead),
        cone("front-left", 5, SIDE_FORWARD_M, ahead + SIDE_BEARING_DEG),
        cone("front-right", 1, SIDE_FORWARD_M, ahead - SIDE_BEARING_DEG),
    ];
    let rays = (0..).zip(RING).map(|(channel, (bearing_deg, share))| SensorRow {
        name: format!("infrared-{channel}"),
        kind: SensorKind::Ray,
        channel: Some(channel),
        forward_m: share * radius_m,
        bearing_deg,
        ..SensorRow::default()
    });
    cones.into_iter().chain(rays).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::DVec2;

    use super::*;
    use crate::{Mission, kinematics::Pose2};

    fn mission(extra: &str) -> Mission {
        Mission::parse(&format!("target = [1, 0]\n{extra}"), Path::new("test.toml")).unwrap()
    }

    fn used(extra: &str) -> Vec<String> {
        let table = mission(extra).sensor_table();
        table.into_iter().filter(|sensor| sensor.used).map(|sensor| sensor.name).collect()
    }

    const ROWS: &str = "[[robot.sensor]]\nname = 'nose'\nkind = 'cone'\nchannel = 4\nforward_m = 0.2\nbearing_deg = 5\nrate_hz = 3.5\n\
        [[robot.sensor]]\nname = 'eye'\nkind = 'ray'\nchannel = 2\nforward_m = 0.1\nbearing_deg = -30\nreach_m = 0.5\n";

    #[test]
    fn the_ring_turns_with_the_robot_and_ranger_5_looks_to_its_right() {
        let pose = Pose2 { position: DVec2::new(1.0, 2.0), heading: std::f64::consts::FRAC_PI_2 };
        let right = mission("").sensor_table()[3 + 4].mount.on(pose);
        assert!(right.position.distance(DVec2::new(1.121, 2.0)) < 1e-9);
        assert!(right.axis().distance(DVec2::X) < 1e-9);
    }

    #[test]
    fn the_sonars_beside_the_front_one_look_45_degrees_to_either_side_of_it() {
        for (sonar, channels, bearings) in [
            ("", [1, 0, 2], [0.0, 45.0, -45.0]),
            ("[sonar]\nindex = 5\nbearing_deg = 10", [5, 4, 0], [10.0, 55.0, -35.0]),
        ] {
            let table = mission(sonar).sensor_table();
            for (row, (channel, bearing_deg)) in channels.into_iter().zip(bearings).enumerate() {
                assert_eq!(table[row].channel, channel);
                assert!((table[row].bearing_deg() - bearing_deg).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_robot_that_looks_first_uses_all_it_has_and_the_papers_method_and_a_car_the_front_sonar() {
        assert_eq!(used("").len(), 10);
        assert_eq!(used("method = 'paper'"), ["front"]);
        assert_eq!(used("robot.model = 'car'"), ["front"]);
        assert_eq!(used("sensors = 'front'"), ["front"]);
        assert_eq!(used("sensors = 'front+infrared'").len(), 8);
        assert_eq!(used("sensors = 'three-front'"), ["front", "front-left", "front-right"]);
    }

    #[test]
    fn written_rows_replace_the_table_and_the_key_sensors_selects_from_them() {
        let table = mission(ROWS).sensor_table();
        let [nose, eye] = &table[..] else {
            panic!("{table:?}");
        };
        assert_eq!((nose.channel, nose.every_ticks, nose.reach_m), (4, 2, 2.55));
        assert_eq!((eye.kind, eye.reach_m, eye.used), (SensorKind::Ray, 0.5, true));
        assert_eq!(used(&format!("sensors = 'front'\n{ROWS}")), ["nose"]);
        assert_eq!(mission(ROWS).front_sonar().name, "nose");
    }

    #[test]
    fn a_robot_whose_protocol_has_no_channels_names_none_and_each_sensor_gets_one_of_its_own() {
        let row = |name: &str, kind: &str, channel: &str| {
            format!(
                "[[robot.sensor]]\nname = '{name}'\nkind = '{kind}'\n{channel}forward_m = 0.1\nbearing_deg = 0\n"
            )
        };
        let rows = [row("a", "cone", ""), row("b", "cone", "channel = 0\n"), row("c", "ray", "")];
        let rows = [rows.concat(), row("d", "cone", ""), row("e", "cone", "channel = 200\n")];
        let table = mission(&format!("robot.protocol = 'json'\n{}", rows.concat())).sensor_table();
        let channels: Vec<_> = table.iter().map(|sensor| sensor.channel).collect();
        assert_eq!(channels, [1, 0, 0, 2, 200]);
    }

    #[test]
    fn a_laser_upside_down_has_its_beams_mirrored_on_the_middle_one() {
        let mirrored = |keys: &str, beams: usize| {
            let row = format!(
                "[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nroll_deg = 180\nbeams = {beams}\n{keys}"
            );
            let (_, laser) = mission(&format!("robot.protocol = 'json'\n{row}")).laser().unwrap();
            let mut numbers: Vec<_> = (0..beams).collect();
            laser.mirror(&mut numbers);
            numbers
        };
        assert_eq!(mirrored("field_of_view_deg = 180", 5), [4, 3, 2, 1, 0]);
        // From behind over right, ahead and left.
        assert_eq!(mirrored("field_of_view_deg = 360", 4), [0, 3, 2, 1]);
    }

    #[test]
    fn of_several_lasers_the_first_with_the_widest_view_that_is_used_says_where_the_robot_is() {
        let laser = |name: &str, view_deg: u32| {
            format!(
                "[[robot.sensor]]\nname = '{name}'\nkind = 'scan'\nforward_m = 0.1\nbearing_deg = 0\nfield_of_view_deg = {view_deg}\n"
            )
        };
        let rows = [laser("narrow", 90), laser("wide", 180), laser("other", 180)].concat();
        let mission = mission(&format!("robot.protocol = 'json'\n{rows}"));
        assert_eq!((mission.laser().unwrap().0, mission.lasers().len()), (1, 3));
    }

    #[test]
    fn a_mission_with_rows_survives_its_run_file() {
        let written = mission(ROWS);
        let again = Mission::parse(&toml::to_string(&written).unwrap(), Path::new("run.toml"));
        assert_eq!(again.unwrap().robot.sensors, written.robot.sensors);
    }
}
