//! A training run, from data to files.

use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_data::Subject;
use asperity_diagnostics::{Diagnostic, Source};
use asperity_numbers::Random;
use asperity_plot::{Chart, Plot, Scale, Trace};
use asperity_texture::picture::Image;
use asperity_texture::{Encoder, Library, LibraryMaterial, Model, Pattern, VECTOR_LEN};
use burn::module::Module;
use burn::tensor::Device;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;

use crate::arguments::{self, Settings, Train, Trained};
use crate::data::{self, Data, Origin};
use crate::descent::{self, Begun, Losses, Stage, Stop};
use crate::evaluation::{self, Naming as Named, Written};
use crate::files::{Teller, make_folder, refused, write_whole};
use crate::loss::Target;
use crate::network::Network;
use crate::stages::{self, Kin, Learner, Looks, Namer, Naming, Touching, mean_vector, vectors};
use crate::{Failure, model_report, onnx, pattern};

/// Learning rate of settling as a part of stage two's.
const SETTLING: f64 = 0.05;
const SETTINGS: &str = "settings.json";

/// Trains a model and writes it.
pub(crate) fn train(train: &Train) -> Result<(), Failure> {
    let settings = &train.settings;
    fits(&train.out, settings)?;
    let stop = stop_by_ctrl_c()?;
    let data = data::load(settings)?;
    spares(&train.out, &data)?;
    let run = Run::begin(&train.out, train.run.as_deref(), stop, settings, &data)?;
    let (plain, device) = (Device::flex(), Device::flex().autodiff());

    // With no weight on names stages one and two are the paper's.
    let kin = Kin::of(data.seen.iter().map(|s| s.family.as_deref())).filter(|_| settings.naming_weight > 0.0);
    let kin = kin.as_ref();
    let naming = run.stage("naming", settings.naming_steps, settings.naming_rate, 0.999);
    let namer = Namer::new(settings.preset, data.seen.len(), settings.seed, &device);
    let naming_of = Naming { batch: settings.naming_batch as usize, seed: settings.seed, kin };
    let (namer, naming_losses) = stages::name(&naming, namer, &data.seen, naming_of, &device)?;

    let namer = namer.valid();
    if let Some(part) = namer.named_rightly(&data.seen, &plain) {
        eprintln!("naming: {:.1} % of held-out images are named rightly", 100.0 * part);
    }
    let looks = Looks::of(&namer.encoder, &data.seen, (kin, settings.seed), &plain);
    let feeling = run.stage("feeling", settings.feeling_steps, settings.feeling_rate, 0.99);
    let touching = Touching::of(settings, &data);
    let learner = Learner::new(&namer.classifier, &looks, settings.seed, &device);
    let beside = (&looks, kin, settings.naming_weight);
    let (learner, feeling_losses) = stages::feel(&feeling, learner, &data.seen, beside, touching, &device)?;

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
        let stage = run.stage(name, settings.settling_steps, SETTLING * settings.feeling_rate, 0.99);
        let network = learner.feeler.network.clone().for_vectors_times(gain, &device);
        stages::settle(&stage, network, &data.seen, &both, Touching { target, ..touching }, &device)
    };
    let (settled, settling_losses) = settle("settling", settings.target)?;
    let other = settings.target.other();
    let (settled_other, other_losses) = settle("settling_other", other)?;

    let about = [("settings", about(settings))];
    let write = |name: &str, bytes: &[u8]| write_whole(&train.out.join(name), bytes);
    let network = |network: &Network, target| {
        onnx::network(&network.weights(touching.scaling), target, data.reach, &about)
    };
    let head = texture.weights(looks.scale, gain);
    write("encoder.onnx", &onnx::encoder(&namer.encoder.kernels(), &head, &about))?;
    write("texture.onnx", &network(&settled, settings.target))?;
    write(&other_file(settings.target), &network(&settled_other, other))?;
    let mut materials = materials(&train.out, &data, &stored)?;
    pattern::fill(&mut materials, settings, &train.out)?;
    let path = train.out.join("materials.ron");
    let library = Library::new(&path, Some("encoder.onnx".to_owned()), materials);
    write_whole(&path, library.to_ron().as_bytes())?;
    let losses = [
        ("naming", naming_losses),
        ("feeling", feeling_losses),
        ("settling", settling_losses),
        ("settling_other", other_losses),
    ];
    run.finish(&train.out, settings, &losses.map(|(name, losses)| (name.to_owned(), losses)), &data)
}

