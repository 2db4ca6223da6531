//! Threads and errors of the served page.

use std::{
    fs,
    io::{self, Write as _},
    net::TcpListener,
    os::unix::fs::OpenOptionsExt as _,
    path::PathBuf,
    sync::Arc,
    thread,
    time::Duration,
};

use common::{domain::Domain, file::FileError};
use console::failure::{Refused, Result, refuse};
use processes::domain::make_own_directory;
use thiserror::Error;

use crate::{
    Arguments, access::Access, context::Context, orders::Operator, places::Places, server,
    shared::Shared,
};

const MOST_SESSIONS: usize = 16;

#[derive(Debug, Error)]
enum PageError {
    #[error("cannot write the page's addresses, which browsers need: {0}")]
    Keep(#[from] FileError),
    #[error("cannot start the page: {0}")]
    System(#[from] io::Error),
}

#[derive(Debug)]
pub struct Page {
    pub access: Arc<Access>,
    /// File with the addresses, removed with the page.
    pub kept: PathBuf,
    pub shared: Arc<Shared>,
    server: Option<(tokio::sync::oneshot::Sender<()>, thread::JoinHandle<()>)>,
}

impl Page {
    /// Listens and starts to serve.
    ///
    /// # Errors
    /// The address is not loopback, or is taken.
    pub fn open(arguments: &Arguments, operator: Operator) -> Result<Self> {
        let address = arguments.listen;
        if !address.ip().is_loopback() {
            return refuse(
                "not-loopback",
                format!(
                    "{address} is not a loopback address, and the page does not encrypt; listen on 127.0.0.1 and use a tunnel, or a proxy with --behind-proxy"
                ),
            );
        }
        let listener = TcpListener::bind(address).map_err(|problem| {
            let message =
                format!("cannot listen on {address}: {problem}; choose another port with --listen");
            Refused::new("cannot-listen", message)
        })?;
        Ok(Self::serve(arguments, listener, operator)?)
    }

    fn serve(
        arguments: &Arguments,
        listener: TcpListener,
        operator: Operator,
    ) -> Result<Self, PageError> {
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let access = Arc::new(Access::new(address, arguments.behind_proxy.as_deref())?);
        let kept = keep(&arguments.robot.domain(), address.port(), &access.addresses())?;
        let shared = Arc::new(Shared::default());
        let context = Arc::new(Context {
            access: access.clone(),
            shared: shared.clone(),
            operator,
            watching: Places::new(MOST_SESSIONS),
            driving: Places::new(MOST_SESSIONS),
        });
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
        Ok(Self { access, kept, shared, server: Some((end, thread)) })
    }
}

/// Stores the page's addresses in a file for its owner. The dot separates its name from robot
/// names.
fn keep(domain: &Domain, port: u16, addresses: &str) -> Result<PathBuf, FileError> {
    let directory = domain.directory().parent().unwrap_or(domain.directory());
    let file = directory.join(format!("{}.page-{port}", domain.robot));
    make_own_directory(directory)
        .map_err(io::Error::other)
        .and_then(|()| {
            // A killed page leaves its file.
            let _ = fs::remove_file(&file);
            fs::OpenOptions::new()
                .write(true)
                .create_new(true)
                .mode(0o600)
                .open(&file)?
                .write_all(addresses.as_bytes())
        })
        .map_err(FileError::of("keep", &file))
        .map(|()| file)
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.kept);
        if let Some((end, thread)) = self.server.take() {
            drop(end);
            let _ = thread.join();
        }
    }
}
