//! The image encoder: from a tactile image to a material's vector.

use crate::onnx::{GraphProto, ModelProto, ValueInfoProto};
use crate::picture::{IMAGE, Image};
use crate::plan::Plan;
use crate::proto::{self, MAX_ENCODER_BYTES};
use crate::signature::{TEXTURE_LEN, fed_inputs, is_float, refused, shape};
use asperity_diagnostics::{Diagnostic, file};
use std::fmt;
use std::path::{Path, PathBuf};

const WANTED: &str =
    "an encoder has the float input image [1,3,192,256] and the float output texture [1,256]";

/// An encoder, checked and compiled by tract. For a control thread: it allocates and takes milliseconds.
pub struct Encoder {
    path: PathBuf,
    plan: Plan,
}

impl Encoder {
    /// Reads an ONNX file of at most [`MAX_ENCODER_BYTES`].
    ///
    /// Its only input, `image [1,3,192,256]`, is red, green and blue from 0 to 1, each row by row. Its
    /// output is `texture [1,256]`, found by that name if there are several. A free batch size counts as 1.
    ///
    /// # Errors
    /// A file that cannot be read or is not an ONNX model; weights that are not finite or stored elsewhere;
    /// inputs and outputs that do not fit (with the shapes found); a graph that tract cannot run.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        Self::from_bytes(&file::read(path, MAX_ENCODER_BYTES)?, path)
    }

    /// An encoder in memory; `path` is its name in errors.
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        let (model, mut graph) = proto::decode(bytes, path)?;
        let output = output(&graph, path)?;
        proto::check(&graph, path)?;
        let refuse = |what: String| Diagnostic::new(what).in_file(path).help(WANTED);
        graph.output.retain(|v| v.name == output);
        let [rows, columns] = IMAGE;
        let inputs = [vec![1, 3, rows, columns]];
        let model = ModelProto { graph: Some(graph), ..model };
        let plan = Plan::compile(&model, path, &inputs, MAX_ENCODER_BYTES, WANTED)?;
        let encoder = Self { path: path.to_owned(), plan };
        // A graph may compile and still fail, or return something unexpected.
        match encoder.run(&vec![0; 3 * rows * columns]) {
            Some(values) if values.len() == TEXTURE_LEN => Ok(encoder),
            Some(values) => {
                Err(refuse(format!("this model answers {} numbers, not {TEXTURE_LEN}", values.len())))
            }
            None => Err(refuse("tract fails to run this model on a black image".into())),
        }
    }

    /// The vector of an image, always finite.
    ///
    /// # Errors
    /// An image of another size than [`IMAGE`]; an encoder that fails on it or returns values that are
    /// not finite.
    pub fn encode(&self, image: &Image) -> Result<[f32; TEXTURE_LEN], Diagnostic> {
        let refuse = |what: String| Diagnostic::new(what).in_file(&self.path);
        let [rows, columns] = image.size;
        if image.size != IMAGE || image.pixels.len() != 3 * rows * columns {
            let what = format!("an image of {rows} x {columns} with {} numbers", image.pixels.len());
            return Err(refuse(what).help("an encoder takes 192 rows of 256 pixels of 3"));
        }
        let values = self.run(&image.pixels).and_then(|values| values.try_into().ok());
        let values: [f32; TEXTURE_LEN] =
            values.ok_or_else(|| refuse("the encoder fails on this image".into()))?;
        match values.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(refuse(format!("number {at} of the encoder's output is not finite"))),
            None => Ok(values),
        }
    }

    /// One run over the right number of pixels, row by row, red, green and blue in turn.
    fn run(&self, pixels: &[u8]) -> Option<Vec<f32>> {
        let planes: Vec<f32> = (0..3)
            .flat_map(|channel| pixels.iter().skip(channel).step_by(3))
            .map(|x| f32::from(*x) / 255.0)
            .collect();
        self.plan.run(&[&planes])?.into_iter().next()
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
