//! Kinds of nodes that are Python classes.
//!
//! A node's arrays belong to Python. Each call copies a tick's values into them and out again. Views of the
//! engine's own memory would dangle in whoever keeps one.

use std::sync::{Arc, Mutex};

use asperity_node::{
    Config, Descriptor, Diagnostic, Fact, Input, Latency, LayoutSpec, NodeKind, Output, Param, ParamValue,
    Prepared, Processor, RateSpec, Setup, Shape, ShapeSpec, Status, Tick, Unit, Wiring,
};
use numpy::{Complex32, PyArray1, PyArrayMethods};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PySlice};
use pyo3::{IntoPyObjectExt, intern};

use crate::error::{AsperityWarning, interrupted, is_interrupted};

/// Largest number of a parameter, either sign.
const MOST: f64 = 1e12;
/// Number of a failure by an exception.
const RAISED: u32 = 1;

/// A kind of node, made of a Python class.
#[pyclass(module = "asperity._asperity", frozen)]
pub struct Kind {
    descriptor: Descriptor,
    class: Arc<Class>,
}

/// Shared by all nodes of a kind.
struct Class {
    /// Makes a node's object.
    make: Py<PyAny>,
    /// Makes a port for the object: `asperity.Port`.
    port: Py<PyAny>,
    /// Makes the argument of `prepare`: `asperity.Setup`.
    setup: Py<PyAny>,
    /// Makes the argument of `process`: `asperity.Tick`.
    tick: Py<PyAny>,
    latency_ms: f64,
    kind: String,
    inputs: Vec<String>,
    outputs: Vec<String>,
    /// First exception that no warning has shown yet, and their number.
    raised: Mutex<Option<(String, u64)>>,
}

/// A declared port: name, shape, number of values, unit; no unit for that of the other ports.
type Declared = (String, String, usize, Option<String>);

#[pymethods]
impl Kind {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        make: Py<PyAny>,
        types: (Py<PyAny>, Py<PyAny>, Py<PyAny>),
        name: String,
        summary: String,
        inputs: Vec<Declared>,
        outputs: Vec<Declared>,
        params: Vec<(String, Bound<'_, PyAny>)>,
        latency_ms: f64,
    ) -> PyResult<Self> {
        let framed = inputs.iter().any(|(_, shape, ..)| shape == "frames" || shape == "spectrum");
        let sounds = inputs.iter().any(|(_, shape, ..)| shape == "audio");
        let rate = match (framed, sounds) {
            (true, _) => RateSpec::Of('l'),
            (false, true) => RateSpec::Of('r'),
            (false, false) => RateSpec::Graph,
        };
        let shape = |shape: &str, count: usize| match shape {
            "frames" => Ok(ShapeSpec::Magnitude(LayoutSpec::Of('l'))),
            "spectrum" => Ok(ShapeSpec::Spectrum(LayoutSpec::Of('l'))),
            "audio" => Ok(ShapeSpec::Audio(rate)),
            "control" => Ok(ShapeSpec::Control(count)),
            other => Err(PyValueError::new_err(format!(
                "there is no port `{other}`: `frames`, `spectrum`, `audio` or `control`"
            ))),
        };
        let fixed = |unit: &Option<String>| unit.clone().map_or(Unit::NONE, Unit::from_symbol);
        let mut descriptor = Descriptor::new(name.clone(), summary);
        for (name, kind, count, unit) in inputs {
            let input = Input::new(name, shape(&kind, count)?, fixed(&unit));
            descriptor = descriptor.input(if unit.is_none() { input.unit_of('u') } else { input });
        }
        for (name, kind, count, unit) in outputs {
            if matches!(kind.as_str(), "frames" | "spectrum") && !framed {
                let what = format!("the output `{name}` needs an input of frames, whose layout it has");
                return Err(PyValueError::new_err(what));
            }
            // A unit that no input determines is that of a signal.
            let unit = unit.or_else(|| (!framed && !sounds).then(|| "m/s^2".to_owned()));
            let output = Output::new(name, shape(&kind, count)?, fixed(&unit));
            descriptor = descriptor.output(if unit.is_none() { output.unit_of('u') } else { output });
        }
        for (name, default) in params {
            descriptor = descriptor.param(param(name, &default)?);
        }
        let (port, setup, tick) = types;
        let inputs = descriptor.inputs.iter().map(|port| port.name.to_string()).collect();
        let outputs = descriptor.outputs.iter().map(|port| port.name.to_string()).collect();
        let raised = Mutex::new(None);
        let class = Class { make, port, setup, tick, latency_ms, kind: name, inputs, outputs, raised };
        Ok(Self { descriptor, class: Arc::new(class) })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.class.kind
    }
}

