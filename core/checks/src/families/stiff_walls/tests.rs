use std::sync::Arc;

use super::*;
use crate::wrap::{Process, wrap};

/// Checks that less damping than the bound makes energy. Motions of constant speed from tick to tick take
/// out within 0.1 % of what K T/2 stands for at every frequency. With 0.8 of that damping a thrown device
/// leaves the wall faster than it came. Were it not so, `wall_inside_its_bound` would show nothing.
fn outside(wall: &mut Wall, near: &Near, _subject: &Subject<'_>) -> Found {
    let bound = near.needed_ns_per_m(0.0);
    holds(near.law.damping_ns_per_m == 0.0, || {
        format!("speed adds {:.3} N s/m to Hooke's force", near.law.damping_ns_per_m)
    })?;
    let found = swings(wall, near);
    holds(found.off_ns_per_m <= 1e-3 * bound, || {
        format!("a motion is {:.2e} N s/m off the closed form", found.off_ns_per_m)
    })?;
    holds(found.most_ns_per_m >= 0.999 * bound, || {
        format!("no motion takes out more than {:.4} N s/m; the bound is {bound:.4}", found.most_ns_per_m)
    })?;
    let gain = gained(wall, near, 0.8 * bound, (0, 1))?;
    Ok(format!(
        "every motion takes out {bound:.4} N s/m within {:.1e}; with 0.8 of it thrown devices gain \
         {gain:+.4} of their energy",
        found.off_ns_per_m
    ))
}

/// A floor that pushes harder by `n_per_mm` for each mm that the stylus has moved out since the last tick,
/// where that is further than `from_mm`.
fn by_way(subject: &Subject<'_>, from_mm: f64, n_per_mm: f64) -> Subject<'static> {
    let make = move |_: &asperity_node::Setup<'_>| -> Process {
        let mut before = 0.0;
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
            let (z, force) = (tick.inputs.control(0)[2], tick.outputs.control(0)[0]);
            if force > 0.0 && (z - before).abs() > from_mm {
                tick.outputs.set(0, (force + n_per_mm * (z - before)).max(0.0));
            }
            before = z;
            Ok(status)
        })
    };
    let floor = wrap(subject.kind("virtual_floor").expect("the kind"), Arc::new(make));
    Subject::new(subject.registry().clone()).with(floor)
}

#[test]
fn wall_outside_its_bound_makes_energy() {
    let subject = Subject::new(asperity_nodes::registry()).effort(Effort::Full);
    println!("{}", floor(&subject, "virtual_floor", outside).expect("it holds"));
    // Floors that answer the place of half a tick later make less energy: at all speeds, and at high speeds
    // only.
    for (from_mm, why) in [(0.0, "to Hooke's force"), (0.01, "off the closed form")] {
        match floor(&by_way(&subject, from_mm, -0.25), "virtual_floor", outside) {
            Err(Stop::Failed(found)) => assert!(found.contains(why), "another reason: {found}"),
            other => panic!("the mutant passes: {other:?}"),
        }
    }
}
