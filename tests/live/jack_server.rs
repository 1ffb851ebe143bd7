//! `asperity run` on a real JACK server, heard sample by sample beside the same graph rendered offline.

use harness::live::told;
use harness::servers::{Jack, inside};
use harness::test_name;

use crate::ear::Ear;
use crate::played::{is_as_rendered, play, report, write_graph};

/// Plays for some seconds in real time, then for some as fast as the server goes.
fn plays_what_is_rendered(clock: &str, seconds: usize, wheeled: usize) {
    const RATE: usize = 48_000;
    told(|| {
        let dir = tempfile::tempdir().unwrap();
        write_graph(dir.path(), RATE as u32);
        let ear = Ear::new((seconds + wheeled + 30) * RATE);
        let mut program = play(dir.path(), &["--host", "jack"]);
        ear.hear(program.id());
        ear.wait(seconds * RATE);
        if wheeled > 0 {
            ear.freewheel(wheeled * RATE);
        }
        program.signal("INT");
        program.end().ok();
        // Silence to the end is heard too.
        ear.wait(RATE / 10);
        assert_eq!(report(dir.path())["clock"], clock);
        is_as_rendered(dir.path(), &ear.stop(), RATE as u32, (seconds + wheeled) as f64 - 1.0)
    });
}

/// Freewheel is for the callback clock: a paced thread keeps to time.
#[test]
fn callback_on_jack_plays_every_sample_also_in_freewheel() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    plays_what_is_rendered("callback", 4, 8);
}

#[test]
fn paced_thread_plays_every_sample_at_1024_frames() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 1024)) else { return };
    plays_what_is_rendered("paced", 5, 0);
}
