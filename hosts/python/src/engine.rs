//! A graph that runs tick by tick, and whose stylus the caller moves.

use std::sync::{Mutex, MutexGuard};

use asperity_engine::Options;
use asperity_live::place;
use asperity_node::Role;
use asperity_offline::render::{channels, interleaved, samples};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::error::raise_interrupt;
use crate::graph::Ready;
use crate::node::{Kind, tell};
use crate::values::Values;

/// An engine at a tick.
#[pyclass(module = "asperity._asperity", frozen)]
pub struct Engine {
    state: Mutex<State>,
    python: Vec<Py<Kind>>,
    #[pyo3(get)]
    rate: u32,
    #[pyo3(get)]
    tick_hz: u32,
}

struct State {
    engine: asperity_engine::Engine,
    hand: Option<usize>,
    strokes: f64,
    channels: Vec<usize>,
    probes: Vec<Values>,
}

impl Engine {
    pub fn new(ready: Ready, python: Vec<Py<Kind>>) -> Self {
        let Ready { compiled, probes, .. } = ready;
        let schedule = &compiled.schedule;
        let hand = schedule.with_role(Role::Hand).next().map(|(node, _)| node);
        let (rate, tick_hz, channels) = (schedule.audio_hz, schedule.tick_hz, channels(schedule));
        let engine = asperity_engine::Engine::new(compiled, Options::default());
        let mut state = State { engine, hand, strokes: 0.0, channels, probes };
        state.begin();
        Self { state: Mutex::new(state), python, rate, tick_hz }
    }

    /// The state. Waiting for it with the GIL could deadlock.
    fn state(&self) -> PyResult<MutexGuard<'_, State>> {
        self.state.try_lock().map_err(|_| PyRuntimeError::new_err("this engine is in a tick already"))
    }
}

impl State {
    /// A hand that does not press, in its first stroke. Until it has a position, the output is silent.
    fn begin(&mut self) {
        self.strokes = 0.0;
        if let Some(hand) = self.hand {
            self.engine.feed_control(hand, place::FORCE, &[0.0], true);
            self.engine.feed_control(hand, place::STROKE, &[0.0], true);
        }
    }
}

#[pymethods]
impl Engine {
    /// Moves the hand, runs one tick, and answers its samples: \[n\], or \[n, channels\].
    #[pyo3(signature = (position=None, force=None, jump=false))]
    fn tick<'py>(
        &self,
        py: Python<'py>,
        position: Option<Position>,
        force: Option<f64>,
        jump: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut state = self.state()?;
        let State { engine, hand, strokes, channels, probes } = &mut *state;
        if let Some(hand) = *hand {
            let mut fed = true;
            if let Some(Position(position)) = position {
                fed &= engine.feed_control(hand, place::POSITION, &position, true);
            }
            if let Some(force) = force {
                fed &= engine.feed_control(hand, place::FORCE, &[force], true);
            }
            if jump {
                *strokes += 1.0;
                engine.feed_control(hand, place::STROKE, &[*strokes], true);
            }
            if !fed {
                return Err(PyValueError::new_err("position and force must be finite numbers"));
            }
        } else if position.is_some() || force.is_some() {
            return Err(PyValueError::new_err("this graph has no stylus that could be moved"));
        }
        let tick = engine.next_tick();
        engine.tick();
        for probe in probes.iter_mut() {
            probe.clear();
            probe.take(engine, tick);
        }
        let answer = if let [one] = channels.as_slice() {
            PyArray1::from_slice(py, samples(engine.output(*one, 0))).into_any()
        } else {
            let all = interleaved(engine, channels);
            let rows = all.len() / channels.len().max(1);
            PyArray1::from_vec(py, all).reshape([rows, channels.len()])?.into_any()
        };
        drop(state);
        raise_interrupt()?;
        tell(py, &self.python)?;
        Ok(answer)
    }

    /// Values of a probe in the last tick.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let state = self.state()?;
        find(&state.probes, name)?.latest(py)
    }

    /// Unit of a probe.
    fn unit(&self, name: &str) -> PyResult<String> {
        let state = self.state()?;
        Ok(find(&state.probes, name)?.unit())
    }

    #[getter]
    fn probes(&self) -> PyResult<Vec<String>> {
        Ok(self.state()?.probes.iter().map(|probe| probe.name.clone()).collect())
    }

    /// Number of the next tick.
    #[getter]
    fn ticks(&self) -> PyResult<u64> {
        Ok(self.state()?.engine.next_tick())
    }

    #[getter]
    fn faults(&self) -> PyResult<u64> {
        Ok(self.state()?.engine.faults())
    }

    /// Goes back to tick 0.
    fn reset(&self) -> PyResult<()> {
        let mut state = self.state()?;
        state.engine.reset();
        state.begin();
        state.probes.iter_mut().for_each(Values::clear);
        Ok(())
    }
}

/// A probe by its name.
pub fn find<'a>(probes: &'a [Values], name: &str) -> PyResult<&'a Values> {
    probes.iter().find(|probe| probe.name == name).ok_or_else(|| PyKeyError::new_err(name.to_owned()))
}

/// x, y and z \[mm\]: an array or any other sequence of three numbers.
struct Position([f64; 3]);

impl<'a, 'py> FromPyObject<'a, 'py> for Position {
    type Error = PyErr;

    fn extract(of: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = of.extract::<PyReadonlyArray1<'py, f64>>() {
            let values = array.as_slice().ok().and_then(|values| <[f64; 3]>::try_from(values).ok());
            if let Some(values) = values {
                return Ok(Self(values));
            }
        }
        let all: Vec<f64> = of.extract()?;
        let wrong = |all: Vec<f64>| {
            PyValueError::new_err(format!("a position has x, y and z in mm, and this has {}", all.len()))
        };
        <[f64; 3]>::try_from(all).map(Self).map_err(wrong)
    }
}
