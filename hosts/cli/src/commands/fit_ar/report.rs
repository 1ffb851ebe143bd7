//! The result as text, JSON and picture.

use std::f64::consts::TAU;
use std::path::PathBuf;

use asperity_autoregressive::fit::{self, Band, Compared, Comparison, Dropped, Segment, Why};
use asperity_autoregressive::{Model, Texture};
use asperity_data::recordings::Recorded;
use asperity_diagnostics::ron::quoted;
use asperity_plot::{Fit, Spectrum};
use serde_json::{Value, json};

use super::{Args, By};
use crate::failure::{clean, plural};

/// Orders below and above the chosen one whose criterion is shown.
const AROUND: usize = 3;
/// Most stretches without a signal that are listed.
const MOST_TOLD: usize = 8;
/// Nominal centres of thirds of an octave from 25 Hz on, ten a decade (IEC 61260).
const BANDS: [f64; 10] = [25.0, 31.5, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0];

pub struct Report<'a> {
    pub args: &'a Args,
    pub recorded: &'a Recorded,
    pub texture: &'a Texture,
    pub fitted: &'a fit::Report,
    pub compared: &'a Comparison,
    pub written: Vec<PathBuf>,
}

impl Report<'_> {
    pub fn text(&self) -> String {
        let (fitted, texture, compared) = (self.fitted, self.texture, self.compared);
        let name = clean(&self.args.recording.display().to_string());
        let rate = self.recorded.rate_hz;
        let axes = match self.recorded.acceleration_m_s2.len() {
            1 => "one axis".to_owned(),
            n => format!("{n} axes"),
        };
        let seconds: f64 = fitted.segments.iter().map(|s| s.length_s).sum();
        let segments = plural(fitted.segments.len(), "segment");
        let dropped = Why::ALL.iter().map(|why| (why, fitted.dropped_s(*why))).filter(|(_, s)| *s > 0.0);
        let dropped: Vec<String> = dropped.map(|(why, seconds)| format!("{seconds:.2} s {why}")).collect();
        let joined = match (texture.triangles().corners().len(), texture.models().len()) {
            (0, 1) => "the same at every speed and force".to_owned(),
            (0, _) => "no triangle: between them, along a line".to_owned(),
            (n, _) => plural(n, "triangle"),
        };
        let models = plural(texture.models().len(), "model");
        let [[slowest, fastest], [least, most]] = self.ranges();
        let mut out = format!(
            "recording     {name}: {:.2} s at {rate:.0} Hz, {axes} of acceleration\n\
             fitted        {seconds:.2} s in {segments} of nearly constant speed, force and spectrum\n",
            fitted.duration_s
        );
        if !dropped.is_empty() {
            out += &format!("dropped       {}\n", dropped.join(", "));
        }
        let no_signal = |d: &&Dropped| matches!(d.why, Why::Still | Why::Clipped | Why::Dead);
        let no_signal: Vec<&Dropped> = fitted.dropped.iter().filter(no_signal).collect();
        for Dropped { start_s, length_s, why } in no_signal.iter().take(MOST_TOLD) {
            out += &format!("              {start_s:.2} to {:.2} s: {why}\n", start_s + length_s);
        }
        if let Some(more) = no_signal.len().checked_sub(MOST_TOLD).filter(|more| *more > 0) {
            out += &format!("              and {more} more; --json lists them\n");
        }
        if !self.recorded.ignored.is_empty() {
            out += &format!("ignored       columns {}\n", clean(&self.recorded.ignored.join(", ")));
        }
        out += &format!(
            "order         {}\n\
             models        {models} at {:.0} Hz, {joined}\n\
             hull          {slowest:.1} to {fastest:.1} mm/s, {least:.2} to {most:.2} N; \
             beyond it the nearest point of it answers\n",
            self.order(),
            texture.rate_hz()
        );
        out += "\nsegment   from s    for s     mm/s        N    m/s^2 rms  model\n";
        for (i, s) in fitted.segments.iter().enumerate() {
            let Segment { start_s, length_s, speed_mm_s, force_n, model, .. } = s;
            let rms = s.mean_square.sqrt();
            out += &format!(
                "{i:7} {start_s:8.2} {length_s:8.2} {speed_mm_s:8.1} {force_n:8.3} {rms:12.4} {model:6}\n"
            );
        }
        out += "\n  model     mm/s        N    for s  segments    m/s^2 rms  rendered  worst band\n";
        for (i, (model, compared)) in texture.models().iter().zip(&compared.models).enumerate() {
            let segments = fitted.segments.iter().filter(|s| s.model == i).count();
            let (Model { speed_mm_s, force_n, .. }, seconds) = (model, compared.seconds);
            let (rms, off, worst) = (level(model), compared.level_off_db(), compared.worst().map(worst));
            out += &format!(
                "{i:7} {speed_mm_s:8.1} {force_n:8.3} {seconds:8.2} {segments:9} {rms:12.4} {off:+6.2} dB  \
                 {}\n",
                worst.unwrap_or("-".into())
            );
        }
        out += "\n   band  recorded  rendered, m/s^2 rms over all segments\n";
        for (band, name) in compared.all.bands.iter().zip(nominal_hz()) {
            let (Band { recorded_m_s2, rendered_m_s2, .. }, off) = (band, band.off_db());
            out += &format!("{name:>7} {recorded_m_s2:9.5} {rendered_m_s2:9.5} {off:+6.2} dB\n");
        }
        let worst = compared.all.worst().map_or_else(String::new, |b| format!(", at most {}", worst(b)));
        out += &format!("    all {:+.2} dB{worst}\n\n", compared.all.level_off_db());
        self.written.iter().for_each(|p| out += &format!("wrote {}\n", clean(&p.display().to_string())));
        let path = quoted(&self.args.out.display().to_string());
        let set = clean(&format!("graphs/fitted.ron --set 'texture.models=[{path}]'"));
        out += &format!(
            "\nrender it:  asperity render {set} --out fitted.wav\n\
             feel it:    asperity run {set} --hand pointer --page\n\
             in a graph: (kind: \"autoregressive\", params: (models: [{path}]))\n\
             in a scene: texture: {path}\n",
            path = clean(&path)
        );
        out
    }

    fn order(&self) -> String {
        let (order, curve) = (self.fitted.order, &self.fitted.criterion);
        let Some(criterion) = self.criterion() else { return format!("{order}, as asked for") };
        let near = curve.iter().filter(|(p, _)| *p != order && p.abs_diff(order) <= AROUND);
        let near: Vec<String> = near.map(|(p, more)| format!("{p} has {more:.1} more")).collect();
        let near = if near.is_empty() { String::new() } else { format!(": {}", near.join(", ")) };
        format!("{order}, of least {criterion} from 1 to {}{near}", curve.len())
    }

    /// Criterion of the order, if it was chosen by one.
    fn criterion(&self) -> Option<&'static str> {
        (!self.fitted.criterion.is_empty()).then_some(match self.args.by {
            By::Aicc => "AICc",
            By::Bic => "BIC",
        })
    }

    /// Ranges of speed and force of the models.
    fn ranges(&self) -> [[f64; 2]; 2] {
        let of: [fn(&Model) -> f64; 2] = [|m| m.speed_mm_s, |m| m.force_n];
        of.map(|of| {
            let all = self.texture.models().iter().map(of);
            [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
        })
    }

    pub fn json(&self) -> Value {
        let (texture, fitted) = (self.texture, self.fitted);
        let models = texture.models().iter().zip(&self.compared.models).enumerate().map(|(i, (model, c))| {
            let segments = fitted.segments.iter().enumerate().filter(|(_, s)| s.model == i);
            let mut value = compared_json(c);
            value["speed_mm_s"] = json!(model.speed_mm_s);
            value["force_n"] = json!(model.force_n);
            value["variance"] = json!(model.variance);
            value["rms_m_s2"] = json!(level(model));
            value["segments"] = json!(segments.map(|(n, _)| n).collect::<Vec<_>>());
            value
        });
        let place = |i: usize| texture.models().get(i).map(|m| [m.speed_mm_s, m.force_n]);
        let corners: Vec<[f64; 2]> = texture.triangles().hull().into_iter().filter_map(place).collect();
        let [speed, force] = self.ranges();
        let segments = fitted.segments.iter().map(|s| {
            json!({
                "start_s": s.start_s, "length_s": s.length_s, "speed_mm_s": s.speed_mm_s,
                "force_n": s.force_n, "rms_m_s2": s.mean_square.sqrt(),
                "residual_variance": s.residual_variance, "model": s.model,
            })
        });
        let dropped = fitted.dropped.iter().map(|d| {
            let why = match d.why {
                Why::Still => "still",
                Why::Clipped => "clipped",
                Why::NoContact => "no_contact",
                Why::Slow => "slow",
                Why::Click => "click",
                Why::Dead => "dead",
                Why::Unsteady => "unsteady",
                Why::Short => "short",
            };
            json!({ "start_s": d.start_s, "length_s": d.length_s, "why": why })
        });
        let written: Vec<String> = self.written.iter().map(|p| p.display().to_string()).collect();
        json!({
            "recording": self.args.recording.display().to_string(), "rate_hz": self.recorded.rate_hz,
            "seconds": fitted.duration_s, "axes": self.recorded.acceleration_m_s2.len(),
            "model_hz": texture.rate_hz(), "high_pass_hz": fitted.high_pass_hz,
            "order": fitted.order,
            "criterion": self.criterion(), "criterion_by_order": fitted.criterion,
            "models": models.collect::<Vec<_>>(), "triangles": texture.triangles().corners(),
            "hull": { "speed_mm_s": speed, "force_n": force, "corners": corners },
            "segments": segments.collect::<Vec<_>>(), "dropped": dropped.collect::<Vec<_>>(),
            "above": fitted.above, "ignored_columns": self.recorded.ignored,
            "all": compared_json(&self.compared.all), "written": written,
        })
    }
}

