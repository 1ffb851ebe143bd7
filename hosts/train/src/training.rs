//! A training run, from data to files.

use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_dataset::Subject;
use asperity_network::Encoder;
use asperity_plot::{Curve, Curves};
use asperity_source::Diagnostic;
use asperity_world::material::{Library, LibraryMaterial, Pattern, VECTOR_LEN};
use asperity_world::tactile::Image;
use burn::module::Module;
use burn::tensor::Device;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use crate::arguments::{Evaluate, Settings, Train};
use crate::card::Sizes;
use crate::data::{self, Data, Origin};
use crate::descent::{self, Losses, Stage, Stop};
use crate::evaluation::{self, Network, Written};
use crate::failure::Failure;
use crate::files::write_whole;
use crate::network::{self, Scaling};
use crate::pattern;
use crate::progress::Teller;
use crate::stages::{self, Kin, Learner, Looks, Namer, Naming, Touching, mean_vector, vectors};
use crate::{card, onnx};

/// Trains a model and writes it.
///
/// # Errors
/// What the data, the folders or the training say; [`Failure::Stopped`] by Ctrl-C.
pub(crate) fn train(train: &Train) -> Result<(), Failure> {
    let settings = &train.settings;
    let run = train.run.clone().unwrap_or_else(|| beside(&train.out));
    belongs(&run, settings)?;
    fits(&train.out, settings)?;
    let stop = Arc::new(Stop::default());
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if !asked.ask() {
            std::process::exit(130);
        }
        eprintln!("stopping; Ctrl-C again to leave at once");
    })
    .map_err(|e| Failure::Model(format!("cannot listen for Ctrl-C: {e}")))?;

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

    // without a weight on names stage two is the paper's, and so is stage one
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
    let touching = Touching {
        groups: settings.feeling_groups as usize,
        each: settings.feeling_each as usize,
        seed: settings.seed,
        target: settings.target,
        aim: settings.error,
        scaling: Scaling::of(data.reach),
    };
    let learner = Learner::new(&namer.classifier, &looks, settings.seed, &device);
    let beside = (&looks, kin, settings.naming_weight);
    let (learner, feeling_losses) =
        stages::feel(&feeling, learner, &data.seen, beside, touching, &device, |p| teller.progress(p))?;

    // The texture encoder is done: what is left is learned from vectors, half of the time the ones that will be stored.
    let texture = learner.feeler.texture.valid();
    let mut vectors: Vec<Vec<f32>> =
        looks.seen.iter().map(|features| vectors(&texture, features, &plain)).collect();
    // Vectors that keep names apart are large: they are brought to a root mean square of 1. At a larger rate the network does not
    // settle: the loss of power has a long tail, and goes up.
    let squares = vectors.iter().flatten().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let rms = (squares / vectors.iter().map(Vec::len).sum::<usize>().max(1) as f64).sqrt();
    let gain = if rms > 0.0 { rms.recip() as f32 } else { 1.0 };
    vectors.iter_mut().flatten().for_each(|x| *x *= gain);
    let stored: Vec<[f32; VECTOR_LEN]> = vectors.iter().map(|v| mean_vector(v)).collect();
    let both: Vec<Vec<f32>> = vectors
        .iter()
        .zip(&stored)
        .map(|(images, mean)| [images.clone(), mean.repeat(images.len() / VECTOR_LEN)].concat())
        .collect();
    let settle = |name, target| {
        let settling = stage(name, settings.settling_steps, (0.05 * settings.feeling_rate, 0.99));
        let mut teller = Teller::new(name, settling.steps);
        let touching = Touching { target, ..touching };
        let network = learner.feeler.network.clone().for_vectors_times(gain, &device);
        stages::settle(&settling, network, &data.seen, &both, touching, &device, |p| teller.progress(p))
    };
    let (settled, settling_losses) = settle("settling", settings.target)?;
    let other = settings.target.other();
    let (settled_other, other_losses) = settle("settling_other", other)?;

    let about = [("settings", about(settings))];
    let network =
        |network: &network::Network| onnx::network(&network.weights(touching.scaling), data.reach, &about);
    let out = |name: &str| train.out.join(name);
    write_whole(
        &out("encoder.onnx"),
        &onnx::encoder(&namer.encoder.kernels(), &texture.weights(looks.scale, gain), &about),
    )?;
    write_whole(&out("texture.onnx"), &network(&settled))?;
    let name = format!("texture_{}.onnx", other.name());
    write_whole(&out(&name), &network(&settled_other))?;
    let mut materials = materials(&train.out, &data, &stored)?;
    pattern::fill(&mut materials, settings)?;
    write_whole(
        &out("materials.ron"),
        Library::new(out("materials.ron"), Some("encoder.onnx".to_owned()), materials).to_ron().as_bytes(),
    )?;
    write_whole(&out(SETTINGS), serde_json::to_string_pretty(settings).unwrap_or_default().as_bytes())?;
    let losses = [
        ("naming", naming_losses),
        ("feeling", feeling_losses),
        ("settling", settling_losses),
        ("settling_other", other_losses),
    ];
    write_whole(&out("losses.csv"), csv(&losses).as_bytes())?;
    write_whole(&out("curves.svg"), curves(&losses).to_svg().as_bytes())?;
    eprintln!("wrote {}", train.out.display());
    if stop.wanted() {
        return Err(Failure::Stopped);
    }
    judge(&train.out, &run, settings, &data)
}

