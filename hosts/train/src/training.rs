//! A training run, from data to files.

use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_data::Subject;
use asperity_diagnostics::{Diagnostic, Source};
use asperity_numbers::Random;
use asperity_plot::{Curve, Curves};
use asperity_texture::Encoder;
use asperity_texture::picture::Image;
use asperity_texture::{Library, LibraryMaterial, Pattern, VECTOR_LEN};
use burn::module::Module;
use burn::tensor::Device;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;
use serde::Deserialize;

use crate::arguments::{self, Evaluate, Settings, Train};
use crate::data::{self, Data, Origin};
use crate::descent::{self, Losses, Stage, Stop};
use crate::evaluation::{self, Naming as Named, Network, Written};
use crate::failure::Failure;
use crate::files::write_whole;
use crate::model_report::Sizes;
use crate::network::{self, Scaling};
use crate::pattern;
use crate::progress::Teller;
use crate::stages::{self, Kin, Learner, Looks, Namer, Naming, Touching, mean_vector, vectors};
use crate::{model_report, onnx};

/// Trains a model and writes it.
///
/// # Errors
/// Errors of the data, the folders or the training; [`Failure::Stopped`] by Ctrl-C.
pub(crate) fn train(train: &Train) -> Result<(), Failure> {
    let settings = &train.settings;
    let run = train.run.clone().unwrap_or_else(|| beside(&train.out));
    belongs(&run, settings)?;
    fits(&train.out, settings)?;
    let stop = stop_by_ctrl_c()?;
    let data = data::load(settings)?;
    same_data(&run, &data)?;
    spares(&train.out, &data)?;
    let _alone = begin(&train.out, &run, settings, &data)?;
    let device = Device::flex().autodiff();
    let stage = |name, steps: u32, (learning_rate, second_decay)| Stage {
        name,
        steps: steps as usize,
        learning_rate,
        second_decay,
        folder: &run,
        stop: &stop,
    };

    // With no weight on names stages one and two are the paper's.
    let kin = Kin::of(data.seen.iter().map(|s| s.family.as_deref())).filter(|_| settings.naming_weight > 0.0);
    let kin = kin.as_ref();
    let naming = stage("naming", settings.naming_steps, (settings.naming_rate, 0.999));
    let mut teller = Teller::new("naming", naming.steps);
    let namer = Namer::new(settings.preset, data.seen.len(), settings.seed, &device);
    let naming_of = Naming { batch: settings.naming_batch as usize, seed: settings.seed, kin };
    let (namer, naming_losses) =
        stages::name(&naming, namer, &data.seen, naming_of, &device, |p| teller.progress(p))?;

    let plain = Device::flex();
    let namer = namer.valid();
    if let Some(part) = namer.named_rightly(&data.seen, &plain) {
        eprintln!("naming: {:.1} % of held-out images are named rightly", 100.0 * part);
    }
    let looks = Looks::of(&namer.encoder, &data.seen, (kin, settings.seed), &plain);
    let feeling = stage("feeling", settings.feeling_steps, (settings.feeling_rate, 0.99));
    let mut teller = Teller::new("feeling", feeling.steps);
    let touching = touching(settings, &data);
    let learner = Learner::new(&namer.classifier, &looks, settings.seed, &device);
    let beside = (&looks, kin, settings.naming_weight);
    let (learner, feeling_losses) =
        stages::feel(&feeling, learner, &data.seen, beside, touching, &device, |p| teller.progress(p))?;

    // The texture encoder is done. The rest learns from vectors, half of the time from those to be
    // stored.
    let texture = learner.feeler.texture.valid();
    let mut vectors: Vec<Vec<f32>> =
        looks.seen.iter().map(|features| vectors(&texture, features, &plain)).collect();
    // Vectors that separate names are large, so they are scaled to a root mean square of 1. At a larger
    // rate the network does not settle: the loss of power has a long tail and rises.
    let squares = vectors.iter().flatten().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let rms = (squares / vectors.iter().map(Vec::len).sum::<usize>().max(1) as f64).sqrt();
    let gain = if rms > 0.0 { rms.recip() as f32 } else { 1.0 };
    vectors.iter_mut().flatten().for_each(|x| *x *= gain);
    let stored: Vec<[f32; VECTOR_LEN]> = vectors.iter().map(|v| mean_vector(v)).collect();
    let both = with_stored(&vectors, &stored);
    let settle = |name, target| {
        let settling = stage(name, settings.settling_steps, (SETTLING * settings.feeling_rate, 0.99));
        let mut teller = Teller::new(name, settling.steps);
        let touching = Touching { target, ..touching };
        let network = learner.feeler.network.clone().for_vectors_times(gain, &device);
        stages::settle(&settling, network, &data.seen, &both, touching, &device, |p| teller.progress(p))
    };
    let (settled, settling_losses) = settle("settling", settings.target)?;
    let other = settings.target.other();
    let (settled_other, other_losses) = settle("settling_other", other)?;

    let about = [("settings", about(settings))];
    let network = |network: &network::Network, target| {
        onnx::network(&network.weights(touching.scaling), target, data.reach, &about)
    };
    let out = |name: &str| train.out.join(name);
    write_whole(
        &out("encoder.onnx"),
        &onnx::encoder(&namer.encoder.kernels(), &texture.weights(looks.scale, gain), &about),
    )?;
    write_whole(&out("texture.onnx"), &network(&settled, settings.target))?;
    let name = format!("texture_{}.onnx", other.name());
    write_whole(&out(&name), &network(&settled_other, other))?;
    let mut materials = materials(&train.out, &data, &stored)?;
    pattern::fill(&mut materials, settings, &train.out)?;
    write_whole(
        &out("materials.ron"),
        Library::new(out("materials.ron"), Some("encoder.onnx".to_owned()), materials).to_ron().as_bytes(),
    )?;
    write_whole(&out(SETTINGS), serde_json::to_string_pretty(settings).unwrap_or_default().as_bytes())?;
    let losses: Vec<(String, Losses)> = [
        ("naming", naming_losses),
        ("feeling", feeling_losses),
        ("settling", settling_losses),
        ("settling_other", other_losses),
    ]
    .map(|(name, losses)| (name.to_owned(), losses))
    .into();
    write_whole(&out("losses.csv"), csv(&losses).as_bytes())?;
    write_whole(&out("curves.svg"), curves(&losses).to_svg().as_bytes())?;
    eprintln!("wrote {}", train.out.display());
    if stop.wanted() {
        return Err(Failure::Stopped);
    }
    judge(&train.out, &run, settings, &data)
}

