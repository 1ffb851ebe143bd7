//! The figures of a running graph in a terminal: condition, timing, nodes, scopes and parameters.
//!
//! [`Terminal`] takes over the terminal, draws [`View`]s and turns keys into requests. It never waits for a
//! slow terminal: it skips a frame while the one before is still being written.
//!
//! Colours are the terminal's own sixteen on its own background; nothing depends on colour alone. Peaks,
//! faults and losses stay for two seconds. Figures of nodes change four times a second. Control characters
//! in names from files are not sent to the terminal.

mod board;
mod draw;
mod keys;
mod recent;
mod screen;
mod text;

use std::io;
use std::sync::mpsc::TryRecvError;
use std::time::Instant;

use asperity_live::RunControl;
use asperity_live::view::{By, Layout, View};
use ratatui::crossterm::event::Event;

use board::Board;
use keys::{KEYS, Keyboard, TERMINAL};
use screen::Screen;

/// A terminal that shows a running graph. It is restored on drop, and when a panic ends the program.
pub struct Terminal {
    board: Board,
    screen: Screen,
    run_control: RunControl,
    keyboard: Keyboard,
    start: Instant,
}

impl Terminal {
    /// Takes over the terminal of standard output: raw mode, so that Ctrl-C is an ordinary key, and the
    /// alternate screen, so that the former contents come back.
    ///
    /// The keys act on `run_control`. Those that stop and mute act as soon as they are read, also between
    /// frames.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::Unsupported`] where standard output is no terminal,
    /// [`io::ErrorKind::AlreadyExists`] while there is another `Terminal`, else the error of the system.
    pub fn open(run_control: RunControl) -> io::Result<Self> {
        let screen = Screen::open()?;
        let keyboard = Keyboard::start(run_control.clone())?;
        Ok(Self { board: Board::default(), screen, run_control, keyboard, start: Instant::now() })
    }

    /// Shows another graph, or the same one with other values or materials.
    pub fn layout(&mut self, layout: &Layout) {
        self.board.lay_out(layout);
    }

    /// Reads the pressed keys, sends their requests and draws `view`. Call it 20 to 60 times a second.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::BrokenPipe`] when the terminal is gone, else the error of the system.
    pub fn draw(&mut self, view: &View) -> io::Result<()> {
        let time = self.start.elapsed();
        self.board.take(view, time);
        for _ in 0..KEYS {
            match self.keyboard.events.try_recv() {
                Ok(Event::Key(key)) if self.board.press(key) => self.screen.redraw(),
                Ok(_) => {}
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Err(io::ErrorKind::BrokenPipe.into()),
            }
        }
        for request in std::mem::take(&mut self.board.requests) {
            if let Err(unheard) = self.run_control.ask(request, &By::name(TERMINAL)) {
                self.note(&unheard.to_string());
            }
        }
        self.screen.said().iter().for_each(|panic| self.note(panic));
        let board = &mut self.board;
        self.screen.frame(|buffer| board.draw(buffer, time))
    }

    /// Shows a notice at the bottom, with the time of the graph: a lost device, a file that was reloaded.
    pub fn note(&mut self, text: &str) {
        self.board.note(text);
    }
}
