//! A stylus that does what no hand does, or whose places come late, twice or not at all.

use asperity_stability::wrap;

use crate::{fails, graph, holds, subject};

#[test]
fn teleport() {
    let graph = graph("texture.ron");
    let subject = subject(Some(&graph));
    holds("teleport", &subject);
    // A velocity that keeps something of every jump.
    let kind = subject.kind("velocity").expect("the kind");
    let mutant = wrap::wrap(
        kind,
        std::sync::Arc::new(|_| {
            let (mut before, mut kept) = (0.0, 0.0);
            Box::new(move |node, tick| {
                let x = tick.inputs.control(0)[0];
                if tick.index > 1 && f64::abs(x - before) > 50.0 {
                    kept = 30.0;
                }
                before = x;
                let status = node.process(tick)?;
                tick.outputs.control(0)[0] += kept;
                tick.outputs.control(1)[0] += kept;
                Ok(status)
            })
        }),
    );
    fails("teleport", &subject.clone().with(mutant), "without the jump");
}
