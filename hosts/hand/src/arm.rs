//! A stylus on an arm that pushes back: its two nodes, its options, and the loop from position to force.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use asperity_live::{ForceModel, ForceReader, Sample, SampleWriter};
use asperity_motion::AxisMap;
use asperity_node::{
    Descriptor, Diagnostic, Input, NodeKind, Param, Params, Prepared, Processor, Registry, Resume, Role,
    ShapeSpec, Status, Tick, Unit,
};

use crate::handle::Shared;
use crate::node::{PassOn, hand};
use crate::servo::Servo;
use crate::{HandDevice, Handle, Open};

/// Time between two attempts to reach a lost device.
pub(crate) const AGAIN: Duration = Duration::from_millis(500);
/// Longest time to release the force at the end; the law takes 20 ms.
pub(crate) const LET_GO: Duration = Duration::from_millis(50);

/// Options of a device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArmOptions {
    /// Name of the device; `None` for the default one, or the only one.
    pub device: Option<String>,
    /// Address of the Haply service, or path of OpenHaptics' library; `None` for the usual one.
    pub by: Option<String>,
    /// The device's axis for each of the graph's x, y, z (z up).
    pub axes: AxisMap,
    /// Largest force \[N\]; the device's own limit also applies.
    pub max_force_n: f64,
}

/// A text parameter, trimmed; `None` if it is empty.
pub(crate) fn text(params: &Params, name: &str) -> Option<String> {
    Some(params.text(name).trim().to_owned()).filter(|text| !text.is_empty())
}

/// The servo between a device and the graph. It neither allocates nor waits.
pub(crate) struct ArmLoop {
    axes: AxisMap,
    pub(crate) servo: Servo,
    models: Option<ForceReader>,
    writer: SampleWriter,
    shared: Arc<Shared>,
    pub(crate) stroke: u32,
    /// The last place of the hand, if it has one.
    sample: Option<Sample>,
}

impl ArmLoop {
    pub(crate) fn new(
        axes: AxisMap,
        writer: SampleWriter,
        models: Option<ForceReader>,
        shared: Arc<Shared>,
    ) -> Self {
        Self { axes, servo: Servo::new(0.0), models, writer, shared, stroke: 0, sample: None }
    }

    /// Whether the graph pushes back.
    pub(crate) fn pushes(&self) -> bool {
        self.models.is_some()
    }

    /// Starts over with a device that was opened, and its largest force \[N\]; without models that is 0.
    pub(crate) fn begin(&mut self, max_force_n: f64) {
        self.servo = Servo::new(if self.pushes() { max_force_n } else { 0.0 });
    }

    /// The force for a hand at a place \[mm\], both in the device's axes. Without a place it goes to 0.
    pub(crate) fn step(&mut self, now_ns: u64, place: Option<[f64; 3]>) -> [f64; 3] {
        let position = place.map_or([f64::NAN; 3], |mm| self.axes.apply(mm));
        let model = self.models.as_mut().map_or_else(ForceModel::default, |models| *models.read());
        self.servo.step(now_ns, position, &model);
        self.sample = place.map(|_| Sample {
            time_ns: now_ns,
            arrived_ns: now_ns,
            position,
            // For a hand at rest this is how hard it presses.
            force: self.servo.normal_force(),
            stroke: self.stroke,
        });
        self.force()
    }

    /// The last force, in the device's axes.
    pub(crate) fn force(&self) -> [f64; 3] {
        self.axes.back(self.servo.force())
    }

    /// Sends where the hand was in the last step.
    pub(crate) fn send(&mut self) {
        if let Some(sample) = self.sample.take() {
            self.shared.send(&mut self.writer, sample);
        }
    }
}

