//! The screens of a study in a browser: a whole session by keys alone, and what is shown to whom.

use std::io::Write as _;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use asperity_diagnostics::Source;
use asperity_page::{Options, Screen, Who, screen};
use asperity_study::log::Event;
use asperity_study::{Answer, Conduct, Experiment, Press};
use harness::alone::real_time;
use harness::chromium::{Chromium, Look};
use harness::live::{Background, until};
use serde_json::json;

/// Every kind of question; real samples, a reference, breaks, instructions and a survey.
const STUDY: &str = r#"Experiment(version: 1, title: "Hidden title", participants: 2,
    factors: {"texture": ["oakwood"]},
    stimuli: {
        "Network": graph(file: "net.ron"),
        "Genuine": real(mount: "{texture}"),
        "Nothing": silence,
        "Emptiness": silence,
    },
    words: {"language": "de", "next": "Weiter", "right": "Rechts", "lost": "Keine Verbindung."},
    parts: [
        (name: "warmup", instructions: "Fühlen Sie.", over: ["texture"], show: ["Genuine"], sides: right),
        (name: "likeness", over: ["texture"], show: [("Network", "Genuine")], reference: "Genuine",
         repeats: 2, break_every: 1, ask: [
            scale(name: "like", text: "Wie ähnlich?", from: 1, to: 7, low: "gar nicht", high: "sehr"),
            which(name: "closer", text: "Was ist näher?"),
            same(name: "same", text: "Gleich?"),
        ]),
        (name: "worth", show: [("Network", "Nothing", "Emptiness")], sides: fixed, ask: [
            sliders(name: "good", text: "Wie gut?", low: "schlecht", high: "gut"),
            text(name: "why", text: "Warum?"),
        ]),
    ],
    survey: [scale(name: "hard", text: "Wie schwer?", from: 0, to: 10, low: "leicht", high: "schwer")],
)"#;
/// Names that the participant must not see.
const HIDDEN: [&str; 11] = [
    "Network",
    "Genuine",
    "Nothing",
    "Emptiness",
    "oakwood",
    "Hidden",
    "warmup",
    "likeness",
    "worth",
    "net.ron",
    "closer",
];

/// A session whose host does what people press.
pub(crate) struct Stage {
    pub(crate) participant: Arc<Screen>,
    pub(crate) experimenter: Arc<Screen>,
    log: Arc<Mutex<Vec<Event>>>,
    _host: Background,
}

impl Stage {
    fn new() -> Self {
        Self::of(STUDY, false)
    }

