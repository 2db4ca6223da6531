//! Writing a bag of rosbag2: a folder with `metadata.yaml` and an MCAP file of messages of ROS 2.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs::{self, File},
    io::{self, BufWriter},
    path::{Path, PathBuf},
};

use common::file::FileError;
use mcap::{
    Writer,
    records::{MessageHeader, Metadata},
};

use crate::{
    error::Result,
    file::{failed, options},
};

const FILE: &str = "bag_0.mcap";
/// Readers of ROS 2 Humble and later know this version of `metadata.yaml`; numbers stand for the policies in it.
const VERSION: u8 = 5;
/// The quality by which a player sends a topic again to those who join later: reliable, transient local, without deadlines.
const LATCHED: &str = "[{history: 1, depth: 1, reliability: 1, durability: 1, deadline: {sec: 9223372036, nsec: 854775807}, \
     lifespan: {sec: 9223372036, nsec: 854775807}, liveliness: 1, \
     liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}, avoid_ros_namespace_conventions: false}]";

/// A topic of a bag.
#[derive(Clone, Debug)]
pub struct BagTopic {
    /// The name from the root.
    pub name: String,
    /// The name of its type, such as `nav_msgs/msg/Path`.
    pub type_name: String,
    /// The text of its type with those of the types in it.
    pub definition: String,
    /// Whether who joins later gets the newest message.
    pub is_latched: bool,
}

impl BagTopic {
    const fn quality(&self) -> &'static str {
        if self.is_latched { LATCHED } else { "" }
    }
}

/// A bag that is written.
pub struct Bag {
    writer: Writer<BufWriter<File>>,
    folder: PathBuf,
    /// The topics by their channels, each with the count of its messages.
    topics: BTreeMap<u16, (BagTopic, u64)>,
    /// The least and the greatest time of a message.
    bounds: Option<(u64, u64)>,
}

impl Bag {
    /// Make `folder`, which must not exist.
    ///
    /// # Errors
    /// When it exists or cannot be made.
    pub fn create(folder: &Path) -> Result<Self> {
        let named = |error: io::Error| FileError::of("make bag", folder)(error);
        fs::create_dir(folder).map_err(named)?;
        let file = File::create(folder.join(FILE)).map_err(named)?;
        let writer = options().profile("ros2").create(BufWriter::new(file));
        let mut writer = writer.map_err(failed(folder))?;
        // Without a text here, readers take the policies of the channels for those of an earlier version, which they are.
        let metadata = BTreeMap::from([("serialized_metadata".to_owned(), String::new())]);
        let written = writer.write_metadata(&Metadata { name: "rosbag2".to_owned(), metadata });
        written.map_err(failed(folder))?;
        Ok(Self { writer, folder: folder.to_path_buf(), topics: BTreeMap::new(), bounds: None })
    }

    /// Add a topic. Returns its channel.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn add(&mut self, topic: BagTopic) -> Result<u16> {
        let BagTopic { name, type_name, definition, .. } = &topic;
        let about =
            BTreeMap::from([("offered_qos_profiles".to_owned(), topic.quality().to_owned())]);
        let schema = self.writer.add_schema(type_name, "ros2msg", definition.as_bytes());
        let added = schema.and_then(|schema| self.writer.add_channel(schema, name, "cdr", &about));
        let channel = added.map_err(failed(&self.folder))?;
        self.topics.insert(channel, (topic, 0));
        Ok(channel)
    }

    /// Add a message in CDR, with its encapsulation, to a topic's channel.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn message(&mut self, channel_id: u16, at_ns: u64, message: &[u8]) -> Result {
        let count = self.topics.get_mut(&channel_id).map(|(_, count)| {
            *count += 1;
            *count
        });
        let (from, to) = self.bounds.unwrap_or((at_ns, at_ns));
        self.bounds = Some((from.min(at_ns), to.max(at_ns)));
        let header = MessageHeader {
            channel_id,
            sequence: count.unwrap_or_default() as u32,
            log_time: at_ns,
            publish_time: at_ns,
        };
        let written = self.writer.write_to_known_channel(&header, message);
        written.map_err(failed(&self.folder))
    }

    /// Write the rest. Returns the count of messages and the seconds from the first to the last.
    ///
    /// # Errors
    /// When the files cannot be written.
    pub fn finish(mut self) -> Result<(u64, f64)> {
        self.writer.finish().map_err(failed(&self.folder))?;
        let file = self.folder.join("metadata.yaml");
        fs::write(&file, self.metadata()).map_err(FileError::of("write", &file))?;
        let (from, to) = self.bounds.unwrap_or_default();
        Ok((self.count(), (to - from) as f64 * 1e-9))
    }

    fn count(&self) -> u64 {
        self.topics.values().map(|(_, count)| count).sum()
    }

    fn metadata(&self) -> String {
        let (from, to) = self.bounds.unwrap_or_default();
        let span = format!(
            "duration: {{nanoseconds: {}}}, starting_time: {{nanoseconds_since_epoch: {from}}}, message_count: {}",
            to - from,
            self.count()
        );
        let mut topics = String::new();
        for (topic, count) in self.topics.values() {
            let BagTopic { name, type_name, .. } = topic;
            // Writing to a text does not fail.
            let _ = write!(
                topics,
                "    {{topic_metadata: {{name: {name}, type: {type_name}, serialization_format: cdr, offered_qos_profiles: '{}'}}, \
                 message_count: {count}}},\n",
                topic.quality()
            );
        }
        format!(
            "rosbag2_bagfile_information: {{\n  version: {VERSION}, storage_identifier: mcap, {span},\n  topics_with_message_count: [\n{topics}  ],\n  \
             compression_format: '', compression_mode: '', relative_file_paths: [{FILE}],\n  files: [{{path: {FILE}, {span}}}]\n}}\n"
        )
    }
}
