//! The one file that names the middleware (iceoryx2): services, writers, readers, and waiting for them.
//!
//! Rules it keeps, each paid for by experiment:
//! - the domain's configuration is made the process-wide one before anything else is called;
//! - services are created by the supervisor alone ([`Bus::make`]) and opened by everyone else, so
//!   that no stage killed while starting leaves one half made;
//! - limits have slack, so authorship is checked here: readers drop samples of a writer's older lives;
//! - events only wake; data come from receiving until there is none.
//!
//! Why `unsafe` is allowed here: the listener's file descriptor can only be had through an `unsafe`
//! call, and polling it needs a borrow of it. It is sound because the borrow never outlives the
//! listener, which the same struct owns, and nobody closes the descriptor. A payload's name, too, can
//! only be asked for through an `unsafe` call, which does nothing but return it.
#![allow(unsafe_code)]

use std::{
    any::Any,
    collections::HashSet,
    ffi::OsStr,
    fmt::Debug,
    io,
    marker::PhantomData,
    ops::Deref,
    os::{
        fd::{AsFd, BorrowedFd},
        unix::{ffi::OsStrExt as _, fs::MetadataExt as _},
    },
    path::{Path, PathBuf},
    time::Duration,
};

mod error;
mod leftovers;

pub use error::BusError;
pub use iceoryx2::prelude::ZeroCopySend;
use iceoryx2::{
    config::Config,
    node::{Node, NodeBuilder, NodeState, NodeView as _},
    port::{listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber},
    prelude::{
        AllocationStrategy, CallbackProgression, FileDescriptorBased, LogLevel, NodeName,
        SemanticString, ServiceName, SignalHandlingMode, ipc, set_log_level_from_env_or,
    },
    sample::Sample,
    service::{
        builder::publish_subscribe::PublishSubscribeOpenError,
        port_factory::{PortFactory as _, event, publish_subscribe},
    },
};

use crate::{
    clock::MissionTime,
    domain::{Domain, SHARED_MEMORY},
    samples::Stamped,
    topics::{EVERY_STAGE, Limits, OPERATOR, Rate, Spec},
};

fn refused<E: Debug>(action: &'static str, topic: &'static str) -> impl FnOnce(E) -> BusError {
    move |detail| BusError::Refused {
        action,
        topic,
        detail: format!("{detail:?}"),
    }
}

fn opening(topic: &'static str) -> impl FnOnce(PublishSubscribeOpenError) -> BusError {
    use PublishSubscribeOpenError as E;
    move |error| match error {
        E::IncompatibleTypes | E::VersionMismatch | E::ServiceInCorruptedState => {
            BusError::Incompatible { topic }
        }
        other => refused("open", topic)(other),
    }
}

/// A topic whose samples are one struct.
#[derive(Debug)]
pub struct Topic<P> {
    spec: &'static Spec,
    payload: PhantomData<fn() -> P>,
}

/// A topic whose samples are a header and a slice.
#[derive(Debug)]
pub struct SliceTopic<H, T> {
    spec: &'static Spec,
    payload: PhantomData<fn() -> (H, T)>,
}

/// What a payload must be to lie in shared memory.
pub trait Payload: ZeroCopySend + Copy + Debug + Default + 'static {}
impl<P: ZeroCopySend + Copy + Debug + Default + 'static> Payload for P {}

impl<P> Topic<P> {
    /// A row of the table.
    #[must_use]
    pub const fn new(spec: &'static Spec) -> Self {
        Self {
            spec,
            payload: PhantomData,
        }
    }
}

impl<H, T> SliceTopic<H, T> {
    /// A row of the table.
    #[must_use]
    pub const fn new(spec: &'static Spec) -> Self {
        Self {
            spec,
            payload: PhantomData,
        }
    }
}