/// Retrains the tick network of a model from its encoder's vectors, and writes its model report.
///
/// # Errors
/// Errors of the files, the data or the training; [`Failure::Stopped`] by Ctrl-C.
pub(crate) fn network(asked: &arguments::Network) -> Result<(), Failure> {
    let folder = &asked.folder;
    let settings = settings_of(folder)?;
    let run = asked.run.clone().unwrap_or_else(|| beside(folder));
    belongs(&run, &settings)?;
    let out = |name: &str| folder.join(name);
    let encoder = Encoder::load(out("encoder.onnx"))?;
    let library = Library::read(out("materials.ron"))?;
    let mut losses = losses_of(&out("losses.csv"))?;
    let stop = stop_by_ctrl_c()?;
    let data = data_of(folder, &settings, asked.data.as_ref())?;
    same_data(&run, &data)?;
    let stored: Vec<[f32; VECTOR_LEN]> =
        trained(&library, &data)?.materials().iter().map(|m| *m.vector).collect();
    let _alone = begin(folder, &run, &settings, &data)?;

    let mut teller = Teller::new("vectors", data.seen.len());
    let mut vectors: Vec<Vec<f32>> = Vec::new();
    for subject in &data.seen {
        let of: Vec<_> =
            subject.images.train.par_iter().map(|image| encoder.encode(image)).collect::<Result<_, _>>()?;
        vectors.push(of.concat());
        teller.tell(vectors.len(), "subjects");
    }
    let both = with_stored(&vectors, &stored);
    let device = Device::flex().autodiff();
    let learn = |network, name, steps: u32, learning_rate, touching| {
        let stage = Stage {
            name,
            steps: steps as usize,
            learning_rate,
            second_decay: 0.99,
            folder: &run,
            stop: &stop,
        };
        let mut teller = Teller::new(name, stage.steps);
        stages::settle(&stage, network, &data.seen, &both, touching, &device, |p| teller.progress(p))
    };
    let touching = touching(&settings, &data);
    let network = network::Network::new(&mut Random::new(settings.seed), &device);
    // The second stage draws other touches than the first.
    let other = Touching { seed: !settings.seed, ..touching };
    let steps = asked.steps.unwrap_or(settings.feeling_steps);
    let (network, first) = learn(network, "network", steps, settings.feeling_rate, other)?;
    let slow = SETTLING * settings.feeling_rate;
    let (network, second) = learn(network, "network_settling", settings.settling_steps, slow, touching)?;

    let settings = Settings { network_steps: Some(steps), ..settings };
    let about = [("settings", about(&settings))];
    let weights = network.weights(touching.scaling);
    write_whole(&out("texture.onnx"), &onnx::network(&weights, settings.target, data.reach, &about))?;
    write_whole(&out(SETTINGS), serde_json::to_string_pretty(&settings).unwrap_or_default().as_bytes())?;
    losses.retain(|(name, _)| !["settling", "network", "network_settling"].contains(&name.as_str()));
    losses.extend([("network".to_owned(), first), ("network_settling".to_owned(), second)]);
    write_whole(&out("losses.csv"), csv(&losses).as_bytes())?;
    write_whole(&out("curves.svg"), curves(&losses).to_svg().as_bytes())?;
    eprintln!("wrote {}", out("texture.onnx").display());
    eprintln!(
        "patterns go with the network before: `asperity-train pattern {}` finds them anew",
        folder.display()
    );
    if stop.wanted() {
        return Err(Failure::Stopped);
    }
    judge(folder, &run, &settings, &data)
}

