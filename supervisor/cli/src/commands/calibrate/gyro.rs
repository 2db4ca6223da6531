//! Computes ratio and track from the gyro, in a recording of two straight drives and two turns.

use bring_up::{Trace, trace::Told};
use calibration::gyro::{Motion, checked};
use common::mission::{Mission, Odometry};
use recording::Recording;

use super::{Arguments, drive::Carried, refused, written::Found};
use console::failure::Result;

/// Time for a robot to come to rest, seconds.
const RESTS_AFTER_S: f64 = 0.8;

pub fn measure(arguments: &Arguments, mission: &Mission, scale_sd: f64) -> Result<Found> {
    if !(mission.robot.gyro() || mission.robot.ros2.imu.is_some()) {
        return Err("this robot has no gyro; if its JSON lines report a gyro angle, set `gyro = true` below [robot]; if a ROS 2 topic carries the angle, name the topic as robot.ros2.imu; or calibrate before a wall or along squares".into());
    }
    let Carried { directory, seconds, .. } = arguments.setting.carry_out(mission, "calibration")?;
    // Nominal distances are those of uncalibrated wheels.
    let mut mission = mission.clone();
    mission.robot.odometry = Odometry::default();
    let trace = Trace::read(&mission, &Recording::open(&directory)?)?;
    let (at_rest, motions) = motions(&mission, &trace).map_err(refused)?;
    let estimate =
        checked(&at_rest, &motions, scale_sd, mission.body().track_m).map_err(refused)?;
    let metres = motions.iter().map(|it| it.rolled_m).sum::<f64>() / 2.0;
    Ok(Found { method: "gyro", estimate, metres, seconds })
}

/// Pairs of seconds and turned angle, radians.
type Increments = Vec<(f64, f64)>;

/// Returns the gyro's increments in the longest rest, and the motions after it, from rest to rest.
fn motions(
    mission: &Mission,
    trace: &Trace,
) -> std::result::Result<(Increments, Vec<Motion>), String> {
    let mut rests = trace.legs();
    rests.retain(|leg| leg.told == Told::Stand && leg.seconds() >= RESTS_AFTER_S);
    let Some(longest) =
        rests.iter().max_by(|one, other| one.seconds().total_cmp(&other.seconds())).copied()
    else {
        return Err("the robot never stood still; see the logs of the run".to_owned());
    };
    let from_s = longest.from_s + RESTS_AFTER_S;
    let near_s = 0.25 / mission.robot.rate_hz;
    let (mut at_rest, mut motions, mut motion) = (Vec::new(), Vec::new(), Motion::default());
    let mut gyro = trace.gyro.iter().peekable();
    let (mut ticks, mut silent) = (0, 0);
    for pair in trace.rolled.windows(2).filter(|pair| pair[0].0 >= from_s) {
        let [(then_s, then), (at_s, now)] = [pair[0], pair[1]];
        while gyro.next_if(|(gyro_s, _)| *gyro_s < at_s - near_s).is_some() {}
        let turn = gyro.next_if(|(gyro_s, _)| *gyro_s <= at_s + near_s);
        ticks += 1;
        silent += u32::from(turn.is_none());
        let (seconds, turn) = (at_s - then_s, turn.map_or(0.0, |(_, turn)| *turn));
        if at_s <= longest.until_s {
            at_rest.push((seconds, turn));
            continue;
        }
        // A leg begins with a command, which follows from the tick before it.
        if rests.iter().any(|rest| (then_s - near_s..at_s - near_s).contains(&rest.until_s)) {
            motions.push(std::mem::take(&mut motion));
        }
        let [left_m, right_m] = [0, 1].map(|wheel| now[wheel] - then[wheel]);
        motion.left_m += left_m;
        motion.right_m += right_m;
        motion.rolled_m += left_m.abs() + right_m.abs();
        motion.turned_rad += turn;
        motion.seconds += seconds;
    }
    motions.push(motion);
    motions.retain(|motion| motion.rolled_m > 0.0);
    if silent > 0 {
        return Err(format!(
            "the gyro reports nothing in {silent} of {ticks} ticks; check it with `firsthand bring-up`, or repeat this on a machine with less load"
        ));
    }
    Ok((at_rest, motions))
}
