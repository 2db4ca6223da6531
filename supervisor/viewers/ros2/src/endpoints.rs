//! The bridge's node, made from the table of topics.

use std::{io, net::Ipv4Addr};

use crate::{
    node::{LATCHED, NEWEST, Node, SURE},
    topics::{Accept, Id, Spec, TABLE, spec},
};

/// Join `domain` by the interface `only`, with topics below `namespace`.
pub(crate) fn open(
    domain: u16,
    only: Option<Ipv4Addr>,
    namespace: &str,
    accepted: &[Accept],
) -> io::Result<Node<Id>> {
    let mut node = Node::join(domain, only, namespace, "firsthand")?;
    for row in TABLE {
        match row.accepted_by {
            // The topics of sensors are opened for each robot.
            None if matches!(row.id, Id::Range(_) | Id::Scan(_)) => {}
            None => write_to(&mut node, row.id, row, "")?,
            Some(by) if accepted.contains(&by) => {
                let name = topic_name(namespace, row, "");
                // A hand's old pushes are not sent again.
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

/// Open the topics of a robot's sensors, and close those of the robot before.
pub(crate) fn open_sensors<'a>(
    node: &mut Node<Id>,
    sensors: impl Iterator<Item = (Id, &'a str)>,
) -> io::Result<()> {
    node.retain_writers(|id| !matches!(id, Id::Range(_) | Id::Scan(_)));
    for (id, sensor) in sensors {
        if let Some(row) = spec(id) {
            write_to(node, id, row, sensor)?;
        }
    }
    node.announce();
    Ok(())
}

fn write_to(node: &mut Node<Id>, id: Id, row: &Spec, sensor: &str) -> io::Result<()> {
    let name = topic_name(&node.namespace, row, sensor);
    node.write_to(id, [&name, row.type_name], if row.is_latched { LATCHED } else { SURE })
}

/// The name of the topic of `row` below `namespace`, from the root.
pub(crate) fn topic_name(namespace: &str, row: &Spec, sensor: &str) -> String {
    let name = row.name.replace("SENSOR", &ros_name(sensor));
    let name = name.trim_end_matches('/');
    match namespace.trim_matches('/') {
        "" => format!("/{name}"),
        namespace => format!("/{namespace}/{name}"),
    }
}

/// `name` as a part of the name of a topic, which has letters, digits and `_`.
fn ros_name(name: &str) -> String {
    let letter = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
    name.chars().map(letter).collect()
}
