//! Cost of the C interface: a pull beside the player's own callback, and a tick beside the engine's own.
//!
//!     cargo bench -p asperity-capi --bench pull

use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::time::Instant;

use asperity::{engine::*, graph::*, live::*, status::*};
use asperity_audio::{Block, Process};
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile};
use asperity_live::{DeviceQueues, Pulled, RunControl, now_ns, prepare_live};
use asperity_offline::kinds::Kinds;
use asperity_offline::load::{Request, load};

/// Blocks of 64 frames, and how many.
const FRAMES: usize = 64;
const BLOCKS: usize = 20_000;

const GRAPH: &str = "graphs/texture.ron";

/// A graph that hardly computes, so that the border is seen.
const SMALL: &str = r#"Graph(version: 1, nodes: {"tone": (kind: "sine", params: (unit: "A")),
    "limiter": (kind: "limiter", params: (profile: "hapcoil_one")), "out": (kind: "audio_out")},
    wires: [("tone", "limiter"), ("limiter", "out")])"#;

fn ok(status: AsperityStatus) {
    assert_eq!(status, ASPERITY_OK);
}

fn c(text: &str) -> CString {
    CString::new(text).expect("no zero byte")
}

fn opened(text: &str) -> *mut AsperityGraph {
    let mut graph = null_mut();
    // SAFETY: texts, and a place for the handle.
    ok(unsafe {
        match text.ends_with(".ron") {
            true => asperity_graph_open(c(text).as_ptr(), &mut graph),
            false => asperity_graph_parse(c(text).as_ptr(), null(), &mut graph),
        }
    });
    graph
}

fn compiled(text: &str) -> (GraphFile, Compiled) {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = match text.ends_with(".ron") {
        true => asperity_offline::shipped::found(text.into()).expect("a shipped file"),
        false => {
            let path = folder.path().join("small.ron");
            std::fs::write(&path, text).expect("a file");
            path
        }
    };
    let loaded = load(&Request { graph, ..Request::default() }, &mut Kinds::new(&[]));
    let loaded = loaded.map_err(|e| e.text()).expect("a graph");
    (loaded.graph, loaded.compiled)
}

/// Mean time of a call \[ns\], of the best of five rounds.
fn time(calls: usize, mut call: impl FnMut()) -> f64 {
    let round = |_| {
        let began = Instant::now();
        (0..calls).for_each(|_| call());
        began.elapsed().as_nanos() as f64 / calls as f64
    };
    (0..5).map(round).fold(f64::INFINITY, f64::min)
}

fn main() {
    for (name, text) in [("sine", SMALL), ("texture", GRAPH)] {
        let mut out = [0.0; FRAMES];
        let (graph, own) = compiled(text);
        let (controller, player) =
            prepare_live(own, &graph, Options::default(), DeviceQueues::default(), None, Vec::new());
        let (run, mut half) = Pulled::start(controller, player, RunControl::default());
        let own = time(BLOCKS, || {
            half.process(&mut Block { output: &mut out, channels: 1, now_ns: now_ns() });
        });
        drop(run);
        let (graph, mut live) = (opened(text), null_mut());
        // SAFETY: a place for the handle.
        ok(unsafe { asperity_live_new(graph, ASPERITY_STROKE, &mut live) });
        // SAFETY: a block.
        let pull = time(BLOCKS, || ok(unsafe { asperity_live_pull(live, out.as_mut_ptr(), FRAMES, 1) }));
        ok(asperity_live_free(live));
        println!(
            "{name:>8}: pull {pull:8.0} ns, the player's own {own:8.0} ns, more by {:5.0} ns",
            pull - own
        );

        let mut engine = Engine::new(compiled(text).1, Options::default());
        let own = time(BLOCKS, || engine.tick());
        let (mut ours, mut out) = (null_mut(), [0.0; 96]);
        // SAFETY: all is valid.
        let tick = unsafe {
            ok(asperity_engine_new(graph, ASPERITY_STROKE, &mut ours));
            time(BLOCKS, || ok(asperity_engine_tick(ours, null(), out.as_mut_ptr(), 96, null_mut())))
        };
        ok(asperity_engine_free(ours));
        println!(
            "{name:>8}: tick {tick:8.0} ns, the engine's own {own:8.0} ns, more by {:5.0} ns",
            tick - own
        );
        ok(asperity_graph_free(graph));
    }
}
