//! From a session to a mirror: a local bus that republishes a remote robot's samples.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    fs,
    path::{Path, PathBuf},
    rc::Rc,
    sync::mpsc::{RecvTimeoutError, sync_channel},
    time::{Duration, Instant},
};

use common::{
    bus::{AnyWriter, Bus, BusError, Stamp, Writer, decode_sample, decode_slice, encode_slice},
    clock::monotonic_ns,
    domain::{Domain, RobotName},
    mission::Mission,
    run::Run,
    samples::{MirrorSample, RosterEntry, RosterHeader},
    topics::{self, AnyTopic, RESTATE, Rate, Spec},
};
use console::{
    failure::Result,
    output::say,
    stream::{LOOK_EVERY, Stream},
};
use processes::domain::{DomainLock, make_own_directory};
use zenoh::{
    Session, Wait, handlers::FifoChannel, handlers::FifoChannelHandler, query::Reply,
    sample::Sample,
};

use crate::{
    serve::may_serve,
    session::{Connecting, failed},
    wire::{Clock, Hello, Sent},
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Robot's machine: HOST, HOST:PORT, tls/HOST:PORT or tcp/HOST:PORT.
    host: String,
    /// Name of the robot there.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Local name, if its own name is taken here.
    #[arg(long = "as", value_name = "NAME")]
    named: Option<RobotName>,
    #[command(flatten)]
    connecting: Connecting,
}

/// Interval of requests for the robot's clock and run.
const ASK_EVERY: Duration = Duration::from_millis(500);
/// Time before a request is repeated.
const PATIENCE: Duration = Duration::from_secs(2);
/// Silence after which the newest samples are republished for late joiners.
const SILENT: Duration = Duration::from_millis(400);
/// Most samples that wait for this process. Further ones are dropped.
const WAITING: usize = 256;

const LONGEST_ROSTER: usize = 64;

pub fn show(arguments: &Arguments) -> Result {
    let mut stream = Stream::open()?;
    let Arguments { host, robot, named, connecting } = arguments;
    let session = connecting.connect(host)?;
    let key = format!("firsthand/{robot}/topic/");
    let (sender, samples) = sync_channel(WAITING);
    // The session thread must not block: it also carries answers and keep-alives.
    let _subscribed = session
        .declare_subscriber(format!("{key}*"))
        .callback(move |sample| {
            let _ = sender.try_send(sample);
        })
        .wait()
        .map_err(failed)?;
    let domain = Domain::of(named.as_ref().unwrap_or(robot).clone());
    let place = connecting.endpoint(host);
    let mut asker = Asker::new(&session, robot);
    let mut mirror = None::<Mirror>;
    let mut silent_until = Some(Instant::now() + PATIENCE);
    while !stream.has_ended() {
        let hello = asker.look()?;
        if hello.is_some() {
            silent_until = None;
        } else if silent_until.take_if(|until| *until <= Instant::now()).is_some() {
            say(format_args!(
                "no robot {robot} answers at {host}, and the mirror asks again; check its name (--robot) and that `firsthand remote serve` runs there"
            ));
        }
        if let Some(hello) = hello
            && mirror.as_ref().is_none_or(|mirror| mirror.id != hello.id)
        {
            // The last run's bus is removed before the next is created.
            if mirror.take().is_some() {
                stream.write("the run has ended\n")?;
            }
            if hello.id != 0
                && let Some(run) = asker.run()?
            {
                mirror = Some(Mirror::open(&domain, run, hello.id, &place)?);
                stream.write("showing\n")?;
            }
        }
        let first = match samples.recv_timeout(LOOK_EVERY) {
            Ok(sample) => Some(sample),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return Err("the session has ended".into()),
        };
        let taken = first.into_iter().chain(samples.try_iter());
        let Some(mirror) = &mut mirror else {
            taken.for_each(drop);
            continue;
        };
        for sample in taken {
            let topic = sample.key_expr().as_str().strip_prefix(&key);
            if let (Some(topic), Some(sent)) = (topic, sent(&sample)) {
                mirror.take(topic, sent, &sample.payload().to_bytes())?;
            }
        }
        mirror.tell(&asker.clock)?;
    }
    drop(mirror);
    // A close would wait for a link that may be cut.
    std::mem::forget(session);
    Ok(())
}

