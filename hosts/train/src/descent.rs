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

use crate::failure::Failure;
use crate::files::write_whole;

/// Batches drawn ahead on a second thread.
const AHEAD: usize = 2;
/// Time between two checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// Adam's epsilon (Kingma and Ba 2015): gradients of single weights are far below burn's 1e-5.
const EPSILON: f32 = 1e-8;
/// Reports of a whole stage.
const REPORTS: usize = 200;
/// First bytes of a checkpoint.
const MAGIC: &[u8; 8] = b"ASPCHK02";

/// One stage of a training run.
#[derive(Clone, Debug)]
pub(crate) struct Stage<'a> {
    /// Name of the stage and its checkpoint.
    pub name: &'a str,
    /// Steps in all.
    pub steps: usize,
    /// Largest learning rate. The rate rises over the first fiftieth of the steps and falls to a
    /// hundredth by half a cosine.
    pub learning_rate: f64,
    /// Adam's decay of the mean squares of gradients. The usual 0.999 gives too large steps after
    /// gradients have grown.
    pub second_decay: f32,
    /// Folder of checkpoints.
    pub folder: &'a Path,
    /// Stop request of the user.
    pub stop: &'a Stop,
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

    /// Whether a stop was requested.
    pub(crate) fn wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }
}

/// Mean losses of a stage so far: (steps done, loss).
pub(crate) type Losses = Vec<(usize, f64)>;

/// Progress of a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    /// Steps done.
    pub step: usize,
    /// Mean loss since the last report.
    pub loss: f64,
    /// Time left.
    pub left: Duration,
    /// Steps a second.
    pub rate: f64,
}

#[derive(Serialize, Deserialize)]
struct Header {
    step: usize,
    /// Sum of losses since the last report.
    #[serde(with = "bits")]
    sum: f64,
    #[serde(with = "bits::of_losses")]
    losses: Losses,
    model_bytes: usize,
    /// Checksum of all bytes behind the header.
    crc32: u32,
}

