//! The recording in blocks of 10 ms, and which of them are unusable.

use std::ops::Range;

use asperity_diagnostics::Diagnostic;

use super::super::triangles::range;
use super::signal::prepared;
use super::{Dropped, Recording, Segment, Settings, Tolerance, Why};

/// Blocks a second.
const BLOCKS_HZ: f64 = 100.0;
/// Blocks in the mean that decides about contact and speed.
const SMOOTH: usize = 5;
/// Time without any change that means no signal, in s.
const STILL_S: f64 = 0.02;
/// Time at the sensor's limit in s; at least three samples.
const CLIPPED_S: f64 = 0.001;
/// Blocks before and behind a clipped place that go too: they are as loud.
const GUARD: usize = 3;
/// Neighbours of a block to each side, in blocks.
const AROUND: usize = 50;
/// Power of a click over the median of its neighbours.
const LOUD: f64 = 100.0;
/// Most loud blocks among the neighbours. More are the texture.
const RARE: usize = 5;

/// Blocks of which a level is taken: long enough for a period of 20 Hz, short beside a dead stretch.
const WINDOW: usize = 5;
/// Blocks that share a speed and force.
const PLACE: usize = 10;
/// Least places to expect a level from.
const FEW: usize = 5;
/// Power over the expected one below which a sensor is dead.
const DEAD: f64 = 0.01;
/// Least blocks of a dead stretch, among places of which most are alive.
const DEAD_BLOCKS: usize = 10;
/// Least blocks of a dead stretch, among places of which a tenth is alive: no bumpy texture is quiet so long.
const LONG_DEAD_BLOCKS: usize = 100;

/// A range of blocks.
pub(super) type Span = Range<usize>;

/// Samples at the models' rate, and quantities by blocks of them.
pub(super) struct Blocks {
    pub(super) rate_hz: f64,
    /// Samples in a block.
    pub(super) len: usize,
    /// Samples of all blocks.
    pub(super) signal: Vec<f64>,
    /// Mean speed in mm/s and force in N.
    means: Vec<[f64; 2]>,
    /// Means over some blocks around.
    pub(super) smooth: Vec<[f64; 2]>,
    why: Vec<Option<Why>>,
    /// Part of the power above half the models' rate, 0 to 1.
    pub(super) above: f64,
}

impl Blocks {
    pub(super) fn new(recording: &Recording<'_>, settings: &Settings) -> Result<Self, Diagnostic> {
        let (rate_hz, recorded_hz) = (f64::from(settings.model_hz), recording.rate_hz.round());
        let len = (rate_hz / BLOCKS_HZ).round() as usize;
        let mut axes: Vec<Vec<f64>> = recording.acceleration_m_s2.iter().map(|axis| axis.to_vec()).collect();
        let samples = recording.force_n.len();
        let count = (samples as f64 / recorded_hz * rate_hz) as usize / len;
        // Samples of the recording in a block.
        let each = len as f64 / rate_hz * recorded_hz;
        let sample = |block: usize| ((block as f64 * each).round() as usize).min(samples);
        let spans: Vec<Range<usize>> = (0..count).map(|b| sample(b)..sample(b + 1)).collect();
        let mean = |channel: &[f64], span: &Range<usize>, of: fn(f64) -> f64| {
            let part = &channel[span.clone()];
            part.iter().map(|x| of(*x)).sum::<f64>() / part.len().max(1) as f64
        };
        let place = |span| [mean(recording.speed_mm_s, span, f64::abs), mean(recording.force_n, span, |f| f)];
        let means: Vec<[f64; 2]> = spans.iter().map(place).collect();
        let around = |b: usize| b.saturating_sub(SMOOTH / 2)..(b + SMOOTH / 2 + 1).min(count);
        let smooth = (0..count).map(|b| average(&means[around(b)])).collect();
        let mut it =
            Self { rate_hz, len, signal: Vec::new(), means, smooth, why: vec![None; count], above: 0.0 };
        let block = |sample: usize| ((sample as f64 / each) as usize).min(count);
        it.mark_stuck(&axes, recording.rate_hz, &block);
        it.mark_low(1, settings.least_force_n, Why::NoContact);
        it.mark_low(0, settings.least_speed_mm_s, Why::Slow);
        it.mark_clicks(&mut axes, &spans);
        it.mark_dead(&axes, &spans, &settings.tolerance);
        // A stretch without a signal begins and ends with a step, on which the high-pass would ring.
        let is_off = |why: Option<Why>| matches!(why, Some(Why::Still | Why::Dead));
        for (run, _) in it.spans().into_iter().filter(|(_, why)| is_off(*why)) {
            let samples = spans[run.start].start..spans[run.end - 1].end;
            axes.iter_mut().for_each(|axis| line(axis, samples.start, samples.end));
        }
        (it.signal, it.above) = prepared(axes, recorded_hz, settings)?;
        it.signal.resize(count * len, 0.0);
        Ok(it)
    }

