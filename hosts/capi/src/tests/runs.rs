//! Engines and live runs.

use std::ffi::{CStr, CString, c_char};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::time::Duration;

use harness::counting::{Counting, allocations};

use crate::engine::*;
use crate::graph::*;
use crate::live::*;
use crate::status::*;

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn c(text: &str) -> CString {
    CString::new(text).expect("no zero byte")
}

fn said(text: *const c_char) -> String {
    assert!(!text.is_null());
    // SAFETY: texts of the library end with a zero byte.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

fn last() -> String {
    said(asperity_last_error())
}

#[track_caller]
fn ok(status: AsperityStatus) {
    assert_eq!(status, ASPERITY_OK, "{}", last());
}

#[track_caller]
fn refused(status: AsperityStatus, as_: AsperityStatus, why: &str) {
    assert_eq!((status, last().contains(why)), (as_, true), "{}", last());
}

fn shipped(name: &str) -> *mut AsperityGraph {
    let mut graph = null_mut();
    let path = c(&harness::graphs(name).display().to_string());
    // SAFETY: a text, and a place for the handle.
    ok(unsafe { asperity_graph_open(path.as_ptr(), &mut graph) });
    graph
}

fn parsed(text: &str) -> (AsperityStatus, *mut AsperityGraph) {
    let mut graph = null_mut();
    // SAFETY: texts, and a place for the handle.
    (unsafe { asperity_graph_parse(c(text).as_ptr(), c("mine.ron").as_ptr(), &mut graph) }, graph)
}

fn set(graph: *mut AsperityGraph, name: &str, value: &str) -> AsperityStatus {
    // SAFETY: texts.
    unsafe { asperity_graph_set(graph, c(name).as_ptr(), c(value).as_ptr()) }
}

fn engine(graph: *mut AsperityGraph, stylus: u32) -> *mut AsperityEngine {
    let mut engine = null_mut();
    // SAFETY: a place for the handle.
    ok(unsafe { asperity_engine_new(graph, stylus, &mut engine) });
    engine
}

fn tick(
    engine: *mut AsperityEngine,
    hand: Option<&AsperityHand>,
    out: &mut [f32],
) -> (AsperityStatus, usize) {
    let (mut frames, hand) = (77, hand.map_or(null(), |hand| hand));
    // SAFETY: all is valid.
    (unsafe { asperity_engine_tick(engine, hand, out.as_mut_ptr(), out.len(), &mut frames) }, frames)
}

fn live(graph: *mut AsperityGraph, stylus: u32) -> *mut AsperityLive {
    let mut live = null_mut();
    // SAFETY: a place for the handle.
    ok(unsafe { asperity_live_new(graph, stylus, &mut live) });
    live
}

fn pull(live: *mut AsperityLive, out: &mut [f32]) -> AsperityStatus {
    // SAFETY: a block of one channel.
    unsafe { asperity_live_pull(live, out.as_mut_ptr(), out.len(), 1) }
}

fn push(live: *mut AsperityLive, x: f64) -> AsperityStatus {
    let hand = AsperityHand { position_mm: [x, 0.0, -2.0], ..AsperityHand::default() };
    // SAFETY: a hand.
    unsafe { asperity_live_push(live, &hand, 0) }
}

fn figures(live: *mut AsperityLive) -> AsperityFigures {
    let mut figures = AsperityFigures::default();
    // SAFETY: a place for the figures.
    ok(unsafe { asperity_live_figures(live, &mut figures) });
    figures
}

/// A tone of 100 Hz at a limiter.
fn tone(gain: f64) -> String {
    format!(
        r#"Graph(version: 1, nodes: {{"tone": (kind: "sine", params: (unit: "A", amplitude: {gain:.3})),
        "limiter": (kind: "limiter", params: (profile: "hapcoil_one")), "out": (kind: "audio_out")}},
        wires: [("tone", "limiter"), ("limiter", "out")])"#
    )
}

