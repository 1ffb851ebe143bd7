//! A device that plays silence until it is given something to play.

use asperity_audio::{Block, Process};
use ringbuf::traits::{Consumer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

/// What a device calls from its start on.
pub(super) struct Switch {
    from: HeapCons<Box<dyn Process>>,
    process: Option<Box<dyn Process>>,
}

/// Gives a device what it is to play, once.
pub(super) struct Give(HeapProd<Box<dyn Process>>);

/// A switch, and the hand on it.
pub(super) fn switch() -> (Give, Switch) {
    let (to, from) = HeapRb::new(1).split();
    (Give(to), Switch { from, process: None })
}

impl Give {
    pub(super) fn give(&mut self, process: Box<dyn Process>) {
        // There is room: it is given once.
        let _ = self.0.try_push(process);
    }
}

impl Process for Switch {
    fn process(&mut self, block: &mut Block<'_>) {
        if self.process.is_none() {
            self.process = self.from.try_pop();
        }
        if let Some(process) = &mut self.process {
            process.process(block);
        }
    }
}
