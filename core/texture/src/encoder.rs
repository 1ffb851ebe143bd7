//! The image encoder: from a tactile image to a material's vector.

use crate::onnx::{GraphProto, ModelProto, ValueInfoProto};
use crate::picture::{IMAGE, Image};
use crate::plan::{self, Run};
use crate::proto::{self, MAX_ENCODER_BYTES};
use crate::signature::{TEXTURE_LEN, fed_inputs, is_float, refused, shape};
use crate::statistics::{self, PICTURE, Statistics, Strangeness};
use asperity_diagnostics::{Diagnostic, Source, file};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const WANTED: &str =
    "an encoder has the float input image [1,3,192,256] and the float output texture [1,256]";

/// An encoder, checked and compiled by tract. For a control thread: it allocates and takes milliseconds.
pub struct Encoder {
    path: PathBuf,
    plan: Arc<Run>,
    layers: Vec<Channels>,
    statistics: Option<Statistics>,
}

/// A layer's name in the graph, and its number of channels.
pub type Channels = (String, usize);

/// An encoder's answer to an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// The vector, always finite.
    pub vector: [f32; TEXTURE_LEN],
    /// [Features](crate::statistics) of the picture, then in each layer that is looked at.
    pub features: Vec<Vec<f64>>,
    /// Strangeness of the image. `None` if the encoder has no statistics.
    pub strangeness: Option<Strangeness>,
}

impl Encoder {
    /// Reads an ONNX file of at most [`MAX_ENCODER_BYTES`], and its [statistics](Statistics::beside) if there
    /// are any.
    ///
    /// Its only input, `image [1,3,192,256]`, is red, green and blue from 0 to 1, each row by row. Its
    /// output is `texture [1,256]`, found by that name if there are several. A free batch size counts as 1.
    ///
    /// # Errors
    /// A file that cannot be read or is not an ONNX model; weights that are not finite or stored elsewhere;
    /// inputs and outputs that do not fit (with the shapes found); a graph that tract cannot run; statistics
    /// that are damaged or of another encoder.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        let bytes = file::read(path, MAX_ENCODER_BYTES)?;
        let beside = Statistics::beside(path);
        if matches!(beside.try_exists(), Ok(false)) {
            return Self::from_bytes(&bytes, path);
        }
        let statistics = Statistics::parse(&Source::read(&beside)?, &bytes)?;
        let layers = statistics.layers.iter().filter(|l| l.name != PICTURE);
        let layers = layers.map(|l| (l.name.clone(), l.mean.len() / 2)).collect();
        Ok(Self { statistics: Some(statistics), ..Self::with_layers(&bytes, path, layers)? })
    }

    /// An encoder in memory without statistics; `path` is its name in errors.
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::with_layers(bytes, path, Vec::new())
    }

    /// An encoder in memory that also answers the [features](crate::statistics) of some layers.
    pub fn with_layers(
        bytes: &[u8],
        path: impl AsRef<Path>,
        layers: Vec<Channels>,
    ) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        let (model, mut graph) = proto::decode(bytes, path)?;
        let output = output(&graph, path)?;
        graph.output.retain(|v| v.name == output);
        let more = layers.iter().map(|(name, _)| ValueInfoProto { name: name.clone(), r#type: None });
        graph.output.extend(more);
        proto::check(&graph, path)?;
        let refuse = |what: String| Diagnostic::new(what).in_file(path).help(WANTED);
        let [rows, columns] = IMAGE;
        let inputs = [vec![1, 3, rows, columns]];
        let model = ModelProto { graph: Some(graph), ..model };
        let plan = plan::compile(&model, path, &inputs, MAX_ENCODER_BYTES, WANTED)?;
        let encoder = Self { path: path.to_owned(), plan, layers, statistics: None };
        // A graph may compile and still fail, or return something unexpected.
        match encoder.run(&vec![0; 3 * rows * columns]) {
            Some((values, _)) if values.len() == TEXTURE_LEN => Ok(encoder),
            Some((values, _)) => {
                Err(refuse(format!("this model answers {} numbers, not {TEXTURE_LEN}", values.len())))
            }
            None => Err(refuse("tract fails to run this model on a black image".into())),
        }
    }

    /// The vector of an image, always finite.
    ///
    /// # Errors
    /// As [`look`](Self::look).
    pub fn encode(&self, image: &Image) -> Result<[f32; TEXTURE_LEN], Diagnostic> {
        self.look(image).map(|found| found.vector)
    }

    /// The vector of an image, and its strangeness.
    ///
    /// # Errors
    /// An image of another size than [`IMAGE`]; an encoder that fails on it or returns values that are
    /// not finite.
    pub fn look(&self, image: &Image) -> Result<Encoded, Diagnostic> {
        let refuse = |what: String| Diagnostic::new(what).in_file(&self.path);
        let [rows, columns] = image.size;
        if image.size != IMAGE || image.pixels.len() != 3 * rows * columns {
            let what = format!("an image of {rows} x {columns} with {} numbers", image.pixels.len());
            return Err(refuse(what).help("an encoder takes 192 rows of 256 pixels of 3"));
        }
        let found = self.run(&image.pixels).and_then(|(v, features)| Some((v.try_into().ok()?, features)));
        let (vector, features): ([f32; TEXTURE_LEN], Vec<Vec<f64>>) =
            found.ok_or_else(|| refuse("the encoder fails on this image".into()))?;
        if let Some(at) = vector.iter().position(|x| !x.is_finite()) {
            return Err(refuse(format!("number {at} of the encoder's output is not finite")));
        }
        let features = [vec![statistics::of_picture(image)], features].concat();
        let strangeness = self.statistics.as_ref().and_then(|known| known.strangeness(&features));
        Ok(Encoded { vector, features, strangeness })
    }

    /// The encoder's file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Statistics of the training pictures, if there are any beside the file.
    pub fn statistics(&self) -> Option<&Statistics> {
        self.statistics.as_ref()
    }

    /// Vector and features of the right number of pixels, row by row, red, green and blue in turn.
    fn run(&self, pixels: &[u8]) -> Option<(Vec<f32>, Vec<Vec<f64>>)> {
        let planes: Vec<f32> = (0..3)
            .flat_map(|channel| pixels.iter().skip(channel).step_by(3))
            .map(|x| f32::from(*x) / 255.0)
            .collect();
        let mut answers = (self.plan)(&[&planes])?.into_iter();
        let vector = answers.next()?;
        let of = |((_, channels), values): (&Channels, Vec<f32>)| statistics::features(&values, *channels);
        Some((vector, self.layers.iter().zip(answers).map(of).collect::<Option<_>>()?))
    }
}

