//! A long run of the shipped graph on the simulated card, in real time: what it was like is reported, what
//! must hold is checked.
//!
//! `ASPERITY_LONG_TICKS` says how many ticks; without it, a few seconds.

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_audio::simulated::{Params, Simulated};
use asperity_audio::{Block, Process, Request, open};
use asperity_engine::Options as EngineOptions;
use asperity_graph::GraphFile;
use asperity_live::driver::{Clock, Options, Rates, Ticker, callback, paced};
use asperity_live::realtime::Machine;
use asperity_live::{Count, DeviceQueues, GraphController, Meters, Player, prepare_live};
use harness::alone::apart;
use harness::counting::{Who, assert_it_counts, bind, look, touched};

/// The graph on a thread whose allocations are counted: a paced driver's own from its first tick to its last,
/// the device's only while it is in our hands.
struct Bound<T>(T);

impl Ticker for Bound<Player> {
    fn rates(&self) -> Rates {
        self.0.rates()
    }
    fn next_tick(&self) -> u64 {
        self.0.next_tick()
    }
    fn tick(&mut self, time_ns: u64, out: &mut [f32]) {
        bind(true);
        self.0.tick(time_ns, out);
        assert!(out.iter().all(|x| x.abs() <= 1.0));
    }
    fn skip(&mut self, n: u64) {
        self.0.skip(n);
    }
}

impl Process for Bound<Box<dyn Process>> {
    fn process(&mut self, block: &mut Block<'_>) {
        bind(true);
        self.0.process(block);
        bind(false);
    }
}

/// Kilobytes of memory that the program has.
fn memory_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// The shipped graph with a stroke without end, so that no node sleeps.
fn player(tick_hz: u32) -> (GraphController, Player) {
    let mut graph = GraphFile::read(harness::graphs("texture.ron")).expect("the shipped graph");
    let stylus = graph.nodes.iter_mut().find(|n| n.id == "stylus").expect("the stylus");
    stylus.kind = "stroke".into();
    stylus.params.clear();
    for set in ["stylus.shape=circle", "stylus.duration_s=1e6", &format!("tick_hz={tick_hz}")] {
        graph.set(set, "the test").expect("a setting");
    }
    let compiled = harness::graph::compiled(&graph, &harness::registry());
    prepare_live(compiled, &graph, EngineOptions::default(), DeviceQueues::default(), None, Vec::new())
}

/// One run of so many ticks; a line of the table.
fn run(clock: Clock, tick_hz: u32, frames: u32, ticks: u64) {
    let what = format!("{} {tick_hz} Hz, {frames} frames", clock.name());
    let card = Simulated::new(&what, Params { frames: vec![frames], inputs: 0, ..Params::default() })
        .expect("a card");
    let (mut graph_controller, mut player) = player(tick_hz);
    let (mut played, mut stylus) = (player.record_played(), player.record_stylus());
    let (mut values, mut rows) = (Vec::new(), 0);
    let meters = Arc::new(Meters::new(tick_hz));
    let options = Options { start_s: 0.0, ..Options::new(meters.clone()) };
    let (driver, process): (_, Box<dyn Process>) = if clock == Clock::Callback {
        let (driver, half) = callback(Bound(player), &options);
        (driver, Box::new(half))
    } else {
        let (driver, half) = paced(Bound(player), &options).expect("a thread");
        (driver, Box::new(half))
    };
    let request = Request { device: Some(card.id()), ..Request::default() };
    let stream = open(&request, Box::new(Bound(process)), None).expect("the card");
    stream.play().expect("it plays");
    let mut wait = |until: u64, graph_controller: &mut GraphController| {
        let (began, mut view) = (Instant::now(), asperity_live::view::View::default());
        while meters.next_tick() < until {
            assert!(!driver.controls().failed() && stream.lost().is_none(), "{what}: {:?}", stream.lost());
            assert!(
                began.elapsed()
                    < Duration::from_secs(60) + Duration::from_secs(3 * until / u64::from(tick_hz))
            );
            // As a page would.
            graph_controller.look(&mut view, Duration::from_millis(50));
            while played.next(&mut values).is_some() {}
            rows += std::iter::from_fn(|| stylus.take()).count();
            std::thread::sleep(Duration::from_millis(50));
        }
        view
    };
    wait(ticks / 5, &mut graph_controller);
    look(Who::Bound);
    let before_kb = memory_kb();
    let view = wait(ticks, &mut graph_controller);
    let after_kb = memory_kb();
    look(Who::Nobody);
    let (timing, grown) = (meters.timing(), after_kb.saturating_sub(before_kb));
    let (lost, breaks) = (meters.lost_samples.get(), meters.underruns.get() + meters.xruns.get());
    println!("{what}: {} ticks, {grown} kB more", meters.next_tick());
    let figures =
        [("woke late", timing.late_us), ("tick", timing.compute_us), ("in time", timing.recovery_us)];
    figures.iter().for_each(|(what, us)| println!("  {what} [us], p50 p99 p99.9 max: {us:.1?}"));
    let [skipped, behind] = [&meters.skipped_ticks, &meters.caught_up_ticks].map(Count::get);
    println!("  {} misses, {skipped} left out, {behind} behind, {breaks} breaks, {lost} lost", timing.misses);
    assert_eq!(touched(), (0, 0), "{what}: allocations");
    assert!(grown < 400, "{what}: {grown} kB more");
    assert_eq!((view.faults, played.lost(), stylus.lost()), (0, 0, 0), "{what}: {view:?}");
    assert!(rows > 0, "the stylus is recorded");
    let ticker = driver.stop().expect("the ticker");
    assert!(ticker.0.engine().next_tick() >= ticks);
}

#[test]
fn long_run_neither_allocates_nor_grows() {
    // It locks the memory of the whole process and measures how that grows.
    if apart(harness::test_name!(), &[]).is_some() {
        return;
    }
    bind(true);
    assert_it_counts(Who::Bound);
    bind(false);
    let long = std::env::var("ASPERITY_LONG_TICKS").ok().and_then(|t| t.parse::<u64>().ok());
    // A run has them; without leave from the system it is worse.
    let _machine = Machine::ask();
    let ticks = |tick_hz: u32, part: u64| long.map_or(u64::from(tick_hz) * 3 / 2, |all| all * part / 100);
    run(Clock::Paced, 4000, 256, ticks(4000, 70));
    run(Clock::Callback, 4000, 12, ticks(4000, 25));
    run(Clock::Paced, 500, 1024, ticks(500, 3));
    run(Clock::Callback, 500, 64, ticks(500, 2));
}
