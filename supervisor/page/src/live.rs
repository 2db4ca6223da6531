//! The live page: a consumer of one robot, and a small web server beside it.
//!
//! One thread reads the bus and fills the data that browsers are shown; a second one runs the server. A browser takes the new data
//! ten times a second, so a slow one delays nobody: it gets the newest maps, fields and states, and those rows and events that are
//! still stored.
//!
//! | module | holds |
//! |---|---|
//! | [`Options`] | where the page is served |
//! | [`access`] | who may: addresses, names, tokens |
//! | `context` | what every connection needs |
//! | `shared` | what browsers are shown |
//! | `robot` | the thread that reads the bus |
//! | `server` | connections, requests, checks |
//! | `session` | one browser: authentication, messages, orders |
//! | [`orders`] | what an operator may ask for |

pub mod access;
mod context;
mod options;
pub mod orders;
mod robot;
mod server;
mod session;
mod shared;
#[cfg(test)]
mod tests;

use std::{net::SocketAddr, sync::Arc, thread};

use common::domain::Domain;

pub use self::options::{Options, PageError};

use self::{access::Access, context::Context, orders::Operator, shared::Shared};

/// A page that is served.
#[derive(Debug)]
pub struct Page {
    /// The address on which the page listens.
    pub address: SocketAddr,
    pub access: Arc<Access>,
    domain: Domain,
    shared: Arc<Shared>,
    server: Option<(tokio::sync::oneshot::Sender<()>, thread::JoinHandle<()>)>,
}

impl Page {
    /// Listen, and serve from now on.
    pub fn open(options: &Options, operator: Arc<dyn Operator>) -> Result<Self, PageError> {
        let tls = server::tls(options)?;
        let listener = std::net::TcpListener::bind(options.listen)
            .map_err(|source| PageError::Listen { address: options.listen, source })?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let access = Arc::new(Access::new(address, &options.hosts, tls.is_some())?);
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
                    () = server::serve(context, listener, tls) => {}
                    _ = ended => {}
                }
            });
            runtime.shutdown_timeout(std::time::Duration::from_secs(1));
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
    pub fn show(&self, ended: &mut dyn FnMut() -> bool) {
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