/// A row of the table, whatever it carries.
pub trait AnyTopic: Sync {
    /// What the table says.
    fn spec(&self) -> &'static Spec;
    /// The name of its payload, for every language: a struct, or a header and a slice of elements.
    fn payload(&self) -> String;
    /// How often its writer says it again when nothing changes; zero for topics of each tick.
    fn restated_every(&self) -> Duration {
        match self.spec().rate {
            Rate::EachTick | Rate::EachFrame | Rate::WhenItHappens => Duration::ZERO,
            Rate::OnChange(at_least_every) => at_least_every,
        }
    }
    /// Create its services on `bus`; they exist as long as the result is held.
    ///
    /// # Errors
    /// When the middleware refuses.
    fn create(&self, bus: &Bus) -> Result<Box<dyn Any>, BusError>;
}

macro_rules! pub_sub {
    ($bus:expr, $spec:expr, $payload:ty, $header:ty) => {
        $bus.node
            .service_builder(&service_name($spec)?)
            .publish_subscribe::<$payload>()
            .user_header::<$header>()
            .subscriber_max_buffer_size($spec.limits.buffer)
            .subscriber_max_borrowed_samples($spec.limits.borrowed)
            .max_subscribers($spec.limits.readers)
            .max_publishers(Limits::WRITERS)
            .max_nodes(Limits::NODES)
            .history_size(1)
            .enable_safe_overflow(true)
    };
}

impl<P: Payload> AnyTopic for Topic<P> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        type_name::<P>().to_owned()
    }

    fn create(&self, bus: &Bus) -> Result<Box<dyn Any>, BusError> {
        let samples = pub_sub!(bus, self.spec, P, ())
            .create()
            .map_err(refused("create", self.spec.name))?;
        Ok(Box::new((samples, bus.create_event(self.spec)?)))
    }
}

impl<H: Payload, T: Payload> AnyTopic for SliceTopic<H, T> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        format!("{} + [{}]", type_name::<H>(), type_name::<T>())
    }

    fn create(&self, bus: &Bus) -> Result<Box<dyn Any>, BusError> {
        let samples = pub_sub!(bus, self.spec, [T], H)
            .create()
            .map_err(refused("create", self.spec.name))?;
        Ok(Box::new((samples, bus.create_event(self.spec)?)))
    }
}

fn type_name<P: Payload>() -> &'static str {
    // SAFETY: the name is only shown; that the layout is the same everywhere is promised where each
    // payload derives the trait.
    unsafe { <P as ZeroCopySend>::type_name() }
}

fn service_name(spec: &Spec) -> Result<ServiceName, BusError> {
    spec.name.try_into().map_err(refused("name", spec.name))
}

/// A process's place on a robot's bus.
#[derive(Debug)]
pub struct Bus {
    node: Node<ipc::Service>,
    config: PathBuf,
    made: Made,
}

/// The services of every topic, existing as long as this is held.
pub struct Services(#[allow(dead_code, reason = "held, not read")] Vec<Box<dyn Any>>);

/// Which making of the bus a configuration is of: a file's number may be given to the next, but not its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Made {
    file: u64,
    seconds: i64,
    nanoseconds: i64,
}

impl Made {
    fn of(config: &Path) -> io::Result<Self> {
        let file = config.metadata()?;
        Ok(Self {
            file: file.ino(),
            seconds: file.mtime(),
            nanoseconds: file.mtime_nsec(),
        })
    }
}

fn no_join(domain: &Domain) -> impl Fn(String) -> BusError {
    move |detail| BusError::Join {
        robot: domain.robot.to_string(),
        detail,
    }
}

impl Bus {
    /// Make the bus of a robot: its configuration, which consumers in other languages load, too, and the services of
    /// every topic of the table. Nobody can join before all are there. The supervisor's business alone; there must be
    /// no other.
    ///
    /// # Errors
    /// When a file cannot be written, a service exists already, or shared memory is full.
    pub fn make(domain: &Domain, name: &str) -> Result<(Self, Services), BusError> {
        let (unfinished, config) = (
            domain.middleware_config_unfinished(),
            domain.middleware_config(),
        );
        Self::write_config(domain, &unfinished)?;
        let mut bus = Self::join_by(&unfinished, domain, name)?;
        let services = crate::topics::TABLE
            .iter()
            .map(|topic| topic.create(&bus))
            .collect::<Result<_, _>>()?;
        let failed = |error: io::Error| no_join(domain)(error.to_string());
        leftovers::keep(&bus.services(), &bus.kept()).map_err(failed)?;
        std::fs::rename(&unfinished, &config).map_err(failed)?;
        bus.config = config;
        Ok((bus, Services(services)))
    }

