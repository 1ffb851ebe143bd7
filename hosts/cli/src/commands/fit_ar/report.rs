//! The result as text, JSON and picture.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_autoregressive::fit::{self, Band, Compared, Comparison, Segment, Why};
use asperity_autoregressive::{Model, Texture};
use asperity_data::recordings::Recorded;
use asperity_plot::{Fit, Spectrum};
use serde_json::{Value, json};

use super::{Args, By};
use crate::failure::clean;

/// Most segments that are listed; JSON has all.
const LISTED: usize = 12;
/// Orders below and above the chosen one whose criterion is shown.
const AROUND: usize = 3;
/// Names of thirds of an octave from 25 Hz on (IEC 61260).
const BANDS: [&str; 13] =
    ["25", "31.5", "40", "50", "63", "80", "100", "125", "160", "200", "250", "315", "400"];

/// A fit that is over.
pub struct Report<'a> {
    pub args: &'a Args,
    pub recorded: &'a Recorded,
    pub texture: &'a Texture,
    pub fitted: &'a fit::Report,
    pub compared: &'a Comparison,
    pub written: Vec<PathBuf>,
}

impl Report<'_> {
    /// The result as text.
    pub fn text(&self) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "recording     {}", self.recording());
        let _ = writeln!(out, "fitted        {}", self.fitted());
        let dropped = self.dropped();
        if !dropped.is_empty() {
            let _ = writeln!(out, "dropped       {dropped}");
        }
        let _ = writeln!(out, "order         {}", self.order());
        let _ = writeln!(out, "models        {}", self.models());
        let _ = writeln!(out, "hull          {}", self.hull());
        self.list_segments(&mut out);
        self.list_models(&mut out);
        self.list_bands(&mut out);
        for path in &self.written {
            let _ = writeln!(out, "wrote {}", clean(&path.display().to_string()));
        }
        out
    }

    fn recording(&self) -> String {
        let axes = match self.recorded.acceleration_m_s2.len() {
            1 => "one axis".to_owned(),
            n => format!("{n} axes"),
        };
        let name = clean(&self.args.recording.display().to_string());
        let rate = self.recorded.rate_hz;
        format!("{name}: {:.2} s at {rate:.0} Hz, {axes} of acceleration", self.fitted.duration_s)
    }

    fn fitted(&self) -> String {
        let seconds: f64 = self.fitted.segments.iter().map(|s| s.length_s).sum();
        format!(
            "{seconds:.2} s in {} of nearly constant speed, force and spectrum",
            count(self.fitted.segments.len(), "segment")
        )
    }

    fn dropped(&self) -> String {
        let parts = Why::ALL.iter().map(|why| (why, self.fitted.dropped_s(*why))).filter(|(_, s)| *s > 0.0);
        parts.map(|(why, seconds)| format!("{seconds:.2} s {why}")).collect::<Vec<_>>().join(", ")
    }

    fn order(&self) -> String {
        let (order, curve) = (self.fitted.order, &self.fitted.criterion);
        if curve.is_empty() {
            return format!("{order}, as asked for");
        }
        let near = curve.iter().filter(|(p, _)| *p != order && p.abs_diff(order) <= AROUND);
        let near: Vec<String> = near.map(|(p, more)| format!("{p} has {more:.1} more")).collect();
        let mut said =
            format!("{order}, of least {} from 1 to {}", self.criterion().unwrap_or(""), curve.len());
        if !near.is_empty() {
            let _ = write!(said, ": {}", near.join(", "));
        }
        said
    }

    /// Criterion of the order, if it was chosen by one.
    fn criterion(&self) -> Option<&'static str> {
        (!self.fitted.criterion.is_empty()).then_some(match self.args.by {
            By::Aicc => "AICc",
            By::Bic => "BIC",
        })
    }

    fn models(&self) -> String {
        let triangles = self.texture.triangles().corners().len();
        let (models, rate) = (count(self.texture.models().len(), "model"), self.texture.rate_hz());
        let joined = match (triangles, self.texture.models().len()) {
            (0, 1) => "the same at every speed and force".to_owned(),
            (0, _) => "no triangle: between them, along a line".to_owned(),
            (n, _) => count(n, "triangle"),
        };
        format!("{models} at {rate:.0} Hz, {joined}")
    }

    fn hull(&self) -> String {
        let [speed, force] = self.ranges();
        format!(
            "{:.1} to {:.1} mm/s, {:.2} to {:.2} N; beyond it the nearest point of it answers",
            speed[0], speed[1], force[0], force[1]
        )
    }

    /// Ranges of speed and force of the models.
    fn ranges(&self) -> [[f64; 2]; 2] {
        let of: [fn(&Model) -> f64; 2] = [|m| m.speed_mm_s, |m| m.force_n];
        of.map(|of| {
            let all = self.texture.models().iter().map(of);
            [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
        })
    }

    fn list_segments(&self, out: &mut String) {
        let all = &self.fitted.segments;
        let _ = writeln!(out, "\nsegment   from s    for s     mm/s        N    m/s^2 rms  model");
        for (i, s) in all.iter().take(LISTED).enumerate() {
            let _ = writeln!(
                out,
                "{i:7} {:8.2} {:8.2} {:8.1} {:8.3} {:12.4} {:6}",
                s.start_s,
                s.length_s,
                s.speed_mm_s,
                s.force_n,
                s.mean_square.sqrt(),
                s.model
            );
        }
        if all.len() > LISTED {
            let _ = writeln!(out, "        and {} more, with --json", all.len() - LISTED);
        }
    }

    fn list_models(&self, out: &mut String) {
        let _ = writeln!(
            out,
            "\n  model     mm/s        N    for s  segments    m/s^2 rms  rendered  worst band"
        );
        for (i, (model, compared)) in self.texture.models().iter().zip(&self.compared.models).enumerate() {
            let of = |s: &&Segment| s.model == i;
            let worst = compared.worst().map_or_else(|| "-".into(), worst);
            let _ = writeln!(
                out,
                "{i:7} {:8.1} {:8.3} {:8.2} {:9} {:12.4} {:+6.2} dB  {worst}",
                model.speed_mm_s,
                model.force_n,
                compared.seconds,
                self.fitted.segments.iter().filter(of).count(),
                level(model),
                compared.level_off_db()
            );
        }
    }

    fn list_bands(&self, out: &mut String) {
        let all = &self.compared.all;
        let _ = writeln!(out, "\n   band  recorded  rendered, m/s^2 rms over all segments");
        for (band, name) in all.bands.iter().zip(BANDS) {
            let _ = writeln!(
                out,
                "{name:>7} {:9.5} {:9.5} {:+6.2} dB",
                band.recorded_m_s2,
                band.rendered_m_s2,
                band.off_db()
            );
        }
        let worst = all.worst().map_or_else(String::new, |b| format!(", at most {}", worst(b)));
        let _ = writeln!(out, "    all {:+.2} dB{worst}\n", all.level_off_db());
    }

    /// The result as JSON.
    pub fn json(&self) -> String {
        let (texture, fitted) = (self.texture, self.fitted);
        let models: Vec<Value> = texture
            .models()
            .iter()
            .zip(&self.compared.models)
            .enumerate()
            .map(|(i, (model, compared))| {
                let mut value = compared_json(compared);
                if let Value::Object(fields) = &mut value {
                    fields.insert("speed_mm_s".into(), json!(model.speed_mm_s));
                    fields.insert("force_n".into(), json!(model.force_n));
                    fields.insert("variance".into(), json!(model.variance));
                    fields.insert("rms_m_s2".into(), json!(level(model)));
                    let segments = fitted.segments.iter().enumerate().filter(|(_, s)| s.model == i);
                    fields.insert("segments".into(), json!(segments.map(|(n, _)| n).collect::<Vec<_>>()));
                }
                value
            })
            .collect();
        let place = |i: usize| texture.models().get(i).map(|m| [m.speed_mm_s, m.force_n]);
        let corners: Vec<[f64; 2]> = texture.triangles().hull().into_iter().filter_map(place).collect();
        let [speed, force] = self.ranges();
        let segments: Vec<Value> = fitted.segments.iter().map(segment_json).collect();
        let dropped: Vec<Value> = fitted
            .dropped
            .iter()
            .map(|d| json!({ "start_s": d.start_s, "length_s": d.length_s, "why": word(d.why) }))
            .collect();
        let written: Vec<String> = self.written.iter().map(|p| p.display().to_string()).collect();
        let value = json!({
            "recording": self.args.recording.display().to_string(),
            "rate_hz": self.recorded.rate_hz,
            "seconds": fitted.duration_s,
            "axes": self.recorded.acceleration_m_s2.len(),
            "model_hz": texture.rate_hz(),
            "high_pass_hz": fitted.high_pass_hz,
            "order": fitted.order,
            "criterion": self.criterion(),
            "criterion_by_order": fitted.criterion,
            "models": models,
            "triangles": texture.triangles().corners(),
            "hull": { "speed_mm_s": speed, "force_n": force, "corners": corners },
            "segments": segments,
            "dropped": dropped,
            "all": compared_json(&self.compared.all),
            "written": written,
        });
        format!("{value:#}\n")
    }
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn worst(band: &Band) -> String {
    format!("{:+.2} dB at {:.0} Hz", band.off_db(), band.centre_hz)
}

/// Root mean square of a model's output \[m/s^2\].
fn level(model: &Model) -> f64 {
    let mut square = [0.0];
    model.filter().autocovariance(&mut square);
    square[0].sqrt()
}

fn segment_json(s: &Segment) -> Value {
    json!({
        "start_s": s.start_s,
        "length_s": s.length_s,
        "speed_mm_s": s.speed_mm_s,
        "force_n": s.force_n,
        "rms_m_s2": s.mean_square.sqrt(),
        "residual_variance": s.residual_variance,
        "model": s.model,
    })
}

fn compared_json(c: &Compared) -> Value {
    let bands: Vec<Value> = c
        .bands
        .iter()
        .zip(BANDS)
        .map(|(b, name)| {
            json!({
                "band": name,
                "centre_hz": b.centre_hz,
                "recorded_m_s2": b.recorded_m_s2,
                "rendered_m_s2": b.rendered_m_s2,
                "off_db": b.off_db(),
            })
        })
        .collect();
    json!({
        "seconds": c.seconds,
        "level_off_db": c.level_off_db(),
        "worst_off_db": c.worst().map(Band::off_db),
        "worst_hz": c.worst().map(|b| b.centre_hz),
        "bands": bands,
    })
}

fn word(why: Why) -> &'static str {
    match why {
        Why::Still => "still",
        Why::Clipped => "clipped",
        Why::NoContact => "no_contact",
        Why::Slow => "slow",
        Why::Click => "click",
        Why::Unsteady => "unsteady",
        Why::Short => "short",
    }
}

