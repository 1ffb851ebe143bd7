//! A loop of optimiser steps that can stop and continue at any time without a change of the result.
//!
//! A step's input depends only on its number, and a checkpoint holds the model and the whole state of
//! Adam. So a stopped run ends at the same bits as an unbroken one.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use asperity_diagnostics::{Diagnostic, file};
use asperity_numbers::denormals::Flushed;
use burn::grad_clipping::GradientClippingConfig;
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::store::ModuleRecord;
use burn::tensor::{Bytes, Tensor};
use serde::{Deserialize, Serialize};

use crate::Failure;
use crate::files::{Teller, refused, write_whole};

const AHEAD: usize = 2;
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// Adam's epsilon (Kingma and Ba 2015): gradients of single weights are far below burn's 1e-5.
const EPSILON: f32 = 1e-8;
const REPORTS: usize = 200;
const MAGIC: &[u8; 8] = b"ASPCHK03";
/// Largest checkpoint to read, in bytes: an encoder of 166 MB with its optimiser takes an eighth of it.
const MAX_CHECKPOINT_BYTES: u64 = 4 << 30;

/// One stage of a training run.
#[derive(Clone, Debug)]
pub(crate) struct Stage<'a> {
    pub name: &'static str,
    pub steps: usize,
    /// Largest learning rate. The rate rises over the first fiftieth of the steps and falls to a
    /// hundredth by half a cosine.
    pub learning_rate: f64,
    /// Adam's decay of the mean squares of gradients. The usual 0.999 gives too large steps after
    /// gradients have grown.
    pub second_decay: f32,
    pub folder: &'a Path,
    pub begun: Begun,
    pub stop: &'a Stop,
}

/// Checksums of a run's settings and data: a checkpoint goes on with the same only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Begun {
    pub settings: u32,
    pub data: u32,
}

/// A stop request, and whether a running stage can keep its state.
#[derive(Debug, Default)]
pub(crate) struct Stop {
    wanted: AtomicBool,
    heeded: AtomicBool,
}

impl Stop {
    /// Requests a stop. Returns whether a stage will obey: not if a stop was requested before, or if no
    /// stage keeps its state. The caller may then exit at once.
    pub(crate) fn ask(&self) -> bool {
        !self.wanted.swap(true, Ordering::Relaxed) && self.heeded.load(Ordering::Relaxed)
    }

    pub(crate) fn wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }
}

/// Mean losses of a stage so far: (steps done, loss).
pub(crate) type Losses = Vec<(usize, f64)>;

#[derive(Default, Serialize, Deserialize)]
struct Header {
    begun: Begun,
    step: usize,
    /// Sum of losses since the last report, and reported losses, as bits: decimals may not read back exactly.
    sum: u64,
    losses: Vec<(usize, u64)>,
    model_bytes: usize,
    crc32: u32,
}

