//! The short-time spectrum of a signal as a small picture.

use asperity_dsp::Stft;

use super::lines::Series;

/// Length of the Hann window in seconds. Its main lobe is 40 Hz wide on each side: enough for texture, and
/// short enough to show the turns of a stroke.
const WINDOW_S: f64 = 0.05;
/// Most columns of the picture, and its rows.
const MAX_COLUMNS: usize = 600;
const ROWS: usize = 128;
/// Most frames for one column, where columns are further apart than windows.
const FRAMES_A_COLUMN: usize = 4;
pub(super) const RANGE_DB: f64 = 60.0;

pub(super) struct Spectrogram {
    /// Levels in dB re 1 of the signal's unit, row by row from the highest frequency down.
    pub(super) levels: Vec<f32>,
    pub(super) columns: usize,
    /// Frequency at the upper edge, in Hz; the lower edge is 0.
    pub(super) max_hz: f64,
    /// Level of the darkest colour, a multiple of 10 dB.
    pub(super) top_db: f64,
}

impl Spectrogram {
    /// Amplitudes 2 |sum w x| / sum w of the first column of `series` up to `max_hz`. A sine of amplitude 1
    /// on a bin reads 0 dB. `None` where the series is silent, shorter than a window, or too slow for one.
    pub(super) fn of(series: &Series, max_hz: f64) -> Option<Self> {
        let (hz, rows) = (series.hz, series.rows());
        let length = (hz * WINDOW_S).round();
        if !(8.0..=1e7).contains(&length) || rows < length as usize {
            return None;
        }
        let length = length as usize;
        let max_hz = max_hz.min(hz / 2.0);
        let columns = MAX_COLUMNS.min(rows / (length / 8)).max(1);
        let width = rows as f64 / columns as f64;
        let frames = ((width / length as f64).ceil() as usize).clamp(1, FRAMES_A_COLUMN);
        let mut stft = Stft::<f32>::new(length);
        let sample = |row: i64| {
            let value = usize::try_from(row).map_or(f64::NAN, |row| series.value(row, 0));
            if value.is_finite() { value as f32 } else { 0.0 }
        };
        let mut levels = vec![0.0f32; columns * ROWS];
        for column in 0..columns {
            let mut power = vec![0.0f32; length / 2 + 1];
            for frame in 0..frames {
                let centre = width * (column as f64 + (frame as f64 + 0.5) / frames as f64);
                let start = centre as i64 - length as i64 / 2;
                let samples: Vec<f32> = (start..start + length as i64).map(sample).collect();
                let bins = stft.process(&samples);
                power.iter_mut().zip(bins).for_each(|(p, x)| *p += x.norm_sqr() / frames as f32);
            }
            for row in 0..ROWS {
                // The strongest bin that a row covers, or the one it lies in.
                let edge = |r: usize| (ROWS - r) as f64 / ROWS as f64 * max_hz * length as f64 / hz;
                let (low, high) = (edge(row + 1).round() as usize, edge(row).round() as usize);
                let bins = &power[low.min(power.len() - 1)..high.clamp(low + 1, power.len()).max(1)];
                let strongest = bins.iter().copied().fold(0.0f32, f32::max);
                levels[row * columns + column] = 10.0 * strongest.max(1e-20).log10();
            }
        }
        let top = levels.iter().copied().fold(f32::MIN, f32::max);
        if top <= -199.0 {
            return None;
        }
        Some(Self { levels, columns, max_hz, top_db: 10.0 * f64::from(top / 10.0).ceil() })
    }

    /// The levels as a PNG, down to [`RANGE_DB`] below the top. A palette entry is a level.
    pub(super) fn png(&self) -> Option<Vec<u8>> {
        const LEVELS: usize = 120;
        let palette: Vec<u8> =
            (0..=LEVELS).flat_map(|i| colour(i as f64 / LEVELS as f64).map(|v| v.round() as u8)).collect();
        let pixels: Vec<u8> = self
            .levels
            .iter()
            .map(|&db| {
                let part = (f64::from(db) - self.top_db) / RANGE_DB + 1.0;
                (part.clamp(0.0, 1.0) * LEVELS as f64).round() as u8
            })
            .collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.columns as u32, ROWS as u32);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(palette);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().ok()?;
        writer.write_image_data(&pixels).ok()?;
        writer.finish().ok()?;
        Some(file)
    }
}

