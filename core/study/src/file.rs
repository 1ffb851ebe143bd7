//! The experiment file.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Key, Kind, Record, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, one_of};

use crate::method::Vary;
use crate::person::Person;
use crate::question::{self, Question, QuestionKind};
use crate::test::{self, Test};

/// First word of the file.
const WORD: &str = "Experiment";
/// Most trials of a part.
const MOST_TRIALS: u64 = 10_000;

/// An experiment file: stimuli, questions and tests.
///
/// ```ron
/// Experiment(
///     version: 1,
///     title: "Oak or felt",
///     participants: 12,
///     factors: {"speed": ["slow", "fast"]},
///     stimuli: {
///         "oak": graph(file: "../texture.ron", set: {"texture.material": "oak"}),
///         "felt": graph(file: "../texture.ron", set: {"texture.material": "felt"}),
///     },
///     parts: [(
///         name: "choice",
///         over: ["speed"],
///         show: [("oak", "felt")],
///         ask: [which(name: "rougher", text: "Which side is rougher?")],
///         tests: [binomial(of: "rougher", chosen: "oak", each: ["speed"])],
///     )],
/// )
/// ```
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Text of the file.
    pub source: Arc<Source>,
    /// Name for people.
    pub title: String,
    /// Planned number of participants.
    pub participants: u32,
    /// Seed of all orders and sides.
    pub seed: u64,
    /// Things that vary over trials, such as the texture.
    pub factors: Vec<Factor>,
    /// Things that a person may feel.
    pub stimuli: Vec<Stimulus>,
    /// Parts, in their order.
    pub parts: Vec<Part>,
    /// Questions after the last part.
    pub survey: Vec<Question>,
    /// Words of the screens that the file replaces, by their English key.
    pub words: Vec<(String, String)>,
    /// Noise on other channels of the sound card.
    pub masking: Option<Masking>,
    /// Recorded stroke over which levels are matched; by default a shipped one.
    pub stroke: Option<Value>,
    /// Larger share of missed deadlines marks a trial, 0 to 1.
    pub missed: f64,
    /// Model of a person for simulations.
    pub person: Person,
    /// Whether marked trials are repeated at the end of their part.
    pub repeat_marked: bool,
}

/// Something that varies over trials.
#[derive(Clone, Debug)]
pub struct Factor {
    /// Name, written `{name}` in stimuli.
    pub name: String,
    /// Its levels, in the order of the file.
    pub levels: Vec<String>,
}

/// Something that a person may feel.
#[derive(Clone, Debug)]
pub struct Stimulus {
    /// Name of the condition. The participant's screen never has it.
    pub name: String,
    /// Its source.
    pub kind: StimulusKind,
    /// Its place in the file.
    pub place: Place,
}

/// Source of a stimulus. Texts may contain `{factor}`.
#[derive(Clone, Debug)]
pub enum StimulusKind {
    /// A graph or scene with settings, each `node.parameter` or `surface.effect.parameter`.
    Graph {
        /// Path from the experiment's folder, and its place.
        file: Value,
        /// Settings of the graph.
        set: Vec<(Key, Value)>,
    },
    /// A recorded clip: a WAV file of acceleration.
    Clip {
        /// Path from the experiment's folder, and its place.
        file: Value,
        /// Settings of the node `clip`, each `clip.parameter`.
        set: Vec<(Key, Value)>,
    },
    /// A real sample that the experimenter mounts.
    Real {
        /// Name of the sample.
        mount: Value,
    },
    /// Nothing.
    Silence,
}

/// A part of an experiment: its trials have the same questions.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name, unique in the file.
    pub name: String,
    /// Text of a screen before the part.
    pub instructions: String,
    /// Factors that vary, with their levels, as indices.
    pub over: Vec<(usize, Vec<usize>)>,
    /// Stimuli of each kind of trial, as indices.
    pub show: Vec<Vec<usize>>,
    /// A stimulus felt before the others, and beside them where sliders compare with it.
    pub reference: Option<usize>,
    /// Who stands where.
    pub sides: Sides,
    /// Order of the trials.
    pub order: Order,
    /// Trials of each kind.
    pub repeats: u32,
    /// Trials between two breaks.
    pub break_every: Option<u32>,
    /// Level of loudness that the stimuli of a trial share.
    pub level: Matching,
    /// Parameter that varies from trial to trial.
    pub vary: Option<Vary>,
    /// Questions of each trial. A training has none.
    pub ask: Vec<Question>,
    /// Estimated time of a trial in s.
    pub trial_s: f64,
    /// Tests of the answers.
    pub tests: Vec<Test>,
    /// Its place in the file.
    pub place: Place,
}

