//! Sources of data.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Mutex;

use asperity_data::{HISTORY, MAX_FORCE_N, MAX_SPEED_MM_S, Subject, hatt, made, recordings};
use asperity_diagnostics::Diagnostic;
use asperity_numbers::Random;
use serde::{Deserialize, Serialize};

use crate::Failure;
use crate::arguments::Settings;
use crate::files::Teller;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Origin {
    /// Made by physics.
    Made,
    /// The Penn Haptic Texture Toolkit's files, in a folder.
    Hatt(PathBuf),
    /// Anyone's recordings, in a folder.
    Recordings(PathBuf),
}

impl Origin {
    /// Name without the private folder.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Made => "made",
            Self::Hatt(_) => "hatt",
            Self::Recordings(_) => "recordings",
        }
    }
}

impl FromStr for Origin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "made" => Ok(Self::Made),
            Some(("hatt", folder)) if !folder.is_empty() => Ok(Self::Hatt(folder.into())),
            Some(("recordings", folder)) if !folder.is_empty() => Ok(Self::Recordings(folder.into())),
            _ => Err("made, hatt:FOLDER or recordings:FOLDER".to_owned()),
        }
    }
}

/// Trained range of touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reach {
    pub force_n: f64,
    pub speed_mm_s: f64,
}

impl Reach {
    /// Range of drawn or made strokes.
    pub(crate) const DRAWN: Self = Self { force_n: MAX_FORCE_N, speed_mm_s: MAX_SPEED_MM_S };

    /// Range of recorded touches, at least 0.1 N and 1 mm/s.
    fn of(subjects: &[Subject]) -> Self {
        let (mut force_n, mut speed_mm_s) = (0.1_f64, 1.0_f64);
        for example in subjects.iter().flat_map(|s| &s.examples.train) {
            let (vx, vy) = example.velocity.split_at(HISTORY);
            force_n = example.force.iter().fold(force_n, |most, f| most.max(f64::from(*f)));
            speed_mm_s = vx.iter().zip(vy).fold(speed_mm_s, |most, (x, y)| most.max(f64::from(x.hypot(*y))));
        }
        Self { force_n, speed_mm_s }
    }
}

/// Training and test data of a run.
pub(crate) struct Data {
    pub seen: Vec<Subject>,
    pub unseen: Vec<Subject>,
    pub reach: Reach,
}

impl Data {
    /// Checksum of all data of a run, held-out parts too. A run must not continue with other data.
    pub(crate) fn checksum(&self) -> u32 {
        let mut sum = crc32fast::Hasher::new();
        for (number, subject) in self.seen.iter().chain(&self.unseen).enumerate() {
            let Subject { name, family, images, examples, truth, .. } = subject;
            let counts = [images.train.len(), images.held.len(), examples.train.len(), examples.held.len()];
            let known = (number < self.seen.len(), name, family, truth, counts);
            sum.update(format!("{known:?}").as_bytes());
            images.train.iter().chain(&images.held).for_each(|image| sum.update(&image.pixels));
            for e in examples.train.iter().chain(&examples.held) {
                let numbers =
                    e.force.iter().chain(&e.velocity).chain(&e.magnitudes).chain(e.other.iter().flatten());
                numbers.for_each(|x| sum.update(&x.to_le_bytes()));
            }
        }
        sum.finalize()
    }
}

/// Holds out some subjects, drawn by the seed.
fn apart(mut subjects: Vec<Subject>, settings: &Settings) -> (Vec<Subject>, Vec<Subject>) {
    let mut random = Random::new(settings.seed ^ 0xa9a7);
    let count = (settings.unseen as usize).min(subjects.len().saturating_sub(1));
    let unseen = (0..count).map(|_| subjects.remove(random.below(subjects.len()))).collect();
    (subjects, unseen)
}

pub(crate) fn made_settings(settings: &Settings) -> made::Settings {
    let pieces = [settings.pieces as usize, made::Settings::default().pieces[1]];
    made::Settings { seed: settings.seed, pieces, ..made::Settings::default() }
}

/// Makes or reads the data of a run.
pub(crate) fn load(settings: &Settings) -> Result<Data, Failure> {
    let made = settings.data == Origin::Made;
    let refuse = |what: String| Err(Diagnostic::new(what).into());
    if made && settings.unseen > 0 {
        let why = "of made surfaces, two of each family are held apart";
        return refuse(format!("--unseen is for data that are read: {why}"));
    }
    if !made && settings.every > 1 {
        return refuse("--every is for made data".to_owned());
    }
    let data = from(settings)?;
    for (path, note) in data.seen.iter().chain(&data.unseen).flat_map(|s| &s.notes) {
        eprintln!("{}: {note}", path.display());
    }
    if data.seen.len() < 2 {
        return refuse("there is nothing to tell apart: fewer than two materials to train on".to_owned());
    }
    for subject in &data.seen {
        let missing = match (subject.images.train.is_empty(), subject.examples.train.is_empty()) {
            (true, _) => "no picture",
            (_, true) => "no stroke",
            _ => continue,
        };
        return refuse(format!("the material `{}` has {missing} to train on", subject.name));
    }
    Ok(data)
}

fn from(settings: &Settings) -> Result<Data, Failure> {
    match &settings.data {
        Origin::Made => {
            let surfaces = made::surfaces(settings.every as usize);
            let count = surfaces.iter().map(Vec::len).sum();
            let teller = Mutex::new(Teller::new("surfaces", count));
            let done = |done: usize| {
                if let Ok(mut teller) = teller.lock() {
                    teller.tell(done, "seen and stroked");
                }
            };
            let [seen, unseen] = made::subjects(&surfaces, &made_settings(settings), done)?;
            Ok(Data { seen, unseen, reach: Reach::DRAWN })
        }
        Origin::Hatt(folder) => {
            let settings_of = hatt::Settings { seed: settings.seed, ..hatt::Settings::default() };
            let (seen, unseen) = apart(hatt::read(folder, &settings_of)?, settings);
            Ok(Data { seen, unseen, reach: Reach::DRAWN })
        }
        Origin::Recordings(folder) => {
            let (seen, unseen) = apart(recordings::read(folder)?, settings);
            let reach = Reach::of(&seen);
            Ok(Data { seen, unseen, reach })
        }
    }
}
