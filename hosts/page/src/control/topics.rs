//! Topics: figures of a run, for those who subscribed to them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_live::RunControl;
use asperity_live::view::{Layout, View};

use super::table::Way;
use super::{Answer, MESSAGES, RATE_HZ, Value};

/// How much too early a message may be: figures come every sixtieth of a second.
const EARLY: Duration = Duration::from_millis(8);

/// The newest figures that topics are made of.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figures {
    /// Time of the run in s.
    pub(crate) at_s: f64,
    position: Option<[f32; 3]>,
    force: Option<f32>,
    speed: Option<f32>,
    peak: f32,
    /// Ticks, misses, skipped ticks, underruns, xruns.
    counts: [u64; 5],
    /// 99th percentiles of lateness and computing time.
    p99_us: [f64; 2],
    /// Nodes that failed: how often, and how last.
    faults: BTreeMap<String, (u64, String)>,
}

impl Figures {
    /// Takes over the figures of a view.
    pub(crate) fn take(&mut self, view: &View, layout: &Layout) {
        self.at_s = view.seconds;
        self.position = view.stylus_mm;
        self.peak = view.peak;
        self.counts = [view.ticks, view.timing.misses, view.skipped_ticks, view.underruns, view.xruns];
        self.p99_us = [view.timing.late_us[1], view.timing.compute_us[1]];
        if view.layout != layout.number {
            return;
        }
        let scope = |name: &str, before: Option<f32>| {
            let at = layout.scopes.iter().position(|scope| scope.name == name)?;
            view.scopes.get(at).and_then(|new| new.last().copied()).or(before).or(Some(0.0))
        };
        (self.force, self.speed) = (scope("force", self.force), scope("speed", self.speed));
        let failed = layout.nodes.iter().zip(&view.nodes).filter(|(_, seen)| seen.faults > 0);
        self.faults =
            failed.map(|(node, seen)| (node.id.clone(), (seen.faults, seen.last_fault.clone()))).collect();
    }
}

/// A topic that a client wants.
#[derive(Debug)]
struct Subscription {
    topic: &'static str,
    every: Duration,
    due: Instant,
}

/// All topics that a client wants.
#[derive(Debug, Default)]
pub(crate) struct Subscriptions {
    all: Vec<Subscription>,
    /// Faults of each node, and number of changes, that the client knows.
    faults: BTreeMap<String, u64>,
    changes: usize,
}

impl Subscriptions {
    /// Subscribes to a topic, or ends that at rate 0. `changes`: number of those that were made so far.
    pub(crate) fn subscribe(
        &mut self,
        topic: &str,
        rate_hz: f64,
        changes: usize,
        figures: &Figures,
    ) -> Result<(), Diagnostic> {
        let topics = || MESSAGES.iter().filter(|m| matches!(m.way, Way::Topic)).map(|m| m.name);
        let Some(topic) = topics().find(|known| *known == topic) else {
            let what = format!("there is no topic `{topic}`");
            return Err(Diagnostic::new(what).help(one_of(topic, topics())));
        };
        if !(0.0..=RATE_HZ).contains(&rate_hz) || (rate_hz > 0.0 && rate_hz < 0.01) {
            let help = format!("0.01 to {RATE_HZ} Hz, or 0 to end it; a recording has every tick");
            return Err(Diagnostic::new(format!("a rate of {rate_hz} Hz is out of range")).help(help));
        }
        let missing = match topic {
            "position" => figures.position.is_none(),
            "force" => figures.force.is_none(),
            "speed" => figures.speed.is_none(),
            _ => false,
        };
        if missing && rate_hz > 0.0 {
            let help = "no node has such an output, or the first tick has not run: try again";
            return Err(Diagnostic::new(format!("this graph has no {topic}")).help(help));
        }
        self.all.retain(|one| one.topic != topic);
        if topic == "changes" {
            self.changes = changes;
        }
        if rate_hz > 0.0 {
            let every = Duration::from_secs_f64(1.0 / rate_hz);
            self.all.push(Subscription { topic, every, due: Instant::now() });
        }
        Ok(())
    }

    /// Messages that are due now.
    pub(crate) fn due(&mut self, now: Instant, figures: &Figures, run_control: &RunControl) -> Vec<Answer> {
        let mut out = Vec::new();
        for at in 0..self.all.len() {
            let one = &mut self.all[at];
            if now + EARLY < one.due {
                continue;
            }
            one.due = (one.due + one.every).max(now);
            let topic = one.topic;
            out.extend(self.messages(topic, figures, run_control));
        }
        out
    }