/// Retrains the tick network of a model from its encoder's vectors, and writes its model report.
pub(crate) fn network(asked: &arguments::Network) -> Result<(), Failure> {
    let Trained { folder, run, data } = &asked.model;
    let settings = settings_of(folder)?;
    let encoder = Encoder::load(folder.join("encoder.onnx"))?;
    let library = Library::read(folder.join("materials.ron"))?;
    let mut losses = losses_of(&folder.join("losses.csv"))?;
    let stop = stop_by_ctrl_c()?;
    let data = data_of(folder, &settings, data.as_ref())?;
    let stored: Vec<[f32; VECTOR_LEN]> =
        trained(&library, &data)?.materials().iter().map(|m| *m.vector).collect();
    let run = Run::begin(folder, run.as_deref(), stop, &settings, &data)?;
    namer_of(&run.folder, run.begun, &settings, &data)?;

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
    let learn = |network, name, steps, learning_rate, touching| {
        let stage = run.stage(name, steps, learning_rate, 0.99);
        stages::settle(&stage, network, &data.seen, &both, touching, &device)
    };
    let touching = Touching::of(&settings, &data);
    let network = Network::new(&mut Random::new(settings.seed), &device);
    // The second stage draws other touches than the first.
    let other = Touching { seed: !settings.seed, ..touching };
    let steps = asked.steps.unwrap_or(settings.feeling_steps);
    let (network, first) = learn(network, "network", steps, settings.feeling_rate, other)?;
    let slow = SETTLING * settings.feeling_rate;
    let (network, second) = learn(network, "network_settling", settings.settling_steps, slow, touching)?;

    let settings = Settings { network_steps: Some(steps), ..settings };
    let about = [("settings", about(&settings))];
    let weights = network.weights(touching.scaling);
    let bytes = onnx::network(&weights, settings.target, data.reach, &about);
    write_whole(&folder.join("texture.onnx"), &bytes)?;
    losses.retain(|(name, _)| !["settling", "network", "network_settling"].contains(&name.as_str()));
    losses.extend([("network".to_owned(), first), ("network_settling".to_owned(), second)]);
    eprintln!(
        "patterns go with the network before: `asperity-train pattern {}` finds them anew",
        folder.display()
    );
    run.finish(folder, &settings, &losses, &data)
}

/// A run: its folder of checkpoints, where nobody else can train meanwhile.
struct Run {
    folder: PathBuf,
    begun: Begun,
    stop: Arc<Stop>,
    _lock: File,
}

impl Run {
    fn begin(
        out: &Path,
        run: Option<&Path>,
        stop: Arc<Stop>,
        settings: &Settings,
        data: &Data,
    ) -> Result<Self, Diagnostic> {
        let folder = run_folder(out, run);
        make_folder(out)?;
        make_folder(&folder)?;
        let path = folder.join("lock");
        let lock = File::create(&path)
            .map_err(|e| Diagnostic::new(format!("cannot write this file: {e}")).in_file(&path))?;
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            let help = "wait until it is done, or name another --run folder";
            return Err(refused(&folder, "another training is going on here", help));
        }
        Ok(Self { folder, begun: begun(settings, data), stop, _lock: lock })
    }

    fn stage(&self, name: &'static str, steps: u32, learning_rate: f64, second_decay: f32) -> Stage<'_> {
        let (steps, folder, begun) = (steps as usize, &self.folder, self.begun);
        Stage { name, steps, learning_rate, second_decay, folder, begun, stop: &self.stop }
    }

    /// Writes how a model was trained, and its model report.
    fn finish(
        self,
        out: &Path,
        settings: &Settings,
        losses: &[(String, Losses)],
        data: &Data,
    ) -> Result<(), Failure> {
        let json = serde_json::to_string_pretty(settings).unwrap_or_default();
        write_whole(&out.join(SETTINGS), json.as_bytes())?;
        write_whole(&out.join("losses.csv"), csv(losses).as_bytes())?;
        write_whole(&out.join("curves.svg"), curves(losses).to_svg().as_bytes())?;
        eprintln!("wrote {}", out.display());
        if self.stop.wanted() {
            return Err(Failure::Stopped);
        }
        judge(out, &self.folder, self.begun, settings, data)
    }
}

