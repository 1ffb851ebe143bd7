//! A node that answers speed along a surface with a force, alone with a stylus.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_graph::GraphFile;
use asperity_node::{Descriptor, ShapeSpec, Unit, UnitSpec};
use asperity_scene::effect::Viscosity;
use asperity_scene::effect::friction::{Dahl, LuGre, LuGreSettings, ViscousCoulomb};
use asperity_scene::effect::passivity::Law;

use crate::case::{Not, holds};
use crate::played::{Place, Played};
use crate::rig::Rig;
use crate::small::has_to_be_set;
use crate::subject::Subject;
use crate::wall::stylus;

/// A law of friction or drag, and what is known of it.
pub(super) struct Rub {
    /// What it is called here.
    pub name: String,
    kind: String,
    params: Vec<(&'static str, String)>,
    /// Its law at rest under a normal force, where it is known beforehand.
    pub law: Option<fn(f64) -> Law>,
}

/// Values of its velocity, and whether it takes a normal force.
fn ports(d: &Descriptor) -> Option<(usize, bool)> {
    let input = |name: &str| d.inputs.iter().find(|i| i.name == name);
    let is = |unit: &UnitSpec, want: &Unit| matches!(unit, UnitSpec::Is(u) if u == want);
    let axes = match input("velocity")?.shape {
        ShapeSpec::Control(n @ 2..=3) => n,
        _ => return None,
    };
    let known = d.inputs.iter().all(|i| i.optional || matches!(&*i.name, "slot" | "velocity" | "force"));
    let pushes = d
        .outputs
        .iter()
        .any(|o| o.name == "force" && o.shape == ShapeSpec::Control(3) && is(&o.unit, &Unit::NEWTON));
    let speed = is(&input("velocity")?.unit, &Unit::MILLIMETRE_PER_SECOND);
    (known && pushes && speed && input("slot").is_some()).then_some((axes, input("force").is_some()))
}

fn stiff() -> LuGreSettings {
    LuGreSettings {
        bristle_stiffness_n_per_mm: 10.0,
        bristle_damping_ns_per_m: 1.0,
        ..LuGreSettings::default()
    }
}

/// Every kind of friction and drag, the built-in ones by several laws, others as they are without parameters; one that has to be set is left out.
pub(super) fn all(subject: &Subject<'_>) -> Vec<Rub> {
    let of = |kind: &str, name: &'static str, text: &str, law: fn(f64) -> Law| {
        let list = if kind == "friction" { "laws" } else { "drags" };
        let params = vec![(list, format!("[{text:?}]"))];
        Rub { name: name.to_owned(), kind: kind.to_owned(), params, law: Some(law) }
    };
    let mut all = Vec::new();
    for kind in subject.registry().iter() {
        let d = kind.descriptor();
        if ports(d).is_none() {
            continue;
        }
        match &*d.kind {
            "friction" => all.extend([
                of("friction", "viscous_coulomb", "viscous_coulomb", |n| {
                    ViscousCoulomb::new(0.3, ViscousCoulomb::VISCOSITY_S_PER_MM)
                        .map_or(Law::default(), |f| f.law(n))
                }),
                of(
                    "friction",
                    "viscous_coulomb, gentle",
                    "viscous_coulomb(viscosity_s_per_mm: 0.0005)",
                    |n| ViscousCoulomb::new(0.3, 0.0005).map_or(Law::default(), |f| f.law(n)),
                ),
                of("friction", "dahl", "dahl", |_| Dahl::new(0.3, 1.0).map_or(Law::default(), |f| f.law())),
                of(
                    "friction",
                    "dahl, stiff",
                    "dahl(coefficient: 0.5, bristle_stiffness_n_per_mm: 10)",
                    |_| Dahl::new(0.5, 10.0).map_or(Law::default(), |f| f.law()),
                ),
                of("friction", "lugre", "lugre", |n| {
                    LuGre::new(LuGreSettings::default()).map_or(Law::default(), |f| f.law(n))
                }),
                of(
                    "friction",
                    "lugre, stiff",
                    "lugre(bristle_stiffness_n_per_mm: 10, bristle_damping_ns_per_m: 1)",
                    |n| LuGre::new(stiff()).map_or(Law::default(), |f| f.law(n)),
                ),
            ]),
            "viscosity" => {
                all.push(of("viscosity", "drag", "(viscosity_ns_per_m: 2, max_force_n: 1.5)", |_| {
                    Viscosity::new(2.0, 1.5).map_or(Law::default(), |f| f.law())
                }))
            }
            other if !has_to_be_set(d, &[]) => all.push(Rub {
                name: other.to_owned(),
                kind: other.to_owned(),
                params: Vec::new(),
                law: None,
            }),
            _ => {}
        }
    }
    all
}

/// It, running.
pub(super) struct Rubbed {
    rig: Rig,
    place: Arc<Place>,
    normal: Arc<AtomicU64>,
    force: usize,
    pub tick_hz: u32,
}

