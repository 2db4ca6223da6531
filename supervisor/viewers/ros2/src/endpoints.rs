//! Node of the bridge, built from the table of topics.

use std::io;

use ros2::participant::Quality;

use crate::{
    Arguments,
    node::{LATCHED, NEWEST, Network, Node, SURE, full_name},
    parameters::Parameter,
    topics::{Accept, Frames, Id, Spec, TABLE, spec},
};

/// Transforms come from many nodes, of either reliability.
const TRANSFORMS: Quality = Quality { is_reliable: false, is_latched: false, depth: 100 };

pub fn open(
    network: Network<'_>,
    options: &Arguments,
    parameters: Vec<Parameter>,
) -> io::Result<Node<Id>> {
    let mut node = Node::join(network, "firsthand", parameters)?;
    if options.frames == Frames::Map {
        node.read_from(Id::Tf, ["tf", "tf2_msgs::msg::dds_::TFMessage_"], TRANSFORMS)?;
    }
    for row in TABLE {
        let topic = [row.name, row.type_name];
        match row.accepted_by {
            None if is_of_robot(row.id) || (row.id == Id::Clock && !options.clock) => {}
            None => write_to(&mut node, (row, row.id, row.name.to_owned()))?,
            Some(by) if !options.accept.contains(&by) => {}
            Some(Accept::Stop) => node.read_late(row.id, topic)?,
            // Old deflections of a joystick are not resent.
            Some(Accept::Hand) => node.read_from(row.id, topic, NEWEST)?,
            Some(Accept::Goals | Accept::Pose) => node.read_from(row.id, topic, SURE)?,
        }
    }
    if options.accept.contains(&Accept::Goals) {
        node.serve("navigate_to_pose", "NavigateToPose")?;
    }
    node.announce();
    Ok(node)
}

/// Returns whether a ROS 2 robot may publish the topic itself.
pub const fn is_of_robot(id: Id) -> bool {
    matches!(id, Id::Odom | Id::Battery | Id::Range(_) | Id::Scan(_))
}

pub fn open_robot(
    node: &mut Node<Id>,
    topics: impl IntoIterator<Item = Published>,
) -> io::Result<()> {
    node.retain_writers(|id| !is_of_robot(id));
    topics.into_iter().try_for_each(|topic| write_to(node, topic))?;
    node.announce();
    Ok(())
}

fn write_to(node: &mut Node<Id>, (row, id, name): Published) -> io::Result<()> {
    let quality = match id {
        // Late readers get earlier events, as from other nodes.
        Id::Rosout => Quality { depth: 100, ..LATCHED },
        _ if row.is_latched => LATCHED,
        _ => SURE,
    };
    node.write_to(id, [&name, row.type_name], quality)
}

pub type Published = (&'static Spec, Id, String);

/// Returns the published topics of a robot with these sensors, named below `namespace`.
pub fn published<'a>(
    namespace: &str,
    sensors: impl Iterator<Item = (Id, &'a str)>,
) -> impl Iterator<Item = Published> {
    let is_sensor = |id| matches!(id, Id::Range(_) | Id::Scan(_));
    TABLE
        .iter()
        .filter(move |row| row.accepted_by.is_none() && !is_sensor(row.id))
        .map(|row| (row.id, ""))
        .chain(sensors)
        .filter_map(move |(id, sensor)| {
            let row = spec(id)?;
            Some((row, id, full_name(namespace, &topic_name(row, sensor))))
        })
}

pub fn topic_name(row: &Spec, sensor: &str) -> String {
    let sensor = sensor.replace(|letter: char| !letter.is_ascii_alphanumeric(), "_");
    row.name.replace("SENSOR", &sensor).trim_end_matches('/').to_owned()
}
