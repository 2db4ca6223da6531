//! Read-only websocket server with a recording's channels for Foxglove and Lichtblick.
//!
//! Each client has its own queue, which drops messages on overflow, so a slow client delays no
//! other.

use std::{
    collections::HashMap,
    io,
    net::{SocketAddr, TcpListener},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use common::{
    bus::{AnyReader, Bus, BusError, Logged},
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    mission::Mission,
    topics::{self, AnyTopic},
};
use console::failure::Refused;
use foxglove::{
    ChannelBuilder, Context, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use recording::{
    log_files::LogFiles,
    now_ns, schema,
    viewers::{self, Channel, Drawn},
};
use robot_state::newest_run;

use crate::gate;

const LOOK_EVERY: Duration = Duration::from_millis(50);
const LOGS_EVERY: Duration = Duration::from_millis(500);
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// Most queued messages of a client: those of some ticks.
const MOST_WAITING: usize = 512;

#[derive(Debug)]
pub struct Live {
    context: Arc<Context>,
    server: WebSocketServerHandle,
}

type Readers = Vec<(&'static str, Box<dyn AnyReader>)>;

/// Returns the topics that are recorded by default.
fn served() -> impl Iterator<Item = &'static dyn AnyTopic> {
    topics::TABLE.iter().copied().filter(|topic| matches!(topic.spec().logged, Logged::Yes))
}

struct Serving {
    channels: HashMap<String, Arc<RawChannel>>,
    drawn: Drawn,
    logs: LogFiles,
    logs_read: Instant,
}

impl Live {
    /// Returns the actual address.
    pub fn open(
        robot: &RobotName,
        address: SocketAddr,
        origins: &[String],
    ) -> Result<(Self, SocketAddr), Refused> {
        let failed = |problem: io::Error| {
            let message =
                format!("cannot listen on {address}: {problem}; choose another port with --listen");
            Refused::new("cannot-listen", message)
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let listens = listener.local_addr().map_err(failed)?;
        let hidden = gate::hidden_address().map_err(failed)?;
        let context = Context::new();
        let server = WebSocketServer::new()
            .name(robot.to_string())
            .bind(hidden.to_string(), 0)
            .context(&context)
            .message_backlog_size(MOST_WAITING)
            .start_blocking()
            .map_err(|source| failed(io::Error::other(source)))?;
        gate::open(listener, SocketAddr::from((hidden, server.port())), origins.to_vec());
        Ok((Self { context, server }, listens))
    }

    pub fn serve(&self, domain: &Domain, ended: &mut dyn FnMut() -> bool) {
        let open = |bus: &Bus| -> Result<Readers, BusError> {
            served().map(|topic| Ok((topic.spec().name, topic.recorder_reader(bus)?))).collect()
        };
        let mut follower = Follower::new(domain.clone(), "foxglove", &topics::LINK, open);
        let mut serving = None;
        while !ended() {
            let taken = follower.wait(LOOK_EVERY).and_then(|event| match event {
                Event::Connected => {
                    serving = None;
                    Ok(())
                }
                Event::Samples(readers) => {
                    serving = serving.take().or_else(|| self.begin(domain));
                    serving.as_mut().map_or(Ok(()), |serving| serving.take_samples(readers))
                }
                Event::Disconnected | Event::Nothing => Ok(()),
            });
            if let Some(serving) = &mut serving {
                serving.take_logs();
            }
            if let Err(error) = taken {
                tracing::error!(%error, "the robot cannot be shown; the viewer tries again");
                thread::park_timeout(AGAIN_AFTER);
            }
        }
    }

    fn begin(&self, domain: &Domain) -> Option<Serving> {
        let (directory, run) = newest_run(domain)?;
        // Viewers forget the previous run.
        self.server.clear_session(None);
        Some(Serving {
            channels: self.channels(&run.mission),
            drawn: Drawn::new(Some(run.mission)),
            logs: LogFiles::follow(&directory, true),
            logs_read: Instant::now(),
        })
    }

    fn channels(&self, mission: &Mission) -> HashMap<String, Arc<RawChannel>> {
        let topics = served().map(|topic| {
            let schema::Schema { name, text } = schema::of(topic);
            (topic.spec().name.to_owned(), Schema::new(name, "ros2msg", text.into_bytes()), "cdr")
        });
        let drawn = viewers::channels(Some(mission)).into_iter();
        let drawn = drawn.map(|Channel { topic, schema, descriptors }| {
            (topic, Schema::new(schema, "protobuf", descriptors), "protobuf")
        });
        topics
            .chain(drawn)
            .filter_map(|(topic, schema, encoding)| {
                let channel = ChannelBuilder::new(&topic).context(&self.context).schema(schema);
                Some((topic, channel.message_encoding(encoding).build_raw().ok()?))
            })
            .collect()
    }
}

impl Serving {
    fn take_samples(&mut self, readers: &mut Readers) -> Result<(), BusError> {
        let Self { channels, drawn, .. } = self;
        let mut send = |topic: &str, message: &[u8]| {
            if let Some(channel) = channels.get(topic) {
                channel.log(message);
            }
        };
        let mut message = Vec::new();
        for (topic, reader) in readers {
            while reader.next_message(&mut message)?.is_some() {
                send(topic, &message);
                drawn.message(topic, &message, now_ns(), &mut send);
            }
        }
        Ok(())
    }

    fn take_logs(&mut self) {
        if self.logs_read.elapsed() < LOGS_EVERY {
            return;
        }
        self.logs_read = Instant::now();
        if let Some(channel) = self.channels.get(viewers::LOG) {
            for (process, line) in self.logs.take() {
                channel.log(&viewers::log(&process, &line, now_ns()));
            }
        }
    }
}