/// Most spectra to draw: those of the models with the longest part of the recording.
const SPECTRA: usize = 6;
/// Lowest frequency to draw \[Hz\].
const LOWEST_HZ: f64 = 10.0;
/// Ratio of the frequencies of neighbouring points of a model's spectrum.
const STEP: f64 = 1.01;

/// Models, triangles, segments and spectra.
pub fn svg(report: &Report<'_>) -> String {
    let (texture, compared) = (report.texture, &report.compared.models);
    let mut chosen: Vec<usize> = (0..texture.models().len().min(compared.len())).collect();
    chosen.sort_by(|a, b| compared[*b].seconds.total_cmp(&compared[*a].seconds));
    chosen.truncate(SPECTRA);
    chosen.sort_unstable();
    let rate_hz = texture.rate_hz();
    let all = &report.compared.all;
    let worst = all
        .worst()
        .map_or_else(String::new, |b| format!(", thirds of an octave within {:.1} dB", b.off_db().abs()));
    Fit {
        title: format!(
            "A texture fitted to {}",
            report.args.recording.file_name().unwrap_or_default().display()
        ),
        subtitle: format!(
            "{} models of order {}; rendered against recorded: {:+.1} dB in all{worst}",
            texture.models().len(),
            report.fitted.order,
            // Rounded to a tenth, without a negative zero.
            (10.0 * all.level_off_db()).round() / 10.0 + 0.0
        ),
        corners: texture.models().iter().map(|m| [m.speed_mm_s, m.force_n]).collect(),
        triangles: texture.triangles().corners().to_vec(),
        pieces: report.fitted.segments.iter().map(|s| [s.speed_mm_s, s.force_n]).collect(),
        unit: "dB of 1 (m/s\u{b2})\u{b2} a Hz".into(),
        spectra: chosen
            .into_iter()
            .map(|i| spectrum(i, &texture.models()[i], &compared[i], rate_hz))
            .collect(),
    }
    .to_svg()
}

fn spectrum(number: usize, model: &Model, compared: &Compared, rate_hz: f64) -> Spectrum {
    let filter = model.filter();
    let db = |density: f64| 10.0 * density.log10();
    let measured =
        compared.density.iter().enumerate().map(|(k, d)| (k as f64 * Compared::DENSITY_STEP_HZ, db(*d)));
    let hz =
        std::iter::successors(Some(LOWEST_HZ), |hz| Some(hz * STEP)).take_while(|hz| *hz < 0.5 * rate_hz);
    Spectrum {
        label: format!("{number}: {:.0} mm/s, {:.2} N", model.speed_mm_s, model.force_n),
        remark: compared.worst().map_or_else(String::new, |b| format!("within {:.1} dB", b.off_db().abs())),
        measured: measured.filter(|(hz, _)| *hz >= LOWEST_HZ).collect(),
        // One-sided, like the measured one.
        model: hz.map(|hz| (hz, db(2.0 * filter.power(TAU * hz / rate_hz) / rate_hz))).collect(),
    }
}
