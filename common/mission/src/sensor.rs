//! Table of the robot's ranging sensors, shared by link, mapper and simulator. A reading names its
//! sensor by its row.
//!
//! A mission writes rows as `[[robot.sensor]]`. By default they are the X80's: the front sonar of
//! `[sonar]`, its two neighbours, and seven infrared rangers. The key `sensors` selects those for
//! the mapper.

use crate::sonar::Mount;

/// Also limits the readings in a sample of `ranges`.
pub const MOST_SENSORS: usize = 16;
/// Limit of all lasers together.
pub const MOST_BEAMS: usize = 16_384;
pub const MOST_LASERS: usize = 4;
pub const INFRARED_RANGERS: usize = 7;
pub const SONARS: usize = 6;

/// Side sonars: degrees from the front one, and metres from the robot's centre.
const SIDE_BEARING_DEG: f64 = 45.0;
const SIDE_FORWARD_M: f64 = 0.194;
/// Sonars within this angle of the front one belong to the set "three-front".
const BESIDE_FRONT_DEG: f64 = 60.0;

/// Bearing of each ranger (degrees counter-clockwise from the robot's axis), and distance from the
/// centre over the body's radius.
///
/// The order is that of the frames, on which two independent drivers agree: front from left to
/// right, then right, rear, left. Side rangers are 121 mm from the centre, the others at the rim.
const RING: [(f64, f64); INFRARED_RANGERS] = [
    (33.75, 1.0),
    (11.25, 1.0),
    (-11.25, 1.0),
    (-33.75, 1.0),
    (-90.0, 0.121 / 0.19),
    (180.0, 1.0),
    (90.0, 0.121 / 0.19),
];

words! {
    #[derive(Default)]
    SensorKind {
        /// Sonar: an echo means something on its arc, and no nearer surface square to the beam.
        #[default]
        Cone,
        /// Infrared ranger: the ray is free up to its end.
        Ray,
        /// Laser or depth camera: a fan of beams, each free up to its end.
        Scan,
    }

    /// Product, which selects the mapper's measurement model.
    SensorModel {
        /// DUR5200 of the X80: a cone, 40 kHz. Source: X80 user manual, 2006; the mapper's
        /// `sonar_model` has its numbers.
        Dur5200,
        /// Infrared ranger of the X80: a ray, 10 to 80 cm. Source: formula in the X80 user manual,
        /// 2006; the mapper's `infrared_model` has its numbers.
        X80Infrared,
        /// Hokuyo UST-10LX, a laser: 270 degrees in 1,081 beams, 0.06 to 10 m, 40 Hz. Source: its
        /// specification, C-42-04077, 2014.
        #[serde(rename = "ust-10lx")]
        Ust10lx,
        /// Slamtec RPLIDAR A1, a laser: 360 degrees, 0.15 to 12 m, 5.5 Hz, 8,000 readings per
        /// second. Source: its data sheet, 2020.
        RplidarA1,
        /// Slamtec RPLIDAR C1, a laser: 360 degrees in 500 readings, 0.05 to 12 m, 10 Hz, 30 mm.
        /// Source: its data sheet, 2023.
        RplidarC1,
        /// LDS-02 of a TurtleBot 3, a laser: 360 degrees in 1-degree steps, 0.16 to 8 m, 5 Hz.
        /// Source: ROBOTIS e-Manual.
        #[serde(rename = "lds-02")]
        Lds02,
        /// Intel RealSense D435, a depth camera as a fan: 87 by 58 degrees, 0.3 to 3 m, 2 % at 2 m.
        /// Source: its product brief, 2018.
        ///
        /// Each beam is the nearest tangible thing in an image column, as in ROS
        /// `pointcloud_to_laserscan`. Two columns per degree are nominal.
        D435,
    }
}

/// Laser, on the base's wire or on a separate serial line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rplidar {
    pub baud: u32,
    /// Time between two measurements of a standard scan.
    pub sample_us: u16,
    pub turns_hz: f64,
    /// The motor stops while DTR of the line is set.
    pub stands_by_dtr: bool,
    /// Model byte in the device's own protocol.
    pub number: u8,
}

