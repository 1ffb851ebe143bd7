//! A model with its materials, ready to run once a tick.

use crate::check::{self, Probe, error_of_full_scale};
use crate::double::Double;
use crate::kernel::has_whole_numbers;
use crate::lower::Lowered;
use crate::model::Model;
use crate::packed::Packed;
use crate::range::Range;
use crate::reference::Reference;
use crate::signature::{FORCE_LEN, MAGNITUDES_LEN, SPEED_LEN, TEXTURE_LEN};
use crate::stored::Stored;
use asperity_diagnostics::Diagnostic;
use asperity_dsp::Isa;
use std::fmt;

/// Most materials of a runner.
pub const MAX_MATERIALS: usize = 4096;
/// Number of materials on which a packed network is compared with tract.
const CHECKED_MATERIALS: usize = 8;

/// Storage of weights. Sums are f32, except for [`Precision::F64`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// 32-bit weights, within 1e-4 of full scale of tract.
    #[default]
    F32,
    /// 16-bit weights, scaled by a power of two per column, within 1e-3 of full scale of tract.
    F16,
    /// 8-bit weights, scaled so that a column's largest is 127, and 16-bit inputs, summed as whole
    /// numbers, within 5e-2 of full scale of tract: 0.4 dB of the largest magnitude.
    Int8,
    /// 64-bit weights, sums and activations, within 1e-4 of full scale of tract: the reference. Not
    /// packed, and slow.
    F64,
}

impl Precision {
    /// All of them, the default first.
    pub const ALL: [Precision; 4] = [Precision::F32, Precision::F16, Precision::Int8, Precision::F64];

    /// Its name in graphs and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::F16 => "f16",
            Precision::Int8 => "int8",
            Precision::F64 => "f64",
        }
    }

    /// Largest accepted difference from tract, as a part of full scale.
    pub fn tolerance(self) -> f64 {
        match self {
            Precision::F32 | Precision::F64 => 1e-4,
            Precision::F16 => 1e-3,
            Precision::Int8 => 5e-2,
        }
    }

    /// This machine's instruction sets that it can be packed for, best first; none for f64.
    pub fn isas(self) -> Vec<Isa> {
        let all = Isa::available();
        match self {
            Precision::F32 | Precision::F16 => all.collect(),
            Precision::Int8 => all.filter(|&isa| has_whole_numbers(isa)).collect(),
            Precision::F64 => Vec::new(),
        }
    }

    /// Precisions to try: this one, then more exact ones.
    fn attempts(self) -> &'static [Precision] {
        match self {
            Precision::F32 => &[Precision::F32],
            Precision::F16 => &[Precision::F16, Precision::F32],
            Precision::Int8 => &[Precision::Int8, Precision::F16, Precision::F32],
            Precision::F64 => &[Precision::F64],
        }
    }
}

/// Wanted executor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Choice {
    /// Packed kernels on the best instruction set, if they agree with tract. int8 falls back to f16,
    /// f16 to f32, f32 to tract. f64 has no packed kernels but is checked in the same way.
    #[default]
    Auto,
    /// Packed kernels on this instruction set, or an error; with f64 always an error.
    Packed(Isa),
    /// tract.
    Tract,
}

/// Mean over root mean square of the magnitude of noise: sqrt(pi / 4), that of a Rayleigh distribution.
pub const NOISE_RATIO: f32 = 0.886_226_9;

/// Magnitudes of one tick and their scatter, for one material, force and velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Magnitudes at 10, 20, .. 1000 Hz, as the model scales them.
    pub magnitudes: [f32; MAGNITUDES_LEN],
    /// Mean over root mean square of each magnitude, 0 to 1: [`NOISE_RATIO`] for noise, 1 for a steady line.
    pub ratio: [f32; MAGNITUDES_LEN],
    /// Variance of a frame's power over its squared mean, from 0. Power is the sum of all squared
    /// magnitudes.
    pub variance: f32,
}

