//! Shows a run: on the live page, to other programs, in the terminal, or as lines of text.

use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use asperity_graph::Schedule;
use asperity_live::RunControl;
use asperity_live::view::{By, Change, Layout, Request, View};
use asperity_page::{Feed, Map, Page, Serves, serve};
use asperity_terminal::Terminal;
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

use super::Args;
use super::hands::{Hands, pointers};
use crate::failure::{Failure, complain, wrong};

pub struct Shows {
    page: Option<(Page, Arc<Feed>)>,
    /// Answers to clients. They go out behind the figures that they change.
    answers: Vec<(By, Outcome)>,
    terminal: Option<Terminal>,
    layout: Option<Layout>,
    map: Option<Arc<Map>>,
    speaker: Speaker,
    begun: bool,
}

/// The outcome of a request.
pub enum Outcome {
    Done(Change),
    /// The request, why it was refused, and help.
    Refused(Request, String, String),
}

impl Shows {
    /// Opens page and terminal, before the engine starts, whose panic hook must be the outer one.
    pub fn open(args: &Args, run_control: &RunControl, hands: &mut Hands) -> Result<Self, Failure> {
        let pointer = hands.take_pointer();
        let speaker = Speaker::new(args.quiet || args.tui);
        let (page, terminal, layout, map, answers) = (None, None, None, None, Vec::new());
        let mut it = Self { page, answers, terminal, layout, map, speaker, begun: false };
        if let Some(port) = port(args)? {
            let feed = Arc::new(Feed::new());
            let serves = match (args.page, args.control) {
                (Some(_), Some(_)) => Serves::Both,
                (None, _) => Serves::Control,
                (_, None) => Serves::Page,
            };
            let options = asperity_page::Options { port, bind: args.bind, token: None, serves };
            let at = args.bind.map(|at| format!("{at}, ")).unwrap_or_default();
            let what = if args.page.is_some() { "page" } else { "control" };
            let cannot = |e| Failure::Machine(format!("cannot serve the {what} at {at}port {port}: {e}"));
            let page = serve(options, feed.clone(), run_control.clone(), pointer).map_err(cannot)?;
            it.page = Some((page, feed));
        }
        if args.tui {
            let terminal = Terminal::open(run_control.clone());
            let cannot = |e| Failure::Machine(format!("cannot draw in the terminal: {e}"));
            it.terminal = Some(terminal.map_err(cannot)?);
        }
        let urls = it.page.as_ref().map(|(page, _)| page.urls().to_vec()).unwrap_or_default();
        if args.page.is_some() {
            urls.iter().for_each(|url| it.say(&format!("the page: {url}")));
        }
        if args.control.is_some() {
            for url in &urls {
                let url = url.replacen("http:", "ws:", 1).replacen("/?", "/control?", 1);
                it.say(&format!("control by WebSocket: {url}"));
            }
            let osc =
                it.page.as_ref().and_then(|(page, _)| Some((page.osc()?.port(), page.token().to_owned())));
            if let Some((port, token)) = osc {
                it.say(&format!("control by OSC: UDP port {port}, /asperity/hello {token}"));
            }
        }
        if let Some(url) = urls.first().filter(|_| args.bind.is_some_and(|at| !at.is_loopback())) {
            if !args.tui && args.page.is_some() {
                it.say(&qr(url, std::io::stderr().is_terminal()));
            }
            let what = if args.page.is_some() { "the page" } else { "the program" };
            it.say(&format!(
                "warning: the connection to {what} is not encrypted, and whoever has its token can move \
                 the actuator"
            ));
        }
        Ok(it)
    }

    pub fn page(&self) -> Option<&Page> {
        self.page.as_ref().map(|(page, _)| page)
    }

    /// Answers a client, once it can see the change.
    pub fn answer(&mut self, by: By, outcome: Outcome) {
        self.answers.push((by, outcome));
    }

    pub fn say(&mut self, text: &str) {
        match &mut self.terminal {
            Some(terminal) => terminal.note(text),
            None => self.speaker.say(text),
        }
    }

