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
    participant::{LateReader, Message, Participant, Quality, Reader, Request, Writer},
    topic::Topic,
};

use crate::parameters::{self, Parameter, SERVICES, Service};

/// Most messages of a topic that wait for a slow reader or for the node.
const DEPTH: u16 = 10;
/// Time for clients to discover a new node's writers. Earlier replies are lost.
const KNOWN_AFTER: Duration = Duration::from_secs(2);
const AT_A_TIME: usize = 16;

pub const SURE: Quality = Quality { is_reliable: true, is_latched: false, depth: DEPTH };
pub const LATCHED: Quality = Quality { is_reliable: true, is_latched: true, depth: 1 };

/// Quality for messages of which only the newest counts, from senders of either reliability.
pub const NEWEST: Quality = Quality { is_reliable: false, is_latched: false, depth: 1 };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    SendGoal,
    CancelGoal,
    GetResult,
}

#[derive(Debug)]
struct Action {
    services: Vec<(Call, Reader, Writer)>,
    feedback: Writer,
    status: Writer,
}

/// Node: topics by `Id`, actions by their opening order.
pub struct Node<Id> {
    name: &'static str,
    pub namespace: String,
    writers: BTreeMap<Id, Writer>,
    readers: Vec<(Id, Reader)>,
    late_readers: Vec<(Id, LateReader)>,
    actions: Vec<Action>,
    parameters: Vec<Parameter>,
    of_parameters: Vec<(Service, Reader, Writer)>,
    /// List of the participant's readers and writers, for other nodes.
    entities: Writer,
    joined: Instant,
    pub participant: Participant,
}

impl<Id: Copy + Ord> Node<Id> {
    pub fn join(
        (domain, only, namespace): (u16, Option<Ipv4Addr>, &str),
        name: &'static str,
        parameters: Vec<Parameter>,
    ) -> io::Result<Self> {
        let participant = Participant::join(domain, only)?;
        let namespace = namespace.trim_matches('/');
        let entities = Topic::plain(
            "ros_discovery_info",
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
        );
        let mut node = Self {
            name,
            namespace: if namespace.is_empty() { String::new() } else { format!("/{namespace}") },
            writers: BTreeMap::new(),
            readers: Vec::new(),
            late_readers: Vec::new(),
            actions: Vec::new(),
            parameters,
            of_parameters: Vec::new(),
            entities: participant.writer(&entities, LATCHED)?,
            joined: Instant::now(),
            participant,
        };
        for (service, part, kind) in SERVICES {
            let name = node.full_name(&format!("{name}/{part}"));
            let kind = format!("rcl_interfaces::srv::dds_::{kind}");
            let (requests, replies) = node.service(&name, &kind)?;
            node.of_parameters.push((service, requests, replies));
        }
        Ok(node)
    }

    /// Returns whether earlier clients know the node's writers.
    pub fn is_known(&self) -> bool {
        self.joined.elapsed() >= KNOWN_AFTER
    }

    /// Returns the absolute name. Names without a leading slash are below the namespace.
    pub fn full_name(&self, name: &str) -> String {
        if name.starts_with('/') { name.to_owned() } else { format!("{}/{name}", self.namespace) }
    }

    pub fn write_to(
        &mut self,
        id: Id,
        [name, kind]: [&str; 2],
        quality: Quality,
    ) -> io::Result<()> {
        let topic = Topic::new(&self.full_name(name), kind);
        self.writers.insert(id, self.participant.writer(&topic, quality)?);
        Ok(())
    }

    pub fn retain_writers(&mut self, keep: impl Fn(Id) -> bool) {
        self.writers.retain(|id, _| keep(*id));
    }

    pub fn read_from(
        &mut self,
        id: Id,
        [name, kind]: [&str; 2],
        quality: Quality,
    ) -> io::Result<()> {
        let topic = Topic::new(&self.full_name(name), kind);
        self.readers.push((id, self.participant.reader(&topic, quality)?));
        Ok(())
    }

    /// Reads a topic of which every message counts.
    pub fn read_late(&mut self, id: Id, [name, kind]: [&str; 2]) -> io::Result<()> {
        let topic = Topic::new(&self.full_name(name), kind);
        self.late_readers.push((id, self.participant.late_reader(topic, SURE)?));
        Ok(())
    }