/// Answer of a model without scatter: noise in every bin, and a variance of 0.
impl Default for Answer {
    fn default() -> Self {
        Self { magnitudes: [0.0; MAGNITUDES_LEN], ratio: [NOISE_RATIO; MAGNITUDES_LEN], variance: 0.0 }
    }
}

impl Answer {
    /// Clamps ratios to 0..=1 and the variance to finite numbers from 0. NaN counts as noise.
    fn hold(&mut self) {
        for ratio in &mut self.ratio {
            *ratio = if ratio.is_nan() { NOISE_RATIO } else { ratio.clamp(0.0, 1.0) };
        }
        if !(0.0..=f32::MAX).contains(&self.variance) {
            self.variance = 0.0;
        }
    }
}

/// Executor of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Executor {
    /// Packed kernels, which do not allocate.
    Packed {
        /// The instruction set used.
        isa: Isa,
        /// Storage of weights.
        precision: Precision,
    },
    /// Plain code in double precision, which does not allocate.
    Double,
    /// tract, which allocates about 200 times a run.
    Tract,
}

impl Executor {
    /// Whether a run allocates no memory.
    pub fn is_allocation_free(self) -> bool {
        match self {
            Executor::Packed { .. } | Executor::Double => true,
            Executor::Tract => false,
        }
    }
}

/// Such as `packed f32 on avx512`.
impl fmt::Display for Executor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Executor::Packed { isa, precision } => {
                write!(f, "packed {} on {}", precision.name(), isa.name())
            }
            Executor::Double => f.write_str("f64"),
            Executor::Tract => f.write_str("tract"),
        }
    }
}

/// Description of a runner, for reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Info {
    /// Executor of the network.
    pub executor: Executor,
    /// Bytes of weights that a run reads, padding included; 0 for tract.
    pub weights_bytes: usize,
    /// Multiply-adds a run, without padding and folded parts; 0 for tract.
    pub multiply_adds: usize,
    /// Largest difference from tract over the check's inputs, as a part of full scale. `None` if not
    /// checked.
    pub max_error_vs_tract: Option<f64>,
    /// The choice in words, and why it is not the first choice.
    pub report: String,
}

/// Reasons why a run fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// There is no such material.
    #[error("material {index} of {count} does not exist")]
    Material {
        /// The index.
        index: usize,
        /// Number of materials.
        count: usize,
    },
    /// An input or output length differs from [`FORCE_LEN`], [`SPEED_LEN`] or [`MAGNITUDES_LEN`].
    #[error("force, speed or magnitudes have another length than 10, 20 and 100")]
    Length,
    /// The executor failed. Packed kernels never do.
    #[error("the network's executor failed")]
    Executor,
}

#[derive(Clone)]
enum Engine {
    F32(Box<Packed<f32>>),
    F16(Box<Packed<u16>>),
    Int8(Box<Packed<i8>>),
    F64(Box<Double>),
    Tract(Reference, Vec<Vec<f32>>),
}

impl Engine {
    /// One run into the first outputs; `None` where tract fails or there is no such material.
    #[inline]
    fn run(&mut self, material: usize, force: &[f32], speed: &[f32], out: &mut [&mut [f32]]) -> Option<()> {
        match self {
            Engine::F32(packed) => packed.run(material, force, speed, out),
            Engine::F16(packed) => packed.run(material, force, speed, out),
            Engine::Int8(packed) => packed.run(material, force, speed, out),
            Engine::F64(double) => double.run(material, force, speed, out),
            Engine::Tract(reference, textures) => reference.run(textures.get(material)?, force, speed, out),
        }
    }
}

/// A network with its materials preloaded.
#[derive(Clone)]
pub struct Runner {
    engine: Engine,
    materials: usize,
    /// Number of the model's outputs.
    outputs: usize,
    info: Info,
}

