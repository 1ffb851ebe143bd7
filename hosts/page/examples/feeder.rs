//! Shows the page with a run that is made up: `cargo run -p asperity-page --example feeder`. What a hand does on it is heard
//! back in the figures.

#[path = "../../../tests/live/page_server/made_up.rs"]
mod made_up;

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_live::{Reins, samples};
use asperity_page::{Feed, Options, serve};

fn main() -> std::io::Result<()> {
    let (to, from) = samples();
    let reins = Reins::default();
    let feed = Arc::new(Feed::new());
    let port = std::env::args().nth(1).and_then(|port| port.parse().ok()).unwrap_or(0);
    let page = serve(Options { port, token: None }, feed.clone(), reins.clone(), Some(to))?;
    println!("{}", page.url());
    let mut run = made_up::Run::new(Some(from));
    feed.publish_layout(run.layout.clone());
    let began = Instant::now();
    for n in 0u32.. {
        if reins.stopping() {
            return Ok(());
        }
        run.muted = reins.muted();
        for request in reins.asked() {
            println!("{request:?}");
            run.asked(&request);
            feed.publish_layout(run.layout.clone());
        }
        feed.publish(run.view());
        let next = Duration::from_secs(1) * n / 60;
        std::thread::sleep(next.saturating_sub(began.elapsed()));
    }
    Ok(())
}
