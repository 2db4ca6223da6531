//! Threads beside a measurement: between a simulated robot and its host, and consumers.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread::{self, JoinHandle},
};

/// A thread that works turn by turn until this is dropped.
pub struct Turns {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Turns {
    /// The thread gets its work from `begin`. Each turn waits for a short time at most, and may fail: a datagram that it cannot send, for
    /// example before the other end listens, is lost, as on a radio.
    pub fn start<E, Turn: FnMut() -> Result<(), E>>(
        begin: impl FnOnce() -> Turn + Send + 'static,
    ) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let is_over = ends.clone();
        let thread = thread::spawn(move || {
            let mut turn = begin();
            while !is_over.load(Relaxed) {
                let _ = turn();
            }
        });
        Self { ends, thread: Some(thread) }
    }
}

impl Drop for Turns {
    fn drop(&mut self) {
        self.ends.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A socket of this machine that does not block.
pub fn socket() -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

pub fn to_robot(robot: SocketAddr) -> io::Result<UdpSocket> {
    let socket = socket()?;
    socket.connect(robot)?;
    Ok(socket)
}
