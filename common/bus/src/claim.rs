//! Supervisor's claim on its robot: an abstract socket, kept by the kernel while the process runs,
//! and safe from cleaners of temporary files.

use std::{
    io,
    os::{
        linux::net::SocketAddrExt as _,
        unix::net::{SocketAddr, UnixListener},
    },
};

use rustix::{
    io::Errno,
    net::{
        AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with,
        sockopt::socket_peercred,
    },
    process::geteuid,
};

use crate::domain::Domain;

#[derive(Debug)]
pub struct Claim(UnixListener);

impl Claim {
    /// Fails with [`io::ErrorKind::AddrInUse`] while another process holds it.
    pub fn make(domain: &Domain) -> io::Result<Self> {
        let name = SocketAddr::from_abstract_name(domain.claim_name())?;
        let listener = UnixListener::bind_addr(&name)?;
        listener.set_nonblocking(true)?;
        Ok(Self(listener))
    }

    /// Drops the connections of processes that looked for the holder. The kernel has answered them,
    /// and its queue is limited.
    pub fn forget_askers(&self) {
        while self.0.accept().is_ok() {}
    }
}

/// Returns the process that claims the robot. Any user may take any abstract name, so its owner
/// must be this user or root.
///
/// Fails with [`io::ErrorKind::WouldBlock`] if the holder is frozen and the kernel's queue is full.
pub(crate) fn holder(domain: &Domain) -> io::Result<Option<u32>> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    match connect(&socket, &SocketAddrUnix::new_abstract_name(domain.claim_name().as_bytes())?) {
        Err(Errno::CONNREFUSED) => return Ok(None),
        connected => connected?,
    }
    let by = socket_peercred(&socket)?;
    let is_trusted = by.uid == geteuid() || by.uid.is_root();
    Ok(is_trusted.then(|| by.pid.as_raw_nonzero().get() as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_claimed_by_one_process_which_the_kernel_names_to_any_number_of_askers() {
        let domain = Domain::of(format!("claim-{}", std::process::id()).parse().unwrap());
        assert_eq!(domain.supervisor().unwrap(), None);
        let claim = Claim::make(&domain).unwrap();
        let refused = Claim::make(&domain).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::AddrInUse);
        for _ in 0..20 {
            for _ in 0..100 {
                let own = std::process::id();
                assert_eq!(domain.supervisor().unwrap(), Some(own));
            }
            claim.forget_askers();
        }
        let unanswered = (0..100_000).find_map(|_| domain.supervisor().err()).unwrap();
        assert_eq!(unanswered.kind(), io::ErrorKind::WouldBlock);
        assert!(domain.is_supervised());
        drop(claim);
        assert!(!domain.is_supervised());
    }
}
