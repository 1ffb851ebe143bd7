//! A made-up run in the terminal, to look at: `demo`; or one frame of it as a picture: `demo FILE.svg [COLUMNS ROWS]`.

mod plausible;

use std::error::Error;
use std::time::{Duration, Instant};

use asperity_live::Reins;
use asperity_live::view::Condition;
use asperity_terminal::{Terminal, picture};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let Some(file) = args.first() {
        let size = |k: usize, else_: u16| args.get(k).map_or(Ok(else_), |text| text.parse());
        let view = plausible::view(83.6, 2.0);
        let text = picture::svg_of(&view, &plausible::layout(), size(1, 120)?, size(2, 40)?);
        return Ok(std::fs::write(file, text)?);
    }
    let reins = Reins::default();
    let mut terminal = Terminal::open(reins.clone())?;
    terminal.layout(&plausible::layout());
    terminal.note("a made-up run: no device, no graph");
    let (start, mut before) = (Instant::now(), 0.0);
    while !reins.stopping() {
        let seconds = start.elapsed().as_secs_f64();
        let mut view = plausible::view(seconds, seconds - before);
        if reins.muted() {
            (view.condition, view.muted, view.peak) = (Condition::Muted, true, 0.0);
        }
        before = seconds;
        terminal.draw(&view)?;
        for request in reins.asked() {
            terminal.note(&format!("{request:?}"));
        }
        std::thread::sleep(Duration::from_millis(33));
    }
    Ok(())
}