/// Places of a trial's stimuli.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// As the file lists them, from left to right.
    Fixed,
    /// Drawn for each trial. A trial with a real sample is always as the file lists it.
    Random,
    /// Each order equally often over the participant's trials of a kind, and over participants.
    Balanced,
    /// A single stimulus on the left.
    Left,
    /// A single stimulus on the right.
    Right,
}

/// Order of a part's trials.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// As the file lists them.
    Fixed,
    /// Drawn for each participant.
    Random,
    /// A row of a Latin square for each participant, balanced for the trial before (Williams 1949).
    LatinSquare,
    /// Blocks of the levels of a factor, in random order; trials within a block are in random order.
    Blocks(usize),
}

/// Level matching of stimuli over the reference stroke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matching {
    /// None.
    Off,
    /// Equal root mean square.
    Rms,
    /// Equal perceptual level.
    Perceptual,
}

/// Noise against the sound of the actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Masking {
    /// Whether it is pink, else white.
    pub is_pink: bool,
    /// Root mean square below full scale in dB.
    pub dbfs: f64,
    /// Channels of the sound card, from 1.
    pub channels: Vec<u16>,
    /// Seed of the noise; each channel has its own noise.
    pub seed: u64,
    /// Its place in the file.
    pub place: Place,
}

impl Experiment {
    /// Whether a text begins as an experiment file.
    pub fn is_meant(source: &Source) -> bool {
        ron::first_word(source) == Some(WORD)
    }

    /// Reads an experiment from a text. Files of stimuli are checked by who plays them.
    ///
    /// # Errors
    /// Invalid RON; an unknown field or name; a value out of its range.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let value = ron::parse(source)?;
        let mut record = value.record(WORD)?;
        let version = record.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the experiment format")
                .help("this program reads version 1"));
        }
        let title = words(record.required("title")?)?;
        let participants = record.required("participants")?.i64_in(1..=10_000, "people")? as u32;
        let seed = record.optional("seed").map_or(Ok(1), |v| v.i64_in(0..=i64::MAX, ""))? as u64;
        let factors = record.optional("factors").map_or(Ok(Vec::new()), factors)?;
        let stimuli = stimuli(record.required("stimuli")?, &factors)?;
        let missed = record.optional("missed").map_or(Ok(0.01), |v| v.f64_in(0.0..=1.0, ""))?;
        let repeat_marked = record.optional("repeat_marked").map_or(Ok(true), Value::bool)?;
        let masking = record.optional("masking").map(|v| masking(v, seed)).transpose()?;
        let stroke = record.optional("stroke").map(|v| templated(v, &[])).transpose()?;
        let words = record.optional("words").map_or(Ok(Vec::new()), screen_words)?;
        let person = record.optional("person").map_or(Ok(Person::default()), Person::read)?;
        let survey = list(record.optional("survey"), Question::read)?;
        let named = Named { factors: &factors, stimuli: &stimuli };
        let listed = record.required("parts")?;
        let parts = listed.list()?.iter().map(|v| part(v, named)).collect::<Result<Vec<_>, _>>()?;
        record.finish()?;
        if parts.is_empty() {
            return Err(listed
                .error("no parts")
                .help("(name: \"choice\", show: [(\"a\", \"b\")], ask: [...])"));
        }
        no_duplicates(parts.iter().map(|p| (p.name.as_str(), &p.place)))?;
        question::distinct(&survey)?;
        let source = source.clone();
        Ok(Self {
            source,
            title,
            participants,
            seed,
            factors,
            stimuli,
            parts,
            survey,
            words,
            masking,
            stroke,
            missed,
            person,
            repeat_marked,
        })
    }
}

