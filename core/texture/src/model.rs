//! A model from its file, before it has materials.

use crate::lower::Lowered;
use crate::plan;
use crate::proto::{self, MAX_MODEL_BYTES};
use crate::reference::Reference;
use crate::runner::{Runner, Wanted};
use crate::signature::match_signature;
use crate::trained::{self, Target, Trained};
use asperity_diagnostics::{Diagnostic, Recent, file, fingerprint};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A texture network: checked, compiled by tract and, if it is a multilayer perceptron, lowered.
///
/// Inputs `force [1,10]` in N, `speed [1,20]` in mm/s and `texture [1,256]` give `magnitudes [1,100]`,
/// all f32. Inputs and magnitudes are found by name, else by shape. A free batch size counts as 1. A
/// model may also have the outputs `ratio [1,100]` and `variance [1,1]`, found by name: scatter of the
/// magnitudes, see [`Answer`](crate::Answer).
pub struct Model {
    pub(crate) path: PathBuf,
    /// An error only in a program without tract.
    pub(crate) reference: Result<Reference, Diagnostic>,
    /// The steps, or why there are none.
    pub(crate) lowered: Result<Lowered, String>,
    trained: Trained,
    target: Target,
    /// Number of outputs.
    pub(crate) outputs: usize,
    /// Recent runners.
    pub(crate) made: Recent<Wanted, Runner>,
}

/// Recent models, by path and content.
static MODELS: Recent<(PathBuf, (usize, u64)), Arc<Model>> = Recent::new(4);
/// Runners of a model to keep: a few precisions, or a few materials in turns.
const RUNNERS: usize = 8;

impl Model {
    /// Reads an ONNX file of at most [`MAX_MODEL_BYTES`](crate::MAX_MODEL_BYTES).
    ///
    /// # Errors
    /// A file that cannot be read or is not an ONNX model; weights stored elsewhere; a signature that does
    /// not fit (with the shapes found); an invalid trained range or target; a graph that tract cannot run
    /// or with tensors that are too large. Without tract: no multilayer perceptron.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        Self::from_bytes(&file::read(path, MAX_MODEL_BYTES)?, path)
    }

    /// Like [`load`](Self::load), but a recent model with the same content is not loaded again.
    pub fn shared(path: impl AsRef<Path>) -> Result<Arc<Self>, Diagnostic> {
        let path = path.as_ref();
        let bytes = file::read(path, MAX_MODEL_BYTES)?;
        MODELS.of((path.to_owned(), fingerprint(&bytes)), |_| Self::from_bytes(&bytes, path).map(Arc::new))
    }

    /// A model in memory; `path` is its name in errors.
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        let (model, graph) = proto::decode(bytes, path)?;
        let signature = match_signature(&graph, path)?;
        proto::check(&graph, path)?;
        let own = model.opset_import.iter().find(|set| matches!(set.domain.as_str(), "" | "ai.onnx"));
        let opset = own.map_or(0, |set| set.version);
        let lowered = Lowered::new(&graph, opset, &signature);
        let reference = match Reference::new(&model, &graph, &signature, path) {
            Err(e) if plan::runs_any_graph() || lowered.is_err() => return Err(e),
            reference => reference,
        };
        let (trained, target) = trained::read(&model.metadata_props, path)?;
        Ok(Self {
            path: path.to_owned(),
            reference,
            lowered,
            trained,
            target,
            outputs: signature.outputs.len(),
            made: Recent::new(RUNNERS),
        })
    }

    /// Range that the file states for the training.
    pub fn trained(&self) -> Trained {
        self.trained
    }

    /// Kind of magnitudes that the file states; by default root mean squares.
    pub fn target(&self) -> Target {
        self.target
    }

    /// Whether the model answers ratio and variance too.
    pub fn answers_scatter(&self) -> bool {
        self.outputs > 1
    }

    /// Reason to run the model only with tract. `None` for a multilayer perceptron.
    pub fn not_lowered_because(&self) -> Option<&str> {
        self.lowered.as_ref().err().map(String::as_str)
    }
}

impl fmt::Debug for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Model")
            .field("path", &self.path)
            .field("not_lowered_because", &self.not_lowered_because())
            .finish_non_exhaustive()
    }
}
