//! A supervisor's claim on its robot: an abstract socket. The kernel keeps it as long as the process runs, and it is no file that
//! a cleaner of temporary files could remove.

use std::{
    io,
    os::{
        linux::net::SocketAddrExt as _,
        unix::net::{SocketAddr, UnixListener, UnixStream},
    },
};

use rustix::{net::sockopt::socket_peercred, process::geteuid};

use crate::domain::Domain;

#[derive(Debug)]
pub struct Claim(UnixListener);

impl Claim {
    /// Fails with [`io::ErrorKind::AddrInUse`] while another process holds it.
    pub fn make(domain: &Domain) -> io::Result<Self> {
        let listener = UnixListener::bind_addr(&name(domain)?)?;
        listener.set_nonblocking(true)?;
        Ok(Self(listener))
    }

    /// Forget those who looked for the holder. The kernel has answered them, and keeps a limited number.
    pub fn forget_askers(&self) {
        while self.0.accept().is_ok() {}
    }
}

fn name(domain: &Domain) -> io::Result<SocketAddr> {
    SocketAddr::from_abstract_name(domain.claim_name())
}

/// The process that claims the robot. Any user may take any abstract name, so it must be this user's or root's, as the kernel says.
pub(crate) fn holder(domain: &Domain) -> io::Result<Option<u32>> {
    let socket = match UnixStream::connect_addr(&name(domain)?) {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => return Ok(None),
        connected => connected?,
    };
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
                assert_eq!(domain.supervisor().unwrap(), Some(own), "without any file");
            }
            claim.forget_askers();
        }
        assert!(domain.is_supervised());
        drop(claim);
        assert!(!domain.is_supervised());
    }
}
