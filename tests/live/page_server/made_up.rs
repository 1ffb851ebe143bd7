//! A run that is made up, for the page to show: the graph of a texture under a stylus, with figures that
//! move.

use asperity_live::view::{
    Condition, Layout, LiveLayout, Material, Materials, NodeLayout, NodeView, Request, ScopeLayout,
    SourceView, TimingView, View,
};

/// Views a second.
const FPS: u64 = 60;
const EDGES_US: [f64; 8] = [1.0, 3.0, 10.0, 32.0, 100.0, 320.0, 1000.0, 2000.0];

pub struct Run {
    pub layout: Layout,
    pub muted: bool,
    pub strength: f32,
    number: u64,
}

impl Run {
    /// One that has run for so long.
    pub fn at(seconds: u64) -> Self {
        Self { layout: layout(), muted: false, strength: 1.0, number: seconds * FPS }
    }

    /// Carries a request out.
    pub fn asked(&mut self, request: &Request) {
        match request {
            Request::Set { node, param, value } => {
                let node = self.layout.nodes.iter_mut().find(|x| x.id == *node);
                let live = node.and_then(|x| x.live.iter_mut().find(|x| x.name == *param));
                live.expect("requests are checked before").value = *value;
            }
            Request::Material { name, .. } => self.layout.materials[0].chosen = name.clone(),
            other => panic!("{other:?} is carried out at once"),
        }
    }

    /// The next view, a sixtieth of a second after the one before.
    pub fn view(&mut self) -> View {
        let seconds = self.number as f64 / FPS as f64;
        let ticks = self.number * 500 / FPS;
        // A stroke to and fro that rests now and then.
        let rests = seconds % 7.0 > 5.5;
        let speed = if rests { 0.0 } else { 90.0 * (2.0 * seconds).sin().abs() };
        let active = speed > 5.0;
        let counts: Vec<u64> =
            (0..=EDGES_US.len() as u64).map(|bin| ticks >> (2 * bin.abs_diff(4))).collect();
        let scopes = self.layout.scopes.iter().map(|scope| {
            let rate = u64::from(scope.rate_hz);
            let wave = |n: u64| speed * (0.02 * n as f64).sin() / 20.0;
            (self.number * rate / FPS..(self.number + 1) * rate / FPS).map(|n| wave(n) as f32).collect()
        });
        let scopes = scopes.collect();
        let nodes = self.layout.nodes.iter().enumerate().map(|(i, node)| {
            let sleeps = (4..=7).contains(&i) && !active;
            let fault = i == 12 && seconds > 6.0;
            NodeView {
                us: 0.3 + i as f64,
                max_us: 1.0 + 4.0 * i as f64,
                // The calls of a sleeping node stand still.
                calls: if sleeps { 1000 } else { ticks + 2000 },
                slept: if sleeps { ticks } else { 0 },
                faults: if fault { 8 } else { 0 },
                last_fault: if fault { "output 0 is not a number".into() } else { String::new() },
                quarantined: fault,
                values: vec![speed as f32; node.outputs.len()],
            }
        });
        let nodes = nodes.collect();
        self.number += 1;
        View {
            number: self.number,
            muted: self.muted,
            strength: self.strength,
            condition: match self.muted {
                true => Condition::Muted,
                false if seconds < 2.0 => Condition::Starting,
                false => Condition::Playing,
            },
            clock: "callback".into(),
            device: "hw:CARD=Device,DEV=0".into(),
            period_frames: 64,
            ticks,
            seconds,
            timing: TimingView {
                deadline_us: 2000.0,
                late_us: [14.2, 24.7, 231.0, 3140.0],
                compute_us: [48.3, 71.0, 118.0, 402.0],
                edges_us: EDGES_US.to_vec(),
                late_counts: counts.clone(),
                compute_counts: counts,
                ..TimingView::default()
            },
            underruns: u64::from(seconds > 5.0),
            nodes,
            sources: vec![SourceView {
                id: "stylus".into(),
                age_ms: 1.3,
                delay_ms: 4.0,
                ..SourceView::default()
            }],
            scopes,
            latency_ms: [("input", 4.0), ("tick", 1.0), ("device", 2.67)]
                .map(|(what, ms)| (what.to_owned(), ms))
                .into(),
            peak: if active && !self.muted { 0.31 } else { 0.0 },
            ..View::default()
        }
    }
}

