//! A training run, from data to files.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use asperity_dataset::Subject;
use asperity_source::Diagnostic;
use asperity_world::material::{Library, LibraryMaterial};
use asperity_world::tactile::Image;
use burn::module::Module;
use burn::tensor::Device;

use crate::arguments::{Settings, Train};
use crate::data;
use crate::descent::Stage;
use crate::encoder::{ImageEncoder, features};
use crate::failure::Failure;
use crate::files::write_whole;
use crate::onnx;
use crate::progress::Teller;
use crate::stages::{self, Feeler, Looks, Namer, Touching, mean_vector};

/// Trains a model and writes it.
///
/// # Errors
/// What the data, the folders or the training say; [`Failure::Stopped`] by Ctrl-C.
pub(crate) fn train(train: &Train) -> Result<(), Failure> {
    let settings = &train.settings;
    let run = run_folder(train)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        // a second time: at once
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|e| Failure::Model(format!("cannot listen for Ctrl-C: {e}")))?;

    let data = data::load(settings)?;
    let device = Device::flex().autodiff();
    let stage =
        |name, steps: u32, learning_rate| Stage { name, steps: steps as usize, learning_rate, folder: &run };

    let naming = stage("naming", settings.naming_steps, settings.naming_rate);
    let mut teller = Teller::new("naming", naming.steps);
    let namer = Namer::new(settings.preset, data.seen.len(), settings.seed, &device);
    let batch = (settings.naming_batch as usize, settings.seed);
    let (namer, _losses) =
        stages::name(&naming, namer, &data.seen, batch, &device, &stop, |p| teller.progress(p))?;

    let plain = Device::flex();
    let encoder = namer.encoder.valid();
    let looks = seen_features(&encoder, &data.seen, &plain);
    let feeling = stage("feeling", settings.feeling_steps, settings.feeling_rate);
    let mut teller = Teller::new("feeling", feeling.steps);
    let touching = Touching {
        groups: settings.feeling_groups as usize,
        each: settings.feeling_each as usize,
        seed: settings.seed,
        target: settings.target,
        aim: settings.error,
    };
    let feeler = Feeler::new(settings.preset, settings.seed, &device);
    let images = Looks { numbers: &looks, width: crate::encoder::FEATURES };
    let (feeler, _losses) =
        stages::feel(&feeling, feeler, &data.seen, &images, touching, &device, &stop, |p| {
            teller.progress(p)
        })?;

    let feeler = feeler.valid();
    let about = [
        ("seed", settings.seed.to_string()),
        ("settings", serde_json::to_string(settings).unwrap_or_default()),
    ];
    let texture = onnx::network(&feeler.network.weights(), &about);
    let encoding = onnx::encoder(&encoder.kernels(), &feeler.texture.weights(), &about);
    write_whole(&train.out.join("texture.onnx"), &texture)?;
    write_whole(&train.out.join("encoder.onnx"), &encoding)?;
    Ok(())
}

/// Features of each subject's training images.
fn seen_features(encoder: &ImageEncoder, subjects: &[Subject], device: &Device) -> Vec<Vec<f32>> {
    let mut teller = Teller::new("features", subjects.len());
    let of = |(n, s): (usize, &Subject)| {
        let images: Vec<&Image> = s.images.train.iter().collect();
        let features = features(encoder, &images, device);
        teller.tell(n + 1, "");
        features
    };
    subjects.iter().enumerate().map(of).collect()
}

/// Makes the folder of a run, or finds it; one that belongs to other settings is refused.
fn run_folder(train: &Train) -> Result<PathBuf, Diagnostic> {
    let run = train.run.clone().unwrap_or_else(|| {
        let mut name = train.out.clone().into_os_string();
        name.push(".run");
        name.into()
    });
    for folder in [&train.out, &run] {
        std::fs::create_dir_all(folder)
            .map_err(|e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(folder))?;
    }
    let path = run.join("settings.json");
    let wanted = serde_json::to_string_pretty(&train.settings).unwrap_or_default();
    match std::fs::read_to_string(&path) {
        Ok(found) if found == wanted => Ok(run),
        Ok(_) => Err(Diagnostic::new("this run was begun with other settings")
            .in_file(&path)
            .help("give the settings it has, name another --run folder, or remove this one")),
        Err(_) => {
            write_whole(&path, wanted.as_bytes())?;
            Ok(run)
        }
    }
}