/// Position of a hand that strokes to and fro, in the surface.
fn stroke(tick: usize) -> AsperityHand {
    let t = tick as f64 * 0.002;
    AsperityHand { position_mm: [40.0 * (3.0 * t).sin(), 0.0, -2.0], ..AsperityHand::default() }
}

const TICKS: usize = 500;

/// A CSV file of that stroke.
fn file_of_the_stroke(folder: &Path) -> CString {
    let rows = (0..=TICKS).map(|i| {
        let [x, y, z] = stroke(i).position_mm;
        format!("{},{x},{y},{z}\n", i as f64 / 500.0)
    });
    let path = folder.join("stroke.csv");
    std::fs::write(&path, "t_s,x_mm,y_mm,z_mm\n".to_owned() + &rows.collect::<String>()).expect("a file");
    c(&path.display().to_string())
}

#[test]
fn hand_and_its_recording_give_the_same_samples() {
    let (graph, folder) = (shipped("texture.ron"), tempfile::tempdir().expect("a folder"));
    let run = |engine, by_hand: bool| {
        let (mut all, mut out) = (Vec::new(), [0.0; 96]);
        for i in 0..TICKS {
            let hand = stroke(i);
            assert_eq!(tick(engine, by_hand.then_some(&hand), &mut out), (ASPERITY_OK, 96), "{}", last());
            all.extend(out.map(f32::to_bits));
        }
        all
    };
    let by_hand = engine(graph, ASPERITY_HAND);
    let first = run(by_hand, true);
    assert!(first.iter().filter(|bits| **bits != 0).count() > 20_000);
    ok(asperity_engine_reset(by_hand));
    assert_eq!(run(by_hand, true), first);
    // SAFETY: a text.
    ok(unsafe { asperity_graph_stroke(graph, file_of_the_stroke(folder.path()).as_ptr()) });
    let recorded = engine(graph, ASPERITY_STROKE);
    assert!(run(recorded, false) == first, "the recording gives other samples");
    assert_eq!(said(asperity_engine_faults(recorded)), "");
    refused(tick(recorded, Some(&stroke(0)), &mut [0.0; 96]).0, ASPERITY_INVALID, "ASPERITY_HAND");
    for engine in [by_hand, recorded] {
        ok(asperity_engine_free(engine));
        refused(asperity_engine_free(engine), ASPERITY_INVALID, "it was freed");
    }
    ok(asperity_graph_free(graph));
}

#[test]
fn ports_and_surface_are_read_after_a_tick() {
    let graph = shipped("haply.ron");
    for port in ["floor.force", "texture", "floor.force"] {
        // SAFETY: a text.
        ok(unsafe { asperity_graph_probe(graph, c(port).as_ptr()) });
    }
    // SAFETY: a text.
    refused(unsafe { asperity_graph_probe(graph, c("flor.force").as_ptr()) }, ASPERITY_INVALID, "floor");
    let engine = engine(graph, ASPERITY_HAND);
    let read = |port: &str, room: usize| {
        let (mut values, mut count) = (vec![0.0; room], 0);
        // SAFETY: all is valid.
        ok(unsafe { asperity_engine_read(engine, c(port).as_ptr(), values.as_mut_ptr(), room, &mut count) });
        (values, count)
    };
    assert_eq!(read("floor.force", 4).1, 0, "nothing before the first tick");
    let mut out = [0.0; 96];
    let frames = (0..200).map(|i| {
        ok(tick(engine, Some(&stroke(i)), &mut out).0);
        read("texture", 0).1
    });
    assert!(frames.max() > Some(100));
    // 0.5 N/mm, 2 mm deep.
    assert_eq!(read("floor.force", 4), (vec![1.0, 0.0, 0.0, 0.0], 1));
    let mut force = AsperityForce::default();
    // SAFETY: a place for the force.
    ok(unsafe { asperity_engine_force(engine, &mut force) });
    assert_eq!((force.valid, force.stiffness_n_per_mm, force.max_force_n), (1, 0.5, 3.3));
    assert_eq!((force.normal, force.point_mm[2]), ([0.0, 0.0, 1.0], 0.0));
    refused(tick(engine, None, &mut out[..95]).0, ASPERITY_INVALID, "room");
    ok(asperity_engine_free(engine));
    ok(asperity_graph_free(graph));
}

