//! A model with its materials, ready to run once a tick.

use crate::check::{self, Probe, error_of_full_scale};
use crate::kernel::has_whole_numbers;
use crate::lower::Lowered;
use crate::model::Model;
use crate::packed::Packed;
use crate::range::Range;
use crate::reference::Reference;
use crate::signature::{FORCE_LEN, MAGNITUDES_LEN, SPEED_LEN, TEXTURE_LEN};
use asperity_diagnostics::Diagnostic;
use asperity_dsp::Isa;
use std::fmt;
use std::sync::Arc;

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
    Packed(Box<Packed>),
    /// The lowered network in double precision, with room for all elements. Only inputs and outputs are f32.
    Double(Arc<Lowered>, Vec<f64>),
    Tract(Reference),
}

impl Engine {
    fn double(net: &Lowered) -> Self {
        Engine::Double(Arc::new(net.clone()), vec![0.0; net.constant.len()])
    }

    /// One run over a material and its texture into the first outputs; `None` where tract fails, or a length
    /// does not fit.
    #[inline]
    fn run(
        &mut self,
        (material, texture): (usize, &[f32]),
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        match self {
            Engine::Packed(packed) => packed.run(material, force, speed, out),
            Engine::Double(net, elements) => {
                let inputs = force.iter().chain(speed).chain(texture);
                elements.iter_mut().zip(inputs).for_each(|(to, x)| *to = f64::from(*x));
                net.steps.iter().for_each(|step| step.compute(elements));
                for (out, at) in out.iter_mut().zip(&net.outputs) {
                    out.iter_mut().zip(elements.get(at.clone())?).for_each(|(y, x)| *y = *x as f32);
                }
                Some(())
            }
            Engine::Tract(reference) => reference.run(texture, force, speed, out),
        }
    }
}

/// A network with its materials preloaded.
#[derive(Clone)]
pub struct Runner {
    engine: Engine,
    textures: Arc<[Vec<f32>]>,
    /// Number of the model's outputs.
    outputs: usize,
    info: Info,
}

