//! Tests that the topics that each process opens on the bus match the table of stages.

use std::collections::BTreeSet;

use common::{
    bus::{Bus, OpenedBy},
    topics,
    wiring::{EVERY_STAGE_READS, EVERY_STAGE_WRITES, Topics},
};
use processes::stages;
use rustix::process::Signal;

use crate::support::{Run, domain, in_own_process, pid};

fn names(lists: &[Topics]) -> BTreeSet<&'static str> {
    let listed = lists.iter().copied().flatten();
    listed.map(|topic| topic.spec().name).collect()
}

#[test]
fn every_stage_has_open_what_its_row_lists_and_nothing_else() {
    in_own_process(|| {
        let mut run = Run::start("wiring", "obstacle-course", &["--pace", "1"]);
        let status = run.wait_until_under_way(0.3);
        let bus = Bus::join(&domain("wiring"), "test").unwrap();
        let opened: Vec<_> = topics::TABLE
            .iter()
            .map(|topic| (topic.spec().name, topic.opened_by(&bus).unwrap()))
            .collect();
        for stage in stages::TABLE {
            let pid = pid(&status, stage.name);
            let found = |has: &dyn Fn(&OpenedBy) -> bool| -> BTreeSet<_> {
                let has = opened.iter().filter(|(_, opened)| has(opened));
                has.map(|(name, _)| *name).collect()
            };
            let wiring = stage.wiring;
            let reads = names(&[wiring.inputs, wiring.feedback, EVERY_STAGE_READS]);
            let writes = names(&[wiring.outputs, EVERY_STAGE_WRITES]);
            let name = stage.name;
            assert_eq!(found(&|opened| opened.readers.contains(&pid)), reads, "{name}");
            assert_eq!(found(&|opened| opened.writers.contains(&pid)), writes, "{name}");
            let woken = found(&|opened| opened.woken.contains(&pid));
            assert_eq!(woken, names(&[wiring.wakes]), "{name}");
        }
        drop(bus);
        run.signal(Signal::TERM);
        run.finish();
    });
}