/// Names that parts refer to.
#[derive(Clone, Copy)]
pub(crate) struct Named<'a> {
    factors: &'a [Factor],
    pub(crate) stimuli: &'a [Stimulus],
}

impl Named<'_> {
    fn factor(&self, value: &Value) -> Result<usize, Diagnostic> {
        index(value, value.text()?, "factor", self.factors.iter().map(|f| f.name.as_str()))
    }

    pub(crate) fn stimulus(&self, value: &Value) -> Result<usize, Diagnostic> {
        index(value, value.text()?, "stimulus", self.stimuli.iter().map(|s| s.name.as_str()))
    }
}

/// Index of a name in a list.
fn index<'a>(
    value: &Value,
    name: &str,
    what: &str,
    names: impl Iterator<Item = &'a str> + Clone,
) -> Result<usize, Diagnostic> {
    let unknown = || value.error(format!("unknown {what} `{name}`")).help(one_of(name, names.clone()));
    names.clone().position(|known| known == name).ok_or_else(unknown)
}

/// A text that is not blank.
pub(crate) fn words(value: &Value) -> Result<String, Diagnostic> {
    match value.text()? {
        blank if blank.trim().is_empty() => Err(value.error("an empty text")),
        text => Ok(text.to_owned()),
    }
}

pub(crate) fn list<T>(
    value: Option<&Value>,
    read: impl Fn(&Value) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    value.map_or(Ok(Vec::new()), |v| v.list()?.iter().map(read).collect())
}

pub(crate) fn no_duplicates<'a>(names: impl Iterator<Item = (&'a str, &'a Place)>) -> Result<(), Diagnostic> {
    let mut known = HashSet::new();
    for (name, place) in names {
        if !known.insert(name) {
            return Err(Diagnostic::new(format!("the name `{name}` is used twice")).at_place(place));
        }
    }
    Ok(())
}

/// The name before a value's parenthesis, or a bare word: which kind of thing it is.
pub(crate) fn variant<'v>(value: &'v Value, known: &[&str]) -> Result<&'v str, Diagnostic> {
    let found = match value.kind() {
        Kind::Record { name: Some(name), .. } | Kind::Word(name) => name.as_str(),
        _ => {
            let known: Vec<String> = known.iter().map(|word| format!("`{word}(...)`")).collect();
            return Err(value
                .error(format!("{} has no kind", value.describe()))
                .help(format!("one of {}", known.join(", "))));
        }
    };
    if known.contains(&found) {
        return Ok(found);
    }
    Err(value.error(format!("unknown kind `{found}`")).help(one_of(found, known.iter().copied())))
}

/// The fields of a variant; a bare word has none.
pub(crate) fn fields<'v>(value: &'v Value, name: &str) -> Result<Option<Record<'v>>, Diagnostic> {
    match value.kind() {
        Kind::Word(_) => Ok(None),
        _ => value.record(name).map(Some),
    }
}

fn factors(value: &Value) -> Result<Vec<Factor>, Diagnostic> {
    let mut factors = Vec::new();
    for (key, levels) in value.map()? {
        let place = Place { source: value.source().clone(), span: key.span };
        let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == ' ';
        if key.name.trim().is_empty() || !key.name.chars().all(is_word) {
            return Err(Diagnostic::new(format!("`{}` cannot name a factor", key.name))
                .at_place(&place)
                .help("letters, digits, spaces and `_`"));
        }
        let list = levels.list()?;
        if list.is_empty() {
            return Err(levels.error("a factor without levels").help("[\"first\", \"second\"]"));
        }
        let places: Vec<Place> = list.iter().map(Value::place).collect();
        let levels = list.iter().map(words).collect::<Result<Vec<_>, _>>()?;
        no_duplicates(levels.iter().map(String::as_str).zip(&places))?;
        factors.push(Factor { name: key.name.clone(), levels });
    }
    Ok(factors)
}

/// Parameters of the node `clip` that a clip may set.
const CLIP: &[&str] = &["full_scale_m_s2", "channel", "loop", "crossfade_ms", "fade_ms"];

