//! BusInstance and joining a bus, and removing what killed processes leave on it.

use std::{
    any::Any,
    ffi::OsStr,
    fs::DirBuilder,
    io,
    os::unix::{ffi::OsStrExt as _, fs::DirBuilderExt as _},
    path::{Path, PathBuf},
};

use iceoryx2::{
    config::Config,
    node::{Node, NodeBuilder, NodeState, NodeView as _},
    prelude::{
        CallbackProgression, LogLevel, NodeName, SemanticString, SignalHandlingMode, ipc,
        set_log_level_from_env_or,
    },
};

use super::{
    error::BusError,
    leftovers, ownership,
    ports::{self, BusNode},
    topic::AnyTopic,
};
use crate::{
    bus_instance::BusInstance,
    domain::{Domain, SHARED_MEMORY},
};

/// A process's place on a robot's bus.
#[derive(Debug)]
pub struct Bus {
    pub(super) node: BusNode,
    /// The process that alone writes the supervisor's topics, of a stage; none of a consumer.
    pub(super) supervisor: Option<u32>,
    instance: BusInstance,
}

/// The services of every topic, existing as long as this is held.
pub struct Services(#[allow(dead_code, reason = "held, not read")] Vec<Box<dyn Any>>);

fn no_join(domain: &Domain) -> impl Fn(String) -> BusError + use<> {
    let robot = domain.robot.to_string();
    move |detail| BusError::Join { robot: robot.clone(), detail }
}

impl Bus {
    /// Make the bus of a robot: its configuration, which consumers in other languages load too, and the services of
    /// every topic of `table`. It takes the place of an earlier one; nobody can join it before all are there. Only the
    /// supervisor calls this.
    ///
    /// # Errors
    /// When a file cannot be written, or shared memory is full.
    pub fn make(
        domain: &Domain,
        name: &str,
        table: &[&dyn AnyTopic],
    ) -> Result<(Self, Services), BusError> {
        let failed = |error: io::Error| no_join(domain)(error.to_string());
        let instance = BusInstance::new(domain);
        // Not one that is there: another user may have made it.
        DirBuilder::new().mode(0o700).create(instance.root()).map_err(failed)?;
        Self::write_config(&instance)?;
        let mut bus = Self::join_instance(instance, name)?;
        bus.supervisor = Some(std::process::id());
        let services = table
            .iter()
            .map(|topic| ports::create(&bus.node, topic.spec(), &topic.carried()))
            .collect::<Result<_, _>>()?;
        leftovers::back_up(&bus.services(), &bus.backup()).map_err(failed)?;
        bus.instance.make_current().map_err(failed)?;
        Ok((bus, Services(services)))
    }

    fn write_config(instance: &BusInstance) -> Result<(), BusError> {
        let failed = no_join(instance.domain());
        let mut config = Config::default();
        let root = instance.root();
        let prefix = instance.shared_memory_prefix();
        let path = SemanticString::new(root.as_os_str().as_encoded_bytes())
            .map_err(|error| failed(format!("{error:?} in {root:?}")))?;
        config.global.set_root_path(&path);
        config.global.prefix = SemanticString::new(prefix.as_bytes())
            .map_err(|error| failed(format!("{error:?} in {prefix:?}")))?;
        // The supervisor cleans up after processes that were killed: a stage that starts does not wait for it.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let text = toml::to_string(&config).map_err(|error| failed(error.to_string()))?;
        let file = instance.config();
        std::fs::write(&file, text).map_err(|error| failed(format!("{}: {error}", file.display())))
    }

    /// Join the bus of a robot under a name that `iox2 node list` shows.
    ///
    /// # Errors
    /// When the robot does not run here, is another user's, or shared memory is full.
    pub fn join(domain: &Domain, name: &str) -> Result<Self, BusError> {
        let not_running = |error: io::Error| BusError::NotRunning {
            robot: domain.robot.to_string(),
            detail: format!("{}: {error}", domain.middleware_config().display()),
        };
        let _joining = domain.joining().map_err(not_running)?;
        let instance = BusInstance::current(domain).map_err(not_running)?;
        Self::join_instance(instance, name)
    }

    /// Join as a stage that process `supervisor` supervises: what others write on the supervisor's topics is ignored,
    /// and the places that consumers leave free may be taken.
    ///
    /// # Errors
    /// As [`Bus::join`].
    pub fn join_as_stage(domain: &Domain, name: &str, supervisor: u32) -> Result<Self, BusError> {
        Ok(Self { supervisor: Some(supervisor), ..Self::join(domain, name)? })
    }

    fn join_instance(instance: BusInstance, name: &str) -> Result<Self, BusError> {
        // We report what the middleware reports; IOX2_LOG_LEVEL brings its own messages back.
        set_log_level_from_env_or(LogLevel::Fatal);
        let join = no_join(instance.domain());
        let failed = |error: io::Error| join(error.to_string());
        ownership::check(&instance).map_err(failed)?;
        let file = instance.config();
        let path = SemanticString::new(file.as_os_str().as_encoded_bytes())
            .map_err(|error| join(format!("{error:?} in {file:?}")))?;
        // Where a node names none: what killed processes left is then looked for in the first bus.
        Config::setup_global_config_from_file(&path).map_err(|error| join(format!("{error:?}")))?;
        let config = Config::from_file(&path).map_err(|error| join(format!("{error:?}")))?;
        let name = NodeName::new(name).map_err(|error| join(format!("{error:?}")))?;
        let node = NodeBuilder::new()
            .config(&config)
            .name(&name)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| join(format!("{error:?}")))?;
        // One that is missing was made anew with the node.
        ownership::close_to_others(&instance).map_err(failed)?;
        Ok(Self { node: node.into(), supervisor: None, instance })
    }

    /// Whether nothing is published on it any more: another bus has taken its place, of this run or of the robot's next,
    /// or the robot's run has ended. A consumer drops everything it has of it, and joins again.
    #[must_use]
    pub fn is_replaced(&self) -> bool {
        BusInstance::current(self.instance.domain()).map_or(true, |now| now != self.instance)
    }

    /// Where the services' files are.
    fn services(&self) -> PathBuf {
        let services = self.node.config().global.service_dir();
        PathBuf::from(OsStr::from_bytes(services.as_bytes()))
    }

    /// Where each of them has a second name.
    fn backup(&self) -> PathBuf {
        self.services().with_extension("backup")
    }

    /// Before a successor of `process`, which must have ended, is started: remove the shared memory that `process` had
    /// not finished, for which the successor could wait for ever, and restore service files that are missing. Only the
    /// supervisor calls this. Returns whether unfinished shared memory of other processes is left.
    ///
    /// # Errors
    /// When files cannot be removed or restored.
    pub fn remove_unfinished(&self, process: u32) -> io::Result<bool> {
        leftovers::restore(&self.backup(), &self.services())?;
        self.remove_unfilled(process)
    }

    fn remove_unfilled(&self, process: u32) -> io::Result<bool> {
        let prefix = String::from_utf8_lossy(self.node.config().global.prefix.as_bytes());
        leftovers::remove_unfilled(Path::new(SHARED_MEMORY), &prefix, process)
    }

    /// Free what ended processes held: their places on the topics and their memory; and what the processes `killed`,
    /// which must have ended, left of a start that was cut off. Restore service files that are missing. Only the
    /// supervisor calls this; it takes a few milliseconds for each process. Returns whether all of it could be done:
    /// if not, try again later with the same processes.
    ///
    /// # Errors
    /// When files cannot be removed or restored.
    pub fn clear_up(&self, killed: &[u32]) -> io::Result<bool> {
        leftovers::restore(&self.backup(), &self.services())?;
        let config = self.node.config();
        let nodes = config.global.node_dir();
        let nodes = Path::new(OsStr::from_bytes(nodes.as_bytes()));
        let (mut outcome, mut all) = (Ok(()), true);
        let listed = Node::<ipc::Service>::list(config, |node| {
            if let NodeState::Dead(dead) = node {
                match self.remove_unfilled(leftovers::process_of(dead.id().value())) {
                    // One that cannot be freed now is listed again next time.
                    Ok(false) => drop(dead.try_remove_stale_resources()),
                    // The middleware would wait for it to be filled, perhaps for ever; next time it is old.
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
        // The places of ended processes are found by these files, so they go last.
        if all {
            killed.iter().try_for_each(|&process| {
                self.remove_unfilled(process)?;
                leftovers::remove_nodes(nodes, process)
            })?;
        }
        Ok(all)
    }
}
