//! Arrays that grow while a graph runs.

use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::{Shape, Unit};
use asperity_offline::probe::Probe;
use numpy::{Complex32, IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// Values of a probe, tick by tick.
pub struct Values {
    /// The name that the caller gave.
    pub name: String,
    probe: Probe,
    unit: Unit,
    tick_hz: u32,
    rows: Vec<f32>,
    /// First sample of each frame.
    starts: Vec<u64>,
}

impl Values {
    /// Starts for a node that records: its input, by its index. `None` for an input without a type.
    pub fn new(name: &str, node: usize, schedule: &Schedule) -> Option<Self> {
        let port = schedule.nodes[node].inputs.first()?.port.clone()?;
        let (probe, unit) = (Probe { node, shape: port.shape }, port.unit);
        let tick_hz = schedule.tick_hz;
        Some(Self { name: name.to_owned(), probe, unit, tick_hz, rows: Vec::new(), starts: Vec::new() })
    }

    pub fn take(&mut self, engine: &Engine, tick: u64) {
        if let Some((start, values)) = self.probe.take(engine, tick) {
            self.rows.extend(values);
            if self.is_frames() {
                self.starts.push(start);
            }
        }
    }

    fn is_frames(&self) -> bool {
        matches!(self.probe.shape, Shape::Magnitude(_) | Shape::Spectrum(_))
    }

    /// Rows a second.
    pub fn rate(&self) -> f64 {
        match self.probe.shape {
            Shape::Control { .. } => self.tick_hz.into(),
            Shape::Audio { rate_hz } => rate_hz.into(),
            Shape::Magnitude(l) | Shape::Spectrum(l) => l.frame_rate.hz(),
        }
    }

    pub fn unit(&self) -> String {
        self.unit.to_string()
    }

    /// Distance of two bins \[Hz\]; 0 where there are none.
    pub fn bin_hz(&self) -> f64 {
        match self.probe.shape {
            Shape::Magnitude(l) | Shape::Spectrum(l) => l.bin_hz(),
            _ => 0.0,
        }
    }

    /// Times of the rows of frames \[s\]; none for other values, whose rows are evenly spaced.
    pub fn times(&self) -> Vec<f64> {
        let rate_hz = f64::from(self.probe.rate_hz(self.tick_hz));
        self.starts.iter().map(|start| *start as f64 / rate_hz).collect()
    }

    /// The values so far: \[rows\], or \[rows, columns\]; frames always have two dimensions.
    pub fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let columns = self.probe.columns();
        if let Shape::Spectrum(l) = self.probe.shape {
            let bins = self.rows.chunks_exact(2).map(|z| Complex32::new(z[0], z[1])).collect::<Vec<_>>();
            let rows = bins.len() / l.bins as usize;
            return Ok(bins.into_pyarray(py).reshape([rows, l.bins as usize])?.into_any());
        }
        let array = PyArray1::from_slice(py, &self.rows);
        if columns == 1 && !self.is_frames() {
            return Ok(array.into_any());
        }
        Ok(array.reshape([self.rows.len() / columns.max(1), columns])?.into_any())
    }

    /// The values of one tick: \[values\] or \[samples\], and \[frames, bins\].
    pub fn latest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        if self.is_frames() { self.array(py) } else { Ok(PyArray1::from_slice(py, &self.rows).into_any()) }
    }

    /// Forgets the values: those of the next tick alone follow.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.starts.clear();
    }
}
