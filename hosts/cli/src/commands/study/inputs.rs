//! Inputs of a session's ticks: the motion of the stylus as the log holds it.

use std::collections::BTreeMap;

use asperity_live::HandInput;
use asperity_study::log::Event;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;

/// Outputs of a hand, with their numbers of values. A recorded stroke has the first alone.
const OUTPUTS: [(&str, usize); 4] = [("position", 3), ("force", 1), ("stroke", 1), ("valid", 1)];

/// Most ticks of an event.
const MOST_TICKS: u64 = 1 << 20;

/// Inputs that are not in the log yet.
#[derive(Debug, Default)]
pub struct Inputs {
    /// Ticks without a gap. Only the last ones grow.
    runs: Vec<Run>,
}

#[derive(Debug)]
struct Run {
    tick: u64,
    ticks: u64,
    /// Values of each output.
    values: [Vec<f32>; OUTPUTS.len()],
}

impl Inputs {
    /// Adds a tick: three values of a position, or all of a hand.
    pub fn add(&mut self, tick: u64, values: &[f32]) {
        if self.runs.last().is_none_or(|run| run.tick + run.ticks != tick) {
            self.runs.push(Run { tick, ticks: 0, values: Default::default() });
        }
        let Some(run) = self.runs.last_mut() else { return };
        run.ticks += 1;
        let mut rest = values;
        for (to, (_, count)) in run.values.iter_mut().zip(OUTPUTS) {
            let (here, after) = rest.split_at(count.min(rest.len()));
            to.extend_from_slice(here);
            rest = after;
        }
    }

    /// Takes all as events, if there are more ticks than `least`.
    pub fn take(&mut self, least: u64) -> Vec<Event> {
        if self.runs.iter().map(|run| run.ticks).sum::<u64>() <= least {
            return Vec::new();
        }
        let lines = |Run { tick, ticks, values }| {
            let line = move |(values, (output, count)): (Vec<f32>, (&str, usize))| {
                let first = values.get(..count)?;
                let rests = values.chunks(count).all(|row| same(row, first));
                let kept = if rests { first } else { &values };
                let bytes: Vec<u8> = kept.iter().flat_map(|x| x.to_le_bytes()).collect();
                let values = BASE64_STANDARD.encode(bytes);
                Some(Event::Inputs { tick, ticks, output: output.to_owned(), values })
            };
            values.into_iter().zip(OUTPUTS).filter_map(line)
        };
        std::mem::take(&mut self.runs).into_iter().flat_map(lines).collect()
    }
}

/// Whether values are the same bit for bit.
fn same(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
}

/// Inputs of ticks as a log has them. `None`: an event is damaged.
pub fn read<'e>(events: impl IntoIterator<Item = &'e Event>) -> Option<BTreeMap<u64, HandInput>> {
    let mut inputs = BTreeMap::new();
    for event in events {
        let Event::Inputs { tick, ticks, output, values } = event else { continue };
        let at = OUTPUTS.iter().position(|(name, _)| name == output)?;
        let (bytes, count) = (BASE64_STANDARD.decode(values).ok()?, OUTPUTS[at].1);
        let (singles, rest) = bytes.as_chunks::<4>();
        let rows = (singles.len() / count) as u64;
        let whole = rest.is_empty() && singles.len().is_multiple_of(count);
        if !whole || (rows != *ticks && rows != 1) || *ticks > MOST_TICKS {
            return None;
        }
        let values: Vec<f32> = singles.iter().map(|single| f32::from_le_bytes(*single)).collect();
        for (n, row) in values.chunks(count).cycle().take(usize::try_from(*ticks).ok()?).enumerate() {
            let input: &mut HandInput = inputs.entry(tick.checked_add(n as u64)?).or_default();
            match (at, row) {
                (0, &[x, y, z]) => input.position = [x, y, z],
                (1, &[force]) => input.force = force,
                (2, &[stroke]) => input.stroke = stroke,
                (_, &[valid]) => input.valid = valid != 0.0,
                _ => return None,
            }
        }
    }
    Some(inputs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_come_back_from_the_log_bit_for_bit() {
        let mut inputs = Inputs::default();
        let of = |tick: u64| HandInput {
            position: [tick as f32 * 0.1, -0.0, f32::MIN_POSITIVE / 4.0],
            force: if tick < 5 { 0.3 } else { tick as f32 },
            stroke: 2.0,
            valid: tick != 6,
        };
        let row = |input: HandInput| {
            let [x, y, z] = input.position;
            [x, y, z, input.force, input.stroke, f32::from(u8::from(input.valid))]
        };
        let ticks = [0, 1, 2, 3, 4, 7, 8, 6_000_000_000];
        ticks.iter().for_each(|tick| inputs.add(*tick, &row(of(*tick))));
        assert!(inputs.take(8).is_empty(), "it waits for more");
        let events = inputs.take(7);
        let expected: BTreeMap<u64, HandInput> = ticks.into_iter().map(|tick| (tick, of(tick))).collect();
        assert_eq!(read(&events), Some(expected));
        assert!(inputs.take(0).is_empty());
    }

    #[test]
    fn damaged_inputs_are_refused() {
        let event = |ticks, values: &str| {
            let output = "force".to_owned();
            Event::Inputs { tick: 0, ticks, output, values: values.into() }
        };
        assert!(read(&[event(2, "AACAPw==")]).is_some_and(|all| all[&1].force == 1.0));
        for (ticks, values) in [(1, "AACA"), (1, "?"), (3, "AACAPwAAgD8="), (u64::MAX, "AACAPw=="), (1, "")] {
            assert_eq!(read(&[event(ticks, values)]), None, "{ticks} {values}");
        }
    }
}