impl Kind {
    pub fn kind(&self) -> Arc<NodeKind> {
        let class = self.class.clone();
        let prepare = move |setup: &Setup<'_>| Python::attach(|py| Node::prepared(py, &class, setup));
        Arc::new(NodeKind::new(self.descriptor.clone(), prepare))
    }
}

fn param(name: String, default: &Bound<'_, PyAny>) -> PyResult<Param> {
    let doc = "Set by the Python class.";
    let mut param = if default.is_instance_of::<PyBool>() {
        Param::flag("", default.extract()?, doc)
    } else if let Ok(whole) = default.extract::<i64>() {
        Param::integer("", whole, -(MOST as i64)..=MOST as i64, doc)
    } else if let Ok(number) = default.extract::<f64>() {
        Param::number("", number, -MOST..=MOST, doc)
    } else if let Ok(text) = default.extract::<String>() {
        Param::text("", &text, doc)
    } else {
        let what = format!("the parameter `{name}` is no number, text, or True or False");
        return Err(PyValueError::new_err(what));
    };
    param.name = name.into();
    Ok(param)
}

/// Warns of exceptions in nodes, once.
pub fn tell(py: Python<'_>, kinds: &[Py<Kind>]) -> PyResult<()> {
    for kind in kinds {
        let class = &kind.get().class;
        let raised = class.raised.lock().map(|mut raised| raised.take()).unwrap_or_default();
        let Some((text, times)) = raised else { continue };
        let times = if times == 1 { "once".to_owned() } else { format!("{times} times; the first time") };
        let message = format!("`{}` raised an exception {times}:\n{text}", class.kind);
        let warnings = py.import(intern!(py, "warnings"))?;
        warnings.call_method1(intern!(py, "warn"), (message, py.get_type::<AsperityWarning>(), 2))?;
    }
    Ok(())
}

/// An array that Python has, and of which port it is.
enum Port {
    /// A control's values.
    Control(Py<PyArray1<f64>>),
    /// Room for the samples of any tick, and a view of those of this tick.
    Audio {
        all: Py<PyArray1<f32>>,
        len: usize,
    },
    Magnitude(Py<PyArray1<f32>>),
    Spectrum(Py<PyArray1<Complex32>>),
}

struct Node {
    class: Arc<Class>,
    /// Parameters and arguments of `prepare`, to make the object anew.
    params: Vec<(String, ParamValue)>,
    setup: Py<PyAny>,
    object: Py<PyAny>,
    tick: Py<PyAny>,
    ins: Py<PyDict>,
    outs: Py<PyDict>,
    inputs: Vec<(String, Port)>,
    outputs: Vec<(String, Port)>,
    /// Input whose frames go out again.
    framed: Option<usize>,
}