/// Learning rate of settling as a part of stage two's.
const SETTLING: f64 = 0.05;

/// A stop request set by Ctrl-C; a second Ctrl-C ends the program.
fn stop_by_ctrl_c() -> Result<Arc<Stop>, Failure> {
    let stop = Arc::new(Stop::default());
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if !asked.ask() {
            std::process::exit(130);
        }
        eprintln!("stopping; Ctrl-C again to leave at once");
    })
    .map_err(|e| Failure::Model(format!("cannot listen for Ctrl-C: {e}")))?;
    Ok(stop)
}

fn touching(settings: &Settings, data: &Data) -> Touching {
    Touching {
        groups: settings.feeling_groups as usize,
        each: settings.feeling_each as usize,
        seed: settings.seed,
        target: settings.target,
        aim: settings.error,
        scaling: Scaling::of(data.reach),
    }
}

/// Vectors of images \[subject\]\[n, 256\], each list followed by equally many copies of the stored
/// vector.
fn with_stored(vectors: &[Vec<f32>], stored: &[[f32; VECTOR_LEN]]) -> Vec<Vec<f32>> {
    let all = vectors.iter().zip(stored);
    all.map(|(images, mean)| [images.clone(), mean.repeat(images.len() / VECTOR_LEN)].concat()).collect()
}

/// Settings of a model.
///
/// # Errors
/// A folder without settings.
pub(crate) fn settings_of(folder: &Path) -> Result<Settings, Diagnostic> {
    let path = folder.join(SETTINGS);
    serde_json::from_str(Source::read(&path)?.text())
        .map_err(|e| Diagnostic::new(format!("these are not a run's settings: {e}")).in_file(&path))
}

/// Settings of a model with the present place of its data.
///
/// # Errors
/// Data of another kind.
pub(crate) fn settings_now(
    folder: &Path,
    settings: &Settings,
    now: Option<&Origin>,
) -> Result<Settings, Diagnostic> {
    match now {
        Some(data) if data.name() != settings.data.name() => {
            let message = format!("this model was trained on `{}` data", settings.data.name());
            Err(Diagnostic::new(message).in_file(folder.join(SETTINGS)))
        }
        Some(data) => Ok(Settings { data: data.clone(), ..settings.clone() }),
        None => Ok(settings.clone()),
    }
}

