//! A made-up run in the terminal, to look at: `demo`; or one frame of it as a picture: `demo FILE.svg [COLUMNS ROWS]`.

mod plausible;

use std::error::Error;
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

use asperity_live::view::{Condition, Request};
use asperity_terminal::{Terminal, picture};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let Some(file) = args.first() {
        let size = |k: usize, else_: u16| args.get(k).map_or(Ok(else_), |text| text.parse());
        let view = plausible::view(83.6, 2.0);
        let text = picture::svg_of(&view, &plausible::layout(), size(1, 120)?, size(2, 40)?);
        return Ok(std::fs::write(file, text)?);
    }
    let (requests, asked) = sync_channel(16);
    let mut terminal = Terminal::open(requests)?;
    terminal.layout(&plausible::layout());
    terminal.note("a made-up run: no device, no graph");
    let (start, mut before, mut mute) = (Instant::now(), 0.0, false);
    loop {
        let seconds = start.elapsed().as_secs_f64();
        let mut view = plausible::view(seconds, seconds - before);
        if mute {
            (view.condition, view.peak) = (Condition::Muted, 0.0);
        }
        before = seconds;
        terminal.draw(&view)?;
        for request in asked.try_iter() {
            match request {
                Request::Stop => return Ok(()),
                Request::Mute(wanted) => mute = wanted,
                other => terminal.note(&format!("{other:?}")),
            }
        }
        std::thread::sleep(Duration::from_millis(33));
    }
}