#[test]
fn errors_have_place_caret_and_help() {
    let (status, graph) = parsed(&tone(0.1).replace("limiter\", p", "limitre\", p"));
    refused(status, ASPERITY_INVALID, "mine.ron:2:27: error: there is no node kind `limitre`");
    assert!(last().contains("^^^") && last().contains("help: did you mean `limiter`?"), "{}", last());
    assert!(graph.is_null());
    let (status, graph) = parsed(&tone(0.1));
    ok(status);
    assert_eq!(said(asperity_graph_warnings(graph)), "");
    let mut info = AsperityGraphInfo::default();
    // SAFETY: a place for the figures.
    ok(unsafe { asperity_graph_info(graph, &mut info) });
    assert_eq!((info.tick_hz, info.audio_hz, info.channels, info.tick_frames), (500, 48_000, 1, 96));
    assert_eq!((info.has_stylus, info.has_force, info.stroke_ticks), (0, 0, 0));
    refused(set(graph, "tone.amplitude", "loud"), ASPERITY_INVALID, "loud");
    refused(set(graph, "tune.amplitude", "1"), ASPERITY_INVALID, "tune");
    ok(set(graph, "tick_hz", "1000"));
    // SAFETY: as above.
    ok(unsafe { asperity_graph_info(graph, &mut info) });
    assert_eq!((info.tick_hz, info.tick_frames), (1000, 48));
    // SAFETY: a text.
    let status = unsafe { asperity_graph_stroke(graph, c("none.csv").as_ptr()) };
    refused(status, ASPERITY_INVALID, "found none");
    ok(asperity_graph_free(graph));
    let hand = shipped("live.ron");
    let mut engine = null_mut();
    // SAFETY: a place for the handle.
    let status = unsafe { asperity_engine_new(hand, ASPERITY_STROKE, &mut engine) };
    refused(status, ASPERITY_INVALID, "ASPERITY_HAND");
    // SAFETY: as above.
    let status = unsafe { asperity_engine_new(hand, 2, &mut engine) };
    refused(status, ASPERITY_INVALID, "neither");
    ok(asperity_graph_free(hand));
}

#[test]
fn null_and_numbers_that_are_none_are_refused() {
    // SAFETY: NULL is allowed everywhere, and all else is valid.
    unsafe {
        let (mut graph, mut hand) = (null_mut(), stroke(0));
        refused(asperity_graph_open(null(), &mut graph), ASPERITY_INVALID, "`path` is NULL");
        refused(asperity_graph_open(c("a.ron").as_ptr(), null_mut()), ASPERITY_INVALID, "`graph` is NULL");
        refused(asperity_graph_open(c("none.ron").as_ptr(), &mut graph), ASPERITY_INVALID, "none.ron");
        refused(asperity_graph_open(c"\xff".as_ptr(), &mut graph), ASPERITY_INVALID, "UTF-8");
        refused(asperity_graph_parse(null(), null(), &mut graph), ASPERITY_INVALID, "`text` is NULL");
        refused(asperity_graph_info(null_mut(), &mut Default::default()), ASPERITY_INVALID, "NULL");
        assert!(asperity_graph_warnings(null_mut()).is_null());
        ok(asperity_graph_free(null_mut()));
        ok(asperity_engine_free(null_mut()));
        ok(asperity_live_free(null_mut()));
        let graph = shipped("live.ron");
        refused(asperity_graph_info(graph, null_mut()), ASPERITY_INVALID, "`info` is NULL");
        refused(asperity_engine_new(graph, ASPERITY_HAND, null_mut()), ASPERITY_INVALID, "NULL");
        // A graph is no engine.
        refused(asperity_engine_reset(graph.cast()), ASPERITY_INVALID, "no such handle");
        let (engine, run) = (engine(graph, ASPERITY_HAND), live(graph, ASPERITY_HAND));
        hand.force_n = f64::NAN;
        refused(tick(engine, Some(&hand), &mut [0.0; 96]).0, ASPERITY_INVALID, "finite");
        refused(asperity_engine_tick(engine, null(), null_mut(), 96, null_mut()), ASPERITY_INVALID, "NULL");
        let much = usize::MAX / 2;
        refused(
            asperity_engine_tick(engine, null(), null_mut(), much, null_mut()),
            ASPERITY_INVALID,
            "memory",
        );
        refused(asperity_engine_force(engine, &mut Default::default()), ASPERITY_INVALID, "pushes back");
        refused(push(run, f64::INFINITY), ASPERITY_INVALID, "finite");
        refused(asperity_live_push(run, null(), 0), ASPERITY_INVALID, "NULL");
        refused(asperity_live_strength(run, f64::NAN), ASPERITY_INVALID, "from 0 to 1");
        refused(asperity_live_force(run, &mut Default::default()), ASPERITY_INVALID, "pushes back");
        refused(asperity_live_servo(run, null(), null_mut()), ASPERITY_INVALID, "NULL");
        let mut two = [1.0; 8];
        refused(asperity_live_pull(run, two.as_mut_ptr(), 4, 2), ASPERITY_INVALID, "channels");
        assert_eq!(two, [0.0; 8]);
        ok(asperity_live_pull(run, null_mut(), 0, 1));
        ok(asperity_engine_free(engine));
        ok(asperity_graph_free(graph));
        ok(asperity_live_free(run));
    }
    refused(crate::asperity_check_version(0, 2), ASPERITY_INVALID, "build it anew");
    refused(crate::asperity_check_version(1, 1), ASPERITY_INVALID, "0.1.0");
    ok(crate::asperity_check_version(crate::ASPERITY_VERSION_MAJOR, crate::ASPERITY_VERSION_MINOR));
}