impl fmt::Debug for Encoder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Encoder").field("path", &self.path).finish_non_exhaustive()
    }
}

/// Checks the graph's input and returns the name of its output.
fn output(graph: &GraphProto, path: &Path) -> Result<String, Diagnostic> {
    let inputs: Vec<&ValueInfoProto> = fed_inputs(graph).collect();
    let refuse = |what: &str| refused(what, graph, path, WANTED);
    let [image] = inputs.as_slice() else {
        return Err(refuse(&format!("this model has {} inputs, not 1", inputs.len())));
    };
    let [rows, columns] = IMAGE.map(|n| Some(n as i64));
    let wanted = [Some(3), rows, columns];
    let fits = |dims: &[Option<i64>]| matches!(dims, [None | Some(1), rest @ ..] if rest == wanted);
    if !is_float(image) || !shape(image).is_some_and(|dims| fits(&dims)) {
        return Err(refuse("the input does not fit"));
    }
    let output = match graph.output.as_slice() {
        [one] => one,
        several => several
            .iter()
            .find(|v| v.name.eq_ignore_ascii_case("texture"))
            .ok_or_else(|| refuse("no output is named texture"))?,
    };
    // A file may leave a shape open. Then the result is checked.
    let fitting = |n: &Option<i64>| n.is_none_or(|n| n == TEXTURE_LEN as i64);
    let open = |dims: &[Option<i64>]| matches!(dims, [None | Some(1), n] if fitting(n));
    if shape(output).is_some_and(|dims| !open(&dims)) {
        return Err(refuse("the output does not fit"));
    }
    Ok(output.name.clone())
}