fn stimuli(value: &Value, factors: &[Factor]) -> Result<Vec<Stimulus>, Diagnostic> {
    let mut stimuli = Vec::new();
    for (key, of) in value.map()? {
        let place = Place { source: value.source().clone(), span: key.span };
        if key.name.trim().is_empty() {
            return Err(Diagnostic::new("an empty name").at_place(&place));
        }
        let name = variant(of, &["graph", "clip", "real", "silence"])?;
        let kind = match (name, fields(of, name)?) {
            ("silence", record) => {
                record.map_or(Ok(()), Record::finish)?;
                StimulusKind::Silence
            }
            (_, None) => {
                return Err(of.error(format!("`{name}` needs fields")).help("graph(file: \"a.ron\")"));
            }
            (_, Some(mut record)) => {
                let kind = match name {
                    "real" => StimulusKind::Real { mount: templated(record.required("mount")?, factors)? },
                    "clip" => {
                        let file = templated(record.required("file")?, factors)?;
                        let setting = |name: &&str| {
                            let value = record.optional(name)?;
                            Some((Key { name: format!("clip.{name}"), span: value.span() }, value.clone()))
                        };
                        StimulusKind::Clip { file, set: CLIP.iter().filter_map(setting).collect() }
                    }
                    _ => {
                        let file = templated(record.required("file")?, factors)?;
                        let set = record.optional("set").map_or(Ok(&[][..]), Value::map)?;
                        set.iter().try_for_each(|(_, value)| known_factors(value, factors))?;
                        StimulusKind::Graph { file, set: set.to_vec() }
                    }
                };
                record.finish()?;
                kind
            }
        };
        stimuli.push(Stimulus { name: key.name.clone(), kind, place });
    }
    if stimuli.is_empty() {
        return Err(value.error("no stimuli").help("{\"oak\": graph(file: \"oak.ron\")}"));
    }
    Ok(stimuli)
}

fn templated(value: &Value, factors: &[Factor]) -> Result<Value, Diagnostic> {
    words(value)?;
    known_factors(value, factors)?;
    Ok(value.clone())
}

/// Refuses a text with `{name}` where no factor has that name.
fn known_factors(value: &Value, factors: &[Factor]) -> Result<(), Diagnostic> {
    match value.kind() {
        Kind::Text(text) => {
            for part in text.split('{').skip(1) {
                let Some((name, _)) = part.split_once('}') else {
                    return Err(value
                        .error("`{` without `}`")
                        .help("{factor} stands for a level of a factor"));
                };
                index(value, name, "factor", factors.iter().map(|f| f.name.as_str()))?;
            }
            Ok(())
        }
        Kind::List(items) => items.iter().try_for_each(|item| known_factors(item, factors)),
        Kind::Map(entries) | Kind::Record { fields: entries, .. } => {
            entries.iter().try_for_each(|(_, value)| known_factors(value, factors))
        }
        _ => Ok(()),
    }
}

fn masking(value: &Value, seed: u64) -> Result<Masking, Diagnostic> {
    let name = variant(value, &["white", "pink"])?;
    let mut record = value.record(name)?;
    let dbfs = record.required("dbfs")?.f64_in(-100.0..=-12.0, "dB")?;
    let channel = |v: &Value| v.i64_in(1..=256, "").map(|n| n as u16);
    let listed = record.required("channels")?;
    let channels = listed.list()?.iter().map(channel).collect::<Result<Vec<_>, _>>()?;
    record.finish()?;
    if channels.is_empty() {
        return Err(listed.error("no channels").help("[2, 3]"));
    }
    if let Some(twice) = (1..channels.len()).find(|i| channels[..*i].contains(&channels[*i])) {
        return Err(listed.error(format!("channel {} stands twice", channels[twice])));
    }
    Ok(Masking { is_pink: name == "pink", dbfs, channels, seed, place: value.place() })
}

