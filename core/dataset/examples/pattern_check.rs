//! Holds the patterns of a library against the physics: `cargo run --release -p asperity-dataset --example
//! pattern_check LIBRARY`.
//!
//! Of each grating, a stroke straight across at 60 and 100 mm/s: kurtosis and the lag at which the wave
//! repeats, of the physics and of the kernel.

use asperity_dataset::felt::Hand;
use asperity_dataset::{Spectrometer, made, pattern};
use asperity_measure::accuracy::rhythm::{Rhythm, repeats_at};
use asperity_world::material::Library;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("name a library")?;
    for material in Library::read(path)?.materials() {
        if material.family.as_deref() != Some("grating") {
            continue;
        }
        let ground = made::Ground::new(&made::surface(&material.name)?, 7);
        for speed in [60.0, 100.0] {
            let felt = ground.felt(&Hand::new(8.3, |t| [speed * t, 0.0, -2.0])?, 1);
            let axes: Vec<&[f64]> = felt.axes().into_iter().map(|axis| &axis[3000..]).collect();
            let mut spectrometer = Spectrometer::new(felt.rate_hz);
            let mut squares = vec![0.0; 101];
            let starts: Vec<usize> = (0..axes[0].len() - 1000).step_by(500).collect();
            for start in &starts {
                let frame: Vec<&[f64]> = axes.iter().map(|axis| &axis[*start..start + 1000]).collect();
                let found = spectrometer.magnitudes(&frame);
                squares[1..].iter_mut().zip(found).for_each(|(sum, m)| *sum += f64::from(m * m));
            }
            let magnitudes: Vec<f64> = squares.iter().map(|s| (s / starts.len() as f64).sqrt()).collect();
            let places: Vec<[f64; 2]> =
                (0..4000).map(|tick| [speed * 0.002 * f64::from(tick), 0.0]).collect();
            let kernel = pattern::rendered(&material.pattern, &magnitudes, &places, 5);
            let kernel = &kernel[500..];
            let about = 1.0 / (speed * material.pattern.waves.first().map_or(1.0, |w| w.per_mm[0].abs()));
            let (truth, found) =
                (Rhythm::new(&axes, felt.rate_hz)?, Rhythm::new(&[kernel], pattern::RATE_HZ)?);
            let strongest = axes.iter().max_by(|a, b| power(a).total_cmp(&power(b))).ok_or("no axis")?;
            let want = repeats_at(strongest, felt.rate_hz, about)?;
            let is = repeats_at(kernel, pattern::RATE_HZ, about)?;
            println!(
                "{:22} {speed:3} mm/s: kurtosis {:6.2} {:6.2}, repeats after {:5.2} {:5.2} ms ({:.2} {:.2})",
                material.name,
                truth.kurtosis,
                found.kurtosis,
                1e3 * want.lag_s,
                1e3 * is.lag_s,
                want.correlation,
                is.correlation
            );
        }
    }
    Ok(())
}

fn power(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}
