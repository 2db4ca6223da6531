use clap::Args;
use common::mission::{Mission, Sensor, SensorKind};
use console::{
    failure::Result,
    output::{print_text, say},
};
use link::failsafe::stop_distance::{self, Stop};
use mission_control::outcome::RIGHT_PLACE_M;

/// Length of a path around obstacles, relative to a straight one.
const DETOUR: f64 = 1.25;
/// Smallest share of missions that is reported.
const LEAST_SHARE: f64 = 0.02;
/// Distance of compared heights in front of a sensor, metres. Farther objects are remembered.
const AHEAD_M: f64 = 0.3;
/// Maximum angle off straight ahead of a forward sensor, degrees.
const BESIDE_AHEAD_DEG: f64 = 30.0;
/// Smallest reported gap of heights, metres.
const LEAST_UNSEEN_M: f64 = 0.01;

/// Check a mission in the same way as `run`.
///
/// Prints the line of an error, and key and remedy of a refused value. For a valid mission, prints
/// the distance from each fault to rest. If only two driven wheels measure the heading, prints how
/// often the mission ends in a wrong place, from 2 %. Prints the heights at which the body touches
/// obstacles that its sensors do not see.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Mission file, or shipped mission (`firsthand missions`).
    mission: String,
    /// Set a key of the mission; may be repeated.
    ///
    /// Example: `--set start.heading_deg=90`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

pub fn main(arguments: &Arguments) -> Result {
    let mission = super::run::ready(&arguments.mission, &arguments.set)?;
    for remark in &mission.remarks {
        say(remark);
    }
    let frame = mission.grid_frame();
    let mut text = format!(
        "{}: {} m to the target, {} x {} cells of {:.3} m\nFrom a fault to rest, at most, at {} m/s:\n",
        mission.name,
        mission.straight_m(),
        frame.cells,
        frame.cells,
        frame.resolution_m,
        mission.speed_m_s()
    );
    for (cause, Stop { known_s, rest_s, way_m }) in stop_distance::from_faults(&mission) {
        text += &format!(
            "  {:<28} {way_m:.2} m in {rest_s:.2} s (known after {known_s:.2} s)\n",
            cause.name()
        );
    }
    if let Some(share) = wrong_places(&mission).filter(|share| *share >= LEAST_SHARE) {
        text += &format!(
            "Its heading depends on its wheels alone, which are known to {} %. Of 100 such missions, about {:.0} end more than {RIGHT_PLACE_M} m from the target. Run `firsthand calibrate`, or give the robot a gyro.\n",
            100.0 * mission.robot.odometry.diameter_ratio_sd,
            100.0 * share
        );
    }
    text += &unseen(&mission).unwrap_or_default();
    print_text(text)
}

/// Describes heights that the body can touch and no forward sensor sees at [`AHEAD_M`], as in the
/// simulator.
fn unseen(mission: &Mission) -> Option<String> {
    let heights = mission.simulation.physics().heights;
    let looks_ahead = |sensor: &Sensor| {
        let half_deg = (sensor.field_of_view_deg / 2.0).max(BESIDE_AHEAD_DEG);
        sensor.used && mission.sensing && sensor.mount.looks_rad().abs() <= half_deg.to_radians()
    };
    let band = |sensor: Sensor| {
        let (height_m, rise) = match sensor.kind {
            SensorKind::Cone => {
                (heights.sonar_m, (sensor.field_of_view_deg / 2.0).to_radians().tan())
            }
            SensorKind::Ray => (heights.infrared_m, 0.0),
            SensorKind::Scan => {
                (sensor.height_m.unwrap_or(heights.infrared_m), sensor.model.rise())
            }
        };
        [height_m - rise * AHEAD_M, height_m + rise * AHEAD_M]
    };
    let mut bands: Vec<_> =
        mission.sensor_table().into_iter().filter(looks_ahead).map(band).collect();
    bands.sort_by(|[a, _], [b, _]| a.total_cmp(b));
    let (mut unseen, mut seen_to) = (Vec::new(), heights.ground_clearance_m);
    let top = [heights.body_top_m, f64::INFINITY];
    for [from, to] in bands.into_iter().chain([top]) {
        if from - seen_to > LEAST_UNSEEN_M {
            unseen.push(format!("from {seen_to:.2} to {:.2} m", from.min(heights.body_top_m)));
        }
        seen_to = seen_to.max(to);
    }
    (!unseen.is_empty()).then(|| {
        format!(
            "Its sensors miss what stands or hangs {} above the floor, {AHEAD_M} m ahead, such as a low board or a shelf. A depth camera (model = \"d435\") sees it, bumpers detect the touch, and a lower controller.speed_m_s softens it.\n",
            unseen.join(" and ")
        )
    })
}

/// Returns the expected share of missions that end in a wrong place, due to the uncertain
/// wheel-diameter ratio; `None` if another sensor holds the heading.
///
/// Over a distance d with track W, a relative error e turns the robot by e d/W, which puts it aside
/// by half of d times that turn. Errors of the track cancel with opposite turns.
fn wrong_places(mission: &Mission) -> Option<f64> {
    let robot = &mission.robot;
    let is_held = robot.gyro() || robot.ros2.imu.is_some() || mission.used(SensorKind::Scan) > 0;
    if is_held || mission.body().steering.is_some() {
        return None;
    }
    let way_m = DETOUR * mission.straight_m();
    let aside_m = robot.odometry.diameter_ratio_sd * way_m * way_m / (2.0 * mission.body().track_m);
    Some(libm::erfc(RIGHT_PLACE_M / (aside_m * std::f64::consts::SQRT_2)))
}

#[cfg(test)]
mod tests {

    use super::*;

    fn mission(text: &str) -> Mission {
        Mission::parse(text, "m.toml").unwrap()
    }

    #[test]
    fn a_far_target_a_narrow_track_and_unknown_wheels_mean_wrong_places_and_a_gyro_or_a_laser_none()
    {
        let share = |text: &str| wrong_places(&mission(&format!("{text}\nperimeter.width_m = 30")));
        let six_m = share("target = [6, 0]").unwrap();
        // Measured: 41 of 100 on the default course, 40 of 100 in rooms.
        assert!((0.25..0.45).contains(&six_m), "{six_m}");
        assert!(share("target = [9, 0]").unwrap() > six_m + 0.2);
        assert!(share("target = [6, 0]\nrobot.track_m = 0.6").unwrap() < six_m - 0.2);
        let calibrated = share("target = [6, 0]\nrobot.odometry.diameter_ratio_sd = 0.0005");
        assert!(calibrated.unwrap() < 0.001);
        for held in ["protocol = 'json'\nrobot.gyro = true", "model = 'kobuki'", "model = 'car'"] {
            assert_eq!(share(&format!("target = [6, 0]\nrobot.{held}")), None, "{held}");
        }
    }

    #[test]
    fn heights_that_the_body_touches_and_no_sensor_sees_ahead_are_told_and_a_depth_camera_leaves_none()
     {
        let unseen = |robot: &str| {
            unseen(&mission(&format!("target = [3, 0]\nrobot.{robot}"))).unwrap_or_default()
        };
        let laser = unseen("model = 'kobuki'");
        assert!(laser.contains("from 0.03 to 0.18 m and from 0.18 to 0.26 m"), "{laser}");
        assert!(unseen("model = 'x80'").contains("hangs from 0.03 to 0.10 m above"));
        assert_eq!(unseen("model = 'turtlebot2'"), "");
    }
}