/// Nominal centres of all bands \[Hz\].
fn nominal_hz() -> impl Iterator<Item = f64> {
    let decades = std::iter::successors(Some(1.0), |by| Some(10.0 * by));
    decades.flat_map(|by| BANDS.map(|hz| by * hz))
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

fn compared_json(c: &Compared) -> Value {
    let bands = c.bands.iter().zip(nominal_hz()).map(|(b, name)| {
        json!({
            "band": name.to_string(), "centre_hz": b.centre_hz, "recorded_m_s2": b.recorded_m_s2,
            "rendered_m_s2": b.rendered_m_s2, "off_db": b.off_db(),
        })
    });
    json!({
        "seconds": c.seconds, "level_off_db": c.level_off_db(), "worst_off_db": c.worst().map(Band::off_db),
        "worst_hz": c.worst().map(|b| b.centre_hz), "bands": bands.collect::<Vec<_>>(),
    })
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
    let (rate_hz, all) = (texture.rate_hz(), &report.compared.all);
    let spectra = chosen.into_iter().map(|i| spectrum(i, &texture.models()[i], &compared[i], rate_hz));
    let worst = all.worst().map(|b| format!(", thirds of an octave within {:.1} dB", b.off_db().abs()));
    // Rounded to a tenth, without a negative zero.
    let off = (10.0 * all.level_off_db()).round() / 10.0 + 0.0;
    let (count, order, worst) = (texture.models().len(), report.fitted.order, worst.unwrap_or_default());
    let name = report.args.recording.file_name().unwrap_or_default().display();
    Fit {
        title: format!("A texture fitted to {name}"),
        subtitle: format!(
            "{count} models of order {order}; rendered against recorded: {off:+.1} dB in all{worst}"
        ),
        corners: texture.models().iter().map(|m| [m.speed_mm_s, m.force_n]).collect(),
        triangles: texture.triangles().corners().to_vec(),
        pieces: report.fitted.segments.iter().map(|s| [s.speed_mm_s, s.force_n]).collect(),
        unit: "dB of 1 (m/s\u{b2})\u{b2} a Hz".into(),
        spectra: spectra.collect(),
    }
    .to_svg()
}

fn spectrum(number: usize, model: &Model, compared: &Compared, rate_hz: f64) -> Spectrum {
    let filter = model.filter();
    let db = |density: f64| 10.0 * density.log10();
    let bins = compared.density.iter().enumerate();
    let measured = bins.map(|(k, d)| (k as f64 * Compared::DENSITY_STEP_HZ, db(*d)));
    let hz = std::iter::successors(Some(LOWEST_HZ), |hz| Some(hz * STEP));
    let hz = hz.take_while(|hz| *hz < 0.5 * rate_hz);
    Spectrum {
        label: format!("{number}: {:.0} mm/s, {:.2} N", model.speed_mm_s, model.force_n),
        remark: compared.worst().map_or_else(String::new, |b| format!("within {:.1} dB", b.off_db().abs())),
        measured: measured.filter(|(hz, _)| *hz >= LOWEST_HZ).collect(),
        // One-sided, like the measured one.
        model: hz.map(|hz| (hz, db(2.0 * filter.power(TAU * hz / rate_hz) / rate_hz))).collect(),
    }
}
