//! Vibration, from the effects to the actuator.

use crate::NETWORK;
use crate::space::Form as ShapeForm;
use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::{Kind as Form, Value};
use asperity_graph::Setting;
use asperity_node::{Acts, Effect, ShapeSpec};

use crate::lower::builder::{Builder, handed_on, number, setting, slot_port};

/// Nodes that acceleration passes on its way to the output.
pub(crate) const STAGES: [(&str, &str); 2] = [("inverse", "actuator_inverse"), ("limiter", "limiter")];
/// Rate at which a network's signal is synthesised unless the file sets it \[Hz\].
const SYNTHESIS_HZ: f64 = 2500.0;

impl Builder<'_> {
    /// Adds the effects that vibrate and the nodes that play them.
    pub(crate) fn acoustic(&mut self) -> Result<(), Diagnostic> {
        let mut textures = Vec::new();
        if self.scene.network.is_some() && self.is_built(NETWORK) {
            textures.push(self.network()?);
        }
        let voices: &[&str] = if self.is_one_voice_enough() { &["a"] } else { &["a", "b"] };
        for (kind, effect) in self.acting(Acts::Gliding) {
            for voice in voices {
                textures.push(self.voice(kind, effect, voice));
            }
        }
        let mut all = Vec::new();
        if !textures.is_empty() {
            self.sum("textures", &textures);
            let gate = &self.scene.gate;
            self.part("gate", gate)?;
            self.wire("textures", "gate.in");
            self.wire("contact.speed", "gate.speed");
            self.wire("contact.force", "gate.force");
            all.push("gate.out".to_owned());
        }
        for acts in [Acts::Touching, Acts::Inside, Acts::Near] {
            for (kind, effect) in self.acting(acts) {
                if self.vibrates(kind) {
                    all.push(self.effect(kind, effect, ""));
                }
            }
        }
        if all.is_empty() {
            return Ok(());
        }
        self.sum("acceleration", &all);
        self.actuator()
    }

    /// Adds the nodes from acceleration to the output, if there is one.
    fn actuator(&mut self) -> Result<(), Diagnostic> {
        let scene = self.scene;
        let Some(output) = &scene.output else { return Ok(()) };
        let mut last = "acceleration";
        if scene.gain != 1.0 {
            let here = self.here();
            self.node("strength", "gain", &here, vec![setting("gain", Form::Float(scene.gain), &here)]);
            self.wire(last, "strength");
            last = "strength";
        }
        let part = &scene.actuator;
        let settings = handed_on(part);
        for (id, kind) in STAGES {
            let descriptor = self.descriptor(kind, &part.place)?;
            let has = |setting: &&Setting| descriptor.params.iter().any(|p| p.name == setting.name);
            self.node(id, kind, &part.place, settings.iter().filter(has).cloned().collect());
            self.wire(last, id);
            last = id;
        }
        self.part("out", output)?;
        self.wire(last, "out");
        Ok(())
    }

    /// Adds the network's chain for all surfaces that ask for it. Answers its output.
    fn network(&mut self) -> Result<String, Diagnostic> {
        let scene = self.scene;
        let Some(network) = &scene.network else { return Ok(String::new()) };
        let mut params = handed_on(network);
        self.materials(&mut params);
        let here = self.here();
        self.node("history", "action_history", &here, Vec::new());
        self.node("texture", "texture_network", &network.place, params);
        let phase = self.part("phase", &scene.phase)?;
        for (from, to) in [
            ("contact.force", "history.force"),
            ("contact.velocity", "history.velocity"),
            ("history.force", "texture.force"),
            ("history.velocity", "texture.velocity"),
            ("contact.material", "texture.material"),
            ("texture", "phase"),
        ] {
            self.wire(from, to);
        }
        // Connects the further inputs that a phase retrieval may have: the place of the hand, or more
        // about the material.
        let asks = |input: &str| phase.inputs.iter().any(|p| p.name == input);
        for (from, input) in [
            ("texture.pattern", "pattern"),
            ("texture.statistics", "statistics"),
            ("contact.place", "position"),
        ] {
            if asks(input) {
                self.wire(from, &format!("phase.{input}"));
            }
        }
        let mut last = "phase";
        // An overlap-add makes a signal of spectra.
        if phase.outputs.iter().any(|output| matches!(output.shape, ShapeSpec::Spectrum(_))) {
            self.node("synthesis", "overlap_add", &here, Vec::new());
            self.wire(last, "synthesis");
            last = "synthesis";
        }
        let synthesis_hz = number(network, "synthesis_hz").unwrap_or(SYNTHESIS_HZ);
        if synthesis_hz != 0.0 && synthesis_hz != f64::from(scene.audio_hz) {
            let minimum = setting("phase", Form::Word("minimum".into()), &here);
            self.node("audio rate", "resample", &here, vec![minimum]);
            self.wire(last, "audio rate");
            last = "audio rate";
        }
        self.node("network level", "level", &here, Vec::new());
        self.wire(last, "network level.in");
        self.wire("contact.material_level", "network level.level");
        for id in ["history", "texture", "phase", "synthesis", "audio rate", "network level"] {
            self.renders(NETWORK, id);
        }
        Ok("network level".into())
    }

    /// Adds the materials that surfaces with a network texture name.
    fn materials(&self, params: &mut Vec<Setting>) {
        let Some(slots) = self.slots(NETWORK) else { return };
        let surfaces = slots.first.iter().filter_map(|first| self.scene.surfaces.get(*first));
        let named: Vec<_> = surfaces.filter_map(|surface| surface.material.as_ref()).collect();
        let value =
            |placed: &&crate::Placed<String>| Value::made(Form::Text(placed.of.clone()), &placed.place);
        match named.split_first() {
            Some((first, rest)) => {
                params.push(setting("material", Form::Text(first.of.clone()), &first.place));
                if let Some(second) = rest.first() {
                    let items = Form::List(rest.iter().map(value).collect());
                    params.push(setting("materials", items, &second.place));
                }
            }
            None => {
                // No surface asks for a material, but all nodes are to be built, so any material will do.
                let library = self.library();
                let name = library.as_ref().and_then(|l| l.materials().first()).map(|m| m.name.clone());
                params.push(setting("material", Form::Text(name.unwrap_or_default()), &self.here()));
            }
        }
    }

    /// Adds one voice of a texture and answers its output.
    fn voice(&mut self, kind: &str, effect: &Effect, voice: &str) -> String {
        let id = self.effect(kind, effect, voice);
        let level = format!("{id} level");
        self.node(&level, "level", &self.first_place(kind), Vec::new());
        self.renders(kind, &level);
        self.wire(&id, &format!("{level}.in"));
        self.wire(&format!("contact.level_{voice}"), &format!("{level}.level"));
        self.wire(&format!("contact.{}", slot_port(kind, voice)), &format!("{level}.slot"));
        level
    }

    /// Whether no crossfade can happen: only one surface has such textures, and it has one face.
    fn is_one_voice_enough(&self) -> bool {
        let voiced = |named: &crate::Named| named.texture && named.kind != NETWORK;
        let has_textures = |effects: &crate::Effects| effects.named.iter().any(voiced);
        let mut voiced = self.scene.surfaces.iter().filter(|s| has_textures(&s.effects));
        let one_face = |form: &ShapeForm| !matches!(form, ShapeForm::Box { .. } | ShapeForm::Sphere { .. });
        let alone = voiced.next().is_none_or(|s| one_face(s.surface.shape.form())) && voiced.next().is_none();
        alone && self.prune
    }
}