/// A kind of arms. They differ in this only.
pub(crate) struct Arm {
    /// Kinds and summaries of the input node and the force node.
    pub(crate) input: [&'static str; 2],
    pub(crate) force: [&'static str; 2],
    pub(crate) max_force_n: f64,
    /// Doc of the parameter `device`: the name of the device, and the meaning of an empty one.
    pub(crate) device: &'static str,
    /// The parameter with the service or the library: name, default, doc.
    pub(crate) by: [&'static str; 3],
    pub(crate) axes: &'static str,
    pub(crate) start: fn(ArmOptions, SampleWriter, Option<ForceReader>) -> Result<Handle, Diagnostic>,
    pub(crate) excludes: fn(&Params, &Params) -> bool,
    pub(crate) servo: [f64; 2],
}

impl HandDevice for Arm {
    fn input(&self) -> &'static str {
        self.input[0]
    }

    fn force(&self) -> Option<&'static str> {
        Some(self.force[0])
    }

    /// Adds the node with the position of the stylus, and the one with the surface that the arm pushes back
    /// with. The parameter `device` joins them. The host gives the surface to the device's servo loop, which
    /// evaluates it at its own rate.
    fn register(&self, mut registry: Registry) -> Registry {
        let axes = "The device's axes that become x, y and z (up), for example \"x,-z,y\".";
        let device = || Param::text("device", "", self.device);
        let ([input, summary], [by, usual, doc]) = (self.input, self.by);
        let input = Descriptor::new(input, summary).param(Param::text(by, usual, doc));
        let input = input.param(device()).param(Param::text("axes", self.axes, axes));
        let input = hand(input, (Unit::NEWTON, "force that the device renders"));
        let force = Descriptor::new(self.force[0], self.force[1]).param(device());
        let force = wall(force, self.max_force_n);
        registry.add(Arc::new(NodeKind::new(input, |_| Ok(Prepared::new(PassOn(1.0))))));
        registry.add(Arc::new(NodeKind::new(force, |_| Ok(Prepared::new(Wall)))));
        registry
    }

    fn configure(&self, params: &Params, max_force_n: f64) -> Result<Open, Diagnostic> {
        let axes = AxisMap::parse(params.text("axes"))?;
        let (device, by) = (text(params, "device"), text(params, self.by[0]));
        let (options, start) = (ArmOptions { device, by, axes, max_force_n }, self.start);
        Ok(Box::new(move |writer, models| start(options, writer, models)))
    }

    fn excludes(&self, params: &Params, open: &Params, _address: Option<SocketAddr>) -> bool {
        (self.excludes)(params, open)
    }

    fn servo(&self) -> [f64; 2] {
        self.servo
    }
}

fn wall(descriptor: Descriptor, max_force_n: f64) -> Descriptor {
    let damping = Unit::NEWTON_SECOND_PER_METRE;
    let input = |name, values, unit, doc| Input::new(name, ShapeSpec::Control(values), unit).doc(doc);
    let beside = "further force: friction, drag, magnets; smoothed over 3 ms";
    let most = "Largest force. The device's own limit applies too.";
    let own = "Damping of the device itself; 0: unknown. With it, walls that the device cannot render stably \
         cause a warning.";
    descriptor
        .role(Role::Force)
        .input(input("plane", 3, Unit::MILLIMETRE, "a point of the plane, such as `virtual_floor.plane`"))
        .input(input("normal", 3, Unit::NONE, "outward normal of the plane; all 0: no surface"))
        .input(input("stiffness", 1, Unit::NEWTON_PER_MILLIMETRE, "stiffness of the plane"))
        .input(input("damping", 1, damping, "damping of the plane along its normal").or(0.0))
        .input(input("force", 3, Unit::NEWTON, beside).or(0.0))
        .param(Param::number("max_force_n", max_force_n, 0.0..=100.0, most).unit("N"))
        .param(Param::number("device_damping_ns_per_m", 0.0, 0.0..=100.0, own).unit("N s/m"))
        .timing("the device evaluates the plane at its own rate, independent of the graph's ticks")
        .resumes(Resume::Never)
        .sink()
}

/// The processor of a force node: the host reads its inputs.
struct Wall;

impl Processor for Wall {
    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}