/// The folder of checkpoints: beside a model's, unless it is named.
fn run_folder(out: &Path, run: Option<&Path>) -> PathBuf {
    if let Some(run) = run {
        return run.to_owned();
    }
    // `.` and `..` have no file name.
    let whole = if out.file_name().is_none() { out.canonicalize().ok() } else { None };
    let out = whole.as_deref().unwrap_or(out);
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    out.with_file_name(name)
}

/// Checksums of a run's settings, apart from later changes to the model, and of its data.
fn begun(settings: &Settings, data: &Data) -> Begun {
    let settings = serde_json::to_vec(&Settings { network_steps: None, ..settings.clone() });
    Begun { settings: crc32fast::hash(&settings.unwrap_or_default()), data: data.checksum() }
}

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

/// Vectors of images \[subject\]\[n, 256\], each list followed by equally many copies of the stored
/// vector.
fn with_stored(vectors: &[Vec<f32>], stored: &[[f32; VECTOR_LEN]]) -> Vec<Vec<f32>> {
    let all = vectors.iter().zip(stored);
    all.map(|(images, mean)| [images.clone(), mean.repeat(images.len() / VECTOR_LEN)].concat()).collect()
}

pub(crate) fn settings_of(folder: &Path) -> Result<Settings, Diagnostic> {
    let path = folder.join(SETTINGS);
    serde_json::from_str(Source::read(&path)?.text())
        .map_err(|e| Diagnostic::new(format!("these are not a run's settings: {e}")).in_file(&path))
}