/// Values from the source of a [`SensorModel`].
pub struct Product {
    pub kind: SensorKind,
    /// 0 for a ray.
    pub field_of_view_deg: f64,
    pub reach_m: f64,
    pub least_m: f64,
    /// 1 except for lasers.
    beams: usize,
    /// Standard deviation of a range: metres, and a share of the range.
    ///
    /// The manuals give 15 mm up to half a metre and 5 % beyond for the LDS-02. They give less than
    /// 1 % for the A1, and at most 40 mm for the UST-10LX. These count as two deviations.
    pub noise: (f64, f64),
    /// Vertical field of view of a depth camera, degrees; 0 otherwise.
    tall_deg: f64,
}

impl SensorModel {
    pub const fn product(self) -> Product {
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

    /// Returns the serial properties of an RPLIDAR. An A1 measures 8,000 times per second, of which
    /// a standard scan carries 2,304; it states one in four.
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

    /// Returns the reach at a black surface, which reflects a tenth of the light.
    ///
    /// The UST-10LX specification gives 4 m, against 10 m for white. Others get the same share,
    /// which is nominal: Slamtec states it for its RPLIDAR A3 (black 10 m, white 25 m).
    pub const fn black_reach_m(self) -> f64 {
        0.4 * self.product().reach_m
    }

    /// Returns the rise of the highest beam and the fall of the lowest per metre; 0 for lasers.
    pub fn rise(self) -> f64 {
        (0.5 * self.product().tall_deg).to_radians().tan()
    }

    /// Returns the range from which a beam detects all that the body can touch, metres. A depth
    /// camera looks over and under nearer things.
    pub fn clears_from_m(self) -> f64 {
        let Product { least_m, tall_deg, .. } = self.product();
        if tall_deg > 0.0 { least_m } else { 0.0 }
    }
}

rows! {
    #[derive(Default)]
    SensorRow {
        name: String,
        kind: SensorKind,
        /// The X80's alone.
        channel: Option<u8>,
        forward_m: f64,
        /// delta of (19).
        bearing_deg: f64,
        /// Counter-clockwise; 0 looks outward.
        #[serde(default, skip_serializing_if = "crate::is_default")]
        turned_deg: f64,
        #[serde(default, skip_serializing_if = "crate::is_default")]
        roll_deg: f64,
        height_m: Option<f64>,
        field_of_view_deg: Option<f64>,
        reach_m: Option<f64>,
        beams: Option<u16>,
        /// Frames in between are ignored.
        rate_hz: Option<f64>,
        model: Option<SensorModel>,
        address: Option<String>,
    }
}

keys! {
    /// Front sonar of a robot without `[[robot.sensor]]`.
    SonarConfig {
        index: u8 = 1,
        /// W/2 in the paper.
        forward_m: f64 = 0.1915,
        /// delta of (19).
        bearing_deg: f64,
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    pub name: String,
    pub kind: SensorKind,
    /// Channel of the row, or the lowest free one of its kind.
    pub channel: u8,
    pub mount: Mount,
    /// 0 for a ray.
    pub field_of_view_deg: f64,
    pub reach_m: f64,
    /// 1 except for lasers.
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

    /// Returns the first beam's angle from the sensor's axis, and the beam spacing, radians
    /// counter-clockwise.
    pub fn fan(&self) -> (f64, f64) {
        let wide = self.field_of_view_deg.to_radians();
        // In a full turn the first and the last beam would coincide.
        let steps = if wide >= std::f64::consts::TAU - 1e-9 { self.beams } else { self.beams - 1 };
        (-wide / 2.0, wide / steps.max(1) as f64)
    }

    /// Reverses the beams of a laser mounted upside down about its middle beam. Applying it twice
    /// restores the order.
    pub fn mirror<T>(&self, beams: &mut [T]) {
        let is_circle = self.field_of_view_deg >= 360.0;
        // In a full turn the first beam looks back and is its own mirror image.
        if let Some(mirrored) = beams.get_mut(usize::from(is_circle)..)
            && self.is_upside_down
        {
            mirrored.reverse();
        }
    }

    /// Returns the index of a beam on the other side of [`Sensor::mirror`].
    pub fn mirrored(&self, beam: usize) -> usize {
        match (self.is_upside_down, self.field_of_view_deg >= 360.0) {
            (false, _) => beam,
            (true, true) => self.beams.saturating_sub(beam) % self.beams.max(1),
            (true, false) => self.beams.saturating_sub(beam + 1),
        }
    }

    /// Returns the robot's angle towards a place at which it looks. For a laser that sees all
    /// around it is the bearing.
    pub fn faces_rad(&self) -> f64 {
        if self.field_of_view_deg >= 360.0 {
            self.mount.bearing_rad
        } else {
            self.mount.looks_rad()
        }
    }

    pub fn bearing_deg(&self) -> f64 {
        self.mount.bearing_rad.to_degrees()
    }
}

words! {
    Sensors {
        /// Sensor nearest to the bearing of `[sonar]`; cones take precedence.
        Front,
        #[serde(rename = "front+infrared")]
        FrontInfrared,
        /// Front sonar and the cones within 60 degrees of it.
        ThreeFront,
        Laser,
        All,
    }
}

/// Builds the sensor table at `rate_hz` and marks the rows of `set` as used.
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
    assert_eq!(table.len(), rows.len());
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

/// Returns the row nearest to the bearing of `[sonar]`, of a cone if there is one.
pub(crate) fn front(table: &[Sensor], sonar: &SonarConfig) -> Option<usize> {
    let ahead = |sensor: &Sensor| (sensor.bearing_deg() - sonar.bearing_deg).abs();
    let any_cone = table.iter().any(|sensor| sensor.kind == SensorKind::Cone);
    let candidates = table.iter().enumerate();
    let candidates = candidates.filter(|(_, sensor)| !any_cone || sensor.kind == SensorKind::Cone);
    candidates.min_by(|(_, a), (_, b)| ahead(a).total_cmp(&ahead(b))).map(|(index, _)| index)
}

/// Returns the rows of an X80; the car has the same boards and sensors.
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
    use super::*;
    use crate::testing::{close, laser, mission, read_back};

    fn used(extra: &str) -> Vec<String> {
        let table = mission(extra).sensor_table();
        table.into_iter().filter(|sensor| sensor.used).map(|sensor| sensor.name).collect()
    }

    const ROWS: &str = "[[robot.sensor]]\nname = 'nose'\nkind = 'cone'\nchannel = 4\nforward_m = 0.2\nbearing_deg = 5\nrate_hz = 3.5\n\
        [[robot.sensor]]\nname = 'eye'\nkind = 'ray'\nchannel = 2\nforward_m = 0.1\nbearing_deg = -30\nreach_m = 0.5\n";

    #[test]
    fn the_sonars_beside_the_front_one_look_45_degrees_to_either_side_of_it() {
        for (sonar, channels, bearings) in [
            ("", [1, 0, 2], [0.0, 45.0, -45.0]),
            ("[sonar]\nindex = 5\nbearing_deg = 10", [5, 4, 0], [10.0, 55.0, -35.0]),
        ] {
            let table = mission(sonar).sensor_table();
            for (row, (channel, bearing_deg)) in channels.into_iter().zip(bearings).enumerate() {
                assert_eq!(table[row].channel, channel);
                close(table[row].bearing_deg(), bearing_deg);
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
        let table = read_back(ROWS).sensor_table();
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
        let table = mission(&format!(
            "robot.protocol = 'json'\nrobot.counts_per_turn = 1320\nrobot.address = '1.2.3.4:5'\n{}",
            rows.concat()
        ))
        .sensor_table();
        let channels: Vec<_> = table.iter().map(|sensor| sensor.channel).collect();
        assert_eq!(channels, [1, 0, 0, 2, 200]);
    }

    #[test]
    fn a_laser_upside_down_has_its_beams_mirrored_on_the_middle_one() {
        let mirrored = |keys: &str, beams: usize| {
            let row = laser("laser", &format!("roll_deg = 180\nbeams = {beams}\n{keys}"));
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
        let rows = [("narrow", 90), ("wide", 180), ("other", 180)]
            .map(|(name, view_deg)| laser(name, &format!("field_of_view_deg = {view_deg}")));
        let rows = rows.concat();
        let mission = mission(&format!("robot.protocol = 'json'\n{rows}"));
        assert_eq!((mission.laser().unwrap().0, mission.lasers().len()), (1, 3));
    }
}