/// Keys of the words that screens show.
const WORDS: &[(&str, &str)] = &[
    ("next", "Next"),
    ("wait", "Wait"),
    ("explore", "Explore"),
    ("left", "Left"),
    ("right", "Right"),
    ("reference", "Reference"),
    ("same", "The same"),
    ("different", "Different"),
    ("break", "Take a break."),
    ("welcome", "Welcome. Go on when you are ready."),
    ("survey", "Some last questions"),
    ("thanks", "Thank you. The study is over."),
    ("paused", "Paused. Please wait."),
    ("pad", "Stroke here."),
    ("choose", "Choose what you feel. Lift the pen to change it."),
    // Refusals of a press.
    ("changed", "The screen has changed. Please look again."),
    ("unanswered", "Please answer all questions."),
    ("invalid", "This does not fit the screen. Please try again."),
    ("no_sample", "Nothing waits for a sample."),
    ("no_trial", "No trial is shown."),
    ("lost", "The connection is lost. Please wait."),
    ("space", "space bar"),
    // Code of the screens' language (BCP 47), for those who have them read aloud.
    ("language", "en"),
    ("trial", "Question {number} of {count}"),
];

/// Word of the screens by its key: the file's own, or the English one.
pub(crate) fn word_of(own: &[(String, String)], key: &str) -> String {
    let own = own.iter().find(|(known, _)| known == key).map(|(_, text)| text.as_str());
    let english = || WORDS.iter().find(|(known, _)| *known == key).map_or("", |(_, text)| text);
    own.unwrap_or_else(english).to_owned()
}

fn screen_words(value: &Value) -> Result<Vec<(String, String)>, Diagnostic> {
    let mut found = Vec::new();
    for (key, text) in value.map()? {
        let place = Place { source: value.source().clone(), span: key.span };
        if !WORDS.iter().any(|(known, _)| *known == key.name) {
            return Err(Diagnostic::new(format!("the screens have no word `{}`", key.name))
                .at_place(&place)
                .help(one_of(&key.name, WORDS.iter().map(|(known, _)| *known))));
        }
        found.push((key.name.clone(), words(text)?));
    }
    for pair in [["left", "right"], ["same", "different"]] {
        let [one, other] = pair.map(|key| word_of(&found, key));
        if one == other {
            let what = format!("`{}` and `{}` have the same word: \"{one}\"", pair[0], pair[1]);
            return Err(value.error(what).help("give each answer a word of its own"));
        }
    }
    Ok(found)
}

fn part(value: &Value, named: Named<'_>) -> Result<Part, Diagnostic> {
    let mut record = value.record("Part")?;
    let name = words(record.required("name")?)?;
    let instructions = record.optional("instructions").map_or(Ok(String::new()), words)?;
    let over = record.optional("over").map_or(Ok(Vec::new()), |v| over(v, named))?;
    let shown = record.required("show")?;
    let show = show(shown, named)?;
    let reference = record.optional("reference").map(|v| named.stimulus(v)).transpose()?;
    let most = show.iter().map(Vec::len).max().unwrap_or(0);
    let placed = record.optional("sides");
    let sides =
        placed.map_or(Ok("balanced"), |v| v.choice(&["fixed", "random", "balanced", "left", "right"]))?;
    let sides = match sides {
        "fixed" => Sides::Fixed,
        "random" => Sides::Random,
        "left" => Sides::Left,
        "right" => Sides::Right,
        _ => Sides::Balanced,
    };
    if let Some(placed) = placed.filter(|_| matches!(sides, Sides::Left | Sides::Right) && most > 1) {
        return Err(placed
            .error(format!("one side for {most} stimuli"))
            .help("`balanced`, `random` or `fixed`; `left` and `right` are for a single stimulus"));
    }
    let order = record.optional("order").map_or(Ok(Order::Random), |v| order(v, named, &over))?;
    let count = |v: &Value| v.i64_in(1..=1000, "").map(|n| n as u32);
    let repeats = record.optional("repeats").map_or(Ok(1), count)?;
    let break_every = record.optional("break_every").map(count).transpose()?;
    let matched = record.optional("level");
    let level = match matched.map_or(Ok("off"), |v| v.choice(&["off", "rms", "perceptual"]))? {
        "rms" => Matching::Rms,
        "perceptual" => Matching::Perceptual,
        _ => Matching::Off,
    };
    let listed = record.optional("ask");
    let ask = list(listed, Question::read)?;
    let chooses = ask.iter().any(|q| q.kind == QuestionKind::Which);
    // With a reference, one of the choices is right.
    let chance = if reference.is_some() && chooses { 1.0 / most.max(1) as f64 } else { 0.0 };
    let vary = record.optional("vary").map(|v| Vary::read(v, named, chance)).transpose()?;
    if let Some(matched) = matched.filter(|_| level != Matching::Off)
        && most + usize::from(reference.is_some()) < 2
        && vary.is_none()
    {
        return Err(matched.error("a trial of this part has one stimulus: there is no level to match"));
    }
    let trial_s = record.optional("trial_s").map_or(Ok(20.0), |v| v.f64_in(0.1..=3600.0, "s"))?;
    let tested = record.optional("tests");
    let it = Part {
        name,
        instructions,
        over,
        show,
        reference,
        sides,
        order,
        repeats,
        break_every,
        level,
        vary,
        ask,
        trial_s,
        tests: Vec::new(),
        place: value.place(),
    };
    let conditions =
        it.over.iter().map(|(_, levels)| levels.len() as u64).product::<u64>() * it.show.len() as u64;
    let trials = conditions.saturating_mul(u64::from(it.count_of_each()));
    if trials > MOST_TRIALS {
        return Err(value.error(format!("{trials} trials in a part")).help(format!("at most {MOST_TRIALS}")));
    }
    question::distinct(&it.ask)?;
    question::fit_shown(&it, shown)?;
    if let Some(vary) = &it.vary {
        question::judges(&it, vary)?;
    }
    let tests = list(tested, |v| test::read(v, &it, named.factors, named.stimuli))?;
    record.finish()?;
    Ok(Part { tests, ..it })
}

