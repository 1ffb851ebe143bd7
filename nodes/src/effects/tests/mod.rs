//! Effects in an engine, against their kernels driven directly and against closed forms.

mod autoregressive;
mod forces;
mod gliding;
mod level;
mod limiter;
mod settings;
mod tap;
mod vibration;

/// Writes a recording, its channels side by side.
fn wav(path: &std::path::Path, channels: u16, sample_rate: u32, samples: &[f32]) {
    let (bits_per_sample, sample_format) = (32, hound::SampleFormat::Float);
    let spec = hound::WavSpec { channels, sample_rate, bits_per_sample, sample_format };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    samples.iter().for_each(|x| writer.write_sample(*x).unwrap());
    writer.finalize().unwrap();
}
