//! Node of the bridge, built from the table of topics.

use std::io;

use ros2::participant::Quality;

use crate::{
    bridge::Options,
    node::{LATCHED, NEWEST, Node, SURE},
    topics::{Accept, Frames, Id, Spec, TABLE, spec},
};

/// Transforms come from many nodes, of either reliability.
const TRANSFORMS: Quality = Quality { is_reliable: false, is_latched: false, depth: 100 };

pub fn open(options: &Options) -> io::Result<Node<Id>> {
    let Options { domain, interface, namespace, accepted, parameters, .. } = options;
    let mut node = Node::join((*domain, *interface, namespace), "firsthand", parameters.clone())?;
    if options.frames == Frames::Map {
        node.read_from(Id::Tf, ["tf", "tf2_msgs::msg::dds_::TFMessage_"], TRANSFORMS)?;
    }
    for row in TABLE {
        match row.accepted_by {
            None if is_of_robot(row.id) || (row.id == Id::Clock && !options.clock) => {}
            None => write_to(&mut node, row.id, row, "")?,
            Some(Accept::Stop) if accepted.contains(&Accept::Stop) => {
                let name = topic_name(namespace, row, "");
                node.read_late(row.id, [&name, row.type_name])?;
            }
            Some(by) if accepted.contains(&by) => {
                let name = topic_name(namespace, row, "");
                // Old deflections of a joystick are not resent.
                let quality = if row.id == Id::Teleop { NEWEST } else { SURE };
                node.read_from(row.id, [&name, row.type_name], quality)?;
            }
            Some(_) => {}
        }
    }
    if accepted.contains(&Accept::Goals) {
        node.serve("navigate_to_pose", "NavigateToPose")?;
    }
    node.announce();
    Ok(node)
}

/// Returns whether a ROS 2 robot may publish the topic itself.
pub const fn is_of_robot(id: Id) -> bool {
    matches!(id, Id::Odom | Id::Battery | Id::Range(_) | Id::Scan(_))
}

pub fn open_robot<'a>(
    node: &mut Node<Id>,
    topics: impl Iterator<Item = (Id, &'a str)>,
) -> io::Result<()> {
    node.retain_writers(|id| !is_of_robot(id));
    for (id, sensor) in topics {
        if let Some(row) = spec(id) {
            write_to(node, id, row, sensor)?;
        }
    }
    node.announce();
    Ok(())
}

fn write_to(node: &mut Node<Id>, id: Id, row: &Spec, sensor: &str) -> io::Result<()> {
    let name = topic_name(&node.namespace, row, sensor);
    let quality = match id {
        // Late readers get earlier events, as from other nodes.
        Id::Rosout => Quality { depth: 100, ..LATCHED },
        _ if row.is_latched => LATCHED,
        _ => SURE,
    };
    node.write_to(id, [&name, row.type_name], quality)
}

/// Returns the published topics of a robot with these sensors: row, id and name below `namespace`.
pub fn published<'a>(
    namespace: &str,
    sensors: impl Iterator<Item = (Id, &'a str)>,
) -> impl Iterator<Item = (&'static Spec, Id, String)> {
    let is_sensor = |id| matches!(id, Id::Range(_) | Id::Scan(_));
    let others = TABLE.iter().filter(move |row| row.accepted_by.is_none() && !is_sensor(row.id));
    let topics = others.map(|row| (row.id, "")).chain(sensors);
    topics.filter_map(move |(id, sensor)| {
        let row = spec(id)?;
        Some((row, id, topic_name(namespace, row, sensor)))
    })
}

pub fn topic_name(namespace: &str, row: &Spec, sensor: &str) -> String {
    let name = row.name.replace("SENSOR", &ros_name(sensor));
    let name = name.trim_end_matches('/');
    match namespace.trim_matches('/') {
        _ if name.starts_with('/') => name.to_owned(),
        "" => format!("/{name}"),
        namespace => format!("/{namespace}/{name}"),
    }
}

/// Converts `name` to a topic name part of letters, digits and `_`.
fn ros_name(name: &str) -> String {
    let letter = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
    name.chars().map(letter).collect()
}