impl Node {
    fn prepared(py: Python<'_>, class: &Arc<Class>, setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let made = Self::new(py, class, setup).map_err(|e| {
            let what = format!("`{}` could not be prepared:\n{}", setup.id, traceback(py, &e));
            setup.params.node_error(what).help("mend the Python class of this kind")
        })?;
        let latency = Latency::ratio((class.latency_ms * 1e3).round() as i64, 1_000_000);
        // Python allocates.
        Ok(Prepared { allocation_free: false, ..Prepared::new(made).latency(latency) })
    }

    fn new(py: Python<'_>, class: &Arc<Class>, setup: &Setup<'_>) -> PyResult<Self> {
        let names = |ports: &[Wiring], declared: &[String]| -> PyResult<(Py<PyDict>, Vec<(String, Port)>)> {
            let (described, mut arrays) = (PyDict::new(py), Vec::new());
            for (wiring, name) in ports.iter().zip(declared) {
                let Some(port) = &wiring.port else { continue };
                let unit = port.unit.to_string();
                let about = match port.shape {
                    Shape::Control { count } => ("control", setup.tick_hz, count, 0, 0.0, unit),
                    Shape::Audio { rate_hz } => ("audio", rate_hz, 1, 0, 0.0, unit),
                    Shape::Magnitude(l) => {
                        ("frames", l.rate_hz, l.bins as usize, l.length, l.frame_rate.hz(), unit)
                    }
                    Shape::Spectrum(l) => {
                        ("spectrum", l.rate_hz, l.bins as usize, l.length, l.frame_rate.hz(), unit)
                    }
                };
                described.set_item(name, class.port.call1(py, about)?)?;
                arrays.push((name.clone(), Port::new(py, port.shape, setup)));
            }
            Ok((described.unbind(), arrays))
        };
        let (described_in, inputs) = names(setup.inputs, &class.inputs)?;
        let (described_out, outputs) = names(setup.outputs, &class.outputs)?;
        let about = (setup.id, setup.tick_hz, setup.audio_hz, setup.seed, described_in, described_out);
        let about = class.setup.call1(py, about)?;
        let params: Vec<_> =
            setup.params.iter().map(|(name, value)| (name.to_owned(), value.clone())).collect();
        let (ins, outs) = (PyDict::new(py).unbind(), PyDict::new(py).unbind());
        let tick = class.tick.call1(py, (&ins, &outs))?;
        let object = make(py, class, &params, &about)?;
        let framed =
            inputs.iter().position(|(_, port)| matches!(port, Port::Magnitude(_) | Port::Spectrum(_)));
        Ok(Self {
            class: class.clone(),
            params,
            setup: about,
            object,
            tick,
            ins,
            outs,
            inputs,
            outputs,
            framed,
        })
    }

    fn call(&mut self, py: Python<'_>, tick: &mut Tick<'_>) -> PyResult<()> {
        let (ins, outs) = (self.ins.bind(py), self.outs.bind(py));
        let mut frame = None;
        for (i, (name, port)) in self.inputs.iter_mut().enumerate() {
            let came = match port {
                Port::Control(array) => {
                    copy_in(array.bind(py), tick.inputs.control(i))?;
                    ins.set_item(&*name, &*array)?;
                    None
                }
                Port::Audio { all, len } => {
                    let samples = tick.inputs.audio(i);
                    copy_in(all.bind(py), samples)?;
                    view(ins, name, all.bind(py), len, samples.len())?;
                    None
                }
                Port::Magnitude(array) => {
                    let came = tick.inputs.magnitude(i);
                    frame_in(ins, name, array.bind(py), came.map(|f| (f.bins, (f.index, f.start))))?
                }
                Port::Spectrum(array) => {
                    let came = tick.inputs.spectrum(i);
                    frame_in(ins, name, array.bind(py), came.map(|f| (f.bins, (f.index, f.start))))?
                }
            };
            if self.framed == Some(i) {
                frame = came;
            }
        }
        for (i, (name, port)) in self.outputs.iter_mut().enumerate() {
            match port {
                Port::Control(array) => outs.set_item(&*name, &*array)?,
                Port::Audio { all, len } => {
                    let wanted = tick.outputs.audio(i).len();
                    clear(all.bind(py))?;
                    view(outs, name, all.bind(py), len, wanted)?;
                }
                Port::Magnitude(array) => outs.set_item(&*name, frame.map(|_| &*array))?,
                Port::Spectrum(array) => outs.set_item(&*name, frame.map(|_| &*array))?,
            }
        }
        let about = self.tick.bind(py);
        about.setattr(intern!(py, "index"), tick.index)?;
        about.setattr(intern!(py, "frame"), frame.map(|(index, _)| index))?;
        about.setattr(intern!(py, "start"), frame.map(|(_, start)| start))?;
        self.object.call_method1(py, intern!(py, "process"), (about,))?;
        for (i, (_, port)) in self.outputs.iter().enumerate() {
            match (port, frame) {
                (Port::Control(array), _) => copy_out(array.bind(py), tick.outputs.control(i))?,
                (Port::Audio { all, .. }, _) => copy_out(all.bind(py), tick.outputs.audio(i))?,
                (Port::Magnitude(array), Some((index, start))) => {
                    copy_out(array.bind(py), tick.outputs.magnitude(i, index, start))?;
                }
                (Port::Spectrum(array), Some((index, start))) => {
                    copy_out(array.bind(py), tick.outputs.spectrum(i, index, start))?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Keeps an exception until `tell` warns of it.
    fn keep(&self, py: Python<'_>, e: &PyErr) {
        if e.is_instance_of::<PyKeyboardInterrupt>(py) {
            return interrupted();
        }
        if let Ok(mut raised) = self.class.raised.lock() {
            match &mut *raised {
                Some((_, times)) => *times += 1,
                none => *none = Some((traceback(py, e), 1)),
            }
        }
    }
}

impl Processor for Node {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        // After Ctrl-C, the rest of a long run takes no time.
        if is_interrupted() {
            return Status::Error(RAISED);
        }
        Python::attach(|py| match self.call(py, tick) {
            Ok(()) => Status::Continue,
            Err(e) => {
                self.keep(py, &e);
                Status::Error(RAISED)
            }
        })
    }

    fn reset(&mut self) {
        Python::attach(|py| match make(py, &self.class, &self.params, &self.setup) {
            Ok(object) => self.object = object,
            Err(e) => self.keep(py, &e),
        });
    }

    fn facts(&mut self) -> Vec<Fact> {
        let raised = self.class.raised.lock().map(|raised| raised.clone()).unwrap_or_default();
        raised.into_iter().map(|(text, _)| Fact::text("exception", text)).collect()
    }
}

/// Makes a node's object: parameters become attributes, then `prepare` is called.
fn make(
    py: Python<'_>,
    class: &Class,
    params: &[(String, ParamValue)],
    setup: &Py<PyAny>,
) -> PyResult<Py<PyAny>> {
    let object = class.make.call0(py)?;
    for (name, value) in params {
        let value = match value {
            ParamValue::Number(x) => x.into_py_any(py)?,
            ParamValue::Integer(x) => x.into_py_any(py)?,
            ParamValue::Flag(x) => x.into_py_any(py)?,
            ParamValue::Text(x) => x.into_py_any(py)?,
            other => other.to_string().into_py_any(py)?,
        };
        object.setattr(py, name.as_str(), value)?;
    }
    if object.bind(py).hasattr(intern!(py, "prepare"))? {
        object.call_method1(py, intern!(py, "prepare"), (setup,))?;
    }
    Ok(object)
}

impl Port {
    fn new(py: Python<'_>, shape: Shape, setup: &Config<'_>) -> Self {
        match shape {
            Shape::Control { count } => Self::Control(PyArray1::zeros(py, count, false).unbind()),
            Shape::Audio { rate_hz } => {
                let most = asperity_node::time::max_samples(rate_hz, setup.tick_hz);
                Self::Audio { all: PyArray1::zeros(py, most, false).unbind(), len: usize::MAX }
            }
            Shape::Magnitude(l) => Self::Magnitude(PyArray1::zeros(py, l.bins as usize, false).unbind()),
            Shape::Spectrum(l) => Self::Spectrum(PyArray1::zeros(py, l.bins as usize, false).unbind()),
        }
    }
}

/// Puts the first `wanted` samples of an array under a name, if others are there.
fn view(
    to: &Bound<'_, PyDict>,
    name: &str,
    all: &Bound<'_, PyArray1<f32>>,
    len: &mut usize,
    wanted: usize,
) -> PyResult<()> {
    if *len != wanted {
        *len = wanted;
        to.set_item(name, all.get_item(PySlice::new(to.py(), 0, wanted as isize, 1))?)?;
    }
    Ok(())
}

/// Puts a frame under a name, or none; answers its index and first sample.
fn frame_in<T: numpy::Element + Copy>(
    to: &Bound<'_, PyDict>,
    name: &str,
    array: &Bound<'_, PyArray1<T>>,
    came: Option<(&[T], (u64, u64))>,
) -> PyResult<Option<(u64, u64)>> {
    if let Some((bins, _)) = came {
        copy_in(array, bins)?;
    }
    to.set_item(name, came.map(|_| array))?;
    Ok(came.map(|(_, frame)| frame))
}

fn clear(array: &Bound<'_, PyArray1<f32>>) -> PyResult<()> {
    array.readwrite().as_slice_mut()?.fill(0.0);
    Ok(())
}

fn copy_in<T: numpy::Element + Copy>(to: &Bound<'_, PyArray1<T>>, from: &[T]) -> PyResult<()> {
    let mut to = to.readwrite();
    let to = to.as_slice_mut()?;
    let len = to.len().min(from.len());
    to[..len].copy_from_slice(&from[..len]);
    Ok(())
}

fn copy_out<T: numpy::Element + Copy>(from: &Bound<'_, PyArray1<T>>, to: &mut [T]) -> PyResult<()> {
    let from = from.readonly();
    let from = from.as_slice()?;
    let len = to.len().min(from.len());
    to[..len].copy_from_slice(&from[..len]);
    Ok(())
}

/// An exception with its place in the Python file.
fn traceback(py: Python<'_>, e: &PyErr) -> String {
    let lines = py
        .import(intern!(py, "traceback"))
        .and_then(|module| {
            let parts = (e.get_type(py), e.value(py), e.traceback(py));
            module.call_method1(intern!(py, "format_exception"), parts)
        })
        .and_then(|lines| lines.extract::<Vec<String>>());
    lines.map_or_else(|_| e.to_string(), |lines| lines.concat().trim_end().to_owned())
}