    /// `has_pad` puts the pad of `--hand page` on the participant's screen.
    pub(crate) fn of(study: &'static str, has_pad: bool) -> Self {
        let open = |who| Arc::new(screen(Options::default(), who, None).expect("it serves"));
        let (participant, experimenter) = (open(Who::Participant), open(Who::Experimenter));
        let log = Arc::new(Mutex::new(Vec::new()));
        let (ours, theirs, events) = (participant.clone(), experimenter.clone(), log.clone());
        let host = Background::new(move |stop| {
            let study = Experiment::parse(&Source::new("study.ron", study)).expect("a study");
            let mut conduct = Conduct::new(&study, 1, &[], 7).expect("a session");
            let began = Instant::now();
            let mut muted = false;
            while !stop.load(Relaxed) {
                for pressed in [ours.pressed(), theirs.pressed()].into_iter().flatten() {
                    let press = pressed.press["press"].as_str().unwrap_or_default();
                    if press.ends_with("mute") {
                        muted = press == "mute";
                        pressed.answer(Ok(()));
                        continue;
                    }
                    let press: Press = serde_json::from_value(pressed.press.clone()).expect("a press");
                    let done = conduct.press(press, began.elapsed().as_secs_f64());
                    let verdict = done.map(|new| events.lock().expect("a log").extend(new));
                    ours.show(with_pad(conduct.participant(), has_pad));
                    pressed.answer(verdict.map_err(|why| why.0));
                }
                ours.show(with_pad(conduct.participant(), has_pad));
                let mut screen = conduct.experimenter();
                screen["live"] = json!({
                    "position_mm": [began.elapsed().as_secs_f64(), 0.0, -1.0], "drive": 0.4, "muted": muted,
                });
                theirs.show(screen);
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        Self { participant, experimenter, log, _host: host }
    }

    fn logged(&self) -> Vec<Event> {
        self.log.lock().expect("a log").clone()
    }
}

fn with_pad(mut screen: serde_json::Value, has_pad: bool) -> serde_json::Value {
    screen["pad"] = has_pad.into();
    screen
}

pub(crate) fn state(browser: &mut Chromium) -> String {
    browser.eval("document.body.dataset.state").as_str().expect("a state").to_owned()
}

/// Waits until the participant's page takes presses, or has nothing to press.
pub(crate) fn settled(browser: &mut Chromium) {
    browser.until(
        "!!document.body?.dataset.state && !document.querySelector('#fields').disabled && \
         (document.querySelector('#go').hidden || !document.querySelector('#go').disabled)",
    );
}

pub(crate) fn types(browser: &mut Chromium, keys: &str) {
    for key in keys.chars() {
        match key {
            '\t' => browser.key("Tab", "Tab"),
            ' ' => browser.key(" ", "Space"),
            digit @ '0'..='9' => browser.key(&digit.to_string(), &format!("Digit{digit}")),
            letter => browser.key(&letter.to_string(), &format!("Key{}", letter.to_ascii_uppercase())),
        }
    }
}

/// Holds a page against the rules of axe, if `scripts/setup.sh tests` could install it.
fn no_fault(browser: &mut Chromium, place: &str) {
    let Ok(axe) = std::fs::read_to_string(harness::root().join("target/axe/axe.min.js")) else {
        let _ = std::io::stderr().write_all(b"SKIPPED: axe-core is not installed: `make setup-tests`\n");
        return;
    };
    browser.eval(&format!("{axe}; 0"));
    let faults = browser.eval(
        "axe.run().then(({ violations }) => violations.map(({ id, nodes }) => \
         [id, ...nodes.map(({ target, failureSummary }) => `${target}: ${failureSummary}`)].join('\\n')))",
    );
    assert_eq!(faults, json!([]), "accessibility of {place}");
}

/// Keys of the left hand that answer all questions of the screen.
pub(crate) fn answers(browser: &mut Chromium) -> String {
    let kinds = browser.eval(
        "[...document.querySelectorAll('.question')].map((box) => \
         ['scale', 'which', 'same', 'sliders', 'text'].find((kind) => box.classList.contains(kind)))",
    );
    let keys = |kind: &serde_json::Value| match kind.as_str().expect("a kind") {
        "scale" => "7",
        "which" | "same" => "2",
        "sliders" => "d\te\ta",
        _ => "wa",
    };
    let kinds = kinds.as_array().expect("kinds");
    let mut all: Vec<&str> = kinds.iter().map(keys).collect();
    // Behind the last question is the button: in a text, the space bar writes.
    if !all.is_empty() {
        all.push("");
    }
    all.join("\t")
}

#[test]
fn session_by_keys_alone_logs_every_answer() {
    let _alone = real_time();
    let (Some(mut page), Some(mut desk)) = (Chromium::start(), Chromium::start()) else { return };
    let stage = Stage::new();
    page.look(&Look { width: 1280, height: 800, dark: false });
    page.open(stage.participant.url());
    desk.open(stage.experimenter.url());
    let mut states = Vec::new();
    while states.last().is_none_or(|state| state != "end") {
        assert!(states.len() < 60, "it never ends: {states:?}");
        settled(&mut page);
        let now = state(&mut page);
        let dom = page.eval("document.documentElement.outerHTML + document.title");
        let shown = dom.as_str().expect("a page");
        assert!(HIDDEN.iter().all(|name| !shown.contains(name)), "{shown}");
        if !states.contains(&now) || now == "explore" {
            no_fault(&mut page, &now);
        }
        if now == "wait" {
            desk.until("!document.querySelector('#ready').disabled");
            types(&mut desk, "r");
            page.until("document.body.dataset.state !== 'wait'");
        } else if now != "end" {
            let keys = answers(&mut page);
            types(&mut page, &format!("{keys} "));
        }
        states.push(now);
    }
    for state in ["welcome", "instructions", "break", "wait", "reference", "explore", "survey"] {
        assert!(states.iter().any(|shown| shown == state), "no {state}: {states:?}");
    }
    let log = stage.logged();
    let answers = |log: &[Event]| -> Vec<Answer> {
        let of = |event: &Event| match event {
            Event::Answered { answers, .. } | Event::Survey { answers } => answers.clone(),
            _ => Vec::new(),
        };
        log.iter().flat_map(of).map(|(_, answer)| answer).collect()
    };
    let all = answers(&log);
    let count = |is: fn(&Answer) -> bool| all.iter().filter(|answer| is(answer)).count();
    assert_eq!(all.len(), 2 * 3 + 2 + 1, "{all:?}");
    assert_eq!(count(|answer| *answer == Answer::Number(7)), 3);
    assert_eq!(count(|answer| *answer == Answer::Same(false)), 2);
    let numbers = [("Network", 51.0), ("Nothing", 60.0), ("Emptiness", 49.0)];
    let numbers = numbers.map(|(name, x)| (name.to_owned(), x)).into();
    assert!(all.contains(&Answer::Numbers(numbers)) && all.contains(&Answer::Text("wa".into())), "{all:?}");
    assert_eq!(log.last(), Some(&Event::End));
    assert_eq!((page.complaints(), desk.complaints()), (Vec::new(), Vec::new()));
}

#[test]
fn experimenter_pauses_marks_notes_and_mutes() {
    let _alone = real_time();
    let (Some(mut page), Some(mut desk)) = (Chromium::start(), Chromium::start()) else { return };
    let stage = Stage::new();
    page.open(stage.participant.url());
    desk.open(stage.experimenter.url());
    for (width, height, dark) in [(1280, 800, false), (800, 1280, true), (390, 844, false)] {
        desk.look(&Look { width, height, dark });
        desk.until("document.querySelector('#session').children.length > 0");
        let wide = desk.eval("document.documentElement.scrollWidth");
        assert_eq!(wide.as_u64(), Some(u64::from(width)), "it scrolls sideways");
        no_fault(&mut desk, &format!("the experimenter's screen at {width}"));
    }
    // Welcome, instructions, wait.
    for _ in 0..2 {
        settled(&mut page);
        types(&mut page, " ");
    }
    desk.until("document.querySelector('#mounts').textContent === 'Rechtsoakwood'");
    types(&mut desk, "p");
    page.until("document.body.dataset.state === 'paused'");
    desk.until("document.querySelector('#pause').textContent.includes('Resume')");
    types(&mut desk, "p");
    page.until("document.body.dataset.state === 'wait'");
    desk.until("document.querySelector('#pause').textContent.includes('Pause')");
    desk.eval("document.querySelector('#why').focus()");
    types(&mut desk, "rmp");
    desk.eval("document.querySelector('#mark').requestSubmit()");
    until("the mark", || {
        stage.logged().iter().any(|event| matches!(event, Event::Marked { why, .. } if why == "rmp"))
    });
    desk.until("document.querySelector('#why').value === ''");
    desk.eval("document.querySelector('#remark').focus()");
    types(&mut desk, "loud");
    desk.eval("document.querySelector('#note').requestSubmit()");
    until("the note", || {
        stage.logged().iter().any(|event| matches!(event, Event::Note { text, .. } if text == "loud"))
    });
    desk.eval("document.activeElement.blur()");
    types(&mut desk, "m");
    desk.until("document.querySelector('#mute').ariaPressed === 'true'");
    types(&mut desk, "m");
    desk.until("document.querySelector('#mute').ariaPressed === 'false'");
    assert_eq!((page.complaints(), desk.complaints()), (Vec::new(), Vec::new()));
}

#[test]
fn lost_host_is_told_and_answers_stay_on_the_page() {
    let _alone = real_time();
    let Some(mut page) = Chromium::start() else { return };
    let words = json!({
        "next": "Next", "same": "Same", "different": "Different", "lost": "Lost.", "space": "space bar",
        "language": "en", "choose": "Choose.", "pad": "Stroke.",
    });
    let question = json!({ "kind": "scale", "text": "How?", "from": 1, "to": 7, "low": "a", "high": "b" });
    let shown = json!({
        "state": "explore", "text": "Explore", "token": "1", "questions": [question], "places": ["Left"],
        "sign": true, "trial": "1 of 2", "words": words, "buttons": [], "chosen": 0, "sides": true,
    });
    let options = Options { token: Some("same".into()), ..Options::default() };
    let first = screen(options.clone(), Who::Participant, None).expect("it serves");
    first.show(shown.clone());
    page.open(first.url());
    settled(&mut page);
    types(&mut page, "5");
    let port = first.url()["http://127.0.0.1:".len()..].split_once('/').expect("a port").0;
    let port = port.parse().expect("a port");
    drop(first);
    page.until("document.querySelector('#lost').textContent === 'Lost.'");
    let again = screen(Options { port, ..options }, Who::Participant, None).expect("it serves again");
    again.show(shown);
    page.until("document.querySelector('#lost').hidden");
    assert_eq!(page.eval("document.querySelector('.option:nth-child(5) input').checked"), true);
    types(&mut page, " ");
    let mut taken = None;
    until("the answer", || {
        taken = again.pressed();
        taken.is_some()
    });
    let pressed = taken.expect("a press");
    assert_eq!(pressed.press, json!({ "press": "answer", "token": "1", "answers": [5] }));
    pressed.answer(Err("try again".to_owned()));
    page.until("document.querySelector('#refused').textContent === 'try again'");
    settled(&mut page);
}

/// Three places and a reference beside them, as in MUSHRA.
const PLACES: &str = r#"Experiment(version: 1, title: "Hidden title", participants: 1,
    stimuli: {"Network": graph(file: "net.ron"), "Nothing": silence, "Other": graph(file: "other.ron")},
    words: {"choose": "Stift heben!", "reference": "Vorlage", "changed": "Anders!"},
    parts: [(name: "worth", show: [("Network", "Nothing", "Other")], sides: fixed, reference: "Network",
        ask: [sliders(name: "good", text: "Wie nah?", low: "fern", high: "nah"),
              which(name: "best", text: "Was ist am besten?")])],
)"#;

/// The button that is marked, and the first slider's number.
const MARKED: &str = "[...document.querySelectorAll('#buttons [aria-pressed=true]')].map((b) => \
     b.firstChild.textContent).join() + document.querySelector('.slider output')?.textContent";

#[test]
fn chosen_place_is_marked_and_answers_stay() {
    let _alone = real_time();
    let Some(mut page) = Chromium::start() else { return };
    let stage = Stage::of(PLACES, false);
    page.open(stage.participant.url());
    for _ in 0..2 {
        settled(&mut page);
        assert!(page.eval("document.querySelector('#feel').hidden").as_bool().expect("a flag"));
        types(&mut page, " ");
    }
    page.until("!document.querySelector('#feel').hidden");
    settled(&mut page);
    for (width, height, dark) in [(1280, 800, false), (800, 1280, true), (390, 844, false)] {
        page.look(&Look { width, height, dark });
        let wide = page.eval("document.documentElement.scrollWidth");
        assert_eq!(wide.as_u64(), Some(u64::from(width)), "it scrolls sideways");
        no_fault(&mut page, &format!("places at {width}"));
    }
    page.look(&Look { width: 1280, height: 800, dark: false });
    assert_eq!(page.eval("document.querySelector('#buttons').textContent"), "A1B2C3Vorlage4");
    assert_eq!(page.eval("document.querySelector('#choose').textContent"), "Stift heben!");
    let dom = page.eval("document.documentElement.outerHTML");
    let shown = dom.as_str().expect("a page");
    assert!(!["Network", "Nothing", "Other", "net.ron", "worth"].iter().any(|name| shown.contains(name)));
    page.until(&format!("{MARKED} === 'A–'"));
    // Digits choose a place, and letters set the slider, all of which stay.
    types(&mut page, "e3");
    page.until(&format!("{MARKED} === 'C60'"));
    page.click("#buttons button:nth-child(4)");
    page.until(&format!("{MARKED} === 'Vorlage60'"));
    types(&mut page, "2");
    page.until(&format!("{MARKED} === 'B60'"));
    // A loaded page shows the same trial with the same place. What was not sent is gone.
    page.eval("location.reload()");
    page.until(&format!("{MARKED} === 'B–'"));
    settled(&mut page);
    types(&mut page, "e\tq\td\tc\t ");
    page.until("document.body.dataset.state === 'end'");
    let log = stage.logged();
    let answers = log.iter().find_map(|event| match event {
        Event::Answered { answers, .. } => Some(answers.clone()),
        _ => None,
    });
    let numbers = [("Network", 60.0), ("Nothing", 40.0), ("Other", 51.0)];
    let numbers = Answer::Numbers(numbers.map(|(name, x)| (name.to_owned(), x)).into());
    let best = Answer::Stimulus("Other".into());
    assert_eq!(answers, Some(vec![("good".to_owned(), numbers), ("best".to_owned(), best)]));
    assert_eq!(page.complaints(), Vec::<String>::new());
}

#[test]
fn two_experimenters_see_the_same_and_one_is_told() {
    let _alone = real_time();
    let (Some(mut one), Some(mut other)) = (Chromium::start(), Chromium::start()) else { return };
    let Some(mut page) = Chromium::start() else { return };
    let stage = Stage::new();
    page.open(stage.participant.url());
    for _ in 0..2 {
        settled(&mut page);
        types(&mut page, " ");
    }
    for desk in [&mut one, &mut other] {
        desk.open(stage.experimenter.url());
        desk.until("!document.querySelector('#ready').disabled");
    }
    let seen = "['#waits', '#mounts', '#session'].map((id) => \
                document.querySelector(id).textContent).join()";
    assert_eq!(one.eval(seen), other.eval(seen));
    // Both press before either hears of the other.
    let press = "document.querySelector('#ready').disabled = false; document.querySelector('#ready').click()";
    one.eval(press);
    page.until("document.body.dataset.state === 'explore'");
    other.eval(press);
    other.until("document.querySelector('#refused').textContent !== ''");
    assert_eq!(one.eval("document.querySelector('#refused').textContent"), "");
    let count = |of: fn(&Event) -> bool| stage.logged().iter().filter(|event| of(event)).count();
    assert_eq!(count(|event| matches!(event, Event::Shown { .. })), 1);
    other.eval("document.querySelector('#remark').value = 'loud'");
    other.eval("document.querySelector('#note').requestSubmit()");
    other.until("document.querySelector('#remark').value === ''");
    assert_eq!(count(|event| matches!(event, Event::Note { .. })), 1);
    for desk in [&mut one, &mut other] {
        desk.until("document.querySelector('#waits').textContent.includes('explores')");
    }
    assert_eq!(one.eval(seen), other.eval(seen));
    // The refusal itself is no fault of the page, and the browser logs it.
    assert_eq!(one.complaints(), Vec::<String>::new());
}
