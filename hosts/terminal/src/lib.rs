//! The figures of a running graph in a terminal: how the run stands, timing against the deadline, nodes, scopes, and
//! parameters to move.
//!
//! [`Terminal`] takes over the terminal, draws [`View`]s and turns keys into what a person asks of the run. It never waits for a slow
//! terminal: a frame that is due while the one before is still being written is left out. [`picture`] draws the same as SVG.
//!
//! A view of twelve nodes and four scopes takes the calling thread 0.11 ms at 80 x 24 and 0.41 ms at 200 x 60 to take in and lay out
//! (medians of 500 frames on a shared virtual machine; what goes to the terminal is only what changed).
//!
//! Colours are the terminal's own sixteen, on the terminal's own ground, and nothing is told by colour alone. Peaks, faults and
//! losses stay for two seconds; figures of nodes change four times a second, as fast as they are read. Names from files are shown without anything that would steer the terminal.

mod board;
mod draw;
mod held;
mod keys;
mod line;
pub mod picture;
mod screen;
mod text;
mod trace;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TryRecvError, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use asperity_live::view::{Layout, View};
use asperity_live::{Reins, Unheard};
use ratatui::crossterm::event::{self, Event};

use board::Board;
use keys::{Answer, at_once};
use screen::Screen;

/// Keys that are read before a frame; the rest waits for the next one.
const KEYS: usize = 64;

/// How long the keyboard is waited for before it is looked whether anybody still wants to know.
const WAIT: Duration = Duration::from_millis(50);

/// How long it is waited for once it is known to be there.
const LEFT: Duration = if cfg!(unix) { Duration::ZERO } else { WAIT };

/// What is typed, read by a thread of its own: reading from a terminal whose window was closed may never come back, and a key that
/// stops or mutes the run waits for no frame.
struct Typed {
    events: Receiver<Event>,
    over: Arc<AtomicBool>,
}

impl Typed {
    fn start(reins: Reins) -> io::Result<Self> {
        let (to, events) = sync_channel(KEYS);
        let over = Arc::new(AtomicBool::new(false));
        let ended = over.clone();
        let read = move || {
            while !ended.load(Relaxed) {
                let next = line::wait(WAIT)
                    .and_then(|()| event::poll(LEFT))
                    .and_then(|there| there.then(event::read).transpose());
                match next {
                    Ok(Some(Event::Key(key))) if at_once(&key, &reins) => {}
                    Ok(Some(event)) => {
                        // One too many is dropped: this thread goes on reading what stops and mutes.
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

impl Drop for Typed {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// A terminal that shows a running graph. Gives the terminal back when it is dropped, and when a panic ends the program.
pub struct Terminal {
    board: Board,
    screen: Screen,
    reins: Reins,
    typed: Typed,
    start: Instant,
}

impl Terminal {
    /// Takes over the terminal that standard output goes to: raw mode, so that Ctrl-C is a key like any other, and the alternate
    /// screen, so that what stood there comes back.
    ///
    /// The keys hold `reins`: those that stop and mute act as soon as they are read, also between two frames.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::Unsupported`] where standard output is no terminal, [`io::ErrorKind::AlreadyExists`] while there is another
    /// `Terminal`, else what the system says.
    pub fn open(reins: Reins) -> io::Result<Self> {
        let screen = Screen::open()?;
        let typed = Typed::start(reins.clone())?;
        Ok(Self { board: Board::default(), screen, reins, typed, start: Instant::now() })
    }

    /// Takes over another graph, or the same one with other values or materials.
    pub fn layout(&mut self, layout: &Layout) {
        self.board.lay_out(layout);
    }

    /// Reads the keys that were pressed, sends what they ask for, and draws `view`. To be called 20 to 60 times a second.
    ///
    /// # Errors
    ///
    /// When the terminal is gone.
    pub fn draw(&mut self, view: &View) -> io::Result<()> {
        let time = self.start.elapsed();
        self.board.take(view, time);
        self.read_keys()?;
        self.send();
        for panic in self.screen.said() {
            self.note(&panic);
        }
        let board = &mut self.board;
        self.screen.frame(|buffer| board.draw(buffer, time))
    }

    /// Shows a notice at the bottom, with the time of the graph: a device that was lost, a file that was read anew.
    pub fn note(&mut self, text: &str) {
        self.board.note(text);
    }

    fn read_keys(&mut self) -> io::Result<()> {
        for _ in 0..KEYS {
            match self.typed.events.try_recv() {
                Ok(Event::Key(key)) if self.board.press(key) == Answer::Redraw => self.screen.redraw(),
                Ok(_) => {}
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Err(io::ErrorKind::BrokenPipe.into()),
            }
        }
        Ok(())
    }

    fn send(&mut self) {
        for request in std::mem::take(&mut self.board.requests) {
            match self.reins.ask(request) {
                Ok(()) => {}
                Err(Unheard::Busy) => self.board.note("too much was asked at once; the last key did nothing"),
                Err(Unheard::Over) => self.board.note("the run takes no requests any more"),
            }
        }
    }
}
