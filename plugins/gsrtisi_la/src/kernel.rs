//! The estimation, frame by frame, without a graph.

use asperity_fft::Transform;
use asperity_numbers::{Elementary as _, polar};
use std::f64::consts::TAU;

use asperity_sdk::{Complex, State};

use crate::grid::{Grid, Place};

/// Length of the ramp of the analysis window before the last covered sample, as part of a window.
/// Before it, an estimate has full weight.
const TAPER: f64 = 0.145;
/// The same for a new frame, which only the other frames determine.
const FIRST_TAPER: f64 = 0.1;
/// Extrapolation of a bin in the direction of its last step (after N. Perraudin, P. Balazs, P. L.
/// Sondergaard, "A Fast Griffin-Lim Algorithm", WASPAA 2013).
const MOMENTUM: f32 = 0.6;
/// Phase of an onset after silence, in turns a bin: a pulse late in the frame, where new samples enter.
const ONSET: f64 = 0.27;
/// Larger magnitudes would overflow in the sums: their phases are computed as for this one.
const LARGEST: f32 = 1e30;
/// Smaller bins have no direction.
const SMALLEST: f32 = 1e-30;
/// A sample covered by less than this, in squared windows, has no estimate.
const COVERED: f32 = 1e-7;

/// A frame that is being estimated.
#[derive(Clone, Debug)]
struct Flight {
    place: Place,
    mags: Vec<f32>,
    /// Direction of each bin: phases from the frame's first sample of the grid.
    units: Vec<Complex<f32>>,
    /// Bins of the last analysis.
    bins: Vec<Complex<f32>>,
    /// Synthesis window.
    window: Vec<f32>,
    /// Analysis window, divided by the cover of each sample.
    analysis: Vec<f32>,
    /// Contribution of this frame to the sum.
    part: Vec<f32>,
}

impl Flight {
    fn new(size: usize, bins: usize) -> Self {
        let (samples, none) = (vec![0.0; size], vec![Complex::default(); bins]);
        Self {
            place: Place::default(),
            mags: vec![0.0; bins],
            units: none.clone(),
            bins: none,
            window: samples.clone(),
            analysis: samples.clone(),
            part: samples,
        }
    }

    fn sane(&self) -> bool {
        let finite = |c: &Complex<f32>| c.re.is_finite() && c.im.is_finite();
        self.mags.iter().all(|m| (0.0..=f32::MAX).contains(m))
            && self.units.iter().chain(&self.bins).all(finite)
            && self.part.iter().all(|x| x.is_finite())
    }
}

/// RTISI with look-ahead, for Hann-windowed frames of one length.
///
/// After a frame is [`push`](Self::push)ed, the one `look_ahead` frames before it can be
/// [answered](Self::answer).
pub struct Estimator {
    grid: Grid,
    iterations: usize,
    transform: Transform<f32>,
    /// Newest first.
    flights: Vec<Flight>,
    /// Number of valid `flights`.
    filled: usize,
    /// Sum of all windowed frames that reach beyond `origin`.
    sum: Vec<f32>,
    /// Sum of their squared windows.
    cover: Vec<f32>,
    /// Sample of the grid at which the sums begin.
    origin: u64,
    /// Cosine and sine over one turn.
    circle: Vec<(f64, f64)>,
    /// Direction of bins that nothing determines.
    onset: Vec<Complex<f32>>,
}

impl Estimator {
    /// For frames of `bins` magnitudes, from bin 0, of a transform of `length` samples, at most `hop`
    /// samples apart. Each new frame starts `iterations` rounds over all frames that are not answered
    /// yet.
    pub fn new(length: u32, bins: usize, hop: u64, look_ahead: usize, iterations: usize) -> Self {
        let grid = Grid::new(length, bins);
        let size = grid.size();
        let room = size + (look_ahead + 1) * grid.span(hop);
        let angle = |i: usize| TAU * i as f64 / size as f64;
        let onset = |k: usize| polar(1.0, (TAU * ONSET * k as f64) as f32);
        Self {
            grid,
            iterations,
            transform: Transform::new(size),
            flights: vec![Flight::new(size, bins); look_ahead + 1],
            filled: 0,
            sum: vec![0.0; room],
            cover: vec![0.0; room],
            origin: 0,
            circle: (0..size).map(|i| (angle(i).cosine(), angle(i).sine())).collect(),
            onset: (0..bins).map(onset).collect(),
        }
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.filled = 0;
        self.sum.fill(0.0);
        self.cover.fill(0.0);
    }