    fn messages(&mut self, topic: &'static str, figures: &Figures, run_control: &RunControl) -> Vec<Answer> {
        let number = Value::single;
        let answer = |at_s: f64, values: Vec<Value>| Answer {
            name: topic,
            values: [Value::Number(at_s)].into_iter().chain(values).collect(),
        };
        let now = |values: Vec<Value>| vec![answer(figures.at_s, values)];
        match topic {
            "position" => figures.position.map_or_else(Vec::new, |p| now(p.map(number).to_vec())),
            "force" => figures.force.map_or_else(Vec::new, |x| now(vec![number(x)])),
            "speed" => figures.speed.map_or_else(Vec::new, |x| now(vec![number(x)])),
            "drive" => now(vec![number(figures.peak)]),
            "meters" => {
                let counts = figures.counts.map(|count| Value::Whole(count as i64));
                now(counts.into_iter().chain(figures.p99_us.map(Value::Number)).collect())
            }
            "faults" => {
                let new =
                    figures.faults.iter().filter(|(node, fault)| self.faults.get(*node) != Some(&fault.0));
                let fault = |(node, (count, fault)): (&String, &(u64, String))| {
                    let count = Value::Whole(*count as i64);
                    answer(figures.at_s, vec![Value::Text(node.clone()), count, Value::Text(fault.clone())])
                };
                let out = new.map(fault).collect();
                self.faults = figures.faults.iter().map(|(node, fault)| (node.clone(), fault.0)).collect();
                out
            }
            _ => {
                let new = run_control.changes(self.changes);
                self.changes += new.len();
                let change = |c: asperity_live::view::Change| {
                    answer(c.at_s, vec![Value::Text(c.what), Value::Text(c.by)])
                };
                new.into_iter().map(change).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::fits;
    use super::*;
    use asperity_live::view::{NodeLayout, NodeView, ScopeLayout};

    fn figures(faults: u64) -> Figures {
        let scope = |name: &str| ScopeLayout { name: name.into(), ..ScopeLayout::default() };
        let node = NodeLayout { id: "phase".into(), ..NodeLayout::default() };
        let layout =
            Layout { scopes: vec![scope("speed"), scope("force")], nodes: vec![node], ..Layout::default() };
        let view = View {
            seconds: 2.5,
            stylus_mm: Some([1.0, 2.0, -3.0]),
            scopes: vec![vec![1.0, 80.0], vec![]],
            nodes: vec![NodeView { faults, last_fault: "odd".into(), ..NodeView::default() }],
            ..View::default()
        };
        let mut figures = Figures::default();
        figures.take(&view, &layout);
        figures
    }

    #[test]
    fn topics_come_at_their_rate_and_as_the_table_lists_them() {
        let (run_control, now) = (RunControl::default(), Instant::now());
        let mut it = Subscriptions::default();
        let figures = figures(3);
        for message in MESSAGES.iter().filter(|m| matches!(m.way, Way::Topic)) {
            it.subscribe(message.name, 10.0, 0, &figures).expect(message.name);
        }
        run_control.list("marker here".into(), "somebody");
        let mut names = Vec::new();
        for frame in 0..60 {
            let due = it.due(now + Duration::from_micros(16_667 * frame), &figures, &run_control);
            assert!(due.iter().all(fits), "{due:?}");
            names.extend(due.iter().map(|answer| answer.name));
        }
        let count = |name| names.iter().filter(|n| **n == name).count();
        for name in ["position", "force", "speed", "drive", "meters"] {
            assert_eq!(count(name), 10, "{name}");
        }
        assert_eq!((count("faults"), count("changes")), (1, 1), "only news");
        let speed = it.messages("speed", &figures, &run_control);
        assert_eq!(speed[0].json(), r#"{"speed":[2.5,80.0]}"#);
        it.subscribe("speed", 0.0, 0, &figures).expect("it ends");
        assert_eq!(it.all.len(), 6);
    }

    #[test]
    fn unknown_topic_odd_rate_or_missing_signal_is_refused() {
        let mut it = Subscriptions::default();
        for (topic, rate, what) in [
            ("forces", 1.0, "no topic"),
            ("done", 1.0, "no topic"),
            ("drive", 61.0, "out of range"),
            ("drive", -1.0, "out of range"),
            ("drive", f64::NAN, "out of range"),
            ("force", 10.0, "has no force"),
        ] {
            let why = it.subscribe(topic, rate, 0, &Figures::default()).expect_err(topic);
            assert!(why.message.contains(what), "{topic} {rate}: {why}");
        }
        assert!(it.all.is_empty());
    }
}