fn sent(sample: &Sample) -> Option<Sent> {
    Sent::decoded(&sample.attachment()?.to_bytes())
}

struct Asker<'a> {
    session: &'a Session,
    robot: &'a RobotName,
    asked: Option<(u64, FifoChannelHandler<Reply>)>,
    last: Option<Instant>,
    clock: Clock,
}

impl<'a> Asker<'a> {
    fn new(session: &'a Session, robot: &'a RobotName) -> Self {
        Self { session, robot, asked: None, last: None, clock: Clock::default() }
    }

    fn ask(&self, what: &str) -> Result<FifoChannelHandler<Reply>> {
        let key = format!("firsthand/{}/{what}", self.robot);
        self.session.get(key).timeout(PATIENCE).with(FifoChannel::new(4)).wait().map_err(failed)
    }

    /// Returns a new answer, if any. Repeats the request when due.
    fn look(&mut self) -> Result<Option<Hello>> {
        let Some((asked_ns, replies)) = &self.asked else {
            if self.last.is_none_or(|last| last.elapsed() >= ASK_EVERY) {
                self.last = Some(Instant::now());
                self.asked = Some((monotonic_ns(), self.ask("hello")?));
            }
            return Ok(None);
        };
        let hello = match replies.try_recv() {
            Ok(None) => return Ok(None),
            Ok(Some(reply)) => payload(&reply).and_then(|bytes| Hello::decoded(&bytes)),
            Err(_) => None,
        };
        if let Some(hello) = &hello {
            self.clock.on_answer(*asked_ns, hello);
        }
        self.asked = None;
        Ok(hello)
    }

    /// Returns `None` if it does not arrive or is incompatible.
    fn run(&self) -> Result<Option<Run>> {
        let run = self
            .ask("run")?
            .recv()
            .ok()
            .and_then(|reply| checked(&String::from_utf8(payload(&reply)?).ok()?));
        if run.is_none() {
            say("the robot's run file is missing or of another version");
        }
        Ok(run)
    }
}

fn payload(reply: &Reply) -> Option<Vec<u8>> {
    Some(reply.result().ok()?.payload().to_bytes().into_owned())
}

/// The mission sets the mirror's memory.
pub fn checked(text: &str) -> Option<Run> {
    let run: Run = toml::from_str(text).ok()?;
    Mission::parse(&toml::to_string(&run.mission).ok()?, "the run file").ok()?;
    Some(run)
}

/// Bus with a remote robot's samples. The lock drops last and removes the bus after its users.
pub struct Mirror {
    id: u64,
    writers: BTreeMap<&'static str, Box<dyn AnyWriter>>,
    ages: Writer<MirrorSample>,
    newest: BTreeMap<&'static str, Vec<u8>>,
    heard: Option<(Sent, Stamp)>,
    told: Option<Instant>,
    refused: u64,
    cells: usize,
    bus: Rc<Bus>,
    lock: DomainLock,
    _run: RunDirectory,
}

/// Directory of the mirror's run file, removed on drop.
struct RunDirectory(PathBuf);

impl Drop for RunDirectory {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl Mirror {
    /// Opens a mirror with the run file and the bus.
    ///
    /// # Errors
    /// A robot of that name runs here, or shared memory is full.
    pub fn open(domain: &Domain, mut run: Run, id: u64, place: &str) -> Result<Self> {
        let cells = run.mission.grid_frame().area();
        run.robot = domain.robot.clone();
        // Robot names contain no dot, so this name is free.
        let directory = domain.directory().with_extension("mirror");
        let mut lock = DomainLock::acquire(domain.clone(), cells)?;
        make_own_directory(&directory)?;
        let directory = RunDirectory(directory);
        run.save(&directory.0)?;
        lock.link_to_run(Path::new(place), domain.mirror_link())?;
        lock.link_to_run(&directory.0, domain.run_directory())?;
        let bus: Rc<Bus> = lock.bus().ok_or("the mirror has no bus")?;
        let ages = bus.writer(&topics::MIRROR, 1)?;
        Ok(Self {
            id,
            writers: BTreeMap::new(),
            ages,
            newest: BTreeMap::new(),
            heard: None,
            told: None,
            refused: 0,
            cells,
            bus,
            lock,
            _run: directory,
        })
    }

