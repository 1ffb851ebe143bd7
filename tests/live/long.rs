//! A long run of the shipped graph on the simulated card, in real time: what it was like is reported, what
//! must hold is checked.
//!
//! `ASPERITY_LONG_TICKS` says how many ticks; without it, a few seconds.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use asperity_audio::simulated::{Params, Simulated};
use asperity_audio::{Block, Process, Request, open};
use asperity_engine::Options as EngineOptions;
use asperity_graph::GraphFile;
use asperity_live::driver::{Clock, Options, Rates, Ticker, callback, paced};
use asperity_live::realtime::Machine;
use asperity_live::{DeviceQueues, Meters, Player, prepare_live};
use asperity_node::time;
use harness::alone::apart;
use harness::counting::{Who, assert_it_counts, bind, look, touched};

/// Samples are numbered up to here, and then from the front: numbers that f32 holds exactly.
const NUMBERS: u64 = 1 << 22;

/// The graph's ticks, each computed; what goes out are the numbers of its samples, so that they can be found
/// again.
struct Numbered(Player);

impl Ticker for Numbered {
    fn rates(&self) -> Rates {
        self.0.rates()
    }
    fn next_tick(&self) -> u64 {
        self.0.next_tick()
    }
    fn tick(&mut self, time_ns: u64, out: &mut [f32]) {
        // The paced driver's own thread, from its first tick to its last; the device's thread only while it
        // is in our hands.
        bind(true);
        let Rates { tick_hz, rate_hz, .. } = self.rates();
        let span = time::samples(self.next_tick(), rate_hz, tick_hz);
        self.0.tick(time_ns, out);
        assert!(out.iter().all(|x| x.abs() <= 1.0));
        out.iter_mut().zip(span).for_each(|(y, n)| *y = (n % NUMBERS + 1) as f32 / (2 * NUMBERS) as f32);
    }
    fn skip(&mut self, n: u64) {
        self.0.skip(n);
    }
}

/// The heard samples: jumps ahead, and frames without a number in its place.
#[derive(Default)]
struct Heard {
    frames: AtomicU64,
    jumped: AtomicU64,
    other: AtomicU64,
    /// Numbers that came a second time.
    repeated: AtomicU64,
}

/// The driver's end, and an ear behind it.
struct Ear<P> {
    half: P,
    heard: Arc<Heard>,
    /// The number that is next, and how many of a new place have come one after the other.
    next: Option<u64>,
    place: (u64, u32),
}

/// A number is believed in when so many follow on one another: what fades has none.
const BELIEVED: u32 = 64;

impl<P> Ear<P> {
    fn new(half: P, heard: &Arc<Heard>) -> Self {
        Self { half, heard: heard.clone(), next: None, place: (0, 0) }
    }

    fn hear(&mut self, sample: f32) {
        let number = (f64::from(sample) * (2 * NUMBERS) as f64) as u64;
        self.place = if number == self.place.0 { (number + 1, self.place.1 + 1) } else { (number + 1, 1) };
        if self.place.0 == NUMBERS + 1 {
            self.place.0 = 1;
        }
        let Some(next) = self.next else {
            if self.place.1 >= BELIEVED {
                self.next = Some(self.place.0);
            }
            return;
        };
        self.heard.frames.fetch_add(1, Relaxed);
        let after = next % NUMBERS + 1;
        self.next = Some(after);
        if number == next {
            return;
        }
        self.heard.other.fetch_add(1, Relaxed);
        if self.place.1 == BELIEVED {
            let ahead = (self.place.0 + NUMBERS - after) % NUMBERS;
            let back = ahead > NUMBERS / 2;
            let (count, by) =
                if back { (&self.heard.repeated, NUMBERS - ahead) } else { (&self.heard.jumped, ahead) };
            count.fetch_add(by, Relaxed);
            self.next = Some(self.place.0);
        }
    }
}

