//! A pen that goes round on the page of a run; needs `chromium` beside it.
#![allow(dead_code, unreachable_pub)]

use std::time::{Duration, Instant};

use serde_json::json;

use crate::chromium::{Chromium, Look};

/// Millimetres of a CSS pixel.
pub const MM: f64 = 25.4 / 96.0;
/// Radius of a stroke in pixels.
pub const RADIUS: f64 = 60.0;
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
        let (began, mut last) = (Instant::now(), 0.0);
        for i in 1.. {
            std::thread::sleep((Duration::from_millis(4) * i).saturating_sub(began.elapsed()));
            let now = began.elapsed().as_secs_f64();
            self.turn += speed_mm_s / (RADIUS * MM) * (now - last);
            last = now;
            let at = [self.middle[0] + RADIUS * self.turn.cos(), self.middle[1] + RADIUS * self.turn.sin()];
            self.browser.pen(if self.down { "mouseMoved" } else { "mousePressed" }, at, 0.5);
            self.down = true;
            if now > seconds {
                return;
            }
        }
    }

    pub fn lifts(&mut self) {
        self.browser.pen("mouseReleased", self.middle, 0.0);
        self.down = false;
    }

    /// Runs a script on the page without waiting for it, so that the stroke goes on.
    pub fn does(&mut self, script: &str) {
        self.browser.send("Runtime.evaluate", json!({ "expression": script }));
    }
}