impl Model {
    /// Prepares the network for `materials`, each of [`TEXTURE_LEN`] finite numbers: folds their part
    /// into biases, packs the weights and checks the result against tract. Slow (0.2 s if weights are
    /// rounded), for the control thread. A recent runner is copied and shares its weights.
    ///
    /// # Errors
    /// No material or more than [`MAX_MATERIALS`]; one of another length or not finite; with
    /// [`Choice::Packed`], a network, machine or result that does not allow it.
    pub fn runner<M: AsRef<[f32]>>(
        &self,
        materials: &[M],
        precision: Precision,
        choice: Choice,
    ) -> Result<Runner, Diagnostic> {
        let refuse = |what: String| Diagnostic::new(what).in_file(&self.path);
        if materials.is_empty() || materials.len() > MAX_MATERIALS {
            return Err(refuse(format!(
                "{} materials for this network; 1 to {MAX_MATERIALS} fit",
                materials.len()
            )));
        }
        for (i, m) in materials.iter().enumerate() {
            let m = m.as_ref();
            if m.len() != TEXTURE_LEN {
                let what =
                    format!("material {i} has a texture vector of {} numbers, not {TEXTURE_LEN}", m.len());
                return Err(refuse(what));
            }
            if let Some(at) = m.iter().position(|x| !x.is_finite()) {
                return Err(refuse(format!("number {at} of material {i}'s texture vector is not finite")));
            }
        }
        let all: Vec<Vec<f32>> = materials.iter().map(|m| m.as_ref().to_vec()).collect();
        self.made.of((all, precision, choice), |asked| self.make(asked))
    }

    /// Makes a runner for valid materials.
    fn make(&self, &(ref materials, precision, choice): &Wanted) -> Result<Runner, Diagnostic> {
        let refuse = |what: String| Diagnostic::new(what).in_file(&self.path);
        let job = Job {
            model: self,
            range: Range::new(self.trained()),
            textures: materials,
            materials: materials.iter().map(|m| m.iter().map(|&x| f64::from(x)).collect()).collect(),
        };
        let tract = |report: String| {
            Ok(Runner {
                engine: Engine::Tract(self.reference.clone()?, materials.clone()),
                materials: materials.len(),
                outputs: self.outputs,
                info: Info {
                    executor: Executor::Tract,
                    weights_bytes: 0,
                    multiply_adds: 0,
                    max_error_vs_tract: None,
                    report,
                },
            })
        };
        let forced = match choice {
            Choice::Tract => return tract("tract, as asked for".into()),
            Choice::Auto => None,
            Choice::Packed(isa) => Some(isa),
        };
        let net = match &self.lowered {
            Ok(net) => net,
            Err(why) if forced.is_some() => {
                return Err(refuse(format!("this network cannot be packed: {why}")));
            }
            Err(why) => return tract(format!("tract: not packed, for {why}")),
        };
        if forced.is_some() && precision == Precision::F64 {
            return Err(refuse("f64 has no packed kernels".into()));
        }
        let mut refused = String::new();
        let attempts = if forced.is_some() { &[precision] } else { precision.attempts() };
        for &precision in attempts {
            let best = precision.isas().first().copied().unwrap_or(Isa::Portable);
            let isa = forced.unwrap_or(best);
            let attempt = match precision {
                Precision::F32 => job.packed::<f32>(net, isa, precision, |p| Engine::F32(Box::new(p))),
                Precision::F16 => job.packed::<u16>(net, isa, precision, |p| Engine::F16(Box::new(p))),
                Precision::Int8 => job.packed::<i8>(net, isa, precision, |p| Engine::Int8(Box::new(p))),
                Precision::F64 => job.double(net),
            };
            match attempt {
                Ok(mut runner) => {
                    runner.info.report.push_str(&refused);
                    return Ok(runner);
                }
                Err(why) => refused.push_str(&format!("; {} weights refused: {why}", precision.name())),
            }
        }
        if forced.is_some() {
            return Err(refuse(format!("this network cannot be packed{refused}")));
        }
        tract(format!("tract{refused}"))
    }
}

/// Key of a runner among a model's: texture vectors, precision and choice.
pub(crate) type Wanted = (Vec<Vec<f32>>, Precision, Choice);