/// Data of a model, from the place in its settings or from the present place.
fn data_of(folder: &Path, settings: &Settings, now: Option<&Origin>) -> Result<Data, Failure> {
    let settings = settings_now(folder, settings, now)?;
    data::load(&settings).map_err(|e| match e {
        Failure::Input(d) if settings.data != Origin::Made && now.is_none() => {
            let place = "the settings of this model say where its data were; --data says where they are now";
            let help = d.help.as_ref().map_or(place.to_owned(), |help| format!("{help}; {place}"));
            d.help(help).into()
        }
        e => e,
    })
}

/// Evaluates the model of a folder and writes its model report.
///
/// # Errors
/// Errors of the files and the data.
pub(crate) fn evaluate(evaluate: &Evaluate) -> Result<(), Failure> {
    let settings = settings_of(&evaluate.folder)?;
    let run = evaluate.run.clone().unwrap_or_else(|| beside(&evaluate.folder));
    if evaluate.run.is_some() && !run.is_dir() {
        return Err(Diagnostic::new("there is no such folder").in_file(&run).help("--run names it").into());
    }
    let data = data_of(&evaluate.folder, &settings, evaluate.data.as_ref())?;
    judge(&evaluate.folder, &run, &settings, &data)
}

fn judge(folder: &Path, run: &Path, settings: &Settings, data: &Data) -> Result<(), Failure> {
    let other = folder.join(format!("texture_{}.onnx", settings.target.other().name()));
    belongs(run, settings)?;
    same_data(run, data)?;
    let namer = Namer::new(settings.preset, data.seen.len(), settings.seed, &Device::flex());
    let written = Written {
        encoder: Encoder::load(folder.join("encoder.onnx"))?,
        network: Network::read(&folder.join("texture.onnx"))?,
        other: other.exists().then(|| Network::read(&other)).transpose()?,
        namer: descent::of_checkpoint(&run.join("naming.checkpoint"), settings.naming_steps as usize, namer)?,
        library: trained(&Library::read(folder.join("materials.ron"))?, data)?,
        named: named_earlier(&folder.join("evaluation.json")),
    };
    let evaluation = evaluation::evaluate(&written, settings, data)?;
    if written.namer.is_none() {
        let instead = match evaluation.naming.judged_earlier {
            true => "its figures are those of the last evaluation, which had the same images and vectors",
            false => "names are judged by the nearest vector alone",
        };
        eprintln!("no classifier in {}: {instead}", run.display());
    }
    let json = serde_json::to_string_pretty(&evaluation).unwrap_or_default();
    write_whole(&folder.join("evaluation.json"), json.as_bytes())?;
    let size = |name: &str| std::fs::metadata(folder.join(name)).map_or(0, |m| m.len());
    let sizes = Sizes { encoder_bytes: size("encoder.onnx"), network_bytes: size("texture.onnx") };
    let report = model_report::write(settings, sizes, data, &evaluation);
    write_whole(&folder.join("MODEL_CARD.md"), report.as_bytes())?;
    eprintln!("wrote {}", folder.join("MODEL_CARD.md").display());
    Ok(())
}

/// Naming of an earlier evaluation, if there was one.
fn named_earlier(path: &Path) -> Option<Named> {
    #[derive(Deserialize)]
    struct Earlier {
        naming: Named,
    }
    let text = Source::read(path).ok()?;
    serde_json::from_str::<Earlier>(text.text()).ok().map(|earlier| earlier.naming)
}

/// Settings for a model's files, without the user's folder.
fn about(settings: &Settings) -> String {
    let mut about = serde_json::to_value(settings).unwrap_or_default();
    about["data"] = settings.data.name().into();
    about.to_string()
}

/// A library's trained materials in the data's order, without later additions.
fn trained(library: &Library, data: &Data) -> Result<Library, Diagnostic> {
    let of = |subject: &Subject| library.material(&subject.name).cloned();
    let materials = data.seen.iter().map(of).collect::<Result<_, _>>()?;
    Ok(Library::new("materials.ron", None, materials))
}

