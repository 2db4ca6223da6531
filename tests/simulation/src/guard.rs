//! The stop guard's process on a simulated machine: it orders an owed stop while no link lives.

use common::{run::Run, samples::Rest, stop_socket::OwedStop};
use link::{
    stop_guard::{Orders, TRIES_AGAIN},
    wire_owner::{Found, Role},
};

/// Time from the end of a link to its guard's first order, nanoseconds.
const STARTS_AFTER_NS: u64 = 30_000_000;

#[derive(Default)]
pub struct Guard {
    /// Of the newest link, whose end the guard awaits.
    pub run: Option<Run>,
    orders: Option<Orders>,
    pub due_ns: Option<u64>,
}

impl Guard {
    pub fn on_link_ended(&mut self, now_ns: u64) {
        self.due_ns.get_or_insert(now_ns + STARTS_AFTER_NS);
    }

    pub fn turn(&mut self, now_ns: u64, is_succeeded: bool) {
        self.due_ns = None;
        let Some(run) = &self.run else { return };
        let mark = OwedStop::of(run.robot.domain());
        let orders = match self.orders.take() {
            Some(orders) => Ok(orders),
            None if is_succeeded || !mark.is_set() => return,
            None => Orders::open(run),
        };
        let turned = orders.and_then(|mut orders| Ok((orders.turn(now_ns)?, orders)));
        let Ok((rest, orders)) = turned else {
            self.due_ns = Some(now_ns + TRIES_AGAIN.as_nanos() as u64);
            return;
        };
        let found = Found {
            link_lives: false,
            is_owed: rest != Rest::AtRest,
            is_succeeded,
            is_signed_off: false,
            is_robot_gone: false,
        };
        if found.role() == Role::Orders {
            self.due_ns = Some(now_ns + orders.pause().as_nanos() as u64);
            self.orders = Some(orders);
        } else if !is_succeeded {
            // Nothing else can be done about a mark that stays.
            let _ = mark.set(false, std::path::Path::new(""));
        }
    }
}
