//! A material's pattern in the library: how its vibration is spread over place.

use asperity_numbers::Elementary as _;
use std::fmt::Write as _;

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::Value;
use asperity_dsp::shaped_noise::{Events, PATTERN_LEN};
pub use asperity_dsp::shaped_noise::{HARMONICS as MAX_HARMONICS, WAVES as MAX_WAVES};

/// Spread of a material's vibration over place. Without waves and events it is noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pattern {
    /// Ridges that repeat with place, at most [`MAX_WAVES`].
    pub waves: Vec<Wave>,
    /// Single bumps that the tool meets one after the other.
    pub events: Option<Events>,
}

/// Ridges that repeat with place: straight, parallel and equally far apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Wave {
    /// Wave vector in 1/mm: across the ridges, with a length of one over their distance. Harmonic h has
    /// the phase `2 pi h k . (x, y)`.
    pub per_mm: [f64; 2],
    /// Harmonics from the fundamental, 1 to [`MAX_HARMONICS`].
    pub harmonics: Vec<Harmonic>,
}

impl Pattern {
    /// Numbers for [`shaped_noise::Pattern::read`](asperity_dsp::shaped_noise::Pattern::read). Missing
    /// higher harmonics have weight 1 and are otherwise like the last.
    pub fn numbers(&self) -> [f64; PATTERN_LEN] {
        let mut numbers = [0.0; PATTERN_LEN];
        let mut next = numbers.iter_mut();
        let mut put = |x: f64| next.by_ref().take(1).for_each(|to| *to = x);
        let of = |e: Events| {
            let [a, b] = e.anisotropy;
            [e.spacing_mm.unwrap_or(-1.0), e.spacing_exponent, e.interval_cv, e.height_cv, a, b]
        };
        let events = self.events.map_or([0.0; 6], of);
        events.into_iter().for_each(&mut put);
        for wave in &self.waves {
            wave.per_mm.into_iter().for_each(&mut put);
            let last = wave.harmonics.last().map_or((0.0, 0.0), |h| (h.share, h.phase));
            let last = Harmonic { weight: 1.0, share: last.0, phase: last.1 };
            let all = wave.harmonics.iter().copied().chain(std::iter::repeat(last)).take(MAX_HARMONICS);
            all.flat_map(|h| [h.weight, h.share, h.phase]).for_each(&mut put);
        }
        numbers
    }
}

/// A harmonic of a wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Power around its frequency over the network's mean there and around the neighbouring harmonics,
    /// 0 to 10. Narrow ridges leave out some harmonics, and a network blurs that.
    pub weight: f64,
    /// Part of the power around its frequency that repeats with place, 0 to 1.
    pub share: f64,
    /// Phase in rad on top of a minimum-phase response.
    pub phase: f64,
}

impl Pattern {
    /// Reads `waves: [(per_mm: [..], harmonics: [[weight, share, phase], ..])]` and `events: (..)`.
    pub(super) fn read(waves: Option<&Value>, events: Option<&Value>) -> Result<Self, Diagnostic> {
        let waves = match waves {
            Some(list) => {
                let waves = list.list()?;
                if waves.len() > MAX_WAVES {
                    let what = format!("{} waves", waves.len());
                    return Err(list.error(what).help(format!("a material has at most {MAX_WAVES}")));
                }
                waves.iter().map(wave).collect::<Result<_, _>>()?
            }
            None => Vec::new(),
        };
        let Some(value) = events else { return Ok(Self { waves, events: None }) };
        let events = bumps(value)?;
        if events.spacing_mm.is_none() && waves.is_empty() {
            return Err(value
                .error("`spacing_mm` is missing")
                .help("only beside `waves` it may be left out: then there is a bump at each ridge"));
        }
        Ok(Self { waves, events: Some(events) })
    }

    /// Writes the fields that are present, each line behind `indent`.
    pub(super) fn write(&self, text: &mut String, indent: &str) {
        // Writing to a String cannot fail.
        if let Some(events) = self.events {
            let _ = write!(text, "{indent}events: (");
            if let Some(mm) = events.spacing_mm {
                let _ = write!(text, "spacing_mm: {mm:?}, spacing_exponent: {:?}, ", events.spacing_exponent);
            }
            if events.anisotropy != [0.0; 2] {
                let _ = write!(text, "anisotropy: {:?}, ", events.anisotropy);
            }
            let _ =
                writeln!(text, "interval_cv: {:?}, height_cv: {:?}),", events.interval_cv, events.height_cv);
        }
        if self.waves.is_empty() {
            return;
        }
        let _ = writeln!(text, "{indent}waves: [");
        for Wave { per_mm: [x, y], harmonics } in &self.waves {
            let harmonics: Vec<String> =
                harmonics.iter().map(|h| format!("[{:?}, {:?}, {:?}]", h.weight, h.share, h.phase)).collect();
            let _ = writeln!(text, "{indent}    (per_mm: [{x:?}, {y:?}], harmonics: [");
            for row in harmonics.chunks(4) {
                let _ = writeln!(text, "{indent}        {},", row.join(", "));
            }
            let _ = writeln!(text, "{indent}    ]),");
        }
        let _ = writeln!(text, "{indent}],");
    }
}

/// Exactly `N` numbers.
fn numbers<const N: usize>(value: &Value) -> Result<[&Value; N], Diagnostic> {
    let list: Vec<&Value> = value.list()?.iter().collect();
    <[&Value; N]>::try_from(list).map_err(|list| value.error(format!("{} numbers, not {N}", list.len())))
}

