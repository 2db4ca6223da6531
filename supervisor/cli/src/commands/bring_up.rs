//! `firsthand bring-up`: compares a new robot with its mission file and prints one verdict per
//! line.

mod written;

use std::fs;

use bring_up::{Finding, Trace, Verdict, findings};
use clap::Args;
use common::{
    file::{FileError, replace},
    mission::{CalibrationPlan, Mission, Procedure},
};
use console::{
    consent,
    failure::{Result, refuse},
    missions,
    output::{print_line, print_text, say},
};
use picture::points_svg;
use recording::Recording;
use serde_json::json;

use super::calibrate::drive::{Carried, Setting};

/// Compare a new robot with its mission file.
///
/// Checks wheels, gyro, laser, rangers and response. Prints faults to fix and keys to change.
///
/// Put the robot on a free floor, 1 to 2 m in front of a wall, with objects around it. The robot
/// stands, turns 1.5 times to each side, drives 0.3 m forward and back, and turns left and right:
/// about a minute.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Mission file with the robot.
    ///
    /// Default: the simulated X80.
    mission: Option<String>,
    /// Check only motors and encoders, with the wheels in the air.
    #[arg(long)]
    lifted: bool,
    /// Write the measured keys into the mission file.
    #[arg(long, requires = "mission")]
    write: bool,
    /// Move without asking first.
    #[arg(long, short)]
    yes: bool,
    #[command(flatten)]
    setting: Setting,
}

const SIMULATED: &str = "target = [1.5, 0]\nsimulation.realism = 'measured'\nsensors = 'all'\n[perimeter]\nwidth_m = 6.0\ncentre = [0.0, 0.0]\n[[world.wall]]\npoints = [[1.3, -1.6], [1.3, 1.2], [-0.4, 1.6], [-1.5, 0.4], [-1.2, -1.6], [1.3, -1.6]]\n";

const TITLE: &str = "What the robot saw, placed by the motion that was found";
const DESCRIPTION: &str = "Ends of beams and echoes; x points ahead of the robot's first place, y to its left. A sharp outline confirms the findings.";

pub fn main(arguments: &Arguments) -> Result {
    arguments.setting.log("bring-up.log")?;
    let set = &arguments.setting.set;
    let named = match &arguments.mission {
        Some(name) => missions::load(name, set)?,
        None => missions::parsed(SIMULATED, "bring-up", set)?,
    };
    let plan = CalibrationPlan { procedure: Procedure::BringUp, ..CalibrationPlan::default() };
    let mut mission = arguments.setting.procedure(&named, plan, 0.2)?;
    (mission.start, mission.perimeter) = (named.start, named.perimeter.clone());
    (mission.sensors, mission.world) = (named.sensors, named.world.clone());
    mission.timeout_s = 150.0;
    if named.robot.address.is_some() && !arguments.yes {
        consent::ask(
            "the robot will turn on the spot and drive 0.3 m there and back",
            "Is the floor free for 1 m around it?",
        )?;
    }
    let Carried { directory, .. } = arguments.setting.carry_out(&mission, "bring-up")?;
    let trace = Trace::read(&named, &Recording::open(&directory)?)?;
    let (found, seen) = findings(&named, &trace, arguments.lifted);
    let picture = directory.join("bring-up.svg");
    fs::write(&picture, points_svg(TITLE, DESCRIPTION, &seen))
        .map_err(FileError::of("write", &picture))?;
    if arguments.setting.json {
        let object = json!({
            "findings": found.iter().map(as_json).collect::<Vec<_>>(),
            "picture": picture,
            "directory": directory,
        });
        print_line(object)?;
    } else {
        for finding in &found {
            print_text(line(finding))?;
        }
        print_line(format_args!("picture: {}", picture.display()))?;
    }
    let keys: Vec<_> = found.iter().flat_map(|finding| finding.keys.iter()).collect();
    if let Some(file) = &arguments.mission
        && arguments.write
        && !keys.is_empty()
    {
        let text = written::with_keys(&Mission::read(file.as_ref())?, &keys)?;
        replace(file.as_ref(), text).map_err(FileError::of("write", file.as_ref()))?;
        say(format_args!("keys written to {file}: {}", keys.len()));
    }
    judged(&found)
}

fn judged(found: &[Finding]) -> Result {
    let wrong = found.iter().filter(|finding| finding.verdict == Verdict::Wrong).count();
    if wrong > 0 {
        return refuse(
            "not-as-stated",
            format!(
                "findings that contradict the mission: {wrong}; correct the robot or change the keys, then repeat"
            ),
        );
    }
    // The first finding, the rate of the reports, needs no motion.
    if found.iter().skip(1).all(|finding| finding.verdict == Verdict::Unknown) {
        return refuse(
            "nothing-measured",
            "nothing was measured: the robot did not move, or its sensors reported nothing; see the link's log in the run directory",
        );
    }
    Ok(())
}

fn line(finding: &Finding) -> String {
    let Finding { part, verdict, text, keys } = finding;
    let mut line = format!("{:<10} {part}: {text}\n", verdict.word());
    for (key, value) in keys {
        line += &format!("{:10} {key} = {value}\n", "");
    }
    line
}

fn as_json(finding: &Finding) -> serde_json::Value {
    let Finding { part, verdict, text, keys } = finding;
    let keys: serde_json::Map<_, _> =
        keys.iter().map(|(key, value)| (key.clone(), json!(value))).collect();
    json!({ "part": part, "verdict": verdict.word(), "text": text, "keys": keys })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bring_up_that_measured_nothing_or_something_else_than_is_stated_fails() {
        let code = |verdicts: &[Verdict]| {
            let finding = |verdict: &Verdict| Finding {
                part: String::new(),
                verdict: *verdict,
                text: String::new(),
                keys: Vec::new(),
            };
            let found: Vec<_> = verdicts.iter().map(finding).collect();
            judged(&found).err().map(|error| error.to_string())
        };
        use Verdict::{Right, Unknown, Wrong};
        assert!(code(&[Right, Unknown]).is_some_and(|said| said.contains("nothing was measured")));
        assert!(
            code(&[Right, Wrong]).is_some_and(|said| said.contains("contradict the mission: 1;"))
        );
        assert_eq!(code(&[Right, Right, Unknown]), None);
    }
}
