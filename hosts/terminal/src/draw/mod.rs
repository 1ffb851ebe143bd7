//! One frame of a [`Board`].

mod nodes;
pub(crate) mod pane;
mod parameters;
mod scopes;
mod side;
mod timing;
mod title;

use std::time::Duration;

use ratatui::buffer::Buffer;

use crate::board::{Board, Tab};
use crate::keys::HELP;
use pane::{ALARM, BOLD, FAINT, PLAIN, Pane};

/// Least size of the terminal.
const LEAST: (usize, usize) = (72, 20);
/// From this many rows on, nodes, scopes and parameters are all visible.
const TALL: usize = 36;
/// From this many columns on, they stand side by side.
const WIDE: usize = 110;

impl Board {
    /// Draws the frame of `time` into an empty buffer.
    pub(crate) fn draw(&mut self, buffer: &mut Buffer, time: Duration) {
        let mut all = Pane::all(buffer);
        let (width, height) = (all.width(), all.height());
        if width < LEAST.0 || height < LEAST.1 {
            self.draw_small(&mut all, time);
            return;
        }
        title::draw(self, &mut all.part(0, 0, width, 2), time);
        let notes = if height >= TALL { height / 12 } else { 1 };
        let body = height - 3 - notes;
        self.draw_body(&mut all.part(0, 2, width, body), time);
        self.draw_notes(&mut all.part(0, 2 + body, width, notes));
        title::draw_keys(self, &mut all.part(0, height - 1, width, 1), height < TALL);
        if self.help {
            draw_help(&mut all);
        }
    }

    fn draw_body(&mut self, body: &mut Pane, time: Duration) {
        let (width, height) = (body.width(), body.height());
        let tall = height + 4 >= TALL;
        let top = if tall { (height / 4).clamp(8, 16) } else { 8 + height.saturating_sub(20) / 3 };
        self.draw_top(&mut body.part(0, 0, width, top), time);
        let rest = height - top;
        self.all_seen = tall;
        if !tall {
            let mut pane = body.part(0, top, width, rest);
            match self.tab {
                Tab::Nodes => nodes::draw(self, &mut pane, time),
                Tab::Scopes => scopes::draw(self, &mut pane),
                Tab::Parameters => parameters::draw(self, &mut pane),
            }
            return;
        }
        // Nodes and parameters take the rows they need. Scopes get the rest, at least a third.
        let list = (self.layout.nodes.len() + 2).max(9).min(rest * 3 / 5);
        if width >= WIDE {
            let wanted = self.names.iter().sum::<usize>() + nodes::REST;
            let left = (width * 2 / 3).min(wanted.max(78)).min(width - 40);
            nodes::draw(self, &mut body.part(0, top, left, list), time);
            parameters::draw(self, &mut body.part(left + 1, top, width, list));
            scopes::draw(self, &mut body.part(0, top + list, width, rest));
        } else {
            let left = width * 9 / 20;
            nodes::draw(self, &mut body.part(0, top, width, list), time);
            parameters::draw(self, &mut body.part(0, top + list, left, rest));
            scopes::draw(self, &mut body.part(left + 1, top + list, width, rest));
        }
    }

    fn draw_top(&self, top: &mut Pane, time: Duration) {
        let (width, height) = (top.width(), top.height());
        if width >= WIDE {
            let timing = (width * 2 / 5).max(48);
            // The rest is for the sources.
            let latency = width.saturating_sub(timing + 42).clamp(22, 44);
            timing::draw(self, &mut top.part(0, 0, timing, height), time);
            side::latency(self, &mut top.part(timing + 1, 0, latency, height));
            side::sources(self, &mut top.part(timing + latency + 2, 0, width, height), time);
        } else {
            let left = width * 21 / 40;
            timing::draw(self, &mut top.part(0, 0, left, height), time);
            let lines = height / 2;
            side::latency(self, &mut top.part(left + 1, 0, width, lines));
            side::sources(self, &mut top.part(left + 1, lines, width, height), time);
        }
    }

    fn draw_notes(&self, pane: &mut Pane) {
        let rows = pane.height();
        for (row, (seconds, text)) in
            self.notes.iter().skip(self.notes.len().saturating_sub(rows)).enumerate()
        {
            let column = 1 + pane.put(0, row, 14, &format!(" {}", crate::text::clock(*seconds)), FAINT);
            pane.put(column, row, usize::MAX, text, PLAIN);
        }
    }

    fn draw_small(&self, all: &mut Pane, time: Duration) {
        let (width, height) = (all.width(), all.height());
        let (word, style) = title::condition(self.view.condition);
        all.put(0, 0, width, &format!(" {word} "), style);
        let small = format!("The terminal is too small: {width} x {height}.");
        all.put(0, 1, width, &small, BOLD);
        all.put(0, 2, width, &format!("The figures need {} x {}.", LEAST.0, LEAST.1), PLAIN);
        let bad: u64 = self.counts.iter().map(|count| count.risen(time)).fold(0, u64::saturating_add);
        if bad > 0 {
            all.put(0, 3, width, "! something was lost", ALARM);
        }
        all.put(0, height.saturating_sub(1).max(4), width, "q stop  space mute", FAINT);
    }
}

/// The help: all keys, over the rest of the frame.
fn draw_help(all: &mut Pane) {
    let (width, height) = (62.min(all.width()), (HELP.len() + 5).min(all.height()));
    let (left, top) = ((all.width() - width) / 2, (all.height() - height) / 2);
    let mut pane = all.part(left, top, width, height);
    pane.frame(" keys ");
    for (row, (keys, action)) in HELP.iter().enumerate() {
        pane.put(3, row + 2, 16, keys, BOLD);
        pane.put(20, row + 2, width - 22, action, PLAIN);
    }
    pane.put(3, height - 2, width - 6, "! marks a loss or a deadline miss of the last 2 s.", FAINT);
}

#[cfg(test)]
mod tests;
