//! `firsthand ros2 bag`: converts a recording to a rosbag2 bag with the bridge's messages.

use std::{collections::BTreeMap, path::PathBuf};

use clap::Args;
use common::topics;
use console::failure::Failure;
use recording::{Bag, Message, Recording};
use robot_state::{Sample, TOPICS};

use crate::{endpoints::published, shown::Shown};

/// Convert a recording to a rosbag2 bag.
///
/// For `ros2 bag play`, PlotJuggler and others. The bag has the topics of a running robot; `path`
/// and `field` need a recording with `--fields`. All times are mission time.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// Directory of a recorded run, or one recording.
    recording: PathBuf,
    /// Folder of the new bag.
    out: PathBuf,
}

/// Makes a bag. Returns a description of its content and gaps.
pub fn make(namespace: &str, arguments: &Arguments) -> Result<String, Failure> {
    let Arguments { recording, out } = arguments;
    let recordings: Vec<_> = recording::files(recording)?
        .iter()
        .map(|file| Recording::open(file))
        .collect::<Result<_, _>>()?;
    let run = &recordings[0].run;
    let mut shown = Shown::new(run.robot.to_string(), run.mission.clone());
    let mut bag = Bag::create(out)?;
    let mut names = BTreeMap::new();
    for (row, id, name) in published(namespace, shown.sensor_topics()) {
        bag.add([&name, &row.message.join("/msg/"), row.definition], row.is_latched)?;
        names.insert(id, name);
    }
    // Begins at the first pose, so that sensor mountings precede sensor messages.
    let began_ns = recordings[0]
        .samples(&topics::POSE)?
        .next()
        .transpose()?
        .map_or(0, |first| first.stamp.stamp_ns);
    let mut messages = Vec::new();
    shown.mounting(began_ns, &mut |id, payload| messages.push((began_ns, id, payload)));
    let wanted: Vec<_> = TOPICS.iter().map(|topic| topic.spec().name).collect();
    for recording in &recordings {
        let decode = |message: Message| Sample::decoded(&message.topic, &message.data);
        for sample in recording.decoded(&wanted, decode)? {
            let sample = sample?;
            let at_ns = sample.time().0;
            shown.sample(&sample, at_ns, &mut |id, payload| messages.push((at_ns, id, payload)));
            // Mission time is unknown before the first pose.
            if let Some(pose) = shown.state.pose {
                let at_ns = pose.stamp.stamp_ns;
                shown.tick(at_ns, &mut |id, payload| messages.push((at_ns, id, payload)));
            }
            for (at_ns, id, payload) in messages.drain(..) {
                if let Some(name) = names.get(&id).filter(|_| at_ns >= began_ns) {
                    bag.message(name, at_ns, &payload)?;
                }
            }
        }
    }
    let mut told: String =
        recordings.iter().flat_map(Recording::gaps).map(|gap| gap + "\n").collect();
    told += &format!("{}: {} messages\n", out.display(), bag.finish()?);
    Ok(told)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_bag_has_a_transform_for_each_recorded_pose_and_replaces_no_other() {
        let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/golden");
        let recording = PathBuf::from(golden).join("stall-and-kill.mcap");
        let poses = Recording::open(&recording).unwrap().counts["pose"];
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        fs::create_dir(&run).unwrap();
        for part in ["recording.mcap", "recording-2.mcap"] {
            fs::copy(&recording, run.join(part)).unwrap();
        }
        for (recording, parts) in [(recording, 1), (run, 2)] {
            let arguments = Arguments { recording, out: folder.path().join(parts.to_string()) };
            make("a", &arguments).unwrap();
            let metadata = fs::read(arguments.out.join("metadata.yaml")).unwrap();
            let metadata: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
            let topics = &metadata["rosbag2_bagfile_information"]["topics_with_message_count"];
            let told = |index: usize| {
                let row = &topics[index];
                (row["topic_metadata"]["name"].as_str(), row["message_count"].as_u64())
            };
            assert_eq!(told(0), (Some("/a/tf"), Some(parts * poses)));
            assert_eq!(told(1), (Some("/a/tf_static"), Some(1)));
            let profiles = topics[1]["topic_metadata"]["offered_qos_profiles"].to_string();
            assert!(profiles.contains("durability: 1"));
            assert!(make("a", &arguments).unwrap_err().to_string().contains("exists"));
        }
    }
}
