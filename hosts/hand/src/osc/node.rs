//! `osc_input`: a hand over the network.

use asperity_live::place;
use asperity_node::{Descriptor, Diagnostic, Node, Param, Prepared, Processor, Setup, Status, Tick, Unit};

use crate::node::{hand, pass_on};

/// A stylus whose position comes by Open Sound Control over UDP.
pub(super) struct OscInput {
    /// Force of a message's 1 \[N\]: a force counts as it is, a pressure of 1 is the largest force.
    newton: f64,
}

impl Node for OscInput {
    fn descriptor() -> Descriptor {
        let it = Descriptor::new("osc_input", "A stylus that some other program tracks, over OSC (UDP).")
            .param(Param::text("listen", "127.0.0.1:9000", "Address and port to listen at."))
            .param(Param::flag(
                "anywhere",
                false,
                "Listen at an address that other machines reach, too. Anybody there can then move the \
                 actuator.",
            ))
            .param(Param::text("address", "/stylus", "OSC address, or an OSC 1.0 pattern of addresses."))
            .param(Param::text(
                "arguments",
                "x_mm, y_mm, z_mm",
                "What each argument of a message is, with its unit: x, y, z in mm, cm or m; force_n; \
                 pressure (0 to 1); touch (0 or 1); time_ms; `_` for one that means nothing here; a minus \
                 turns an axis round.",
            ))
            .param(
                Param::number(
                    "max_force_n",
                    3.3,
                    0.0..=100.0,
                    "Force at full pressure, where messages say a pressure.",
                )
                .unit("N"),
            );
        hand(it, (Unit::NEWTON, "how hard it presses, where a message says so"))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let arguments = p.text("arguments");
        let says = ["force", "pressure"].iter().any(|word| arguments.contains(word));
        if setup.outputs[place::FORCE].connected && !says {
            let message = format!("`{}.force` is wired, but no argument of a message says it", setup.id);
            return Err(p
                .error("arguments", message)
                .help("send force_n too, or compute it with virtual_floor"));
        }
        let newton = if arguments.contains("pressure") { p.number("max_force_n") } else { 1.0 };
        Ok(Prepared::new(Self { newton }))
    }
}

impl Processor for OscInput {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let status = pass_on(tick);
        tick.outputs.set(place::FORCE, tick.inputs.value(place::FORCE) * self.newton);
        status
    }

    fn reset(&mut self) {}
}