    fn write_config(domain: &Domain, file: &Path) -> Result<(), BusError> {
        let failed = no_join(domain);
        let mut config = Config::default();
        let root = domain.middleware_root();
        let prefix = domain.shared_memory_prefix();
        let path = SemanticString::new(root.as_os_str().as_encoded_bytes())
            .map_err(|error| failed(format!("{error:?} in {root:?}")))?;
        config.global.set_root_path(&path);
        config.global.prefix = SemanticString::new(prefix.as_bytes())
            .map_err(|error| failed(format!("{error:?} in {prefix:?}")))?;
        // The supervisor clears up after the dead: a stage that starts does not wait for it.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let text = toml::to_string(&config).map_err(|error| failed(error.to_string()))?;
        std::fs::write(file, text).map_err(|error| failed(format!("{}: {error}", file.display())))
    }

    /// Join the bus of a robot under a name that `iox2 node list` shows.
    ///
    /// The first call settles the process's domain: a process speaks to one robot.
    ///
    /// # Errors
    /// When the robot does not run here, is another user's, or shared memory is full.
    pub fn join(domain: &Domain, name: &str) -> Result<Self, BusError> {
        Self::join_by(&domain.middleware_config(), domain, name)
    }

    fn join_by(file: &Path, domain: &Domain, name: &str) -> Result<Self, BusError> {
        // The middleware reports what we report anyway; IOX2_LOG_LEVEL brings its own words back.
        set_log_level_from_env_or(LogLevel::Fatal);
        let join = no_join(domain);
        // Looked at first: should it be replaced meanwhile, that is seen.
        let made = Made::of(file).map_err(|error| BusError::NotRunning {
            robot: domain.robot.to_string(),
            detail: format!("{}: {error}", file.display()),
        })?;
        let path = SemanticString::new(file.as_os_str().as_encoded_bytes())
            .map_err(|error| join(format!("{error:?} in {file:?}")))?;
        let config = Config::setup_global_config_from_file(&path)
            .map_err(|error| join(format!("{error:?}")))?;
        if config.global.prefix.as_bytes() != domain.shared_memory_prefix().as_bytes() {
            return Err(join(
                "this process already speaks to another robot".to_owned(),
            ));
        }
        let name = NodeName::new(name).map_err(|error| join(format!("{error:?}")))?;
        let node = NodeBuilder::new()
            .name(&name)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| join(format!("{error:?}")))?;
        Ok(Self {
            node,
            config: file.to_owned(),
            made,
        })
    }

    /// Whether another bus has taken its place, of this run or of the robot's next: on this one nobody speaks any
    /// more. Whoever listens drops all he has of it, and joins again.
    #[must_use]
    pub fn is_replaced(&self) -> bool {
        Made::of(&self.config).is_ok_and(|now| now != self.made)
    }

    /// Where the services' files are.
    fn services(&self) -> PathBuf {
        let services = self.node.config().global.service_dir();
        PathBuf::from(OsStr::from_bytes(services.as_bytes()))
    }

    /// Where they are kept under a second name.
    fn kept(&self) -> PathBuf {
        self.services().with_extension("kept")
    }

    /// Make way for the successor of `process`, which must be gone: remove what it was just making, for which the
    /// successor could wait for ever, and put back what it must find. The supervisor's business alone. Says whether
    /// somebody else is just making something, or died of it.
    ///
    /// # Errors
    /// When files of the dead cannot be removed.
    pub fn make_way(&self, process: u32) -> io::Result<bool> {
        leftovers::put_back(&self.kept(), &self.services())?;
        self.remove_unfilled(process)
    }

    fn remove_unfilled(&self, process: u32) -> io::Result<bool> {
        let prefix = String::from_utf8_lossy(self.node.config().global.prefix.as_bytes());
        leftovers::remove_unfilled(Path::new(SHARED_MEMORY), &prefix, process)
    }

    /// Free what the dead held: their places on the topics, their memory; and what the processes `killed`, which
    /// must be gone, left of a start that was cut off. Put back what joiners must find. The supervisor's business alone; a few milliseconds for each.
    /// Says whether all that could be done: else it is to be tried again, with the same processes.
    ///
    /// # Errors
    /// When files of the dead cannot be removed.
    pub fn clear_up(&self, killed: &[u32]) -> io::Result<bool> {
        leftovers::put_back(&self.kept(), &self.services())?;
        let config = self.node.config();
        let nodes = config.global.node_dir();
        let nodes = Path::new(OsStr::from_bytes(nodes.as_bytes()));
        let (mut outcome, mut all) = (Ok(()), true);
        let listed = Node::<ipc::Service>::list(config, |node| {
            if let NodeState::Dead(dead) = node {
                match self.remove_unfilled(leftovers::process_of(dead.id().value())) {
                    // One that cannot be freed now is met again next time.
                    Ok(false) => drop(dead.try_remove_stale_resources()),
                    // To wait for what is never filled would be to wait for ever: next time it is old.
                    Ok(true) => all = false,
                    Err(error) => {
                        outcome = Err(error);
                        return CallbackProgression::Stop;
                    }
                }
            }
            CallbackProgression::Continue
        });
        outcome?;
        listed.map_err(|error| io::Error::other(format!("{error:?}")))?;
        // By these files the places of the dead are found.
        if all {
            killed.iter().try_for_each(|&process| {
                self.remove_unfilled(process)?;
                leftovers::remove_nodes(nodes, process)
            })?;
        }
        Ok(all)
    }

    fn create_event(&self, spec: &Spec) -> Result<event::PortFactory<ipc::Service>, BusError> {
        self.node
            .service_builder(&service_name(spec)?)
            .event()
            .max_notifiers(Limits::WRITERS)
            .max_listeners(spec.limits.readers)
            .max_nodes(Limits::NODES)
            .create()
            .map_err(refused("create", spec.name))
    }

    fn open_event(&self, spec: &Spec) -> Result<event::PortFactory<ipc::Service>, BusError> {
        self.node
            .service_builder(&service_name(spec)?)
            .event()
            .open()
            .map_err(refused("open", spec.name))
    }

    fn notifier(&self, spec: &Spec) -> Result<Notifier<ipc::Service>, BusError> {
        self.open_event(spec)?
            .notifier_builder()
            .create()
            .map_err(refused("write", spec.name))
    }

    /// Write `topic` in the `generation`-th life of this process's stage.
    ///
    /// # Errors
    /// When the topic is missing, carries another payload, or has no place left.
    pub fn writer<P: Payload + Stamped>(
        &self,
        topic: &Topic<P>,
        generation: u32,
    ) -> Result<Writer<P>, BusError> {
        let spec = topic.spec;
        let service = pub_sub!(self, spec, P, ())
            .open()
            .map_err(opening(spec.name))?;
        let publisher = service
            .publisher_builder()
            .create()
            .map_err(refused("write", spec.name))?;
        Ok(Writer {
            publisher,
            notifier: self.notifier(spec)?,
            generation,
            sequence: 0,
            topic: spec.name,
        })
    }

    /// Write slices of at most `longest` elements on `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn slice_writer<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
        generation: u32,
        longest: usize,
    ) -> Result<SliceWriter<H, T>, BusError> {
        let spec = topic.spec;
        let service = pub_sub!(self, spec, [T], H)
            .open()
            .map_err(opening(spec.name))?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(longest)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(refused("write", spec.name))?;
        Ok(SliceWriter {
            publisher,
            readers: Readers {
                service,
                known: HashSet::new(),
            },
            notifier: self.notifier(spec)?,
            generation,
            sequence: 0,
            topic: spec.name,
        })
    }

    /// Read `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn reader<P: Payload + Stamped>(&self, topic: &Topic<P>) -> Result<Reader<P>, BusError> {
        let spec = topic.spec;
        let subscriber = pub_sub!(self, spec, P, ())
            .open()
            .map_err(opening(spec.name))?
            .subscriber_builder()
            .create()
            .map_err(refused("read", spec.name))?;
        Ok(Reader {
            subscriber,
            authorship: Authorship::of(spec),
        })
    }

    /// Read the slices of `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn slice_reader<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
    ) -> Result<SliceReader<H, T>, BusError> {
        let spec = topic.spec;
        let subscriber = pub_sub!(self, spec, [T], H)
            .open()
            .map_err(opening(spec.name))?
            .subscriber_builder()
            .create()
            .map_err(refused("read", spec.name))?;
        Ok(SliceReader {
            subscriber,
            authorship: Authorship::of(spec),
        })
    }

    /// Be woken when `topic` speaks.
    ///
    /// # Errors
    /// When the topic is missing or has no place left.
    pub fn wakeup(&self, topic: &dyn AnyTopic) -> Result<Wakeup, BusError> {
        let spec = topic.spec();
        self.open_event(spec)?
            .listener_builder()
            .create()
            .map(|listener| Wakeup { listener })
            .map_err(refused("listen to", spec.name))
    }
}