impl Stage<'_> {
    fn path(&self) -> PathBuf {
        self.folder.join(format!("{}.checkpoint", self.name))
    }

    fn learning_rate(&self, step: usize) -> f64 {
        let warm_up = (self.steps / 50).clamp(1, 500);
        if step < warm_up {
            return self.learning_rate * (step + 1) as f64 / warm_up as f64;
        }
        let part = (step - warm_up) as f64 / (self.steps - warm_up).max(1) as f64;
        let cosine = 0.5 + 0.5 * (std::f64::consts::PI * part).cos();
        self.learning_rate * (0.01 + 0.99 * cosine)
    }

    /// Runs the remaining steps, from the checkpoint if there is one, and returns the model and all
    /// losses. `draw` makes the batch of a step on another thread; `loss` evaluates a model on it. After a
    /// [stop](Self::stop) request it writes a checkpoint and fails with [`Failure::Stopped`].
    pub(crate) fn descend<M: Module, B: Send>(
        &self,
        model: M,
        draw: impl Fn(usize) -> B + Sync,
        loss: impl Fn(&M, B) -> Tensor<1>,
    ) -> Result<(M, Losses), Failure> {
        // Momenta of untouched weights decay for ever, down to denormals.
        let _flushed = Flushed::new();
        let adam = AdamConfig::new()
            .with_beta_2(self.second_decay)
            .with_epsilon(EPSILON)
            .with_grad_clipping(Some(GradientClippingConfig::Norm(1.0)))
            .init();
        let mut teller = Teller::new(self.name, self.steps);
        let (model, mut adam, mut header) = self.resume(model, adam)?;
        let (start, begun) = (Instant::now(), header.step);
        let every = self.steps.div_ceil(REPORTS).max(1);
        self.stop.heeded.store(true, Ordering::Relaxed);
        let model = std::thread::scope(|scope| {
            let (mut model, mut sum) = (model, f64::from_bits(header.sum));
            let (send, receive) = mpsc::sync_channel(AHEAD);
            let draw = &draw;
            scope.spawn(move || (begun..self.steps).try_for_each(|step| send.send(draw(step))));
            let mut saved = Instant::now();
            for batch in receive {
                let now = loss(&model, batch);
                let size = f64::from(now.clone().into_scalar::<f32>());
                if !size.is_finite() {
                    return Err(Failure::Model(format!(
                        "the loss of stage `{}` is {size} at step {}: begin again with a smaller learning \
                         rate, in another folder",
                        self.name, header.step
                    )));
                }
                sum += size;
                let gradients = GradientsParams::from_grads(now.backward(), &model);
                model = adam.step(self.learning_rate(header.step), model, gradients);
                header.step += 1;
                if header.step % every == 0 || header.step == self.steps {
                    let count = header.step - header.losses.last().map_or(0, |(step, _)| *step);
                    let mean = sum / count as f64;
                    header.losses.push((header.step, mean.to_bits()));
                    sum = 0.0;
                    let rate = (header.step - begun) as f64 / start.elapsed().as_secs_f64();
                    let left = ((self.steps - header.step) as f64 / rate) as u64;
                    let left = format!("{} min {:02} s left", left / 60, left % 60);
                    teller.tell(header.step, &format!("loss {mean:.4}, {rate:.1} steps/s, {left}"));
                }
                let stopped = self.stop.wanted();
                if stopped || saved.elapsed() > CHECKPOINT_EVERY || header.step == self.steps {
                    header.sum = sum.to_bits();
                    self.save(&model, &adam, &mut header)?;
                    saved = Instant::now();
                }
                if stopped && header.step < self.steps {
                    return Err(Failure::Stopped);
                }
            }
            Ok(model)
        })?;
        self.stop.heeded.store(false, Ordering::Relaxed);
        let losses = header.losses.into_iter().map(|(step, loss)| (step, f64::from_bits(loss)));
        Ok((model, losses.collect()))
    }

    fn save<M: Module>(&self, model: &M, adam: &ModuleOptimizer, header: &mut Header) -> Result<(), Failure> {
        let broken = |e: &dyn std::fmt::Display| Failure::Model(format!("a checkpoint cannot be made: {e}"));
        let model = model.clone().into_record().into_bytes().map_err(|e| broken(&e))?;
        let adam = adam.into_bytes().map_err(|e| broken(&e))?;
        (header.model_bytes, header.crc32) = (model.len(), crc32(&[&model, &adam]));
        let line = serde_json::to_vec(header).map_err(|e| broken(&e))?;
        let bytes = [&MAGIC[..], &(line.len() as u64).to_le_bytes(), &line, &model, &adam].concat();
        Ok(write_whole(&self.path(), &bytes)?)
    }

    fn resume<M: Module>(
        &self,
        model: M,
        adam: ModuleOptimizer,
    ) -> Result<(M, ModuleOptimizer, Header), Failure> {
        let Some((model, header, state)) = read(&self.path(), self.begun, model.clone())? else {
            return Ok((model, adam, Header { begun: self.begun, ..Header::default() }));
        };
        let adam = adam.from_bytes(state).map_err(|_| broken(&self.path()))?;
        Ok((model, adam, header))
    }
}

/// Model of a stage's checkpoint if the stage is finished.
pub(crate) fn of_checkpoint<M: Module>(
    path: &Path,
    begun: Begun,
    steps: usize,
    model: M,
) -> Result<Option<M>, Failure> {
    Ok(read(path, begun, model)?.filter(|(_, header, _)| header.step == steps).map(|(model, ..)| model))
}

fn broken(path: &Path) -> Diagnostic {
    refused(path, "this is not a whole checkpoint", "remove it, and its stage begins anew")
}