/// A node with ports, each a name and a unit: `position mm, force N`.
fn node(id: &str, kind: &str, inputs: &str, outputs: &str) -> NodeLayout {
    let ports = |list: &str| {
        let port = |port: &str| port.split_once(' ').map(|(name, unit)| [name.to_owned(), unit.to_owned()]);
        list.split(", ").filter_map(port).collect::<Vec<_>>()
    };
    NodeLayout {
        id: id.into(),
        kind: kind.into(),
        inputs: ports(inputs),
        outputs: ports(outputs),
        sink: outputs.is_empty(),
        ..NodeLayout::default()
    }
}

fn live(name: &str, value: f64, [least, most]: [f64; 2], unit: &str) -> LiveLayout {
    LiveLayout { name: name.into(), value, least, most, unit: unit.into(), ..LiveLayout::default() }
}

fn words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

/// Materials and their families.
const MATERIALS: [[&str; 2]; 5] = [
    ["canvas", "weave"],
    ["fine weave", "weave"],
    ["felt", "wool"],
    ["sandpaper 120", "sandpaper"],
    ["ribbed glass", "glass"],
];

/// The graph of Heravi et al. 2024 with a pointer for a stylus, and a probe.
pub fn layout() -> Layout {
    let mut nodes = vec![
        node("stylus", "pointer_input", "", "position mm, pressure "),
        node("motion", "velocity", "position mm", "velocity mm/s, speed mm/s"),
        node("floor", "virtual_floor", "position mm", "force N"),
        node("history", "action_history", "force N, velocity mm/s", "velocity mm/s, force N"),
        node("texture", "texture_network", "force N, velocity mm/s", "magnitude m/s²"),
        node("phase", "spsi", "magnitude m/s²", "spectrum m/s²"),
        node("synthesis", "overlap_add", "spectrum m/s²", "out m/s²"),
        node("audio rate", "resample", "in m/s²", "out m/s²"),
        node("gate", "speed_gate", "in m/s², speed mm/s, force N", "out m/s², active "),
        node("inverse", "actuator_inverse", "acceleration m/s²", "current A"),
        node("limiter", "limiter", "current A", "current A"),
        node("out", "audio_out", "current A", ""),
        node("watched speed", "probe", "in mm/s", "value mm/s"),
    ];
    nodes[2].live = vec![
        live("stiffness_n_per_mm", 0.5, [0.05, 2.0], "N/mm"),
        live("max_force_n", 3.3, [0.1, 10.0], "N"),
    ];
    nodes[4].live = vec![live("gain", 1.0, [0.0, 4.0], "")];
    let locks = live("lock_phases", 1.0, [0.0, 1.0], "");
    nodes[5].live = vec![LiveLayout { words: words(["off", "on"]), ..locks }];
    let fade = live("fade", 1.0, [0.0, 2.0], "");
    nodes[8].live = vec![
        live("speed_mm_s", 5.0, [0.01, 500.0], "mm/s"),
        LiveLayout { words: words(["linear", "cosine", "square root"]), ..fade },
    ];
    let scope =
        |name: &str, unit: &str, rate_hz| ScopeLayout { name: name.into(), unit: unit.into(), rate_hz };
    let wires = "0 0 1 0, 0 0 2 0, 2 0 3 0, 1 0 3 1, 3 1 4 0, 3 0 4 1, 4 0 5 0, 5 0 6 0, 6 0 7 0, 7 0 8 0, \
                 1 1 8 1, 2 0 8 2, 8 0 9 0, 9 0 10 0, 10 0 11 0, 1 1 12 0";
    let wire = |wire: &str| {
        let ends: Vec<usize> = wire.split(' ').map(|n| n.parse().expect("a number")).collect();
        ends.try_into().expect("node and output, node and input")
    };
    Layout {
        file: "heravi2024_pointer.ron".into(),
        tick_hz: 500,
        audio_hz: 48000,
        nodes,
        wires: wires.split(", ").map(wire).collect(),
        scopes: vec![
            scope("speed", "mm/s", 500),
            scope("force", "N", 500),
            scope("acceleration", "m/s²", 48000),
            scope("current", "A", 48000),
        ],
        materials: vec![Materials {
            node: "texture".into(),
            chosen: "canvas".into(),
            names: MATERIALS.map(|[name, ..]| name.to_owned()).into(),
            gallery: MATERIALS
                .map(|[name, family]| Material {
                    name: name.into(),
                    family: family.into(),
                    ..Material::default()
                })
                .into(),
        }],
        ..Layout::default()
    }
}