    /// Gives a reason to those of some blocks that have none.
    fn mark(&mut self, blocks: Range<usize>, why: Why) {
        self.why.iter_mut().take(blocks.end).skip(blocks.start).for_each(|of| _ = of.get_or_insert(why));
    }

    /// Marks blocks where all axes stand still or one is at its limit.
    fn mark_stuck(&mut self, axes: &[Vec<f64>], rate_hz: f64, block: &dyn Fn(usize) -> usize) {
        let mut still = vec![0; self.why.len()];
        let mut clipped = Vec::new();
        for axis in axes {
            let mut of_axis = vec![0; still.len()];
            for (run, why) in stuck(axis, rate_hz) {
                let (first, end) = (block(run.start), block(run.end - 1) + 1);
                match why {
                    Why::Clipped => clipped.push(first.saturating_sub(GUARD)..end + GUARD),
                    _ => of_axis.iter_mut().take(end).skip(first).for_each(|b| *b = 1),
                }
            }
            still.iter_mut().zip(of_axis).for_each(|(axes, of_axis)| *axes += of_axis);
        }
        for (b, _) in still.into_iter().enumerate().filter(|(_, count)| *count == axes.len()) {
            self.mark(b..b + 1, Why::Still);
        }
        clipped.into_iter().for_each(|run| self.mark(run, Why::Clipped));
    }

    fn mark_low(&mut self, axis: usize, least: f64, why: Why) {
        for (of, _) in self.why.iter_mut().zip(&self.smooth).filter(|(_, smooth)| smooth[axis] < least) {
            of.get_or_insert(why);
        }
    }

    /// Marks clicks and replaces each by a line.
    fn mark_clicks(&mut self, axes: &mut [Vec<f64>], spans: &[Range<usize>]) {
        let power = |span: &Range<usize>| {
            let parts = axes.iter().filter_map(|a| a.get(span.start.saturating_sub(1)..span.end));
            parts.flat_map(|part| part.windows(2)).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>()
        };
        let powers: Vec<f64> = spans.iter().map(power).collect();
        let mut clicks = Vec::new();
        let mut near: Vec<f64> = Vec::new();
        for b in 0..powers.len() {
            if self.why[b].is_some() {
                continue;
            }
            near.clear();
            let around = b.saturating_sub(AROUND)..(b + AROUND + 1).min(powers.len());
            near.extend(around.filter(|i| self.why[*i].is_none()).map(|i| powers[i]));
            let middle = near.len() / 2;
            let median = *near.select_nth_unstable_by(middle, f64::total_cmp).1;
            let loud = near.iter().filter(|p| **p > LOUD * median).count();
            if powers[b] > LOUD * median && loud <= RARE && near.len() > 4 * RARE {
                clicks.push(b);
            }
        }
        for run in clicks.chunk_by(|a, b| a + 1 == *b) {
            let (first, last) = (run[0], run[run.len() - 1]);
            axes.iter_mut().for_each(|axis| line(axis, spans[first].start, spans[last].end));
            self.mark(first.saturating_sub(1)..last + 2, Why::Click);
        }
    }

