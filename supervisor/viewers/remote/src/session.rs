//! Zenoh sessions with certificates. Clients may only read, and what other sessions put is ignored.

use std::path::{Path, PathBuf};

use clap::Args;
use common::grid::MAX_CELLS;
use console::{
    failure::{Failure, Result, refuse},
    output::say,
};
use serde_json::{Value, json};
use zenoh::{Session, Wait};

const PORT: u16 = 7447;
/// Silence after which a link is lost and reconnected.
const LEASE_MS: u64 = 2000;
/// Longest message: a map of the most cells.
const LONGEST: usize = (MAX_CELLS as usize).pow(2) + (1 << 16);

#[derive(Debug, Args)]
pub struct Certificates {
    /// Certificate of this machine, a PEM file.
    #[arg(long, requires = "key")]
    cert: Option<PathBuf>,
    /// Private key of the certificate.
    #[arg(long, requires = "cert")]
    key: Option<PathBuf>,
}

/// Listens at `endpoints`. With `clients`, readers need a certificate of that authority, and one of
/// `names` if there are any.
pub fn listen(
    endpoints: &[String],
    own: &Certificates,
    clients: Option<&Path>,
    names: &[String],
) -> Result<Session> {
    let endpoints: Vec<_> = endpoints.iter().map(|at| endpoint(at, own.cert.is_some())).collect();
    let secured = endpoints.iter().all(|at| at.starts_with("tls/"));
    if !secured && clients.is_some() {
        return refuse(
            "no-tls",
            "--clients checks certificates, and tcp has none; give each --listen as tls/ADDRESS:PORT",
        );
    }
    if !secured {
        say(
            "over tcp every machine that reaches the port can read the robot; to restrict readers, use tls with --clients",
        );
    }
    let mut reader = json!({ "id": "readers" });
    if !names.is_empty() {
        reader["cert_common_names"] = json!(names);
    }
    let rule = |id, flow, messages: &[&str]| json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": ["firsthand/**"] });
    open(&json!({
        "mode": "peer",
        "listen": { "endpoints": endpoints, "exit_on_failure": true, "timeout_ms": 0 },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "access_control": {
            "enabled": true,
            "default_permission": "deny",
            "rules": [
                rule("ask", "ingress", &["declare_subscriber", "query"]),
                rule("tell", "egress", &["put", "reply", "declare_queryable"]),
            ],
            "subjects": [reader],
            "policies": [{ "rules": ["ask", "tell"], "subjects": ["readers"] }],
        },
        "transport": transport(&json!({
            "root_ca_certificate": clients,
            "enable_mtls": clients.is_some(),
            "listen_certificate": own.cert,
            "listen_private_key": own.key,
            "close_link_on_expiration": true,
        })),
    }))
}

#[derive(Debug, Args)]
pub struct Connecting {
    /// Authority of the robot's certificate, a PEM file.
    ///
    /// Without it the connection is tcp, and the robot's identity is unknown.
    #[arg(long)]
    ca: Option<PathBuf>,
    #[command(flatten)]
    own: Certificates,
}

impl Connecting {
    pub fn endpoint(&self, at: &str) -> String {
        endpoint(at, self.ca.is_some())
    }

    /// Connects to `at`, and reconnects after a lost link.
    pub fn connect(&self, at: &str) -> Result<Session> {
        let Self { ca, own } = self;
        open(&json!({
            "mode": "peer",
            "connect": { "endpoints": [self.endpoint(at)], "exit_on_failure": false, "timeout_ms": -1,
                "retry": { "period_init_ms": 500, "period_max_ms": 2000, "period_increase_factor": 2 } },
            "listen": { "endpoints": [] },
            "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
            "transport": transport(&json!({
                "root_ca_certificate": ca,
                "enable_mtls": own.cert.is_some(),
                "connect_certificate": own.cert,
                "connect_private_key": own.key,
            })),
        }))
    }
}

fn transport(tls: &Value) -> Value {
    json!({
        "unicast": { "max_sessions": 64, "compression": { "enabled": true } },
        "link": { "tx": { "lease": LEASE_MS }, "rx": { "max_message_size": LONGEST }, "tls": tls },
        "shared_memory": { "enabled": false },
    })
}

fn open(config: &Value) -> Result<Session> {
    let config = zenoh::Config::from_json5(&config.to_string()).map_err(failed)?;
    zenoh::open(config).wait().map_err(failed)
}

pub fn failed(error: zenoh::Error) -> Failure {
    error
}

/// Completes `at` to zenoh's `tls/HOST:PORT` or `tcp/HOST:PORT`.
pub fn endpoint(at: &str, secured: bool) -> String {
    let (protocol, address) =
        at.split_once('/').unwrap_or((if secured { "tls" } else { "tcp" }, at));
    let has_port = address.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    if has_port { format!("{protocol}/{address}") } else { format!("{protocol}/{address}:{PORT}") }
}
