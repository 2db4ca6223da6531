//! `firsthand page`: the robot in a browser.

use std::{net::SocketAddr, path::PathBuf, process::ExitCode, sync::Arc};

use clap::Parser;
use common::{
    domain::RobotName,
    samples::TargetPoint,
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
};
use glam::DVec2;
use mission_control::operator;
use page::live::{Options, Page, PageError, orders};
use rustix::process::Signal;

use console::{executable, failure::Failure, output::print_text, stream::let_stages_go_first};

/// Show a robot in a browser: map, field, charts, stages, events; orders for whoever has the token to drive.
///
/// It prints two addresses. The part behind # is a token: keep it to those who may drive.
#[derive(Debug, Parser)]
#[command(name = "firsthand-page", version)]
pub struct Arguments {
    /// Name of the robot; it need not run yet.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Where to listen. Other addresses than those of this machine need --tls-cert and --tls-key.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// A further name by which browsers know this machine.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// The certificate chain, PEM.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The key of the certificate, PEM.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

/// The main function of the executable.
pub fn main() -> ExitCode {
    executable::run("error", serve, |error| match error.downcast_ref()? {
        PageError::NotLoopback(_) => Some("not-loopback"),
        PageError::Listen { .. } => Some("cannot-listen"),
        PageError::Tls { .. } => Some("tls"),
        PageError::NoName(_) => Some("no-name"),
        PageError::System(_) => None,
    })
}

fn serve(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let_stages_go_first();
    let mut signals = Signals::catch(&[SIGINT, SIGTERM, SIGHUP])?;
    let options = Options {
        robot: arguments.robot.clone(),
        listen: arguments.listen,
        hosts: arguments.host.clone(),
        tls: arguments.tls_cert.clone().zip(arguments.tls_key.clone()),
    };
    let page = Page::open(&options, Arc::new(Operator { robot: arguments.robot.clone() }))?;
    let url = page.access.url();
    let (watch, drive) = (page.access.watch.reveal(), page.access.drive.reveal());
    print_text(&format!("watch {url}#{watch}\ndrive {url}#{drive}\n"))?;
    page.show(&mut || signals.came());
    Ok(ExitCode::SUCCESS)
}

/// The subcommands of an operator, for the page.
struct Operator {
    robot: RobotName,
}

/// The confirmation, or the reason why the request was not carried out.
fn told(done: Result<(), impl ToString>, confirmed: &str) -> Result<String, String> {
    done.map(|()| confirmed.to_owned()).map_err(|error| error.to_string())
}

impl orders::Operator for Operator {
    fn stop(&self) -> Result<String, String> {
        match operator::stand(&self.robot) {
            Ok(None) => Ok("the robot rests".to_owned()),
            Ok(Some(why)) => Ok(format!("the robot rests; its supervisor was not told: {why}")),
            Err(error) => Err(error.to_string()),
        }
    }

    fn resume(&self) -> Result<String, String> {
        told(operator::resume(&self.robot), "the supervisor lets the robot go on")
    }

    fn restart(&self, stage: &str) -> Result<String, String> {
        let stage = console::operator::known(stage).map_err(|error| error.to_string())?;
        let done = operator::restart(&self.robot, stage);
        told(done, "the supervisor starts a new generation")
    }

    fn kill(&self, stage: &str) -> Result<String, String> {
        let done = console::operator::known(stage)
            .and_then(|stage| console::operator::send(&self.robot, stage, Signal::KILL));
        told(done, "the process is killed")
    }

    fn go_to(&self, targets: &[[f64; 2]]) -> Result<String, String> {
        let points: Vec<_> =
            targets.iter().map(|&place| TargetPoint::at(DVec2::from(place))).collect();
        let done = operator::send_to(&self.robot, &points, false);
        told(done, "the supervisor sends the robot there")
    }

    fn go_back(&self) -> Result<String, String> {
        // The start is the origin of the mission frame.
        self.go_to(&[[0.0; 2]])
    }
}