    /// Marks stretches that are far quieter than the recording is elsewhere at their speed and force.
    ///
    /// A texture gets no quieter with speed or force. So two medians are compared with: of all places of
    /// like speed and force, and of all that are not faster and not pressed harder. Where most places of a
    /// speed and force are dead, their median is dead, too: long stretches are compared with the loudest
    /// tenth of those places.
    fn mark_dead(&mut self, axes: &[Vec<f64>], spans: &[Range<usize>], tolerance: &Tolerance) {
        let sums = |axis: &Vec<f64>| {
            let mut sums = vec![[0.0; 2]];
            for (i, span) in spans.iter().enumerate() {
                let of = |power: i32| axis[span.clone()].iter().map(|x| x.powi(power)).sum::<f64>();
                sums.push([sums[i][0] + of(1), sums[i][1] + of(2)]);
            }
            sums
        };
        let sums: Vec<Vec<[f64; 2]>> = axes.iter().map(sums).collect();
        // Mean square around the mean, which takes gravity out.
        let power = |blocks: Span| {
            let count = (spans[blocks.end - 1].end - spans[blocks.start].start) as f64;
            let of = |sums: &Vec<[f64; 2]>| {
                let [sum, squares] = [0, 1].map(|i| sums[blocks.end][i] - sums[blocks.start][i]);
                (squares - sum * sum / count) / count
            };
            sums.iter().map(of).sum::<f64>()
        };
        let runs = self.runs().into_iter().filter(|run| run.len() >= WINDOW);
        let places: Vec<(Span, [f64; 2], f64)> = runs
            .flat_map(|run| (run.start..run.end).step_by(PLACE).map(move |b| b..run.end.min(b + PLACE)))
            .map(|place| (place.clone(), average(self.smooth_of(&place)), power(place)))
            .collect();
        let loudest = places.iter().map(|(.., power)| *power).fold(0.0, f64::max);
        let mut is_quiet = [DEAD_BLOCKS, LONG_DEAD_BLOCKS].map(|least| (least, vec![false; self.why.len()]));
        let mut levels = Vec::new();
        for (place, at, _) in &places {
            let limits = tolerance.of(*at);
            let mut quantile = |part: f64, is_like: &dyn Fn(usize, f64) -> bool| {
                levels.clear();
                let like =
                    places.iter().filter(|(_, other, _)| (0..2).all(|axis| is_like(axis, other[axis])));
                levels.extend(like.map(|(.., power)| *power));
                let at = (part * levels.len() as f64) as usize;
                let enough = levels.len() >= FEW;
                if enough { *levels.select_nth_unstable_by(at, f64::total_cmp).1 } else { 0.0 }
            };
            let windows = place.clone().map(|b| b..b + WINDOW);
            let windows =
                windows.filter(|w| w.end <= spans.len() && self.why[w.clone()].iter().all(Option::is_none));
            let quiet: Vec<(Span, f64)> = windows.map(|w| (w.clone(), power(w))).collect();
            if quiet.iter().all(|(_, power)| *power > DEAD * loudest) {
                continue;
            }
            let is_same = |axis: usize, x: f64| (x - at[axis]).abs() <= limits[axis];
            let slower = quantile(0.5, &|axis, x| x <= at[axis] + limits[axis]);
            let expected = [quantile(0.5, &is_same).max(slower), quantile(0.9, &is_same)];
            for ((_, is_quiet), expected) in is_quiet.iter_mut().zip(expected) {
                for (window, _) in quiet.iter().filter(|(_, power)| *power < DEAD * expected) {
                    is_quiet[window.clone()].fill(true);
                }
            }
        }
        for (least, is_quiet) in is_quiet {
            let mut end = 0;
            for run in is_quiet.chunk_by(|a, b| a == b) {
                end += run.len();
                if run[0] && run.len() >= least {
                    self.mark((end - run.len()).saturating_sub(1)..end + 1, Why::Dead);
                }
            }
        }
    }

    pub(super) fn seconds(&self, blocks: usize) -> f64 {
        (blocks * self.len) as f64 / self.rate_hz
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.seconds(self.why.len())
    }

