//! DDS node: topic readers and writers, action servers, parameters, and its entry in
//! `ros2 node list`.

use std::{
    collections::BTreeMap,
    io,
    net::Ipv4Addr,
    time::{Duration, Instant},
};

use ros2::{
    cdr::Cdr as _,
    msg::{self, NodeEntitiesInfo, ParticipantEntitiesInfo},
    participant::{LateReader, Message, Participant, Quality, Reader, Request, Server, Writer},
    topic::Topic,
};

use crate::parameters::{self, Parameter, SERVICES};

/// Most messages of a topic that wait for a slow reader or for the node.
const DEPTH: u16 = 10;
/// Time for clients to discover a new node's writers. Earlier replies are lost.
const KNOWN_AFTER: Duration = Duration::from_secs(2);
const AT_A_TIME: usize = 16;

pub const SURE: Quality = Quality { is_reliable: true, is_latched: false, depth: DEPTH };
pub const LATCHED: Quality = Quality { is_reliable: true, is_latched: true, depth: 1 };

/// Quality for messages of which only the newest counts, from senders of either reliability.
pub const NEWEST: Quality = Quality { is_reliable: false, is_latched: false, depth: 1 };

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Call {
    SendGoal,
    CancelGoal,
    GetResult,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Service {
    Action(usize, Call),
    Parameters(parameters::Service),
}

/// ROS domain, address of the only network interface to use, and namespace.
pub type Network<'a> = (u16, Option<Ipv4Addr>, &'a str);

/// Node: topics by `Id`, actions by their opening order.
pub struct Node<Id> {
    name: &'static str,
    namespace: String,
    writers: BTreeMap<Id, Writer>,
    readers: Vec<(Id, Reader)>,
    late_readers: Vec<(Id, LateReader)>,
    services: BTreeMap<Service, Server>,
    /// Feedback and status of each action.
    actions: Vec<[Writer; 2]>,
    parameters: Vec<Parameter>,
    /// List of the participant's readers and writers, for other nodes.
    entities: Writer,
    joined: Instant,
    pub participant: Participant,
}

impl<Id: Copy + Ord> Node<Id> {
    pub fn join(
        (domain, only, namespace): Network<'_>,
        name: &'static str,
        parameters: Vec<Parameter>,
    ) -> io::Result<Self> {
        let participant = Participant::join(domain, only)?;
        let entities = Topic::plain(
            "ros_discovery_info",
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
        );
        let mut node = Self {
            name,
            namespace: namespace.trim_matches('/').to_owned(),
            writers: BTreeMap::new(),
            readers: Vec::new(),
            late_readers: Vec::new(),
            services: BTreeMap::new(),
            actions: Vec::new(),
            parameters,
            entities: participant.writer(&entities, LATCHED)?,
            joined: Instant::now(),
            participant,
        };
        for (service, part, kind) in SERVICES {
            let name = node.full_name(&format!("{name}/{part}"));
            let kind = format!("rcl_interfaces::srv::dds_::{kind}");
            node.offer(Service::Parameters(service), &name, &kind)?;
        }
        Ok(node)
    }

    /// Returns whether earlier clients know the node's writers.
    pub fn is_known(&self) -> bool {
        self.joined.elapsed() >= KNOWN_AFTER
    }

    pub fn full_name(&self, name: &str) -> String {
        full_name(&self.namespace, name)
    }

    fn topic(&self, [name, kind]: [&str; 2]) -> Topic {
        Topic::new(&self.full_name(name), kind)
    }

    pub fn write_to(&mut self, id: Id, topic: [&str; 2], quality: Quality) -> io::Result<()> {
        self.writers.insert(id, self.participant.writer(&self.topic(topic), quality)?);
        Ok(())
    }

    pub fn retain_writers(&mut self, keep: impl Fn(Id) -> bool) {
        self.writers.retain(|id, _| keep(*id));
    }

    pub fn read_from(&mut self, id: Id, topic: [&str; 2], quality: Quality) -> io::Result<()> {
        self.readers.push((id, self.participant.reader(&self.topic(topic), quality)?));
        Ok(())
    }

    /// Reads a topic of which every message counts.
    pub fn read_late(&mut self, id: Id, topic: [&str; 2]) -> io::Result<()> {
        self.late_readers.push((id, self.participant.late_reader(self.topic(topic), SURE)?));
        Ok(())
    }

