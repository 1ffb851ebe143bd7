//! `relief`: a texture straight from heights under the tip.

mod follow;
mod spline;

use std::sync::Arc;

use crate::ports::{Doc, number};
use asperity_node::{Acts, Descriptor, Diagnostic, Effect, Form, Node, Prepared, Settings, Setup, State};
use asperity_scene::Heights;

use super::gliding::{self, Gained};
use super::path::{Parts, Path};
use super::{Made, each, gain, made, shared};
pub(super) use follow::{Follower, Jet, ReliefSettings, Surface};
pub(super) use spline::HeightSpline;

/// The acceleration of a tip that rises and falls with the heights under it. Slots with the same heights
/// share one copy of them.
pub struct Relief;

/// Heights with the state of their reading.
#[derive(Clone)]
struct Field {
    relief: Follower,
    heights: Arc<HeightSpline>,
}

impl gliding::Kernel for Field {
    fn process(&mut self, path: &Path, parts: &Parts, out: &mut [f64]) {
        self.relief.process(&*self.heights, path, parts, out);
    }

    fn reset(&mut self) {
        self.relief.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.relief.state(state);
    }
}

fn effect() -> Effect {
    let usual = ReliefSettings::default();
    Effect::new("reliefs", Acts::Gliding)
        .form(
            Form::new("", "relief(heights: made(surface: \"hessian\"))")
                .nested("heights")
                .field(
                    number("cutoff_hz", usual.cutoff_hz, 20.0..=20_000.0, "Hz").doc("cutoff of the low-pass"),
                )
                .field(number("max_m_s2", usual.max_m_s2, 0.1..=1e4, "m/s^2").doc("the largest acceleration"))
                .field(gain()),
        )
        .check(|settings| heights(settings).map(drop))
}

fn heights(settings: &Settings) -> Result<Heights, Diagnostic> {
    let Some(heights) = settings.nested("heights") else {
        return Err(settings
            .node_error("a relief needs `heights`")
            .help("relief(heights: made(surface: \"hessian\"))"));
    };
    Heights::parse(heights)
}

impl Node for Relief {
    fn descriptor() -> Descriptor {
        gliding::descriptor(
            ("relief", "A texture straight from the heights under the tip, as acceleration."),
            "which of `reliefs`, from 0; below 0 none is felt",
            (
                "reliefs",
                "Reliefs, each a text as behind `texture` in a scene; or a list of them, `[relief(..), \
                 relief(..)]`, whose sum is one entry. Quotes within a text are written r#\"..\"#.",
            ),
            effect(),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut fields = Made::default();
        let reliefs = each(setup, |settings| {
            let (cutoff_hz, max_m_s2) = (settings.number("cutoff_hz"), settings.number("max_m_s2"));
            let relief = Follower::new(ReliefSettings { cutoff_hz, max_m_s2 }, setup.audio_hz);
            let relief = made(settings, relief)?;
            let heights = heights(settings)?;
            let field = || heights.field().map(|field| HeightSpline::new(&field));
            let heights = shared(&mut fields, format!("{heights:?}"), field)?;
            Ok(Gained { kernel: Field { relief, heights }, gain: settings.number("gain") })
        })?;
        gliding::prepare(setup, reliefs, ("height_fields", fields.len() as u64))
    }
}