impl<P: Process> Process for Ear<P> {
    fn process(&mut self, block: &mut Block<'_>) {
        bind(true);
        self.half.process(block);
        block.output.iter().for_each(|x| self.hear(*x));
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
fn player(tick_hz: u32) -> (asperity_live::GraphController, Player) {
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
    let (mut graph_controller, player) = player(tick_hz);
    let meters = Arc::new(Meters::new(tick_hz));
    let options = Options { start_s: 0.0, ..Options::new(meters.clone()) };
    let heard = Arc::new(Heard::default());
    let (driver, process): (_, Box<dyn Process>) = if clock == Clock::Callback {
        let (driver, half) = callback(Numbered(player), &options);
        (driver, Box::new(Ear::new(half, &heard)))
    } else {
        let (driver, half) = paced(Numbered(player), &options).expect("a thread");
        (driver, Box::new(Ear::new(half, &heard)))
    };
    let request = Request { device: Some(card.id()), ..Request::default() };
    let stream = open(&request, process, None).expect("the card");
    stream.play().expect("it plays");
    let wait = |until: u64, graph_controller: &mut asperity_live::GraphController| {
        let (began, mut view) = (Instant::now(), asperity_live::view::View::default());
        while meters.next_tick() < until {
            assert!(!driver.controls().failed() && stream.lost().is_none(), "{what}: {:?}", stream.lost());
            assert!(
                began.elapsed()
                    < Duration::from_secs(60) + Duration::from_secs(3 * until / u64::from(tick_hz))
            );
            // As a page would.
            graph_controller.look(&mut view, Duration::from_millis(50));
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
    let [jumped, other, repeated] = [&heard.jumped, &heard.other, &heard.repeated].map(|x| x.load(Relaxed));
    let (lost, breaks) = (meters.lost_samples.get(), meters.underruns.get() + meters.xruns.get());
    let figures = |f: [f64; 4]| format!("{:7.1} {:7.1} {:7.1} {:9.1}", f[0], f[1], f[2], f[3]);
    println!(
        "{what:<30} {:>8} {} {} {:>6} {:>6.3} % {} {:>6} {:>6} {:>6} {:>7} {jumped:>7} {:>5} kB",
        meters.next_tick(),
        figures(timing.late_us),
        figures(timing.compute_us),
        timing.misses,
        100.0 * timing.misses as f64 / meters.next_tick() as f64,
        figures(timing.recovery_us),
        meters.skipped_ticks.get(),
        meters.caught_up_ticks.get(),
        breaks,
        lost,
        grown,
    );
    assert_eq!(touched(), (0, 0), "{what}: allocations");
    assert_eq!(repeated, 0, "{what}: samples were played twice");
    assert!(heard.frames.load(Relaxed) > 0, "{what}: nothing was heard");
    // Frames that went by without a call are jumped over; those that were missing when they were to be played
    // are not.
    assert!(jumped <= lost, "{what}: {jumped} samples were left out, {lost} counted");
    let faded = breaks * (48_000 / 50 + u64::from(BELIEVED));
    assert!(
        other <= lost + faded,
        "{what}: {other} samples were not in their place, {lost} and {breaks} breaks counted"
    );
    assert!(grown < 400, "{what}: {grown} kB more");
    assert_eq!(view.faults, 0, "{what}: {view:?}");
    let ticker = driver.stop().expect("the ticker");
    assert!(ticker.0.engine().next_tick() >= ticks);
}

#[test]
fn long_run_counts_every_loss_and_neither_allocates_nor_grows() {
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
    println!(
        "{:<30} {:>8} {:>33} {:>33} {:>6} {:>8} {:>33} {:>6} {:>6} {:>6} {:>7} {:>7} {:>8}",
        "clock",
        "ticks",
        "woke late us: p50 p99 p99.9 max",
        "tick us: p50 p99 p99.9 max",
        "misses",
        "",
        "in time again us: p50 .. max",
        "skip",
        "behind",
        "breaks",
        "lost",
        "jumped",
        "grown",
    );
    let ticks = |tick_hz: u32, part: u64| long.map_or(u64::from(tick_hz) * 3 / 2, |all| all * part / 100);
    run(Clock::Paced, 4000, 256, ticks(4000, 70));
    run(Clock::Callback, 4000, 12, ticks(4000, 25));
    run(Clock::Paced, 500, 1024, ticks(500, 3));
    run(Clock::Callback, 500, 64, ticks(500, 2));
}