    /// Everything dropped, in order of time. Neighbours with one reason are joined.
    pub(super) fn dropped(&self, mut all: Vec<(Span, Why)>) -> Vec<Dropped> {
        all.extend(self.spans().into_iter().filter_map(|(span, why)| Some((span, why?))));
        all.sort_by_key(|(span, _)| span.start);
        let joined = all.chunk_by(|(a, why), (b, other)| why == other && a.end == b.start);
        let dropped = |run: &[(Span, Why)]| {
            let (start, end) = (run[0].0.start, run[run.len() - 1].0.end);
            Dropped { start_s: self.seconds(start), length_s: self.seconds(end - start), why: run[0].1 }
        };
        joined.map(dropped).collect()
    }

    /// Runs of usable blocks.
    pub(super) fn runs(&self) -> Vec<Span> {
        self.spans().into_iter().filter(|(_, why)| why.is_none()).map(|(span, _)| span).collect()
    }

    fn spans(&self) -> Vec<(Span, Option<Why>)> {
        let mut end = 0;
        let span = |run: &[Option<Why>]| {
            end += run.len();
            (end - run.len()..end, run[0])
        };
        self.why.chunk_by(|a, b| a == b).map(span).collect()
    }

    /// Least number of blocks that last this long.
    pub(super) fn count(&self, seconds: f64) -> usize {
        ((seconds * self.rate_hz / self.len as f64 - 1e-9).ceil() as usize).max(1)
    }

    /// Smoothed speeds and forces of some blocks.
    pub(super) fn smooth_of(&self, span: &Span) -> &[[f64; 2]] {
        &self.smooth[span.clone()]
    }

    /// Samples of some blocks.
    pub(super) fn signal_of(&self, span: &Span) -> &[f64] {
        &self.signal[span.start * self.len..span.end * self.len]
    }

    /// Blocks of a segment.
    pub(super) fn span(&self, segment: &Segment) -> Span {
        let block = |seconds: f64| (seconds * self.rate_hz / self.len as f64).round() as usize;
        block(segment.start_s)..block(segment.start_s + segment.length_s)
    }

    /// Mean speed and force of some blocks.
    pub(super) fn mean(&self, span: &Span) -> [f64; 2] {
        average(&self.means[span.clone()])
    }

    /// The greatest speed and force of any block.
    pub(super) fn greatest(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.means.iter().map(|m| m[axis]).fold(f64::NEG_INFINITY, f64::max))
    }
}

fn average(means: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| means.iter().map(|m| m[axis]).sum::<f64>() / means.len().max(1) as f64)
}

/// Draws a straight line from the sample before `start` to the one at `end`.
fn line(samples: &mut [f64], start: usize, end: usize) {
    let before = start.checked_sub(1).and_then(|i| samples.get(i)).or(samples.get(end)).copied();
    let behind = samples.get(end).copied().or(before).unwrap_or(0.0);
    let (from, steps) = (before.unwrap_or(behind), (end - start + 1) as f64);
    for (i, x) in samples[start..end].iter_mut().enumerate() {
        *x = from + (behind - from) * (i + 1) as f64 / steps;
    }
}

/// Runs of equal samples: at the highest or lowest value, or long ones.
fn stuck(samples: &[f64], rate_hz: f64) -> Vec<(Range<usize>, Why)> {
    let [lowest, highest] = range(samples.iter().copied());
    let clipped = ((CLIPPED_S * rate_hz).ceil() as usize).max(3);
    let still = (STILL_S * rate_hz).ceil() as usize;
    let mut end = 0;
    let kind = |run: &[f64]| {
        end += run.len();
        let at_limit = highest > lowest && (run[0] == highest || run[0] == lowest);
        let why = match run.len() {
            len if at_limit && len >= clipped => Why::Clipped,
            len if len >= still => Why::Still,
            _ => return None,
        };
        Some((end - run.len()..end, why))
    };
    samples.chunk_by(|a, b| a == b).filter_map(kind).collect()
}