    fn service(&self, name: &str, kind: &str) -> io::Result<(Reader, Writer)> {
        let [requests, replies] = Topic::service(name, kind);
        let requests = self.participant.reader(&requests, SURE)?;
        Ok((requests, self.participant.writer(&replies, SURE)?))
    }

    pub fn serve(&mut self, name: &str, kind: &str) -> io::Result<()> {
        let name = |part| format!("{}/_action/{part}", self.full_name(name));
        let kind = |part| format!("nav2_msgs::action::dds_::{kind}_{part}");
        let mut services = Vec::new();
        for (call, part, kind) in [
            (Call::SendGoal, "send_goal", kind("SendGoal")),
            (Call::CancelGoal, "cancel_goal", "action_msgs::srv::dds_::CancelGoal".to_owned()),
            (Call::GetResult, "get_result", kind("GetResult")),
        ] {
            let (requests, replies) = self.service(&name(part), &kind)?;
            services.push((call, requests, replies));
        }
        let writer = |part, kind: &str, quality| {
            self.participant.writer(&Topic::new(&name(part), kind), quality)
        };
        let feedback = writer("feedback", &kind("FeedbackMessage_"), SURE)?;
        let status = writer("status", "action_msgs::msg::dds_::GoalStatusArray_", LATCHED)?;
        self.actions.push(Action { services, feedback, status });
        Ok(())
    }

    pub fn announce(&self) {
        let services = || {
            let actions = self.actions.iter().flat_map(|action| &action.services);
            let actions = actions.map(|(_, requests, replies)| (requests, replies));
            actions
                .chain(self.of_parameters.iter().map(|(_, requests, replies)| (requests, replies)))
        };
        let readers = self.readers.iter().map(|(_, reader)| reader);
        let readers = readers.chain(services().map(|(requests, _)| requests)).map(Reader::gid);
        let writers = self.writers.values().chain(services().map(|(_, replies)| replies));
        let topics = self.actions.iter().flat_map(|action| [&action.feedback, &action.status]);
        let writers = writers.chain(topics).map(Writer::gid);
        let gid = |data| msg::Gid { data };
        let namespace = if self.namespace.is_empty() { "/" } else { &self.namespace };
        let node = NodeEntitiesInfo {
            node_namespace: namespace.to_owned(),
            node_name: self.name.to_owned(),
            reader_gid_seq: readers.map(gid).collect(),
            writer_gid_seq: writers.map(gid).collect(),
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
        if let Some(action) = self.actions.get(action) {
            action.feedback.write(payload);
        }
    }

    pub fn publish_status(&self, action: usize, payload: Vec<u8>) {
        if let Some(action) = self.actions.get(action) {
            action.status.write(payload);
        }
    }

    pub fn answer(&self) {
        for (service, requests, replies) in &self.of_parameters {
            for Message { payload, request, .. } in requests.messages().take(AT_A_TIME) {
                let payload = request.without_header(&payload);
                match parameters::reply(&self.parameters, *service, &payload) {
                    Ok(reply) => {
                        replies.reply(&request, &reply);
                    }
                    Err(why) => tracing::warn!("refused a request for parameters: {why}"),
                }
            }
        }
    }

    pub fn heard(&mut self) -> io::Result<Vec<(Id, Message)>> {
        let heard = self.readers.iter().flat_map(|(id, reader)| {
            reader.messages().take(AT_A_TIME).map(|message| (*id, message))
        });
        let mut heard: Vec<_> = heard.collect();
        for (id, reader) in &mut self.late_readers {
            heard.extend(reader.take(AT_A_TIME)?.into_iter().map(|message| (*id, message)));
        }
        Ok(heard)
    }

    pub fn called(&self) -> Vec<(usize, Call, Message)> {
        let actions = self.actions.iter().enumerate();
        let called = actions.flat_map(|(action, it)| {
            it.services.iter().flat_map(move |(call, requests, _)| {
                requests.messages().take(AT_A_TIME).map(move |message| (action, *call, message))
            })
        });
        called.collect()
    }

    pub fn reply(&self, action: usize, call: Call, to: &Request, payload: &[u8]) {
        let services = self.actions.get(action).map(|action| &action.services);
        if let Some((.., replies)) = services.into_iter().flatten().find(|(of, ..)| *of == call) {
            replies.reply(to, payload);
        }
    }
}
