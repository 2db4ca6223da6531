use x80_protocol::MOTOR_SCALE_V;

use super::objection::{Result, all_within, objection, refuse_if, within};
use crate::{
    Footprint, Mission, Protocol, ResponseKeys,
    address::{Address, AddressError, FORMS},
};

pub(super) fn check(mission: &Mission) -> Result {
    let body = mission.body();
    let robot = &mission.robot;
    if let Some(Err(error)) = robot.address.as_deref().map(str::parse::<Address<String>>) {
        let problem = match error {
            AddressError::Form { address, problem } => format!("{address:?} {problem}"),
            AddressError::Host { .. } => error.to_string(),
        };
        return Err(objection("robot.address", problem, FORMS));
    }
    all_within([
        ("robot.rate_hz", robot.rate_hz, 0.5..=200.0, "Hz"),
        ("robot.wheel_radius_m", body.wheel_radius_m, 0.005..=2.0, "m"),
        ("robot.track_m", body.track_m, 0.01..=5.0, "m"),
        ("robot.counts_per_turn", body.counts_per_turn, 1.0..=100_000.0, "counts"),
    ])?;
    refuse_if(
        robot.protocol() != Protocol::X80 && body.steering.is_some(),
        "robot.protocol",
        "only the x80 protocol can steer a car",
        "give \"x80\", or another robot.model",
    )?;
    steering(mission)?;
    for (key, value, range) in robot.odometry.ranges() {
        within(key, value, range, "")?;
    }
    if !robot.footprint.is_empty() {
        let remedy = "list it as [[x, y], ...] in metres, in the robot's frame";
        let footprint = Footprint::new(&robot.footprint).map_err(|rule| {
            objection("robot.footprint", format!("the outline is invalid: {rule}"), remedy)
        })?;
        let covers_m = footprint.circumscribed_m();
        refuse_if(
            body.radius_m < covers_m - 1e-6,
            "robot.radius_m",
            format!(
                "a disc of {} m does not cover robot.footprint, which reaches {covers_m:.3} m",
                body.radius_m
            ),
            "remove robot.radius_m",
        )?;
    }
    all_within([
        ("robot.radius_m", body.radius_m, 0.01..=5.0, "m"),
        ("robot.top_speed_m_s", body.top_speed_m_s, 0.01..=10.0, "m/s"),
    ])?;
    response(robot.response)?;
    let limits = robot.low_battery_v;
    let limit_s = robot.command_limit_s;
    all_within([
        ("robot.command_limit_s", limit_s, 0.02..=5.0, "s"),
        ("robot.low_battery_v", limits.board, 0.0..=MOTOR_SCALE_V, "V"),
        ("robot.low_battery_v", limits.motor, 0.0..=MOTOR_SCALE_V, "V"),
        ("robot.low_battery_v", limits.servo, 0.0..=MOTOR_SCALE_V, "V"),
        ("robot.held_current_ad", f64::from(robot.held_current_ad), 0.0..=4095.0, "AD counts"),
    ])?;
    let rate_hz = robot.rate_hz;
    refuse_if(
        limit_s * rate_hz <= 1.0,
        "robot.command_limit_s",
        format!("a command expires before the next tick: {limit_s} s at {rate_hz} Hz"),
        "raise robot.command_limit_s or robot.rate_hz",
    )?;
    refuse_if(
        robot.gyro() && !matches!(robot.protocol(), Protocol::Json | Protocol::Arduino),
        "robot.gyro",
        "only the protocols json and arduino report a gyro through this key",
        "set robot.ros2.imu for a ROS 2 robot, or remove it",
    )?;
    let left = robot.left.channel;
    let right = robot.right.channel;
    refuse_if(
        left > 1 || right > 1 || left == right,
        "robot.left",
        format!("the wheels have channels {left} and {right}"),
        "put one on channel 0 and one on channel 1",
    )?;
    // At most a third of the counter's half cycle per tick keeps wraparound unambiguous with a tick
    // to spare.
    let counts = body.top_speed_m_s / body.metres_per_count() / rate_hz;
    let has_counter = matches!(robot.protocol(), Protocol::X80 | Protocol::Arduino);
    refuse_if(
        has_counter && counts > 32_768.0 / 6.0,
        "robot.rate_hz",
        format!(
            "at top speed a wheel makes {counts:.0} counts per tick, and the counter wraps at 32768"
        ),
        "raise robot.rate_hz or lower robot.top_speed_m_s",
    )
}

fn steering(mission: &Mission) -> Result {
    let robot = &mission.robot;
    let Some(steering) = mission.body().steering else {
        let written = [
            ("robot.wheelbase_m", robot.wheelbase_m),
            ("robot.steering_limit_deg", robot.steering_limit_deg),
            ("robot.steering_rate_deg_s", robot.steering_rate_deg_s),
            ("robot.steering_counts_per_turn", robot.steering_counts_per_turn),
        ];
        let problem = "this robot has two driven wheels and no steering";
        let remedy = "remove the key, or set robot.model = \"car\"";
        return written
            .into_iter()
            .try_for_each(|(key, value)| refuse_if(value.is_some(), key, problem, remedy));
    };
    refuse_if(
        !mission.simulation.blocks.is_empty(),
        "simulation.block",
        "the simulation cannot block the wheels of a car",
        "remove it, or choose another robot.model",
    )?;
    let [limit, rate] = [steering.limit_rad, steering.rate_rad_s].map(f64::to_degrees);
    // A full turn fits twice into the counter's cycle, so an angle is unambiguous.
    let counts = steering.counts_per_turn;
    all_within([
        ("robot.wheelbase_m", steering.wheelbase_m, 0.01..=5.0, "m"),
        ("robot.steering_limit_deg", limit, 1.0..=80.0, "degrees"),
        ("robot.steering_rate_deg_s", rate, 1.0..=3600.0, "degrees/s"),
        ("robot.steering_counts_per_turn", counts, 36.0..=16_384.0, "counts"),
    ])
}

fn response(keys: ResponseKeys) -> Result {
    let ResponseKeys { delay_s, lag_s, acceleration_m_s2, turn_acceleration_rad_s2 } = keys;
    let turn = turn_acceleration_rad_s2.unwrap_or(1.0);
    all_within([
        ("robot.response.delay_s", delay_s.unwrap_or(0.0), 0.0..=2.0, "s"),
        ("robot.response.lag_s", lag_s.unwrap_or(0.0), 0.0..=2.0, "s"),
        (
            "robot.response.acceleration_m_s2",
            acceleration_m_s2.unwrap_or(1.0),
            0.05..=1000.0,
            "m/s^2",
        ),
        ("robot.response.turn_acceleration_rad_s2", turn, 0.05..=1000.0, "rad/s^2"),
    ])
}