fn over(value: &Value, named: Named<'_>) -> Result<Vec<(usize, Vec<usize>)>, Diagnostic> {
    let whole = |factor: usize| (factor, (0..named.factors[factor].levels.len()).collect());
    let found: Vec<(usize, Vec<usize>)> = match value.kind() {
        Kind::List(items) => {
            items.iter().map(|item| named.factor(item).map(whole)).collect::<Result<_, _>>()?
        }
        _ => {
            let one = |(key, levels): &(Key, Value)| {
                let names = named.factors.iter().map(|f| f.name.as_str());
                let key_value = Value::made(
                    Kind::Text(key.name.clone()),
                    &Place { source: value.source().clone(), span: key.span },
                );
                let factor = index(&key_value, &key.name, "factor", names)?;
                let known = || named.factors[factor].levels.iter().map(String::as_str);
                let level = |v: &Value| index(v, v.text()?, "level", known());
                if matches!(levels.kind(), Kind::Word(word) if word == "all") {
                    return Ok(whole(factor));
                }
                let chosen = levels.list()?.iter().map(level).collect::<Result<Vec<_>, _>>()?;
                if chosen.is_empty() {
                    return Err(levels.error("no levels").help("leave the factor out instead"));
                }
                Ok((factor, chosen))
            };
            value.map()?.iter().map(one).collect::<Result<_, _>>()?
        }
    };
    let mut seen = HashSet::new();
    if let Some((twice, _)) = found.iter().find(|(factor, _)| !seen.insert(*factor)) {
        return Err(value.error(format!("the factor `{}` stands twice", named.factors[*twice].name)));
    }
    Ok(found)
}

/// Kinds of trials: a name alone, a tuple of names, or `pairs([..])` for all pairs.
fn show(value: &Value, named: Named<'_>) -> Result<Vec<Vec<usize>>, Diagnostic> {
    let mut kinds = Vec::new();
    for item in value.list()? {
        let kind = match item.kind() {
            Kind::Text(_) => vec![named.stimulus(item)?],
            Kind::Record { name: Some(_), .. } => {
                variant(item, &["pairs"])?;
                let mut record = item.record("pairs")?;
                let of = record.required("of")?;
                let all = of.list()?.iter().map(|v| named.stimulus(v)).collect::<Result<Vec<_>, _>>()?;
                record.finish()?;
                if all.len() < 2 {
                    return Err(of.error("no pair").help("at least two stimuli"));
                }
                for (i, a) in all.iter().enumerate() {
                    kinds.extend(all[i + 1..].iter().map(|b| vec![*a, *b]));
                }
                continue;
            }
            _ => item.list()?.iter().map(|v| named.stimulus(v)).collect::<Result<Vec<_>, _>>()?,
        };
        if kind.is_empty() {
            return Err(item.error("nothing to show").help("(\"first\", \"second\")"));
        }
        kinds.push(kind);
    }
    if kinds.is_empty() {
        return Err(value.error("nothing to show").help("[(\"first\", \"second\")]"));
    }
    Ok(kinds)
}

