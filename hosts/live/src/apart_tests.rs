use super::*;

fn audio(samples: [f32; 4]) -> Buffer {
    Buffer::Audio { samples: samples.into(), len: 4, valid: true, silent: false }
}

/// Calls a node once, over one input and one output.
fn process(node: &mut Apart, input: [f32; 4]) -> (Result<Status, Fault>, Buffer) {
    let node: &mut dyn Processor = node;
    let (inputs, mut outputs) = ([audio(input)], [audio([0.0; 4])]);
    let map = [InputRef { buffer: 0, connected: true }];
    let answer = node.run(&mut Tick {
        index: 7,
        tick_hz: 500,
        inputs: Inputs::new(&inputs, &[], 1, &map),
        outputs: Outputs::new(&mut outputs),
    });
    let [output] = outputs;
    (answer, output)
}

fn start(node: impl Processor + 'static) -> Apart {
    let desk = Desk::over(vec![audio([0.0; 4])], vec![audio([0.0; 4])]);
    Apart::start(Box::new(node), desk, "node", None).unwrap()
}

/// Doubles; a negative sample makes it panic, one above 100 keeps it for ever.
struct Doubler;

impl Processor for Doubler {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let first = tick.inputs.audio(0)[0];
        if first < 0.0 {
            // Without a message, which takes long on a busy machine.
            std::panic::resume_unwind(Box::new("a panic"));
        }
        if first > 100.0 {
            loop {
                std::thread::park();
            }
        }
        assert!(tick.index == 7 && tick.inputs.connected(0));
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *y = 2.0 * x;
        }
        Status::Tail(3)
    }

    fn reset(&mut self) {}
}

fn samples(buffer: &Buffer) -> &[f32] {
    let Buffer::Audio { samples, len, .. } = buffer else { panic!("audio") };
    &samples[..*len]
}

#[test]
fn node_apart_is_given_the_data_of_a_tick() {
    let mut node = start(Doubler);
    for _ in 0..3 {
        let (answer, output) = process(&mut node, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(answer, Ok(Status::Tail(3)));
        assert_eq!(samples(&output), [2.0, 4.0, 6.0, 8.0]);
    }
}

#[test]
fn stuck_node_is_left_and_its_outputs_stay() {
    let mut node = start(Doubler);
    let (answer, output) = process(&mut node, [101.0; 4]);
    assert_eq!(answer, Err(Fault::Stuck));
    assert_eq!(samples(&output), [0.0; 4], "of their length, and silent");
    // From here on nobody waits.
    let begun = Instant::now();
    for _ in 0..100 {
        let (answer, output) = process(&mut node, [1.0; 4]);
        assert_eq!((answer, samples(&output)), (Err(Fault::Stuck), [0.0; 4].as_slice()));
    }
    let it: &mut dyn Processor = &mut node;
    assert_eq!((it.ask(|n| n.reset()), it.state_size()), (Err(Fault::Stuck), 0));
    assert!(it.save(&mut [0]).is_none() && !it.restore(&[0]) && it.facts().is_empty());
    drop(node);
    assert!(begun.elapsed() < 50 * PATIENCE, "calls were waited for, after the first");
}

#[test]
fn panicking_node_counts_a_fault_and_goes_on() {
    let mut node = start(Doubler);
    assert_eq!(process(&mut node, [-1.0; 4]).0, Err(Fault::Panicked));
    let (answer, output) = process(&mut node, [1.0; 4]);
    assert_eq!((answer, samples(&output)), (Ok(Status::Tail(3)), [2.0; 4].as_slice()));
}

#[test]
fn stuck_drop_of_a_node_is_left() {
    struct Endless;
    impl Processor for Endless {
        fn process(&mut self, _: &mut Tick<'_>) -> Status {
            Status::Continue
        }
        fn reset(&mut self) {}
    }
    impl Drop for Endless {
        fn drop(&mut self) {
            loop {
                std::thread::park();
            }
        }
    }
    let mut node = start(Endless);
    assert_eq!(process(&mut node, [0.0; 4]).0, Ok(Status::Continue));
    drop(node);
}