/// Publishes one struct a sample.
#[derive(Debug)]
pub struct Writer<P: Payload> {
    publisher: Publisher<ipc::Service, P, ()>,
    notifier: Notifier<ipc::Service>,
    generation: u32,
    sequence: u32,
    topic: &'static str,
}

impl<P: Payload + Stamped> Writer<P> {
    /// Publish `payload` for `tick` at mission `time`, stamped, and wake the readers.
    ///
    /// # Errors
    /// When no memory is left to loan, which slack in the limits rules out unless a reader misbehaves.
    pub fn publish(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut payload: P,
    ) -> Result<(), BusError> {
        *payload.stamp_mut() = next_stamp(tick, time, self.generation, &mut self.sequence);
        self.publisher
            .send_copy(payload)
            .map_err(refused("publish on", self.topic))?;
        wake(&self.notifier, self.topic)
    }
}

fn next_stamp(
    tick: u64,
    time: MissionTime,
    generation: u32,
    sequence: &mut u32,
) -> crate::samples::Stamp {
    let stamp = crate::samples::Stamp {
        tick,
        stamp_ns: time.0,
        generation,
        sequence: *sequence,
    };
    *sequence = sequence.wrapping_add(1);
    stamp
}

fn wake(notifier: &Notifier<ipc::Service>, topic: &'static str) -> Result<(), BusError> {
    notifier
        .notify()
        .map(drop)
        .map_err(refused("wake the readers of", topic))
}