fn wave(value: &Value) -> Result<Wave, Diagnostic> {
    let mut record = value.record("Wave")?;
    let place = record.required("per_mm")?;
    let [x, y] = numbers(place)?;
    let per_mm = [x.f64_in(-100.0..=100.0, "1/mm")?, y.f64_in(-100.0..=100.0, "1/mm")?];
    if per_mm[0].hypotenuse(per_mm[1]) < 1e-3 {
        return Err(place.error("a wave without a direction").help("ridges at most 1000 mm apart"));
    }
    let list = record.required("harmonics")?;
    let told = list.list()?;
    if !(1..=MAX_HARMONICS).contains(&told.len()) {
        let what = format!("{} harmonics", told.len());
        return Err(list.error(what).help(format!("1 to {MAX_HARMONICS}; those above are like the last")));
    }
    let harmonic = |value: &Value| {
        let [weight, share, phase] = numbers(value)?;
        Ok(Harmonic {
            weight: weight.f64_in(0.0..=10.0, "")?,
            share: share.f64_in(0.0..=1.0, "")?,
            phase: phase.f64_in(-100.0..=100.0, "rad")?,
        })
    };
    let harmonics = told.iter().map(harmonic).collect::<Result<_, Diagnostic>>()?;
    record.finish()?;
    Ok(Wave { per_mm, harmonics })
}

fn bumps(value: &Value) -> Result<Events, Diagnostic> {
    let mut record = value.record("Events")?;
    let anisotropy = |value: &Value| {
        let [a, b] = numbers(value)?;
        let [a, b] = [a.f64_in(-0.99..=0.99, "")?, b.f64_in(-0.99..=0.99, "")?];
        if a.hypotenuse(b) > 0.99 {
            let longer = format!("an anisotropy {:.3} long", a.hypotenuse(b));
            return Err(value.error(longer).help("at most 0.99: bumps are longer than wide, but not lines"));
        }
        Ok([a, b])
    };
    let events = Events {
        spacing_mm: record
            .optional("spacing_mm")
            .map(|value| value.f64_in(0.01..=1000.0, "mm"))
            .transpose()?,
        spacing_exponent: record
            .optional("spacing_exponent")
            .map_or(Ok(0.0), |value| value.f64_in(-2.0..=2.0, ""))?,
        anisotropy: record.optional("anisotropy").map_or(Ok([0.0; 2]), anisotropy)?,
        interval_cv: record.required("interval_cv")?.f64_in(0.0..=4.0, "")?,
        height_cv: record.required("height_cv")?.f64_in(0.0..=10.0, "")?,
    };
    record.finish()?;
    Ok(events)
}

#[cfg(test)]
mod tests {
    use super::super::{Library, tests::three};
    use super::*;
    use asperity_diagnostics::Source;

    #[test]
    fn pattern_reads_back_to_the_same_bits() {
        let mut library = three();
        let harmonic = |share, phase| Harmonic { weight: 1.5 - share, share, phase };
        library.materials[0].pattern.events = Some(Events {
            spacing_mm: Some(0.23),
            spacing_exponent: -0.7,
            anisotropy: [0.6, -0.1],
            interval_cv: 0.1 + 0.2,
            height_cv: 0.5,
        });
        library.materials[1].pattern.waves = vec![
            Wave { per_mm: [0.4, -1e-3], harmonics: vec![harmonic(0.9, -0.3); 7] },
            Wave { per_mm: [0.0, 2.0], harmonics: vec![harmonic(1.0, 3.0)] },
        ];
        library.materials[1].pattern.events = Some(Events {
            spacing_mm: None,
            spacing_exponent: 0.0,
            anisotropy: [0.0; 2],
            interval_cv: 0.05,
            height_cv: 0.5,
        });
        let text = super::super::tests::reads_back(&library);
        assert!(text.contains("version: 3,"), "{}", &text[..60]);
    }

    #[test]
    fn pattern_out_of_range_is_refused_where_it_stands() {
        let vector = format!("vector: [{}]", "0.5, ".repeat(256));
        for (version, field, what) in [
            (2, "waves: []", "unknown field `waves`"),
            (3, "waves: [(per_mm: [0.0, 0.0], harmonics: [[1.0, 1.0, 0.0]])]", "without a direction"),
            (3, "waves: [(per_mm: [0.4], harmonics: [[1.0, 1.0, 0.0]])]", "1 numbers, not 2"),
            (3, "waves: [(per_mm: [0.4, 0.0], harmonics: [])]", "0 harmonics"),
            (3, "waves: [(per_mm: [0.4, 0.0], harmonics: [[1.0, 1.5, 0.0]])]", "out of range"),
            (3, "waves: [(per_mm: [0.4, 0.0], harmonics: [[1.0, 0.0]])]", "2 numbers, not 3"),
            (3, "events: (spacing_mm: 0.0, interval_cv: 0.1, height_cv: 0.1)", "out of range"),
            (3, "events: (spacing_mm: 1.0, interval_cv: 0.1)", "`height_cv` is missing"),
            (3, "events: (anisotropy: [1.0], interval_cv: 1, height_cv: 1)", "1 numbers, not 2"),
            (3, "events: (anisotropy: [0.0, 4.0], interval_cv: 1, height_cv: 1)", "out of range"),
            (3, "events: (anisotropy: [0.8, 0.8], interval_cv: 1, height_cv: 1)", "an anisotropy 1.131 long"),
            (3, "events: (interval_cv: 0.1, height_cv: 0.1)", "`spacing_mm` is missing"),
        ] {
            let text = format!(
                "Library(version: {version}, materials: {{\"a\": (description: \"d\", {field}, {vector})}})"
            );
            let e = Library::parse(&Source::new("m.ron", text)).unwrap_err().to_string();
            assert!(e.contains(what), "{field}: {e}");
        }
    }
}
