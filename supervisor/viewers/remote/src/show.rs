//! From a session to a mirror: a bus of this machine on which the samples of a robot of another machine are published again.

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
    output::write_stderr,
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
    /// The robot's machine: HOST, HOST:PORT, tls/HOST:PORT or tcp/HOST:PORT.
    host: String,
    /// Name of the robot there.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Its name here, if another robot has that name here.
    #[arg(long = "as", value_name = "NAME")]
    named: Option<RobotName>,
    #[command(flatten)]
    connecting: Connecting,
}

/// The interval of the questions for the robot's clock and run.
const ASK_EVERY: Duration = Duration::from_millis(500);
/// A question without an answer is asked again after this.
const PATIENCE: Duration = Duration::from_secs(2);
/// When nothing came for so long, the newest samples are published again, for who joins later.
const SILENT: Duration = Duration::from_millis(400);
/// Samples that wait for this process; more are dropped.
const WAITING: usize = 256;

const LONGEST_ROSTER: usize = 64;

pub fn show(arguments: &Arguments) -> Result {
    let mut stream = Stream::open()?;
    let Arguments { host, robot, named, connecting } = arguments;
    let session = connecting.connect(host)?;
    let key = format!("firsthand/{robot}/topic/");
    let (sender, samples) = sync_channel(WAITING);
    // A thread of the session must not wait: answers and signs of life come through it, too.
    let subscribed = session.declare_subscriber(format!("{key}*")).callback(move |sample| {
        let _ = sender.try_send(sample);
    });
    let _subscribed = subscribed.wait().map_err(failed)?;
    let domain = Domain::of(named.as_ref().unwrap_or(robot).clone());
    let place = connecting.endpoint(host);
    let mut asker = Asker::new(&session, robot);
    let mut mirror = None::<Mirror>;
    // Until then nobody is told that nothing answers.
    let mut silent_until = Some(Instant::now() + PATIENCE);
    while !stream.has_ended() {
        let hello = asker.look()?;
        if hello.is_some() {
            silent_until = None;
        } else if silent_until.take_if(|until| *until <= Instant::now()).is_some() {
            write_stderr(&format!(
                "firsthand: no robot {robot} answers at {host}; is its name right (--robot), does `firsthand remote serve` run there? It is asked again\n"
            ));
        }
        if let Some(hello) = hello
            && mirror.as_ref().is_none_or(|mirror| mirror.id != hello.id)
        {
            // The last run's bus goes before the next one's comes.
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
    // Closing it would wait for a link that may be cut.
    std::mem::forget(session);
    Ok(())
}

fn sent(sample: &Sample) -> Option<Sent> {
    Sent::decoded(&sample.attachment()?.to_bytes())
}

/// Asks the robot's machine, one question at a time.
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
        let asked = self.session.get(key).timeout(PATIENCE).with(FifoChannel::new(4));
        asked.wait().map_err(failed)
    }

    /// The newest answer, if one has come. Asks again when it is time.
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
            // There is no answer, and none will come.
            Err(_) => None,
        };
        if let Some(hello) = &hello {
            self.clock.on_answer(*asked_ns, hello);
        }
        self.asked = None;
        Ok(hello)
    }

    /// The run of the robot; none if it does not come, or is none that this program can show.
    fn run(&self) -> Result<Option<Run>> {
        let reply = self.ask("run")?.recv().ok();
        let run = reply.and_then(|reply| checked(&String::from_utf8(payload(&reply)?).ok()?));
        if run.is_none() {
            write_stderr(
                "firsthand: the run file of the robot does not come, or is of another version\n",
            );
        }
        Ok(run)
    }
}

fn payload(reply: &Reply) -> Option<Vec<u8>> {
    Some(reply.result().ok()?.payload().to_bytes().into_owned())
}

/// The run in `text`, if its mission is a sane one: the size of the mirror's memory is in it.
pub fn checked(text: &str) -> Option<Run> {
    let run: Run = toml::from_str(text).ok()?;
    Mission::parse(&toml::to_string(&run.mission).ok()?, Path::new("the run file")).ok()?;
    Some(run)
}

/// A bus with the samples of another machine's robot. The fields are dropped in this order: the lock, which removes the bus, last.
pub struct Mirror {
    id: u64,
    writers: BTreeMap<&'static str, Box<dyn AnyWriter>>,
    ages: Writer<MirrorSample>,
    /// The newest samples of the topics that say a state.
    newest: BTreeMap<&'static str, Vec<u8>>,
    heard: Option<(Sent, Stamp)>,
    told: Option<Instant>,
    refused: u64,
    cells: usize,
    bus: Rc<Bus>,
    lock: DomainLock,
    _run: RunDirectory,
}

/// The directory of the mirror's run file, removed with it.
struct RunDirectory(PathBuf);

impl Drop for RunDirectory {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl Mirror {
    /// # Errors
    /// If a robot of that name runs here, or shared memory is full.
    pub fn open(domain: &Domain, mut run: Run, id: u64, place: &str) -> Result<Self> {
        let cells = run.mission.grid_frame().area();
        run.robot = domain.robot.clone();
        // No robot's name has a point.
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

    /// Publish a sample of the robot. What is no sample of a topic that is served is counted and left out.
    pub fn take(&mut self, topic: &str, sent: Sent, message: &[u8]) -> Result {
        let stamp = decode_sample::<Stamp>(message).filter(|_| sent.id == self.id);
        let mut served = topics::TABLE.iter().copied().filter(|topic| may_serve(*topic));
        let known = served.find(|known| known.spec().name == topic);
        let (Some(known), Some(stamp)) = (known, stamp) else {
            self.refuse(topic);
            return Ok(());
        };
        let message = match known.spec().name == topics::ROSTER.spec().name {
            true => without_processes(message),
            false => Some(message.to_vec()),
        };
        let writer = self.writer(known)?;
        // It is refused if it is of another type, or too long.
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

    /// The writer of `topic`, which is opened for its first sample: that of the field takes much memory.
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
            let text = format!(
                "firsthand: a sample of {topic:?} that came is none of this run and version; such are left out\n"
            );
            write_stderr(&text);
        }
    }

    /// Say how old what is shown is, and show the newest samples again while none come.
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

/// Whether the newest sample of a topic says all that there is to say, in few bytes.
fn says_a_state(spec: &Spec) -> bool {
    let [field, pose, power] = [topics::FIELD.spec(), topics::POSE.spec(), topics::POWER.spec()];
    let restated = matches!(spec.rate, Rate::OnChange { .. }) && spec.name != field.name;
    restated || [pose.name, power.name].contains(&spec.name)
}

/// A roster whose processes are not those of this machine, so that nobody looks for them or signals them here.
fn without_processes(message: &[u8]) -> Option<Vec<u8>> {
    let (mut header, mut entries) = decode_slice::<RosterHeader, RosterEntry>(message)?;
    header.supervisor_pid = std::process::id();
    entries.iter_mut().for_each(|entry| entry.pid = 0);
    let mut bytes = Vec::new();
    encode_slice(&header, &entries, &mut bytes);
    Some(bytes)
}
