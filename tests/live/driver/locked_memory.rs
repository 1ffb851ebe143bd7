//! Memory that the system says it locked is locked.

#![cfg(target_os = "linux")]

use asperity_live::realtime::{Grant, Machine};
use harness::alone::apart;

#[test]
fn memory_that_is_called_locked_is_locked() {
    // The memory of the whole process is locked.
    if apart(harness::test_name!(), &[]).is_some() {
        return;
    }
    let machine = Machine::ask();
    let grants = machine.grants(Grant::NotAsked);
    let status = std::fs::read_to_string("/proc/self/status").expect("the process's own figures");
    let locked = status.lines().find_map(|l| l.strip_prefix("VmLck:")).expect("a figure for locked memory");
    let kb: u64 = locked.trim().trim_end_matches(" kB").parse().expect("a number");
    assert_eq!(grants.memory == Grant::Granted, kb > 0, "{grants:?}, {kb} kB");
    let missing = [grants.memory, grants.latency].iter().filter(|g| g.missing()).count();
    assert_eq!(grants.refused().len(), missing);
}