fn order(value: &Value, named: Named<'_>, over: &[(usize, Vec<usize>)]) -> Result<Order, Diagnostic> {
    match variant(value, &["fixed", "random", "latin_square", "blocks"])? {
        "fixed" => Ok(Order::Fixed),
        "latin_square" => Ok(Order::LatinSquare),
        "blocks" => {
            let mut record = value.record("blocks")?;
            let by = record.required("by")?;
            let factor = named.factor(by)?;
            record.finish()?;
            if !over.iter().any(|(other, _)| *other == factor) {
                return Err(by.error("this factor does not vary in this part").help("name it in `over`"));
            }
            Ok(Order::Blocks(factor))
        }
        _ => Ok(Order::Random),
    }
}

impl Stimulus {
    /// Files and texts with the levels of a trial filled in. `level` gives the level of a factor.
    pub fn filled(&self, level: &dyn Fn(&str) -> Option<String>) -> StimulusKind {
        let fill = |value: &Value| filled(value, level);
        match &self.kind {
            StimulusKind::Graph { file, set } => StimulusKind::Graph {
                file: fill(file),
                set: set.iter().map(|(key, value)| (key.clone(), fill(value))).collect(),
            },
            StimulusKind::Clip { file, set } => StimulusKind::Clip { file: fill(file), set: set.clone() },
            StimulusKind::Real { mount } => StimulusKind::Real { mount: fill(mount) },
            StimulusKind::Silence => StimulusKind::Silence,
        }
    }
}

impl StimulusKind {
    /// Path of its file, if it has one.
    pub fn file(&self) -> Option<PathBuf> {
        match self {
            Self::Graph { file, .. } | Self::Clip { file, .. } => file.path().ok(),
            _ => None,
        }
    }
}