/// Key of a runner among a model's: texture vectors, precision and choice.
pub(crate) type Wanted = (Vec<Vec<f32>>, Precision, Choice);

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
        let refuse = |what: String| Err(Diagnostic::new(what).in_file(&self.path));
        let count = materials.len();
        if !(1..=MAX_MATERIALS).contains(&count) {
            return refuse(format!("{count} materials for this network; 1 to {MAX_MATERIALS} fit"));
        }
        for (i, m) in materials.iter().map(AsRef::as_ref).enumerate() {
            if m.len() != TEXTURE_LEN {
                let len = m.len();
                return refuse(format!(
                    "material {i} has a texture vector of {len} numbers, not {TEXTURE_LEN}"
                ));
            }
            if let Some(at) = m.iter().position(|x| !x.is_finite()) {
                return refuse(format!("number {at} of material {i}'s texture vector is not finite"));
            }
        }
        let all: Vec<Vec<f32>> = materials.iter().map(|m| m.as_ref().to_vec()).collect();
        self.made.of((all, precision, choice), |asked| self.make(asked))
    }

    /// Makes a runner for valid materials.
    fn make(&self, &(ref textures, precision, choice): &Wanted) -> Result<Runner, Diagnostic> {
        let refuse = |what: String| Err(Diagnostic::new(what).in_file(&self.path));
        let tract = |report: String| {
            let info = Info {
                executor: Executor::Tract,
                weights_bytes: 0,
                multiply_adds: 0,
                max_error_vs_tract: None,
                report,
            };
            Ok(self.with(Engine::Tract(self.reference.clone()?), textures, info))
        };
        let forced = match choice {
            Choice::Tract => return tract("tract, as asked for".into()),
            Choice::Auto => None,
            Choice::Packed(_) if precision == Precision::F64 && self.lowered.is_ok() => {
                return refuse("f64 has no packed kernels".into());
            }
            Choice::Packed(isa) => Some(isa),
        };
        let net = match &self.lowered {
            Ok(net) => net,
            Err(why) if forced.is_some() => return refuse(format!("this network cannot be packed: {why}")),
            Err(why) => return tract(format!("tract: not packed, for {why}")),
        };
        let mut refused = String::new();
        let attempts = if forced.is_some() { &[precision] } else { precision.attempts() };
        for &precision in attempts {
            let isa = forced.or(precision.isas().first().copied()).unwrap_or(Isa::Portable);
            match self.checked(net, textures, precision, isa) {
                Ok(mut runner) => {
                    runner.info.report.push_str(&refused);
                    return Ok(runner);
                }
                Err(why) => refused.push_str(&format!("; {} weights refused: {why}", precision.name())),
            }
        }
        match forced {
            Some(_) => refuse(format!("this network cannot be packed{refused}")),
            None => tract(format!("tract{refused}")),
        }
    }

    fn with(&self, engine: Engine, textures: &[Vec<f32>], info: Info) -> Runner {
        Runner { engine, textures: textures.into(), outputs: self.outputs, info }
    }

    /// A runner in this precision, if it is near enough to tract; without tract, to the network in f64.
    /// Else the reason.
    fn checked(
        &self,
        net: &Lowered,
        textures: &[Vec<f32>],
        precision: Precision,
        isa: Isa,
    ) -> Result<Runner, String> {
        let (mut engine, executor, weights_bytes, multiply_adds) = if precision == Precision::F64 {
            let multiply_adds = net.multiply_adds();
            (Engine::double(net), Executor::Double, multiply_adds * size_of::<f64>(), multiply_adds)
        } else {
            let packed = Packed::new(net, textures, isa, precision)?;
            let (bytes, multiply_adds) = (packed.weights().map(<[u8]>::len).sum(), packed.multiply_adds());
            (Engine::Packed(Box::new(packed)), Executor::Packed { isa, precision }, bytes, multiply_adds)
        };
        let (mut exact, name) = match &self.reference {
            Ok(reference) => (Engine::Tract(reference.clone()), "tract"),
            Err(_) => (Engine::double(net), "f64"),
        };
        let (error, tolerance) = (self.error(textures, &mut exact, &mut engine)?, precision.tolerance());
        if error.is_nan() || error > tolerance {
            return Err(format!(
                "differs from {name} by {error:.1e} of full scale, more than {tolerance:.0e}"
            ));
        }
        let info = Info {
            executor,
            weights_bytes,
            multiply_adds,
            max_error_vs_tract: self.reference.is_ok().then_some(error),
            report: format!("{executor}, within {error:.1e} of full scale of {name}"),
        };
        Ok(self.with(engine, textures, info))
    }

    /// Largest difference between two. Each output has its own full scale in each group of probes.
    fn error(&self, textures: &[Vec<f32>], exact: &mut Engine, other: &mut Engine) -> Result<f64, String> {
        let range = Range::new(self.trained());
        let mut worst = 0f64;
        for probes in [check::ordinary(), check::large()] {
            let probes: Vec<Probe> = probes.iter().map(|probe| probe.held(&range)).collect();
            let mut reference: [Vec<f32>; 3] = Default::default();
            let mut found = reference.clone();
            for (material, texture) in textures.iter().enumerate().take(CHECKED_MATERIALS) {
                for Probe { force, speed } in &probes {
                    let mut answer = Answer::default();
                    let mut out = outputs(&mut answer);
                    let out = &mut out[..self.outputs];
                    for (engine, all) in [(&mut *exact, &mut reference), (&mut *other, &mut found)] {
                        let ran = engine.run((material, texture), force, speed, out);
                        ran.ok_or("it fails on the check's inputs")?;
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
        let count = self.textures.len();
        let texture = self.textures.get(material).ok_or(RunError::Material { index: material, count })?;
        if force.len() != FORCE_LEN || speed.len() != SPEED_LEN {
            return Err(RunError::Length);
        }
        self.engine.run((material, texture), force, speed, out).ok_or(RunError::Executor)
    }

    /// The executor, and why it was chosen.
    pub fn describe(&self) -> &Info {
        &self.info
    }

    /// Number of materials.
    pub fn materials(&self) -> usize {
        self.textures.len()
    }

    /// Whether a run allocates no memory.
    pub fn is_allocation_free(&self) -> bool {
        self.info.executor.is_allocation_free()
    }

    /// Reads the packed weights once, in order, and returns a checksum: the lower bound of a run's
    /// time, for benches. `None` for f64 and tract.
    pub fn read_weights(&self) -> Option<u32> {
        let Engine::Packed(packed) = &self.engine else { return None };
        let words = packed.weights().flat_map(|layer| layer.as_chunks::<4>().0);
        Some(words.fold(0, |sum, word| sum.wrapping_add(u32::from_ne_bytes(*word))))
    }
}

impl fmt::Debug for Runner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Runner")
            .field("materials", &self.textures.len())
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(a: &Runner, b: &Runner) -> bool {
        match (&a.engine, &b.engine) {
            (Engine::Packed(a), Engine::Packed(b)) => Arc::ptr_eq(&a.made, &b.made),
            (Engine::Double(a, _), Engine::Double(b, _)) => Arc::ptr_eq(a, b),
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
