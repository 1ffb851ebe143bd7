//! `asperity plugin check`: a good plugin passes every case, and for every case there is a plugin that fails
//! it.

use std::path::Path;

use asperity_checks::node_cases;
use harness::{Ran, Room, plugins, run};

fn check(file: &Path, more: &str) -> Ran {
    let line = format!("plugin check {} {more}", file.display());
    run(&harness::root(), &line.split_whitespace().collect::<Vec<_>>())
}

/// Checks one case of a broken plugin, which must fail it and say `found`.
#[track_caller]
fn fails(dir: &Room, broken: &str, kind: &str, case: &str, found: &str) {
    let ran = check(&plugins::broken(dir, broken), &format!("--kind {kind} --case {case} --ticks 3000"));
    let line = ran.out.lines().find(|l| l.starts_with(kind) && l.contains("fail")).unwrap_or_default();
    let failed = ran.code == 1 && line.contains(case) && line.contains(found);
    assert!(failed, "{broken}: {}\n{}", ran.out, ran.err);
}

/// Which plugin fails which case of which kind, and with what.
const MUTANTS: &[(&str, &str, &str, &str)] = &[
    ("NO_OUTPUTS", "turning", "descriptor", "no outputs and is no sink"),
    ("NOT_PREPARED", "low_pass", "prepare", "it is not in the mood"),
    ("ZERO_BY_ZERO", "low_pass", "zero", "`out` is not finite at tick 0"),
    ("FAILS_WITH_CODE", "low_pass", "random", "failed with code 7 at tick 49"),
    ("WRITES_NAN", "low_pass", "random", "`out` is not finite at tick 49"),
    ("NO_SUCH_STATUS", "low_pass", "random", "a status that does not exist"),
    ("TRIPS_ON_STEPS", "low_pass", "steps", "failed with code 0"),
    ("TRIPS_ON_DENORMALS", "low_pass", "denormal", "failed with code 0"),
    ("OVERFLOWS", "low_pass", "huge", "`out` is not finite"),
    ("KEEPS_NAN", "low_pass", "not_finite", "a reset does not help"),
    ("SHORT_BUFFER", "low_pass", "rates", "failed with code 0 at tick 0 (100 Hz ticks, 44100 Hz audio"),
    ("FEW_BINS", "turning", "layouts", "2206 bins of 4410 at 44100 Hz"),
    ("NEEDS_THE_OPTIONAL", "low_pass", "unconnected", "failed with code 0"),
    ("NEEDS_EVERY_FRAME", "turning", "missing_frames", "failed with code 0 at tick 0"),
    ("UNSAID_SAMPLES", "low_pass", "outputs", "wrote samples without saying so"),
    ("UNSAID_FRAME", "turning", "outputs", "wrote a frame without saying so"),
    ("HALF_A_FRAME", "turning", "outputs", "values of a frame unwritten"),
    ("PAST_THE_END", "low_pass", "outputs", "wrote past the"),
    ("WRITES_TO_INPUTS", "low_pass", "outputs", "wrote to input 0"),
    ("FORGETS_TO_RESET", "low_pass", "reset", "`out` differs first at call 0"),
    ("STATIC_COUNTER", "low_pass", "determinism", "a second instance: `out` differs"),
    ("SLEEPS_TOO_EARLY", "low_pass", "engine", "lets it sleep when it says it may"),
    ("DEAF_TO_ELAPSED", "turning", "sleep", "after 120 ticks asleep: `spectrum` differs"),
    ("ABSORB_FAILS", "late", "cycle", "failed with code 0"),
    ("SAVES_TOO_LITTLE", "low_pass", "state", "restored at tick 1 into a fresh instance: `out` differs"),
    ("SAVES_TOO_MUCH", "low_pass", "state", "save wrote past the memory it was given"),
    (
        "TRUSTS_ANY_STATE",
        "low_pass",
        "garbage_state",
        "signal 11 (segmentation fault) in case `garbage_state`",
    ),
    ("DIVIDES_BY_GAIN", "low_pass", "live_parameters", "with gain = 0.0"),
    ("TIRES", "low_pass", "random_ticks", "failed with code 0 at tick"),
    ("ROUNDS_TO_ZERO", "low_pass", "surroundings", "it changed the rounding mode"),
    ("HANDLES_SIGNALS", "low_pass", "surroundings", "the handler of signal 11 (segmentation fault)"),
    ("CHANGES_FOLDER", "low_pass", "surroundings", "it changed the working directory, to /"),
    ("LEAVES_A_THREAD", "low_pass", "surroundings", "of its threads behind"),
    ("PROCESS_ID", "low_pass", "other_process", "another process puts out something else"),
];

#[test]
fn broken_plugin_fails_its_case() {
    let dir = Room::new();
    for (broken, kind, case, found) in MUTANTS {
        fails(&dir, broken, kind, case, found);
    }
}

#[test]
fn every_case_has_a_broken_plugin() {
    for case in node_cases().iter().filter(|c| c.name != "allocation") {
        assert!(MUTANTS.iter().any(|m| m.2 == case.name), "no plugin fails {}", case.name);
    }
}

#[test]
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn allocations_in_process_and_reset_are_counted() {
    let dir = Room::new();
    let found = "process allocated 6000 and freed 6000 times in 6000 of 6000 calls, first at tick 0";
    fails(&dir, "ALLOCATES", "low_pass", "allocation", found);
    let found = "reset allocated 6 and freed 6 times in 6 of 6 calls";
    fails(&dir, "ALLOCATES_IN_RESET", "low_pass", "allocation", found);
}

