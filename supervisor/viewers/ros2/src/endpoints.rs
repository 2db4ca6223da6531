//! The bridge's readers and writers in DDS, made from the table of topics, and the node that `ros2 node list` shows.

use std::{collections::BTreeMap, io, net::Ipv4Addr};

use ros2::{
    cdr,
    participant::{Gid, Message, Participant, Quality, Reader, Request, Writer},
    topic::Topic,
};

use crate::topics::{Accept, Id, Spec, TABLE, spec};

/// The name of the node.
const NODE: &str = "firsthand";
/// The most messages of a topic that wait for a slow reader, or for the bridge.
const DEPTH: u16 = 10;
/// The most messages of a topic that are taken at a time.
const AT_A_TIME: usize = 16;

/// The quality that sends lost messages again, for messages that all count.
const SURE: Quality = Quality { is_reliable: true, is_latched: false, depth: DEPTH };
/// The quality that stores the newest message for readers that join later.
const LATCHED: Quality = Quality { is_reliable: true, is_latched: true, depth: 1 };

/// A service.
#[derive(Debug)]
struct Service {
    requests: Reader,
    replies: Writer,
}

/// The services of the action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    SendGoal,
    CancelGoal,
    GetResult,
}

/// Readers and writers.
#[derive(Debug)]
pub(crate) struct Endpoints {
    namespace: String,
    writers: BTreeMap<Id, Writer>,
    readers: Vec<(Id, Reader)>,
    /// The services of the action; none if goals are not accepted.
    services: Vec<(Call, Service)>,
    /// The list of the participant's readers and writers, for other nodes.
    entities: Writer,
    participant: Participant,
}

impl Endpoints {
    /// Join `domain` by the interface `only`, with topics below `namespace`.
    pub(crate) fn open(
        domain: u16,
        only: Option<Ipv4Addr>,
        namespace: &str,
        accepted: &[Accept],
    ) -> io::Result<Self> {
        let participant = Participant::join(domain, only)?;
        let namespace = namespace.trim_matches('/');
        let namespace = if namespace.is_empty() { String::new() } else { format!("/{namespace}") };
        let entities = Topic::plain(
            "ros_discovery_info",
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
        );
        let mut endpoints = Self {
            writers: BTreeMap::new(),
            readers: Vec::new(),
            services: Vec::new(),
            entities: participant.writer(&entities, LATCHED)?,
            namespace,
            participant,
        };
        for row in TABLE {
            match row.accepted_by {
                // The topics of sensors are opened for each robot.
                None if matches!(row.id, Id::Range(_) | Id::Scan(_)) => {}
                None => endpoints.write_to(row.id, row, "")?,
                Some(by) if accepted.contains(&by) => {
                    let topic = endpoints.topic(row, "");
                    let reader = endpoints.participant.reader(&topic, SURE)?;
                    endpoints.readers.push((row.id, reader));
                }
                Some(_) => {}
            }
        }
        if accepted.contains(&Accept::Goals) {
            endpoints.open_action()?;
        }
        endpoints.announce();
        Ok(endpoints)
    }

    /// Open the topics of a robot's sensors.
    pub(crate) fn open_sensors<'a>(
        &mut self,
        sensors: impl Iterator<Item = (Id, &'a str)>,
    ) -> io::Result<()> {
        // The topics of the sensors of the robot before are closed.
        self.writers.retain(|id, _| !matches!(id, Id::Range(_) | Id::Scan(_)));
        for (id, sensor) in sensors {
            if let Some(row) = spec(id) {
                self.write_to(id, row, sensor)?;
            }
        }
        self.announce();
        Ok(())
    }

    fn topic(&self, row: &Spec, sensor: &str) -> Topic {
        Topic::new(&topic_name(&self.namespace, row, sensor), row.type_name)
    }

