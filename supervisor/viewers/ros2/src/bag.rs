//! `firsthand ros2 bag`: a bag of rosbag2 from a recording, with the messages that the bridge publishes.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use clap::Args;
use common::topics;
use console::failure::Failure;
use recording::{Bag, BagTopic, Recording, RecordingError};
use robot_state::{Sample, TOPICS};

use crate::{definitions::definition, endpoints::published, shown::Shown, topics::Id};

/// Make a bag of rosbag2 from a recording: for `ros2 bag play`, PlotJuggler and other readers of bags.
///
/// It has the topics that are published of a robot that runs, `path` and `field` only from a recording with `--fields`. Their stamps and
/// the times of the bag are mission time.
#[derive(Clone, Debug, Args)]
pub(crate) struct Arguments {
    /// A recorded run's directory, or one recording.
    recording: PathBuf,
    /// The folder of the bag, which must not exist yet.
    out: PathBuf,
}

/// A bag with the channels of its topics.
struct Writer {
    bag: Bag,
    channels: BTreeMap<Id, u16>,
    /// Whether all messages so far could be written.
    written: Result<(), RecordingError>,
}

impl Writer {
    /// What takes the messages of this time.
    fn at(&mut self, at_ns: u64) -> impl FnMut(Id, Vec<u8>) {
        move |id, payload| {
            if let (Ok(()), Some(channel)) = (&self.written, self.channels.get(&id)) {
                self.written = self.bag.message(*channel, at_ns, &payload);
            }
        }
    }
}

/// Make a bag with topics below `namespace`. Returns what is in it, in words.
pub(crate) fn make(namespace: &str, arguments: &Arguments) -> Result<String, Failure> {
    let Arguments { recording, out } = arguments;
    let recordings = recording::files(recording)?;
    let recordings: Vec<_> =
        recordings.iter().map(|file| Recording::open(file)).collect::<Result<_, _>>()?;
    let (mut shown, mut writer) = begin(namespace, &recordings[0], out)?;
    if let Some(first) = recordings[0].samples(&topics::POSE)?.next().transpose()? {
        let at_ns = first.sample.stamp.stamp_ns;
        shown.mounting(at_ns, &mut writer.at(at_ns));
    }
    let wanted: Vec<_> = TOPICS.iter().map(|topic| topic.spec().name).collect();
    for recording in &recordings {
        for message in recording.messages(&wanted)? {
            let message = message?;
            let Some(sample) = Sample::decoded(&message.topic, &message.data) else {
                let (file, topic) = (recording.path.clone(), message.topic.to_string());
                return Err(RecordingError::Message { file, topic }.into());
            };
            let at_ns = sample.time().0;
            shown.sample(&sample, at_ns, &mut writer.at(at_ns));
            // Before the first pose mission time is not known.
            if let Some(pose) = shown.state.pose {
                let now_ns = pose.stamp.stamp_ns;
                shown.tick(now_ns, &mut writer.at(now_ns));
            }
            std::mem::replace(&mut writer.written, Ok(()))?;
        }
    }
    let topics = writer.channels.len();
    let (messages, span_s) = writer.bag.finish()?;
    let gaps = recordings.iter().flat_map(Recording::gaps).map(|gap| gap + "\n");
    let out = out.display();
    Ok(gaps.collect::<String>()
        + &format!("{out}: {messages} messages on {topics} topics, {span_s:.1} s\n"))
}

fn begin(
    namespace: &str,
    recording: &Recording,
    out: &Path,
) -> Result<(Shown, Writer), RecordingError> {
    let run = &recording.run;
    let shown = Shown::new(run.robot.to_string(), run.mission.clone());
    let mut bag = Bag::create(out)?;
    let mut channels = BTreeMap::new();
    for (row, id, name) in published(namespace, shown.sensor_topics()) {
        let [package, message] = row.message;
        let channel = bag.add(BagTopic {
            name,
            type_name: format!("{package}/msg/{message}"),
            definition: definition(row.message),
            is_latched: row.is_latched,
        })?;
        channels.insert(id, channel);
    }
    Ok((shown, Writer { bag, channels, written: Ok(()) }))
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
        // A run's directory with two recordings.
        let run = folder.path().join("run");
        fs::create_dir(&run).unwrap();
        for part in ["recording.mcap", "recording-2.mcap"] {
            fs::copy(&recording, run.join(part)).unwrap();
        }
        for (recording, parts) in [(recording, 1), (run, 2)] {
            let arguments = Arguments { recording, out: folder.path().join(parts.to_string()) };
            make("a", &arguments).unwrap();
            let metadata = fs::read_to_string(arguments.out.join("metadata.yaml")).unwrap();
            let row = |topic: &str| metadata.lines().find(|line| line.contains(topic)).unwrap();
            let count = format!("message_count: {}}}", parts * poses);
            assert!(row("name: /a/tf,").contains(&count), "{metadata}");
            assert!(row("name: /a/tf_static,").contains("durability: 1"), "{metadata}");
            assert!(make("a", &arguments).unwrap_err().to_string().contains("exists"));
        }
    }
}