/// Model, header and the optimiser's state of a checkpoint.
fn read<M: Module>(path: &Path, begun: Begun, model: M) -> Result<Option<(M, Header, Bytes)>, Failure> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = file::read(path, MAX_CHECKPOINT_BYTES)?;
    let (header, model_bytes, adam_bytes) = parts(&bytes).ok_or_else(|| broken(path))?;
    let help = "name another --run folder, or remove this one";
    if header.begun.settings != begun.settings {
        return Err(refused(path, "this run was begun with other settings", help).into());
    }
    if header.begun.data != begun.data {
        return Err(refused(path, "the data have changed since this run was begun", help).into());
    }
    let bytes = |part: &[u8]| Bytes::from_bytes_vec(part.to_vec());
    let record = ModuleRecord::from_bytes(bytes(model_bytes)).map_err(|_| broken(path))?;
    let model = model.try_load_record(record).map_err(|_| broken(path))?;
    Ok(Some((model, header, bytes(adam_bytes))))
}

fn parts(bytes: &[u8]) -> Option<(Header, &[u8], &[u8])> {
    let (length, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    let (line, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let header: Header = serde_json::from_slice(line).ok()?;
    let (model, adam) = rest.split_at_checked(header.model_bytes)?;
    (crc32(&[model, adam]) == header.crc32).then_some((header, model, adam))
}

fn crc32(parts: &[&[u8]]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    parts.iter().for_each(|part| sum.update(part));
    sum.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layer::{Layer, Weights};
    use asperity_numbers::Random;
    use burn::tensor::{Device, TensorData};

    const BEGUN: Begun = Begun { settings: 1, data: 2 };

    /// Learns y = 2 a - b + 1, with a stop request after step `stop_at`.
    fn learn(folder: &Path, begun: Begun, stop_at: Option<usize>) -> Result<(Weights, Losses), Failure> {
        let device = Device::flex().autodiff();
        let stop = &Stop::default();
        let (steps, learning_rate, second_decay) = (60, 0.1, 0.99);
        let stage = Stage { name: "line", steps, learning_rate, second_decay, folder, begun, stop };
        let layer = Layer::new(2, 1, 1.0, &mut Random::new(5), &device);
        let draw = |step: usize| {
            let mut random = Random::new(step as u64);
            let inputs: Vec<f32> = (0..16).map(|_| random.range(-1.0, 1.0) as f32).collect();
            let wanted: Vec<f32> = inputs.chunks_exact(2).map(|x| 2.0 * x[0] - x[1] + 1.0).collect();
            (step, inputs, wanted)
        };
        let loss = |layer: &Layer, (step, inputs, wanted): (usize, Vec<f32>, Vec<f32>)| {
            if Some(step) == stop_at {
                assert!(stop.ask() && !stop.ask(), "seen to, and not twice");
            }
            let tensor = |x: Vec<f32>, width| Tensor::<2>::from_data(TensorData::new(x, [8, width]), &device);
            (layer.forward(tensor(inputs, 2)) - tensor(wanted, 1)).powi_scalar(2).mean()
        };
        let (layer, losses) = stage.descend(layer, draw, loss)?;
        Ok((layer.weights(), losses))
    }

    #[test]
    fn run_stopped_twice_ends_at_the_same_bits() {
        let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let (weights, losses) = learn(whole.path(), BEGUN, None).unwrap();
        assert!(losses.last().unwrap().1 < 0.05 * losses[0].1, "{losses:?}");
        for stop_at in [17, 40] {
            assert!(matches!(learn(parts.path(), BEGUN, Some(stop_at)), Err(Failure::Stopped)));
        }
        let unbroken = (weights, losses);
        assert_eq!(learn(parts.path(), BEGUN, None).unwrap(), unbroken);
        // A finished stage takes no step, so the stop never comes.
        assert_eq!(learn(whole.path(), BEGUN, Some(0)).unwrap(), unbroken);
        // A stop request without a stage to keep is not obeyed.
        assert!(!Stop::default().ask());
    }

    #[test]
    fn broken_or_other_checkpoint_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        learn(folder.path(), BEGUN, None).unwrap();
        let path = folder.path().join("line.checkpoint");
        let refused = |begun: Begun, why: &str| {
            let Err(Failure::Input(e)) = learn(folder.path(), begun, None) else { panic!("taken") };
            assert!(e.to_string().contains("line.checkpoint") && e.to_string().contains(why), "{e}");
        };
        refused(Begun { settings: 0, ..BEGUN }, "begun with other settings");
        refused(Begun { data: 0, ..BEGUN }, "the data have changed");
        let bytes = std::fs::read(&path).unwrap();
        let mut flipped = bytes.clone();
        flipped[bytes.len() - 1] ^= 1;
        for broken in [&bytes[..0], &bytes[..7], &bytes[..40], &bytes[..bytes.len() / 2], &flipped] {
            std::fs::write(&path, broken).unwrap();
            refused(BEGUN, "not a whole");
        }
    }
}