/// Judges the model of a folder, and writes its card.
///
/// # Errors
/// What the files say, and the data.
pub(crate) fn evaluate(evaluate: &Evaluate) -> Result<(), Failure> {
    let settings = told_settings(&evaluate.folder)?;
    let run = evaluate.run.clone().unwrap_or_else(|| beside(&evaluate.folder));
    let now = settings_of(&evaluate.folder, evaluate.data.as_ref())?;
    if evaluate.run.is_some() && !run.is_dir() {
        return Err(Diagnostic::new("there is no such folder").in_file(&run).help("--run names it").into());
    }
    let data = data::load(&now).map_err(|e| match e {
        Failure::Input(d) if now.data != Origin::Made && evaluate.data.is_none() => {
            let place = "the settings of this model say where its data were; --data says where they are now";
            let help = d.help.as_ref().map_or(place.to_owned(), |help| format!("{help}; {place}"));
            d.help(help).into()
        }
        e => e,
    })?;
    judge(&evaluate.folder, &run, &settings, &data)
}

/// The settings of a model.
fn told_settings(folder: &Path) -> Result<Settings, Diagnostic> {
    let path = folder.join(SETTINGS);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Diagnostic::new(format!("cannot read this file: {e}")).in_file(&path))?;
    serde_json::from_str(&text)
        .map_err(|e| Diagnostic::new(format!("these are not a run's settings: {e}")).in_file(&path))
}

/// The settings of a model, with the place where its data are now, if that is another.
///
/// # Errors
/// No settings, or data of another kind.
pub(crate) fn settings_of(folder: &Path, data: Option<&Origin>) -> Result<Settings, Diagnostic> {
    let settings = told_settings(folder)?;
    match data {
        Some(data) if data.name() != settings.data.name() => {
            let message = format!("this model was trained on `{}` data", settings.data.name());
            Err(Diagnostic::new(message).in_file(folder.join(SETTINGS)))
        }
        Some(data) => Ok(Settings { data: data.clone(), ..settings }),
        None => Ok(settings),
    }
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
    };
    if written.namer.is_none() {
        eprintln!("no classifier in {}: names are judged by the nearest vector alone", run.display());
    }
    let evaluation = evaluation::evaluate(&written, settings, data)?;
    let json = serde_json::to_string_pretty(&evaluation).unwrap_or_default();
    write_whole(&folder.join("evaluation.json"), json.as_bytes())?;
    let size = |name: &str| std::fs::metadata(folder.join(name)).map_or(0, |m| m.len());
    let sizes = Sizes { encoder_bytes: size("encoder.onnx"), network_bytes: size("texture.onnx") };
    let card = card::write(settings, sizes, data, &evaluation);
    write_whole(&folder.join("MODEL_CARD.md"), card.as_bytes())?;
    eprintln!("wrote {}", folder.join("MODEL_CARD.md").display());
    Ok(())
}

