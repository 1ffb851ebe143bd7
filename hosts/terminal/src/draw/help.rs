//! The keys, over everything else.

use super::pane::{BOLD, FAINT, PLAIN, Pane};
use crate::keys::HELP;

pub(crate) fn draw(all: &mut Pane) {
    let (width, height) = (62.min(all.width()), (HELP.len() + 5).min(all.height()));
    let (left, top) = ((all.width() - width) / 2, (all.height() - height) / 2);
    let mut pane = all.part(left, top, width, height);
    pane.blank();
    let line = "─".repeat(width - 2);
    for (row, [from, to]) in [(0, ["┌", "┐"]), (height - 1, ["└", "┘"])] {
        pane.words(0, row, &[(from, FAINT), (&line, FAINT), (to, FAINT)]);
    }
    for row in 1..height - 1 {
        pane.put(0, row, 1, "│", FAINT);
        pane.put(width - 1, row, 1, "│", FAINT);
    }
    pane.put(2, 0, width, " keys ", BOLD);
    for (row, (keys, what)) in HELP.iter().enumerate() {
        pane.put(3, row + 2, 16, keys, BOLD);
        pane.put(20, row + 2, width - 22, what, PLAIN);
    }
    pane.put(3, height - 2, width - 6, "! marks what was lost or too late in the last 2 s.", FAINT);
}