/// The library's materials; writes a picture of each.
fn materials(
    folder: &Path,
    data: &Data,
    vectors: &[[f32; VECTOR_LEN]],
) -> Result<Vec<LibraryMaterial>, Failure> {
    let pictures = folder.join("pictures");
    std::fs::create_dir_all(&pictures)
        .map_err(|e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(&pictures))?;
    let mut taken = HashSet::new();
    let mut picture = |subject: &Subject| -> Result<Vec<String>, Failure> {
        let images = &subject.images;
        let Some(image) = images.held.first().or(images.train.first()) else { return Ok(Vec::new()) };
        let name = format!("pictures/{}.jpg", file_name(&subject.name, &mut taken));
        write_whole(&folder.join(&name), &jpeg(image)?)?;
        Ok(vec![name])
    };
    let mut material =
        |(subject, vector): (&Subject, &[f32; VECTOR_LEN])| -> Result<LibraryMaterial, Failure> {
            Ok(LibraryMaterial {
                name: subject.name.clone(),
                description: subject.description.clone(),
                family: subject.family.clone(),
                images: picture(subject)?,
                pattern: Pattern::default(),
                vector: Box::new(*vector),
            })
        };
    let materials = data.seen.iter().zip(vectors).map(&mut material).collect::<Result<_, _>>()?;
    // Unseen surfaces get pictures too, for the reader.
    data.unseen.iter().try_for_each(|subject| picture(subject).map(drop))?;
    Ok(materials)
}

/// An unused file name for any file system: letters, digits, points and underscores.
fn file_name(name: &str, taken: &mut HashSet<String>) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' };
    let plain: String = name.chars().map(safe).collect();
    let numbered = (2_u32..).map(|number| format!("{plain}_{number}"));
    // Some file systems ignore case.
    let free = |name: &String| taken.insert(name.to_lowercase());
    std::iter::once(plain.clone()).chain(numbered).find(free).unwrap_or(plain)
}

/// An image as a JPEG file of good quality.
fn jpeg(image: &Image) -> Result<Vec<u8>, Failure> {
    let [rows, columns] = image.size;
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 88)
        .encode(&image.pixels, columns as u32, rows as u32, ExtendedColorType::Rgb8)
        .map_err(|e| Failure::Model(format!("a picture cannot be written: {e}")))?;
    Ok(bytes)
}

/// Losses by stage in the form of [`csv`].
fn losses_of(path: &Path) -> Result<Vec<(String, Losses)>, Diagnostic> {
    let source = Source::read(path)?;
    let mut stages: Vec<(String, Losses)> = Vec::new();
    for (number, line) in source.text().lines().enumerate().skip(1) {
        let mut parts = line.split(',');
        let [name, step, loss] = [(); 3].map(|()| parts.next().unwrap_or_default());
        let (Ok(step), Ok(loss)) = (step.parse(), loss.parse()) else {
            let message = format!("line {} is not `stage,step,loss`", number + 1);
            return Err(Diagnostic::new(message).in_file(path));
        };
        match stages.iter_mut().find(|(known, _)| known == name) {
            Some((_, losses)) => losses.push((step, loss)),
            None => stages.push((name.to_owned(), vec![(step, loss)])),
        }
    }
    Ok(stages)
}

fn csv(stages: &[(String, Losses)]) -> String {
    let rows = stages
        .iter()
        .flat_map(|(name, losses)| losses.iter().map(move |(step, loss)| format!("{name},{step},{loss}\n")));
    std::iter::once("stage,step,loss\n".to_owned()).chain(rows).collect()
}

fn curves(stages: &[(String, Losses)]) -> Curves {
    let curve = |(name, losses): &(String, Losses)| Curve {
        name: name.clone(),
        remark: losses.last().map(|(_, loss)| format!("{loss:.4} at last")).unwrap_or_default(),
        points: losses.iter().map(|(step, loss)| (*step as f64, *loss)).collect(),
    };
    Curves {
        title: "Training".to_owned(),
        subtitle: "mean loss since the last report, by step".to_owned(),
        curves: stages.iter().map(curve).collect(),
    }
}

/// The folder of checkpoints beside a model's.
fn beside(out: &Path) -> PathBuf {
    // `.` and `..` have no file name.
    let whole = if out.file_name().is_none() { out.canonicalize().ok() } else { None };
    let out = whole.as_deref().unwrap_or(out);
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    out.with_file_name(name)
}

/// File of the settings in a model's or a run's folder.
const SETTINGS: &str = "settings.json";

