//! The result as a picture.

use std::f64::consts::TAU;

use asperity_autoregressive::Model;
use asperity_autoregressive::fit::Compared;
use asperity_plot::{Fit, Spectrum};

use super::report::Report;

/// Most spectra that are drawn: those of the models that have the most of the recording.
const MOST: usize = 6;
/// Lowest frequency that is drawn, in Hz.
const LOWEST_HZ: f64 = 10.0;
/// Points of a model's spectrum, each so many times as high as the one before.
const STEP: f64 = 1.01;

/// Models, triangles, segments and spectra.
pub fn svg(report: &Report<'_>) -> String {
    let (texture, compared) = (report.texture, &report.compared.models);
    let mut chosen: Vec<usize> = (0..texture.models().len().min(compared.len())).collect();
    chosen.sort_by(|a, b| compared[*b].seconds.total_cmp(&compared[*a].seconds));
    chosen.truncate(MOST);
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
            // To a tenth, of which none is less than nothing.
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
        // One-sided, as it is measured.
        model: hz.map(|hz| (hz, db(2.0 * filter.power(TAU * hz / rate_hz) / rate_hz))).collect(),
    }
}
