//! Creating and joining a bus, and cleaning up after killed processes.

use std::{
    any::Any,
    cell::Cell,
    ffi::OsStr,
    fmt::Debug,
    fs::{DirBuilder, File},
    io,
    os::unix::{ffi::OsStrExt as _, fs::DirBuilderExt as _},
    path::{Path, PathBuf},
    rc::Rc,
    time::SystemTime,
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
    any::AnyTopic,
    authors::Writers,
    error::{BusError, Result},
    leftovers, ownership,
    ports::{self, BusNode, Medium, Memory},
    spec::Limits,
};
use crate::{
    bus_instance::BusInstance,
    domain::{Domain, SHARED_MEMORY},
};

#[derive(Debug)]
pub struct Bus {
    pub(super) medium: Medium,
    /// Processes whose samples are read; `None` without named authors.
    pub(super) writers: Option<Writers>,
    pub(super) is_stage: bool,
    pub(super) lost: Rc<Cell<u64>>,
}

/// Services of all topics, which exist while this value is held.
pub struct Services(#[allow(dead_code, reason = "held, not read")] Vec<Box<dyn Any>>);

fn no_join<D: ToString>(domain: &Domain) -> impl Fn(D) -> BusError + use<D> {
    let robot = domain.robot.to_string();
    move |detail| BusError::Join { robot: robot.clone(), detail: detail.to_string() }
}

fn not_running(domain: &Domain) -> impl Fn(io::Error) -> BusError {
    |error| BusError::NotRunning {
        robot: domain.robot.to_string(),
        detail: format!("{}: {error}", domain.middleware_config().display()),
    }
}

impl Bus {
    /// Creates a robot's bus: its configuration, which consumers in all languages load, and the
    /// services of all topics in `table`.
    /// It replaces an earlier bus, and can be joined only once all services exist.
    pub fn make(domain: &Domain, name: &str, table: &[&dyn AnyTopic]) -> Result<(Self, Services)> {
        let failed = no_join(domain);
        let instance = BusInstance::new(domain);
        // An existing directory is an error, because another user may have created it.
        DirBuilder::new().mode(0o700).create(instance.root()).map_err(&failed)?;
        Self::write_config(&instance)?;
        ownership::create_count_of_nodes(&instance).map_err(&failed)?;
        let mut bus = Self::join_instance(instance, name)?;
        bus.writers = Some(Writers::of(std::process::id()));
        bus.is_stage = true;
        let mut services = Vec::new();
        if let Medium::Shared { node, instance } = &bus.medium {
            for topic in table {
                services.push(ports::create(node, topic.spec(), &topic.carried())?);
            }
            leftovers::back_up(&services_of(node), &backup_of(node)).map_err(&failed)?;
            instance.make_current().map_err(failed)?;
        }
        Ok((bus, Services(services)))
    }

    /// Returns the bus of a process on a simulated machine. With a `supervisor`, it reads only the
    /// samples of processes that it names.
    pub fn in_memory(memory: Rc<Memory>, supervisor: Option<u32>) -> Self {
        Self {
            medium: Medium::Memory(memory),
            writers: supervisor.map(Writers::of),
            is_stage: true,
            lost: Rc::default(),
        }
    }

    pub fn restore_config(&self) -> Result {
        let Medium::Shared { instance, .. } = &self.medium else { return Ok(()) };
        Self::write_config(instance)?;
        instance.make_current().map_err(no_join(&instance.domain))
    }

    fn write_config(instance: &BusInstance) -> Result {
        let failed = no_join(&instance.domain);
        let mut config = Config::default();
        let root = instance.root();
        let prefix = instance.shared_memory_prefix();
        let path = SemanticString::new(root.as_os_str().as_encoded_bytes())
            .map_err(|error| failed(format!("{error:?} in {root:?}")))?;
        config.global.set_root_path(&path);
        config.global.prefix = SemanticString::new(prefix.as_bytes())
            .map_err(|error| failed(format!("{error:?} in {prefix:?}")))?;
        // The supervisor cleans up after killed processes, so that starting stages need not wait.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        // At most this many writers end at once. The default would reserve 400 kB of connection
        // memory per topic.
        config.defaults.publish_subscribe.subscriber_expired_connection_buffer = Limits::WRITERS;
        let text = toml::to_string(&config).map_err(|error| failed(error.to_string()))?;
        let file = instance.config();
        std::fs::write(&file, BusInstance::config_text(&text))
            .map_err(|error| failed(format!("{}: {error}", file.display())))
    }

    /// Joins a robot's bus under a name for `iox2 node list`, and reads the newest generation of
    /// any author.
    ///
    /// Fails if the robot does not run here or belongs to another user, or if shared memory is
    /// full.
    pub fn join(domain: &Domain, name: &str) -> Result<Self> {
        let _joining = domain.joining().map_err(not_running(domain))?;
        let instance = BusInstance::current(domain).map_err(not_running(domain))?;
        Self::join_instance(instance, name)
    }

    /// Joins as a consumer, like [`Bus::join`]. With a supervisor, it reads only its samples and
    /// those of processes that it names.
    pub fn join_as_consumer(domain: &Domain, name: &str) -> Result<Self> {
        let supervisor = domain.supervisor().ok().flatten();
        Ok(Self { writers: supervisor.map(Writers::of), ..Self::join(domain, name)? })
    }

    /// Joins as a stage of the process `supervisor`, like [`Bus::join`]. It ignores unnamed
    /// processes and may take the places that consumers leave free.
    pub fn join_as_stage(domain: &Domain, name: &str, supervisor: u32) -> Result<Self> {
        Ok(Self {
            writers: Some(Writers::of(supervisor)),
            is_stage: true,
            ..Self::join(domain, name)?
        })
    }

    fn join_instance(instance: BusInstance, name: &str) -> Result<Self> {
        // This crate's errors include the middleware's; IOX2_LOG_LEVEL restores its messages.
        set_log_level_from_env_or(LogLevel::Fatal);
        let join = no_join(&instance.domain);
        let refused = |error: &dyn Debug| join(format!("{error:?}"));
        ownership::check(&instance).map_err(no_join(&instance.domain))?;
        if let Some(runs) = instance.made_by_another().map_err(no_join(&instance.domain))? {
            return Err(BusError::OtherVersion { robot: instance.domain.robot.to_string(), runs });
        }
        let file = instance.config();
        let path = SemanticString::new(file.as_os_str().as_encoded_bytes())
            .map_err(|error| join(format!("{error:?} in {file:?}")))?;
        // The middleware falls back to this configuration, which stays that of the first bus that
        // the process joins.
        Config::setup_global_config_from_file(&path).map_err(|error| refused(&error))?;
        let config = Config::from_file(&path).map_err(|error| refused(&error))?;
        let name = NodeName::new(name).map_err(|error| refused(&error))?;
        let node = NodeBuilder::new()
            .config(&config)
            .name(&name)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| refused(&error))?;
        let medium = Medium::Shared { node: node.into(), instance };
        Ok(Self { medium, writers: None, is_stage: false, lost: Rc::default() })
    }

    /// Returns the processes whose samples are read; `None` means the newest generation of any
    /// author.
    pub const fn writers(&self) -> Option<&Writers> {
        self.writers.as_ref()
    }

    /// Samples of this process lost to full shared memory.
    pub fn lost(&self) -> u64 {
        self.lost.get()
    }

    /// Returns whether another bus replaced this one or the run has ended.
    pub fn is_replaced(&self) -> bool {
        let Medium::Shared { instance, .. } = &self.medium else { return false };
        BusInstance::current(&instance.domain).map_or(true, |now| now != *instance)
    }

    /// Prevents removal of the bus while a consumer opens a topic, which would recreate and leave
    /// the bus's directory.
    pub(super) fn hold(&self) -> Result<Option<File>> {
        let domain = match &self.medium {
            Medium::Shared { instance, .. } if !self.is_stage => &instance.domain,
            _ => return Ok(None),
        };
        let held = domain.joining().map_err(not_running(domain))?;
        if self.is_replaced() {
            Err(not_running(domain)(io::ErrorKind::NotFound.into()))
        } else {
            Ok(Some(held))
        }
    }

    /// Prepares the bus for a successor of `process`, which must have ended. Only the supervisor
    /// calls this.
    ///
    /// Removes unfilled shared memory of `process`, for which the successor could wait forever, and
    /// restores missing service files. Returns whether unfilled memory of others is left.
    pub fn remove_unfinished(&self, process: u32) -> io::Result<bool> {
        let Medium::Shared { node, .. } = &self.medium else { return Ok(false) };
        leftovers::restore(&backup_of(node), &services_of(node))?;
        remove_unfilled(node, process)
    }

    /// Returns the time at which a process last joined or left, or a service file came or went.
    pub fn changed(&self) -> Option<SystemTime> {
        let Medium::Shared { node, .. } = &self.medium else { return None };
        let changed = |directory: &Path| directory.metadata().ok()?.modified().ok();
        changed(&nodes_of(node)).max(changed(&services_of(node)))
    }

    /// Asks for a cleanup: the nodes' directory changes, which the supervisor watches.
    pub(crate) fn ask_to_clear_up(&self) -> io::Result<()> {
        let Medium::Shared { node, .. } = &self.medium else { return Ok(()) };
        File::open(nodes_of(node))?.set_modified(SystemTime::now())
    }

    /// Cleans up after ended processes, at a few milliseconds each. Only the supervisor calls this.
    ///
    /// Frees their places and memory, removes files of incomplete starts of `killed` (which must
    /// have ended), and restores missing service files. If it returns false, call it again later
    /// with the same processes.
    pub fn clear_up(&self, killed: &[u32]) -> io::Result<bool> {
        let Medium::Shared { node, .. } = &self.medium else { return Ok(true) };
        leftovers::restore(&backup_of(node), &services_of(node))?;
        let config = node.config();
        let nodes = nodes_of(node);
        let mut outcome = Ok(());
        let mut all = true;
        let listed = Node::<ipc::Service>::list(config, |listed| {
            if let NodeState::Dead(dead) = listed {
                match remove_unfilled(node, leftovers::process_of(dead.id().value())) {
                    // The next call lists it again.
                    Ok(false) => drop(dead.try_remove_stale_resources()),
                    // The middleware could wait forever for the unfilled memory, which the next
                    // call finds old enough to remove.
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
        // The middleware finds the places of ended processes by these files, so they are removed
        // last.
        if all {
            killed.iter().try_for_each(|&process| {
                remove_unfilled(node, process)?;
                leftovers::remove_nodes(&nodes, process)
            })?;
        }
        Ok(all)
    }
}

fn nodes_of(node: &BusNode) -> PathBuf {
    PathBuf::from(OsStr::from_bytes(node.config().global.node_dir().as_bytes()))
}

fn services_of(node: &BusNode) -> PathBuf {
    PathBuf::from(OsStr::from_bytes(node.config().global.service_dir().as_bytes()))
}

fn backup_of(node: &BusNode) -> PathBuf {
    services_of(node).with_extension("backup")
}

fn remove_unfilled(node: &BusNode, process: u32) -> io::Result<bool> {
    let prefix = String::from_utf8_lossy(node.config().global.prefix.as_bytes());
    leftovers::remove_unfilled(Path::new(SHARED_MEMORY), &prefix, process)
}
