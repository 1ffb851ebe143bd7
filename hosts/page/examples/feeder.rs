//! Shows the page with a run that is made up: `cargo run -p asperity-page --example feeder`. What a hand does on it is heard
//! back in the figures.

#[path = "../tests/made_up/mod.rs"]
mod made_up;

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_live::samples;
use asperity_page::{Feed, Options, serve};

fn main() -> std::io::Result<()> {
    let (to, from) = samples();
    let (ask, asked) = std::sync::mpsc::sync_channel(64);
    let feed = Arc::new(Feed::new());
    let port = std::env::args().nth(1).and_then(|port| port.parse().ok()).unwrap_or(0);
    let page = serve(Options { port, token: None }, feed.clone(), ask, Some(to))?;
    println!("{}", page.url());
    let mut run = made_up::Run::new(Some(from));
    feed.publish_layout(run.layout.clone());
    let began = Instant::now();
    for n in 0u32.. {
        while let Ok(request) = asked.try_recv() {
            println!("{request:?}");
            if request == asperity_live::view::Request::Stop {
                return Ok(());
            }
            run.asked(&request);
            feed.publish_layout(run.layout.clone());
        }
        feed.publish(run.view());
        let next = Duration::from_secs(1) * n / 60;
        std::thread::sleep(next.saturating_sub(began.elapsed()));
    }
    Ok(())
}
