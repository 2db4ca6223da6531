use std::{fs, path::PathBuf};

use clap::Args;
use common::{kinematics::Pose2, samples::PoseSample};
use picture::{Facts, Scene};
use trial::{Drive, Judged, Log};

use console::{
    failure::{Refused, Result},
    output::{json_lines, print_text},
};

/// Try a robot's log: track it as a robot that somebody else drives, and judge the result.
///
/// Reads bags of ROS 2, in MCAP or SQLite, and logs in CARMEN's format with a laser of 180 degrees,
/// also compressed by gzip. A log with corrected poses, such as GMapping writes, judges them too.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Log with odometry and laser scans: a file, or the directory of a bag.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Tables `[robot]` and `[[robot.sensor]]` of its robot; by default of a robot with this laser.
    #[arg(long, value_name = "FILE.toml")]
    robot: Option<PathBuf>,
    /// Directory for poses, picture and map.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one line of JSON.
    #[arg(long)]
    json: bool,
}

/// Of `poses.csv`: seconds, metres, radians, and standard deviations.
const COLUMNS: [&str; 7] =
    ["time_s", "x_m", "y_m", "heading_rad", "x_sd_m", "y_sd_m", "heading_sd_rad"];

pub fn main(arguments: &Arguments) -> Result {
    let robot = arguments.robot.as_ref().map(fs::read_to_string).transpose()?;
    let log = Log::read(&arguments.log, robot.as_deref())?;
    let mission = trial::mission(&log)?;
    let drive = trial::drive(&log, &mission).ok_or_else(|| {
        Refused::new(
            "no-laser",
            "the robot has no laser; give --robot with a [[robot.sensor]] of kind \"scan\"",
        )
    })?;
    let judged = trial::judge(&drive);
    let (frame, cells) = (drive.mapper.frame(), &drive.mapper.state().cells);
    if let Some(out) = &arguments.out {
        fs::create_dir_all(out)?;
        let mut rows = csv::Writer::from_path(out.join("poses.csv"))?;
        rows.write_record(COLUMNS)?;
        for PoseSample { stamp, x_m, y_m, heading_rad, covariance, .. } in &drive.poses {
            let [x_sd, _, _, y_sd, _, heading_sd] = covariance.map(f64::sqrt);
            let time_s = stamp.time().seconds();
            rows.serialize([time_s, *x_m, *y_m, *heading_rad, x_sd, y_sd, heading_sd])?;
        }
        rows.flush()?;
        maps::save_believed(&out.join("map.yaml"), &mission, &frame, cells)?;
        let believed: Vec<Pose2> = drive.poses.iter().map(PoseSample::pose).collect();
        let svg = picture::svg(&Scene {
            mission: &mission,
            grid: Some((frame, cells)),
            field: None,
            believed: &believed,
            covariance: None,
            truth: drive.references.as_deref().unwrap_or_default(),
            targets: &[],
            trails: &[],
            facts: Facts {
                outcome: "tried",
                reached: true,
                mission_time_s: log.instants.last().map_or(0.0, |it| it.time_s),
                path_length_m: drive.poses.last().map_or(0.0, |it| it.travelled_m),
                straight_m: believed.last().map_or(0.0, |it| it.position.length()),
                safety_events: 0,
                seed: None,
            },
            captions: &[],
        });
        fs::write(out.join("picture.svg"), svg)?;
    }
    print_text(if arguments.json { json_lines(&[&judged])? } else { text(&judged, &drive) })
}

fn text(judged: &Judged, drive: &Drive) -> String {
    let metres = |it: Option<f64>| it.map_or("-".to_owned(), |it| format!("{it:.3} m"));
    let mut text = format!(
        "{} scans, {:.0} % matched\n\
        error over 5 m: {} (odometry alone: {})\n\
        error over 20 m: {} (odometry alone: {})\n\
        poses beyond two standard deviations: {}\n\
        cells that the map's points touch, over those by odometry alone: {:.2}\n\
        stands of the failsafe: {}\n",
        judged.scans,
        100.0 * judged.fixes,
        metres(judged.error_5_m),
        metres(judged.odometry_error_5_m),
        metres(judged.error_20_m),
        metres(judged.odometry_error_20_m),
        judged.beyond_2_sigma.map_or("-".to_owned(), |it| format!("{:.1} %", 100.0 * it)),
        judged.blur_ratio,
        judged.false_stands,
    );
    for (time_s, why) in &drive.stands {
        text += &format!("  at {time_s:.1} s: {why}\n");
    }
    text
}