/// Who reads a topic of slices.
#[derive(Debug)]
struct Readers<H: Payload, T: Payload> {
    service: publish_subscribe::PortFactory<ipc::Service, [T], H>,
    known: HashSet<u128>,
}

/// Publishes a header and a slice a sample.
#[derive(Debug)]
pub struct SliceWriter<H: Payload, T: Payload> {
    publisher: Publisher<ipc::Service, [T], H>,
    readers: Readers<H, T>,
    notifier: Notifier<ipc::Service>,
    generation: u32,
    sequence: u32,
    topic: &'static str,
}

impl<H: Payload + Stamped, T: Payload> SliceWriter<H, T> {
    /// Publish `header` with `cells`, in order; as [`Writer::publish`].
    ///
    /// # Errors
    /// As [`Writer::publish`], and when there are more cells than the writer was made for.
    pub fn publish(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        *header.stamp_mut() = next_stamp(tick, time, self.generation, &mut self.sequence);
        let mut sample = self
            .publisher
            .loan_slice_uninit(cells.len())
            .map_err(refused("publish on", self.topic))?;
        *sample.user_header_mut() = header;
        let mut cells = cells;
        sample
            .write_from_fn(|_| cells.next().unwrap_or_default())
            .send()
            .map_err(refused("publish on", self.topic))?;
        wake(&self.notifier, self.topic)
    }

