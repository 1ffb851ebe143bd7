//! Who looks at a run: the live page, the terminal, or lines of text.

use std::sync::Arc;

use asperity_live::Reins;
use asperity_live::view::{Layout, View};
use asperity_page::{Feed, Page, serve};
use asperity_terminal::Terminal;

use super::hands::Hands;
use super::speaker::Speaker;
use crate::args::Run;
use crate::failure::Failure;

/// The page and the terminal, which hold the reins of the run.
pub struct Shows {
    page: Option<(Page, Arc<Feed>)>,
    terminal: Option<Terminal>,
    layout: Option<Layout>,
    speaker: Speaker,
    begun: bool,
}

impl Shows {
    /// Opens what the command line asks for: before there is an engine, whose way with panics is to be the outer one.
    pub fn open(args: &Run, reins: &Reins, hands: &mut Hands) -> Result<Self, Failure> {
        let pointer = hands.take_pointer();
        let speaker = Speaker::new(args.quiet || args.tui);
        let page = match args.page {
            Some(port) => {
                let feed = Arc::new(Feed::new());
                let options = asperity_page::Options { port, ..asperity_page::Options::default() };
                let page = serve(options, feed.clone(), reins.clone(), pointer)
                    .map_err(|e| Failure::Machine(format!("cannot serve the page at port {port}: {e}")))?;
                speaker.say(&format!("the page: {}", page.url()));
                Some((page, feed))
            }
            None => None,
        };
        let terminal = match args.tui {
            true => Some(
                Terminal::open(reins.clone())
                    .map_err(|e| Failure::Machine(format!("cannot draw in the terminal: {e}")))?,
            ),
            false => None,
        };
        let mut it = Self { page, terminal, layout: None, speaker, begun: false };
        if let (Some((page, _)), Some(terminal)) = (&it.page, &mut it.terminal) {
            terminal.note(&format!("the page: {}", page.url()));
        }
        Ok(it)
    }

    /// Says something to whoever looks.
    pub fn say(&mut self, text: &str) {
        match &mut self.terminal {
            Some(terminal) => terminal.note(text),
            None => self.speaker.say(text),
        }
    }

    /// Shows figures of the moment, and the graph where it changed.
    pub fn show(&mut self, view: View, layout: &Layout, hands: &mut Hands) {
        if let Some(pointer) = hands.take_pointer() {
            match &self.page {
                Some((page, _)) => page.set_pointer(Some(pointer)),
                None => {
                    self.say("warning: there is a pointer now, and no page to move it on: start with --page")
                }
            }
        }
        if self.layout.as_ref() != Some(layout) {
            if let Some((page, feed)) = &self.page {
                if layout.nodes.iter().all(|node| node.kind != "pointer_input") {
                    page.set_pointer(None);
                }
                feed.publish_layout(layout.clone());
            }
            if let Some(terminal) = &mut self.terminal {
                terminal.layout(layout);
            }
            self.layout = Some(layout.clone());
        }
        if !self.begun && !view.clock.is_empty() && (view.period_frames > 0 || view.device.is_empty()) {
            self.begun = true;
            let text = begins(&view, layout);
            self.say(&text);
        }
        if let Some(terminal) = &mut self.terminal
            && terminal.draw(&view).is_err()
        {
            // Nobody can see it any more.
            self.terminal = None;
        }
        if let Some((_, feed)) = &self.page {
            feed.publish(view);
        }
    }

    /// Gives the terminal back and closes the page.
    pub fn close(self) {
        self.speaker.close();
    }
}

/// How the run goes, in a line.
fn begins(view: &View, layout: &Layout) -> String {
    if view.device.is_empty() {
        return format!("runs at {} ticks/s without audio; Ctrl-C stops", layout.tick_hz);
    }
    format!(
        "plays on {}: {} Hz, {} frames at a time, {} ticks/s by the {} clock; Ctrl-C stops",
        view.device, layout.audio_hz, view.period_frames, layout.tick_hz, view.clock
    )
}
