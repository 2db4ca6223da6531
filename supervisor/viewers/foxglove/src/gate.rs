//! Gate before the server, which refuses foreign web pages.
//!
//! Browsers open websockets to any address for any page, and send the page's origin, which the
//! SDK's server ignores. So that server listens on an unguessable loopback address, and the gate
//! forwards admitted clients.

use std::{
    fs::File,
    io::{self, Read as _, Write as _},
    net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::Arc,
    thread,
    time::Duration,
};

/// Origin of Foxglove's own page. Most other programs send none.
pub const FOXGLOVE: &str = "https://app.foxglove.dev";
/// Most clients; further ones are closed at once.
const MOST_CLIENTS: usize = 32;
const SAID_WITHIN: Duration = Duration::from_secs(3);
const MOST_REQUEST_BYTES: usize = 4 << 10;

/// Returns one of 16 million loopback addresses.
pub fn hidden_address() -> io::Result<Ipv4Addr> {
    let mut bytes = [0; 3];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    let [one, two, three] = bytes;
    // The last byte excludes network and broadcast addresses.
    Ok(Ipv4Addr::new(127, one, two, three.clamp(1, 254)))
}

/// Forwards clients of `listener` to `server` until this process ends. Web pages need one of these
/// origins.
pub fn open(listener: TcpListener, server: SocketAddr, origins: Vec<String>) {
    let origins = Arc::new(origins);
    thread::spawn(move || {
        for client in listener.incoming() {
            let origins = origins.clone();
            // Each client holds a reference.
            if let Ok(client) = client
                && Arc::strong_count(&origins) <= MOST_CLIENTS
            {
                let _ = thread::Builder::new().spawn(move || drop(pass(&client, server, &origins)));
            }
        }
    });
}

fn pass(mut client: &TcpStream, server: SocketAddr, origins: &[String]) -> io::Result<()> {
    client.set_read_timeout(Some(SAID_WITHIN))?;
    let (mut head, mut byte) = (Vec::new(), [0]);
    while !head.ends_with(b"\r\n\r\n") {
        if head.len() >= MOST_REQUEST_BYTES {
            return Ok(());
        }
        client.read_exact(&mut byte)?;
        head.extend(byte);
    }
    client.set_read_timeout(None)?;
    let text = String::from_utf8_lossy(&head);
    let mut said = text
        .lines()
        .filter_map(|line| line.split_once(':'))
        .filter(|(name, _)| name.trim().eq_ignore_ascii_case("origin"));
    if said.any(|(_, origin)| !origins.iter().any(|known| known == origin.trim())) {
        return client.write_all(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\n\r\n");
    }
    let mut server = TcpStream::connect(server)?;
    server.write_all(&head)?;
    thread::scope(|both| {
        let server = &server;
        let copy = |mut from: &TcpStream, mut to: &TcpStream| {
            let _ = io::copy(&mut from, &mut to);
            let _ = from.shutdown(Shutdown::Both);
            let _ = to.shutdown(Shutdown::Both);
        };
        both.spawn(move || copy(client, server));
        copy(server, client);
    });
    Ok(())
}