    /// Whether a reader came since this was last asked: it needs a keyframe.
    pub fn has_new_reader(&mut self) -> bool {
        let mut now = HashSet::new();
        self.readers
            .service
            .dynamic_config()
            .list_subscribers(|reader| {
                now.insert(reader.subscriber_id.value());
                CallbackProgression::Continue
            });
        let new = !now.is_subset(&self.readers.known);
        self.readers.known = now;
        new
    }
}

/// Which life of the writer a reader listens to.
#[derive(Debug)]
struct Authorship {
    /// None where many write.
    newest: Option<u32>,
}

impl Authorship {
    fn of(spec: &Spec) -> Self {
        Self {
            newest: (![EVERY_STAGE, OPERATOR].contains(&spec.writer)).then_some(0),
        }
    }

    /// Whether a sample of `generation` is still of the living.
    fn admits(&mut self, generation: u32) -> bool {
        match &mut self.newest {
            Some(newest) if generation < *newest => false,
            Some(newest) => {
                *newest = generation;
                true
            }
            None => true,
        }
    }
}

/// Receives structs.
#[derive(Debug)]
pub struct Reader<P: Payload> {
    subscriber: Subscriber<ipc::Service, P, ()>,
    authorship: Authorship,
}

impl<P: Payload + Stamped> Reader<P> {
    /// The next sample in order of publication; none when all were taken.
    ///
    /// # Errors
    /// When a connection to the writer broke.
    pub fn take(&mut self) -> Result<Option<P>, BusError> {
        while let Some(sample) = self
            .subscriber
            .receive()
            .map_err(refused("read", "a topic"))?
        {
            if self.authorship.admits(sample.stamp().generation) {
                return Ok(Some(*sample));
            }
        }
        Ok(None)
    }

    /// The newest sample; those before it are dropped.
    ///
    /// # Errors
    /// As [`Reader::take`].
    pub fn newest(&mut self) -> Result<Option<P>, BusError> {
        let mut newest = None;
        while let Some(sample) = self.take()? {
            newest = Some(sample);
        }
        Ok(newest)
    }
}

/// Receives headers with slices.
#[derive(Debug)]
pub struct SliceReader<H: Payload, T: Payload> {
    subscriber: Subscriber<ipc::Service, [T], H>,
    authorship: Authorship,
}

/// A header with its slice, still in shared memory; the writer cannot reuse it while this is held.
#[derive(Debug)]
pub struct Slice<H: Payload, T: Payload> {
    sample: Sample<ipc::Service, [T], H>,
}

impl<H: Payload, T: Payload> Slice<H, T> {
    /// The header.
    #[must_use]
    pub fn header(&self) -> &H {
        self.sample.user_header()
    }
}

impl<H: Payload, T: Payload> Deref for Slice<H, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.sample.payload()
    }
}

impl<H: Payload + Stamped, T: Payload> SliceReader<H, T> {
    /// The next sample; as [`Reader::take`].
    ///
    /// # Errors
    /// As [`Reader::take`].
    pub fn take(&mut self) -> Result<Option<Slice<H, T>>, BusError> {
        while let Some(sample) = self
            .subscriber
            .receive()
            .map_err(refused("read", "a topic"))?
        {
            if self
                .authorship
                .admits(sample.user_header().stamp().generation)
            {
                return Ok(Some(Slice { sample }));
            }
        }
        Ok(None)
    }
}

/// Rings when a topic speaks.
#[derive(Debug)]
pub struct Wakeup {
    listener: Listener<ipc::Service>,
}

impl Wakeup {
    /// Level-triggered: silence it before looking at the data, or waiting never waits again.
    pub(crate) fn drain(&self) -> Result<(), BusError> {
        self.listener
            .try_wait(|_| {})
            .map(drop)
            .map_err(refused("listen to", "a topic"))
    }
}

impl AsFd for Wakeup {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor belongs to the listener that `self` owns and stays open until it is
        // dropped; the borrow ends before that, and nobody closes it.
        unsafe { BorrowedFd::borrow_raw(self.listener.file_descriptor().native_handle()) }
    }
}
