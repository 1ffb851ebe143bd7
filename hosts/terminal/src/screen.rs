//! The terminal itself: raw mode, the alternate screen, and a thread that writes.
//!
//! The drawing thread never waits for a slow terminal.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::panic;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use ratatui::backend::{Backend, ClearType, CrosstermBackend};
use ratatui::buffer::Buffer;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui::crossterm::{cursor, execute, terminal};
use ratatui::layout::Rect;

/// Longest wait for the last frame to be written.
const PATIENCE: Duration = Duration::from_millis(500);
/// Most panics of other threads that are kept.
const PANICS: usize = 16;

/// Whether the terminal is taken over, the thread that draws, and messages of panics of other threads.
static HELD: AtomicBool = AtomicBool::new(false);
static OWNER: Mutex<Option<ThreadId>> = Mutex::new(None);
static SAID: Mutex<Vec<String>> = Mutex::new(Vec::new());
static HOOK: Once = Once::new();

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The bytes of one frame, which are written as a whole.
#[derive(Clone, Default)]
struct Sheet(Arc<Mutex<Vec<u8>>>);

impl Write for Sheet {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        lock(&self.0).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[derive(Default)]
struct Pen {
    busy: AtomicBool,
    failed: AtomicBool,
}

pub(crate) struct Screen {
    backend: CrosstermBackend<Sheet>,
    sheet: Sheet,
    shown: Buffer,
    next: Buffer,
    pages: SyncSender<Vec<u8>>,
    pen: Arc<Pen>,
    said: Vec<String>,
}

impl Screen {
    pub(crate) fn open() -> io::Result<Self> {
        if !io::stdout().is_terminal() {
            let what = "standard output is no terminal, and --tui needs one";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        if HELD.swap(true, Ordering::SeqCst) {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "the terminal is drawn on already"));
        }
        Self::begin().inspect_err(|_| restore())
    }

    fn begin() -> io::Result<Self> {
        *lock(&OWNER) = Some(thread::current().id());
        HOOK.call_once(install_hook);
        let mut out = output()?;
        enter(&mut out)?;
        let pen = Arc::new(Pen::default());
        let (pages, written) = sync_channel::<Vec<u8>>(1);
        let thread_pen = Arc::clone(&pen);
        thread::Builder::new().name("terminal".into()).spawn(move || {
            for page in written {
                if out.write_all(&page).is_err() {
                    thread_pen.failed.store(true, Ordering::SeqCst);
                }
                thread_pen.busy.store(false, Ordering::SeqCst);
            }
        })?;
        let sheet = Sheet::default();
        let (shown, next) = (Buffer::default(), Buffer::default());
        Ok(Self {
            backend: CrosstermBackend::new(sheet.clone()),
            sheet,
            shown,
            next,
            pages,
            pen,
            said: Vec::new(),
        })
    }

    /// Draws a frame with `draw`, which gets an empty buffer. Skips it while the last one is being written.
    pub(crate) fn frame(&mut self, draw: impl FnOnce(&mut Buffer)) -> io::Result<()> {
        if self.pen.failed.load(Ordering::SeqCst) {
            return Err(io::Error::new(io::ErrorKind::BrokenPipe, "the terminal is gone"));
        }
        if self.pen.busy.load(Ordering::SeqCst) {
            return Ok(());
        }
        *lock(&OWNER) = Some(thread::current().id());
        if !HELD.swap(true, Ordering::SeqCst) {
            // A panic restored the terminal, but was caught: the run goes on.
            enter(&mut output()?)?;
            self.redraw();
        }
        let size = self.backend.size()?;
        let area = Rect::new(0, 0, size.width, size.height);
        if area != self.shown.area {
            self.shown = Buffer::empty(area);
            self.next = Buffer::empty(area);
            self.backend.clear_region(ClearType::All)?;
        }
        self.next.reset();
        draw(&mut self.next);
        let changes = self.shown.diff(&self.next);
        if !changes.is_empty() {
            self.backend.draw(changes.into_iter())?;
        }
        std::mem::swap(&mut self.shown, &mut self.next);
        let page = std::mem::take(&mut *lock(&self.sheet.0));
        self.write(page);
        Ok(())
    }

    /// Messages of panics of other threads since the last call. They are also printed when the terminal is
    /// restored.
    pub(crate) fn said(&mut self) -> Vec<String> {
        let said = std::mem::take(&mut *lock(&SAID));
        let room = PANICS.saturating_sub(self.said.len());
        self.said.extend(said.iter().take(room).cloned());
        said
    }

    /// Clears the screen before the next frame.
    pub(crate) fn redraw(&mut self) {
        self.shown = Buffer::default();
    }

    fn write(&self, page: Vec<u8>) {
        if !page.is_empty() {
            self.pen.busy.store(true, Ordering::SeqCst);
            if self.pages.try_send(page).is_err() {
                self.pen.busy.store(false, Ordering::SeqCst);
            }
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let until = Instant::now() + PATIENCE;
        while self.pen.busy.load(Ordering::SeqCst) && Instant::now() < until {
            thread::sleep(Duration::from_millis(2));
        }
        self.said();
        if self.pen.busy.load(Ordering::SeqCst) && HELD.swap(false, Ordering::SeqCst) {
            // The terminal does not read. It gets the rest if it ever does.
            let mut page = Vec::new();
            let _ = leave(&mut page);
            let _ = self.pages.try_send(page);
            let _ = disable_raw_mode();
            return;
        }
        restore();
        for panic in &self.said {
            // Not eprintln, which panics where standard error is gone.
            let _ = writeln!(io::stderr(), "{panic}");
        }
    }
}

fn enter(out: &mut impl Write) -> io::Result<()> {
    enable_raw_mode()?;
    execute!(out, EnterAlternateScreen, terminal::DisableLineWrap, cursor::Hide)
}

fn leave(out: &mut impl Write) -> io::Result<()> {
    execute!(out, terminal::EnableLineWrap, LeaveAlternateScreen, cursor::Show)
}

/// Restores the terminal, once.
fn restore() {
    if HELD.swap(false, Ordering::SeqCst) {
        // Errors are ignored: the terminal may be gone.
        if let Ok(mut out) = output() {
            let _ = leave(&mut out);
        }
        let _ = disable_raw_mode();
    }
}

/// Standard output without the lock and the line buffer of [`io::stdout`], which a slow terminal would block.
fn output() -> io::Result<File> {
    #[cfg(unix)]
    let own = std::os::fd::AsFd::as_fd(&io::stdout()).try_clone_to_owned()?;
    #[cfg(windows)]
    let own = std::os::windows::io::AsHandle::as_handle(&io::stdout()).try_clone_to_owned()?;
    Ok(own.into())
}

/// Restores the terminal when the drawing thread or the main thread panics, before the message is printed:
/// either may end the program without a drop. Messages of other threads would spoil the screen and are
/// kept for [`Screen::said`].
fn install_hook() {
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !HELD.load(Ordering::SeqCst) {
            return before(info);
        }
        let here = thread::current();
        let owner = OWNER.try_lock().is_ok_and(|owner| *owner == Some(here.id()));
        if owner || here.name() == Some("main") {
            restore();
            return before(info);
        }
        if let Ok(mut said) = SAID.try_lock()
            && said.len() < PANICS
        {
            let what = info.payload_as_str().unwrap_or("no message");
            let place =
                info.location().map(|at| format!(" ({}:{})", at.file(), at.line())).unwrap_or_default();
            said.push(format!("thread {} panicked: {what}{place}", here.name().unwrap_or("without a name")));
        }
    }));
}