#[test]
fn good_plugin_passes_every_case() {
    let dir = Room::new();
    let ran = check(&plugins::broken(&dir, "NOTHING"), "--json --ticks 20000").ok();
    let all: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    let rows = all["cases"].as_array().expect("rows");
    for case in node_cases().iter().map(|c| c.name).chain(["surroundings", "time", "other_process"]) {
        let of: Vec<_> = rows.iter().filter(|r| r["case"] == case).collect();
        assert_eq!(of.len(), 3, "{case} is run for every kind");
        let known = |r: &&serde_json::Value| {
            ["pass", "not applicable", "measured"].iter().any(|v| r["verdict"] == *v)
        };
        assert!(of.iter().all(known), "{of:?}");
        let said = if case == "time" { "measured" } else { "pass" };
        let counted = cfg!(all(target_os = "linux", target_env = "gnu"));
        // No kind of it sleeps too early or has no use for a case at all.
        assert!(of.iter().any(|r| r["verdict"] == said) || (case == "allocation" && !counted), "{of:?}");
    }
    assert_eq!(all["verdict"], "pass");
    assert!(rows.iter().any(|r| r["case"] == "time" && r["median_us"].as_f64().is_some_and(|x| x > 0.0)));
}

#[test]
fn rust_plugins_are_checked_and_their_allocations_counted() {
    for package in ["my_phase", "my_filter", "my_effect", "asperity-rtpghi", "asperity-gsrtisi-la"] {
        check(&plugins::rust(package), "--ticks 5000").ok().says(&[" 0 failed"]);
    }
    // A panic takes memory, which only the plugin's own allocator sees.
    let ran = check(&plugins::rust("asperity-test-panics"), "--case random --case allocation")
        .ends(1, &["panicked at tick 100"]);
    if cfg!(all(target_os = "linux", target_env = "gnu")) {
        assert!(ran.out.contains("in 1 of 6000 calls, first at tick 100"), "{}", ran.out);
    }
}

#[test]
fn crash_is_named_and_later_cases_still_run() {
    let dir = Room::new();
    let cases = "--case zero --case random --case descriptor";
    let ran = check(&plugins::broken(&dir, "SEGFAULT"), cases)
        .says(&[
            "crashed by signal 11 (segmentation fault) in case `zero`",
            "crashed by signal 11 (segmentation fault) in case `random`",
        ])
        .ends(1, &[]);
    let passed = |kind: &str, case: &str| {
        let words = |l: &str| l.split_whitespace().take(3).map(str::to_owned).collect::<Vec<_>>();
        assert!(ran.out.lines().any(|l| words(l) == [kind, case, "pass"]), "{kind} {case}: {}", ran.out);
    };
    // Of the kind that crashes, and of those behind it, which are well.
    passed("low_pass", "descriptor");
    for kind in ["turning", "late"] {
        passed(kind, "zero");
        passed(kind, "random");
    }
    assert!(ran.out.ends_with("7 passed, 2 failed, 0 not applicable\n"), "{}", ran.out);
}

#[test]
fn abort_exit_and_endless_loop_are_named() {
    let dir = Room::new();
    fails(&dir, "ABORT", "low_pass", "random", "crashed by signal 6 (abort) in case `random`");
    fails(&dir, "EXITS", "low_pass", "random", "ended the process with code 3 in case `random`");
    let file = plugins::broken(&dir, "ENDLESS");
    check(&file, "--kind low_pass --case random --patience 1")
        .ends(1, &["did not answer within 1 s in case `random`"]);
}

#[test]
fn plugin_that_does_not_load_is_refused() {
    let dir = Room::new();
    let text = dir.join("text.so");
    std::fs::write(&text, "not a library").unwrap();
    let ran = check(&text, "").refused("not a shared library");
    assert_eq!(ran.out, "");
    check(&dir.join("nowhere.so"), "").refused("");
    check(&plugins::broken(&dir, "NO_FULL_STOP"), "").refused("full stop");
    check(&plugins::broken(&dir, "CRASHES_OPENING"), "")
        .ends(1, &["load", "crashed by signal 11 (segmentation fault) outside of any case"]);
}

#[test]
fn unknown_kinds_cases_and_settings_are_refused() {
    let dir = Room::new();
    let good = plugins::broken(&dir, "NOTHING");
    for (args, message) in [
        ("--kind low_pas", "this plugin has no kind `low_pas`"),
        ("--case randon", "there is no case `randon`"),
        ("--set gian=1", "no kind here has a parameter `gian`"),
        ("--set gain", "there is no `=` in `gain`"),
    ] {
        let ran = check(&good, args);
        assert!(ran.code == 2 && ran.err.contains(message) && ran.out.is_empty(), "{}\n{}", ran.out, ran.err);
    }
    check(&good, "--case prepare --kind low_pass --set gain=9").ends(1, &["fail"]);
}

#[cfg(target_os = "linux")]
#[test]
fn checking_process_ends_with_its_parent() {
    let file = plugins::c("told").display().to_string();
    let args = ["plugin", "check", &file, "--set", "what=endless", "--set", "to=1000000"];
    let mut parent = harness::asperity(&harness::root())
        .args(args)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let id = parent.id();
    let children = || std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
    let mut child = String::new();
    harness::live::until("the process that checks", || {
        child = children().split_whitespace().next().unwrap_or_default().to_owned();
        !child.is_empty()
    });
    // So that it is in the endless loop.
    std::thread::sleep(std::time::Duration::from_secs(1));
    parent.kill().unwrap();
    parent.wait().unwrap();
    let state = || std::fs::read_to_string(format!("/proc/{child}/stat")).unwrap_or_default();
    harness::live::until("its end", || state().is_empty() || state().contains(") Z "));
}