/// Whether two runs have the same settings, apart from later changes to the model.
fn begun_alike(a: &Settings, b: &Settings) -> bool {
    Settings { network_steps: b.network_steps, ..a.clone() } == *b
}

/// Refuses a run's folder that belongs to other settings.
fn belongs(run: &Path, settings: &Settings) -> Result<(), Diagnostic> {
    let Some(found) = told(run, SETTINGS)? else { return Ok(()) };
    let path = run.join(SETTINGS);
    let found: Settings = serde_json::from_str(&found)
        .map_err(|e| Diagnostic::new(format!("these are not a run's settings: {e}")).in_file(&path))?;
    if begun_alike(&found, settings) {
        return Ok(());
    }
    Err(Diagnostic::new("this run was begun with other settings")
        .in_file(path)
        .help("give the settings it has, name another --run folder, or remove this one"))
}

/// Content of a file of a run's folder; nothing if no run was begun there.
fn told(run: &Path, name: &str) -> Result<Option<String>, Diagnostic> {
    let path = run.join(name);
    if path.exists() {
        return Ok(Some(Source::read(&path)?.text().to_owned()));
    }
    let mut files = std::fs::read_dir(run).into_iter().flatten().flatten();
    match files.find(|file| file.path().extension().is_some_and(|e| e == "checkpoint")) {
        None => Ok(None),
        Some(file) => Err(Diagnostic::new("it is not known what this checkpoint was made with")
            .in_file(file.path())
            .help(format!("its run's {name} is gone: name another --run folder, or remove this one"))),
    }
}

/// Refuses a folder with a model of other settings.
fn fits(out: &Path, settings: &Settings) -> Result<(), Diagnostic> {
    let path = out.join(SETTINGS);
    let alike = |found: &str| serde_json::from_str(found).is_ok_and(|found| begun_alike(&found, settings));
    if !path.exists() || alike(Source::read(&path)?.text()) {
        return Ok(());
    }
    Err(Diagnostic::new("a model with other settings lies here")
        .in_file(&path)
        .help("name another --out folder, or remove this one"))
}

/// Refuses to overwrite a library with later additions.
fn spares(out: &Path, data: &Data) -> Result<(), Diagnostic> {
    let path = out.join("materials.ron");
    if !path.exists() {
        return Ok(());
    }
    let library = Library::read(&path)?;
    match library.materials().iter().find(|m| data.seen.iter().all(|s| s.name != m.name)) {
        None => Ok(()),
        Some(added) => {
            Err(Diagnostic::new(format!("`{}` was added to this library, and would be lost", added.name))
                .in_file(&path)
                .help("name another --out folder, or move this file away"))
        }
    }
}

/// File of a run's folder with the checksum of its data.
const CHECKSUM: &str = "data.crc32";

/// Refuses a run's folder begun with other data.
fn same_data(run: &Path, data: &Data) -> Result<(), Diagnostic> {
    match told(run, CHECKSUM)? {
        Some(found) if found != data.checksum().to_string() => {
            Err(Diagnostic::new("the data have changed since this run was begun")
                .in_file(run.join(CHECKSUM))
                .help("name another --run folder, or remove this one"))
        }
        _ => Ok(()),
    }
}

/// Makes a run's folders and marks them as such. Nobody else can train there until the result is
/// dropped.
fn begin(out: &Path, run: &Path, settings: &Settings, data: &Data) -> Result<File, Diagnostic> {
    for folder in [out, run] {
        std::fs::create_dir_all(folder)
            .map_err(|e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(folder))?;
    }
    let lock = run.join("lock");
    let held = File::create(&lock)
        .map_err(|e| Diagnostic::new(format!("cannot write this file: {e}")).in_file(&lock))?;
    if let Err(TryLockError::WouldBlock) = held.try_lock() {
        return Err(Diagnostic::new("another training is going on here")
            .in_file(run)
            .help("wait until it is done, or name another --run folder"));
    }
    write_whole(&run.join(CHECKSUM), data.checksum().to_string().as_bytes())?;
    write_whole(&run.join(SETTINGS), serde_json::to_string_pretty(settings).unwrap_or_default().as_bytes())?;
    Ok(held)
}
