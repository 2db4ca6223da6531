//! Network interfaces for rustdds, in place of the crate `netdev`.
//!
//! rustdds 0.15.1 fragments messages larger than the MTU of the interface to its reader. A fragment
//! that names its request gets one byte too many (`DataFrag::write_to` writes an `Option`, not its
//! content). Clients cannot read it, and a build with assertions loses its DDS thread.
//!
//! Each interface here therefore reports the largest datagram, which IP fragments. Remove this
//! crate once rustdds is fixed.

use std::net::{Ipv4Addr, Ipv6Addr};

use nix::{
    ifaddrs::getifaddrs,
    net::if_::{InterfaceFlags, if_nametoindex},
    sys::socket::SockaddrStorage,
};

/// Most bytes of an IP packet.
const LARGEST: u32 = 65_535;

pub struct Net<A> {
    addr: A,
    netmask: A,
}

impl<A: Copy> Net<A> {
    pub const fn addr(&self) -> A {
        self.addr
    }

    pub const fn netmask(&self) -> A {
        self.netmask
    }
}

/// Interface with one of its addresses, or without a known one.
pub struct Interface {
    pub index: u32,
    pub mtu: Option<u32>,
    pub ipv4: Option<Net<Ipv4Addr>>,
    pub ipv6: Option<Net<Ipv6Addr>>,
    flags: InterfaceFlags,
}

impl Interface {
    pub const fn is_loopback(&self) -> bool {
        self.flags.contains(InterfaceFlags::IFF_LOOPBACK)
    }

    pub const fn is_multicast(&self) -> bool {
        self.flags.contains(InterfaceFlags::IFF_MULTICAST)
    }
}

pub fn get_interfaces() -> Vec<Interface> {
    let ipv4 = |at: SockaddrStorage| at.as_sockaddr_in().map(|at| at.ip());
    let ipv6 = |at: SockaddrStorage| at.as_sockaddr_in6().map(|at| at.ip());
    let addresses = getifaddrs().into_iter().flatten();
    let interfaces = addresses.map(|it| Interface {
        index: if_nametoindex(it.interface_name.as_str()).unwrap_or_default(),
        mtu: Some(LARGEST),
        ipv4: it.address.and_then(ipv4).zip(it.netmask.and_then(ipv4)).map(Net::from),
        ipv6: it.address.and_then(ipv6).zip(it.netmask.and_then(ipv6)).map(Net::from),
        flags: it.flags,
    });
    interfaces.collect()
}

impl<A> From<(A, A)> for Net<A> {
    fn from((addr, netmask): (A, A)) -> Self {
        Self { addr, netmask }
    }
}