    /// Publishes a sample. Counts and drops other messages.
    pub fn take(&mut self, topic: &str, sent: Sent, message: &[u8]) -> Result {
        let stamp = decode_sample::<Stamp>(message).filter(|_| sent.id == self.id);
        let known = topics::find(topic).filter(|known| may_serve(*known));
        let (Some(known), Some(stamp)) = (known, stamp) else {
            self.refuse(topic);
            return Ok(());
        };
        let message = if known.spec().name == topics::ROSTER.spec().name {
            without_processes(message)
        } else {
            Some(message.to_vec())
        };
        let writer = self.writer(known)?;
        let Some(message) = message.filter(|it| writer.publish_message(it).unwrap_or(false)) else {
            self.refuse(topic);
            return Ok(());
        };
        if self.heard.is_none_or(|(heard, _)| sent.sent_ns >= heard.sent_ns) {
            self.heard = Some((sent, stamp));
        }
        if says_a_state(known.spec()) {
            self.newest.insert(known.spec().name, message);
        }
        Ok(())
    }

    /// Returns the writer of `topic`, opened at its first sample to save memory.
    fn writer(&mut self, topic: &'static dyn AnyTopic) -> Result<&mut dyn AnyWriter, BusError> {
        let spec = topic.spec();
        let longest = match spec.limits.longest {
            usize::MAX if spec.name == topics::ROSTER.spec().name => LONGEST_ROSTER,
            usize::MAX => self.cells,
            longest => longest,
        };
        Ok(match self.writers.entry(spec.name) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(place) => place.insert(topic.any_writer(&self.bus, 1, longest)?),
        }
        .as_mut())
    }

    fn refuse(&mut self, topic: &str) {
        self.refused += 1;
        if self.refused == 1 {
            say(format_args!(
                "the mirror drops samples of {topic:?} that are from another run or version"
            ));
        }
    }

    /// Publishes the data's age, and repeats the newest samples during silence.
    pub fn tell(&mut self, clock: &Clock) -> Result {
        let Some((sent, stamp)) = self.heard else { return Ok(()) };
        if self.told.is_some_and(|told| told.elapsed() < RESTATE) {
            return Ok(());
        }
        self.told = Some(Instant::now());
        self.lock.restore();
        let Some(age_ns) = clock.age_ns(monotonic_ns(), sent.sent_ns) else { return Ok(()) };
        let sample = MirrorSample { age_ns, ..MirrorSample::default() };
        self.ages.publish(stamp.tick, stamp.time(), sample)?;
        if u128::from(age_ns) >= SILENT.as_nanos() {
            for (name, message) in &self.newest {
                if let Some(writer) = self.writers.get_mut(name) {
                    writer.publish_message(message)?;
                }
            }
        }
        Ok(())
    }
}

/// Returns whether a topic's newest sample is its complete state, in few bytes.
fn says_a_state(spec: &Spec) -> bool {
    let [field, pose, power] = [topics::FIELD.spec(), topics::POSE.spec(), topics::POWER.spec()];
    let restated = matches!(spec.rate, Rate::OnChange { .. }) && spec.name != field.name;
    restated || [pose.name, power.name].contains(&spec.name)
}

/// Clears the roster's remote pids, which must not be signalled here.
fn without_processes(message: &[u8]) -> Option<Vec<u8>> {
    let (mut header, mut entries) = decode_slice::<RosterHeader, RosterEntry>(message)?;
    header.supervisor_pid = std::process::id();
    entries.iter_mut().for_each(|entry| entry.pid = 0);
    let mut bytes = Vec::new();
    encode_slice(&header, &entries, &mut bytes);
    Some(bytes)
}
