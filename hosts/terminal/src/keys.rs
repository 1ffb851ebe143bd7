//! Keys: the thread that reads them, and their actions.
//!
//! Keys have a thread of their own. Reading from a terminal whose window was closed may never return, and
//! keys that stop or mute the run do not wait for a frame.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::time::Duration;

use asperity_live::RunControl;
use asperity_live::view::{By, LiveLayout, Request};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::board::{Board, Tab};

/// Most keys that wait for a frame.
pub(crate) const KEYS: usize = 64;
/// Longest wait for a key, before the thread looks whether it is still needed.
const WAIT: Duration = Duration::from_millis(50);
/// Longest wait for a key that [`wait`] has seen.
const SEEN: Duration = if cfg!(unix) { Duration::ZERO } else { WAIT };

/// Who asks for changes, as reports name it.
pub(crate) const TERMINAL: &str = "terminal";

/// Keys read by a thread of its own; the thread ends after a drop.
pub(crate) struct Keyboard {
    /// Events for the next frame. Disconnected when the terminal is gone.
    pub(crate) events: Receiver<Event>,
    over: Arc<AtomicBool>,
}

impl Keyboard {
    /// Starts the thread. Keys that stop or mute act on `run_control` at once.
    pub(crate) fn start(run_control: RunControl) -> io::Result<Self> {
        let (to, events) = sync_channel(KEYS);
        let over = Arc::new(AtomicBool::new(false));
        let ended = over.clone();
        let read = move || {
            while !ended.load(Relaxed) {
                let seen = wait(WAIT).and_then(|()| event::poll(SEEN));
                let next = seen.and_then(|seen| seen.then(event::read).transpose());
                match next {
                    Ok(Some(Event::Key(key))) if at_once(&key, &run_control) => {}
                    Ok(Some(event)) => {
                        // A key too many is dropped: the thread goes on with those that stop and mute.
                        if let Err(TrySendError::Disconnected(_)) = to.try_send(event) {
                            break;
                        }
                    }
                    Ok(None) => {}
                    Err(_) => break,
                }
            }
        };
        std::thread::Builder::new().name("asperity-keys".into()).spawn(read)?;
        Ok(Self { events, over })
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// Waits until there may be something to read, at most `most`.
///
/// A read from a closed terminal never returns and keeps a processor busy. So the line is checked first.
///
/// # Errors
///
/// [`io::ErrorKind::BrokenPipe`] where the terminal is gone.
#[cfg(unix)]
fn wait(most: Duration) -> io::Result<()> {
    use std::io::IsTerminal as _;
    let of = |fd, events| libc::pollfd { fd, events, revents: 0 };
    // Standard output is the terminal. Keys come over standard input, or crossterm finds them.
    let mut fds = [of(libc::STDOUT_FILENO, 0), of(libc::STDIN_FILENO, libc::POLLIN)];
    let typed = io::stdin().is_terminal();
    let count = if typed { 2 } else { 1 };
    let most = if typed { most } else { most / 4 };
    // SAFETY: the first `count` of the two entries exist and outlive the call.
    let ready =
        unsafe { libc::poll(fds.as_mut_ptr(), count, i32::try_from(most.as_millis()).unwrap_or(i32::MAX)) };
    let gone = fds.iter().any(|fd| fd.revents & (libc::POLLHUP | libc::POLLERR | libc::POLLNVAL) != 0);
    if ready > 0 && gone { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
}

/// Elsewhere [`event::poll`] waits by itself.
#[cfg(not(unix))]
fn wait(_: Duration) -> io::Result<()> {
    Ok(())
}

/// Steps from one end of a range to the other.
const STEPS: f64 = 100.0;
/// A range whose ends have this ratio or more is logarithmic.
const DECADES: f64 = 100.0;

/// Keys and their actions, for the help.
pub(crate) const HELP: [(&str, &str); 10] = [
    ("q, Ctrl-C", "stop"),
    ("space, m", "mute, or play again"),
    ("up, down", "choose a parameter"),
    ("left, right", "move it; with shift by a tenth of that"),
    ("n, p", "next or previous material"),
    ("t", "another texture node"),
    ("1, 2, 3, Tab", "one pane or another, where not all fit"),
    ("PgUp, PgDn", "scroll the nodes; Home, End"),
    ("Ctrl-L", "draw everything anew"),
    ("?, h", "this help"),
];

/// Stops or mutes the run, without waiting for a frame. Returns whether it was such a key.
pub(crate) fn at_once(key: &KeyEvent, run_control: &RunControl) -> bool {
    if key.kind == KeyEventKind::Release {
        return false;
    }
    match (key.modifiers.contains(KeyModifiers::CONTROL), key.code) {
        (true, KeyCode::Char('c' | 'C')) | (false, KeyCode::Char('q' | 'Q')) => {
            let _ = run_control.ask(Request::Stop, &By::name(TERMINAL));
        }
        // A repeated key would flicker.
        (false, KeyCode::Char(' ' | 'm')) if key.kind == KeyEventKind::Repeat => {}
        (false, KeyCode::Char(' ' | 'm')) => {
            let _ = run_control.ask(Request::Mute(!run_control.muted()), &By::name(TERMINAL));
        }
        _ => return false,
    }
    true
}

impl Board {
    /// Acts on a key; requests are left in [`Board::requests`]. Answers whether the screen must be redrawn.
    pub(crate) fn press(&mut self, key: KeyEvent) -> bool {
        if key.kind == KeyEventKind::Release {
            return false;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return matches!(key.code, KeyCode::Char('l' | 'L'));
        }
        let step = if key.modifiers.contains(KeyModifiers::SHIFT) { 0.1 } else { 1.0 };
        let last = self.layout.nodes.len().saturating_sub(1);
        match key.code {
            KeyCode::Char('?' | 'h') => self.help = !self.help,
            KeyCode::Esc => self.help = false,
            KeyCode::Char('n') => self.change_material(1),
            KeyCode::Char('p') => self.change_material(-1),
            KeyCode::Char('t') => self.texture = (self.texture + 1) % self.layout.materials.len().max(1),
            KeyCode::Up => self.choose(-1),
            KeyCode::Down => self.choose(1),
            KeyCode::Left => self.move_parameter(-step),
            KeyCode::Right => self.move_parameter(step),
            KeyCode::Char('1') => self.tab = Tab::Nodes,
            KeyCode::Char('2') => self.tab = Tab::Scopes,
            KeyCode::Char('3') => self.tab = Tab::Parameters,
            KeyCode::Tab => {
                self.tab = match self.tab {
                    Tab::Nodes => Tab::Scopes,
                    Tab::Scopes => Tab::Parameters,
                    Tab::Parameters => Tab::Nodes,
                }
            }
            KeyCode::PageUp => self.scroll_to(self.scroll.saturating_sub(self.page.max(1))),
            KeyCode::PageDown => self.scroll_to((self.scroll + self.page.max(1)).min(last)),
            KeyCode::Home => self.scroll_to(0),
            KeyCode::End => self.scroll_to(last),
            _ => {}
        }
        false
    }

    fn scroll_to(&mut self, node: usize) {
        (self.scroll, self.tab) = (node, Tab::Nodes);
    }

    fn choose(&mut self, by: isize) {
        // Where the list is hidden, the first press only shows it.
        if self.tab == Tab::Parameters || self.all_seen {
            let last = self.parameters().count().saturating_sub(1);
            self.chosen = self.chosen.saturating_add_signed(by).min(last);
        }
        self.tab = Tab::Parameters;
    }

    fn move_parameter(&mut self, by: f64) {
        let mut live = self.layout.nodes.iter_mut().flat_map(|node| {
            let id = &node.id;
            node.live.iter_mut().map(move |live| (id, live))
        });
        let Some((id, live)) = live.nth(self.chosen) else { return };
        self.tab = Tab::Parameters;
        let value = moved(live, by);
        if value != live.value && value.is_finite() {
            live.value = value;
            let request = Request::Set { node: id.clone(), param: live.name.clone(), value };
            self.ask(request);
        }
    }

    fn change_material(&mut self, by: isize) {
        let Some(materials) = self.layout.materials.get_mut(self.texture) else { return };
        let many = materials.names.len();
        let at = materials.names.iter().position(|name| *name == materials.chosen);
        let next = at.map_or(0, |at| (at + many).saturating_add_signed(by) % many);
        let Some(name) = materials.names.get(next).filter(|name| **name != materials.chosen) else { return };
        materials.chosen.clone_from(name);
        let request = Request::Material { node: materials.node.clone(), name: name.clone() };
        self.ask(request);
    }

    /// Keeps a request. It replaces an older one for the same parameter: a held key asks often.
    fn ask(&mut self, request: Request) {
        self.requests.retain(|waiting| !waiting.is_of_the_same(&request));
        self.requests.push(request);
    }
}

/// Whether a range is logarithmic: positive, over two decades or more.
pub(crate) fn is_logarithmic(live: &LiveLayout) -> bool {
    let [least, most] = live.slide();
    least > 0.0 && most.is_finite() && most / least >= DECADES
}

/// Place of a value in the range of its slider, 0 to 1.
pub(crate) fn place(live: &LiveLayout) -> f64 {
    let [least, most] = live.slide();
    let place = if is_logarithmic(live) {
        (live.value / least).ln() / (most / least).ln()
    } else {
        (live.value - least) / (most - least)
    };
    if place.is_finite() { place.clamp(0.0, 1.0) } else { 0.0 }
}

/// The value after `by` steps, from -1 to 1; words and whole numbers move by one at least.
fn moved(live: &LiveLayout, by: f64) -> f64 {
    let [low, high] = live.slide();
    let range = high - low;
    let value = [live.value, live.least, 0.0].into_iter().find(|x| x.is_finite()).unwrap_or(0.0);
    let next = if !live.words.is_empty() {
        value.round() + by.signum()
    } else if live.whole {
        let step = if range.is_finite() { (range / STEPS * by.abs()).round().max(1.0) } else { 1.0 };
        value.round() + step * by.signum()
    } else if is_logarithmic(live) {
        value.max(low) * (high / low).powf(by / STEPS)
    } else if range.is_finite() {
        let step = range / STEPS * by;
        // On a grid from the lower end: steps up and down meet the same values.
        low + ((value + step - low) / step.abs()).round() * step.abs()
    } else {
        value + by * (value.abs() / STEPS).max(0.01)
    };
    let most = if live.words.is_empty() { live.most } else { live.words.len() as f64 - 1.0 };
    // Rounds off the errors that sums of steps collect.
    let next = format!("{next:.9e}").parse().unwrap_or(next);
    if next.is_finite() { next.max(live.least).min(most) } else { live.value }
}

#[cfg(test)]
#[path = "keys_tests.rs"]
mod tests;
