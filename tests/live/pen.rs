//! A pen that goes round on the page of a run; needs `chromium` beside it.

use std::time::{Duration, Instant};

use harness::chromium::{Chromium, Look};

/// Millimetres of a CSS pixel.
pub const MM: f64 = 25.4 / 96.0;
/// Radius of a stroke in pixels.
pub const RADIUS: f64 = 60.0;
/// Between two events of the pen.
const EVERY: Duration = Duration::from_millis(4);
/// Longest delay that it makes up for. Events that come in a bunch have no speed.
const BEHIND: Duration = Duration::from_millis(12);
/// Longest time that the page may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// A page on which a pen goes round.
pub struct Pen {
    pub browser: Chromium,
    pub middle: [f64; 2],
    pub turn: f64,
    down: bool,
}

impl Pen {
    pub fn over(mut browser: Chromium, url: &str) -> Self {
        browser.look(&Look { width: 1200, height: 800, dark: false });
        browser.open(url);
        browser.until("document.querySelector('#condition').dataset.is === 'playing'");
        let middle = browser.middle("#surface");
        Self { browser, middle, turn: 0.0, down: false }
    }

    /// Goes round for so long, 250 events a second.
    pub fn strokes(&mut self, seconds: f64, speed_mm_s: f64) {
        let began = Instant::now();
        self.strokes_while(speed_mm_s, |_| began.elapsed().as_secs_f64() <= seconds);
    }

    /// Goes round until an expression is true on the page.
    pub fn strokes_until(&mut self, speed_mm_s: f64, script: &str) {
        let (began, mut asked) = (Instant::now(), None);
        self.strokes_while(speed_mm_s, |browser| {
            assert!(began.elapsed() < PATIENCE, "waited too long: {script}");
            let id = *asked.get_or_insert_with(|| browser.asks(script));
            let Some(answer) = browser.answer(id) else { return true };
            assert!(answer["exceptionDetails"].is_null(), "{script}: {answer}");
            asked = None;
            answer["result"]["value"] != true
        });
    }

    /// Goes round while it is told to: after a pause of this machine from where it should be by then.
    fn strokes_while(&mut self, speed_mm_s: f64, mut on: impl FnMut(&mut Chromium) -> bool) {
        let (began, mut last) = (Instant::now(), 0.0);
        let mut next = Duration::ZERO;
        while on(&mut self.browser) {
            next = (next + EVERY).max(began.elapsed().saturating_sub(BEHIND));
            std::thread::sleep(next.saturating_sub(began.elapsed()));
            let now = began.elapsed().as_secs_f64();
            self.turn += speed_mm_s / (RADIUS * MM) * (now - last);
            last = now;
            let at = [self.middle[0] + RADIUS * self.turn.cos(), self.middle[1] + RADIUS * self.turn.sin()];
            self.browser.pen(if self.down { "mouseMoved" } else { "mousePressed" }, at, 0.5);
            self.down = true;
        }
    }

    pub fn lifts(&mut self) {
        self.browser.pen("mouseReleased", self.middle, 0.0);
        self.down = false;
    }

    /// Runs a script on the page without waiting for it, so that the stroke goes on.
    pub fn does(&mut self, script: &str) {
        self.browser.asks(script);
    }
}
