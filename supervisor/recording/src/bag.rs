//! Writer of a rosbag2 bag: a folder with `metadata.yaml` and an MCAP file.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use common::file::FileError;
use serde_json::{Value, json};

use crate::{error::Result, file::Output};

const FILE: &str = "bag_0.mcap";
/// Version of `metadata.yaml`, with numbers for policies, for ROS 2 Humble and later.
const VERSION: u8 = 5;
/// QoS for late joiners: reliable, transient local, without deadlines.
const LATCHED: &str = "[{history: 1, depth: 1, reliability: 1, durability: 1, deadline: {sec: 9223372036, nsec: 854775807}, \
     lifespan: {sec: 9223372036, nsec: 854775807}, liveliness: 1, \
     liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}, avoid_ros_namespace_conventions: false}]";

pub struct Bag {
    output: Output,
    folder: PathBuf,
}

impl Bag {
    /// Makes `folder`.
    ///
    /// # Errors
    /// Fails if it exists or cannot be made.
    pub fn create(folder: &Path) -> Result<Self> {
        fs::create_dir(folder).map_err(FileError::of("make bag", folder))?;
        let mut output = Output::create(&folder.join(FILE), "ros2")?;
        // An empty text tells readers that the channel policies predate version 9.
        let about = BTreeMap::from([("serialized_metadata".to_owned(), String::new())]);
        output.metadata("rosbag2", about)?;
        Ok(Self { output, folder: folder.to_path_buf() })
    }

    /// Adds a topic. Late joiners get its newest message if it `is_latched`.
    pub fn add(&mut self, [topic, kind, definition]: [&str; 3], is_latched: bool) -> Result {
        let quality = if is_latched { LATCHED } else { "" };
        let about = [("offered_qos_profiles", quality)];
        self.output.add(topic, kind, "ros2msg", definition.as_bytes(), "cdr", &about)
    }

    /// Adds a CDR message with its encapsulation.
    pub fn message(&mut self, topic: &str, at_ns: u64, message: &[u8]) -> Result {
        self.output.write(topic, 0, [at_ns; 2], message)
    }

    /// Writes the rest. Returns the count of messages.
    pub fn finish(self) -> Result<u64> {
        let summary = self.output.finish()?;
        let stats = summary.stats.unwrap_or_default();
        let topic = |(id, count): (&u16, &u64)| {
            let channel = summary.channels.get(id)?;
            let kind = &channel.schema.as_ref()?.name;
            let quality = channel.metadata.values().next()?;
            Some(json!({"message_count": count, "topic_metadata": {
                "name": channel.topic, "type": kind, "serialization_format": "cdr", "offered_qos_profiles": quality,
            }}))
        };
        let topics: Vec<Value> = stats.channel_message_counts.iter().filter_map(topic).collect();
        let count = stats.message_count;
        let begin = json!({"nanoseconds_since_epoch": stats.message_start_time});
        let span = json!({"nanoseconds": stats.message_end_time - stats.message_start_time});
        let metadata = json!({"rosbag2_bagfile_information": {
            "version": VERSION, "storage_identifier": "mcap", "compression_format": "", "compression_mode": "",
            "starting_time": begin, "duration": span, "message_count": count, "topics_with_message_count": topics,
            "relative_file_paths": [FILE],
            "files": [{"path": FILE, "starting_time": begin, "duration": span, "message_count": count}],
        }});
        let file = self.folder.join("metadata.yaml");
        // JSON is valid YAML.
        fs::write(&file, format!("{metadata:#}\n")).map_err(FileError::of("write", &file))?;
        Ok(count)
    }
}
