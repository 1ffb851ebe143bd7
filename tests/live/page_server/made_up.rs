//! A run that is made up, for the page to show: the graph of a texture under a stylus, with figures that move
//! as those of a real run do.
// The tests and the example each use a part.

use asperity_live::view::{
    Condition, Layout, LiveLayout, Materials, NodeLayout, NodeView, Request, ScopeLayout, SourceView,
    TimingView, View,
};

/// Views a second.
const FPS: u64 = 60;
const EDGES_US: [f64; 20] = [
    1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 20.0, 32.0, 50.0, 80.0, 130.0, 200.0, 320.0, 500.0, 800.0, 1300.0, 2000.0,
    3200.0, 5000.0, 8000.0,
];

pub struct Run {
    pub layout: Layout,
    pub muted: bool,
    number: u64,
    samples: [u64; 4],
    phase: f64,
    late: Vec<u64>,
    compute: Vec<u64>,
    random: u64,
}

impl Run {
    pub fn new() -> Self {
        Self {
            layout: layout(),
            muted: false,
            number: 0,
            samples: [0; 4],
            phase: 0.0,
            late: vec![0; EDGES_US.len() + 1],
            compute: vec![0; EDGES_US.len() + 1],
            random: 1,
        }
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
        }
    }

    /// The next view, a sixtieth of a second after the one before.
    pub fn view(&mut self) -> View {
        let seconds = self.number as f64 / FPS as f64;
        let (speed, force) = motion(seconds);
        let active = speed > 5.0 && force > 0.05;
        let ticks = self.number * 500 / FPS;
        let scopes = self.scopes(speed, force, active);
        self.time_ticks();
        self.number += 1;
        let values = Self::values(speed, force, active);
        let nodes =
            values.into_iter().enumerate().map(|(i, values)| self.node(i, values, ticks, active, seconds));
        let nodes: Vec<NodeView> = nodes.collect();
        View {
            number: self.number,
            layout: 0,
            muted: self.muted,
            condition: if self.muted {
                Condition::Muted
            } else if seconds < 2.0 {
                Condition::Starting
            } else {
                Condition::Playing
            },
            clock: "callback".into(),
            device: "hw:CARD=Device,DEV=0".into(),
            period_frames: 64,
            ticks,
            seconds,
            timing: TimingView {
                deadline_us: 2000.0,
                misses: self.compute[17..].iter().chain(&self.late[17..]).sum(),
                woke_late: self.late[17..].iter().sum(),
                late_us: [14.2, 24.7, 231.0, 3140.0],
                compute_us: [48.3, 71.0, 118.0, 402.0],
                recovery_us: [0.0; 4],
                edges_us: EDGES_US.to_vec(),
                late_counts: self.late.clone(),
                compute_counts: self.compute.clone(),
            },
            underruns: u64::from(seconds > 5.0),
            lost_samples: if seconds > 5.0 { 64 } else { 0 },
            faults: nodes.iter().map(|x| x.faults).sum(),
            nodes,
            sources: vec![SourceView {
                id: "stylus".into(),
                age_ms: 1.3 + 0.2 * (seconds * 3.0).sin(),
                delay_ms: 4.0,
                ..SourceView::default()
            }],
            scopes,
            latency_ms: [
                ("input", 4.0),
                ("tick", 1.0),
                ("motion's filter", 11.2),
                ("overlap-add", 0.0),
                ("resampler", 1.86),
                ("ring", 0.0),
                ("device", 2.67),
            ]
            .map(|(what, ms)| (what.to_owned(), ms))
            .into(),
            peak: if active && !self.muted { 0.31 } else { 0.0 },
            ..View::default()
        }
    }

    fn noise(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }

    fn scopes(&mut self, speed: f64, force: f64, active: bool) -> Vec<Vec<f32>> {
        let rates = [500, 500, 48000, 48000];
        let mut all = Vec::new();
        let mut accelerations = Vec::new();
        for (place, rate) in rates.into_iter().enumerate() {
            let until = (self.number + 1) * rate / FPS;
            let n = (until - self.samples[place]) as usize;
            self.samples[place] = until;
            all.push(match place {
                0 => (0..n).map(|_| (speed + 0.8 * self.noise()).max(0.0) as f32).collect(),
                1 => (0..n).map(|_| (force * (1.0 + 0.01 * self.noise())) as f32).collect(),
                2 => {
                    accelerations =
                        (0..n).map(|_| self.acceleration(speed, force, active)).collect::<Vec<f64>>();
                    accelerations.iter().map(|&x| x as f32).collect()
                }
                _ => accelerations.iter().map(|x| if self.muted { 0.0 } else { (0.02 * x) as f32 }).collect(),
            });
        }
        all
    }

    fn acceleration(&mut self, speed: f64, force: f64, active: bool) -> f64 {
        self.phase += std::f64::consts::TAU * (speed / 0.45) / 48000.0;
        let (loud, noise) = (force.sqrt() * (speed / 90.0), self.noise());
        if active {
            loud * (4.0 * self.phase.sin() + 1.5 * (2.0 * self.phase).sin() + 0.9 * noise)
        } else {
            0.0
        }
    }

    fn time_ticks(&mut self) {
        for _ in 0..8 {
            let late = 14.0 * (0.5 * (self.noise() + self.noise())).exp();
            let late =
                if self.noise() > 0.9985 { 40.0 * late * (1.0 + self.noise().abs() * 4.0) } else { late };
            let compute = 48.0 * (0.4 * (self.noise() + self.noise())).exp();
            for (us, counts) in [(late, &mut self.late), (compute, &mut self.compute)] {
                counts[EDGES_US.partition_point(|&edge| edge < us)] += 1;
            }
        }
    }

    fn values(speed: f64, force: f64, active: bool) -> Vec<Vec<f32>> {
        let (speed, force) = (speed as f32, force as f32);
        let on = if active { 1.0 } else { 0.0 };
        vec![
            vec![0.0, force / 3.0],
            vec![speed, speed],
            vec![force],
            vec![speed, force],
            vec![0.42 * on],
            vec![0.42 * on],
            vec![2.1 * on],
            vec![2.1 * on],
            vec![2.1 * on, on],
            vec![0.04 * on],
            vec![0.04 * on],
            vec![],
            vec![speed],
        ]
    }

    fn node(&self, i: usize, values: Vec<f32>, ticks: u64, active: bool, seconds: f64) -> NodeView {
        let us = [0.4, 0.9, 0.3, 1.1, 21.4, 9.8, 4.2, 3.3, 0.8, 1.2, 2.2, 0.5, 0.2][i];
        let sleeps = (4..=7).contains(&i) && !active;
        // The calls of a sleeping node stand still.
        let calls = if sleeps { 1000 } else { ticks + 2000 };
        let fault = i == 12 && seconds > 6.0;
        NodeView {
            us,
            max_us: us * 3.7,
            calls,
            slept: if sleeps { ticks } else { 0 },
            faults: if fault { 8 } else { u64::from(i == 9 && seconds > 4.0) },
            last_fault: if fault { "output 0 is not a number".into() } else { String::new() },
            quarantined: fault,
            values,
        }
    }
}