    /// Saves or restores the frames and sums.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut grid = self.grid;
        grid.state(state);
        state.keep(&mut self.filled).keep(&mut self.origin).keep(&mut self.sum).keep(&mut self.cover);
        let mut sane = grid == self.grid && self.filled <= self.flights.len();
        sane &= self.sum.iter().chain(&self.cover).all(|x| x.is_finite());
        let end = self.origin.saturating_add((self.sum.len() - self.grid.size()) as u64);
        let mut newer = end;
        for (age, flight) in self.flights.iter_mut().enumerate() {
            state.keep(&mut flight.place.at).keep(&mut flight.place.part).keep(&mut flight.mags);
            state.keep(&mut flight.units).keep(&mut flight.bins).keep(&mut flight.part);
            sane &= flight.sane();
            if age < self.filled {
                sane &= (self.origin..=newer).contains(&flight.place.at);
                newer = flight.place.at;
            }
        }
        state.require(sane);
        if state.restores() {
            (0..self.flights.len()).for_each(|age| self.shape(age));
        }
    }

    /// Takes the next frame, whose first output sample is `start`, and estimates all that are not
    /// answered. A magnitude that is NaN, infinite or negative counts as 0; their number is returned.
    /// Missing bins count as 0.
    pub fn push(&mut self, magnitudes: &[f32], start: u64) -> usize {
        let place = self.grid.place(start);
        if !self.follows(place) {
            self.reset();
        }
        self.flights.rotate_right(1);
        self.filled = (self.filled + 1).min(self.flights.len());
        self.flights[0].place = place;
        self.slide();
        let bad = self.take(magnitudes);
        self.estimate();
        bad
    }

    /// Whether a frame fits those in flight: it overlaps the newest, and the oldest is in reach.
    fn follows(&self, place: Place) -> bool {
        let kept = self.filled.min(self.flights.len() - 1);
        let newest = self.flights[0].place.at;
        let oldest = if kept == 0 { place.at } else { self.flights[kept - 1].place.at };
        let size = self.grid.size();
        self.filled == 0
            || (place.at >= newest
                && place.at - newest < size as u64
                && place.at.saturating_sub(oldest) <= (self.sum.len() - size) as u64)
    }

    /// Whether there is a frame to answer: as many came as the look-ahead, and one more.
    pub fn answers(&self) -> bool {
        self.filled == self.flights.len()
    }

    /// The oldest frame in flight: its magnitudes with phases counted from the frame's first sample.
    pub fn answer(&self, out: &mut [Complex<f32>]) {
        out.fill(Complex::default());
        let Some(flight) = self.flights.get(self.filled.wrapping_sub(1)) else { return };
        // From the grid's sample to the frame's start.
        let turn = TAU * self.grid.fraction(flight.place) / self.grid.size() as f64;
        let bins = flight.mags.iter().zip(&flight.units).enumerate();
        for (out, (k, (&mag, unit))) in out.iter_mut().zip(bins) {
            let (sin, cos) = if turn == 0.0 { (0.0, 1.0) } else { (turn * k as f64).sine_cosine() };
            *out = unit * Complex::new(cos as f32, sin as f32) * mag;
        }
    }

    /// Moves the sums so that they begin with the oldest frame in flight.
    fn slide(&mut self) {
        let Some(oldest) = self.flights.get(self.filled.wrapping_sub(1)) else { return };
        let by = usize::try_from(oldest.place.at.saturating_sub(self.origin)).unwrap_or(usize::MAX);
        self.origin = oldest.place.at;
        for sums in [&mut self.sum, &mut self.cover] {
            let by = by.min(sums.len());
            sums.copy_within(by.., 0);
            let kept = sums.len() - by;
            sums[kept..].fill(0.0);
        }
    }

    fn take(&mut self, magnitudes: &[f32]) -> usize {
        let flight = &mut self.flights[0];
        let mut bad = 0;
        // Directions have length one up to rounding, which must not make the largest magnitude
        // infinite.
        let most = f32::MAX * (1.0 - 8.0 * f32::EPSILON);
        let given = magnitudes.iter().copied().chain(std::iter::repeat(0.0));
        for (mag, from) in flight.mags.iter_mut().zip(given) {
            let good = (0.0..=f32::MAX).contains(&from);
            *mag = if good { from.min(most) } else { 0.0 };
            bad += usize::from(!good);
        }
        flight.part.fill(0.0);
        self.shape(0);
        bad
    }

    /// The Hann window of a frame where it lies on the grid.
    fn shape(&mut self, age: usize) {
        let flight = &mut self.flights[age];
        let (sin, cos) = (TAU * self.grid.fraction(flight.place) / self.circle.len() as f64).sine_cosine();
        for (w, (c, s)) in flight.window.iter_mut().zip(&self.circle) {
            *w = (0.5 - 0.5 * (c * cos + s * sin)) as f32;
        }
    }

    fn estimate(&mut self) {
        self.weigh(0, FIRST_TAPER);
        self.update(0, 0.0);
        let at = self.offset(0);
        for (cover, w) in self.cover[at..].iter_mut().zip(&self.flights[0].window) {
            *cover += w * w;
        }
        for age in 0..self.filled {
            self.weigh(age, TAPER);
        }
        for round in 0..self.iterations {
            for age in usize::from(round == 0)..self.filled {
                self.update(age, MOMENTUM);
            }
        }
    }

    /// Position of a frame in the sums.
    fn offset(&self, age: usize) -> usize {
        let at = self.flights[age].place.at.saturating_sub(self.origin) as usize;
        at.min(self.sum.len() - self.grid.size())
    }

    /// Computes the analysis window of a frame. It has less weight where only the newest frames
    /// contribute, as these are least certain.
    fn weigh(&mut self, age: usize, taper: f64) {
        let (at, size) = (self.offset(age), self.grid.size());
        let end = (self.offset(0) + size - at) as f32;
        let slope = 1.0 / (taper * size as f64) as f32;
        let flight = &mut self.flights[age];
        let covers = flight.window.iter().zip(&self.cover[at..]);
        for (i, (a, (w, &cover))) in flight.analysis.iter_mut().zip(covers).enumerate() {
            let ramp = ((end - i as f32 - 0.5) * slope).min(1.0);
            *a = if cover > COVERED { w * ramp / cover } else { 0.0 };
        }
    }

    /// Gives a frame the phases of the sum of all frames, and updates its contribution to the sum.
    fn update(&mut self, age: usize, momentum: f32) {
        let at = self.offset(age);
        let flight = &mut self.flights[age];
        let sum = &mut self.sum[at..];
        for ((x, s), a) in self.transform.time.iter_mut().zip(sum.iter()).zip(&flight.analysis) {
            *x = s * a;
        }
        self.transform.forward();
        let found = self.transform.bins.iter().zip(&self.onset);
        for ((unit, bin), (&now, &onset)) in flight.units.iter_mut().zip(&mut flight.bins).zip(found) {
            *unit = direction(now + (now - *bin) * momentum).unwrap_or(onset);
            *bin = now;
        }
        let size = self.transform.time.len();
        let nyquist = size.is_multiple_of(2).then_some(size / 2);
        for k in [Some(0), nyquist].into_iter().flatten() {
            if let Some(unit) = flight.units.get_mut(k) {
                *unit = Complex::new(if unit.re < 0.0 { -1.0 } else { 1.0 }, 0.0);
            }
        }
        self.transform.bins.fill(Complex::default());
        for (to, (unit, mag)) in self.transform.bins.iter_mut().zip(flight.units.iter().zip(&flight.mags)) {
            // An amplitude is four times the bin of a Hann-windowed frame over its length.
            *to = unit * (0.25 * mag.min(LARGEST));
        }
        self.transform.inverse();
        let made = self.transform.time.iter().zip(&flight.window);
        for ((sum, part), (x, w)) in sum.iter_mut().zip(&mut flight.part).zip(made) {
            let new = x * w;
            *sum += new - *part;
            *part = new;
        }
    }
}

/// Direction of a number; none for a negligible one.
#[inline]
fn direction(x: Complex<f32>) -> Option<Complex<f32>> {
    // Squares of the number itself could overflow or underflow.
    let top = x.re.abs().max(x.im.abs());
    (top > SMALLEST).then(|| {
        let y = x / top;
        y / (y.re * y.re + y.im * y.im).sqrt()
    })
}
