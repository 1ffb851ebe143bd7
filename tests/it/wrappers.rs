//! A wrapped node hears every call that the node itself hears, and its answers come back.

use std::sync::{Arc, Mutex};

use asperity_checks::wrap::wrap;
use asperity_node::{
    Config, Descriptor, Fact, Fault, Inputs, Latency, NodeKind, Outputs, Params, Prepared, Processor, Setup,
    State, Status, Tick,
};

/// Calls that a node heard.
type Heard = Arc<Mutex<Vec<String>>>;

/// Notes every call, and answers each with something that is no default. Resets fail.
struct Witness(Heard, Option<Fault>);

impl Witness {
    fn note(&self, call: impl Into<String>) {
        self.0.lock().expect("nobody panicked").push(call.into());
    }
}

// A new call has to be noted here, and made in `all_calls`.
#[warn(clippy::missing_trait_methods)]
impl Processor for Witness {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.note(format!("process {}", tick.index));
        Status::Tail(tick.index)
    }
    fn reset(&mut self) {
        self.note("reset");
        self.1 = Some(Fault::Failed(9));
    }
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        self.note(format!("wants {}", tick.index));
        false
    }
    fn absorb(&mut self, tick: &mut Tick<'_>) {
        self.note(format!("absorb {}", tick.index));
    }
    fn elapsed(&mut self, ticks: u64) {
        self.note(format!("elapsed {ticks}"));
    }
    fn set_parameter(&mut self, index: usize, value: f64) {
        self.note(format!("set_parameter {index} {value}"));
    }
    fn state(&mut self, state: &mut State<'_>) {
        self.note("state");
        state.keep(&mut 7_u8);
    }
    fn facts(&mut self) -> Vec<Fact> {
        self.note("facts");
        vec![Fact::count("answer", 42)]
    }
    fn warm(&mut self, heat: f64) {
        self.note(format!("warm {heat}"));
    }
    fn attenuate(&mut self, strength: f32) {
        self.note(format!("attenuate {strength}"));
    }
    fn fault(&mut self) -> Option<Fault> {
        self.1.take()
    }
    fn inner(&mut self, _: &mut dyn FnMut(&mut dyn Processor)) {
        self.note("inner");
    }
}

/// Makes every call, and answers what was heard and answered.
fn all_calls(node: &mut dyn Processor, heard: &Heard) -> String {
    let tick = |index| Tick {
        index,
        tick_hz: 500,
        inputs: Inputs::new(&[], &[], 0, &[]),
        outputs: Outputs::new(&mut []),
    };
    let mut answers = format!("{:?} ", node.ask(|n| n.process(&mut tick(1))));
    answers += &format!("{:?} ", node.ask(|n| n.wants(&mut tick(2))));
    answers += &format!("{:?} ", node.ask(|n| n.absorb(&mut tick(3))));
    answers += &format!("{:?} ", node.ask(|n| n.reset()));
    answers += &format!("{:?} ", node.ask(|n| n.elapsed(4)));
    answers += &format!("{:?} ", node.ask(|n| n.set_parameter(5, 6.0)));
    answers += &format!("{:?} ", node.ask(|n| n.warm(7.0)));
    answers += &format!("{:?} ", node.ask(|n| n.attenuate(0.5)));
    let mut bytes = vec![0; node.state_size()];
    answers += &format!("{:?} {bytes:?} ", node.save(&mut bytes));
    answers += &format!("{} {} ", node.restore(&bytes), node.restore(&[]));
    answers += &format!("{:?}", node.facts());
    format!("{:?} {answers}", heard.lock().expect("nobody panicked"))
}

/// A wrapper that forgot to name the node inside.
struct Forgetful(Box<dyn Processor>);

impl Processor for Forgetful {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.0.process(tick)
    }
    fn reset(&mut self) {
        self.0.reset();
    }
}

/// A kind of witnesses, and what they heard.
fn witness() -> (Arc<NodeKind>, Heard) {
    let heard = Heard::default();
    let hears = heard.clone();
    let kind = NodeKind::new(Descriptor::new("witness", "Hears every call."), move |_| {
        let it = Prepared::new(Witness(hears.clone(), None))
            .latency(Latency::ratio(1, 2))
            .tail(Latency::ratio(3, 1));
        let it = it.duration(Some(Latency::ratio(5, 1))).files(vec!["file".into()]).guard(|| unreachable!());
        Ok(Prepared { allocation_free: false, ..it })
    });
    (Arc::new(kind.from_plugin("a plugin".into(), 8)), heard)
}

/// All that is seen of a kind and of a node of it.
fn seen(kind: &NodeKind, heard: &Heard) -> String {
    let params = Params::new(None);
    let config = Config { id: "it", params: &params, tick_hz: 500, every: 1, audio_hz: 48_000, seed: 1 };
    let setup = Setup { config, inputs: &[], outputs: &[], closes_cycle: false };
    let mut node = kind.prepare(&setup).expect("it prepares");
    let calls = all_calls(&mut *node.processor, heard);
    let Prepared { latency, tail, duration, allocation_free, files, guard, .. } = node;
    let kind = format!("{} {} {}", kind.descriptor().kind, kind.origin(), kind.build());
    format!(
        "{kind} {latency:?} {tail:?} {duration:?} {allocation_free} {files:?} {} {calls}",
        guard.is_some()
    )
}

#[test]
fn wrapped_node_hears_every_call() {
    let (kind, heard) = witness();
    let plain = seen(&kind, &heard);
    assert!(plain.contains("warm 7") && plain.contains("Err(Failed(9))"), "{plain}");
    let through = wrap(kind.clone(), |_| Box::new(|node, tick| Ok(node.process(tick))));
    let apart = asperity_live::apart(kind.clone(), None);
    for (name, wrapped) in [("wrap", through), ("apart", apart)] {
        heard.lock().expect("nobody panicked").clear();
        assert_eq!(seen(&wrapped, &heard), plain, "{name}");
    }
    let forgetful = NodeKind::clone(&kind)
        .wrapped(|_, node| Ok(Prepared { processor: Box::new(Forgetful(node.processor)), ..node }));
    heard.lock().expect("nobody panicked").clear();
    assert_ne!(seen(&forgetful, &heard), plain, "calls that are dropped are noticed");
}