/// Speed and force of a stroke to and fro that rests now and then.
fn motion(seconds: f64) -> (f64, f64) {
    if seconds % 7.0 > 5.5 {
        return (0.0, 0.0);
    }
    (90.0 * (2.0 * seconds).sin().abs(), 0.8 + 0.3 * (1.3 * seconds).sin())
}

fn node(id: &str, kind: &str, inputs: &[[&str; 2]], outputs: &[[&str; 2]]) -> NodeLayout {
    let own = |ports: &[[&str; 2]]| ports.iter().map(|port| port.map(str::to_owned)).collect();
    let sink = outputs.is_empty();
    NodeLayout {
        id: id.into(),
        kind: kind.into(),
        inputs: own(inputs),
        outputs: own(outputs),
        sink,
        ..NodeLayout::default()
    }
}

fn live(name: &str, value: f64, [least, most]: [f64; 2], unit: &str) -> LiveLayout {
    LiveLayout { name: name.into(), value, least, most, unit: unit.into(), ..LiveLayout::default() }
}

/// The graph of Heravi et al. 2024 with a pointer for a stylus, and a probe.
pub fn layout() -> Layout {
    let mut nodes = vec![
        node("stylus", "pointer_input", &[], &[["position", "mm"], ["pressure", ""]]),
        node("motion", "velocity", &[["position", "mm"]], &[["velocity", "mm/s"], ["speed", "mm/s"]]),
        node("floor", "virtual_floor", &[["position", "mm"]], &[["force", "N"]]),
        node(
            "history",
            "action_history",
            &[["force", "N"], ["velocity", "mm/s"]],
            &[["velocity", "mm/s"], ["force", "N"]],
        ),
        node("texture", "texture_network", &[["force", "N"], ["velocity", "mm/s"]], &[["magnitude", "m/s²"]]),
        node("phase", "spsi", &[["magnitude", "m/s²"]], &[["spectrum", "m/s²"]]),
        node("synthesis", "overlap_add", &[["spectrum", "m/s²"]], &[["out", "m/s²"]]),
        node("audio rate", "resample", &[["in", "m/s²"]], &[["out", "m/s²"]]),
        node(
            "gate",
            "speed_gate",
            &[["in", "m/s²"], ["speed", "mm/s"], ["force", "N"]],
            &[["out", "m/s²"], ["active", ""]],
        ),
        node("inverse", "actuator_inverse", &[["acceleration", "m/s²"]], &[["current", "A"]]),
        node("limiter", "limiter", &[["current", "A"]], &[["current", "A"]]),
        node("out", "audio_out", &[["current", "A"]], &[]),
        node("watched speed", "probe", &[["in", "mm/s"]], &[["value", "mm/s"]]),
    ];
    nodes[2].live = vec![
        live("stiffness_n_per_mm", 0.5, [0.05, 2.0], "N/mm"),
        live("max_force_n", 3.3, [0.1, 10.0], "N"),
    ];
    nodes[4].live = vec![live("gain", 1.0, [0.0, 4.0], "")];
    nodes[5].live = vec![LiveLayout {
        words: ["off", "on"].map(str::to_owned).into(),
        value: 1.0,
        ..live("lock_phases", 0.0, [0.0, 1.0], "")
    }];
    nodes[8].live = vec![
        live("speed_mm_s", 5.0, [0.01, 500.0], "mm/s"),
        LiveLayout {
            words: ["linear", "cosine", "square root"].map(str::to_owned).into(),
            ..live("fade", 1.0, [0.0, 2.0], "")
        },
    ];
    let scope =
        |name: &str, unit: &str, rate_hz| ScopeLayout { name: name.into(), unit: unit.into(), rate_hz };
    Layout {
        number: 0,
        file: "heravi2024_pointer.ron".into(),
        tick_hz: 500,
        audio_hz: 48000,
        nodes,
        wires: vec![
            [0, 0, 1, 0],
            [0, 0, 2, 0],
            [2, 0, 3, 0],
            [1, 0, 3, 1],
            [3, 1, 4, 0],
            [3, 0, 4, 1],
            [4, 0, 5, 0],
            [5, 0, 6, 0],
            [6, 0, 7, 0],
            [7, 0, 8, 0],
            [1, 1, 8, 1],
            [2, 0, 8, 2],
            [8, 0, 9, 0],
            [9, 0, 10, 0],
            [10, 0, 11, 0],
            [1, 1, 12, 0],
        ],
        scopes: vec![
            scope("speed", "mm/s", 500),
            scope("force", "N", 500),
            scope("acceleration", "m/s²", 48000),
            scope("current", "A", 48000),
        ],
        materials: vec![Materials {
            node: "texture".into(),
            chosen: "canvas".into(),
            names: ["canvas", "fine weave", "felt", "sandpaper 120", "ribbed glass"]
                .map(str::to_owned)
                .into(),
        }],
    }
}
