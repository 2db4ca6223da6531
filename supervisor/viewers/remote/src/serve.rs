//! From a robot's bus to a session, as a consumer that delays no stage.

use std::{
    fs,
    hash::{BuildHasher as _, RandomState},
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use common::{
    bus::{AnyReader, Bus, BusError, Reader},
    clock::monotonic_ns,
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    run,
    samples::{RosterEntry, RosterHeader},
    topics::{self, AnyTopic, Logged},
};
use console::{
    failure::{Result, refuse},
    stream::{LOOK_EVERY, Stream},
    words::order,
};
use zenoh::{Session, Wait};

use crate::{
    session::{self, Certificates, failed},
    wire::{Hello, Sent},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Address for connections: tls/ADDRESS:PORT or tcp/ADDRESS:PORT.
    ///
    /// Use tcp only on a trusted network.
    #[arg(long, required = true)]
    listen: Vec<String>,
    #[command(flatten)]
    own: Certificates,
    /// Authority of the readers' certificates, a PEM file.
    #[arg(long)]
    clients: Option<PathBuf>,
    /// Common name in the certificate of a permitted reader.
    ///
    /// Default: all whom the authority knows.
    #[arg(long, value_name = "NAME", requires = "clients")]
    allow: Vec<String>,
    /// Topic to serve, for example `field`.
    ///
    /// Default: all with one writer other than an operator, except the largest.
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
}

#[derive(Default)]
struct Told {
    hello: Hello,
    run: String,
}

/// Returns whether a topic has one writer. Excludes operators' topics, because the mirror must not
/// act as one.
pub fn may_serve(topic: &dyn AnyTopic) -> bool {
    let spec = topic.spec();
    spec.has_one_writer() && spec.name != topics::MIRROR.spec().name
}

fn topics(named: &[String]) -> Result<Vec<&'static dyn AnyTopic>> {
    let all = topics::TABLE.iter().copied().filter(|topic| may_serve(*topic));
    if named.is_empty() {
        let large = |topic: &dyn AnyTopic| {
            topic.spec().logged == Logged::WithFields
                || topic.spec().name == topics::WIRE.spec().name
        };
        return Ok(all.filter(|topic| !large(*topic)).collect());
    }
    let find = |name: &String| {
        let found = all.clone().find(|topic| topic.spec().name == name);
        let message =
            format!("topic {name:?} cannot be served; `firsthand topic list` names the topics");
        found.map_or_else(|| refuse("unknown-topic", message), Ok)
    };
    named.iter().map(find).collect()
}

struct Readers {
    topics: Vec<Box<dyn AnyReader>>,
    roster: Reader<RosterHeader, RosterEntry>,
}

pub fn serve(arguments: &Arguments) -> Result {
    let topics = topics(&arguments.topic)?;
    // The session's threads inherit the low priority of this one.
    let mut stream = Stream::open()?;
    let Arguments { listen, own, clients, allow, robot, .. } = arguments;
    let session = session::listen(listen, own, clients.as_deref(), allow)?;
    let told = Arc::new(Mutex::new(Told::default()));
    lock(&told).hello.robot = robot.to_string();
    let _hello = answer(&session, robot, "hello", &told, |told| {
        let hello = Hello { clock_ns: monotonic_ns(), ..told.hello.clone() };
        serde_json::to_vec(&hello).unwrap_or_default()
    })?;
    let _run = answer(&session, robot, "run", &told, |told| told.run.clone().into_bytes())?;
    let publishers = topics
        .iter()
        .map(|topic| {
            let key = format!("firsthand/{robot}/topic/{}", topic.spec().name);
            session.declare_publisher(key).wait().map_err(failed)
        })
        .collect::<Result<Vec<_>>>()?;
    let domain = robot.domain();
    let open = |bus: &Bus| {
        let readers = topics
            .iter()
            .map(|topic| topic.recorder_reader(bus))
            .collect::<Result<_, BusError>>()?;
        Ok(Readers { topics: readers, roster: bus.reader(&topics::ROSTER)? })
    };
    let mut follower = Follower::new(domain.clone(), "remote", &topics::LINK, open)
        .also_on([&topics::ROSTER as _]);
    stream.write("serving\n")?;
    let mut message = Vec::new();
    while !stream.has_ended() {
        match follower.wait(LOOK_EVERY)? {
            Event::Connected | Event::Disconnected => {
                let mut told = lock(&told);
                (told.hello.id, told.run) = (0, String::new());
            }
            Event::Nothing => {}
            Event::Samples(readers) => {
                let id = tell(&mut lock(&told), &domain, &mut readers.roster)?;
                for (reader, publisher) in readers.topics.iter_mut().zip(&publishers) {
                    while reader.next_message(&mut message)?.is_some() {
                        // A slow link drops samples.
                        let sent = Sent { id, sent_ns: monotonic_ns() }.encoded();
                        publisher
                            .put(message.as_slice())
                            .attachment(sent)
                            .wait()
                            .map_err(failed)?;
                    }
                }
            }
        }
    }
    // A close would wait for a link that may be cut.
    std::mem::forget(session);
    Ok(())
}

/// Returns the number of the run.
fn tell(
    told: &mut Told,
    domain: &Domain,
    roster: &mut Reader<RosterHeader, RosterEntry>,
) -> Result<u64> {
    while let Some(entries) = roster.next_slice()? {
        let header = entries.header();
        told.hello.order = order(header).to_owned();
        told.hello.mission_time_s = header.stamp.seconds();
    }
    // The run file appears after the bus.
    if told.hello.id == 0
        && let Ok(text) = fs::read_to_string(domain.run_directory().join(run::FILE_NAME))
    {
        told.run = text;
        told.hello.id = RandomState::new().hash_one(std::process::id()) | 1;
    }
    Ok(told.hello.id)
}

type Answering = zenoh::query::Queryable<()>;

fn answer(
    session: &Session,
    robot: &RobotName,
    what: &str,
    told: &Arc<Mutex<Told>>,
    bytes: impl Fn(&Told) -> Vec<u8> + Send + Sync + 'static,
) -> Result<Answering> {
    let key = format!("firsthand/{robot}/{what}");
    let (told, own) = (Arc::clone(told), key.clone());
    session
        .declare_queryable(key)
        .callback(move |query| {
            let bytes = bytes(&lock(&told));
            let _ = query.reply(own.as_str(), bytes).wait();
        })
        .wait()
        .map_err(failed)
}

fn lock(told: &Mutex<Told>) -> MutexGuard<'_, Told> {
    told.lock().unwrap_or_else(PoisonError::into_inner)
}