/// A value with each `{factor}` replaced.
fn filled(value: &Value, level: &dyn Fn(&str) -> Option<String>) -> Value {
    let kind = match value.kind() {
        Kind::Text(text) => {
            let mut out = String::new();
            let mut rest = text.as_str();
            while let Some((before, name, after)) = rest
                .split_once('{')
                .and_then(|(before, rest)| rest.split_once('}').map(|(name, after)| (before, name, after)))
            {
                out += before;
                match level(name) {
                    Some(level) => out += &level,
                    None => out += &format!("{{{name}}}"),
                }
                rest = after;
            }
            Kind::Text(out + rest)
        }
        Kind::List(items) => Kind::List(items.iter().map(|item| filled(item, level)).collect()),
        other => other.clone(),
    };
    Value::made(kind, &value.place())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{parse, text};

    const WHICH: &str = "which(name: \"w\", text: \"?\")";
    const CONSTANT: &str = "(stimulus: \"z\", set: \"a.b\", by: constant(levels: [1, 2], each: 3))";
    const STAIRS: &str =
        "staircase(start: 1, floor: 2, ceiling: 3, steps: multiply(by: [2]), down: 2, trials: 30)";

    /// Each mistake, a part of its message, and the text that it points at.
    #[test]
    fn mistakes_are_refused_where_they_stand() {
        let rate = "ask: [scale(name: \"r\", text: \"?\", from: 1, to: 7, low: \"a\", high: \"b\")],";
        let which = "ask: [which(name: \"w\", text: \"?\")],";
        for (fields, part, message, at) in [
            ("", "show: [\"q\"]".to_owned(), "unknown stimulus `q`", "\"q\""),
            ("", "show: []".to_owned(), "nothing to show", "[]"),
            ("", "show: [\"x\"], order: latin".to_owned(), "unknown kind `latin`", "latin"),
            ("", "show: [(\"x\", \"w\")], sides: left".to_owned(), "one side for 2 stimuli", "left"),
            ("", format!("show: [\"x\"], {which}"), "`which` needs two stimuli", WHICH),
            ("", "show: [\"x\"], over: [\"speed\"]".to_owned(), "unknown factor `speed`", "\"speed\""),
            ("factors: {\"a\": []},", "show: [\"x\"]".to_owned(), "a factor without levels", "[]"),
            ("factors: {\"a\": [\"b\", \"b\"]},", "show: [\"x\"]".to_owned(), "`b` is used twice", "\"b\""),
            ("", "show: [\"x\"], repeats: 0".to_owned(), "0 is out of range", "0"),
            ("masking: white(dbfs: 3, channels: [2]),", "show: [\"x\"]".to_owned(), "3 dB is out", "3"),
            (
                "masking: white(dbfs: -30, channels: [0]),",
                "show: [\"x\"]".to_owned(),
                "0 is out of range",
                "0",
            ),
            (
                "masking: pink(dbfs: -30, channels: [3, 2, 3]),",
                "show: [\"x\"]".to_owned(),
                "channel 3 stands twice",
                "[3, 2, 3]",
            ),
            ("", "show: [\"x\"], level: rms".to_owned(), "no level to match", "rms"),
            ("words: {\"nxt\": \"Weiter\"},", "show: [\"x\"]".to_owned(), "no word `nxt`", "\"nxt\""),
            (
                "",
                format!("show: [\"x\", \"z\"], {rate} tests: [friedman(of: \"r\")]"),
                "`show` has 2",
                "friedman(of: \"r\")",
            ),
            ("", format!("show: [\"x\"], {rate} tests: [wilcoxon(of: \"s\")]"), "no question `s`", "\"s\""),
            (
                "",
                format!("show: [(\"x\", \"w\")], {which} tests: [binomial(of: \"w\", chosen: \"z\")]"),
                "shows no stimulus `z`",
                "\"z\"",
            ),
            (
                "",
                format!("show: [(\"x\", \"w\")], {which} vary: {}", CONSTANT.replace('z', "w")),
                "no parameters",
                "\"w\"",
            ),
            (
                "",
                format!("show: [(\"x\", \"z\")], {rate} vary: {CONSTANT}"),
                "0 questions that judge it",
                CONSTANT,
            ),
            (
                "",
                format!(
                    "show: [(\"x\", \"z\")], {which} vary: (stimulus: \"z\", set: \"a.b\", by: {STAIRS})"
                ),
                "`start` is 1: use a number from 2 to 3",
                "1",
            ),
            ("words: {\"left\": \"A\", \"right\": \"A\"},", "show: [\"x\"]".to_owned(), "the same word", ""),
            ("", "show: [(\"x\", \"z\"), (\"x\", \"z\")]".to_owned(), "entry 2 of `show`", ""),
            ("", format!("show: [(\"x\", \"x\")], {which}"), "shows a stimulus twice", WHICH),
            ("", "show: [\"x\"], repeats: 1000, over: [\"n\"]".to_owned(), "20000 trials in a part", ""),
        ] {
            let factor = if part.contains("\"n\"") { "factors: {\"n\": [NAMES]}," } else { fields };
            let names: Vec<String> = (0..20).map(|n| format!("\"{n}\"")).collect();
            let error = parse(&text(&factor.replace("NAMES", &names.join(", ")), &part)).unwrap_err();
            assert!(error.to_string().contains(message), "{error}\nwanted {message}");
            let place = error.place.expect("a place");
            let pointed = &place.source.text()[place.span.start..place.span.end];
            assert!(at.is_empty() || pointed == at, "{message}: points at {pointed}");
        }
    }

    #[test]
    fn levels_are_filled_into_texts_and_lists() {
        let study = parse(&text(
            "factors: {\"a\": [\"one\", \"two\"]},",
            "over: [\"a\"], show: [\"x\"], order: fixed",
        ))
        .unwrap();
        let source = Source::new("s.ron", "[\"{a}/{b}.ron\", 3, [\"{a}\"]]");
        let value = ron::parse(&source).unwrap();
        let trial = &study.trials(1)[1];
        let found = filled(&value, &|factor| study.level(trial, factor));
        let Kind::List(items) = found.kind() else { panic!("{found:?}") };
        assert_eq!(items[0].text().unwrap(), "two/{b}.ron");
        assert_eq!(items[2].list().unwrap()[0].text().unwrap(), "two");
    }
}