/// Settings of a model with the present place of its data.
pub(crate) fn settings_now(
    folder: &Path,
    settings: &Settings,
    now: Option<&Origin>,
) -> Result<Settings, Diagnostic> {
    let data = now.unwrap_or(&settings.data);
    if data.name() != settings.data.name() {
        let message = format!("this model was trained on `{}` data", settings.data.name());
        return Err(Diagnostic::new(message).in_file(folder.join(SETTINGS)));
    }
    Ok(Settings { data: data.clone(), ..settings.clone() })
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
pub(crate) fn evaluate(Trained { folder, run, data }: &Trained) -> Result<(), Failure> {
    let settings = settings_of(folder)?;
    if let Some(run) = run.as_ref().filter(|run| !run.is_dir()) {
        return Err(refused(run, "there is no such folder", "--run names it").into());
    }
    let data = data_of(folder, &settings, data.as_ref())?;
    judge(folder, &run_folder(folder, run.as_deref()), begun(&settings, &data), &settings, &data)
}

fn namer_of(run: &Path, begun: Begun, settings: &Settings, data: &Data) -> Result<Option<Namer>, Failure> {
    let namer = Namer::new(settings.preset, data.seen.len(), settings.seed, &Device::flex());
    descent::of_checkpoint(&run.join("naming.checkpoint"), begun, settings.naming_steps as usize, namer)
}

fn other_file(target: Target) -> String {
    format!("texture_{}.onnx", target.other().name())
}

fn judge(folder: &Path, run: &Path, begun: Begun, settings: &Settings, data: &Data) -> Result<(), Failure> {
    let path = |name: &str| folder.join(name);
    let other = path(&other_file(settings.target));
    let written = Written {
        encoder: Encoder::load(path("encoder.onnx"))?,
        network: Model::load(path("texture.onnx"))?,
        other: other.exists().then(|| Model::load(&other)).transpose()?,
        namer: namer_of(run, begun, settings, data)?,
        library: trained(&Library::read(path("materials.ron"))?, data)?,
        named: named_earlier(&path("evaluation.json")),
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
    write_whole(&path("evaluation.json"), json.as_bytes())?;
    let megabytes = ["encoder.onnx", "texture.onnx"]
        .map(|name| std::fs::metadata(path(name)).map_or(0.0, |m| m.len() as f64 * 1e-6));
    let report = model_report::write(settings, megabytes, data, &evaluation);
    write_whole(&path("MODEL_CARD.md"), report.as_bytes())?;
    eprintln!("wrote {}", path("MODEL_CARD.md").display());
    Ok(())
}

/// Naming of an earlier evaluation, if there was one.
fn named_earlier(path: &Path) -> Option<Named> {
    let mut earlier: serde_json::Value = serde_json::from_str(Source::read(path).ok()?.text()).ok()?;
    serde_json::from_value(earlier.get_mut("naming")?.take()).ok()
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
    make_folder(&folder.join("pictures"))?;
    let mut taken = HashSet::new();
    let mut picture = |subject: &Subject| -> Result<Vec<String>, Failure> {
        let images = &subject.images;
        let Some(image) = images.held.first().or(images.train.first()) else { return Ok(Vec::new()) };
        let name = format!("pictures/{}.jpg", file_name(&subject.name, &mut taken));
        write_whole(&folder.join(&name), &jpeg(image)?)?;
        Ok(vec![name])
    };
    let mut materials = Vec::new();
    for (subject, vector) in data.seen.iter().zip(vectors) {
        materials.push(LibraryMaterial {
            name: subject.name.clone(),
            description: subject.description.clone(),
            family: subject.family.clone(),
            images: picture(subject)?,
            image_mm: subject.image_mm,
            pattern: Pattern::default(),
            vector: Box::new(*vector),
        });
    }
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
    let mut text = "stage,step,loss\n".to_owned();
    for (name, losses) in stages {
        text.extend(losses.iter().map(|(step, loss)| format!("{name},{step},{loss}\n")));
    }
    text
}

/// The loss of each stage over its steps, logarithmic where all are above 0.
fn curves(stages: &[(String, Losses)]) -> Chart {
    let plot = |(name, losses): &(String, Losses)| Plot {
        heading: (
            name.clone(),
            losses.last().map(|(_, loss)| format!("{loss:.4} at last")).unwrap_or_default(),
        ),
        x_name: "Step".into(),
        y: Scale { logarithmic: losses.iter().all(|(_, loss)| *loss > 0.0), range: None },
        traces: vec![Trace {
            lines: vec![losses.iter().map(|(step, loss)| (*step as f64, *loss)).collect()],
            ..Trace::default()
        }],
        ..Plot::default()
    };
    Chart {
        title: "Training".to_owned(),
        subtitle: "mean loss since the last report, by step".to_owned(),
        columns: stages.len(),
        size: [300.0, 240.0],
        plots: stages.iter().map(plot).collect(),
        aside: Vec::new(),
    }
}

fn fits(out: &Path, settings: &Settings) -> Result<(), Diagnostic> {
    let alike = |found: Settings| Settings { network_steps: settings.network_steps, ..found } == *settings;
    if !out.join(SETTINGS).exists() || settings_of(out).is_ok_and(alike) {
        return Ok(());
    }
    let help = "name another --out folder, or remove this one";
    Err(refused(&out.join(SETTINGS), "a model with other settings lies here", help))
}

/// Refuses to overwrite a library with later additions.
fn spares(out: &Path, data: &Data) -> Result<(), Diagnostic> {
    let path = out.join("materials.ron");
    if !path.exists() {
        return Ok(());
    }
    let library = Library::read(&path)?;
    if let Some(added) = library.materials().iter().find(|m| data.seen.iter().all(|s| s.name != m.name)) {
        let what = format!("`{}` was added to this library, and would be lost", added.name);
        return Err(refused(&path, &what, "name another --out folder, or move this file away"));
    }
    Ok(())
}