/// Settings, as the files of a model tell them: where the user's folder is, is the user's own affair.
fn about(settings: &Settings) -> String {
    let mut about = serde_json::to_value(settings).unwrap_or_default();
    about["data"] = settings.data.name().into();
    about.to_string()
}

/// Those of a library's materials that were trained on, in the data's order: others may have come in since.
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
    // Of what is not known too: to be looked up.
    data.unseen.iter().try_for_each(|subject| picture(subject).map(drop))?;
    Ok(materials)
}

/// A name that any file system takes, in letters, digits, points and underscores, and that is not taken yet.
fn file_name(name: &str, taken: &mut HashSet<String>) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' };
    let plain: String = name.chars().map(safe).collect();
    let numbered = (2_u32..).map(|number| format!("{plain}_{number}"));
    // some file systems take no notice of case
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

fn csv(stages: &[(&str, Losses)]) -> String {
    let rows = stages
        .iter()
        .flat_map(|(name, losses)| losses.iter().map(move |(step, loss)| format!("{name},{step},{loss}\n")));
    std::iter::once("stage,step,loss\n".to_owned()).chain(rows).collect()
}

fn curves(stages: &[(&str, Losses)]) -> Curves {
    let curve = |(name, losses): &(&str, Losses)| Curve {
        name: (*name).to_owned(),
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
    // `.` and `..` have no name of their own
    let whole = if out.file_name().is_none() { out.canonicalize().ok() } else { None };
    let out = whole.as_deref().unwrap_or(out);
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    out.with_file_name(name)
}

/// The file of a model's or a run's folder that has its settings.
const SETTINGS: &str = "settings.json";

/// Refuses a run's folder that belongs to other settings.
fn belongs(run: &Path, settings: &Settings) -> Result<(), Diagnostic> {
    let Some(found) = told(run, SETTINGS)? else { return Ok(()) };
    let path = run.join(SETTINGS);
    let found: Settings = serde_json::from_str(&found)
        .map_err(|e| Diagnostic::new(format!("these are not a run's settings: {e}")).in_file(&path))?;
    if found == *settings {
        return Ok(());
    }
    Err(Diagnostic::new("this run was begun with other settings")
        .in_file(path)
        .help("give the settings it has, name another --run folder, or remove this one"))
}

/// What a run's folder says in one of its files; nothing where no run was begun there.
fn told(run: &Path, name: &str) -> Result<Option<String>, Diagnostic> {
    let path = run.join(name);
    match std::fs::read_to_string(&path) {
        Ok(found) => Ok(Some(found)),
        Err(e) if e.kind() == ErrorKind::NotFound => {
            let mut files = std::fs::read_dir(run).into_iter().flatten().flatten();
            match files.find(|file| file.path().extension().is_some_and(|e| e == "checkpoint")) {
                None => Ok(None),
                Some(file) => Err(Diagnostic::new("it is not known what this checkpoint was made with")
                    .in_file(file.path())
                    .help(format!(
                        "its run's {name} is gone: name another --run folder, or remove this one"
                    ))),
            }
        }
        Err(e) => Err(Diagnostic::new(format!("cannot read this file: {e}")).in_file(&path)),
    }
}

/// Refuses a folder that has a model of other settings.
fn fits(out: &Path, settings: &Settings) -> Result<(), Diagnostic> {
    let path = out.join(SETTINGS);
    match std::fs::read_to_string(&path) {
        Ok(found) if serde_json::from_str(&found).ok().as_ref() != Some(settings) => {
            Err(Diagnostic::new("a model with other settings lies here")
                .in_file(&path)
                .help("name another --out folder, or remove this one"))
        }
        Ok(_) => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        Err(e) => Err(Diagnostic::new(format!("cannot read this file: {e}")).in_file(&path)),
    }
}

/// Refuses to write over a library that someone has added to.
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

/// The file of a run's folder that has the checksum of its data.
const CHECKSUM: &str = "data.crc32";

/// Refuses a run's folder that was begun with other data.
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

/// Makes a run's folders, and says in them what it is. Until the answer is dropped nobody else trains there.
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