/// Numbers as their bits, as decimals may not read back exactly.
mod bits {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
        x.to_bits().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        u64::deserialize(from).map(f64::from_bits)
    }

    pub(super) mod of_losses {
        use super::*;

        pub(in super::super) fn serialize<S: Serializer>(
            losses: &[(usize, f64)],
            to: S,
        ) -> Result<S::Ok, S::Error> {
            to.collect_seq(losses.iter().map(|(step, loss)| (step, loss.to_bits())))
        }

        pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
            from: D,
        ) -> Result<Vec<(usize, f64)>, D::Error> {
            let all = Vec::<(usize, u64)>::deserialize(from)?;
            Ok(all.into_iter().map(|(step, bits)| (step, f64::from_bits(bits))).collect())
        }
    }
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
    /// losses. `draw` makes the batch of a step on another thread; `loss` evaluates a model on it.
    ///
    /// # Errors
    /// [`Failure::Stopped`] after a [stop](Self::stop) request and a checkpoint; a checkpoint that
    /// cannot be read or written; a loss that is not finite.
    pub(crate) fn descend<M: Module, B: Send>(
        &self,
        model: M,
        draw: impl Fn(usize) -> B + Sync,
        loss: impl Fn(&M, B) -> Tensor<1>,
        mut report: impl FnMut(&Progress),
    ) -> Result<(M, Losses), Failure> {
        // Momenta of untouched weights decay for ever, down to denormals.
        let _flushed = Flushed::new();
        let clipping = Some(GradientClippingConfig::Norm(1.0));
        let adam = AdamConfig::new()
            .with_beta_2(self.second_decay)
            .with_epsilon(EPSILON)
            .with_grad_clipping(clipping)
            .init();
        let (model, mut adam, mut header) = self.resume(model, adam)?;
        let (start, begun) = (Instant::now(), header.step);
        let every = self.steps.div_ceil(REPORTS).max(1);
        self.stop.heeded.store(true, Ordering::Relaxed);
        let model = std::thread::scope(|scope| {
            let mut model = model;
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
                header.sum += size;
                let gradients = GradientsParams::from_grads(now.backward(), &model);
                model = adam.step(self.learning_rate(header.step), model, gradients);
                header.step += 1;
                if header.step % every == 0 || header.step == self.steps {
                    let count = header.step - header.losses.last().map_or(0, |(step, _)| *step);
                    let mean = header.sum / count as f64;
                    header.losses.push((header.step, mean));
                    header.sum = 0.0;
                    let rate = (header.step - begun) as f64 / start.elapsed().as_secs_f64();
                    let left = Duration::from_secs_f64((self.steps - header.step) as f64 / rate);
                    report(&Progress { step: header.step, loss: mean, left, rate });
                }
                let stopped = self.stop.wanted();
                if stopped || saved.elapsed() > CHECKPOINT_EVERY || header.step == self.steps {
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
        Ok((model, header.losses))
    }

    fn save<M: Module>(&self, model: &M, adam: &ModuleOptimizer, header: &mut Header) -> Result<(), Failure> {
        let broken = |e: &dyn std::fmt::Display| Failure::Model(format!("a checkpoint cannot be made: {e}"));
        let model = model.clone().into_record().into_bytes().map_err(|e| broken(&e))?;
        let adam = adam.into_bytes().map_err(|e| broken(&e))?;
        header.model_bytes = model.len();
        header.crc32 = crc32(&[&model, &adam]);
        let line = serde_json::to_vec(header).map_err(|e| broken(&e))?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend((line.len() as u64).to_le_bytes());
        bytes.extend(line);
        bytes.extend_from_slice(&model);
        bytes.extend_from_slice(&adam);
        Ok(write_whole(&self.path(), &bytes)?)
    }

    fn resume<M: Module>(
        &self,
        model: M,
        adam: ModuleOptimizer,
    ) -> Result<(M, ModuleOptimizer, Header), Failure> {
        match read(&self.path(), model.clone())? {
            None => {
                Ok((model, adam, Header { step: 0, sum: 0.0, losses: Vec::new(), model_bytes: 0, crc32: 0 }))
            }
            Some((model, header, state)) => {
                let adam = adam.from_bytes(state).map_err(|_| broken(&self.path()))?;
                Ok((model, adam, header))
            }
        }
    }
}

/// Model of a stage's checkpoint if the stage is finished.
///
/// # Errors
/// A checkpoint that cannot be read or belongs to another model.
pub(crate) fn of_checkpoint<M: Module>(path: &Path, steps: usize, model: M) -> Result<Option<M>, Failure> {
    Ok(read(path, model)?.filter(|(_, header, _)| header.step == steps).map(|(model, ..)| model))
}

fn broken(path: &Path) -> Diagnostic {
    Diagnostic::new("this is not a whole checkpoint")
        .in_file(path)
        .help("remove it, and its stage begins anew")
}

/// Largest checkpoint to read, in bytes: an encoder of 166 MB with its optimiser takes an eighth of it.
const MAX_CHECKPOINT_BYTES: u64 = 4 << 30;

/// Model, header and the optimiser's state of a checkpoint.
fn read<M: Module>(path: &Path, model: M) -> Result<Option<(M, Header, Bytes)>, Failure> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = file::read(path, MAX_CHECKPOINT_BYTES)?;
    let (header, model_bytes, adam_bytes) = parts(&bytes).ok_or_else(|| broken(path))?;
    let bytes = |part: &[u8]| Bytes::from_bytes_vec(part.to_vec());
    let record = ModuleRecord::from_bytes(bytes(model_bytes)).map_err(|_| broken(path))?;
    let model = model.try_load_record(record).map_err(|_| broken(path))?;
    Ok(Some((model, header, bytes(adam_bytes))))
}

/// Header, model and optimiser of a checkpoint.
fn parts(bytes: &[u8]) -> Option<(Header, &[u8], &[u8])> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (length, rest) = rest.split_first_chunk::<8>()?;
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
#[path = "descent_tests.rs"]
mod tests;