#[test]
fn live_run_plays_pushes_back_and_allocates_nothing() {
    let graph = shipped("haply.ron");
    let run = live(graph, ASPERITY_HAND);
    let (mut force, mut newtons, mut loudest) = (AsperityForce::default(), [9.0; 3], 0.0_f32);
    for i in 0..400 {
        let mut out = [0.0; 48];
        let ((), count) = allocations(|| {
            ok(push(run, 0.1 * f64::from(i)));
            ok(pull(run, &mut out));
            let at = [0.1 * f64::from(i), 0.0, -2.0];
            // SAFETY: all is valid.
            unsafe {
                ok(asperity_live_force(run, &mut force));
                ok(asperity_live_servo(run, at.as_ptr(), newtons.as_mut_ptr()));
                refused_quietly(asperity_live_push(run, null(), 0));
            }
        });
        assert_eq!(count, 0, "pull {i}");
        loudest = out.iter().fold(loudest, |most, x| x.abs().max(most));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(loudest > 0.0);
    assert_eq!((force.valid, force.stiffness_n_per_mm), (1, 0.5));
    assert!(newtons[2] > 0.0 && newtons[2] <= 1.5, "{newtons:?}");
    let figures = figures(run);
    // The last ones are read by the next tick.
    assert!(figures.hand_samples >= 398 && figures.faults == 0, "{figures:?}");
    assert!(figures.ticks >= 199 && figures.tick_max_us > 0.0 && figures.deadline_us == 2000.0);
    assert_eq!(said(asperity_live_faults(run)), "");
    ok(asperity_live_free(run));
    refused(pull(run, &mut [0.0; 48]), ASPERITY_INVALID, "freed");
    ok(asperity_graph_free(graph));
}

fn refused_quietly(status: AsperityStatus) {
    assert_eq!(status, ASPERITY_INVALID);
}

/// Pulls so many blocks of a tick.
fn pull_ticks(run: *mut AsperityLive, ticks: usize) -> Vec<f32> {
    let mut heard = Vec::new();
    for _ in 0..ticks {
        let mut out = [0.0; 96];
        ok(pull(run, &mut out));
        heard.extend(out);
    }
    heard
}

fn loudest(heard: &[f32]) -> f32 {
    heard.iter().fold(0.0, |most, x| x.abs().max(most))
}

#[test]
fn live_run_is_set_swapped_muted_and_weakened() {
    let (_, quiet) = parsed(&tone(0.02));
    let (_, loud) = parsed(&tone(0.08));
    let run = live(quiet, ASPERITY_HAND);
    let name = |text: &str| c(text);
    let set = |param: &str, value: &str| {
        // SAFETY: texts.
        unsafe { asperity_live_set(run, name(param).as_ptr(), name(value).as_ptr()) }
    };
    pull_ticks(run, 2_000);
    let first = loudest(&pull_ticks(run, 50));
    assert!(first > 0.0);
    ok(asperity_live_swap(run, loud));
    pull_ticks(run, 100);
    let second = loudest(&pull_ticks(run, 50));
    assert!((second / first - 4.0).abs() < 0.1, "{second} after {first}");
    ok(asperity_live_strength(run, 0.5));
    pull_ticks(run, 20);
    let third = loudest(&pull_ticks(run, 50));
    assert!((third / second - 0.5).abs() < 0.02, "{third} after {second}");
    ok(asperity_live_mute(run, 1));
    pull_ticks(run, 20);
    assert_eq!(loudest(&pull_ticks(run, 10)), 0.0);
    assert_eq!(figures(run).state, ASPERITY_MUTED);
    ok(asperity_live_mute(run, 0));
    ok(set("tone.amplitude", "0.02"));
    pull_ticks(run, 500);
    let fourth = loudest(&pull_ticks(run, 50));
    assert!((fourth / first - 0.5).abs() < 0.02, "{fourth} after {first}");
    assert_eq!(figures(run).state, ASPERITY_PLAYING);
    refused(set("tone.amplitude", "loud"), ASPERITY_INVALID, "loud");
    refused(set("tick_hz", "250"), ASPERITY_INVALID, "start anew");
    refused(set("tone", "1"), ASPERITY_INVALID, "tone");
    let two = tone(0.1).replace(
        "\"out\": (kind: \"audio_out\")",
        "\"out\": (kind: \"audio_out\"), \"b\": (kind: \"audio_out\")",
    );
    let (status, two) = parsed(&two.replace("\"out\")])", "\"out\"), (\"limiter\", \"b\")])"));
    ok(status);
    refused(asperity_live_swap(run, two), ASPERITY_INVALID, "channels");
    ok(asperity_live_free(run));
    for graph in [quiet, loud, two] {
        ok(asperity_graph_free(graph));
    }
}

#[test]
fn material_of_a_live_run_changes() {
    let graph = shipped("live.ron");
    let run = live(graph, ASPERITY_HAND);
    // SAFETY: texts.
    let choose = |material: &str| unsafe {
        asperity_live_set(run, c("texture.material").as_ptr(), c(material).as_ptr())
    };
    ok(push(run, 0.0));
    pull_ticks(run, 3);
    ok(choose("oak"));
    refused(choose("oka"), ASPERITY_INVALID, "oak");
    pull_ticks(run, 60);
    ok(choose("canvas"));
    // The hand goes on: its queue is the same.
    ok(push(run, 1.0));
    pull_ticks(run, 3);
    assert_eq!(figures(run).hand_samples, 2);
    ok(asperity_live_free(run));
    ok(asperity_graph_free(graph));
}

#[test]
fn second_thread_in_a_call_is_refused() {
    let graph = shipped("texture.ron");
    let engine = engine(graph, ASPERITY_STROKE) as usize;
    let busy = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                for _ in 0..2_000 {
                    match tick(engine as *mut AsperityEngine, None, &mut [0.0; 96]).0 {
                        ASPERITY_OK => {}
                        ASPERITY_BUSY => _ = busy.fetch_add(1, std::sync::atomic::Ordering::Relaxed),
                        other => panic!("{other}: {}", last()),
                    }
                }
            });
        }
    });
    assert!(busy.into_inner() > 0, "three threads were never in a tick at once");
    ok(asperity_engine_free(engine as *mut AsperityEngine));
    ok(asperity_graph_free(graph));
}