    fn offer(&mut self, service: Service, name: &str, kind: &str) -> io::Result<()> {
        let [requests, replies] = Topic::service(name, kind);
        self.services.insert(service, self.participant.server([&requests, &replies], SURE)?);
        Ok(())
    }

    pub fn serve(&mut self, name: &str, kind: &str) -> io::Result<()> {
        let name = self.full_name(name);
        let name = |part| format!("{name}/_action/{part}");
        let kind = |part| format!("nav2_msgs::action::dds_::{kind}_{part}");
        for (call, part, kind) in [
            (Call::SendGoal, "send_goal", kind("SendGoal")),
            (Call::CancelGoal, "cancel_goal", "action_msgs::srv::dds_::CancelGoal".to_owned()),
            (Call::GetResult, "get_result", kind("GetResult")),
        ] {
            self.offer(Service::Action(self.actions.len(), call), &name(part), &kind)?;
        }
        let writer = |part, kind: &str, quality| {
            self.participant.writer(&Topic::new(&name(part), kind), quality)
        };
        let feedback = writer("feedback", &kind("FeedbackMessage_"), SURE)?;
        let status = writer("status", "action_msgs::msg::dds_::GoalStatusArray_", LATCHED)?;
        self.actions.push([feedback, status]);
        Ok(())
    }

    pub fn announce(&self) {
        let requests = self.services.values().map(|server| &server.requests);
        let replies = self.services.values().map(|server| &server.replies);
        let readers = self.readers.iter().map(|(_, reader)| reader).chain(requests);
        let writers = self.writers.values().chain(replies).chain(self.actions.iter().flatten());
        let gid = |data| msg::Gid { data };
        let node = NodeEntitiesInfo {
            node_namespace: format!("/{}", self.namespace),
            node_name: self.name.to_owned(),
            reader_gid_seq: readers.map(Reader::gid).map(gid).collect(),
            writer_gid_seq: writers.map(Writer::gid).map(gid).collect(),
        };
        let gid = gid(self.participant.gid());
        let entities = ParticipantEntitiesInfo { gid, node_entities_info_seq: vec![node] };
        self.entities.write(entities.encode());
    }

    pub fn publish(&self, id: Id, payload: Vec<u8>) {
        if let Some(writer) = self.writers.get(&id) {
            writer.write(payload);
        }
    }

    pub fn publish_feedback(&self, action: usize, payload: Vec<u8>) {
        if let Some([feedback, _]) = self.actions.get(action) {
            feedback.write(payload);
        }
    }

    pub fn publish_status(&self, action: usize, payload: Vec<u8>) {
        if let Some([_, status]) = self.actions.get(action) {
            status.write(payload);
        }
    }

    pub fn heard(&mut self) -> io::Result<Vec<(Id, Message)>> {
        let mut heard: Vec<_> = self
            .readers
            .iter()
            .flat_map(|(id, reader)| {
                reader.messages().take(AT_A_TIME).map(|message| (*id, message))
            })
            .collect();
        for (id, reader) in &mut self.late_readers {
            heard.extend(reader.take(AT_A_TIME)?.into_iter().map(|message| (*id, message)));
        }
        Ok(heard)
    }

    /// Answers requests for parameters. Returns calls of actions, without their headers.
    pub fn called(&mut self) -> Vec<(usize, Call, Message)> {
        let mut called = Vec::new();
        for (service, server) in &mut self.services {
            for mut message in server.take(AT_A_TIME) {
                message.payload = message.request.without_header(&message.payload);
                match service {
                    Service::Action(action, call) => called.push((*action, *call, message)),
                    Service::Parameters(service) => {
                        match parameters::reply(&self.parameters, *service, &message.payload) {
                            Ok(reply) => server.reply(&message.request, &reply),
                            Err(why) => tracing::warn!("refused a request for parameters: {why}"),
                        }
                    }
                }
            }
        }
        called
    }

    pub fn reply(&mut self, action: usize, call: Call, to: &Request, payload: &[u8]) {
        if let Some(server) = self.services.get_mut(&Service::Action(action, call)) {
            server.reply(to, payload);
        }
    }
}

/// Returns the absolute name. Names without a leading slash are below the namespace.
pub fn full_name(namespace: &str, name: &str) -> String {
    match namespace.trim_matches('/') {
        _ if name.starts_with('/') => name.to_owned(),
        "" => format!("/{name}"),
        namespace => format!("/{namespace}/{name}"),
    }
}