/// Inputs of packing beside the network.
struct Job<'a> {
    model: &'a Model,
    /// Range to which inputs are clamped.
    range: Range,
    textures: &'a [Vec<f32>],
    materials: Vec<Vec<f64>>,
}

impl Job<'_> {
    /// Packs and checks, or says why not.
    fn packed<W: Stored>(
        &self,
        net: &Lowered,
        isa: Isa,
        precision: Precision,
        engine: impl FnOnce(Packed<W>) -> Engine,
    ) -> Result<Runner, String> {
        let packed = Packed::<W>::new(net, &self.materials, isa)?;
        let (bytes, multiply_adds) = (packed.weights_bytes(), packed.multiply_adds());
        let executor = Executor::Packed { isa, precision };
        self.checked(net, engine(packed), executor, precision.tolerance(), bytes, multiply_adds)
    }

    /// The network in f64, checked, or says why not.
    fn double(&self, net: &Lowered) -> Result<Runner, String> {
        let double = Double::new(net, &self.materials);
        let multiply_adds = double.multiply_adds();
        let (bytes, tolerance) = (multiply_adds * size_of::<f64>(), Precision::F64.tolerance());
        self.checked(net, Engine::F64(Box::new(double)), Executor::Double, tolerance, bytes, multiply_adds)
    }

    /// A runner, if it is near enough to tract; without tract, to the network in f64.
    fn checked(
        &self,
        net: &Lowered,
        mut engine: Engine,
        executor: Executor,
        tolerance: f64,
        weights_bytes: usize,
        multiply_adds: usize,
    ) -> Result<Runner, String> {
        let (mut exact, name) = match &self.model.reference {
            Ok(reference) => (Engine::Tract(reference.clone(), self.textures.to_vec()), "tract"),
            Err(_) => (Engine::F64(Box::new(Double::new(net, &self.materials))), "f64"),
        };
        let error = self.error(&mut exact, &mut engine)?;
        if error.is_nan() || error > tolerance {
            return Err(format!(
                "differs from {name} by {error:.1e} of full scale, more than {tolerance:.0e}"
            ));
        }
        let info = Info {
            executor,
            weights_bytes,
            multiply_adds,
            max_error_vs_tract: self.model.reference.is_ok().then_some(error),
            report: format!("{executor}, within {error:.1e} of full scale of {name}"),
        };
        Ok(Runner { engine, materials: self.textures.len(), outputs: self.model.outputs, info })
    }

    /// Largest difference between two. Each output has its own full scale in each group of probes.
    fn error(&self, exact: &mut Engine, other: &mut Engine) -> Result<f64, String> {
        let mut worst = 0f64;
        for probes in [check::ordinary(), check::large()] {
            let probes: Vec<Probe> = probes.iter().map(|probe| probe.held(&self.range)).collect();
            let mut reference: [Vec<f32>; 3] = Default::default();
            let mut found = reference.clone();
            for material in 0..self.textures.len().min(CHECKED_MATERIALS) {
                for Probe { force, speed } in &probes {
                    let mut answer = Answer::default();
                    let mut out = outputs(&mut answer);
                    let out = &mut out[..self.model.outputs];
                    for (engine, all) in [(&mut *exact, &mut reference), (&mut *other, &mut found)] {
                        engine.run(material, force, speed, out).ok_or("it fails on the check's inputs")?;
                        all.iter_mut().zip(&*out).for_each(|(all, out)| all.extend_from_slice(out));
                    }
                }
            }
            let errors = reference.iter().zip(&found).map(|(r, f)| error_of_full_scale(r, f));
            worst = errors.fold(worst, f64::max);
        }
        Ok(worst)
    }
}

/// The parts of an answer, in the signature's order.
fn outputs(answer: &mut Answer) -> [&mut [f32]; 3] {
    [&mut answer.magnitudes, &mut answer.ratio, std::slice::from_mut(&mut answer.variance)]
}

