//! A page that is served: its threads, its options, its errors.

use std::{
    io,
    net::{SocketAddr, TcpListener},
    sync::Arc,
    thread,
    time::Duration,
};

use common::domain::{Domain, RobotName};
use thiserror::Error;

use crate::{access::Access, context::Context, orders::Operator, robot, server, shared::Shared};

/// The options of a page.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub(crate) robot: RobotName,
    pub(crate) listen: SocketAddr,
    /// The name by which browsers know the proxy before the page; none without a proxy.
    pub(crate) proxy: Option<String>,
}

/// A page that cannot be served.
#[derive(Debug, Error)]
pub(crate) enum PageError {
    #[error(
        "{0} is no loopback address, and the page does not encrypt; listen on 127.0.0.1 and use a tunnel, or a proxy with --behind-proxy"
    )]
    NotLoopback(SocketAddr),
    #[error("cannot listen on {address}: {source}; choose another port with --listen")]
    Listen { address: SocketAddr, source: io::Error },
    #[error("cannot start the page: {0}")]
    System(#[from] io::Error),
}

/// A page that is served.
#[derive(Debug)]
pub(crate) struct Page {
    /// The address on which the page listens.
    #[cfg_attr(not(test), allow(dead_code, reason = "tests connect to it"))]
    pub(crate) address: SocketAddr,
    pub(crate) access: Arc<Access>,
    domain: Domain,
    pub(crate) shared: Arc<Shared>,
    server: Option<(tokio::sync::oneshot::Sender<()>, thread::JoinHandle<()>)>,
}

impl Page {
    /// Listen, and serve from now on.
    ///
    /// # Errors
    /// When the address is not one of this machine alone, or is taken.
    pub(crate) fn open(options: &Options, operator: Arc<dyn Operator>) -> Result<Self, PageError> {
        if !options.listen.ip().is_loopback() {
            return Err(PageError::NotLoopback(options.listen));
        }
        let listener = TcpListener::bind(options.listen)
            .map_err(|source| PageError::Listen { address: options.listen, source })?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let access = Arc::new(Access::new(address, options.proxy.as_deref())?);
        let shared = Arc::new(Shared::default());
        let context = Context { access: access.clone(), shared: shared.clone(), operator };
        let context = Arc::new(context);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(8)
            .build()?;
        let (end, ended) = tokio::sync::oneshot::channel();
        let thread = thread::Builder::new().name("page".to_owned()).spawn(move || {
            runtime.block_on(async {
                tokio::select! {
                    () = server::serve(context, listener) => {}
                    _ = ended => {}
                }
            });
            runtime.shutdown_timeout(Duration::from_secs(1));
        })?;
        Ok(Self {
            address,
            access,
            domain: Domain::of(options.robot.clone()),
            shared,
            server: Some((end, thread)),
        })
    }

    /// Show the robot, from run to run, until `ended` returns true.
    pub(crate) fn show(&self, ended: &mut dyn FnMut() -> bool) {
        robot::follow(&self.domain, &self.shared, ended);
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.server.take() {
            drop(end);
            let _ = thread.join();
        }
    }
}
