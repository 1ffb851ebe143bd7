//! Motion of the hand, its contact with surfaces, and the forces on it.

use crate::Part;
use crate::read::error;
use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::{Kind as Form, Value};
use asperity_node::{Acts, Role};

use crate::lower::builder::{Builder, handed_on, number, setting};

/// Default fade of a gate \[ms\].
const GATE_FADE_MS: f64 = 10.0;
/// Time of the crossfade from one surface's textures to another's \[ms\].
const CROSSFADE_MS: f64 = 20.0;
/// Distance from which the plane of a surface is reported to a device that pushes back in its own loop
/// \[mm\].
const ANTICIPATE_MM: f64 = 5.0;

impl Builder<'_> {
    /// Adds the stylus, its motion and the contact.
    pub(crate) fn hand(&mut self) -> Result<(), Diagnostic> {
        let scene = self.scene;
        let input = self.part("stylus", &scene.input)?;
        if input.outputs.iter().all(|output| output.name != "position") {
            let place = &scene.input.place;
            let message = format!("`{}` has no position of a stylus", scene.input.kind);
            let [strokes, hands] = [Role::Stroke, Role::Hand].map(|role| self.kinds(role).join(", "));
            return Err(error(place, message).help(format!("{strokes}, or a hand: {hands}")));
        }
        let strokes = input.outputs.iter().any(|output| output.name == "stroke");
        self.part("motion", &scene.motion)?;
        let here = self.here();
        let name = scene.source.path().file_name().map(|name| name.to_string_lossy().into_owned());
        let gate_ms = number(&scene.gate, "fade_ms").unwrap_or(GATE_FADE_MS);
        let names = self.names();
        let list = |name, kinds: &[String]| {
            let items = kinds.iter().map(|kind| Value::made(Form::Text(kind.clone()), &here)).collect();
            setting(name, Form::List(items), &here)
        };
        let mut params = vec![
            list("touching", &names.touching),
            list("inside", &names.inside),
            list("near", &names.near),
            list("textures", &names.textures),
            setting("scene", Form::Text(name.unwrap_or_default()), &here),
            setting("slots", Form::Text(scene.slots_key(names.iter())), &here),
            setting("max_force_n", Form::Float(scene.device.max_force_n), &scene.device.place),
            setting("crossfade_ms", Form::Float(CROSSFADE_MS), &here),
            setting("hold_ms", Form::Float(gate_ms.max(CROSSFADE_MS)), &here),
        ];
        if let Some(device) = &scene.device.output {
            params.push(setting("anticipate_mm", Form::Float(ANTICIPATE_MM), &device.place));
        }
        self.node("contact", "contact", &here, params);
        self.wire("stylus.position", "motion.position");
        self.wire("stylus.position", "contact.position");
        self.wire("motion.spatial", "contact.velocity");
        self.wire("motion.unfiltered", "contact.unfiltered");
        if strokes {
            self.wire("stylus.stroke", "motion.stroke");
            self.wire("stylus.stroke", "contact.stroke");
        }
        Ok(())
    }

    /// Names of the kinds with a role.
    fn kinds(&self, role: Role) -> Vec<&str> {
        self.registry.with_role(role).collect()
    }

    /// Adds the nodes for forces.
    pub(crate) fn forces(&mut self) -> Result<(), Diagnostic> {
        let scene = self.scene;
        let walls = scene.surfaces.iter().any(|surface| surface.effects.stiffness.is_some());
        let mut beside = Vec::new();
        for acts in [Acts::Touching, Acts::Inside, Acts::Near] {
            for (kind, effect) in self.acting(acts) {
                if !self.vibrates(kind) {
                    beside.push(self.effect(kind, effect, ""));
                }
            }
        }
        let mut all = beside.clone();
        if walls || !self.prune {
            all.insert(0, "contact.push".to_owned());
        }
        if all.is_empty() {
            return Ok(());
        }
        let here = self.here();
        self.sum("forces", &all);
        let most = setting("max_force_n", Form::Float(scene.device.max_force_n), &scene.device.place);
        self.node("force limiter", "force_limiter", &here, vec![most]);
        self.wire("forces", "force limiter");
        self.node("force", "probe", &here, Vec::new());
        self.wire("force limiter", "force");
        if let Some(device) = &scene.device.output {
            self.device(device, &beside)?;
        }
        Ok(())
    }

    /// Adds a device that pushes back. It renders the wall in its own loop. All other forces are sent
    /// once per tick.
    fn device(&mut self, device: &Part, beside: &[String]) -> Result<(), Diagnostic> {
        let descriptor = self.descriptor(&device.kind, &device.place)?;
        if descriptor.role != Some(Role::Force) {
            let message = format!("`{}` is not a node of force feedback", device.kind);
            return Err(error(&device.place, message).help(self.kinds(Role::Force).join(" or ")));
        }
        let mut params = handed_on(device);
        let of_scene = &self.scene.device;
        for (name, value) in
            [("max_force_n", of_scene.max_force_n), ("device_damping_ns_per_m", of_scene.damping_ns_per_m)]
        {
            let known = descriptor.params.iter().any(|param| param.name == name);
            if known && params.iter().all(|setting| setting.name != name) {
                params.push(setting(name, Form::Float(value), &of_scene.place));
            }
        }
        self.node("device", &device.kind, &device.place, params);
        for port in ["plane", "normal", "stiffness", "damping"] {
            self.wire(&format!("contact.{port}"), &format!("device.{port}"));
        }
        if !beside.is_empty() && descriptor.inputs.iter().any(|input| input.name == "force") {
            self.sum("forces beside", beside);
            self.wire("forces beside", "device.force");
        }
        Ok(())
    }
}