    pub fn show(
        &mut self,
        view: View,
        layout: &Layout,
        schedule: &Schedule,
        hands: &mut Hands,
        map: Option<&Arc<Map>>,
    ) {
        if let Some(pointer) = hands.take_pointer() {
            match &self.page {
                Some((page, _)) => page.set_pointer(Some(pointer)),
                None => {
                    self.say("warning: there is a pointer now, and no page to move it on: start with --page")
                }
            }
        }
        if self.map.as_ref().map(Arc::as_ptr) != map.map(Arc::as_ptr) {
            self.map = map.cloned();
            if let Some((page, _)) = &self.page {
                page.set_scene(map.cloned());
            }
            self.layout = None;
        }
        if self.layout.as_ref() != Some(layout) {
            if let Some((page, feed)) = &self.page {
                if pointers(schedule).next().is_none() {
                    page.set_pointer(None);
                }
                feed.publish_layout(layout.clone());
            }
            if let Some(terminal) = &mut self.terminal {
                terminal.layout(layout);
            }
            self.layout = Some(layout.clone());
        }
        if !self.begun && !view.clock.is_empty() && (view.period_frames > 0 || view.device.is_empty()) {
            self.begun = true;
            let text = begins(&view, layout);
            self.say(&text);
        }
        if let Some(terminal) = &mut self.terminal
            && terminal.draw(&view).is_err()
        {
            // The terminal is gone.
            self.terminal = None;
        }
        let answers = std::mem::take(&mut self.answers);
        if let Some((page, feed)) = &self.page {
            feed.publish(view);
            for (by, outcome) in answers {
                match outcome {
                    Outcome::Done(change) => page.done(&by, &change),
                    Outcome::Refused(request, why, help) => page.refused(&by, &request, &why, &help),
                }
            }
        }
    }

    /// Restores the terminal and closes the page.
    pub fn close(self) {
        self.speaker.close();
    }
}

/// The port of the server for pages and other programs; `None` where none is wanted.
fn port(args: &Args) -> Result<Option<u16>, Failure> {
    match (args.page, args.control) {
        (Some(page), Some(control)) if page != control && page.min(control) > 0 => {
            let what = format!("one server is for both, and --page wants port {page}");
            Err(wrong("--control", what, "give the port once: --page 8080 --control"))
        }
        (Some(page), Some(control)) => Ok(Some(page.max(control))),
        (page, control) => Ok(page.or(control)),
    }
}

/// A QR code of half blocks. On a terminal it is black on white, whatever the terminal's own colours are.
fn qr(text: &str, coloured: bool) -> String {
    // An address is far shorter than the longest text of a QR code.
    let Ok(code) = QrCode::new(text) else { return String::new() };
    let (on, off) = if coloured { ("\x1b[38;5;16;48;5;231m", "\x1b[0m") } else { ("", "") };
    let picture = code.render::<Dense1x2>().build();
    picture.lines().map(|line| format!("{on}{line}{off}")).collect::<Vec<_>>().join("\n")
}

fn begins(view: &View, layout: &Layout) -> String {
    if view.device.is_empty() {
        return format!("runs at {} ticks/s without audio; Ctrl-C stops", layout.tick_hz);
    }
    format!(
        "plays on {}: {} Hz, {} frames at a time, {} ticks/s by the {} clock; Ctrl-C stops",
        view.device, layout.audio_hz, view.period_frames, layout.tick_hz, view.clock
    )
}

/// Lines that may wait to be written. If there are more, the newest are dropped.
const LINES: usize = 256;
/// How long the end of a run waits for the last lines.
const PATIENCE: Duration = Duration::from_millis(500);

/// Writes lines to the standard error from a thread of its own: a run never waits for their reader.
pub struct Speaker(Option<(SyncSender<String>, JoinHandle<()>)>);

impl Speaker {
    /// Starts the thread; a quiet speaker writes nothing.
    pub fn new(quiet: bool) -> Self {
        let (to, lines): (_, Receiver<String>) = sync_channel(LINES);
        let write = move || lines.iter().for_each(|line| complain(&line));
        let thread = (!quiet).then(|| std::thread::Builder::new().name("asperity-say".into()).spawn(write));
        Self(thread.and_then(Result::ok).map(|thread| (to, thread)))
    }

    pub fn say(&self, text: &str) {
        if let Some((to, _)) = &self.0 {
            let _ = to.try_send(format!("{text}\n"));
        }
    }

    /// Waits until all lines are written, for 500 ms at most.
    pub fn close(self) {
        let Some((to, thread)) = self.0 else { return };
        drop(to);
        let began = Instant::now();
        while !thread.is_finished() && began.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}