/// The colour scale: from white (0) through blue to deep violet (1), ever darker.
pub(super) fn colour(part: f64) -> [f64; 3] {
    const STOPS: [[f64; 3]; 6] = [
        [255.0, 255.0, 255.0],
        [222.0, 237.0, 242.0],
        [139.0, 194.0, 214.0],
        [56.0, 132.0, 184.0],
        [48.0, 62.0, 140.0],
        [38.0, 12.0, 62.0],
    ];
    let at = part.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let (a, b) = (STOPS[i], STOPS[i + 1]);
    [0, 1, 2].map(|k| a[k] + (at - i as f64) * (b[k] - a[k]))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn sine(hz: f64, rate: f64, seconds: f64, amplitude: f64) -> Series {
        let n = (rate * seconds) as usize;
        let data = (0..n).map(|i| (amplitude * (TAU * hz * i as f64 / rate).sin()) as f32).collect();
        Series::sampled("a", "m/s\u{b2}", rate, data)
    }

    #[test]
    fn sine_reads_its_amplitude_at_its_frequency() {
        for (hz, rate, amplitude) in [(400.0, 48_000.0, 1.0), (120.0, 2_500.0, 0.1), (220.0, 500.0, 3.0)] {
            let s = Spectrogram::of(&sine(hz, rate, 2.0, amplitude), 1000.0).unwrap();
            assert_eq!(s.max_hz, 1000.0f64.min(rate / 2.0));
            let middle = s.columns / 2;
            let column: Vec<f32> = (0..ROWS).map(|r| s.levels[r * s.columns + middle]).collect();
            let peak = (0..ROWS).max_by(|a, b| column[*a].total_cmp(&column[*b])).unwrap();
            let at = s.max_hz * (1.0 - (peak as f64 + 0.5) / ROWS as f64);
            assert!((at - hz).abs() <= 10.0, "{at} for {hz}");
            let want = 20.0 * amplitude.log10();
            assert!((f64::from(column[peak]) - want).abs() < 0.1, "{} for {want}", column[peak]);
            // The Hann window's side lobes fall at 18 dB an octave: 150 Hz away little is left.
            let far = ((1.0 - (at - 100.0) / s.max_hz) * ROWS as f64) as usize;
            assert!(column[far.min(ROWS - 1)] < column[peak] - 40.0);
        }
    }

    #[test]
    fn short_silent_or_slow_series_have_none() {
        assert!(Spectrogram::of(&sine(100.0, 2500.0, 0.04, 1.0), 1000.0).is_none(), "shorter than a window");
        assert!(Spectrogram::of(&sine(100.0, 2500.0, 1.0, 0.0), 1000.0).is_none(), "silent");
        assert!(Spectrogram::of(&sine(1.0, 50.0, 1.0, 1.0), 1000.0).is_none(), "too slow");
        let mut broken = sine(100.0, 2500.0, 1.0, 1.0);
        broken.data[7] = f32::NAN;
        assert!(Spectrogram::of(&broken, 1000.0).unwrap().levels.iter().all(|v| v.is_finite()));
    }

    #[test]
    fn picture_reads_back_as_its_levels() {
        let s = Spectrogram::of(&sine(400.0, 2500.0, 1.0, 1.0), 1000.0).unwrap();
        let bytes = s.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width as usize, info.height as usize), (s.columns, ROWS));
        for (p, db) in pixels.iter().zip(&s.levels) {
            let shown = f64::from(*p) / 120.0 * RANGE_DB + s.top_db - RANGE_DB;
            assert!(
                (shown - f64::from(*db)).abs() <= 0.26
                    || (*p == 0 && f64::from(*db) < s.top_db - RANGE_DB + 0.26)
            );
        }
    }

    #[test]
    fn colours_only_darken() {
        let light = |i: i32| {
            let [r, g, b] = colour(f64::from(i) / 100.0);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..100).all(|i| light(i + 1) < light(i)));
    }
}