impl Runner {
    /// Predicts magnitudes as [`run`](Self::run), and their scatter.
    ///
    /// A model without [scatter](Self::answers_scatter) gives ratio and variance as in [`Answer::default`].
    /// Others give ratios within 0..=1 and a finite variance from 0, whatever the network returns.
    #[inline]
    pub fn answer(
        &mut self,
        material: usize,
        force: &[f32],
        speed: &[f32],
        answer: &mut Answer,
    ) -> Result<(), RunError> {
        let count = self.outputs.min(3);
        self.run_into(material, force, speed, &mut outputs(answer)[..count])?;
        if count > 1 {
            answer.hold();
        } else {
            (answer.ratio, answer.variance) = ([NOISE_RATIO; MAGNITUDES_LEN], 0.0);
        }
        Ok(())
    }

    /// Whether the model answers ratio and variance too.
    pub fn answers_scatter(&self) -> bool {
        self.outputs > 1
    }

    /// Predicts magnitudes: `force` of [`FORCE_LEN`] in N, `speed` of [`SPEED_LEN`] in mm/s, `out` of
    /// [`MAGNITUDES_LEN`] as the model scales them. NaN and infinities are passed on, not refused.
    ///
    /// Neither allocates nor locks where [`Executor::is_allocation_free`].
    #[inline]
    pub fn run(
        &mut self,
        material: usize,
        force: &[f32],
        speed: &[f32],
        out: &mut [f32],
    ) -> Result<(), RunError> {
        if out.len() != MAGNITUDES_LEN {
            return Err(RunError::Length);
        }
        self.run_into(material, force, speed, &mut [out])
    }

    /// Runs the network into the first outputs, as many as `out` has. Their lengths fit.
    #[inline]
    fn run_into(
        &mut self,
        material: usize,
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Result<(), RunError> {
        if material >= self.materials {
            return Err(RunError::Material { index: material, count: self.materials });
        }
        if force.len() != FORCE_LEN || speed.len() != SPEED_LEN {
            return Err(RunError::Length);
        }
        self.engine.run(material, force, speed, out).ok_or(RunError::Executor)
    }

    /// The executor, and why it was chosen.
    pub fn describe(&self) -> &Info {
        &self.info
    }

    /// Number of materials.
    pub fn materials(&self) -> usize {
        self.materials
    }

    /// Whether a run allocates no memory.
    pub fn is_allocation_free(&self) -> bool {
        self.info.executor.is_allocation_free()
    }

    /// Reads the packed weights once, in order, and returns a checksum: the lower bound of a run's
    /// time, for benches. `None` for f64 and tract.
    pub fn read_weights(&self) -> Option<u32> {
        match &self.engine {
            Engine::F32(packed) => Some(packed.read()),
            Engine::F16(packed) => Some(packed.read()),
            Engine::Int8(packed) => Some(packed.read()),
            Engine::F64(..) | Engine::Tract(..) => None,
        }
    }
}

impl fmt::Debug for Runner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Runner")
            .field("materials", &self.materials)
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn share(a: &Runner, b: &Runner) -> bool {
        match (&a.engine, &b.engine) {
            (Engine::F32(a), Engine::F32(b)) => Arc::ptr_eq(&a.made, &b.made),
            (Engine::F16(a), Engine::F16(b)) => Arc::ptr_eq(&a.made, &b.made),
            (Engine::Int8(a), Engine::Int8(b)) => Arc::ptr_eq(&a.made, &b.made),
            (Engine::F64(a), Engine::F64(b)) => Arc::ptr_eq(&a.net, &b.net),
            _ => false,
        }
    }

    #[test]
    fn recent_model_is_reused_and_its_weights_are_held_once() {
        let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/texture.onnx");
        let model = Model::load(model).unwrap();
        let materials = [[0.1_f32; TEXTURE_LEN], [0.2; TEXTURE_LEN]];
        for precision in Precision::ALL {
            let make = |count| model.runner(&materials[..count], precision, Choice::Auto).unwrap();
            let (one, other) = (make(2), make(1));
            assert!(share(&one, &make(2)) && share(&other, &make(1)), "{}", precision.name());
            assert!(!share(&one, &other), "{}", precision.name());
        }
    }
}