    fn write_to(&mut self, id: Id, row: &Spec, sensor: &str) -> io::Result<()> {
        let quality = if row.is_latched { LATCHED } else { SURE };
        let writer = self.participant.writer(&self.topic(row, sensor), quality)?;
        self.writers.insert(id, writer);
        Ok(())
    }

    fn open_action(&mut self) -> io::Result<()> {
        let name = |part| format!("{}/navigate_to_pose/_action/{part}", self.namespace);
        for (call, part, types) in [
            (
                Call::SendGoal,
                "send_goal",
                [
                    "nav2_msgs::action::dds_::NavigateToPose_SendGoal_Request_",
                    "nav2_msgs::action::dds_::NavigateToPose_SendGoal_Response_",
                ],
            ),
            (
                Call::CancelGoal,
                "cancel_goal",
                [
                    "action_msgs::srv::dds_::CancelGoal_Request_",
                    "action_msgs::srv::dds_::CancelGoal_Response_",
                ],
            ),
            (
                Call::GetResult,
                "get_result",
                [
                    "nav2_msgs::action::dds_::NavigateToPose_GetResult_Request_",
                    "nav2_msgs::action::dds_::NavigateToPose_GetResult_Response_",
                ],
            ),
        ] {
            let [requests, replies] = Topic::service(&name(part), types);
            let requests = self.participant.reader(&requests, SURE)?;
            let replies = self.participant.writer(&replies, SURE)?;
            self.services.push((call, Service { requests, replies }));
        }
        let feedback = "nav2_msgs::action::dds_::NavigateToPose_FeedbackMessage_";
        let status = "action_msgs::msg::dds_::GoalStatusArray_";
        for (id, part, type_name, quality) in
            [(Id::Feedback, "feedback", feedback, SURE), (Id::Status, "status", status, LATCHED)]
        {
            let topic = Topic::new(&name(part), type_name);
            self.writers.insert(id, self.participant.writer(&topic, quality)?);
        }
        Ok(())
    }

    /// Tell other nodes which readers and writers are the node's.
    fn announce(&self) {
        let services = || self.services.iter().map(|(_, service)| service);
        let readers = self.readers.iter().map(|(_, reader)| reader);
        let readers = readers.chain(services().map(|service| &service.requests)).map(Reader::gid);
        let writers = self.writers.values().chain(services().map(|service| &service.replies));
        let writers = writers.map(Writer::gid);
        let gid = |writer: &mut cdr::Writer, gid: Gid| {
            writer.raw(&gid);
        };
        let namespace = if self.namespace.is_empty() { "/" } else { &self.namespace };
        let mut entities = cdr::Writer::default();
        entities.raw(&self.participant.gid()).length(1).text(namespace).text(NODE);
        entities.list(readers.collect::<Vec<_>>(), gid).list(writers.collect::<Vec<_>>(), gid);
        self.entities.write(entities.take());
    }

    /// Send a message. If the library does not accept it now, it is lost, and a newer one follows.
    pub(crate) fn publish(&self, id: Id, payload: Vec<u8>) {
        if let Some(writer) = self.writers.get(&id) {
            writer.write(payload);
        }
    }

    /// The messages that have come on the topics.
    pub(crate) fn heard(&self) -> Vec<(Id, Message)> {
        let heard = self.readers.iter().flat_map(|(id, reader)| {
            reader.messages().take(AT_A_TIME).map(|message| (*id, message))
        });
        heard.collect()
    }

    /// The calls of clients of the action.
    pub(crate) fn called(&self) -> Vec<(Call, Message)> {
        let taken = self.services.iter().flat_map(|(call, service)| {
            service.requests.messages().take(AT_A_TIME).map(|message| (*call, message))
        });
        taken.collect()
    }

    /// Answer a call.
    pub(crate) fn reply(&self, call: Call, to: &Request, payload: &[u8]) {
        if let Some((_, service)) = self.services.iter().find(|(of, _)| *of == call) {
            service.replies.reply(to, payload);
        }
    }
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