impl Rubbed {
    /// In a graph at this rate, and behind a limiter of this force \[N\], if there is to be one.
    ///
    /// # Errors
    /// What the compiler says.
    pub(super) fn new(
        subject: &Subject<'_>,
        rub: &Rub,
        tick_hz: u32,
        limit_n: Option<f64>,
    ) -> Result<Self, Not> {
        let at = "the case";
        let (place, normal) = (Arc::new(Place::default()), Arc::new(AtomicU64::new(0)));
        let pressed = normal.clone();
        let kinds = [
            stylus(&place),
            Played::control("slot from memory", 1, Unit::NONE, Arc::new(|_, to| to.fill(0.0))),
            Played::control(
                "normal force from memory",
                1,
                Unit::NEWTON,
                Arc::new(move |_, to| to.fill(f64::from_bits(pressed.load(Ordering::Relaxed)))),
            ),
        ];
        let mut graph = GraphFile::empty("friction");
        graph.tick_hz = tick_hz;
        graph.add_node("stylus", "stylus from memory", &[], at)?;
        graph.add_node("motion", "velocity", &[("cutoff_hz", "0")], at)?;
        graph.add_node("slot", "slot from memory", &[], at)?;
        let params: Vec<(&str, &str)> =
            rub.params.iter().map(|(name, text)| (*name, text.as_str())).collect();
        graph.add_node("rub", &rub.kind, &params, at)?;
        graph.add_wire("stylus.position", "motion.position", at);
        graph.add_wire("slot", "rub.slot", at);
        let (axes, takes) = ports(subject.kind(&rub.kind)?.descriptor()).unwrap_or((2, false));
        graph.add_wire(if axes == 2 { "motion.velocity" } else { "motion.unfiltered" }, "rub.velocity", at);
        if takes {
            graph.add_node("normal", "normal force from memory", &[], at)?;
            graph.add_wire("normal", "rub.force", at);
        }
        let mut last = "rub";
        if let Some(limit_n) = limit_n {
            graph.add_node("limit", "force_limiter", &[("max_force_n", &format!("{limit_n}"))], at)?;
            graph.add_wire("rub.force", "limit.force", at);
            last = "limit";
        }
        graph.add_node("probe", "probe", &[], at)?;
        graph.add_wire(&format!("{last}.force"), "probe", at);
        let rig = Rig::of(subject, &graph, &kinds)?;
        let force = rig.schedule.index_of(last).ok_or_else(|| "the force is not built".to_owned())?;
        Ok(Self { rig, place, normal, force, tick_hz })
    }

    pub(super) fn tick_s(&self) -> f64 {
        1.0 / f64::from(self.tick_hz)
    }

    /// As new, with the stylus at 0 under this normal force, where it has rested for two ticks.
    pub(super) fn begin(&mut self, normal_n: f64) {
        self.rig.engine.reset();
        (0..2).for_each(|_| _ = self.at([0.0; 2], normal_n));
    }

    /// One tick with the stylus there on the surface \[mm\], under this normal force; answers the force along it \[N\].
    pub(super) fn at(&mut self, [x, y]: [f64; 2], normal_n: f64) -> [f64; 2] {
        self.place.put([x, y, 0.0]);
        self.normal.store(normal_n.to_bits(), Ordering::Relaxed);
        self.rig.engine.tick();
        match self.rig.engine.output(self.force, 0) {
            Some(asperity_node::Buffer::Control { values, .. }) => {
                [0, 1].map(|k| values.get(k).copied().unwrap_or(0.0))
            }
            _ => [0.0; 2],
        }
    }

    /// Its law at rest under a normal force, as it answers: one step so short that nothing slips, and a rest.
    ///
    /// # Errors
    /// Another one than is known of it.
    pub(super) fn law(&mut self, rub: &Rub, normal_n: f64) -> Result<Law, Not> {
        let step = 1e-7 * normal_n;
        self.begin(normal_n);
        let moved = -self.at([step, 0.0], normal_n)[0];
        let held = -self.at([step, 0.0], normal_n)[0];
        let found = Law {
            stiffness_n_per_mm: held / step,
            damping_ns_per_m: 1e3 * (moved - held) / step * self.tick_s(),
        };
        if let Some(law) = rub.law {
            let want = law(normal_n);
            let whole = 1e3 * want.stiffness_n_per_mm * self.tick_s() + want.damping_ns_per_m;
            let off = 1e3 * (found.stiffness_n_per_mm - want.stiffness_n_per_mm).abs() * self.tick_s()
                + (found.damping_ns_per_m - want.damping_ns_per_m).abs();
            holds(off <= 1e-3 * whole, || {
                format!(
                    "{} under {normal_n:e} N at {} Hz is {:.4} N/mm and {:.4} N s/m at rest, not {:.4} and {:.4}",
                    rub.name,
                    self.tick_hz,
                    found.stiffness_n_per_mm,
                    found.damping_ns_per_m,
                    want.stiffness_n_per_mm,
                    want.damping_ns_per_m
                )
            })?;
            return Ok(want);
        }
        Ok(found)
    }

    /// # Errors
    /// A node failed.
    pub(super) fn sound(&self) -> Result<(), Not> {
        holds(self.rig.engine.faults() == 0, || format!("{} faults", self.rig.engine.faults()))
    }
}
